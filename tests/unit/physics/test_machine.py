"""Machine and shaft equations against power, differences and closed cases."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.physics.machine import linear_flux_wb, steady_flux_wb, steady_voltage_v, torque_nm
from pipeline.physics.mechanics import coast_rad_s, cogging_order, friction_nm

LD, LQ, PSI, R, P = 0.8e-3, 1.3e-3, 0.02, 0.3, 7
CURRENT = np.array([0.0 + 4.0j, -3.0 + 5.0j, 2.0 - 1.0j])


def test_flux_of_each_axis() -> None:
    flux = linear_flux_wb(CURRENT, LD, LQ, PSI)
    assert flux.real == pytest.approx([0.02, 0.0176, 0.0216])
    assert flux.imag == pytest.approx([5.2e-3, 6.5e-3, -1.3e-3])


def test_air_gap_power_is_torque_times_speed() -> None:
    """P = 1.5 Re(v i*) less copper loss 1.5 R |i|² turns the shaft."""
    omega_mech = 80.0
    flux = linear_flux_wb(CURRENT, LD, LQ, PSI)
    volts = steady_voltage_v(CURRENT, flux, R, P * omega_mech)
    power = 1.5 * (volts * np.conj(CURRENT)).real - 1.5 * R * np.abs(CURRENT) ** 2
    assert torque_nm(flux, CURRENT, P) * omega_mech == pytest.approx(power)
    by_hand = 1.5 * P * (PSI * CURRENT.imag + (LD - LQ) * CURRENT.real * CURRENT.imag)
    assert torque_nm(flux, CURRENT, P) == pytest.approx(by_hand)


def test_voltage_by_axis_and_flux_back() -> None:
    omega = 500.0
    flux = linear_flux_wb(CURRENT, LD, LQ, PSI)
    volts = steady_voltage_v(CURRENT, flux, R, omega)
    assert volts.real == pytest.approx(R * CURRENT.real - omega * LQ * CURRENT.imag)
    assert volts.imag == pytest.approx(R * CURRENT.imag + omega * (LD * CURRENT.real + PSI))
    assert steady_flux_wb(volts, CURRENT, R, omega) == pytest.approx(flux)


def test_coasting_solves_its_equation() -> None:
    t = np.linspace(0.0, 2.0, 20001)
    omega = coast_rad_s(t, 100.0, 12.0, 0.4)
    slope = np.gradient(omega, t)
    assert slope[1:-1] == pytest.approx(-12.0 - 0.4 * omega[1:-1], rel=1e-6)
    assert coast_rad_s(t, 100.0, 12.0, 0.0) == pytest.approx(100.0 - 12.0 * t)
    assert float(coast_rad_s(1e3, 100.0, 12.0, 0.4)) == 0.0


def test_friction_opposes_rotation() -> None:
    assert friction_nm([-10.0, 0.0, 10.0], 0.02, 1e-3) == pytest.approx([-0.03, 0.0, 0.03])


@pytest.mark.parametrize(
    ("slots", "pole_pairs", "order"), [(12, 7, 84), (18, 12, 72), (12, 5, 60), (9, 3, 18)]
)
def test_cogging_order(slots: int, pole_pairs: int, order: int) -> None:
    assert cogging_order(slots, pole_pairs) == order
