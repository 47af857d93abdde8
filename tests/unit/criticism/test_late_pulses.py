"""Late pulses: a dead time moves them, and the drive samples its current before their middle."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.requested_model import fit_of
from tests.unit.criticism.machines import BASE, LIBRARY, coasting, log, machine

DEAD_S, PWM_S, VDC_V = 1.6e-6, 5e-5, 24.0
LOSS_V = VDC_V * DEAD_S / PWM_S
SUPPLY = {"pwm_s": PWM_S, "vdc_v": VDC_V}
MODEL = Model(machine(), (LIBRARY["dead_time"],))
VALUES = {**BASE, **zero(LIBRARY["dead_time"], MODEL), "dead_time.loss_v": LOSS_V}


def late(noise: float = 0.0, seed: int = 5) -> Segment:
    """A log of a drive whose dead time takes voltage and makes its pulses late."""
    plain = log(noise=noise, seed=seed)
    recorded = plain.recorded
    theta = recorded["theta_mech_rad"]
    omega = 7 * np.gradient(theta, plain.ts_s * np.arange(theta.size))
    current = recorded["id_a"] + 1j * recorded["iq_a"]
    legs = [np.exp(1j * (7 * theta - k * 2.0 * np.pi / 3.0)) for k in range(3)]
    lost = 2.0 / 3.0 * LOSS_V * sum(np.sign((current * one).real) / one for one in legs)
    psi = BASE["ld_h"] * current.real + BASE["psi_wb"] + 1j * BASE["lq_h"] * current.imag
    fall = 0.5 * DEAD_S * (BASE["r_ohm"] * current + 1j * omega * psi)
    moved = {
        "id_a": current.real + fall.real / BASE["ld_h"],
        "iq_a": current.imag + fall.imag / BASE["lq_h"],
        "vd_v": recorded["vd_v"] + lost.real,
        "vq_v": recorded["vq_v"] + lost.imag,
    }
    return replace(plain, recorded={**recorded, **moved}, fixed={**plain.fixed, **SUPPLY})


def left(segment: Segment, sampled: float) -> float:
    """Largest torque [N·m] that is left away from the ends."""
    found = residual(segment, MODEL, {**VALUES, "dead_time.sampled": sampled})
    return float(np.abs(found[2, 60:-60]).max())


def fitted(model: Model) -> LinearSystem:
    """A noisy log and a coast."""
    return fit_of([late(1.0), coasting()], model).system


def test_the_torque_is_that_of_the_mean_current() -> None:
    drive = late()
    plain = left(drive, 0.0)
    fastest = 7 * 100.0
    expected = 1.5 * 7 * BASE["psi_wb"] ** 2 * 0.5 * DEAD_S * fastest / BASE["lq_h"]
    assert plain == pytest.approx(expected, rel=0.3)
    assert left(drive, 1.0) < 0.03 * plain


def test_an_inverter_whose_pulses_are_not_known_samples_means() -> None:
    drive = late()
    unknown = replace(drive, fixed={"ambient_k": 0.0})
    assert left(unknown, 1.0) == left(drive, 0.0)


def test_beside_a_coast_it_is_no_friction() -> None:
    system = fitted(MODEL)
    values = system.fit.values
    assert not significant_groups(system).any()
    assert values["dead_time.sampled"] == pytest.approx(1.0, abs=0.3)
    assert values["b_nm_s_rad"] == pytest.approx(BASE["b_nm_s_rad"], rel=0.02)


def test_a_drive_without_dead_time_has_no_such_current() -> None:
    """So it hides no friction there."""
    gone = residual(late(), MODEL, {**VALUES, "dead_time.loss_v": 0.0, "dead_time.sampled": 1.0})
    plain = residual(late(), Model(machine(), ()), dict(BASE))
    assert np.array_equal(gone[2], plain[2])
