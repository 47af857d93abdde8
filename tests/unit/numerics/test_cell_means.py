"""Cell means: p-values uniform on noise, honest under memory, and sharp on a real error."""

from __future__ import annotations

import numpy as np
from scipy.stats import kstest

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
