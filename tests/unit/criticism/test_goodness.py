"""What a fit's uncertainty and held-out error make of captures that disagree."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import _as_reported
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.cross_validation import (
    HeldOut,
    in_common,
    leave_out,
    predicted_chi2,
)
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import (
    form_error_factor,
    material_size,
    over_floor,
    remainder,
)
from pipeline.criticism.regression.identifiability import known_by
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from tests.unit.criticism.machines import BASE, fitted, log, machine, unit_floor

ROWS = 400


def captures(levels: list[float], seed: int = 4) -> LinearSystem:
    """One constant told by several captures, each off by its own level, in noise of one."""
    rng = np.random.default_rng(seed)
    group = np.repeat(np.arange(len(levels)), ROWS)
    told = np.array(levels)[group] + rng.standard_normal(group.size)
    return LinearSystem(
        columns=(Column("r_ohm", 1.0),),
        residual=told - told.mean(),
        matrix=-np.ones((group.size, 1)),
        group=group,
        window=np.tile(np.arange(ROWS), len(levels)),
        unit=np.ones(group.size),
        noise_ratio=np.ones(group.size),
        row_weight=np.ones(group.size),
        labels=tuple((n, "vq_v", 0) for n in range(len(levels))),
        prior_precision=np.zeros(1),
        prior_gradient=np.zeros(1),
        fit=Fit((log(),) * len(levels), Model(machine(), ()), {}, (), {}),
        model_column_count=1,
        made_at={},
    )


def with_column(system: LinearSystem, column) -> LinearSystem:
    """The same with a second constant, of a column [R] of its own."""
    return replace(
        system,
        columns=(*system.columns, Column("psi_wb", 1.0)),
        matrix=np.column_stack([system.matrix, column]),
        prior_precision=np.zeros(2),
        prior_gradient=np.zeros(2),
        model_column_count=2,
    )


def u(system: LinearSystem) -> float:
    return float(known_by(system, leave_out(system), np.ones(1)).u[0])


def test_captures_that_agree_are_as_sure_as_their_samples():
    found = [float(u(one)) for one in (captures([0.0] * 6, seed) for seed in range(30))]
    assert np.median(found) == pytest.approx((6 * ROWS) ** -0.5, rel=0.25)


def test_captures_that_disagree_are_not_surer_than_their_scatter():
    """Six means that scatter by s: a mean is no better known than s / sqrt 6."""
    levels = [0.3, -0.3, 0.1, -0.2, 0.25, -0.15]
    system = captures(levels)
    scatter = np.std(levels, ddof=1) / 6**0.5
    assert u(system) == pytest.approx(scatter, rel=0.3)


def test_a_fit_that_a_bound_keeps_from_its_end_is_no_surer_than_what_is_left_to_go():
    """Six captures agree on a step of 0.5 that is not done."""
    system = captures([0.0] * 6)
    held_back = replace(system, residual=system.residual + 0.5)
    assert u(held_back) == pytest.approx(0.5, rel=0.05)


def test_one_capture_alone_has_its_noise():
    system = captures([0.0])
    assert u(system) == pytest.approx(ROWS**-0.5, rel=0.1)


def test_a_column_that_one_capture_carries_predicts_nothing_better():
    """It keeps the worst capture in the fit, which is no prediction: rows count in both or none."""
    system = captures([0.0, 0.0, 0.0, 0.0, 3.0])
    own = np.random.default_rng(9).standard_normal(system.size) * (system.group == 4)
    wider = with_column(system, own)
    alone = leave_out(system), leave_out(wider)
    assert alone[1].total < 0.9 * alone[0].total
    before, after = in_common((system, wider), alone)
    assert after.total == pytest.approx(before.total, rel=0.02)
    assert np.array_equal(np.isfinite(before.residual), system.group != 4)
    assert np.array_equal(np.isfinite(after.residual), system.group != 4)


def in_quarters(system: LinearSystem) -> LinearSystem:
    """The same, every capture held out whole where that is possible, else in quarters."""
    quarters = np.arange(ROWS) * 4 // ROWS
    one_each = [
        replace(log(), capture=f"{number}.mcap", blocks=quarters, whole=True)
        for number in range(len(system.labels))
    ]
    return replace(system, fit=replace(system.fit, segments=tuple(one_each)))


def test_what_no_other_capture_tells_is_predicted_by_the_rest_of_its_own():
    """The last capture's step of its own at half of its time is in none of the others."""
    system = in_quarters(captures([0.0, 0.0, 0.0]))
    last, late = system.group == 2, system.window >= ROWS // 2
    own = (1.0 * last * np.where(system.window % 2, 1.0, -1.0))[:, None]
    stepped = replace(system, residual=system.residual + np.where(last & late, 5.0, 0.0))
    wider = with_column(stepped, own)
    held = leave_out(wider)
    assert held.divided == {"2.mcap"}
    assert np.isfinite(held.residual).all()
    assert np.std(held.residual[last]) > 2.0
    assert held.residual[~last] == pytest.approx(
        leave_out(wider, frozenset({"2.mcap"})).residual[~last]
    )


