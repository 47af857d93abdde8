"""The clock of a log: whether its samples came unevenly, or only their stamps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_REACH = 2
"""Samples at either side that a cubic goes through; it needs four."""


def counted(time: Array, missing: float, most_scatter: float) -> tuple[float, Indices] | None:
    """The even clock behind stamps that scatter.

    Parameters
    ----------
    time
        Stamps [n, s], rising.
    missing
        Distance of two stamps [periods] from which on a sample may be missing between them.
    most_scatter
        Scatter of stamps [periods] from which on a stamp does not number its sample.

    Returns
    -------
    (period, numbers) or None
        Period [s] and number of each sample [n]; None where the stamps scatter by more than that
        about any even clock.

    Notes
    -----
    Two counts are tried: one in which a long step stands for missing samples, whose numbers are
    left out, and one in which it does not. The one with less scatter counts.

    Examples
    --------
    >>> period, numbers = counted(np.array([0.0, 1.0, 2.0, 4.0, 5.0]), 1.6, 0.5)
    >>> round(period, 9), numbers.tolist()
    (1.0, [0, 1, 2, 4, 5])

    """
    since = time - time[0]
    steps = np.diff(since) / np.median(np.diff(since))
    gaps = np.where(steps > missing, np.rint(steps), 1.0)
    ends = []
    for counts in (np.ones(steps.size), gaps):
        number = np.concatenate([[0.0], np.cumsum(counts)])
        period, first = np.polyfit(number, since, 1)
        scatter = float(np.std(since - first - period * number)) / period
        ends.append((scatter, float(period), number.astype(np.int64)))
    scatter, period, number = min(ends, key=lambda end: end[0])
    return None if scatter > most_scatter else (period, number)


def clearest_ratio(time: Array, number: Indices, columns: Iterable[Array]) -> float:
    """How much smoother signals are over the stamps than over the count of the samples.

    Parameters
    ----------
    time
        Stamps [n, s].
    number
        Number of each sample on the even clock [n].
    columns
        Signals [n each, any unit].

    Returns
    -------
    float
        Ratio [1] of the signal that shows most: above 1 samples came unevenly, below 1 only their
        stamps did; 1 where no signal shows it.

    Notes
    -----
    A shaft that turns shows when its angle was read: where it is evener than the clock that stamped
    it, the stamps are at fault and not the sampling. Roughness is the median distance of samples
    from the cubic through the two before and the two after.

    """
    ratios = [_roughness(c, number.astype(float)) / _roughness(c, time) for c in columns]
    return max(ratios, key=lambda ratio: max(ratio, 1.0 / ratio), default=1.0)


def _roughness(signal: Array, at: Array) -> float:
    """Median distance of samples from the cubic through the two before and the two after."""
    offsets = [n for n in range(-_REACH, _REACH + 1) if n]
    inner = slice(_REACH, signal.size - _REACH)
    moved = {n: slice(_REACH + n, signal.size - _REACH + n) for n in offsets}
    foretold = np.zeros(max(signal.size - 2 * _REACH, 0))
    for n in offsets:
        weight = np.ones_like(foretold)
        for other in offsets:
            if other != n:
                weight *= (at[inner] - at[moved[other]]) / (at[moved[n]] - at[moved[other]])
        foretold += weight * signal[moved[n]]
    error = np.abs(signal[inner] - foretold)
    moving = error[error > 0.0]
    rounding = 1e-12 * float(np.max(np.abs(signal), initial=0.0))
    return max(float(np.median(moving)) if moving.size else 0.0, rounding, 1e-300)
