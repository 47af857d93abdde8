"""Work on segments shared with a second process: the same results, whatever befalls it."""

from __future__ import annotations

import gc
import os
import weakref
from collections.abc import Iterator
from dataclasses import replace
from multiprocessing import parent_process

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.effect import Effect
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.noise_floors import form_tolerance
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.regression.parallel import by_threads, in_order, on_each
from pipeline.criticism.residuals.segments import segments
from pipeline.execution.workers import segment_worker as segment_worker_module
from pipeline.execution.workers.pools import Cluster, core_count, open_pool
from pipeline.execution.workers.segment_worker import (
    SegmentWorker,
    open_own,
    segment_worker,
    shared_or_in_order,
)
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from tests.unit.criticism.machines import BASE, machine

two_cores = pytest.mark.skipif(core_count() < 2, reason="a second worker needs a second core")


def workers(test):
    """A test that starts worker processes, where there is a core for one."""
    return pytest.mark.workers(two_cores(test))


def slow_turn(number: int) -> Capture:
    t = np.arange(16_000 + 4_000 * number) * 1e-3
    theta = 2 * np.pi * t / 8.0
    torque = 0.01 * np.sin(84 * theta) + np.random.default_rng(number).normal(0, 1e-4, t.size)
    table = pl.DataFrame({"t_s": t, "theta_mech_rad": theta, "torque_shaft_nm": torque})
    return Capture(f"{number}.mcap", "0", "verified", CaptureMeta("m", "cogging"), (table,))


@pytest.fixture(scope="module")
def found():
    return segments(Campaign("m", tuple(slow_turn(n) for n in range(4))), machine())


@pytest.fixture(scope="module")
def process(_on_one_core) -> Iterator[SegmentWorker]:
    """A worker process that several tests share, since starting one takes seconds."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("pipeline.execution.workers.pools.local_pool", _on_one_core)
        with segment_worker(None) as made:
            yield made


@pytest.fixture
def second(process) -> SegmentWorker:
    """A test's own state before the shared process."""
    return SegmentWorker(process._executor)


def whose(segment, _) -> bool:
    """Whether a worker did it."""
    return parent_process() is not None


def fallen(segment, _) -> float:
    """Ends the worker; here it is a number."""
    if parent_process() is not None:
        os._exit(3)
    return segment.recorded["torque_shaft_nm"].sum()


def broken(segment, _) -> float:
    raise ZeroDivisionError(segment.capture)


@workers
def test_floors_are_the_same_bits_and_in_order(found, second) -> None:
    cogging = effects()["cogging"]
    model = Model(machine(), (cogging,))
    arguments = [(model, {**BASE, **zero(cogging, model)}, seed) for seed in range(len(found))]
    alone = by_threads(noise_floor, found, arguments)
    for one, two in zip(alone, in_order(noise_floor, found, arguments), strict=True):
        np.testing.assert_array_equal(one, two)
    with second.campaign():
        for _ in range(2):  # the second time the worker has the segments already
            for one, two in zip(alone, on_each(noise_floor, found, arguments), strict=True):
                np.testing.assert_array_equal(one, two)


@workers
def test_half_of_the_samples_are_the_workers(found, second) -> None:
    with second.campaign():
        theirs = on_each(whose, found, [(0,)] * len(found))
    sizes = np.array([one.size for one in found])
    assert 0.4 < sizes[np.array(theirs)].sum() / sizes.sum() < 0.6
    assert not any(on_each(whose, found, [(0,)] * len(found)))


@workers
def test_a_segment_of_more_signals_is_more_work(found, second) -> None:
    (channel,) = found[3].channels
    three = replace(found[3], channels=(channel,) * 3)
    with second.campaign():
        theirs = on_each(whose, [three, *found[:3]], [(0,)] * 4)
    assert theirs == (theirs[0], *(not theirs[0],) * 3)


@workers
def test_a_segment_stays_with_its_process(found, second) -> None:
    """Whatever joins or leaves: a process keeps what it computed, and last bits depend on it."""
    with second.campaign():
        alone = [on_each(whose, [one, found[0]], [(0,)] * 2)[0] for one in found[1:]]
        _, *together = on_each(whose, found, [(0,)] * len(found))
    assert together == alone
    assert {True, False} == set(together)


