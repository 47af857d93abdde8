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
STRETCH = 16


@dataclass(frozen=True, slots=True)
class WeakRows:
    """Windows over one clock, with the weights that turn samples into averages.

    Attributes
    ----------
    starts, sizes
        First row and number of rows of each window [w].
    centres_s
        Mid times of the windows [w, s].
    weights
        For derivatives of order 0, 1 and 2: [3, m], shared by all windows, on an even clock; else
        [3, sum m] over the rows of `members`.
    members
        Rows of every window in turn [sum m]; empty on an even clock.

    """

    starts: NDArray[np.int64]
    sizes: NDArray[np.int64]
    centres_s: Array
    weights: Array
    members: NDArray[np.int64]

    @property
    def count(self) -> int:
        """Number of windows."""
        return int(self.starts.size)

    def integral(self, signal: Array, order: int = 0) -> Array:
        """Window averages of a signal or of its first or second derivative.

        Parameters
        ----------
        signal
            Samples on the clock of the windows [n, any unit].
        order
            Of the derivative: 0, 1 or 2.

        Returns
        -------
        array [w]
            Unit of the signal over s^order.

        Notes
        -----
        ∫φ dᵏx/dtᵏ dt/∫φ dt, the derivatives moved onto φ by partial integration. Exact for
        constants (order 0), straight lines (1) and parabolas (2) on any clock.

        """
        kernel = self.weights[order]
        if self.members.size == 0:
            views = np.lib.stride_tricks.sliding_window_view(signal, kernel.size)[self.starts]
            centred = views - views.mean(axis=1, keepdims=True) if order else views
            return centred @ kernel
        part = signal[self.members]
        if order:
            means = _sums(part, self.sizes) / self.sizes
            part = part - np.repeat(means, self.sizes)
        return _sums(part * kernel, self.sizes)

    def clusters(self, length_s: float, capture: int) -> NDArray[np.int64]:
        """Numbers of the stretches that the windows lie in, other ones in each capture.

        Parameters
        ----------
        length_s
            Of a stretch [s].
        capture
            Number of the capture.

        Returns
        -------
        array [w] of int
            One a window.

        """
        stretch = np.floor((self.centres_s - self.centres_s[0]) / length_s)
        return stretch.astype(np.int64) + 1_000_000 * capture

    def noise_gain(self, order: int) -> float:
        """How much white noise of the signal is left in the window averages.

        Parameters
        ----------
        order
            Of the derivative: 0, 1 or 2.

        Returns
        -------
        float
            Standard deviation of `integral` over that of the samples [s^-order]; on an uneven clock
            the median over the windows.

        """
        power = self.weights[order] ** 2
        if self.members.size == 0:
            return float(np.sqrt(power.sum()))
        return float(np.sqrt(np.median(_sums(power, self.sizes))))


