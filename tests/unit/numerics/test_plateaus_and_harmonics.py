"""Plateaus of stepped signals, harmonic regression, cycle cuts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.numerics.harmonics import harmonic_design, hermite, whole_cycles
from pipeline.numerics.plateaus import (
    block_means,
    decimated,
    find_plateaus,
    true_runs,
    white_noise_sigma,
)


def stepped(sigma: float) -> np.ndarray:
    """Four levels of 200 rows, each approached with a time constant of 5 rows."""
    signal, level = [], 0.0
    for target in (0.0, 2.0, 1.0, -2.0):
        for _ in range(200):
            level += (target - level) / 5.0
            signal.append(level)
    return np.array(signal) + sigma * np.random.default_rng(1).standard_normal(800)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_plateaus_of_any_scale(scale):
    signal = scale * stepped(0.01)
    levels = [float(signal[p.rows].mean()) / scale for p in find_plateaus(signal)]
    assert levels == pytest.approx([0.0, 2.0, 1.0, -2.0], abs=0.004)


@pytest.mark.parametrize("level", [5.16, -5.16e-9, 5.16e9, 0.0])
def test_an_exact_constant_is_one_plateau(level):
    """The running sum of 20 000 times 5.16 is rounded; that is no motion."""
    assert [(p.start, p.stop) for p in find_plateaus(np.full(20_000, level))] == [(0, 20_000)]


def test_a_ramp_has_no_plateau():
    signal = np.linspace(0.0, 5.0, 1000) + 0.001 * np.random.default_rng(2).standard_normal(1000)
    assert all(p.size < 200 for p in find_plateaus(signal))


def test_noise_of_a_drifting_stepped_signal():
    signal = stepped(0.03) + np.linspace(0.0, 1.0, 800)
    assert white_noise_sigma(signal) == pytest.approx(0.03, rel=0.12)


def test_block_means_drop_the_rest():
    assert block_means(np.arange(7.0), 3).tolist() == [1.0, 4.0]


def test_cuts_hold_whole_cycles():
    phase = np.linspace(0.3, 0.3 + 2 * math.pi * 5.4, 1000)
    cuts = whole_cycles(phase)
    assert cuts.size == 6
    assert np.diff(phase[cuts]) == pytest.approx(2 * math.pi, abs=phase[1] - phase[0])


def test_hermite_reproduces_a_parabola_and_its_slope():
    nodes = np.array([0.0, 0.7, 1.5, 2.0, 3.1])
    x = np.linspace(0.8, 1.9, 50)
    value, slope = hermite(nodes, nodes**2, x)
    assert value == pytest.approx(x**2, abs=1e-12)
    assert slope == pytest.approx(2 * x, abs=1e-12)


def test_rows_of_a_step_are_left_out_and_no_others():
    """A clean step at row 100: windows of 20 rows that see it are moving."""
    signal = np.repeat([0.0, 1.0], 100)
    found = find_plateaus(signal, 20, 20)
    assert len(found) == 2
    assert found[0].start == 0
    assert 80 <= found[0].stop <= 82
    assert 118 <= found[1].start <= 120
    assert found[1].stop == 200
    assert (found[1].size, signal[found[1].rows].tolist()) == (
        200 - found[1].start,
        [1.0] * (200 - found[1].start),
    )


@pytest.mark.parametrize(("rows", "plateaus"), [(19, 0), (20, 1), (39, 1)])
def test_a_short_record_is_one_plateau_or_none(rows, plateaus):
    """Below twice the least number of rows no step can be told."""
    signal = np.where(np.arange(rows) < rows // 2, 0.0, 1.0)
    expected = [(0, rows)][:plateaus]
    assert [(p.start, p.stop) for p in find_plateaus(signal, 20)] == expected


def test_twice_the_least_rows_may_hold_two():
    signal = np.where(np.arange(60) < 30, 0.0, 1.0)
    assert [signal[p.rows].mean() for p in find_plateaus(signal, 20)] == [0.0, 1.0]


@pytest.mark.parametrize(("share", "parts"), [(0.97, 1), (1.03, 2)])
def test_steps_of_a_hundredth_of_the_span_count(share, parts):
    """Span 1 by a far level; a step of 0.0097 is settled, one of 0.0103 is not."""
    signal = np.concatenate([np.zeros(300), np.full(300, 0.01 * share), np.full(300, 1.0)])
    assert len(find_plateaus(signal, 20, 20)) == parts + 1
    # the span taken as 2: the same steps are half as large a share
    assert len(find_plateaus(signal, 20, 20, least_span=2.0)) == 2
    assert len(find_plateaus(signal, 20, 20, tolerance=0.005)) == 3


@pytest.mark.parametrize(("errors", "parts"), [(2.0, 1), (11.0, 2)])
def test_steps_of_six_standard_errors_count(errors, parts):
    """Means of 200 rows differ by sigma sqrt(2/200) at random; noise alone reaches three of it."""
    sigma = 0.1
    step = errors * sigma * math.sqrt(2.0 / 200)
    signal = np.repeat([0.0, step], 2000) + sigma * np.random.default_rng(3).standard_normal(4000)
    assert len(find_plateaus(signal, 20, 200, tolerance=0.0)) == parts


def test_a_slow_approach_is_trimmed_from_the_start():
    """exp(-t/200) is within its window's limit long before it has settled."""
    row = np.arange(4000)
    signal = np.concatenate([np.zeros(500), 1.0 - np.exp(-row / 200.0)])
    second = find_plateaus(signal)[-1]
    assert second.stop == 4500
    assert 1.0 - signal[second.start] < 0.004
    assert second.start < 500 + 200 * math.log(1.0 / 1e-4)