@workers
def test_a_user_s_effect_from_a_folder_goes_along(found, tmp_path) -> None:
    (tmp_path / "tenth.py").write_text(
        "from pipeline.criticism.effects.coulomb_friction import EFFECT as KNOWN\n"
        "from dataclasses import replace\n"
        "def torque(x, q):\n"
        "    return 0.1 * q['torque_nm'] * x.omega_rad_s\n"
        "EFFECT = replace(KNOWN, name='tenth', torque=torque)\n"
    )
    tenth = effects(str(tmp_path))["tenth"]
    with segment_worker(str(tmp_path)) as own:
        assert _tolerances_shared(found, tenth, own)


@workers
def test_an_effect_made_on_the_way_is_worked_on_there(found, second) -> None:
    """What a search draws of a residual is functions that no module has by name."""
    made = replace(
        effects()["coulomb_friction"], torque=lambda x, q: q["torque_nm"] * x.omega_rad_s
    )
    assert _tolerances_shared(found, made, second)


@workers
def test_an_effect_whose_module_the_worker_lacks_is_worked_on_here(found, second, tmp_path) -> None:
    (tmp_path / "later.py").write_text(
        "from pipeline.criticism.effects.coulomb_friction import EFFECT as KNOWN\n"
        "from dataclasses import replace\n"
        "def torque(x, q):\n"
        "    return 0.1 * q['torque_nm'] * x.omega_rad_s\n"
        "EFFECT = replace(KNOWN, name='later', torque=torque)\n"
    )
    assert not _tolerances_shared(found, effects(str(tmp_path))["later"], second)


def _tolerances_shared(found, effect: Effect, second: SegmentWorker) -> bool:
    """Whether the worker is in use after work on an effect, which must come out right."""
    model = Model(machine(), (effect,))
    values = {**BASE, **zero(effect, model), f"{effect.name}.torque_nm": 0.02}
    arguments = [(model, values, (effect,))] * len(found)
    alone = by_threads(form_tolerance, found, arguments)
    with second.campaign():
        for one, two in zip(alone, on_each(form_tolerance, found, arguments), strict=True):
            np.testing.assert_array_equal(one, two)
            assert one.max() > 0
        return any(on_each(whose, found, [(0,)] * len(found)))


@workers
def test_the_death_of_the_worker_loses_nothing(found) -> None:
    with segment_worker(None) as second, second.campaign():
        sums = on_each(fallen, found, [(0,)] * len(found))
        assert sums == tuple(one.recorded["torque_shaft_nm"].sum() for one in found)
        assert not any(on_each(whose, found, [(0,)] * len(found)))


def test_an_error_of_the_work_itself_is_raised(found) -> None:
    with (
        segment_worker(None) as second,
        second.campaign(),
        pytest.raises(ZeroDivisionError, match=r"\.mcap"),
    ):
        on_each(broken, found, [(0,)] * len(found))


def shared_in_a_worker(found) -> tuple[bool, ...]:
    """Which segments a worker's own segment worker did; whose driver is a worker itself."""
    open_own()
    with shared_or_in_order():
        return on_each(whose_grandchild, found, [(os.getpid(),)] * len(found))


def whose_grandchild(segment, worker: int) -> bool:
    return os.getpid() != worker


@pytest.mark.slow
@workers
def test_a_worker_s_own_segment_worker_shares_its_work_and_ends_with_it(found) -> None:
    """A worker waits for its children when it ends: one that was not told to end would hang it."""
    with open_pool("local", Cluster())(1) as pool:
        theirs = pool.executor.submit(shared_in_a_worker, found).result()
    assert set(theirs) == {True, False}


def test_in_a_driver_there_is_no_segment_worker_of_its_own(found) -> None:
    open_own()
    with shared_or_in_order():
        assert not any(on_each(whose, found, [(0,)] * len(found)))


def test_segments_that_are_forgotten_go_with_what_refers_to_them(monkeypatch) -> None:
    (turn,) = segments(Campaign("m", (slow_turn(1),)), machine())
    turn.cache["sampler"] = turn, np.zeros(8)
    left = weakref.ref(turn.cache)
    monkeypatch.setitem(segment_worker_module._SEGMENTS, 1, turn)
    gc.disable()
    try:
        del turn
        segment_worker_module._forget()
        assert left() is None
    finally:
        gc.enable()
