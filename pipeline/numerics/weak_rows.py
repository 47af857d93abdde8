"""Derivatives without differentiating: integrals of a signal against smooth windows.

For a window phi that vanishes with its derivatives at both ends, partial integration gives
integral(phi x') = -integral(phi' x) and integral(phi x'') = integral(phi'' x), so an equation
of motion becomes one row a window in which the noisy derivative never appears. The window is
phi(u) = (1 - u²)^4 on -1 < u < 1. Reference: Messenger and Bortz, Multiscale Model. Simul. 19(3),
2021 (weak SINDy), eqs. 2.3-2.6.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LEAST_SAMPLES = 9
EVEN_SPACING = 1e-3


@dataclass(frozen=True, slots=True)
class WeakRows:
    """Windows over one clock: rows `starts` [w] to `starts + sizes`, and their weights.

    `kernels[order]` is a list of one weight vector a window, or of one for all where the clock is
    even. `centres_s` [w] are the windows' mid times.
    """

    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    centres_s: Array
    kernels: tuple[tuple[Array, ...], tuple[Array, ...], tuple[Array, ...]]

    @property
    def count(self) -> int:
        """Number of windows."""
        return int(self.starts.size)

    def integral(self, signal: Array, order: int = 0) -> Array:
        """Window averages [w] of a derivative of a signal [n]: the signal, its first or second.

        integral(phi d^order x/dt^order) / integral(phi), the derivatives thrown onto phi. Exact
        for constants (order 0), straight lines (1) and parabolas (2) on any clock.
        """
        kernels = self.kernels[order]
        if len(kernels) == 1:
            size = kernels[0].size
            views = np.lib.stride_tricks.sliding_window_view(signal, size)[self.starts]
            centred = views - views.mean(axis=1, keepdims=True) if order else views
            uniform: Array = centred @ kernels[0]
            return uniform
        out = np.empty(self.count)
        for i, (start, kernel) in enumerate(zip(self.starts, kernels, strict=True)):
            part = signal[start : start + kernel.size]
            out[i] = kernel @ (part - part.mean() if order else part)
        return out

    def noise_gain(self, order: int) -> float:
        """Standard deviation of `integral(white noise of unit deviation, order)`, typical."""
        return float(np.median([np.linalg.norm(kernel) for kernel in self.kernels[order]]))


def weak_rows(t_s: Array, width_s: float, overlap: float = 0.5) -> WeakRows:
    """Windows of `width_s` over the clock t_s [n], each overlapping the next by `overlap`.

    A window with fewer than nine samples, or with a gap of more than a quarter of its width, is
    left out. Raises ValueError where no window is left.
    """
    hop = width_s * (1.0 - overlap)
    firsts = np.arange(t_s[0], t_s[-1] - width_s * (1.0 - 1e-9), hop)
    starts = np.searchsorted(t_s, firsts - 1e-9 * width_s)
    stops = np.searchsorted(t_s, firsts + width_s * (1.0 + 1e-9), side="right")
    gap = np.diff(t_s)
    even = gap.size > 0 and float(np.ptp(gap)) < EVEN_SPACING * float(np.median(gap))
    if even:
        size = round(width_s / float(np.median(gap))) + 1
        keep = starts + size <= t_s.size
        starts, stops = starts[keep], starts[keep] + size
    wide = np.flatnonzero(gap > 0.25 * width_s)
    blocked = np.searchsorted(wide, starts) != np.searchsorted(wide, np.maximum(stops - 1, starts))
    fine = (stops - starts >= LEAST_SAMPLES) & ~blocked
    starts, stops = starts[fine], stops[fine]
    if starts.size == 0:
        raise ValueError("the record holds no window of nine samples without a gap")
    centres = np.array([0.5 * (t_s[a] + t_s[b - 1]) for a, b in zip(starts, stops, strict=True)])
    cells = [(starts[0], stops[0])] if even else list(zip(starts, stops, strict=True))
    triples = [_kernels(t_s[a:b]) for a, b in cells]
    kernels = (
        tuple(k[0] for k in triples),
        tuple(k[1] for k in triples),
        tuple(k[2] for k in triples),
    )
    return WeakRows(starts.astype(np.int64), (stops - starts).astype(np.int64), centres, kernels)


def _kernels(t_s: Array) -> tuple[Array, Array, Array]:
    """Weights of order 0, 1, 2 over one window, normalised to be exact on polynomials."""
    half = 0.5 * float(t_s[-1] - t_s[0])
    u = (t_s - 0.5 * (t_s[0] + t_s[-1])) / half
    cell = np.gradient(u)
    inside = 1.0 - u**2
    zero = cell * inside**4
    first = cell * 8.0 * u * inside**3
    second = cell * (48.0 * u**2 * inside**2 - 8.0 * inside**3)
    zero = zero / zero.sum()
    first = _free_of(first, np.ones((1, u.size)))
    first = first / (first @ u) / half
    second = _free_of(second, np.vstack([np.ones(u.size), u]))
    second = second / (second @ (0.5 * u**2)) / half**2
    return zero, first, second


def _free_of(kernel: Array, rows: Array) -> Array:
    """The kernel less its part along the rows [r, n]."""
    coefficients = np.linalg.lstsq(rows.T, kernel, rcond=None)[0]
    free: Array = kernel - coefficients @ rows
    return free


def smooth_speed(t_s: Array, angle: Array, width_s: float) -> Array:
    """Rate [n] of an angle [n] averaged over windows of `width_s`, interpolated to the clock."""
    rows = weak_rows(t_s, width_s, overlap=0.75)
    speed: Array = np.interp(t_s, rows.centres_s, rows.integral(angle, 1))
    return speed
