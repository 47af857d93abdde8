"""Standard errors of any statistic of correlated samples: the circular block bootstrap."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.numerics.least_squares import Array, autocorrelation_time


def block_length(series: Array) -> int:
    """Length of the blocks that keep a series' correlation and still leave many blocks.

    Parameters
    ----------
    series
        Samples in order of time [n, any unit].

    Returns
    -------
    int
        Rows a block [1]: at least 1, at most a quarter of the series.

    Notes
    -----
    l = τ (n/τ)^(1/3) = τ^(2/3) n^(1/3), with τ the autocorrelation time [samples]: n/τ samples
    count as independent, and the best block grows with the third root of their number.

    References
    ----------
    Politis and White, Econometric Reviews 23(1), 2004, 53, doi:10.1081/ETC-120028836.

    """
    tau = autocorrelation_time(series)
    length = max(1.0, tau) ** (2.0 / 3.0) * series.size ** (1.0 / 3.0)
    return int(min(max(1, round(length)), max(1, series.size // 4)))


def block_bootstrap(
    statistic: Callable[[Array], Array],
    samples: Array,
    length: int,
    replicates: int,
    rng: np.random.Generator,
) -> Array:
    """Values of a statistic over series resampled in blocks; their scatter is its standard error.

    Parameters
    ----------
    statistic
        Takes samples like `samples` and returns [k] or one number.
    samples
        Rows in order of time [n] or [n, m].
    length
        Rows a block [1]; correlation that is shorter than a block is kept.
    replicates
        How many series are drawn.
    rng
        Source of the draws; the same state gives the same values.

    Returns
    -------
    array [replicates, k]
        The statistic of each series drawn.

    Notes
    -----
    The circular block bootstrap: blocks begin at any row and wrap round the end, so every row is
    drawn equally often.

    References
    ----------
    Politis and Romano, A circular block-resampling procedure for stationary data, in Exploring the
    Limits of Bootstrap, Wiley, 1992, 263.

    """
    n = samples.shape[0]
    count = -(-n // length)
    offsets = np.arange(length)
    drawn = []
    for _ in range(replicates):
        starts = rng.integers(0, n, count)
        rows = (starts[:, None] + offsets[None, :]).ravel()[:n] % n
        drawn.append(np.atleast_1d(statistic(samples[rows])))
    return np.array(drawn)
