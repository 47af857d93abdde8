"""The clock of a log: whether its samples came unevenly, or only their stamps."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.quantisation import resolution

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
_REACH = 2
"""Samples at either side that a cubic goes through; it needs four."""
_BY_ITSELF = 0.2
"""Scatter of stamps [periods] to which each may be numbered by itself; of any stamps it is 0.29."""
_PARTS, _PART, _FAR = 8, 64, 0.2
"""Parts of a record that its clock is looked for in, stamps of each, and how far from the median
step [its logarithm]."""
_MOVED = 16
"""Samples at either side whose stamps give the pace of a signal: of stamps that scatter by half a
period it is off by a fiftieth."""
_MOST_OF_WAY = 0.8
"""Share of the way of a signal in stretches that number their samples."""
_NEAR = 8
"""Samples that a change may stand for: of more, a fiftieth is no longer a small part of one."""
_STEPS = 8
"""Steps of an encoder in a change from which on their rounding, √(1/6) of one, is no sample."""
SMOOTHER = 0.5
"""Roughness of a signal over its own count, of that over another, that shows the other wrong."""


def counted(
    time: Array, missing: float, most_scatter: float, columns: Sequence[Array] = ()
) -> tuple[float, Indices] | None:
    """The even clock behind stamps that scatter.

    Parameters
    ----------
    time
        Stamps [n, s], rising.
    missing
        Distance of two stamps [periods] from which on a sample may be missing between them.
    most_scatter
        Scatter of stamps [periods] from which on a stamp does not number its sample.
    columns
        Signals [n each, any unit]. One that goes most of its way in long stretches of one sense
        numbers its samples, where it is smoother over that count than over the stamps'.

    Returns
    -------
    (period, numbers) or None
        Period [s] and number of each sample [n]; None where the stamps scatter by more than that
        about any even clock.

    Notes
    -----
    Two counts are tried: one in which a long step stands for missing samples, whose numbers are
    left out, and one in which it does not. The one with less scatter counts. Of stamps that scatter
    a count goes wrong once and stays so: where neither count is even, every stamp is numbered by
    itself, on the clock that most of them agree with. A computer that stamps in whole milliseconds
    gives a sample of every millisecond its own number or the one before, and loses what has a
    number twice; such stamps are even, and wrong. The angle of a shaft that turns knows better.

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
    found = None if scatter > most_scatter else (period, number)
    if scatter > _BY_ITSELF:
        found = _numbered(since) or found
    moved = _by_motion(since, columns)
    known = since if found is None else found[1].astype(float)
    if moved is not None and clearest_ratio(known, moved[1], columns) < SMOOTHER:
        return moved
    return found


def _by_motion(since: Array, columns: Iterable[Array]) -> tuple[float, Indices] | None:
    """Period and number of each sample by the signal that shows most of them: in stretches in which
    it only rises or only falls, by many times its resolution, its change from one sample to the
    next over its pace. Where it hardly moves the stamps number it: there a number that is one off
    is as good. None where no signal goes most of its way in such stretches.
    """
    best, most, apart = None, _MOST_OF_WAY, np.diff(since)
    near = apart <= _NEAR * np.median(apart)
    for column in columns:
        steps = np.diff(column)
        seen = near & (np.abs(steps) >= _STEPS * resolution(steps))
        way = np.where(seen, np.sign(steps), 0.0)
        edges = np.concatenate([[0], np.flatnonzero(np.diff(way)) + 1, [way.size]]).tolist()
        stretches = [
            slice(first, end + 1)
            for first, end in pairwise(edges)
            if way[first] and end - first > 2 * _MOVED
        ]
        moved = sum(float(np.abs(steps[one.start : one.stop - 1]).sum()) for one in stretches)
        share = moved / max(float(np.abs(steps[near]).sum()), 1e-300)
        if share > most and (clock := _on_one_clock(since, column, stretches)) is not None:
            best, most = clock, share
    return best


