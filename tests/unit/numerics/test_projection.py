"""Smooth windows times shaft orders: derivatives move onto the window, orders stay apart."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.projection import bump, projection, window_starts


def test_the_window_is_a_known_polynomial():
    window = bump(4)
    u = np.array([-0.75, -0.25, 0.25, 0.75])
    assert window == pytest.approx((1 - u**2) ** 4)


def test_a_central_difference_projects_to_minus_the_windows_own_derivative():
    """sum(phi x') = -sum(phi' x) although x is noise, which no difference quotient survives."""
    rng, n, length, period = np.random.default_rng(3), 400, 200, 1e-3
    signal = rng.normal(size=n)
    slope = np.zeros(n)
    slope[1:-1] = (signal[2:] - signal[:-2]) / (2 * period)
    starts = np.array([60])
    weak = projection(np.zeros(n), starts, length, ()).project(slope[None])[0, 0, 0]
    fine = (2 * np.arange(length) + 1) / length - 1
    derivative = -8 * fine * (1 - fine**2) ** 3 * 2 / (length * period)
    norm = np.sqrt((bump(length) ** 2).sum())
    expected = -(derivative * signal[60:260]).sum() / norm
    assert weak == pytest.approx(expected, rel=1e-3)


def test_an_order_is_seen_by_its_own_functions_only():
    theta = np.linspace(0, 20 * np.pi, 4000)
    weak = projection(theta, np.array([0]), 4000, (3, 11))
    told = weak.project(np.sin(11 * theta)[None])[0, 0]
    own = weak.orders == 11
    assert np.hypot(*told[own]) > 30.0
    assert np.abs(told[~own]).max() < 1e-3


def test_an_order_with_too_few_cycles_or_samples_is_left_out():
    theta = np.linspace(0, 2 * np.pi, 320)
    weak = projection(theta, np.array([0]), 320, (2, 8, 40))
    assert sorted(set(weak.orders.tolist())) == [0, 8]


def test_windows_with_an_unusable_sample_are_left_out():
    keep = np.ones(1000, dtype=bool)
    keep[510] = False
    starts = window_starts(keep, 100, 100)
    assert starts.tolist() == [0, 100, 200, 300, 400, 600, 700, 800, 900]
    assert window_starts(keep, 100, 100, most=3).size == 3
