"""Waves that turn with the rotor and are no noise of the sensor that shows them."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.criticism.data.locked_waves import LockedWaves
from pipeline.criticism.data.sensors import noise_and_steps, sensor_noise
from pipeline.criticism.policy.policy import DEFAULT

SENSORS = DEFAULT.sensor_noise
ORDERS = (30.0, 60.0)


def turning(rows: int, turn_rad: float) -> np.ndarray:
    """An angle whose 30th order turns so far from row to row, and a tenth further at the end."""
    return np.cumsum(np.linspace(turn_rad, 1.1 * turn_rad, rows)) / ORDERS[0]


@pytest.mark.parametrize("turn_rad", [0.9, 1.6, 2.9, 9.7])
@pytest.mark.parametrize("rows_a_level", [50, 4000])
def test_a_ripple_of_few_rows_a_wave_is_no_noise(turn_rad, rows_a_level):
    rng = np.random.default_rng(int(10 * turn_rad))
    theta = turning(4000, turn_rad)
    levels = np.repeat(rng.normal(0.0, 20.0, 4000 // rows_a_level), rows_a_level)
    white = rng.normal(0.0, 0.1, theta.size)
    signal = levels + white + 2.0 * np.cos(ORDERS[0] * theta + 0.4)
    waves = LockedWaves.of(theta, ORDERS, SENSORS)
    assert sensor_noise(signal, SENSORS) > 0.25
    assert 0.085 < sensor_noise(signal, SENSORS, waves=waves) < 0.135


def test_the_noise_of_a_signal_without_waves_stays_what_it_is():
    rng = np.random.default_rng(5)
    theta = turning(4000, 1.6)
    signal = 3.0 * np.sin(np.linspace(0.0, 9.0, theta.size)) + rng.normal(0.0, 0.1, theta.size)
    waves = LockedWaves.of(theta, ORDERS, SENSORS)
    assert sensor_noise(signal, SENSORS, waves=waves) == sensor_noise(signal, SENSORS)


@pytest.mark.parametrize("width", [12, 48])
@pytest.mark.parametrize("turn_rad", [0.05, 0.9, 3.0])
def test_what_a_fit_takes_of_white_noise_is_made_up_for(width, turn_rad):
    rng = np.random.default_rng(width)
    third = np.diff(rng.normal(0.0, 1.0, 40_000), 3)
    remainder = LockedWaves.of(turning(40_000, turn_rad), ORDERS, SENSORS).remainder(third, width)
    assert np.square(remainder).mean() == pytest.approx(20.0, rel=0.03)


def test_a_rotor_at_rest_has_no_waves():
    third = np.diff(np.random.default_rng(2).normal(0.0, 1.0, 960), 3)
    still = LockedWaves.of(np.full(960, 1.3), ORDERS, SENSORS)
    assert still.remainder(third, 48) == pytest.approx(third[: third.size // 48 * 48])


def test_a_wave_of_a_current_stays_in_its_noise():
    """Between the rows it is not known: straight lines miss it."""
    rng, theta = np.random.default_rng(8), turning(4000, 1.6)
    wave = 2.0 * np.cos(ORDERS[0] * theta) + rng.normal(0.0, 0.1, theta.size)
    columns = {"theta_mech_rad": theta, "iq_a": wave, "vq_v": wave}
    noise, _ = noise_and_steps(columns, SENSORS, ORDERS)
    assert noise["vq_v"] < 0.135
    assert noise["iq_a"] > 0.25
