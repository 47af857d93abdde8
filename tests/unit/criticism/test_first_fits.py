"""Where fits begin of motors that few tests, or coarse sensors, show."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.machine.model import BEND_SPEED, LAG_SPEED
from pipeline.criticism.regression.gauss_newton import rough_fit
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design

GIMBAL = "gimbal-5208"
MOTION = ("theta_mech_rad", "omega_mech_rad_s")
DRIVE = ("drive_0", "drive", {})


def sound(motor: str):
    return replace(design(motor), effects={})


def recorded(motor: str, *plan, gone: tuple[str, ...] = (), **bench) -> Campaign:
    made = campaign_of(campaign(sound(motor), Bench(instruments=EXACT, **bench), 2, plan))
    captures = (
        replace(one, tables=tuple(t.drop(gone, strict=False) for t in one.tables))
        for one in made.captures
    )
    return replace(made, captures=tuple(captures))


def base(found: Campaign):
    """Values of the standard model, fitted."""
    machine = machine_of(found, Constants())
    return fit_of(segments(found, machine), model_of(ModelSpec(), machine)).system.fit.values


@pytest.mark.parametrize(
    ("motor", "bits", "noise_rad"), [(GIMBAL, 11, 3e-4), ("joint-11p", 17, 1.5e-3)]
)
def test_a_rough_fit_has_the_inertia_of_a_coarse_or_noisy_encoder(motor, bits, noise_rad):
    """By the machine's scale alone the noise of an acceleration took nine tenths of it away."""
    found = recorded(motor, DRIVE, encoder_bits=bits, encoder_noise_rad=noise_rad, pwm_hz=20e3)
    machine = machine_of(found, Constants())
    rough = rough_fit(segments(found, machine), model_of(ModelSpec(), machine))
    assert 0.7 < rough.values["j_kgm2"] / sound(motor).j_rotor_kgm2 < 1.4


def test_a_meter_beside_a_spin_gives_resistance_and_inductances():
    motor, spin = "servo-15kw", ("open_circuit", "open_circuit", {})
    values, true = base(recorded(motor, ("lcr", "lcr", {}), spin)), truth(sound(motor))["constants"]
    assert values["r_ohm"] == pytest.approx(true["r_phase_ohm"], rel=0.02)
    assert values["ld_h"] == pytest.approx(true["ld_h"], rel=0.05)
    assert values["lq_h"] == pytest.approx(true["lq_h"], rel=0.05)


@pytest.mark.parametrize(("test", "column"), [("lcr", "lab_h"), ("flux_map", "psi_d_wb")])
def test_a_table_that_lacks_a_value_has_its_other_rows(test, column):
    found = recorded("servo-ipm", (test, test, {}), DRIVE)
    (table,) = found.of(test)
    (rows,) = table.tables
    holes = np.where(np.arange(rows.height) == 3, np.nan, rows[column].to_numpy())
    lacks = replace(table, tables=(rows.with_columns(pl.Series(column, holes)),))
    captures = tuple(lacks if one is table else one for one in found.captures)
    machine = machine_of(replace(found, captures=captures), Constants())
    cut = segments(replace(found, captures=captures), machine)
    (segment,) = (one for one in cut if one.test == test)
    assert segment.size == rows.height - 1
    assert all(np.isfinite(signal).all() for signal in segment.recorded.values())


def test_a_spin_whose_voltages_alone_show_its_speed_gives_the_flux():
    motor, spin = "drone-2306", ("open_circuit", "open_circuit", {})
    values = base(recorded(motor, spin, gone=MOTION, pwm_hz=30e3))
    assert values["psi_wb"] == pytest.approx(
        truth(sound(motor))["constants"]["psi_pm_wb"], rel=0.01
    )


def test_gaps_of_a_thinned_log_bend_no_speed():
    """A lag far shorter than a row is none."""
    found = recorded(GIMBAL, DRIVE, gone=("theta_mech_rad",))
    machine = machine_of(found, Constants())
    model = model_of(ModelSpec(), machine)
    (log,) = (one for one in segments(found, machine) if one.kind == "dq")
    values = {**rough_fit((log,), model).values, BEND_SPEED: 1e-7}
    at_once, soon = (
        residual(log, model, {**values, LAG_SPEED: lag * log.ts_s}) for lag in (0.0, 1e-3)
    )
    assert np.abs(at_once - soon).max() < 1e-3 * np.abs(at_once).max()
