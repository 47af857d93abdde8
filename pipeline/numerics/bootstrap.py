"""Standard errors of any statistic of correlated samples: the circular block bootstrap."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import autocorrelation_time

Array = NDArray[np.float64]


def block_length(series: Array) -> int:
    """Length of a block [samples] for a series [n]: n^(1/3) samples that count as one, or so.

    Blocks must be long against the correlation and short against the series. Reference: Politis
    and White, Econometric Reviews 23(1), 2004 (growth with n^(1/3)).
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
    """Values [replicates, k] of statistic(samples) [k] over resampled series.

    samples [n] or [n, m] are resampled in blocks of `length` rows that wrap round the end, so
    correlation shorter than a block is kept. Reference: Politis and Romano, in Exploring the
    Limits of Bootstrap, 1992.
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
