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


def test_the_functions_are_the_window_times_waves_of_unit_length():
    """Unit norm makes white noise of unit deviation a residual of unit deviation."""
    theta = np.linspace(0.3, 30.0, 500)
    starts = np.array([0, 130])
    weak = projection(theta, starts, 200, (1, 2.5), cycles=1.0)
    assert weak.orders.tolist() == [0, 1, 1, 2.5, 2.5]
    assert weak.length == 200
    assert (weak.functions**2).sum(axis=2) == pytest.approx(np.ones((2, 5)))
    u = (2 * np.arange(200) + 1) / 200 - 1
    for w, start in enumerate(starts):
        rows = slice(start, start + 200)
        ratio = weak.functions[w, 3] / weak.functions[w, 0]
        wave = np.cos(2.5 * theta[rows])
        inner = np.abs(u) < 0.9
        assert np.corrcoef(ratio[inner], wave[inner])[0, 1] == pytest.approx(1.0)
        assert np.tan(2.5 * theta[rows]) == pytest.approx(
            weak.functions[w, 4]
            / weak.functions[w, 3]
            * np.sqrt(
                ((1 - u**2) ** 8 * np.sin(2.5 * theta[rows]) ** 2).sum()
                / ((1 - u**2) ** 8 * wave**2).sum()
            ),
            rel=1e-6,
        )


def test_window_means_of_a_constant_and_of_a_straight_line():
    """The window is even about its centre: a line averages to its value there."""
    signals = np.vstack([np.full(100, 4.0), np.arange(100.0)])
    weak = projection(np.linspace(0, 9, 100), np.array([0, 20, 60]), 30, (2,))
    means = weak.means(signals)
    assert means[0] == pytest.approx(4.0)
    assert means[1] == pytest.approx([14.5, 34.5, 74.5])


def test_projection_of_each_channel_and_window_is_its_scalar_product():
    rng = np.random.default_rng(1)
    signals = rng.normal(size=(3, 120))
    weak = projection(np.linspace(0, 40, 120), np.array([5, 40]), 60, (2,), 1.0, 2.0)
    projected = weak.project(signals)
    assert projected.shape == (3, 2, 3)
    for c, w, m in np.ndindex(projected.shape):
        rows = signals[c, weak.starts[w] : weak.starts[w] + 60]
        assert projected[c, w, m] == pytest.approx(float(rows @ weak.functions[w, m]))


def test_an_order_counts_from_three_cycles_and_sixteen_samples_each():
    """320 rows of 319 even steps over one turn; a second window that stands still."""
    theta = np.concatenate([np.linspace(0, 2 * np.pi, 320), np.full(320, 2 * np.pi)])
    starts = np.array([0, 320])
    told = projection(theta, starts, 320, (2.9, 3.1, 19.9, 20.1))
    assert sorted(set(told.orders.tolist())) == [0, 3.1, 19.9]
    assert told.valid.tolist() == [[True] * 5, [True] + [False] * 4]
    assert projection(-theta, starts, 320, (3.1,)).orders.size == 3
    assert projection(theta, starts, 320, (3.1,), cycles=4.0).orders.size == 1
    assert projection(theta, starts, 320, (19.9,), margin=17.0).orders.size == 1
    only = told.only(np.array([True, False]))
    assert (only.starts.tolist(), only.valid.shape, only.functions.shape[0]) == ([0], (1, 5), 1)


def test_no_window_is_no_function():
    weak = projection(np.zeros(10), np.zeros(0, dtype=np.int64), 20, (3,))
    assert weak.functions.shape == (0, 1, 20)


def test_windows_start_every_half_window_and_end_within_the_record():
    keep = np.ones(100, dtype=bool)
    assert window_starts(keep, 20).tolist() == list(range(0, 81, 10))
    assert window_starts(keep, 21).tolist() == list(range(0, 80, 10))
    assert window_starts(keep, 1).tolist() == list(range(100))
    assert window_starts(keep, 100).tolist() == [0]
    assert window_starts(keep, 101).size == 0
    assert window_starts(keep, 300).size == 0
    assert window_starts(keep, 20, most=9).size == 9
    assert window_starts(keep, 20, most=5).tolist() == [0, 20, 40, 60, 80]
    keep[0] = keep[99] = False
    assert window_starts(keep, 20).tolist() == list(range(10, 80, 10))
