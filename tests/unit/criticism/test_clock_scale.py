"""A time base that is wrong by a factor: it is named, with its size, and nothing else is."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.effect import RECORDERS
from pipeline.criticism.library.equations import equations
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, clock_gain
from pipeline.criticism.residuals.channels import of_acceleration
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import QUIET, campaign_of, design
from tests.unit.criticism.machines import machine

FAST = 1.0 / 1.024
TURNING = frozenset({"open_circuit", "cogging", "torque_map", "spin_down", "drive"})
STILL = frozenset({"resistance", "heat_run", "cogging"})
"""Tests in which next to nothing goes by time."""
PLAN = tuple(step for step in CAMPAIGN if step[1] not in ("hand_turn", "holding_current"))
CLOCK = effects()["clock_scale"]


def on_clock(capture: Capture, factor: float, speed_too: bool = False) -> Capture:
    """The capture with its time base, and the speed that goes by it, wrong by a factor."""
    factors = {"t_s": factor, "omega_mech_rad_s": 1.0 / factor if speed_too else 1.0}
    tables = (
        table.with_columns(pl.col(n) * f for n, f in factors.items() if n in table.columns)
        for table in capture.tables
    )
    return replace(capture, tables=tuple(tables))


def recorded(
    motor: str, bench: Bench, seed: int, factor: float, tests=TURNING, plan=PLAN
) -> Campaign:
    plain = replace(design(motor), effects={})
    whole = campaign_of(campaign(plain, bench, seed, plan))
    captures = (on_clock(c, factor) if c.meta.test in tests else c for c in whole.captures)
    return replace(whole, captures=tuple(captures))


RECORDER = {name: one.recorder for name, one in equations().items() if one.recorder}


@pytest.mark.parametrize("kind", RECORDER)
def test_every_recorder_has_a_clock_of_its_own(kind):
    """A gain of one recorder's clock is none of another's; a table goes by none."""
    model = Model(machine(), (CLOCK,))
    mask = 2 ** RECORDERS.index(RECORDER[kind])
    values = {"gain_clock": 0.001, "clock_scale.gain": 0.02, "clock_scale.of": float(mask)}
    assert clock_gain(RECORDER[kind], model, values) == pytest.approx(0.021)
    other = {**values, "clock_scale.of": float(15 - mask)}
    assert clock_gain(RECORDER[kind], model, other) == pytest.approx(0.001)
    assert clock_gain(None, model, values) == 0.0


def test_the_true_gain_undoes_a_wrong_clock_in_every_equation():
    """Residuals on a clock of 1/1.024 with that gain are those on the true clock without one."""
    right = recorded("gimbal-5208", QUIET, 1, 1.0)
    size = machine_of(right, Constants())
    plain, model = Model(size, ()), Model(size, (CLOCK,))
    motor = design("gimbal-5208")
    base = {
        **dict.fromkeys(plain.priors(), 0.0),
        "bench_angle_rad": 0.0,
        "r_ohm": motor.r_phase_ohm,
        "ld_h": motor.ld_h,
        "lq_h": motor.lq_h,
        "psi_wb": motor.psi_pm_wb,
        "j_kgm2": motor.j_rotor_kgm2,
        "b_nm_s_rad": motor.b_visc_nm_s_rad,
    }
    gain = {"clock_scale.gain": FAST - 1.0, "clock_scale.of": 15.0}
    told = set()
    for one in segments(right, size):
        if one.kind not in RECORDER:
            continue
        here = residual(one, plain, base)
        wrong = replace(one, ts_s=FAST * one.ts_s)
        there = residual(wrong, model, {**base, **gain})
        for channel, a, b in zip(one.channels, here, there, strict=True):
            # an acceleration is told by the recorded clock
            told_by = FAST**2 if of_acceleration(one, channel) else 1.0
            assert b * told_by == pytest.approx(a, abs=1e-9 * np.abs(a).max()), (one.kind, channel)
            unaware = residual(wrong, plain, base)
            assert one.test in STILL or np.abs(unaware - here).max() > 1e-3 * np.abs(here).max()
        told.add(one.kind)
    assert told == {"dq", "shaft", "open", "terminal"}


@pytest.mark.slow
@pytest.mark.parametrize(("factor", "verdict"), [(FAST, "adequate"), (1.0 / 1.08, "unknown")])
def test_a_coast_on_a_fast_clock_is_no_compliance(factor, verdict):
    """Its friction over inertia is another: by little friction is so too, by much it is told."""
    stems = ("resistance_ab", "lcr", "torque_map_fast", "drive_0")
    few = tuple(step for step in PLAN if step[0] in stems or step[1] == "spin_down")
    found = recorded("gimbal-5208", Bench(), 3, factor, {"spin_down"}, few)
    result = diagnose(found, ModelSpec(), Constants())
    assert (result.verdict, result.missing) == (verdict, ())
    assert any("or a clock that is off there" in note for note in result.notes) == (
        verdict == "unknown"
    )


@pytest.mark.slow
@pytest.mark.parametrize("motor", ["gimbal-5208", "joint-11p", "servo-ipm"])
@pytest.mark.parametrize("factor", [FAST, 1.0 / FAST])
def test_a_fast_or_slow_clock_is_named_alone_with_its_size(motor, factor):
    """J came out 4.6 % low, and a curve of temperature was told of the rest."""
    result = diagnose(recorded(motor, Bench(), 3, factor), ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("missing", ("clock_scale",))
    value, u, _ = result.ranking[0].parameters["gain"]
    assert abs(value - (factor - 1.0)) < 2.0 * u < 0.005
    assert result.ranking[0].parameters["of"][0] == 7.0


@pytest.mark.slow
@pytest.mark.parametrize("motor", ["gimbal-5208", "joint-11p"])
@pytest.mark.parametrize("bench", [Bench(), Bench(jitter_s=1e-5)], ids=["even", "jitter"])
def test_a_crystals_own_error_names_nothing(motor, bench):
    """100 ppm off, with stamps that scatter or not: adequate."""
    result = diagnose(recorded(motor, bench, 3, 1.0 + 1e-4), ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("adequate", ())
