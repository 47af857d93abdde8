"""What gates look for in one sampled signal: noise, repeats, gaps, steps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

MAD_TO_SIGMA = 1.4826


def noise_of(values: Array) -> float:
    """Standard deviation [unit of values] of white noise on a slow signal [n].

    From the median absolute second difference, which ramps and edges of the signal do not move:
    sigma = 1.4826 median|x[k+1] - 2 x[k] + x[k-1]| / sqrt(6).
    """
    bends = np.abs(np.diff(values[np.isfinite(values)], n=2))
    return MAD_TO_SIGMA * float(np.median(bends)) / math.sqrt(6.0) if bends.size else 0.0


def runs_of_equal(values: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """First row and length of every stretch of exactly equal samples [n]; NaN equals nothing."""
    if values.size == 0:
        empty = np.empty(0, dtype=np.int64)
        return empty, empty
    starts = np.concatenate(([0], np.flatnonzero(values[1:] != values[:-1]) + 1))
    lengths = np.diff(np.concatenate((starts, [values.size])))
    return starts.astype(np.int64), lengths.astype(np.int64)


def share_of_repeats(values: Array) -> float:
    """Share of samples [n] that equal the one before; 1 where there are too few to say."""
    finite = values[np.isfinite(values)]
    return float(np.mean(finite[1:] == finite[:-1])) if finite.size > 1 else 1.0


def longest_likely_run(values: Array, level: float) -> float:
    """Length that a run of equal samples exceeds by chance with probability `level` at most.

    With p the share of samples equal to the one before, n p^(L-1) is the expected number of
    runs of L or more in n samples; infinite where most samples repeat and a run says nothing.
    """
    repeats = share_of_repeats(values)
    if repeats > 0.5:
        return math.inf
    size = float(np.count_nonzero(np.isfinite(values)))
    return 1.0 + math.log(level / size) / math.log(max(repeats, 1.0 / size))


def rows_of_runs(size: int, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> Rows:
    """True on the rows [size] of the given stretches."""
    edges = np.zeros(size + 1, dtype=np.int64)
    np.add.at(edges, starts, 1)
    np.add.at(edges, starts + lengths, -1)
    return np.cumsum(edges[:-1]) > 0


def gaps_of(t_s: Array, factor: float) -> tuple[NDArray[np.int64], float]:
    """Rows after which more than `factor` median intervals pass, and that interval [s]."""
    steps = np.diff(t_s)
    if steps.size == 0:
        return np.empty(0, dtype=np.int64), math.nan
    usual = float(np.median(steps))
    return np.flatnonzero(steps > factor * usual).astype(np.int64), usual


def missing_samples(t_s: Array, gaps: NDArray[np.int64], usual_s: float) -> float:
    """Samples that the gaps cost: what they skip, less what a hurried clock made up for.

    A logger that stalls and then catches up loses nothing: the rows still fill the time.
    """
    skipped = float(np.sum(np.diff(t_s)[gaps] / usual_s - 1.0))
    short = (t_s[-1] - t_s[0]) / usual_s + 1.0 - t_s.size
    return max(0.0, min(skipped, float(short)))


def samples_per_time_constant(values: Array) -> float:
    """Samples in one time constant of the edges of an exponential step response [n].

    An exponential passes from 10 % to 90 % of its way in ln(9) time constants, so the rows
    between those levels over the number of edges, over ln 9. Infinite without an edge.
    """
    low, high = np.percentile(values, [1.0, 99.0])
    way = (values - low) / max(high - low, np.finfo(np.float64).tiny)
    side = np.where(way > 0.75, 1, np.where(way < 0.25, -1, 0))
    sides = side[side != 0]
    edges = int(np.count_nonzero(np.diff(sides)))
    if edges == 0:
        return math.inf
    between = int(np.count_nonzero((way > 0.1) & (way < 0.9)))
    return between / edges / math.log(9.0)
