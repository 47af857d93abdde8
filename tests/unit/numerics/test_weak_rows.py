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


@pytest.mark.slow
def test_smooth_speed_of_a_long_record_is_that_of_a_short_one() -> None:
    """After ten minutes at 10 kHz a window adds less than a sum over the record is rounded to."""
    t = np.arange(6_000_000) * 1e-4
    speed = smooth_speed(t, 100.0 * t + 0.5 * np.sin(30.0 * t), 0.005)
    inner = slice(100, -100)
    assert speed[inner] == pytest.approx((100.0 + 15.0 * np.cos(30.0 * t))[inner], abs=0.02)


def test_windows_of_an_even_clock_are_where_the_overlap_puts_them() -> None:
    """A second at 1 kHz, windows of 51 samples, half of them shared: one every 25 samples."""
    t = np.arange(1001) * 1e-3
    rows = weak_rows(t, 0.05)
    assert rows.starts.tolist() == list(range(0, 951, 25))
    assert set(rows.sizes.tolist()) == {51}
    assert rows.centres_s == pytest.approx(0.025 + 0.025 * np.arange(39))
    assert rows.members.size == 0
    assert weak_rows(t, 0.05, overlap=0.0).starts.tolist() == list(range(0, 951, 50))
    assert weak_rows(t, 0.05, overlap=0.8).count == 96


def test_an_uneven_clock_has_windows_of_one_width_in_time() -> None:
    t = np.sort(np.random.default_rng(1).uniform(0.0, 1.0, 1500))
    rows = weak_rows(t, 0.1)
    ends = t[rows.starts + rows.sizes - 1]
    assert (ends - t[rows.starts] <= 0.1 + 1e-9).all()
    assert (ends - t[rows.starts] > 0.09).all()
    assert rows.centres_s == pytest.approx(0.5 * (t[rows.starts] + ends))
    assert np.diff(rows.centres_s) == pytest.approx(0.05, abs=0.01)
    assert rows.members.size == rows.sizes.sum()
    assert rows.members[: rows.sizes[0]].tolist() == list(range(rows.sizes[0]))


@pytest.mark.parametrize(("missing", "windows"), [(11, 39), (13, 37)])
def test_a_gap_of_a_quarter_of_the_window_ends_it(missing: int, windows: int) -> None:
    """51 samples of 1 ms span 50 ms; 12 ms are bridged; 14 ms fall into two windows."""
    t = np.delete(np.arange(1001) * 1e-3, np.arange(510, 510 + missing))
    rows = weak_rows(t, 0.05)
    assert rows.count == windows


def test_nine_samples_are_a_window_and_eight_are_none() -> None:
    assert weak_rows(np.arange(9) * 1e-3, 8e-3).sizes.tolist() == [9]
    with pytest.raises(ValueError, match="no window"):
        weak_rows(np.arange(8) * 1e-3, 7e-3)


@pytest.mark.parametrize("jitter", [0.0, 0.45])
def test_the_weight_is_the_fourth_power_of_a_parabola(jitter: float) -> None:
    """E[u²] under (1 - u²)^4 is 1/11 (a beta law), so a parabola averages to h²/11 at its vertex.

    First derivative of u³: minus the integral of phi' u³ is 3 E[u²]; second of u⁴: 12 E[u²].
    """
    t = clock(jitter)
    rows = weak_rows(t, 0.2)
    for k in range(rows.count):
        members = slice(rows.starts[k], rows.starts[k] + rows.sizes[k])
        half = 0.5 * (t[members][-1] - t[members][0])
        u = (t - rows.centres_s[k]) / half
        assert rows.integral(u**2)[k] == pytest.approx(1.0 / 11.0, rel=0.01)
        assert rows.integral(u**3, 1)[k] * half == pytest.approx(3.0 / 11.0, rel=0.02)
        assert rows.integral(u**4, 2)[k] * half**2 == pytest.approx(12.0 / 11.0, rel=0.03)


def test_noise_gain_of_an_uneven_clock() -> None:
    t = np.sort(np.random.default_rng(2).uniform(0.0, 40.0, 40_000))
    rows = weak_rows(t, 0.05, overlap=0.0)
    noise = np.random.default_rng(0).standard_normal(t.size)
    for order in (0, 1):
        seen = float(np.median(np.abs(rows.integral(noise, order)))) / 0.6745
        assert seen == pytest.approx(rows.noise_gain(order), rel=0.12)


def test_smooth_speed_is_the_least_squares_slope_of_its_window() -> None:
    """0.01 s at 1 kHz: five samples either side; at the ends the first and last whole window."""
    t = clock(0.45)
    angle = np.random.default_rng(7).standard_normal(t.size)
    speed = smooth_speed(t, angle, 0.01)
    for row, first in ((0, 0), (5, 0), (6, 1), (500, 495), (994, 989), (999, 989)):
        window = slice(first, first + 11)
        slope = np.polyfit(t[window] - t[first], angle[window], 1)[0]
        assert speed[row] == pytest.approx(slope, rel=1e-8)


def test_smooth_speed_of_a_short_window_and_a_short_record() -> None:
    """Five samples at least, whatever the width; four are refused."""
    t = np.arange(5) * 1e-3
    assert smooth_speed(t, 3.0 * t, 1e-4) == pytest.approx(3.0)
    with pytest.raises(ValueError, match="shorter"):
        smooth_speed(t[:4], t[:4], 1e-4)
