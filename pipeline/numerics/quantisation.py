"""What rounding to a converter's steps does to a reading, beyond white noise.

The mean of Q(x + n), n of standard deviation s, is off x by Σ_k (-1)^k q/(πk) sin(2πkx/q)
exp(-2π²k²s²/q²): noise of half a step hides it, and without noise all samples of a steady level are
off by the same part of a step, however many they are. Over all x its mean square is
q²/(2π²) Σ_k exp(-4π²k²s²/q²)/k², q²/12 without noise.

Reference: Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, 4.
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.records.capture import Array

_K = np.arange(1.0, 65.0)
_LATTICE = 8
"""Distinct values from which on their common step is a converter's: a few are what was set."""
_MOST_DIGITS = 5
"""Digits beyond which a number's rounding is below any instrument's error."""
_EXACT = 1e-6
"""Share of a step, or of a value, that is rounding of floating-point numbers."""


@dataclass(frozen=True, slots=True)
class Rounding:
    """What rounding leaves in the mean of one level.

    Attributes
    ----------
    u
        Its standard uncertainty [unit of the readings], with the sign of the level: a converter
        rounds both senses alike.
    cell
        The level in whole steps, without its sign. Levels of one cell, read in one way, have one
        error.

    """

    u: float
    cell: int


EXACT = Rounding(0.0, 0)
"""A mean that no rounding shows in."""


def resolution(signal: Array) -> float:
    """The step of a converter: the least spacing of a signal's values.

    Parameters
    ----------
    signal
        Readings [n, any unit]; those that are not finite are left out.

    Returns
    -------
    float
        Step q in the unit of the signal; 0 where all values are one.

    Notes
    -----
    Spacings below 1e-7 of the span are rounding of a sum of channels, not steps. Readings of a
    continuous channel have a least spacing too: that it is a step has to show elsewhere.

    Examples
    --------
    >>> resolution(np.array([0.5, 1.5, 1.0, 3.0]))
    0.5

    """
    values = np.unique(signal[np.isfinite(signal)])
    spacing = np.diff(values)
    spacing = spacing[spacing > 1e-7 * float(np.ptp(values))] if values.size > 1 else spacing
    return float(spacing.min()) if spacing.size else 0.0


def rounding_rms(step: float, sigma: float) -> float:
    """Root mean square of what rounding leaves in the mean of many samples of one level.

    Parameters
    ----------
    step
        Step q of the converter [any unit].
    sigma
        Standard deviation of the noise before the converter [same unit].

    Returns
    -------
    float
        [same unit], over all levels alike: q/√12 without noise, next to none at half a step of
        noise.

    Notes
    -----
    q²/(2π²) Σ_k exp(−4π² k² σ²/q²)/k², its square.

    References
    ----------
    Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, ch. 4.

    Examples
    --------
    >>> round(rounding_rms(1.0, 0.0) * math.sqrt(12.0), 2), round(rounding_rms(1.0, 0.5), 4)
    (1.0, 0.0016)

    """
    if step <= 0.0:
        return 0.0
    terms = np.exp(-((2.0 * math.pi * _K * sigma / step) ** 2)) / _K**2
    return step * math.sqrt(float(terms.sum()) / 2.0) / math.pi


def steps_of(column: Array) -> Array:
    """The step to which each value of a column is rounded: a converter's, or a file's digits.

    Parameters
    ----------
    column
        Readings [n, any unit].

    Returns
    -------
    array [n]
        [same unit]; 0 where no rounding shows.

    Notes
    -----
    All values are multiples of one step, or of the last of five digits at most. A file that keeps a
    number of digits has a step a decade, one that keeps decimals the step of its largest values.

    Examples
    --------
    >>> steps_of(np.array([0.122, 0.0447, -0.109])).round(6).tolist()
    [0.001, 0.0001, 0.001]

    """
    values = np.abs(column)
    there = np.isfinite(values) & (values > 0.0)
    if not there.any():
        return np.zeros(column.size)
    distinct, step = np.unique(values[there]), resolution(column)
    several = np.unique(column[np.isfinite(column)]).size >= _LATTICE
    if not (several and step > 0.0 and _multiples(distinct, step)):
        step = 0.0
    # a converter's step beside the last digit, which is never coarser at small values
    return np.maximum(step, _digit_steps(np.where(there, values, distinct[-1]), distinct))


def _digit_steps(values: Array, distinct: Array) -> Array:
    """The last digit that each of positive values [n] keeps; 0 where they keep more than five."""
    decades, of_distinct = (np.floor(np.log10(one) + 1e-9) for one in (values, distinct))
    for digits in range(1, _MOST_DIGITS + 1):
        if _multiples(distinct, 10.0 ** (of_distinct - digits + 1.0)):
            coarsest = 10.0 ** (of_distinct[-1] - digits + 1.0)
            if _multiples(distinct, coarsest):
                return np.full(values.size, coarsest)
            steps: Array = 10.0 ** (decades - digits + 1.0)
            return steps
    return np.zeros(values.size)


def _multiples(values: Array, step: Array | float) -> bool:
    """Whether all values [n] are whole steps [n, or one for all]."""
    counts = values / step
    return bool(np.all(np.abs(counts - np.round(counts)) <= _EXACT * np.maximum(counts, 1.0)))