def _on_one_clock(
    since: Array, column: Array, stretches: Sequence[slice]
) -> tuple[float, Indices] | None:
    """Period and number of each sample, those of the stretches by the way of the column; None where
    that is not in steps of one period.
    """
    lasted = [_lasted(since[one], column[one]) for one in stretches]
    every = np.concatenate(lasted)
    usual = float(np.median(every))
    counts = [np.maximum(np.rint(one / usual), 1.0) for one in lasted]
    if np.sqrt(np.mean((every / usual - np.concatenate(counts)) ** 2)) > _BY_ITSELF:
        return None
    within = [np.concatenate([[0.0], np.cumsum(one)]) for one in counts]
    apart = [(n - n.mean(), since[one]) for n, one in zip(within, stretches, strict=True)]
    period = sum(float(n @ t) for n, t in apart) / sum(float(n @ n) for n, _ in apart)
    begins = [
        float(np.median(since[one] / period - n)) for n, one in zip(within, stretches, strict=True)
    ]
    sizes = [n.size for n in within]
    phase = float(np.angle(np.exp(2j * np.pi * np.array(begins)) @ sizes)) / (2.0 * np.pi)
    number = np.rint(since / period - phase)
    for n, one, begin in zip(within, stretches, begins, strict=True):
        number[one] = np.rint(begin - phase) + n
    _fit_between(number, stretches)
    if np.any(np.diff(number) < 1.0):
        return None
    return float(np.polyfit(number, since, 1)[0]), (number - number[0]).astype(np.int64)


def _fit_between(number: Array, stretches: Sequence[slice]) -> None:
    """Makes numbers outside of the stretches rise from one stretch to the next, in place."""
    edges = [0, *(edge for one in stretches for edge in (one.start, one.stop)), number.size]
    for first, end in zip(edges[::2], edges[1::2], strict=True):
        place = np.arange(end - first)
        low = number[first - 1] + 1.0 if first else -np.inf
        high = number[end] - float(place.size) if end < number.size else np.inf
        rising = np.maximum.accumulate(np.clip(number[first:end] - place, low, max(low, high)))
        number[first:end] = rising + place


def _lasted(since: Array, column: Array) -> Array:
    """Time from each sample to the next [n - 1, s] by the change of a column over its pace."""
    ahead, behind = slice(2 * _MOVED, None), slice(None, -2 * _MOVED)
    pace = (column[ahead] - column[behind]) / (since[ahead] - since[behind])
    middle = 0.5 * (since[ahead] + since[behind])
    at, paces = [since[0], *middle, since[-1]], [pace[0], *pace, pace[-1]]
    if middle.size >= _MOVED:
        # a coast goes on slowing down in its last samples
        for part, end in ((slice(_MOVED), 0), (slice(-_MOVED, None), -1)):
            paces[end] = np.polyval(np.polyfit(middle[part], pace[part], 1), since[end])
    lasted: Array = np.diff(column) / np.interp(0.5 * (since[1:] + since[:-1]), at, paces)
    return lasted


def _numbered(since: Array) -> tuple[float, Indices] | None:
    """Period and number of each stamp [n, s from the first] on the clock that most agree with; None
    where they agree with none, or too many have one number.
    """
    usual, length = float(np.median(np.diff(since))), min(_PART, since.size)
    starts = np.unique(np.linspace(0, since.size - length, _PARTS).round().astype(np.int64))
    parts = since[starts[:, None] + np.arange(length)]
    periods = usual * np.exp(np.linspace(-_FAR, _FAR, 2 * round(_FAR * 4 * length) + 1))
    turns = np.exp(2j * np.pi * parts[:, None, :] / periods[:, None])
    period = float(periods[np.argmax(np.abs(turns.mean(axis=2)).mean(axis=0))])
    first, size = 0.0, length
    while True:
        number = np.rint((since[:size] - first) / period)
        period, first = np.polyfit(number, since[:size], 1)
        if size == since.size:
            break
        size = min(2 * size, since.size)
    number = np.rint((since - first) / period)
    # of two stamps of one number one is its neighbour's: the earlier one came late, or the later
    # one early
    twice = np.flatnonzero(np.diff(number) < 1.0)
    late = twice[number[twice] - np.append(-np.inf, number)[twice] > 1.0]
    number[late] -= 1.0
    early = np.setdiff1d(twice, late) + 1
    number[early[np.append(number, np.inf)[early + 1] - number[early] > 1.0]] += 1.0
    scatter = float(np.std(since - first - period * number)) / period
    if scatter > _BY_ITSELF or np.any(np.diff(number) < 1.0):
        return None
    return float(period), (number - number[0]).astype(np.int64)


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
    rounding = max(1e-12 * float(np.max(np.abs(signal), initial=0.0)), 1e-300)
    moving = error[error > rounding]
    return float(np.median(moving)) if moving.size else rounding
