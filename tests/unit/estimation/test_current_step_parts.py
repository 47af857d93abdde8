"""Inductances along a step of current."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.estimators.current_step import along_ramp, inductances


def test_inductances_bend_with_their_own_flux() -> None:
    shared = np.array([[1e-3, 2.0, -3.0, 4.0, 5.0, 2e-3, 1.0, 6.0, -7.0, 8.0]])
    y = 0.2
    ld, lq = inductances(shared, np.array([-y]), np.array([-y]))
    d = 1.0 + 2.0 * -y - 3.0 * y**2 + 4.0 * -(y**3) + 5.0 * y**4
    q = 1.0 + y**2 + 6.0 * y**3 - 7.0 * y**4 + 8.0 * y**5
    assert ld[0] == pytest.approx(1e-3 / d)
    assert lq[0] == pytest.approx(2e-3 / q)
    runaway = np.array([[1e-3, -9.0, 0, 0, 0, 2e-3, -90.0, 0, 0, 0]])
    ld, lq = inductances(runaway, np.array([0.5]), np.array([0.5]))
    assert (ld[0], lq[0]) == (pytest.approx(1e-3 / 0.05), pytest.approx(2e-3 / 0.05))


def test_inductance_along_a_ramp() -> None:
    """L = L0/(1 + a y) of the d axis: i L0 = y + a y^2/2: 1 + a y = sqrt(1 + 2 a L0 i)."""
    shared = np.array([1e-3, 40.0, 0, 0, 0, 2e-3, 0, 0, 0, 0])
    ramp = np.linspace(0.0, 5.0, 200)
    found = along_ramp(shared, 1.0, ramp)
    i_d = ramp * 2.0 / math.sqrt(3.0)
    assert found == pytest.approx(2.0 * 1e-3 / np.sqrt(1.0 + 2.0 * 40.0 * 1e-3 * i_d), rel=1e-5)
    between = along_ramp(np.array([1e-3, 0, 0, 0, 0, 2e-3, 0, 0, 0, 0.0]), 0.6, ramp)
    assert between == pytest.approx(2.0 * (0.36 * 1e-3 + 0.64 * 2e-3))
