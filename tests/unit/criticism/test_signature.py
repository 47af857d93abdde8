"""What gives an effect away is found among all captures, signals and variables."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from pipeline.criticism.validation import signature as module
from pipeline.criticism.validation.error_maps import Errors
from pipeline.criticism.validation.signature import signature
from pipeline.records.diagnosis import Signature
from pipeline.records.error_map import Bins, ErrorMap

N, TURNS, INERTIA_KGM2 = 2000, 40, 3e-5


def segment(capture: str, *, turning: bool = True) -> Any:
    """A capture of windows of ten samples over some turns, or over none."""
    theta = np.linspace(0.0, 2 * np.pi * TURNS if turning else 0.1, 10 * N)
    weak = SimpleNamespace(starts=10 * np.arange(N), length=10)
    return SimpleNamespace(capture=capture, recorded={"theta_mech_rad": theta}, weak=weak)


def errors(signal: str, shape: np.ndarray, of: int = 0, seed: int = 1) -> Errors:
    """Errors of a signal in one capture of several: a shape and noise of 0.01."""
    rng = np.random.default_rng(seed)
    speed, current = np.linspace(5.0, 200.0, N), rng.uniform(-9.0, 9.0, N)
    at = {"omega_mech_rad_s": speed, "iq_a": current, "temp_winding_degc": np.full(N, 25.0)}
    noisy = shape + 0.01 * rng.normal(size=N)
    return Errors(signal, noisy, np.full(N, 0.01), np.full(N, of), np.arange(N), at)


def system_of(*captures: str) -> Any:
    """A fit of segments of these captures, to be looked at with and without its effects."""
    segments = tuple(segment(name) for name in captures)
    fit = SimpleNamespace(values={"j_kgm2": INERTIA_KGM2}, without=lambda *gone: gone)
    return SimpleNamespace(residual=np.empty(0), segments=segments, fit=fit)


def shown_by(
    monkeypatch: pytest.MonkeyPatch,
    before: list[Errors],
    after: list[Errors],
    maps: tuple[tuple[ErrorMap, ...], tuple[ErrorMap, ...]] = ((), ()),
    captures: tuple[str, ...] = ("a.mcap", "b.mcap"),
) -> Signature | None:
    """The signature of an effect without which these errors and maps are left, and with it."""
    whole = system_of(*captures)
    made = iter([after, before])
    made_of: list[tuple[str, ...]] = []
    monkeypatch.setattr(
        module, "linear_system", lambda fit, **_: made_of.append(fit) or system_of(*captures)
    )
    monkeypatch.setattr(module, "window_errors", lambda *_: next(made))
    monkeypatch.setattr(module, "angle_maps", lambda _: maps[0])
    shown = signature(whole, ["effect"], maps[1])
    assert made_of == [("effect",)], "the same values less the effect, nothing fitted anew"
    return shown


def found_in(
    monkeypatch: pytest.MonkeyPatch,
    before: list[Errors],
    maps: tuple[tuple[ErrorMap, ...], tuple[ErrorMap, ...]] = ((), ()),
) -> Signature | None:
    """The signature of an effect with which nothing but noise is left."""
    quiet = [errors(one.signal, np.zeros(N), int(one.segment[0]), seed=2) for one in before]
    return shown_by(monkeypatch, before, quiet, maps)


def test_a_bump_of_speed_is_drawn_over_speed_in_its_capture(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    speed = np.linspace(5.0, 200.0, N)
    bump = 0.5 * np.exp(-((speed / 20.0) ** 2))
    one = found_in(monkeypatch, [errors("vq_v", 0.0 * bump), errors("vd_v", bump, of=1)])
    assert one is not None
    assert (one.signal, one.unit, one.variable) == ("vd_v", "V", "omega_mech_rad_s")
    assert one.capture == "b.mcap"
    expected = 0.5 * np.exp(-((np.array(one.at) / 20.0) ** 2))
    assert np.array(one.before) == pytest.approx(expected, abs=0.03)
    assert np.array(one.after) == pytest.approx(0.0, abs=0.01)


def test_an_error_once_a_turn_is_drawn_over_the_angle_of_the_shaft(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    theta = segment("a").recorded["theta_mech_rad"][10 * np.arange(N) + 5]
    one = found_in(monkeypatch, [errors("vd_v", 0.3 * np.sin(theta))])
    assert one is not None
    assert one.variable == "theta_mech_rad"
    assert np.array(one.before) == pytest.approx(0.3 * np.sin(one.at), abs=0.03)


def test_an_error_of_acceleration_is_told_as_torque(monkeypatch: pytest.MonkeyPatch) -> None:
    step = 40.0 * np.sign(np.linspace(-1.0, 1.0, N))
    one = found_in(monkeypatch, [errors("alpha_mech_rad_s2", step)])
    assert one is not None
    assert (one.signal, one.unit) == ("torque_nm", "N·m")
    assert one.before[0] == pytest.approx(-40.0 * INERTIA_KGM2, rel=0.01)


def turn_maps(
    order: int, cells: int, variable: str
) -> tuple[tuple[ErrorMap, ...], tuple[ErrorMap, ...]]:
    """Maps whose torque has a wave over the angle, without and nearly without it."""
    turn = Bins(variable, tuple(np.linspace(0.0, 2 * np.pi, cells + 1).tolist()))
    middles = (np.array(turn.edges[1:]) + np.array(turn.edges[:-1])) / 2.0
    wave = 0.01 * np.sin(order * middles)
    count, chance = np.full(cells, 500), np.full(cells, 0.5)
    loud = ErrorMap("torque_shaft_nm", "N·m", turn, None, count, wave, chance, 0.9, 0.1)
    quiet = replace(loud, mean=0.001 * wave)
    return (loud,), (quiet,)


def test_a_wave_that_windows_smooth_is_taken_from_the_maps_of_the_turn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    maps = turn_maps(2, 72, "theta_mech_rad")
    one = found_in(monkeypatch, [errors("vd_v", np.zeros(N))], maps)
    assert one is not None
    assert (one.signal, one.variable, one.capture) == ("torque_shaft_nm", "theta_mech_rad", None)
    assert (one.order, one.x_name) == (1, "theta_mech_rad")
    assert one.before == pytest.approx(maps[0][0].mean.tolist())
    assert one.after == pytest.approx(maps[1][0].mean.tolist())


def test_many_waves_a_turn_are_laid_over_each_other(monkeypatch: pytest.MonkeyPatch) -> None:
    """84 waves in 480 cells are a zigzag; folded they are one wave with its shape."""
    maps = turn_maps(84, 480, "theta_mech_rad")
    one = found_in(monkeypatch, [errors("vd_v", np.zeros(N))], maps)
    assert one is not None
    assert (one.order, one.x_name) == (84, "theta_in_one_of_84_waves_rad")
    assert len(one.at) >= 36
    assert one.before == pytest.approx((0.01 * np.sin(one.at)).tolist(), abs=1e-3)
    assert list(one.at) == sorted(one.at)


def test_a_wave_of_which_the_cells_show_no_shape_is_not_drawn(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Twelve waves in 36 cells have three points each, and six have six."""
    for order in (6, 12):
        maps = turn_maps(order, 36, "theta_elec_rad")
        one = found_in(monkeypatch, [errors("vd_v", np.linspace(-1.0, 1.0, N))], maps)
        assert one is not None
        assert one.signal == "vd_v"


