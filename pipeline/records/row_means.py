"""A signal on the rows of another clock: its means over slower ones, a curve on faster ones."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int64]

FASTER = 1.5
"""How many times as often as the rows a signal is sampled that is averaged over them."""


def slower_rows(row_s: Array, sample_s: Array) -> bool:
    """Whether rows are slower than the samples of another table.

    Parameters
    ----------
    row_s
        Times of the rows [n, s].
    sample_s
        Times of the samples [m, s].

    """
    if row_s.size < 2 or sample_s.size < 2:
        return False
    return bool(np.median(np.diff(row_s)) > FASTER * np.median(np.diff(sample_s)))


def curve_between(row_s: Array, sample_s: Array, samples: Array) -> Array:
    """A slow signal on the rows of a faster clock.

    Parameters
    ----------
    row_s
        Times of the rows [n, s].
    sample_s
        Times of the samples [m, s], ascending.
    samples
        The signal [m, any unit], finite.

    Returns
    -------
    array [n]
        A cubic spline; a straight line across a gap, and where the rows are no faster; NaN
        outside the samples' span.

    Notes
    -----
    Between samples h apart straight lines have sinc²(f h) of a wave of frequency f: an eighth less
    of it at five samples a period, where a cubic spline has half a percent less.

    References
    ----------
    Unser, IEEE Signal Process. Mag. 16(6), 1999, 22, doi:10.1109/79.799930 (splines).

    """
    line: Array = np.interp(row_s, sample_s, samples, left=np.nan, right=np.nan)
    if sample_s.size < 4 or not slower_rows(sample_s, row_s):
        return line
    from scipy.interpolate import CubicSpline

    curve = CubicSpline(sample_s, samples)(row_s)
    step_s = np.diff(sample_s)
    place = np.clip(np.searchsorted(sample_s, row_s, "right") - 1, 0, step_s.size - 1)
    near = np.isfinite(line) & (step_s[place] < FASTER * np.median(step_s))
    return np.where(near, curve, line)


def bridged(row_s: Array, column: Array) -> Array:
    """A column with the rows filled in that hold no value between two that do.

    Parameters
    ----------
    row_s
        Times of the rows [n, s].
    column
        The signal [n, any unit], NaN where it was not recorded.

    Returns
    -------
    array [n]
        With a cubic through the two nearest values on either side of a single row without one, or a
        straight line where they are not there; NaN in longer gaps.

    Notes
    -----
    A logger that lacks one column in a row has the others there: a fit that needs all of them
    would lose a third of its rows where each of eight columns lacks one in twenty.

    """
    known = np.isfinite(column)
    single = np.flatnonzero(~known[1:-1] & known[:-2] & known[2:]) + 1
    if single.size == 0:
        return column
    places, filled = np.flatnonzero(known), column.copy()
    after = np.searchsorted(places, single)
    filled[single] = _through(row_s, column, single, [places[after - 1], places[after]])
    inner = (after >= 2) & (after < places.size - 1)
    beside = [places[after[inner] + k] for k in (-2, -1, 0, 1)]
    filled[single[inner]] = _through(row_s, column, single[inner], beside)
    return filled


def _through(row_s: Array, column: Array, places: Indices, beside: Sequence[Indices]) -> Array:
    """Lagrange's polynomial through the values in rows beside some places, at these."""
    distance = [row_s[rows] - row_s[places] for rows in beside]
    total = np.zeros(places.size)
    for rows, own in zip(beside, distance, strict=True):
        others = [other for other in distance if other is not own]
        total += column[rows] * np.prod([o / (o - own) for o in others], axis=0)
    return total


def row_means(row_s: Array, sample_s: Array, samples: Array) -> Array:
    """Means of a sampled signal over rows about their middles.

    Parameters
    ----------
    row_s
        Middles of the rows [n, s]; each is as long as the median of their distances.
    sample_s
        Times of the samples [m, s], ascending.
    samples
        The signal [m, any unit], finite.

    Returns
    -------
    array [n]
        Of straight lines between samples, over what of a row the samples span; NaN where they do
        not span its middle.

    """
    half = 0.5 * float(np.median(np.diff(row_s)))
    steps = np.diff(sample_s)
    integral = np.concatenate([[0.0], np.cumsum(steps * 0.5 * (samples[1:] + samples[:-1]))])

    def until(t_s: Array) -> Array:
        place = np.clip(np.searchsorted(sample_s, t_s, side="right") - 1, 0, steps.size - 1)
        within = t_s - sample_s[place]
        share = within / np.where(steps[place] > 0.0, steps[place], 1.0)
        rise = samples[place + 1] - samples[place]
        return integral[place] + within * (samples[place] + 0.5 * share * rise)

    begin = np.clip(row_s - half, sample_s[0], sample_s[-1])
    end = np.clip(row_s + half, sample_s[0], sample_s[-1])
    inside = (row_s >= sample_s[0]) & (row_s <= sample_s[-1]) & (end > begin)
    means = np.full(row_s.size, np.nan)
    means[inside] = (until(end) - until(begin))[inside] / (end - begin)[inside]
    return means
