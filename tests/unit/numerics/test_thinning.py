"""Fewer points, same picture: extremes, gaps and ends stay."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from pipeline.numerics.thinning import cloud_points, line_points


@pytest.mark.parametrize(("n", "limit"), [(1000, 10), (1003, 10), (999, 7), (50, 49), (11, 2)])
def test_each_bucket_keeps_its_extremes_and_the_curve_its_ends(n: int, limit: int) -> None:
    y = np.random.default_rng(n).standard_normal(n)
    kept = line_points(y, limit)
    assert kept.size <= limit + 2
    assert (np.diff(kept) > 0).all()
    assert (kept[0], kept[-1]) == (0, n - 1)
    edges = np.linspace(0, n, max(limit // 2, 1) + 1).astype(int)
    for first, last in pairwise(edges):
        inside = kept[(kept >= first) & (kept < last)]
        assert y[inside].min() == y[first:last].min()
        assert y[inside].max() == y[first:last].max()


def test_a_curve_of_up_to_the_limit_stays_whole() -> None:
    assert line_points(np.zeros(20), 20).tolist() == list(range(20))
    assert line_points(np.zeros(21), 20).size < 21


def test_a_gap_stays_a_gap() -> None:
    y = np.sin(np.arange(1000) / 50.0)
    y[430:433] = np.nan
    kept = line_points(y, 20)
    assert np.isnan(y[kept]).sum() == 1
    assert 430 in kept
    assert {400 + int(np.nanargmax(y[400:500])), 400 + int(np.nanargmin(y[400:500]))} <= set(kept)


def test_a_curve_of_nothing_but_gaps_keeps_its_ends() -> None:
    kept = line_points(np.full(100, np.nan), 10)
    assert (kept[0], kept[-1]) == (0, 99)


def test_a_cell_keeps_its_first_point() -> None:
    x = np.array([0.5, 2.5, 0.9, np.nan, 2.0, 0.1, 1.0])
    y = np.array([0.5, 0.5, 0.1, 0.5, 0.9, -0.1, np.inf])
    assert cloud_points(x, y, 1.0).tolist() == [0, 1, 5]
    assert cloud_points(x, y, 3.0).tolist() == [0, 5]
    assert cloud_points(10.0 * x, 10.0 * y, 10.0).tolist() == [0, 1, 5]


def test_cells_far_apart_are_not_taken_for_one() -> None:
    """Every cell of a whole screen, row after row and column after column, is its own."""
    column, row = (axis.ravel() for axis in np.meshgrid(np.arange(300.0), np.arange(200.0)))
    assert cloud_points(column + 0.5, row + 0.5, 1.0).size == 60_000
