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
    """Standard deviation of the sample-to-sample noise of a signal [n] that steps or drifts.

    From second differences x[k-1] - 2 x[k] + x[k+1] (variance 6 sigma²), robustly by their median
    absolute deviation; falls back to their root mean square where quantisation makes more than
    half of them vanish.
    """
    second = np.diff(signal[np.isfinite(signal)], n=2)
    if second.size < 4:
        return 0.0
    robust = float(np.median(np.abs(second))) / 0.6744897501960817
    if robust == 0.0:
        inner = np.abs(second) <= np.quantile(np.abs(second), 0.95)
        robust = float(np.sqrt(np.mean(second[inner] ** 2)))
    return robust / math.sqrt(6.0)


def find_plateaus(
    signal: Array,
    least: int = 20,
    window: int | None = None,
    tolerance: float = 0.01,
    least_span: float = 0.0,
) -> tuple[Plateau, ...]:
    """Settled stretches of at least `least` rows of a stepped signal [n].

    A row belongs to a step where the means of the `window` rows before and after it differ by
    more than six of their standard errors, `tolerance` of the signal's span (taken as
    `least_span` where that is more) and what rounding of the running sum can make up, eps n max|x|.
    What is left is trimmed at its start while blocks still approach the level of its later half.
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
    found = []
    for start, stop in true_runs(~moving):
        trimmed = _trim(signal, start, stop, window, sigma, limit)
        if stop - trimmed >= least:
            found.append(Plateau(trimmed, stop))
    return tuple(found)


def true_runs(flags: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Start and stop (excluded) of every run of true values in flags [n]."""
    edges = np.flatnonzero(np.diff(np.concatenate([[0], flags.astype(np.int8), [0]])))
    return [(int(a), int(b)) for a, b in zip(edges[::2], edges[1::2], strict=True)]


def _trim(signal: Array, start: int, stop: int, window: int, sigma: float, limit: float) -> int:
    level = float(np.mean(signal[(start + stop) // 2 : stop]))
    near = max(4.0 * sigma / math.sqrt(window), 0.25 * limit)
    while stop - start > 2 * window:
        if abs(float(np.mean(signal[start : start + window])) - level) <= near:
            break
        start += window
    return start


def block_means(values: Array, size: int) -> Array:
    """Means of consecutive blocks of `size` rows of values [n] or [n, k]; the rest is dropped."""
    blocks = values.shape[0] // size
    means: Array = values[: blocks * size].reshape(blocks, size, *values.shape[1:]).mean(axis=1)
    return means


def decimated(size: int, most: int = 2000) -> slice:
    """A slice that keeps every k-th row so that at most `most` of `size` rows are left."""
    return slice(None, None, max(1, -(-size // most)))
