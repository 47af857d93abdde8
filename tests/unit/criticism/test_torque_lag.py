"""The lag of a torque sensor is its time constant, whatever the stamps of its samples are."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import least_squares

from pipeline.criticism.effect import Recorded
from pipeline.criticism.effects.torque_lag import EFFECT
from pipeline.simulator.sensors import first_order_lag

TS = 1e-4
WAVES = 2.0 * np.pi * np.array([3.0, 17.0, 41.0, 80.0, 130.0])
TIME = TS * np.arange(8000)
SETTLED = slice(2000, -50)


def torque(t_s: np.ndarray, tau_s: float = 0.0) -> np.ndarray:
    """A torque of five waves [n], behind a first-order lag."""
    angle = np.outer(t_s, WAVES) + np.arange(WAVES.size)
    return np.imag(np.exp(1j * angle) / (1.0 + 1j * WAVES * tau_s)).sum(axis=1)


def undone(recorded: np.ndarray, lag_s: float, late: float) -> np.ndarray:
    nothing = np.zeros(recorded.size)
    told = Recorded(nothing + 0j, recorded, nothing, nothing, TS, True, "drive")
    return EFFECT.load(told, {"lag_s": lag_s, "late": late})


def fitted(recorded: np.ndarray) -> np.ndarray:
    """Lag in samples, and lateness, that undo the recording best."""
    true = torque(TIME)
    found = least_squares(lambda q: (undone(recorded, q[0] * TS, q[1]) - true)[SETTLED], [5.0, 0.0])
    return found.x


@pytest.mark.parametrize("samples", [3.0, 10.0, 100.0])
@pytest.mark.parametrize("late", [-0.5, 0.0, 0.5, 1.0])
def test_a_late_stamp_is_no_part_of_the_lag(samples, late):
    lag, told = fitted(torque(TIME - late * TS, samples * TS))
    assert lag == pytest.approx(samples, rel=0.004)
    assert told == pytest.approx(late, abs=0.01)


@pytest.mark.parametrize("samples", [3.0, 10.0, 100.0])
def test_the_simulated_sensor_has_the_lag_that_it_was_given(samples):
    lag, _ = fitted(first_order_lag(torque(TIME), 1.0 / samples))
    assert lag == pytest.approx(samples, rel=0.02)


def test_lateness_vanishes_with_the_lag_and_leaves_no_kink():
    recorded = torque(TIME)
    for late in (-2.0, 0.5, 2.0):
        assert np.array_equal(undone(recorded, 0.0, late), recorded)
        lags = np.linspace(0.0, 4.0, 81) * TS
        path = np.array([undone(recorded, lag, late)[1234] for lag in lags])
        assert np.abs(np.diff(path, 2)).max() < 0.2 * np.abs(np.diff(path)).max()
