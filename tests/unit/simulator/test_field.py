"""The field of the motor is one energy: currents and torque are its gradient, whatever is on."""

import math

import numpy as np
import pytest

from pipeline.simulator.field import (
    cogging,
    current,
    energy,
    flux,
    fluxes,
    inductances,
    open_emf,
    open_flux,
    stiffness,
    torque_of,
    torques,
)
from pipeline.simulator.plant import plant_of
from tests.simulated import design

EVERYTHING = {
    "saturation": {"size": 0.2, "size_d": 0.12},
    "cross_saturation": 0.15,
    "bemf_harmonics": 0.03,
    "inductance_harmonics": {"size": 0.15},
}
POINTS = [(-0.9, 0.8, 0.3), (0.4, -1.1, 1.9), (0.0, 0.0, 4.4), (-0.2, 0.1, 5.9), (1.0, 1.0, 2.7)]


BASE = design("servo-ipm")
PLANTS = [
    plant_of(BASE),
    plant_of(BASE.having(**EVERYTHING)),
    plant_of(BASE.having(**{**EVERYTHING, "saturation": {"size": 0.2, "form": 1.0}})),
]


@pytest.mark.parametrize("plant", PLANTS, ids=["design", "power", "sinh"])
@pytest.mark.parametrize(("share_d", "share_q", "eps"), POINTS)
def test_currents_are_the_gradient_of_the_energy(plant, share_d, share_q, eps):
    d, q = flux(14.0 * share_d, 14.0 * share_q, eps, 40.0, plant)
    i_d, i_q, w_eps = current(d, q, eps, 40.0, plant)
    h = 1e-6

    def slope(step_d, step_q, step_eps):
        up = energy(d + step_d, q + step_q, eps + step_eps, 40.0, plant)
        down = energy(d - step_d, q - step_q, eps - step_eps, 40.0, plant)
        return (up - down) / (2.0 * h) / 1.5

    assert i_d == pytest.approx(slope(h, 0, 0), rel=1e-6, abs=1e-6)
    assert i_q == pytest.approx(slope(0, h, 0), rel=1e-6, abs=1e-6)
    assert w_eps == pytest.approx(slope(0, 0, h), rel=1e-6, abs=1e-6)


@pytest.mark.parametrize("plant", PLANTS, ids=["design", "power", "sinh"])
@pytest.mark.parametrize(("share_d", "share_q", "eps"), POINTS)
def test_torque_is_the_energy_lost_by_turning_at_constant_phase_flux(plant, share_d, share_q, eps):
    """T = -dE/dtheta with the stator's flux vector held: the definition, by differences."""
    d, q = flux(14.0 * share_d, 14.0 * share_q, eps, 25.0, plant)
    vector = complex(d, q) * np.exp(1j * eps)
    h = 1e-6

    def stored(theta):
        turned = vector * np.exp(-1j * plant.pole_pairs * theta)
        return energy(turned.real, turned.imag, plant.pole_pairs * theta, 25.0, plant)

    theta = eps / plant.pole_pairs
    expected = -(stored(theta + h) - stored(theta - h)) / (2.0 * h)
    i_d, i_q, w_eps = current(d, q, eps, 25.0, plant)
    scale = 1.5 * plant.pole_pairs * plant.psi_wb * 14.0
    assert torque_of(d, q, i_d, i_q, w_eps, plant) == pytest.approx(expected, abs=1e-6 * scale)


@pytest.mark.parametrize("plant", PLANTS, ids=["design", "power", "sinh"])
@pytest.mark.parametrize(("share_d", "share_q", "eps"), POINTS)
def test_flux_map_is_reciprocal_and_its_stiffness_its_derivative(plant, share_d, share_q, eps):
    d, q = flux(14.0 * share_d, 14.0 * share_q, eps, 25.0, plant)
    h = 1e-7
    by_d = np.subtract(current(d + h, q, eps, 25.0, plant), current(d - h, q, eps, 25.0, plant))
    by_q = np.subtract(current(d, q + h, eps, 25.0, plant), current(d, q - h, eps, 25.0, plant))
    by_d, by_q = by_d / (2 * h), by_q / (2 * h)
    g_dd, g_qq, g_dq = stiffness(d, q, eps, 25.0, plant)
    assert by_d[1] == pytest.approx(by_q[0], rel=1e-5, abs=1e-3)
    assert (g_dd, g_qq) == pytest.approx((by_d[0], by_q[1]), rel=1e-5)
    assert g_dq == pytest.approx(by_q[0], rel=1e-5, abs=1e-3)


@pytest.mark.parametrize("plant", PLANTS, ids=["design", "power", "sinh"])
@pytest.mark.parametrize(("share_d", "share_q", "eps"), POINTS)
def test_flux_of_a_current_carries_that_current(plant, share_d, share_q, eps):
    i_d, i_q, _ = current(*flux(14.0 * share_d, 14.0 * share_q, eps, 80.0, plant), eps, 80.0, plant)
    assert (i_d, i_q) == pytest.approx((14.0 * share_d, 14.0 * share_q), abs=1e-10)