def test_the_default_window_is_a_hundredth_of_the_record_within_limits():
    """3000 rows: 30, but no more than the least plateau of 20; 200 rows: 3 at least."""
    long, short = np.repeat([0.0, 1.0], 1500), np.repeat([0.0, 1.0], 100)
    for signal, window in ((long, 20), (short, 3)):
        assert find_plateaus(signal, 20) == find_plateaus(signal, 20, window)
        assert find_plateaus(signal, 20) != find_plateaus(signal, 20, window + 2)


def test_white_noise_is_told_from_second_differences():
    """A line has none; 1, -1, 1, ... has second differences of 4, of which sigma is 4/q/sqrt 6."""
    assert white_noise_sigma(np.arange(50.0) ** 1) == 0.0
    assert white_noise_sigma(np.array([1.0, 5.0, 2.0, 9.0, 3.0])) == 0.0
    values = np.tile([1.0, -1.0], 50)  # second differences all of size 4
    assert white_noise_sigma(values) == pytest.approx(4.0 / 0.6744897501960817 / math.sqrt(6.0))
    values[7] = np.nan
    assert white_noise_sigma(values) == pytest.approx(4.0 / 0.6745 / math.sqrt(6.0), rel=1e-3)


def test_noise_of_a_coarse_quantity_is_its_root_mean_square():
    """One count in ten rows: most second differences vanish, the rest are 1, -2, 1."""
    values = np.zeros(1000)
    values[5::10] = 1.0
    second = np.abs(np.diff(values, n=2))
    kept = second[second <= np.quantile(second, 0.95)]
    expected = math.sqrt(float(np.mean(kept**2)) / 6.0)
    assert white_noise_sigma(values) == pytest.approx(expected)
    assert expected > 0.2


def test_runs_of_true_values():
    flags = np.array([1, 1, 0, 1, 0, 0, 1, 1, 1], dtype=bool)
    assert true_runs(flags) == [(0, 2), (3, 4), (6, 9)]
    assert true_runs(np.zeros(3, dtype=bool)) == []


@pytest.mark.parametrize(("size", "most", "step"), [(10, 10, 1), (11, 10, 2), (4001, 2000, 3)])
def test_decimated_rows_are_at_most_as_many_as_told(size, most, step):
    rows = decimated(size, most)
    assert rows == slice(None, None, step)
    assert np.arange(size)[rows].size <= most
    assert decimated(4001) == slice(None, None, 3)


def test_block_means_of_columns():
    means = block_means(np.arange(10.0).reshape(5, 2), 2)
    assert means.tolist() == [[1.0, 2.0], [5.0, 6.0]]


def test_columns_of_harmonics():
    angle = np.array([0.0, math.pi / 6, math.pi / 2])
    columns = harmonic_design(angle, [1, 3])
    root = math.sqrt(3.0) / 2.0
    expected = [[1, 1, 0, 1, 0], [1, root, 0.5, 0, 1], [1, 0, 1, 0, -1]]
    assert columns == pytest.approx(np.array(expected, dtype=float), abs=1e-12)


def test_cuts_of_a_phase_that_falls_and_of_several_cycles():
    phase = -np.linspace(0.0, 4.0 * math.pi, 401)  # 200 rows a cycle, two whole ones
    assert whole_cycles(phase).tolist() == [0, 200, 400]
    assert whole_cycles(phase, 2.0).tolist() == [0, 400]
    assert whole_cycles(phase, 0.5).tolist() == [0, 100, 200, 300, 400]
    assert whole_cycles(phase[:-1]).tolist() == [0, 200]


def test_hermite_goes_on_outside_its_nodes():
    """A cubic of second-order slopes through a straight line and a parabola is exact anywhere."""
    nodes = np.array([0.0, 1.0, 3.0])
    value, slope = hermite(nodes, 5.0 - 2.0 * nodes, np.array([-1.0, 0.0, 0.5, 3.0, 4.0]))
    assert value == pytest.approx([7.0, 5.0, 4.0, -1.0, -3.0])
    assert slope == pytest.approx(-2.0)


def test_hermite_passes_through_its_values_with_their_slopes():
    nodes = np.array([0.0, 1.0, 2.0, 3.0, 4.0])
    values = np.array([0.0, 3.0, -1.0, 2.0, 2.0])
    value, slope = hermite(nodes, values, nodes)
    assert value == pytest.approx(values)
    assert slope == pytest.approx([3.0, -0.5, -0.5, 1.5, 0.0])
    # half way: mean of the values plus an eighth of the difference of the slopes
    between, _ = hermite(nodes, values, np.array([0.5, 1.5]))
    assert between == pytest.approx([1.5 + 3.5 / 8, 1.0 + 0.0])
