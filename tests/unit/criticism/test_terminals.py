"""Terminals against the simulator, which has equations of its own: no constant is fitted here."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.residuals.segments import segments
from pipeline.records.constants import Constants
from pipeline.simulator.bench import record
from tests.simulated import QUIET, campaign_of, design
from tests.unit.criticism.machines import BASE

MOTOR = design("servo-ipm")
TRUE = {
    **BASE,
    "r_ohm": MOTOR.r_phase_ohm,
    "ld_h": MOTOR.ld_h,
    "lq_h": MOTOR.lq_h,
    "psi_wb": MOTOR.psi_pm_wb,
    "j_kgm2": MOTOR.j_rotor_kgm2,
    "b_nm_s_rad": MOTOR.b_visc_nm_s_rad,
}


def left(test: str, **how) -> tuple[np.ndarray, np.ndarray]:
    """Residual of the true motor, and the signal that it is of, [C, n] each."""
    made = record(test, MOTOR, QUIET, np.random.default_rng(1), **how)
    campaign = campaign_of([replace(made, stem=test)])
    machine = machine_of(campaign, Constants())
    (segment,) = segments(campaign, machine)
    nothing = {**TRUE, **dict.fromkeys(("r_ohm", "ld_h", "lq_h", "psi_wb"), 0.0)}
    model = Model(machine, ())
    return residual(segment, model, TRUE), residual(segment, model, nothing)


@pytest.mark.parametrize("pair", ["ab", "bc", "ca"])
def test_a_resistance_between_terminals(pair: str):
    """V = 2 R i between two terminals, whichever: what an angle of pi/7 for pi/6 has 0.3 % off."""
    found, whole = left("resistance", pair=pair)
    assert np.median(np.abs(found[0])) < 3e-4 * np.median(np.abs(whole[0]))


def test_inductance_and_resistance_between_terminals_at_every_rotor_angle():
    found, whole = left("lcr")
    assert np.all(np.abs(found) < 1e-9 * np.abs(whole).max(axis=1, keepdims=True))