@dataclass(frozen=True, slots=True)
class RoundedColumn:
    """A column with what it is rounded to.

    Attributes
    ----------
    readings
        [n, any unit].
    steps
        What each is rounded to [n, same unit]; 0 where no rounding shows.
    noise
        Scatter from reading to reading, over all levels together [same unit].

    """

    readings: Array
    steps: Array
    noise: float

    def error_of_mean(self, rows: slice) -> Rounding:
        """What rounding leaves in the mean of rows of one level.

        Parameters
        ----------
        rows
            Of the column.

        Returns
        -------
        Rounding
            Of no error where no rounding shows, or noise hides it.

        Notes
        -----
        The noise is that of all levels, or its own where that is less: one near a threshold
        scatters by half a step where another of the same noise stands still.

        """
        level, step = self.readings[rows], float(np.max(self.steps[rows], initial=0.0))
        known = level[np.isfinite(level)]
        if step <= 0.0 or known.size == 0:
            return EXACT
        mean = float(np.mean(known))
        noise = min(self.noise, noise_after_rounding(level, step))
        left = rounding_rms(step, noise_before_rounding(noise, step))
        return Rounding(math.copysign(left, mean), round(abs(mean) / step))


def rounded_column(column: Array, levels: Sequence[slice]) -> RoundedColumn:
    """A column with its steps, and its noise at some levels.

    Parameters
    ----------
    column
        Readings [n, any unit] in their order.
    levels
        Rows of each level that it stays at: what moves between them is no noise.

    """
    steps = steps_of(column)
    usual = float(np.median(steps)) if steps.size else 0.0
    scatter = np.array([noise_after_rounding(column[rows], usual) for rows in levels])
    sizes = np.array([rows.stop - rows.start for rows in levels], dtype=np.float64)
    noise = math.sqrt(float(sizes @ scatter**2) / max(float(sizes.sum()), 1.0))
    return RoundedColumn(column, steps, noise)


def covariance_alike(errors: Array, cells: Sequence[Hashable]) -> Array:
    """Covariance of errors of which those of one cell are one error.

    Parameters
    ----------
    errors
        Standard uncertainties [n, any unit], with the sign of what they act on.
    cells
        Of each.

    Returns
    -------
    array [n, n]
        [unit²].

    """
    return spread_alike(np.eye(errors.size), errors, cells)


def spread_alike(levers: Array, errors: Array, cells: Sequence[Hashable]) -> Array:
    """Covariance of sums of errors of which those of one cell are one error.

    Parameters
    ----------
    levers
        What each error counts in each sum [k, n].
    errors
        Standard uncertainties [n, any unit], with the sign of what they act on.
    cells
        Of each.

    Returns
    -------
    array [k, k]
        [unit²], without a matrix of all errors.

    """
    numbers = {cell: number for number, cell in enumerate(dict.fromkeys(cells))}
    sums = np.zeros((max(len(numbers), 1), levers.shape[0]))
    np.add.at(
        sums, np.array([numbers[cell] for cell in cells], dtype=np.int64), (levers * errors).T
    )
    covariance: Array = sums.T @ sums
    return covariance


def noise_after_rounding(signal: Array, step: float) -> float:
    """Standard deviation of the sample-to-sample scatter of a rounded signal.

    Parameters
    ----------
    signal
        Readings [n, any unit]; those that are not finite are left out.
    step
        Step of the converter [same unit].

    Returns
    -------
    float
        [same unit]; 0 for fewer than six samples.

    Notes
    -----
    Second differences have the variance 6 s². The mean square is taken of those below eight of
    their standard deviations, itself taken as one step at least: a median would be 0 or a whole
    step where the noise is less than a step.

    """
    second = np.diff(signal[np.isfinite(signal)], n=2)
    if second.size < 4:
        return 0.0
    usual = float(np.median(np.abs(second))) / 0.6744897501960817
    inner = second[np.abs(second) <= 8.0 * max(usual, step)]
    return math.sqrt(float(np.mean(inner**2)) / 6.0) if inner.size else 0.0


def noise_before_rounding(sigma: float, step: float) -> float:
    """The noise before a converter that scatters by a given amount after it.

    Parameters
    ----------
    sigma
        Standard deviation of the readings' scatter [any unit].
    step
        Step q of the converter [same unit]; 0 where there is none.

    Returns
    -------
    float
        Standard deviation [same unit], over all levels alike; 0 where rounding alone explains it.

    Notes
    -----
    s_after² = s² + q²/12 − (mean square of the means' error, see `rounding_rms`), which is 0
    without noise, solved for s.

    """
    if step <= 0.0 or sigma >= 2.0 * step:
        return math.sqrt(max(sigma**2 - step**2 / 12.0, 0.0))
    trial = np.linspace(0.0, 2.1, 421)
    means = np.exp(-((2.0 * math.pi * _K[:, None] * trial) ** 2)) / _K[:, None] ** 2
    after = trial**2 + 1.0 / 12.0 - means.sum(axis=0) / (2.0 * math.pi**2)
    return step * float(np.interp((sigma / step) ** 2, np.maximum.accumulate(after), trial))
