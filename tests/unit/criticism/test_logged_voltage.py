"""What a voltage in a drive's log stands for: vectors that are held for a PWM period."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.equations.dq import _shortened
from pipeline.criticism.machine.model import Model
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.other_readings import by_best_readings, reading_notes
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.criticism.selection.stepwise import search
from pipeline.criticism.signals.true_state import hold_s
from tests.unit.criticism.machines import BASE, LIBRARY, fitted, held, log, machine

EVERY = 60
PAIRS = 7


def slow(pwm_s: float | None, timing: str = "centred", every: int = EVERY) -> Segment:
    """A log of 3 ms of a shaft that turns by up to 2.1 rad, electrical, in that time.

    Its voltages are those in the rotor frame: a vector that is held for 50 us loses nothing.
    """
    fast = log()
    fixed = dict(fast.fixed) if pwm_s is None else {**fast.fixed, "pwm_s": pwm_s}
    recorded = {name: column[::every] for name, column in fast.recorded.items()}
    instrument = replace(fast.instrument, timing=timing)
    slower = replace(fast, ts_s=every * fast.ts_s, recorded=recorded, weak=None)
    return replace(slower, fixed=fixed, instrument=instrument)


def left(segment: Segment, **changed: float) -> float:
    """Largest voltage that is left of the q axis [V], away from the ends."""
    found = residual(segment, Model(machine(), ()), {**BASE, **changed})
    return float(np.abs(found[1, 2:-2]).max())


def test_a_log_slower_than_the_pwm_holds_means_in_the_rotor_frame() -> None:
    assert np.abs(slow(5e-5).recorded["vq_v"]).max() > 4.5
    assert left(slow(5e-5)) < 1e-3
    assert left(slow(3e-3)) > 0.5, "a vector held for as long as the log's period is shorter"


def test_where_the_pwm_is_not_known_the_data_decide() -> None:
    """`ripple_edge` goes from a vector held for a whole period, 0, to one that is not, -1/24."""
    mean, instant = (slow(None, timing, every=8) for timing in ("centred", "instant"))
    assert left(mean) > 0.01
    assert left(mean, ripple_edge=-1.0 / 24.0) == pytest.approx(left(instant))
    assert left(mean, ripple_edge=-1.0 / 24.0) < 1e-5


@pytest.mark.parametrize(
    ("every", "omega_rad_s", "fast"), [(8, 300.0, True), (8, 400.0, False), (20, 0.0, False)]
)
def test_a_log_slower_than_any_inverter_has_the_pwm_of_a_usual_one(
    every: int, omega_rad_s: float, fast: bool
) -> None:
    """A turn of 0.84 rad in a row of 0.4 ms may be under one vector, one of 1.12 rad may not."""
    segment = slow(None, every=every)
    held_s = hold_s(segment, np.array([omega_rad_s]), machine())
    assert held_s == pytest.approx(every * 5e-5 if fast else 1e-4)


def test_a_log_as_fast_as_the_pwm_holds_one_vector_a_period() -> None:
    """Of the mean of a vector over a turn φ there is left sin(φ/2) / (φ/2)."""
    one, all_ = slow(3e-3), slow(5e-5)
    speed = PAIRS * np.gradient(one.recorded["theta_mech_rad"], one.ts_s)
    model = Model(machine(), ())
    shrunk, whole = (one.recorded["vq_v"] - residual(each, model, BASE)[1] for each in (one, all_))
    half = 0.5 * speed[3:-3] * one.ts_s
    held = 0.5 * speed[3:-3] * 5e-5
    expected = np.sin(half) / half / (np.sin(held) / held)
    assert (shrunk / whole)[3:-3] == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize("turn", [1e-6, 0.3, 2.4])
def test_what_is_left_of_a_mean_has_one_form_through_zero(turn: float) -> None:
    lost = np.array([turn**2 / 24.0, 0.0, -(turn**2) / 24.0])
    half = turn / 2.0
    assert _shortened(lost) == pytest.approx([math.sin(half) / half, 1.0, math.sinh(half) / half])


@pytest.mark.parametrize("frame", [0.0, 0.5])
def test_the_frame_of_held_voltages_is_the_one_that_explains_them(frame: float) -> None:
    system = by_best_readings(fit_of([held(frame, log(noise=1.0))], Model(machine(), ())).system)
    (segment,) = system.segments
    assert segment.instrument.frame == frame
    assert bool(reading_notes(system.fit)) == bool(frame)
    assert system.fit.values["psi_wb"] == pytest.approx(BASE["psi_wb"], rel=1e-3)


HOLDS_A_SAMPLE = 5.0


@pytest.mark.parametrize(
    ("timing", "meter", "many", "chosen"),
    [
        ("instant", "gain_commanded", 1.0, 0.5),
        pytest.param("instant", "gain_commanded", HOLDS_A_SAMPLE, 0.5, marks=pytest.mark.slow),
        ("centred", "gain_commanded", HOLDS_A_SAMPLE, 0.5),
        ("centred", "gain_commanded", 1.0, 0.0),
        ("instant", "gain_voltage", 1.0, 0.0),
        ("instant", "gain_commanded", None, 0.0),
    ],
)
def test_a_frame_is_chosen_where_it_is_not_stated(timing, meter, many, chosen) -> None:
    """Of commands of a known PWM, but for means about the middle of one hold, it is not."""
    plain = log(noise=1.0)
    hold_s = plain.ts_s / (many or 1.0)
    omega = PAIRS * np.gradient(plain.recorded["theta_mech_rad"], plain.ts_s)
    vector = plain.recorded["vd_v"] + 1j * plain.recorded["vq_v"]
    vector = vector * np.exp(0.5j * hold_s * omega)
    recorded = {**plain.recorded, "vd_v": vector.real, "vq_v": vector.imag}
    fixed = {**plain.fixed, **({} if many is None else {"pwm_s": hold_s})}
    instrument = replace(plain.instrument, timing=timing, meter=meter)
    segment = replace(plain, recorded=recorded, fixed=fixed, instrument=instrument)
    system = by_best_readings(fit_of([segment], Model(machine(), ())).system)
    assert system.segments[0].instrument.frame == chosen


@pytest.mark.slow
def test_the_frame_is_asked_again_when_an_effect_joins() -> None:
    """The search begins in the wrong frame, as behind a dead time that spoke for it."""

    def dragged(segment: Segment) -> Segment:
        omega = np.gradient(segment.recorded["theta_mech_rad"], segment.ts_s)
        torque = segment.recorded["torque_shaft_nm"] - 0.3 * omega * np.abs(omega) / 250.0**2
        return replace(segment, recorded={**segment.recorded, "torque_shaft_nm": torque})

    one = dragged(held(0.5, log(noise=1.0)))
    fit = fitted([one, replace(one, capture="again")])
    assert {segment.instrument.frame for segment in fit.segments} == {0.0}
    last = search(fit, {"windage": LIBRARY["windage"]})[-1]
    assert last.added == ("windage",)
    assert {segment.instrument.frame for segment in last.fit.segments} == {0.5}