def weak_rows(t_s: Array, width_s: float, overlap: float = 0.5) -> WeakRows:
    """Windows over a clock, with the weights that turn samples into averages of derivatives.

    Parameters
    ----------
    t_s
        Sampling instants [n, s], rising.
    width_s
        Width of a window [s].
    overlap
        Part of a window that the next one shares [1], below 1.

    Returns
    -------
    WeakRows
        Windows of at least `LEAST_SAMPLES` samples without a gap of more than a quarter of their
        width.

    Raises
    ------
    ValueError
        No window is left.

    Notes
    -----
    φ(u) = (1 − u²)⁴ on −1 < u < 1. The weights are corrected so that they are exact on polynomials
    of their order, whatever the clock.

    References
    ----------
    Messenger and Bortz, Multiscale Model. Simul. 19(3), 2021, 1474, doi:10.1137/20M1343166.

    Examples
    --------
    >>> t_s = np.linspace(0.0, 1.0, 101)
    >>> rows = weak_rows(t_s, 0.5)
    >>> np.round(rows.integral(3.0 * t_s**2, order=2), 6).tolist()
    [6.0, 6.0, 6.0]

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
    starts, sizes = starts[fine].astype(np.int64), (stops - starts)[fine].astype(np.int64)
    if starts.size == 0:
        raise ValueError("the record holds no window of nine samples without a gap")
    centres: Array = 0.5 * (t_s[starts] + t_s[starts + sizes - 1])
    if even:
        weights = _kernels(t_s[starts[0] : starts[0] + sizes[0]], sizes[:1])
        return WeakRows(starts, sizes, centres, weights, np.zeros(0, dtype=np.int64))
    within = np.arange(sizes.sum()) - np.repeat(np.cumsum(sizes) - sizes, sizes)
    members = np.repeat(starts, sizes) + within
    return WeakRows(starts, sizes, centres, _kernels(t_s[members], sizes), members)


def _sums(values: Array, sizes: NDArray[np.int64]) -> Array:
    """Sums over consecutive stretches of `sizes` values."""
    return np.add.reduceat(values, np.cumsum(sizes) - sizes)


def _kernels(t_s: Array, sizes: NDArray[np.int64]) -> Array:
    """Weights [3, sum m] of order 0, 1, 2 over windows in turn, exact on polynomials."""
    heads = np.cumsum(sizes) - sizes
    tails = heads + sizes - 1
    half = 0.5 * (t_s[tails] - t_s[heads])
    u = (t_s - np.repeat(0.5 * (t_s[tails] + t_s[heads]), sizes)) / np.repeat(half, sizes)
    cell = np.gradient(u)
    cell[heads], cell[tails] = 0.0, 0.0
    inside = 1.0 - u**2
    zero = cell * inside**4
    first = cell * 8.0 * u * inside**3
    second = cell * (48.0 * u**2 * inside**2 - 8.0 * inside**3)

    def spread(per_window: Array) -> Array:
        return np.repeat(per_window, sizes)

    zero = zero / spread(_sums(zero, sizes))
    first = first - spread(_sums(first, sizes) / sizes)
    first = first / spread(_sums(first * u, sizes) * half)
    centred = u - spread(_sums(u, sizes) / sizes)
    second = second - spread(_sums(second, sizes) / sizes)
    slope = _sums(second * centred, sizes) / _sums(centred**2, sizes)
    second = second - spread(slope) * centred
    second = second / spread(_sums(0.5 * second * u**2, sizes) * half**2)
    return np.vstack([zero, first, second])


def smooth_speed(t_s: Array, angle: Array, width_s: float) -> Array:
    """Rate of an angle: the slope of the straight line through the samples about each row.

    Parameters
    ----------
    t_s
        Sampling instants [n, s], rising.
    angle
        Angle, unwrapped [n, any unit].
    width_s
        Width of the window [s]; at least five samples are taken.

    Returns
    -------
    array [n]
        Unit of the angle per second. Within half a window of the ends, the rate of the first and of
        the last whole window.

    Raises
    ------
    ValueError
        The record is shorter than the window.

    References
    ----------
    Savitzky and Golay, Anal. Chem. 36(8), 1964, 1627, doi:10.1021/ac60214a047.

    """
    reach = max(2, round(0.5 * width_s / float(np.median(np.diff(t_s)))))
    size = 2 * reach + 1
    if t_s.size < size:
        raise ValueError("the record is shorter than the window of its speed")
    slopes = _slopes(t_s, angle, size)
    return slopes[np.clip(np.arange(t_s.size) - reach, 0, slopes.size - 1)]


def _slopes(t_s: Array, y: Array, size: int) -> Array:
    """Slopes [n - size + 1] of the lines through every `size` neighbouring samples.

    Sums over a window are differences of running sums. These start again, about the mean, every
    `STRETCH` windows: over a long record they grow until rounding hides what one window adds.
    """
    count, step = t_s.size - size + 1, STRETCH * size
    length = step + size - 1

    def stretches(values: Array) -> Array:
        padded = np.pad(values, (0, -count % step), mode="edge")
        rows = np.lib.stride_tricks.sliding_window_view(padded, length)[::step]
        return rows - rows.mean(axis=1, keepdims=True)

    def means(values: Array) -> Array:
        running = np.cumsum(np.pad(values, ((0, 0), (1, 0))), axis=1)
        return ((running[:, size:] - running[:, :-size]) / size).ravel()[:count]

    t, x = stretches(t_s), stretches(y)
    mean_t = means(t)
    return (means(t * x) - mean_t * means(x)) / (means(t * t) - mean_t**2)
