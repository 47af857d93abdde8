"""Cell means: p-values uniform on noise, honest under memory, and sharp on a real error."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import f_oneway, kstest, t, ttest_1samp

from pipeline.numerics.cell_means import FEWEST_VISITS, cell_means, visits_of

CELLS, VISITS, STAY = 12, 10, 5


def walk(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Cells [n] and visits [n] of a record that stays five samples in a cell, in random order."""
    order = rng.permutation(np.repeat(np.arange(CELLS), VISITS))
    cell = np.repeat(order, STAY)
    return cell, np.repeat(np.arange(order.size), STAY)


def noise(rng: np.random.Generator, n: int, memory: float) -> np.ndarray:
    """Gaussian noise of variance 1 whose neighbours correlate by `memory`."""
    made = np.empty(n)
    made[0] = rng.normal()
    for k in range(1, n):
        made[k] = memory * made[k - 1] + np.sqrt(1 - memory**2) * rng.normal()
    return made


def p_values(memory: float, runs: int) -> tuple[np.ndarray, np.ndarray]:
    """One cell's p-value and that of all cells, of each of many records of noise."""
    one, everything = [], []
    for seed in range(runs):
        rng = np.random.default_rng(seed)
        cell, visit = walk(rng)
        error = noise(rng, cell.size, memory)
        found = cell_means(error, np.ones(cell.size), cell, visit, CELLS)
        one.append(found.p_value[seed % CELLS])
        everything.append(found.p_all)
    return np.array(one), np.array(everything)


def test_white_noise_gives_uniform_p_values():
    one, everything = p_values(0.0, 400)
    assert kstest(one, "uniform").pvalue > 0.01
    assert kstest(everything, "uniform").pvalue > 0.01


def test_noise_with_memory_gives_no_false_alarms():
    """Neighbours that correlate by 0.7: a test that took samples for independent would cry wolf in
    a third of all cases; visits keep the share near its 5 % (400 runs: standard error 1.1 %).
    """
    one, everything = p_values(0.7, 400)
    assert np.mean(one < 0.05) < 0.05 + 3 * 0.011
    assert np.mean(everything < 0.05) < 0.05 + 3 * 0.011


def test_an_error_in_one_cell_is_found_there_with_its_size():
    rng = np.random.default_rng(3)
    cell, visit = walk(rng)
    sigma = rng.uniform(0.5, 2.0, cell.size)
    error = sigma * rng.normal(size=cell.size) + np.where(cell == 7, 1.5, 0.0)
    found = cell_means(error, sigma, cell, visit, CELLS)
    assert int(np.argmin(found.p_value)) == 7
    assert found.p_value[7] < 1e-6
    assert (np.delete(found.p_value, 7) > 1e-3).all()
    # the scatter of a weighted mean of 50 errors
    spread = 1 / np.sqrt((sigma[cell == 7] ** -2.0).sum())
    assert abs(found.mean[7] - 1.5) < 4 * spread
    assert found.p_all < 1e-6


def test_an_error_that_is_everywhere_the_same_is_significant_but_depends_on_nothing():
    rng = np.random.default_rng(4)
    cell, visit = walk(rng)
    error = rng.normal(size=cell.size) + 3.0
    found = cell_means(error, np.ones(cell.size), cell, visit, CELLS)
    assert (found.p_value < 1e-6).all()
    assert found.p_all > 1e-3
    assert found.explained < 0.1


def test_cells_never_visited_and_too_few_visits_tell_nothing():
    cell = np.array([0, 0, 2, 2, 0, 2])
    found = cell_means(np.ones(6), np.ones(6), cell, visits_of(cell, np.zeros(6, int)), 4)
    assert found.count.tolist() == [3, 0, 3, 0]
    assert np.isnan(found.mean[[1, 3]]).all()
    assert np.isnan(found.p_value).all()
    assert FEWEST_VISITS > 2


def test_a_visit_ends_where_the_cell_or_the_record_changes():
    cell = np.array([1, 1, 2, 1, 1, 1])
    record = np.array([0, 0, 0, 0, 1, 1])
    assert visits_of(cell, record).tolist() == [0, 0, 1, 2, 3, 3]


def test_of_equal_weights_it_is_the_analysis_of_variance():
    """One sample a visit: F and eta² of a one-way layout, and t with the pooled variance."""
    rng = np.random.default_rng(8)
    cell = rng.permutation(np.repeat(np.arange(4), [5, 6, 7, 8]))
    error = rng.normal(size=cell.size) + 0.6 * (cell == 2) + 0.3
    found = cell_means(error, np.ones(cell.size), cell, np.arange(cell.size), 4)
    groups = [error[cell == c] for c in range(4)]
    assert found.p_all == pytest.approx(f_oneway(*groups).pvalue, rel=1e-9)
    between = sum(g.size * (g.mean() - error.mean()) ** 2 for g in groups)
    assert found.explained == pytest.approx(between / (error.size * error.var()), rel=1e-12)
    pooled = sum(g.var() * g.size for g in groups) / (error.size - 4)
    for c, group in enumerate(groups):
        assert found.mean[c] == pytest.approx(group.mean(), rel=1e-12)
        expected = 2.0 * t.sf(abs(group.mean()) / np.sqrt(pooled / group.size), error.size - 4)
        assert found.p_value[c] == pytest.approx(expected, rel=1e-9)


def test_a_quarter_of_the_noise_counts_sixteenfold():
    """A sample of sigma 1/4 says what sixteen of sigma 1 in the same visit say."""
    rng = np.random.default_rng(9)
    cell = np.tile(np.arange(3), 6)
    error, sharp = rng.normal(size=18) + 0.5, rng.random(18) < 0.4
    visit, times = np.arange(18), np.where(sharp, 16, 1)
    one = cell_means(error, np.where(sharp, 0.25, 1.0), cell, visit, 3)
    many = cell_means(
        *(np.repeat(error, times), np.ones(times.sum())),
        *(np.repeat(cell, times), np.repeat(visit, times), 3),
    )
    assert one.mean == pytest.approx(many.mean, rel=1e-12)
    assert one.p_value == pytest.approx(many.p_value, rel=1e-9)
    assert (one.p_all, one.explained) == pytest.approx((many.p_all, many.explained), rel=1e-9)


def test_eight_visits_more_than_cells_are_the_fewest_that_tell():
    error = np.random.default_rng(2).normal(size=10)
    for visits, tells in ((10, True), (9, False)):
        cell = np.arange(visits) % 2
        found = cell_means(error[:visits], np.ones(visits), cell, np.arange(visits), 2)
        assert np.isfinite([found.p_all, *found.p_value]).all() == tells


def test_one_cell_has_a_mean_and_nothing_to_differ_from():
    error = np.random.default_rng(2).normal(size=20) + 0.4
    found = cell_means(error, np.ones(20), np.zeros(20, int), np.arange(20), 1)
    assert found.p_value[0] == pytest.approx(ttest_1samp(error, 0.0).pvalue, rel=1e-9)
    assert np.isnan(found.p_all)
    assert found.explained == pytest.approx(0.0, abs=1e-12)


def test_errors_without_scatter_tell_nothing_of_chance():
    """A quantised sensor repeats its errors exactly: there is no noise to judge them by."""
    cell = np.tile([0, 1], 10)
    found = cell_means(np.where(cell == 1, 2.0, 1.0), np.ones(20), cell, np.arange(20), 2)
    assert found.mean.tolist() == [1.0, 2.0]
    assert found.explained == 1.0
    assert np.isnan([found.p_all, *found.p_value]).all()
