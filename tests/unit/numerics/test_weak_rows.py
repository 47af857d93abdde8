"""Weak-form integrals against closed forms, on even and jittered clocks."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.weak_rows import smooth_speed, weak_rows


def clock(jitter: float) -> np.ndarray:
    rng = np.random.default_rng(3)
    t = np.arange(0.0, 1.0, 1e-3)
    return np.sort(t + rng.uniform(-jitter, jitter, t.size) * 1e-3)


@pytest.mark.parametrize("jitter", [0.0, 0.45])
def test_exact_on_polynomials(jitter: float) -> None:
    t = clock(jitter)
    rows = weak_rows(t, 0.05)
    ones = np.ones(rows.count)
    assert rows.integral(np.full(t.size, 7.0)) == pytest.approx(7.0 * ones, rel=1e-12)
    assert rows.integral(3.0 - 4.0 * t, 1) == pytest.approx(-4.0 * ones, rel=1e-9)
    parabola = 2.0 + 5.0 * t - 1.5 * t**2
    assert rows.integral(parabola, 2) == pytest.approx(-3.0 * ones, rel=1e-6)


def test_derivatives_of_a_sine_agree_with_the_sine() -> None:
    """integral(phi x'') of sin(9 t) is -81 integral(phi x): partial integration, no derivative."""
    t = clock(0.0)
    rows = weak_rows(t, 0.05)
    x = np.sin(9.0 * t)
    scale = float(np.max(np.abs(rows.integral(x))))
    assert np.max(np.abs(rows.integral(x, 2) + 81.0 * rows.integral(x))) < 1e-5 * 81.0 * scale
    assert np.max(np.abs(rows.integral(x, 1) - 9.0 * rows.integral(np.cos(9.0 * t)))) < 1e-5 * 9.0


def test_noise_gain_is_the_scatter_of_white_noise() -> None:
    t = np.arange(0.0, 40.0, 1e-3)
    rows = weak_rows(t, 0.02, overlap=0.0)
    noise = np.random.default_rng(0).standard_normal(t.size)
    for order in (0, 1, 2):
        seen = float(np.std(rows.integral(noise, order)))
        assert seen == pytest.approx(rows.noise_gain(order), rel=0.08)


def test_windows_do_not_bridge_a_gap() -> None:
    t = np.concatenate([np.arange(0.0, 0.2, 1e-3), np.arange(0.5, 0.7, 1e-3)])
    rows = weak_rows(t, 0.05)
    ends = t[rows.starts + rows.sizes - 1]
    assert np.all((ends < 0.2) | (t[rows.starts] >= 0.5))
    with pytest.raises(ValueError, match="no window"):
        weak_rows(np.arange(5) * 1e-3, 0.004)


@pytest.mark.parametrize("jitter", [0.0, 0.45])
def test_smooth_speed_is_the_slope(jitter: float) -> None:
    t = clock(jitter)
    speed = smooth_speed(t, 1e3 + 250.0 * t - 40.0 * t**2, 0.01)
    inner = slice(10, -10)
    assert speed[inner] == pytest.approx((250.0 - 80.0 * t)[inner], rel=5e-4)


def test_smooth_speed_of_a_long_record_is_that_of_a_short_one() -> None:
    """After ten minutes at 10 kHz a window adds less than a sum over the record is rounded to."""
    t = np.arange(6_000_000) * 1e-4
    speed = smooth_speed(t, 100.0 * t + 0.5 * np.sin(30.0 * t), 0.005)
    inner = slice(100, -100)
    assert speed[inner] == pytest.approx((100.0 + 15.0 * np.cos(30.0 * t))[inner], abs=0.02)
