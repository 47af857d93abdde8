"""A coast ends where the shaft stands, not where its smoothed speed has faded."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.criticism.equations.free_shaft import _coasts
from pipeline.criticism.policy.policy import DEFAULT

STEP_RAD = 2.0 * np.pi / 16384
RATE_HZ = 1000.0


def stops(rows: int, after: int, sense: float = 1.0, noise_rad: float = 0.0) -> np.ndarray:
    """Angle of a shaft that dry friction alone stops, and that then stands, as an encoder's."""
    t_s = np.minimum(np.arange(rows + after), rows) / RATE_HZ
    deceleration = 200.0 / (rows / RATE_HZ)
    theta = sense * (200.0 * t_s - 0.5 * deceleration * t_s**2)
    theta += noise_rad * np.random.default_rng(3).normal(size=theta.size)
    return np.round(theta / STEP_RAD) * STEP_RAD


@pytest.mark.parametrize("window", [32, 64])
@pytest.mark.parametrize(("sense", "noise_rad"), [(1.0, 0.0), (-1.0, 0.0), (1.0, 3e-4)])
def test_no_row_at_rest_counts_and_few_that_turn_are_lost(
    window: int, sense: float, noise_rad: float
) -> None:
    """Cogging was named for a shaft that friction held in some place of rest."""
    free = _coasts(stops(250, 200, sense, noise_rad), window, DEFAULT)
    last = int(np.flatnonzero(free)[-1])
    # the last rows turn by less than an encoder's step, or than its noise
    assert 238 <= last <= 250


def test_a_record_that_ends_before_the_stop_is_whole() -> None:
    whole = stops(250, 0)[:180]
    assert np.flatnonzero(_coasts(whole, 32, DEFAULT))[-1] >= 178


def test_a_shaft_that_creeps_on_is_no_shaft_at_rest() -> None:
    """Viscous friction leaves a slow motion, which counts as far as the speed says."""
    t_s = np.arange(4000) / RATE_HZ
    theta = np.round(200.0 * 0.4 * -np.expm1(-t_s / 0.4) / STEP_RAD) * STEP_RAD
    last = int(np.flatnonzero(_coasts(theta, 32, DEFAULT))[-1])
    assert last == pytest.approx(0.4 * np.log(200.0) * RATE_HZ, abs=40)