def test_a_capture_that_one_fit_predicts_by_parts_all_do():
    """By the others the last capture is 3 off, by the rest of its own it is not."""
    system = in_quarters(captures([0.0, 0.0, 3.0]))
    own = 1.0 * (system.group == 2)
    wider = with_column(system, own)
    alone = leave_out(system), leave_out(wider)
    assert alone[0].divided == frozenset()
    before, after = in_common((system, wider), alone)
    assert before.divided == after.divided == {"2.mcap"}
    assert np.mean(before.residual[own > 0]) < np.mean(alone[0].residual[own > 0]) - 0.1
    assert after.total == pytest.approx(1.0, abs=0.1)


@pytest.mark.parametrize(("times", "carries"), [(4.0, False), (6.0, True)])
def test_a_capture_without_which_a_variance_grows_fivefold_is_not_held_out(times, carries):
    """Of three captures the first has 2 (times − 1) the information of one of the others, so that
    the variance without it is `times` that with it; the other two are predicted all the same.
    """
    system = captures([0.0, 0.0, 0.0])
    strong = np.sqrt(2.0 * (times - 1.0))
    matrix = np.where(system.group == 0, strong, 1.0)[:, None] * system.matrix
    held = leave_out(replace(system, matrix=matrix, residual=0.01 * system.residual))
    assert np.array_equal(np.isfinite(held.residual), (system.group != 0) | (not carries))


def with_offsets(system: LinearSystem, u: float) -> LinearSystem:
    """An instrument for the last capture and one for all others, each with an offset of prior u."""
    last = system.group == system.group.max()
    return replace(
        system,
        columns=(*system.columns, Column("one_offset", 1.0), Column("other_offset", 1.0)),
        matrix=np.column_stack([system.matrix, -1.0 * ~last, -1.0 * last]),
        prior_precision=np.array([0.0, u**-2, u**-2]),
        prior_gradient=np.zeros(3),
        model_column_count=3,
    )


@pytest.mark.parametrize("u", [0.5, 3.0])
def test_what_instruments_may_be_off_by_is_expected_of_a_capture_held_out(u):
    """Two instruments disagree by what two offsets of u may: a row of the capture held out may be
    off by noise, both offsets and what the mean of the 800 other rows is uncertain by.
    """
    system = with_offsets(captures([0.0, 0.0, 2**0.5 * u]), u)
    held, last = leave_out(system), system.group == 2
    noise_alone = system.residual - system.residual[~last].mean()
    assert held.residual[last] == pytest.approx(noise_alone[last], abs=0.01)
    expected = np.sqrt(1.0 + 2.0 * u**2 + 1.0 / (2 * ROWS))
    assert held.widening[last] == pytest.approx(np.full(ROWS, expected), rel=0.01)
    assert held.total == pytest.approx(1.0, abs=0.06)


def test_a_fit_that_leaves_more_open_predicts_nothing_better():
    """The same error of the last capture, with and without offsets that nobody knows."""
    system = captures([0.0, 0.0, 3.0])
    loose = with_offsets(system, 3.0)
    alone, last = (leave_out(system), leave_out(loose)), system.group == 2

    def missed(systems, held):
        return [predicted_chi2(one, out)[2] for one, out in zip(systems, held, strict=True)]

    sure, vague = missed((system, loose), alone)
    assert vague < 0.2 * sure
    assert alone[1].residual[last] == pytest.approx(alone[0].residual[last], abs=0.01)
    together = missed((system, loose), in_common((system, loose), alone))
    assert together == pytest.approx([sure, sure], rel=0.01)


