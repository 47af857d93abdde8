"""A temperature that was not recorded is a nuisance of the fit, and in its uncertainties."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.comparison import compare
from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.traces import window_between_gaps
from pipeline.criticism.diagnosis import base_fit, diagnose
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.residuals.residual import operate
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, log, machine

MOTOR = replace(design("gimbal-5208"), effects={})
TRUE = truth(MOTOR)["constants"]
U_K = DEFAULT.priors.unlogged_k
REACH = 1.96


def spins(*columns: str) -> Campaign:
    plan = (
        ("cold", "open_circuit", {}),
        ("warm", "open_circuit", {"temp_magnet_degc": 58.0, "levels": (-0.3, -0.6)}),
    )
    return without(campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, plan)), *columns)


def without(whole: Campaign, *columns: str) -> Campaign:
    kept = (
        replace(one, tables=tuple(t.drop(columns, strict=False) for t in one.tables))
        for one in whole.captures
    )
    return replace(whole, captures=tuple(kept))


def flux(captures: Campaign):
    result = compare(captures, ModelSpec(), Constants())
    return result.parameters["psi_wb"], result


def test_a_warm_magnet_without_a_thermometer():
    """It gave psi 3.7 % low, by 40 of its uncertainties."""
    both = spins("temp_magnet_degc")
    warm = replace(both, captures=tuple(c for c in both.captures if c.path == "warm.mcap"))
    psi, result = flux(warm)
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value == pytest.approx(U_K * 0.0011, rel=0.1)
    assert any(f"± {U_K:g} K" in note for note in result.notes)


def test_of_captures_without_a_thermometer_each_has_a_temperature_of_its_own():
    """One that all have in common leaves 33 K of magnet temperature between two spins."""
    psi, result = flux(spins("temp_magnet_degc"))
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value == pytest.approx(math.sqrt(1.5) * U_K * 0.0011, rel=0.1)
    assert result.held_out < 1.5


def test_a_recorded_temperature_leaves_the_flux_as_sharp_as_the_instruments():
    psi, _ = flux(spins())
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value < 0.005


@pytest.mark.parametrize("lost", [("theta_mech_rad",), ("theta_mech_rad", "omega_mech_rad_s")])
def test_a_trace_of_line_voltages_without_an_encoder_has_the_flux(lost):
    psi, result = flux(spins(*lost))
    assert abs(psi.value - TRUE["psi_pm_wb"]) < REACH * psi.u
    assert psi.u / psi.value < 0.005
    assert not any("not used" in note for note in result.notes)


def test_a_hot_winding_at_rest_without_a_thermometer():
    """It gave R 13 % high, by 60 of its uncertainties; a drive's winding may be another."""
    plan = (("hot", "resistance", {"temp_degc": 60.0}), ("log", "drive", {}))
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, plan))
    bare = replace(whole.of("resistance")[0])
    bare = replace(bare, tables=tuple(t.drop("temp_winding_degc") for t in bare.tables))
    alone = compare(replace(whole, captures=(bare,)), ModelSpec(), Constants())
    r = alone.parameters["r_ohm"]
    assert abs(r.value - TRUE["r_phase_ohm"]) < REACH * r.u
    assert r.u / r.value == pytest.approx(U_K * 0.0039, rel=0.15)
    assert any(
        f"no temp_winding_degc, taken to be at ambient temperature ± {U_K:g} K" in note
        for note in alone.notes
    )
    (log,) = whole.of("drive")
    both = compare(replace(whole, captures=(bare, log)), ModelSpec(), Constants())
    r = both.parameters["r_ohm"]
    assert abs(r.value - TRUE["r_phase_ohm"]) < REACH * r.u
    volts, amperes = (
        max(float(np.abs(log.arrays(name)[name]).max()) for name in names)
        for names in (("vd_v", "vq_v"), ("id_a", "iq_a"))
    )
    leads_ohm = max(DEFAULT.priors.lead_ohm, DEFAULT.priors.lead_share * volts / amperes)
    assert r.u / r.value == pytest.approx(leads_ohm / TRUE["r_phase_ohm"], rel=0.1)


