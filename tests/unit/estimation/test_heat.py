"""Copper coefficient and thermal resistance from warm-up curves written out in closed form."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators import (
    heat_run,
    thermal,
)
from pipeline.records.capture import Capture
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import type_a
from tests.recovery.cases_electrical import LONG_HEAT
from tests.recovery.simulated import MOTOR, recorded
from tests.unit.estimation.signals import capture, estimates, known_value


def heat_capture(drop=0.0, kind="commanded", alpha=0.0039, speed=0.0):
    t = np.arange(0.0, 200.0, 0.05)
    temp = 25.0 + 50.0 * -np.expm1(-t / 60.0)
    rng = np.random.default_rng(6)
    current = 5.0 + 1e-3 * rng.standard_normal(t.size)
    vd = 0.4 * (1 + alpha * (temp - 25.0)) * 5.0 + drop
    return capture(
        "heat_run",
        voltage_kind=kind,
        ambient_degc=25.0,
        t_s=t,
        id_a=current,
        iq_a=np.zeros(t.size),
        vd_v=vd + 2e-4 * rng.standard_normal(t.size),
        vq_v=np.zeros(t.size),
        omega_mech_rad_s=np.full(t.size, speed),
        temp_winding_degc=temp + 0.02 * rng.standard_normal(t.size),
    )


def test_an_inverters_drop_leaves_the_coefficient_alone():
    reference = Constants((known_value("r_phase_ohm", 0.4, 0.0004, "ohm", "resistance"),))
    found = estimates(heat_run.ESTIMATOR, heat_capture(drop=0.3), known=reference)
    assert found["temp_coeff_copper_1_k"].number == pytest.approx(0.0039, rel=2e-3)
    assert found["r_phase_ohm"].u > 0.04


def test_a_locked_rotor_sees_its_own_mix_of_unequal_phases():
    """Current on phase a: R = (2/3)(R_a + R_b/4 + R_c/4); the mean of 0.40 would be 4 % off."""
    run = heat_capture(alpha=0.0039, drop=0.3)
    table = run.tables[0].with_columns(pl.lit(0.0).alias("theta_elec_rad"))
    locked = Capture("locked", "0" * 64, "verified", run.meta, (table,))
    phases = {"r_a_ohm": 0.416, "r_b_ohm": 0.37, "r_c_ohm": 0.366}
    known = Constants(
        (
            known_value("r_phase_ohm", 0.384, unit="ohm"),
            *(known_value(name, r, 0.001, "ohm") for name, r in phases.items()),
        )
    )
    found = estimates(heat_run.ESTIMATOR, locked, known=known)["temp_coeff_copper_1_k"]
    assert found.number == pytest.approx(0.0039, rel=2e-3)


def test_a_measured_voltage_needs_no_other_test():
    found = estimates(heat_run.ESTIMATOR, heat_capture(kind="measured"))
    alpha = found["temp_coeff_copper_1_k"]
    assert alpha.number == pytest.approx(0.0039, rel=2e-3)
    sources = {part.source: part.u for part in alpha.budget}
    assert abs(sources.get("current@s", 0.0)) < 1e-9
    assert abs(sources.get("voltage@s", 0.0)) < 1e-9


def with_current(run, i_a):
    """The same run with its d current replaced by i_a [n], the voltage by R(T) times it."""
    warm = run.arrays("temp_winding_degc")["temp_winding_degc"] - 25.0
    volts = 0.4 * (1.0 + 0.0039 * warm) * i_a
    table = run.tables[0].with_columns(pl.Series("id_a", i_a), pl.Series("vd_v", volts))
    return Capture("set", "0" * 64, "verified", run.meta, (table,))


def test_a_current_that_is_exactly_constant_is_steady():
    run = heat_capture(kind="measured")
    held = with_current(run, np.full(4000, 5.16))
    found = estimates(heat_run.ESTIMATOR, held)["temp_coeff_copper_1_k"]
    assert found.number == pytest.approx(0.0039, rel=2e-3)
    flicker = 5.16 + 0.01 * (np.arange(4000) % 90 == 7)
    found = estimates(heat_run.ESTIMATOR, with_current(run, flicker))["temp_coeff_copper_1_k"]
    assert found.number == pytest.approx(0.0039, rel=2e-3)
    swept = with_current(run, 5.0 * np.sin(np.arange(4000) / 30.0))
    lost = estimates(heat_run.ESTIMATOR, swept)["temp_coeff_copper_1_k"]
    assert "no steady current found" in lost.note


@pytest.mark.parametrize("estimator", [heat_run.ESTIMATOR, thermal.ESTIMATOR])
def test_a_run_without_current_tells_nothing(estimator):
    """No share of the phases in a current of 0: not identifiable, and no estimator breaks."""
    still = with_current(heat_capture(kind="measured"), np.zeros(4000))
    table = still.tables[0].with_columns(pl.lit(0.0).alias("theta_elec_rad"))
    for one in estimates(estimator, replace(still, tables=(table,))).values():
        assert one.status == "not_identifiable"


def test_a_run_that_cannot_be_used_keeps_no_other_from_being_used():
    reference = Constants((known_value("r_phase_ohm", 0.4, 0.0004, "ohm", "resistance"),))
    good = heat_capture()
    turning = replace(heat_capture(speed=5.0), path="a")
    found = estimates(heat_run.ESTIMATOR, turning, good, known=reference)
    alone = estimates(heat_run.ESTIMATOR, good, known=reference)
    name = "temp_coeff_copper_1_k"
    assert found[name].number == alone[name].number
    assert "open_circuit" in found[name].note


def test_a_turning_rotor_without_its_flux_is_refused():
    found = estimates(heat_run.ESTIMATOR, heat_capture(speed=5.0))
    assert found["temp_coeff_copper_1_k"].status == "not_identifiable"
    assert "open_circuit" in found["temp_coeff_copper_1_k"].note


def test_thermal_resistance_of_one_time_constant():
    """3.3 of 60 s: 50 K over the loss at the end; R rises with the winding, so loss does too."""
    found = estimates(thermal.ESTIMATOR, heat_capture(kind="measured", alpha=0.0))
    rth = found["rth_winding_k_w"]
    assert rth.number == pytest.approx(50.0 / (1.5 * 0.4 * 25.0), rel=0.01)
    short = heat_capture(kind="measured", alpha=0.0)
    table = short.tables[0].head(600)
    brief = Capture("short", "0" * 64, "verified", short.meta, (table,))
    assert estimates(thermal.ESTIMATOR, brief)["rth_winding_k_w"].status == "not_identifiable"


def test_a_clock_that_does_not_begin_at_zero_changes_nothing():
    run = heat_capture(kind="measured", alpha=0.0)
    table = run.tables[0].with_columns(pl.col("t_s") + 7200.0)
    late = Capture("late", run.sha256, "verified", run.meta, (table,))
    first, second = (estimates(thermal.ESTIMATOR, one)["rth_winding_k_w"] for one in (run, late))
    assert (second.number, second.u) == pytest.approx((first.number, first.u), rel=1e-6)


def test_the_loss_carries_what_it_was_made_of():
    """By v i alone: both gains once. By a known R: the current's twice, R's scatter as scatter."""
    run = heat_capture(kind="measured", alpha=0.0)
    alone = estimates(thermal.ESTIMATOR, run)["rth_winding_k_w"]
    parts = {part.source: part for part in alone.budget}
    assert parts["voltage@s"].u == pytest.approx(-0.001 * alone.number)
    assert parts["current@s"].u == pytest.approx(-0.002 * alone.number)
    reference = replace(
        known_value("r_phase_ohm", 0.4, 0.0, "ohm", "resistance"), budget=type_a("contacts", 0.004)
    )
    known = Constants((reference,))
    found = estimates(thermal.ESTIMATOR, run, known=known)["rth_winding_k_w"]
    parts = {part.source: part for part in found.budget}
    assert parts["current@s"].u == pytest.approx(-0.004 * found.number)
    assert parts["contacts"].u == pytest.approx(-0.01 * found.number)
    assert parts["contacts"].kind == "A"


@pytest.mark.parametrize(("begin", "end"), [(0.1, 0.19), (0.02, 0.06)])
def test_a_gap_in_the_log_is_no_jump_of_the_temperature(begin, end):
    """The logger was away for up to a tenth of a run of two bodies; the motor was not."""
    captures, _ = recorded(LONG_HEAT, 3)
    run = captures.captures[0]
    table = run.tables[0]
    share = pl.col("t_s") / table["t_s"].max()
    left = table.filter((share < begin) | (share > end))
    held = Capture("gap", run.sha256, "verified", run.meta, (left,))
    whole, broken = (estimates(thermal.ESTIMATOR, c)["rth_winding_k_w"] for c in (run, held))
    assert "two nodes" in whole.note
    assert broken.number == pytest.approx(whole.number, rel=4e-3)
    assert broken.u_a < 1.2 * whole.u_a


def test_heat_capacity_and_time_constant_of_one_node():
    """60 s and 50 K over 15 W: C = 18 J/K; a gain of the current moves C as it moves the loss."""
    found = estimates(thermal.ESTIMATOR, heat_capture(kind="measured", alpha=0.0))
    capacity, tau = found["cth_winding_j_k"], found["tau_thermal_winding_s"]
    assert tau.number == pytest.approx(60.0, rel=0.01)
    assert capacity.number == pytest.approx(tau.number / found["rth_winding_k_w"].number, rel=1e-9)
    rth = {part.source: part.u for part in found["rth_winding_k_w"].budget}
    own = {part.source: part.u for part in capacity.budget}
    for gain in ("voltage@s", "current@s"):
        assert own[gain] / capacity.number == pytest.approx(
            -rth[gain] / found["rth_winding_k_w"].number
        )
    assert found["tau_thermal_body_s"].status == "not_identifiable"
    assert "one node" in found["tau_thermal_body_s"].note


def test_the_network_of_two_bodies_is_that_of_the_bench():
    """Capacity and time constants within their intervals of the simulated network's."""
    captures, _ = recorded(LONG_HEAT, 3)
    found = estimates(thermal.ESTIMATOR, captures.captures[0])
    motor = MOTOR
    truths = {
        "cth_winding_j_k": motor.cth_winding_j_k,
        "tau_thermal_winding_s": motor.cth_winding_j_k
        / (1.0 / motor.rth_wa_k_w + 1.0 / motor.rth_wm_k_w),
        "tau_thermal_body_s": motor.cth_magnet_j_k
        / (1.0 / motor.rth_wm_k_w + 1.0 / motor.rth_ma_k_w),
    }
    for name, truth in truths.items():
        low, high = found[name].interval(0.999)
        assert low < truth < high, (name, truth, found[name].number, found[name].u)
        assert found[name].u < 0.1 * truth, name
