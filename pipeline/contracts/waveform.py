"""What gates look for in one sampled signal: noise, repeats, gaps, steps."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Rows = NDArray[np.bool_]

MAD_TO_SIGMA = 1.4826


def noise_of(values: Array) -> float:
    """Standard deviation of white noise on a slow signal.

    Parameters
    ----------
    values
        Samples [n, any unit]; those that are not finite are left out.

    Returns
    -------
    float
        Unit of the values; 0 for fewer than three.

    Notes
    -----
    σ = 1.4826 median|x_(k+1) − 2 x_k + x_(k−1)|/√6: ramps and edges of the signal do not move it.

    """
    bends = np.abs(np.diff(values[np.isfinite(values)], n=2))
    return MAD_TO_SIGMA * float(np.median(bends)) / math.sqrt(6.0) if bends.size else 0.0


def runs_of_equal(values: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Stretches of exactly equal samples.

    Parameters
    ----------
    values
        Samples [n]; NaN equals nothing.

    Returns
    -------
    starts, lengths
        First row and number of rows of each; together they cover all rows.

    Examples
    --------
    >>> starts, lengths = runs_of_equal(np.array([1.0, 1.0, 2.0]))
    >>> starts.tolist(), lengths.tolist()
    ([0, 2], [2, 1])

    """
    if values.size == 0:
        empty = np.empty(0, dtype=np.int64)
        return empty, empty
    starts = np.concatenate(([0], np.flatnonzero(values[1:] != values[:-1]) + 1))
    lengths = np.diff(np.concatenate((starts, [values.size])))
    return starts.astype(np.int64), lengths.astype(np.int64)


def share_of_repeats(values: Array) -> float:
    """Share of samples that equal the one before.

    Parameters
    ----------
    values
        Samples [n]; values that are not finite are left out.

    Returns
    -------
    float
        1 where there are fewer than two.

    """
    finite = values[np.isfinite(values)]
    return float(np.mean(finite[1:] == finite[:-1])) if finite.size > 1 else 1.0


def longest_likely_run(values: Array, level: float) -> float:
    """Length that a run of equal samples exceeds by chance with a given probability at most.

    Parameters
    ----------
    values
        Samples [n].
    level
        Expected number of such runs in a signal of this length [1].

    Returns
    -------
    float
        [samples]; infinite where more than half of the samples repeat and a run says nothing.

    Notes
    -----
    With p the share of samples equal to the one before, n p^(L−1) is the expected number of runs of
    L or more in n samples.

    """
    repeats = share_of_repeats(values)
    if repeats > 0.5:
        return math.inf
    size = float(np.count_nonzero(np.isfinite(values)))
    return 1.0 + math.log(level / size) / math.log(max(repeats, 1.0 / size))


def rows_of_runs(size: int, starts: NDArray[np.int64], lengths: NDArray[np.int64]) -> Rows:
    """Rows that lie in some runs.

    Parameters
    ----------
    size
        Number of rows.
    starts
        First row of each run [r].
    lengths
        Rows of each run [r].

    Returns
    -------
    array [size] of bool
        True inside a run.

    """
    edges = np.zeros(size + 1, dtype=np.int64)
    np.add.at(edges, starts, 1)
    np.add.at(edges, starts + lengths, -1)
    return np.cumsum(edges[:-1]) > 0


def gaps_of(
    t_s: Array, factor: float, pause_s: float | None = None
) -> tuple[NDArray[np.int64], float]:
    """Gaps of a clock.

    Parameters
    ----------
    t_s
        Instants [n, s].
    factor
        Median intervals beyond which an interval is a gap [1].
    pause_s
        Interval beyond which it is none but a pause of the recorder [s]; None where it had none.

    Returns
    -------
    rows
        Those after which a gap comes.
    interval
        The median [s]; NaN for fewer than two rows.

    Examples
    --------
    >>> rows, interval = gaps_of(np.array([0.0, 1.0, 2.0, 5.0]), 1.5)
    >>> rows.tolist(), interval
    ([2], 1.0)

    """
    steps = np.diff(t_s)
    if steps.size == 0:
        return np.empty(0, dtype=np.int64), math.nan
    usual = float(np.median(steps))
    longest = math.inf if pause_s is None else pause_s
    return np.flatnonzero((steps > factor * usual) & (steps <= longest)).astype(np.int64), usual


def missing_samples(t_s: Array, gaps: NDArray[np.int64], usual_s: float) -> float:
    """Samples that gaps cost: what they skip, less what a hurried clock made up for.

    Parameters
    ----------
    t_s
        Instants [n, s].
    gaps
        Rows after which a gap comes.
    usual_s
        Interval between two rows [s].

    Returns
    -------
    float
        [samples]. A logger that stalls and then catches up loses nothing: the rows still fill the
        time.

    """
    skipped = float(np.sum(np.diff(t_s)[gaps] / usual_s - 1.0))
    short = (t_s[-1] - t_s[0]) / usual_s + 1.0 - t_s.size
    return max(0.0, min(skipped, float(short)))


def samples_per_time_constant(values: Array) -> float:
    """Samples in one time constant of the edges of an exponential step response.

    Parameters
    ----------
    values
        Step response [n, any unit], one edge or several.

    Returns
    -------
    float
        [samples]; infinite without an edge.

    Notes
    -----
    An exponential passes from 10 % to 90 % of its way in ln 9 time constants, so it is the rows
    between those levels, over the number of edges, over ln 9.

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
