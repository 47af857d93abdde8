"""The clock of a log: whether its samples came unevenly, or only their stamps."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.captures import Cutting

_REACH = 2
"""Samples at either side that a cubic goes through; it needs four."""


def counted(time: Array, policy: Cutting) -> tuple[float, Indices] | None:
    """The even clock behind stamps that scatter.

    Parameters
    ----------
    time
        Stamps [n, s], rising.
    policy
        Constants of judgement.

    Returns
    -------
    (period, numbers) or None
        Period [s] and number of each sample [n]; None where the stamps scatter by more than half a
        period about any even clock.

    Notes
    -----
    Two counts are tried: one in which a long step stands for missing samples, whose numbers are
    left out, and one in which it does not. The one with less scatter counts.

    Examples
    --------
    >>> period, numbers = counted(np.array([0.0, 1.0, 2.0, 4.0, 5.0]), Cutting())
    >>> round(period, 9), numbers.tolist()
    (1.0, [0, 1, 2, 4, 5])

    """
    since = time - time[0]
    steps = np.diff(since) / np.median(np.diff(since))
    gaps = np.where(steps > policy.clock_missing, np.rint(steps), 1.0)
    ends = []
    for counts in (np.ones(steps.size), gaps):
        number = np.concatenate([[0.0], np.cumsum(counts)])
        period, first = np.polyfit(number, since, 1)
        scatter = float(np.std(since - first - period * number)) / period
        ends.append((scatter, float(period), number.astype(np.int64)))
    scatter, period, number = min(ends, key=lambda end: end[0])
    return None if scatter > policy.clock_scatter else (period, number)


def sampled_unevenly(
    time: Array, number: Indices, columns: Iterable[Array], policy: Cutting
) -> bool:
    """Whether the samples came unevenly, and not only their stamps.

    Parameters
    ----------
    time
        Stamps [n, s].
    number
        Number of each sample on the even clock [n].
    columns
        Signals [n each, any unit].
    policy
        Constants of judgement.

    Returns
    -------
    bool
        Where the signal that shows most runs `policy.clock_ratio` times more smoothly over the
        stamps.

    Notes
    -----
    A shaft that turns shows when its angle was read: where it is evener than the clock that stamped
    it, the stamps are at fault and not the sampling. Roughness is the median distance of samples
    from the cubic through the two before and the two after.

    """
    ratios = [_roughness(c, number.astype(float)) / _roughness(c, time) for c in columns]
    clearest = max(ratios, key=lambda ratio: max(ratio, 1.0 / ratio), default=1.0)
    return clearest > policy.clock_ratio


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
    return max(float(np.median(moving)) if moving.size else 0.0, 1e-300)
