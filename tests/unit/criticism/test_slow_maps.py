"""A torque map of a few rows a second, of which the speed is logged and no angle."""

from __future__ import annotations

import numpy as np
import pytest

import pipeline
from pipeline.records.capture import Campaign
from tests.unit.estimation.signals import capture

PAIRS, R_OHM, L_H, PSI_WB = 4, 0.4, 2e-3, 0.08
DRY_NM, VISCOUS = 0.05, 2e-4
ROWS, RATE_HZ = 30, 10.0


def torque_map(share: float) -> pipeline.Recordings:
    """Nine speeds of five currents, thirty rows each; friction has a share of the torque in it."""
    rng = np.random.default_rng(2)
    speeds, currents = (
        (20.0, 60.0, 100.0, 150.0, -20.0, -60.0, -100.0, -150.0, 200.0),
        (-8, -3, 3, 6, 9),
    )
    omega, iq = (
        np.repeat(one, ROWS) for one in np.array([(w, i) for w in speeds for i in currents]).T
    )
    torque = 1.5 * PAIRS * PSI_WB * iq
    shaft = torque - (DRY_NM + share * np.abs(torque)) * np.sign(omega) - VISCOUS * omega
    noisy = {
        "vd_v": (-PAIRS * omega * L_H * iq, 0.02),
        "vq_v": (R_OHM * iq + PAIRS * omega * PSI_WB, 0.02),
        "id_a": (0.0 * iq, 2e-3),
        "iq_a": (iq, 2e-3),
        "omega_mech_rad_s": (omega, 0.02),
        "torque_shaft_nm": (shaft, 3e-3),
    }
    columns = {name: one + rng.normal(0.0, u, one.size) for name, (one, u) in noisy.items()}
    t = np.arange(omega.size) / RATE_HZ
    log = capture("torque_map", "map", t_s=t, pole_pairs=PAIRS, **columns)
    return pipeline.Recordings({"m": Campaign("m", (log,))})


@pytest.mark.parametrize(("share", "names"), [(0.03, ("load_dependent_friction",)), (0.0, ())])
def test_a_level_need_not_last_three_windows_to_be_held(share: float, names: tuple) -> None:
    """Windows of four seconds left out the torque of levels of three, without a word."""
    (found,) = pipeline.diagnose(torque_map(share)).motors.values()
    assert found.missing == names
    assert "torque_shaft_nm" in found.ladder[-1].signals
