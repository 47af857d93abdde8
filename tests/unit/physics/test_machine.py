"""The ideal machine's equations against energy and against a case worked by hand."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.physics.machine import DqMeans, air_gap_torque, dq_voltages

PAIRS, R, LD, LQ, PSI = 4.0, 0.3, 2e-4, 3e-4, 0.01


def test_power_that_is_not_heat_turns_the_shaft() -> None:
    """At held currents 1.5 (v·i) − 1.5 R i² = T ω, whatever the currents and the speed."""
    rng = np.random.default_rng(4)
    id_a, iq_a, omega = rng.normal(0, 10, 50), rng.normal(0, 10, 50), rng.normal(0, 500, 50)
    nothing = np.zeros(50)
    state = DqMeans(id_a, iq_a, nothing, nothing, PAIRS * omega)
    vd, vq = dq_voltages(state, np.full(50, R), LD, LQ, np.full(50, PSI))
    kt = np.full(50, 1.5 * PAIRS * PSI)
    torque = air_gap_torque(id_a, iq_a, kt, PAIRS, LD - LQ)
    power = 1.5 * (vd * id_a + vq * iq_a) - 1.5 * R * (id_a**2 + iq_a**2)
    np.testing.assert_allclose(power, torque * omega, rtol=1e-12, atol=1e-9)


def test_a_case_by_hand() -> None:
    one = np.ones(1)
    state = DqMeans(2 * one, 3 * one, 1000 * one, -500 * one, 100 * one)
    vd, vq = dq_voltages(state, R * one, LD, LQ, PSI * one)
    assert vd[0] == pytest.approx(0.6 + 0.2 - 0.09)
    assert vq[0] == pytest.approx(0.9 - 0.15 + 0.04 + 1.0)
