"""Telemetry of the q axis alone: rows slower than the PWM, and the drive's own, late speed."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest
from scipy.signal import lfilter, lfiltic

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.machine.sample_period import mean_current, ripple
from pipeline.criticism.regression.noise_floors import reading_error
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.records.diagnosis import Diagnosis
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from pipeline.views.ladder import headline
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, operating

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
EVERY = 10
PERIOD_S = EVERY * 1e-4
FREE = {"load": 0.0, "id_level": 0.0}
PLAN = (
    *(step for step in CAMPAIGN if step[0] in ("resistance_ab", "spin_down_cw")),
    ("drive_0", "drive", FREE),
    ("drive_1", "drive", FREE),
)


def telemetry(capture: Capture, late: float, low_pass: float) -> Capture:
    """Of a drive's log every tenth row: q voltages as means around it, a speed `late` rows late and
    behind a low-pass of so many rows.
    """
    if capture.meta.test != "drive":
        return capture
    (table,) = capture.tables
    half = EVERY // 2
    at = np.arange(4 * EVERY, table.height - 4 * EVERY, EVERY)
    kept = ("t_s", "iq_a", "theta_mech_rad", "temp_winding_degc")
    slow = {name: table[name].to_numpy()[at] for name in kept}
    mean = np.full(EVERY + 1, 1.0 / EVERY)
    mean[[0, -1]] *= 0.5
    slow["vq_v"] = np.convolve(table["vq_v"].to_numpy(), mean, "same")[at]
    theta, back = table["theta_mech_rad"].to_numpy(), round(late * EVERY)
    speed = (theta[at - back + half] - theta[at - back - half]) / PERIOD_S
    stays = math.exp(-1.0 / low_pass) if low_pass else 0.0
    at_once = lfiltic([1.0 - stays], [1.0, -stays], speed[:1])
    speed = lfilter([1.0 - stays], [1.0, -stays], speed, zi=at_once)[0]
    slow["omega_mech_rad_s"] = np.round(speed, 3)
    meta = replace(capture.meta, voltage_timing="centred", pwm_hz=1e4)
    return replace(capture, tables=(pl.DataFrame(slow),), meta=meta)


@cache
def whole() -> Campaign:
    return campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 3, PLAN))


def recorded(late: float, low_pass: float = 0.0) -> Campaign:
    captures = tuple(telemetry(one, late, low_pass) for one in whole().captures)
    return replace(whole(), captures=captures)


@cache
def diagnosed(late: float, low_pass: float) -> Diagnosis:
    return diagnose(recorded(late, low_pass), ModelSpec(), Constants())


def test_the_back_emf_follows_the_angle_where_a_drives_own_speed_is_late() -> None:
    found = recorded(3.0)
    machine = machine_of(found, Constants())
    logs = [one for one in segments(found, machine) if one.kind == "q"]
    assert all("omega_mech_rad_s" in one.channels for one in logs)
    values = fit_of(logs, model_of(ModelSpec("ideal"), machine)).system.fit.values
    assert values["r_ohm"] == pytest.approx(TRUE["r_phase_ohm"], rel=0.02)
    assert values["psi_wb"] == pytest.approx(TRUE["psi_pm_wb"], rel=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("late", [pytest.param(0.0, marks=pytest.mark.slow), 1.0])
def test_a_speed_of_a_period_ago_is_no_missing_effect(late: float) -> None:
    assert diagnosed(late, 0.0).missing == ()


def test_a_speed_of_three_periods_ago_is_named_with_its_delay() -> None:
    result = diagnosed(3.0, 0.0)
    assert result.missing == ("sample_delay",)
    found = result.ranking[0].parameters
    assert found["delay_s"][0] == pytest.approx(3.0 * PERIOD_S, rel=0.02)
    assert found["of_speed"][0] == 1.0


@pytest.mark.parametrize("low_pass", [0.0, pytest.param(25.0, marks=pytest.mark.slow)])
def test_no_fault_of_its_own_speed_is_the_motors_where_the_angle_counts(low_pass: float) -> None:
    """A delay is named and a long low-pass is not; neither decides what the motor lacks."""
    result = diagnosed(3.0, low_pass)
    assert result.verdict == "insufficient"
    assert result.ladder[0].held_out > 1.5
    assert set(result.missing) <= {"sample_delay"}
    assert not any(one.matters for one in result.remainder)
    assert headline(result).endswith("what to record is named below.")
    assert ("off in time" in headline(result)) == bool(result.missing)


def test_a_period_of_a_late_speed_is_in_its_floor_and_in_no_other() -> None:
    found = recorded(1.0)
    machine = machine_of(found, Constants())
    (log, *_) = [one for one in segments(found, machine) if one.kind == "q"]
    model = model_of(ModelSpec("ideal"), machine)
    steady = dict(log.recorded)
    steady["omega_mech_rad_s"] = np.full(log.size, log.recorded["omega_mech_rad_s"].mean())
    change, rest = (
        reading_error(replace(log, recorded=one), model, BASE) for one in (log.recorded, steady)
    )
    late = np.abs(log.weak.project(np.gradient(log.recorded["omega_mech_rad_s"])[None])[0])
    assert change[0] == pytest.approx(rest[0])
    known = np.abs(log.weak.project(np.gradient(steady["omega_mech_rad_s"])[None])[0])
    assert known == pytest.approx(0.0)
    assert (change[1] > 0.9 * late).all()
    assert np.median(change[1] / np.maximum(rest[1], 1e-300)) > 2.0


def test_what_a_current_ripples_by_goes_with_the_hold_of_a_vector_not_with_the_rows() -> None:
    values = {**BASE, "ripple_mean": 1.0 / 12.0}
    fast = operating().fed(hold_s=5e-5)
    slow = replace(fast, ts_s=20.0 * fast.ts_s)
    for one, other in zip(ripple(fast, 0.1, values), ripple(slow, 0.1, values), strict=True):
        assert np.array_equal(one, other)
    four = ripple(fast.fed(hold_s=1e-4), 0.1, values)[0]
    assert four == pytest.approx(4.0 * ripple(fast, 0.1, values)[0])
    assert mean_current(fast.fed(hold_s=0.0), values).i_a == pytest.approx(fast.i_a)


@pytest.mark.parametrize("axis", ["ld_h", "lq_h"])
def test_an_inductance_that_no_current_shows_makes_no_ripple_without_bounds(axis: str) -> None:
    """It may come out near zero, and over it the ripple of the current would be kiloamperes."""
    state = operating().fed(hold_s=5e-5)
    tried = [{**BASE, axis: h} for h in (0.0, 1e-12, 1e-6, BASE[axis])]
    sizes = [np.abs(ripple(state, 0.1, values)[1]).max() for values in tried]
    assert sizes[:2] == pytest.approx([sizes[2]] * 2, rel=0.01)
    assert sizes[0] < 10.0 * sizes[3]


def test_a_log_of_the_q_axis_alone_has_no_ripple() -> None:
    """It would pass for a resistance that grows with the square of speed."""
    found = recorded(1.0)
    machine = machine_of(found, Constants())
    model = model_of(ModelSpec("ideal"), machine)
    (log, *_) = [one for one in segments(found, machine) if one.kind == "q"]
    values = {**BASE, **dict.fromkeys(machine.unlogged, 0.0)}
    plain, rippling = (residual(log, model, {**values, "ripple_mean": m}) for m in (0.0, 0.08))
    assert rippling == pytest.approx(plain)


def test_a_jump_of_the_voltage_between_rows_is_an_error_of_its_windows_alone() -> None:
    """A log says what a voltage was at its samples, not when within a period it changed."""
    found = recorded(0.0)
    machine = machine_of(found, Constants())
    log = next(one for one in segments(found, machine) if one.kind == "q")
    system = fit_of([log], model_of(ModelSpec("ideal"), machine)).system
    model, values = system.fit.model, system.fit.values
    place, weak = log.size // 2, log.weak
    assert weak is not None
    stepped = log.recorded["vq_v"].copy()
    stepped[place:] += 5.0
    jumping = replace(log, recorded={**log.recorded, "vq_v": stepped})
    before, after = (
        reading_error(one, model, values)[log.channels.index("vq_v"), :, 0]
        for one in (log, jumping)
    )
    near = (weak.starts <= place) & (place < weak.starts + weak.length)
    grown = np.hypot(before, model.policy.noise_floors.reading * 5.0)
    assert np.max(after[near]) > 10.0 * np.max(grown)
    assert after[~near] == pytest.approx(before[~near], rel=0.2)