@pytest.mark.parametrize("named", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_a_winding_that_warms_within_a_log_without_a_thermometer_is_no_effect(named):
    """Six kelvin in a second were named `skin_effect`; with thermometers nothing was missing."""
    light = {name: getattr(MOTOR, name) / 120.0 for name in ("cth_winding_j_k", "cth_magnet_j_k")}
    plan = tuple((f"drive_{n}", "drive", {}) for n in range(2))
    whole = campaign_of(campaign(replace(MOTOR, **light), Bench(instruments=EXACT), 8, plan))
    temperatures = [c.arrays("temp_winding_degc", "temp_magnet_degc") for c in whole.captures]
    rises = [t["temp_winding_degc"][-1] - t["temp_winding_degc"][0] for t in temperatures]
    assert min(rises) > 5.0
    blind = without(whole, "temp_winding_degc", "temp_magnet_degc")
    for captures in (whole, blind) if named else ():
        result = diagnose(captures, ModelSpec(), Constants())
        assert (result.verdict, result.missing) == ("adequate", ())
    values = base_fit(blind, ModelSpec(), Constants()).system.fit.values
    for n, rise in enumerate(rises):
        assert values[f"warming_winding_k_{n}"] == pytest.approx(rise, rel=0.4)


def test_a_winding_without_a_thermometer_may_come_to_rest_within_a_log():
    """Forty-six kelvin in a minute, most of them in its first half, were an `unknown` drop."""
    segment = log()
    recorded = {n: c for n, c in segment.recorded.items() if n != "temp_winding_degc"}
    fixed = {"ambient_k": 2.0, "warming_winding_k_0": 1.0, "bending_winding_k_0": 1.0}
    blind = replace(segment, recorded=recorded, fixed=fixed)
    values = {**BASE, "warming_winding_k_0": 10.0, "bending_winding_k_0": 3.0}
    course = operate(blind, recorded, Model(machine(), ()), values).winding_k
    assert course.mean() == pytest.approx(2.0, abs=0.01)
    assert course[-1] - course[0] == pytest.approx(10.0)
    assert course[course.size // 2] == pytest.approx(2.0 + 3.0, abs=0.01)


def test_a_window_is_no_longer_than_what_is_free_of_gaps():
    """A rig that logs settled rows alone, fifteen a level, had no window at all."""
    keep = np.ones(3000, dtype=bool)
    policy = DEFAULT.cutting
    assert window_between_gaps(0.02, keep, policy) == policy.window_samples
    keep[15::16] = False
    assert window_between_gaps(0.02, keep, policy) == 15
    keep[:] = False
    assert window_between_gaps(0.02, keep, policy) == policy.least_window


def test_a_shaft_that_rests_has_no_speed():
    """The rounding of an angle that stands still made psi 7e13 Wb, and its coefficient sure."""
    plan = (("run", "heat_run", {}),)
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, plan))
    (run,) = whole.captures
    (table, *rest) = run.tables
    still = table.drop("omega_mech_rad_s", strict=False).with_columns(
        (0.7853 + 1e-16 * pl.int_range(pl.len()).mod(3)).alias("theta_mech_rad")
    )
    stated = replace(run.meta, pole_pairs=MOTOR.pole_pairs)
    captures = (replace(run, meta=stated, tables=(still, *rest)),)
    machine = machine_of(replace(whole, captures=captures), Constants())
    assert machine.scales["speed_rad_s"] == 1.0


@pytest.mark.parametrize("seed", [1, pytest.param(2, marks=pytest.mark.slow)])
def test_a_drive_without_an_angle(seed):
    """Its observer is late: that read as resistance, and left an error of many noise floors."""
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), seed, (("log", "drive", {}),)))
    (log,) = whole.captures
    bare = replace(log, tables=tuple(t.drop("theta_mech_rad") for t in log.tables))
    result = compare(replace(whole, captures=(bare,)), ModelSpec(), Constants())
    with_angle = compare(whole, ModelSpec(), Constants())
    for name, true in (("r_ohm", "r_phase_ohm"), ("psi_wb", "psi_pm_wb"), ("lq_h", "lq_h")):
        one = result.parameters[name]
        assert abs(one.value - TRUE[true]) < REACH * one.u, name
        assert one.u < 0.05 * one.value, name
    assert result.held_out < 3.0 * with_angle.held_out


def test_a_drive_without_a_motion_is_not_taken_to_rest():
    """Its back-EMF read as resistance, three times too large, with an uncertainty of 5 %."""
    whole = campaign_of(campaign(MOTOR, Bench(instruments=EXACT), 1, (("log", "drive", {}),)))
    (log,) = whole.captures
    lost = ("theta_mech_rad", "omega_mech_rad_s")
    bare = replace(log, tables=tuple(t.drop(lost, strict=False) for t in log.tables))
    result = compare(replace(whole, captures=(bare,)), ModelSpec(), Constants())
    assert not any(one.known for one in result.parameters.values())