def test_what_an_effect_explains_wholly_comes_before_what_it_only_lessens(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Of v_q ten volts go and ten stay, of v_d one goes and none stays."""
    speed = np.linspace(5.0, 200.0, N)
    step = np.sign(speed - 100.0)
    one = shown_by(
        monkeypatch,
        [errors("vq_v", 20.0 * step), errors("vd_v", 1.0 * step)],
        [errors("vq_v", 10.0 * step, seed=2), errors("vd_v", 0.0 * step, seed=3)],
    )
    assert one is not None
    assert one.signal == "vd_v"


def test_without_cells_there_is_none(monkeypatch: pytest.MonkeyPatch) -> None:
    assert found_in(monkeypatch, []) is None


def test_few_windows_are_drawn_over_what_the_error_is_a_curve_of(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A window a cell leaves nothing over any variable: over the current it is no curve."""
    rng = np.random.default_rng(3)
    few = np.linspace(-30.0, 30.0, 24)
    at = {"omega_mech_rad_s": few, "iq_a": rng.uniform(-9.0, 9.0, few.size)}
    rest = (np.full(few.size, 1e-4), np.zeros(few.size, dtype=int), np.arange(few.size))
    before = Errors("torque_shaft_nm", np.sign(few) * np.exp(-np.abs(few) / 8.0), *rest, at)
    left = 1e-4 * np.argsort(np.argsort(-np.abs(at["iq_a"]))) / few.size
    found = shown_by(monkeypatch, [before], [replace(before, error=left)])
    assert found is not None
    assert found.variable == "omega_mech_rad_s"