def test_at_standstill_a_voltage_is_measured_by_what_is_there():
    """Half a per cent of R i at standstill is told, however high the machine's own voltage is."""
    running = log()
    still = {
        n: 0.2 * running.recorded[n] / np.abs(running.recorded[n]).max() for n in ("vd_v", "vq_v")
    }
    standing = replace(running, recorded={**running.recorded, **still})
    fit = Fit((running,), Model(machine(), ()), dict(BASE), (unit_floor(running),), dict(BASE))
    volt, torque = (running.channels[n] for n in (0, 2))
    assert material_size(running, volt, fit) == pytest.approx(5e-4 * 20.0)
    assert material_size(standing, volt, fit) == pytest.approx(5e-3 * 0.2)
    assert material_size(standing, volt, fit, large=True) == pytest.approx(5e-4 * 20.0)
    assert material_size(standing, torque, fit) == material_size(running, torque, fit)


@pytest.mark.parametrize(("share", "matters"), [(0.8, False), (1.3, True)])
def test_what_is_over_the_floor_is_told_even_where_it_is_too_small_to_matter(share, matters):
    """A held-out error far over the floor has to be somewhere."""
    running = log()
    fit = Fit((running,), Model(machine(), ()), dict(BASE), (unit_floor(running),), dict(BASE))
    system = linear_system(fit)
    place = next(n for n, label in enumerate(system.labels) if label[1:] == ("torque_shaft_nm", 0))
    mine = system.group == place
    limit = material_size(running, "torque_shaft_nm", fit)
    small = np.where(mine, 0.1 * limit, 1.0)
    left = np.where(mine, np.hypot(share, 0.1) * limit / small, 0.0)
    off = replace(system, unit=small, residual=left)
    (told,) = over_floor(off)
    assert told.size == pytest.approx(share * limit)
    assert told.matters == matters
    assert remainder(off) == ((told,) if matters else ())
    page = _as_reported(off, ())
    assert [(one.signal, one.matters) for one in page] == [("torque_shaft_nm", False)]
    assert over_floor(replace(off, residual=np.where(mine, 1.2, 0.0))) == ()


def test_a_window_that_no_floor_is_sure_of_hides_no_other_one():
    """One window is 90 floors off, and the floor of another is a hundred times theirs: what is over
    counts as in a mean that is weighted as its significance is.
    """
    running, floor = log(), 1e-3
    plain = linear_system(fitted((running,)))
    place = plain.labels.index((0, "torque_shaft_nm", 0))
    rows = np.flatnonzero(plain.group == place)
    unit = plain.unit.copy()
    unit[rows] = floor
    ratio, residual = plain.noise_ratio.copy(), np.zeros(plain.size)
    ratio[rows], ratio[rows[0]], residual[rows[1]] = 1.0, 100.0, 90.0
    system = replace(plain, unit=unit, noise_ratio=ratio, residual=residual)
    (told,) = (one for one in over_floor(system) if one.signal == "torque_shaft_nm")
    assert told.size == pytest.approx(90.0 * floor / np.sqrt(rows.size), rel=0.05)


@pytest.mark.parametrize(
    ("count", "q", "told"), [(4, 8.9, False), (4, 9.4, True), (400, 1.9, False), (400, 2.1, True)]
)
def test_few_samples_are_over_their_floor_by_chance_far_more_often(count, q, told):
    """Of χ² with 4 degrees of freedom, 36.0 is passed as seldom as 5 by a normal variable."""
    running = log()
    fit = Fit((running,), Model(machine(), ()), dict(BASE), (unit_floor(running),), dict(BASE))
    system = linear_system(fit)
    place = next(n for n, label in enumerate(system.labels) if label[1:] == ("torque_shaft_nm", 0))
    group = np.full(count, place)
    few = replace(
        system,
        group=group,
        residual=np.full(count, np.sqrt(q)),
        noise_ratio=np.ones(count),
        unit=np.ones(count),
    )
    assert bool(over_floor(few)) == told


@pytest.mark.parametrize(("windows", "told"), [(1, True), (2, False), (9, False)])
def test_a_wave_in_one_window_of_several_is_none_of_the_motors(windows, told):
    """At the pace of one window an encoder's steps may beat with it; a slow turn has but one."""
    running = log()
    fit = Fit((running,), Model(machine(), ()), dict(BASE), (unit_floor(running),), dict(BASE))
    system = linear_system(fit)
    place = next(n for n, (_, name, order) in enumerate(system.labels) if name == "vq_v" and order)
    window = np.repeat(np.arange(windows), 2)
    residual = np.where(window == 0, 30.0, 1.0)
    one = replace(
        system,
        group=np.full(window.size, place),
        window=window,
        residual=residual,
        noise_ratio=np.ones(window.size),
        unit=np.ones(window.size),
    )
    assert bool(over_floor(one)) == told
    both = replace(one, residual=np.where(window < 2, 30.0, 1.0))
    assert over_floor(both)