def test_linear_motor_has_the_textbook_torque():
    motor = design("gimbal-5208")
    plant = plant_of(motor)
    i_d, i_q = np.array([-4.0]), np.array([7.0])
    expected = 1.5 * 7 * (7.1e-3 * 7.0 + (1.9e-4 - 2.35e-4) * -4.0 * 7.0)
    assert torques(i_d, i_q, np.array([0.4]), 25.0, plant)[0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("form", [0.0, 1.0])
def test_saturation_size_is_the_fall_of_the_apparent_inductance(form):
    motor = design("gimbal-5208").having(
        saturation={"size": 0.25, "size_d": 0.1, "form": form}, cross_saturation=0.07
    )
    plant, rated = plant_of(motor), motor.current_rated_a
    _, psi_q = flux(0.0, rated, 0.0, 25.0, plant_of(motor.having(cross_saturation=0.0)))
    assert psi_q / rated == pytest.approx(0.75 * motor.lq_h, rel=1e-9)
    psi_d, _ = flux(rated, 0.0, 0.0, 25.0, plant)
    assert (psi_d - motor.psi_pm_wb) / rated == pytest.approx(0.9 * motor.ld_h, rel=1e-9)
    near = inductances(np.zeros(1), 25.0, plant)[0]
    assert near[:2] == pytest.approx((motor.ld_h, motor.lq_h), rel=1e-12)


def test_cross_saturation_lowers_lq_under_d_current_and_nothing_else_at_rest():
    motor = design("gimbal-5208").having(cross_saturation=0.08)
    plant, rated = plant_of(motor), motor.current_rated_a
    small = 1e-6 * rated
    _, psi_q = flux(rated, small, 0.0, 25.0, plant)
    assert psi_q / small == pytest.approx(0.92 * motor.lq_h, rel=1e-6)
    _, at_zero = flux(0.0, small, 0.0, 25.0, plant)
    assert at_zero / small == pytest.approx(motor.lq_h, rel=1e-6)


def test_back_emf_harmonics_are_those_of_the_phase_flux():
    """Amplitudes of the 5th and 7th in phase a, straight from its Fourier series."""
    motor = design("gimbal-5208").having(bemf_harmonics={"size": 0.02, "seventh": 0.5})
    eps = np.arange(512) * 2 * np.pi / 512
    phases = open_flux(eps, np.full(512, 25.0), plant_of(motor))
    lines = 2.0 * np.abs(np.fft.rfft(phases[:, 0])) / 512 / motor.psi_pm_wb
    assert lines[[1, 5, 7]] == pytest.approx([1.0, 0.02, 0.01], rel=1e-9)
    assert lines[[2, 3, 4, 6, 9]] == pytest.approx(0.0, abs=1e-12)
    assert phases.sum(axis=1) == pytest.approx(0.0, abs=1e-15)


def test_open_voltage_is_the_derivative_of_open_flux():
    plant = plant_of(design("gimbal-5208").having(bemf_harmonics=0.05))
    eps, h = np.linspace(0.0, 6.0, 50), 1e-6
    cold = np.full(50, 25.0)
    expected = 300.0 * (open_flux(eps + h, cold, plant) - open_flux(eps - h, cold, plant)) / (2 * h)
    emf = open_emf(eps, np.full(50, 300.0), cold, plant)
    assert emf == pytest.approx(expected, abs=1e-6)


def test_inductance_harmonics_turn_six_times_an_electrical_turn():
    plant = plant_of(design("gimbal-5208").having(inductance_harmonics={"size": 0.1}))
    eps = np.arange(360) * 2 * np.pi / 360
    l_q = inductances(eps, 25.0, plant)[:, 1]
    lines = np.abs(np.fft.rfft(1.0 / l_q)) / 360
    assert 2.0 * lines[6] / lines[0] == pytest.approx(0.1, rel=1e-9)
    i_q = np.full(360, 9.0)
    ripple = torques(np.zeros(360), i_q, eps, 25.0, plant)
    assert 2.0 * np.abs(np.fft.rfft(ripple))[6] / 360 > 1e-4
    psi = fluxes(np.zeros(360), i_q, eps, 25.0, plant)
    assert np.ptp(psi[:, 1]) / np.mean(psi[:, 1]) == pytest.approx(0.2, rel=0.02)


def test_cogging_orders_and_phase():
    motor = design("servo-15kw").having(cogging={"size": 0.4, "second": 0.5, "order_slots": 0.0})
    plant = plant_of(motor)
    theta = np.arange(1024) * 2 * np.pi / 1024
    lines = 2.0 * np.abs(np.fft.rfft([cogging(x, plant) for x in theta])) / 1024
    assert math.lcm(60, 10) == 60
    assert lines[[60, 120]] == pytest.approx([0.4, 0.2], rel=1e-9)
    assert np.sum(lines > 1e-9) == 2


def test_too_much_saturation_is_refused():
    with pytest.raises(ValueError, match="no inverse"):
        plant_of(design("gimbal-5208").having(saturation={"size": 0.1, "size_d": 0.5}))
