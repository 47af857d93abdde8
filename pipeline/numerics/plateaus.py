"""Finds the settled stretches of a signal that was stepped from level to level."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Plateau:
    """Rows start..stop (stop excluded) of a settled stretch."""

    start: int
    stop: int

    @property
    def size(self) -> int:
        """How many rows."""
        return self.stop - self.start

    @property
    def rows(self) -> slice:
        """The rows as a slice."""
        return slice(self.start, self.stop)


def white_noise_sigma(signal: Array) -> float:
    """Standard deviation of the sample-to-sample noise of a signal that steps or drifts.

    Parameters
    ----------
    signal
        Samples [n, any unit]; those that are not finite are left out.

    Returns
    -------
    float
        In the unit of the signal; 0 for fewer than six samples.

    Notes
    -----
    Second differences x[k−1] − 2 x[k] + x[k+1] of white noise have the variance 6 σ². σ comes from
    their median absolute value; where rounding makes more than half of them vanish, from the root
    mean square of those up to the 95th percentile.

    """
    second = np.diff(signal[np.isfinite(signal)], n=2)
    if second.size < 4:
        return 0.0
    robust = float(np.median(np.abs(second))) / 0.6744897501960817
    if robust == 0.0:
        inner = np.abs(second) <= np.quantile(np.abs(second), 0.95)
        robust = float(np.sqrt(np.mean(second[inner] ** 2)))
    return robust / math.sqrt(6.0)


def noise_about_cubics(t_s: Array, signal: Array) -> float:
    """Standard deviation of the noise of a signal that bends, on any clock.

    Parameters
    ----------
    t_s
        Sampling instants [n, s], rising.
    signal
        Samples [n, any unit].

    Returns
    -------
    float
        In the unit of the signal; 0 for fewer than six samples.

    Notes
    -----
    Each sample is held against the cubic through the two before and the two after, at their own
    instants: e_k = x_k - Σ w_j x_j, of variance σ² (1 + Σ w_j²). Where a shaft turns by radians
    between samples, their jitter is no noise, as it is in second differences.

    Examples
    --------
    >>> t_s = np.array([0.0, 1.0, 2.1, 2.9, 4.2, 5.0, 6.1])
    >>> round(noise_about_cubics(t_s, 3.0 * t_s**3 - t_s), 9)
    0.0

    """
    if t_s.size < 6:
        return 0.0
    offsets = (-2, -1, 1, 2)
    at = t_s[2:-2]
    stamps = {n: t_s[2 + n : t_s.size - 2 + n] for n in offsets}
    error, power = signal[2:-2].astype(np.float64), np.ones(at.size)
    for n in offsets:
        others = [m for m in offsets if m != n]
        parts = [(at - stamps[m]) / (stamps[n] - stamps[m]) for m in others]
        weight = np.prod(parts, axis=0)
        error = error - weight * signal[2 + n : t_s.size - 2 + n]
        power = power + weight**2
    return float(np.median(np.abs(error) / np.sqrt(power))) / 0.6744897501960817


def find_plateaus(
    signal: Array,
    least: int = 20,
    window: int | None = None,
    tolerance: float = 0.01,
    least_span: float = 0.0,
) -> tuple[Plateau, ...]:
    """Settled stretches of a signal that was stepped from level to level.

    Parameters
    ----------
    signal
        Samples [n, any unit], finite.
    least
        Fewest rows a stretch.
    window
        Rows a mean; by default a hundredth of the record, at least 3 and at most `least`.
    tolerance
        Part of the signal's span [1] by which a settled signal may drift within two windows.
    least_span
        Span that is taken where the signal's own is less [unit of the signal].

    Returns
    -------
    tuple of Plateau
        In order of rows. A record shorter than two stretches is one plateau, or none where it is
        shorter than `least`.

    Notes
    -----
    A row belongs to a step where the means of the windows before and after it differ by more than
    the largest of: six standard errors of their difference, `tolerance` of the span, and what
    rounding of the running sum can make up, eps n max|x|. From what is left, blocks are cut off at
    the start while they still approach the level of the later half.

    """
    n = signal.size
    if n < 2 * least:
        return (Plateau(0, n),) if n >= least else ()
    window = max(3, min(n // 100, least)) if window is None else window
    sums = np.concatenate([[0.0], np.cumsum(signal)])
    centre = np.arange(window, n - window + 1)
    jump = np.zeros(n + 1)
    jump[centre] = np.abs(
        (sums[centre + window] - 2.0 * sums[centre] + sums[centre - window]) / window
    )
    span = max(float(np.ptp(signal)), least_span)
    sigma = white_noise_sigma(signal)
    rounding = float(np.finfo(np.float64).eps) * n * float(np.max(np.abs(signal)))
    limit = max(6.0 * sigma * math.sqrt(2.0 / window), tolerance * span, rounding)
    moving = jump[:n] > limit
    plateaus = []
    for start, stop in true_runs(~moving):
        trimmed = _trim(signal, start, stop, window, sigma, limit)
        if stop - trimmed >= least:
            plateaus.append(Plateau(trimmed, stop))
    return tuple(plateaus)


def true_runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and stop of every run of true values.

    Parameters
    ----------
    flags
        Booleans [n].

    Returns
    -------
    list of (start, stop)
        Row numbers; stop is excluded.

    Examples
    --------
    >>> true_runs(np.array([True, True, False, True]))
    [(0, 2), (3, 4)]

    """
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _trim(signal: Array, start: int, stop: int, window: int, sigma: float, limit: float) -> int:
    level = float(np.mean(signal[(start + stop) // 2 : stop]))
    tolerance = max(4.0 * sigma / math.sqrt(window), 0.25 * limit)
    while stop - start > 2 * window:
        if abs(float(np.mean(signal[start : start + window])) - level) <= tolerance:
            break
        start += window
    return start


def block_means(values: Array, size: int) -> Array:
    """Means of consecutive blocks of rows; rows that fill no block are dropped.

    Parameters
    ----------
    values
        [n] or [n, k], any unit.
    size
        Rows a block.

    Returns
    -------
    array [n // size] or [n // size, k]
        Unit of the values.

    """
    blocks = values.shape[0] // size
    return values[: blocks * size].reshape(blocks, size, *values.shape[1:]).mean(axis=1)


def decimated(size: int, most: int = 2000) -> slice:
    """A slice that keeps every k-th row.

    Parameters
    ----------
    size
        How many rows there are.
    most
        How many may be left.

    Returns
    -------
    slice
        From the first row, with the smallest step that leaves at most `most`.

    """
    return slice(None, None, max(1, -(-size // most)))
