"""Late pulses: a drive samples its current before their middle, off in proportion to speed."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.requested_model import fit_of
from tests.unit.criticism.machines import BASE, coasting, log, machine

LATE_S = 0.8e-6


def late(noise: float = 0.0, seed: int = 5) -> Segment:
    """A plain machine's log, its current sampled so long before the middle of its pulses."""
    plain = log(noise=noise, seed=seed)
    recorded = plain.recorded
    time = plain.ts_s * np.arange(recorded["iq_a"].size)
    omega = 7 * np.gradient(recorded["theta_mech_rad"], time)
    current = recorded["id_a"] + 1j * recorded["iq_a"]
    psi = BASE["ld_h"] * current.real + BASE["psi_wb"] + 1j * BASE["lq_h"] * current.imag
    volts = LATE_S * (BASE["r_ohm"] * current + 1j * omega * psi)
    moved = {
        "id_a": recorded["id_a"] + volts.real / BASE["ld_h"],
        "iq_a": recorded["iq_a"] + volts.imag / BASE["lq_h"],
    }
    return replace(plain, recorded={**recorded, **moved})


def left(segment: Segment, **changed: float) -> float:
    """Largest torque [N·m] that is left away from the ends."""
    found = residual(segment, Model(machine(), ()), {**BASE, **changed})
    return float(np.abs(found[2, 60:-60]).max())


def test_the_torque_of_a_late_pulse_is_that_of_its_middle() -> None:
    drive = late()
    plain = left(drive)
    kt = 1.5 * 7 * BASE["psi_wb"]
    fastest = 7 * 100.0
    expected = kt * LATE_S * fastest * BASE["psi_wb"] / BASE["lq_h"]
    assert plain == pytest.approx(expected, rel=0.3)
    assert left(drive, sampled_s=LATE_S) < 0.03 * plain
    assert left(drive, sampled_s=-LATE_S) > 1.9 * plain


def test_beside_a_coast_it_is_no_friction() -> None:
    """Without it the drives' viscous friction contradicts that of the coast."""
    logs = [replace(late(0.1, seed), capture=f"log_{seed}") for seed in (5, 6)]
    system = fit_of([*logs, coasting()], Model(machine(), ())).system
    assert not significant_groups(system).any()
    assert system.fit.values["sampled_s"] == pytest.approx(LATE_S, rel=0.3)
    assert system.fit.values["b_nm_s_rad"] == pytest.approx(BASE["b_nm_s_rad"], rel=0.05)
