"""Coasts of one sense: a constant load, and what friction has more in it, are friction there."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.estimators import inertia
from pipeline.records.capture import Capture
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, estimates, known_value

KT, J_KGM2, DRY_NM, VISCOUS = 0.5, 2e-3, 0.05, 4e-4
STEP_S, ROW = 1e-4, 10
"""Steps of the integration, and how many a row."""


def turned(
    name: str, current: np.ndarray, omega: float, load_nm: float, by_sense: float = 0.0
) -> Capture:
    """A shaft under a current [n, A] by steps and a load, its angle known to 0.4 mrad; friction has
    that share more forward and less backward.
    """
    theta, angles = 0.0, np.empty(current.size)
    for n, ampere in enumerate(current):
        friction = DRY_NM * math.tanh(omega / 0.05) + VISCOUS * omega
        drag = (1.0 + by_sense * math.copysign(1.0, omega)) * friction + load_nm
        omega += STEP_S / J_KGM2 * (KT * ampere - drag)
        theta += STEP_S * omega
        angles[n] = theta
    rng = np.random.default_rng(2)
    rows = slice(None, None, ROW)
    count = 2.0 * math.pi / 16384
    columns = {
        "t_s": STEP_S * np.arange(current.size)[rows],
        "theta_mech_rad": count * np.floor(angles[rows] / count),
    }
    if name == "drive":
        measured = current[rows] + rng.normal(0.0, 2e-3, columns["t_s"].size)
        columns |= {"iq_a": measured, "id_a": rng.normal(0.0, 2e-3, measured.size)}
    return capture(name, name, **columns)


def driven(load_nm: float, by_sense: float = 0.0) -> Capture:
    """Six seconds of levels of current either way."""
    levels = np.random.default_rng(1).uniform(0.15, 0.7, 20) * np.tile([1.0, -1.0], 10)
    return turned("drive", np.repeat(levels, 3000), 0.0, load_nm, by_sense)


@pytest.mark.parametrize("load_nm", [0.0, 0.03])
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_a_load_is_no_friction_of_a_coast_of_one_sense(load_nm: float, sense: float) -> None:
    coast = turned("spin_down", np.zeros(20_000), 120.0 * sense, load_nm)
    known = Constants((known_value("kt_peak_nm_a", KT, 1e-3 * KT),))
    found = estimates(inertia.ESTIMATOR, driven(load_nm), coast, known=known)
    for name, true in (("j_rotor_kgm2", J_KGM2), ("torque_coulomb_nm", DRY_NM)):
        assert found[name].number == pytest.approx(true, rel=0.03)
        assert abs(found[name].number - true) < 3.5 * found[name].u
    viscous = found["b_visc_nm_s_rad"]
    assert abs(viscous.number - VISCOUS) < 3.5 * viscous.u
    assert viscous.u < 0.2 * VISCOUS


def test_friction_of_one_sense_is_not_that_of_both() -> None:
    """A forward coast alone gave B of the forward sense, at 72 of its uncertainties."""
    coast = turned("spin_down", np.zeros(20_000), 120.0, 0.0, 0.2)
    known = Constants((known_value("kt_peak_nm_a", KT, 1e-3 * KT),))
    found = estimates(inertia.ESTIMATOR, driven(0.0, 0.2), coast, known=known)
    for name, true in (("torque_coulomb_nm", DRY_NM), ("b_visc_nm_s_rad", VISCOUS)):
        assert abs(found[name].number - true) < 3.0 * found[name].u
        assert found[name].u < 0.3 * true