def test_a_capture_left_out_is_predicted_from_the_others():
    """As a fit to the others alone predicts it, which is not as the fit to all of them has it."""
    segments = tuple(log(noise=1.0, seed=n) for n in (5, 6, 7))
    start = fitted(segments)
    system = linear_system(start)
    held = leave_out(system)
    assert np.isfinite(held.residual).all()
    in_sample = np.sqrt(np.mean((system.residual / system.noise_ratio) ** 2))
    assert in_sample < held.total < 1.2
    capture = system.segment
    for number in range(3):
        others = [n for n in range(3) if n != number]
        # from a start that is off: a fit that has nothing worth a step to gain takes none
        off = {**start.values, "psi_wb": 1.002 * start.values["psi_wb"]}
        less = replace(
            start,
            segments=tuple(segments[n] for n in others),
            values=off,
            sigma=tuple(start.sigma[n] for n in others),
        )
        alone = gauss_newton(less).fit
        told = linear_system(replace(start, values=alone.values)).residual[capture == number]
        assert held.residual[capture == number] == pytest.approx(told, abs=1e-3)
        assert np.abs(told - system.residual[capture == number]).max() > 0.1


def test_one_capture_alone_has_the_error_of_its_fit_and_says_so():
    start = fitted((log(noise=1.0),))
    system = linear_system(start)
    held = leave_out(system)
    assert not np.isfinite(held.residual).any()
    rms = np.sqrt(np.mean((system.residual / system.noise_ratio) ** 2))
    assert held.total == pytest.approx(rms, rel=1e-12)
    assert "of the fit" in held.notes[0]
    two = tuple(log(noise=1.0, seed=n) for n in (5, 6))
    assert leave_out(linear_system(fitted(two))).notes == ()


def bent_line(count):
    """A line through a parabola 40 floors deep, and beside it one through a line; noise of one."""
    running = log()
    fit = Fit((running,), Model(machine(), ()), dict(BASE), (unit_floor(running),), dict(BASE))
    system = linear_system(fit)
    bent, straight = (system.labels.index((0, name, 0)) for name in ("vq_v", "torque_shaft_nm"))
    x = np.linspace(0.0, 1.0, count)
    noise = np.random.default_rng(count).standard_normal(2 * count)
    measured = np.concatenate([3.0 * x + 40.0 * x**2, 5.0 * x]) + noise
    matrix = -np.kron(np.eye(2), x[:, None])
    return replace(
        system,
        columns=(Column("r_ohm", 1.0), Column("j_kgm2", 1.0)),
        matrix=matrix,
        residual=measured + matrix @ np.linalg.lstsq(-matrix, measured, rcond=None)[0],
        fit=replace(fit, sigma=(np.ones(2 * count),)),
        group=np.repeat([bent, straight], count),
        window=np.tile(np.arange(count), 2),
        unit=np.ones(2 * count),
        noise_ratio=np.ones(2 * count),
        row_weight=np.ones(2 * count),
        prior_precision=np.zeros(2),
        prior_gradient=np.zeros(2),
        model_column_count=2,
    )


def test_a_form_that_misses_is_no_noise_that_windows_average_away():
    """The slope of the bent one stays unsure; the straight one is as sure as its samples."""
    unsure = []
    for count in (100, 3000):
        whole = bent_line(count)
        bare = known_by(whole, HeldOut(whole.residual, 1.0), np.ones(2))
        sure = replace(bare, form_error_factor=form_error_factor(whole))
        assert sure.u[1] == bare.u[1]
        power = np.sum(whole.matrix[:, 0] ** 2)
        left = np.sum(whole.residual[:count] ** 2)
        # u² = u_noise² + bound²/3, the bound |r| / |x| over the floor of one
        noise = left / count / power
        assert sure.u[0] ** 2 == pytest.approx(noise + (left - count) / power / 3.0)
        unsure.append(sure.u[0])
    assert unsure[0] == pytest.approx(unsure[1], rel=0.1)


def test_what_fits_to_its_floor_is_no_misfit():
    system = linear_system(fitted((log(noise=1.0),)))
    assert not form_error_factor(system).any()
