"""Periodic signals against an angle or a phase: harmonic regression, cycle counting."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import hac_covariance, linear_fit

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True, slots=True)
class HarmonicFit:
    """Amplitudes of cos and sin of each order, mean, and their covariance.

    y = mean + sum a_k cos(k x) + b_k sin(k x); `covariance` is ordered mean, a_1, b_1, a_2, ...
    """

    orders: tuple[int, ...]
    mean: float
    cosine: Array
    sine: Array
    covariance: Array
    fitted: Array

    def amplitude(self, order: int) -> float:
        """sqrt(a_k² + b_k²) of one order."""
        index = self.orders.index(order)
        return float(np.hypot(self.cosine[index], self.sine[index]))

    def u_amplitude(self, order: int) -> float:
        """Standard uncertainty of the amplitude, first order."""
        index = self.orders.index(order)
        amplitude = max(self.amplitude(order), 1e-300)
        slope = np.array([self.cosine[index], self.sine[index]]) / amplitude
        block = self.covariance[1 + 2 * index : 3 + 2 * index, 1 + 2 * index : 3 + 2 * index]
        return math.sqrt(max(float(slope @ block @ slope), 0.0))


def harmonic_design(angle_rad: Array, orders: Sequence[int]) -> Array:
    """Columns [n, 1 + 2k]: 1, cos and sin of each order times angle."""
    columns = [np.ones(angle_rad.size)]
    for order in orders:
        columns += [np.cos(order * angle_rad), np.sin(order * angle_rad)]
    return np.column_stack(columns)


def harmonic_fit(angle_rad: Array, y: Array, orders: Sequence[int]) -> HarmonicFit:
    """Least squares of y [n] on harmonics of angle_rad [n], covariance safe under correlation.

    Needs neither even spacing nor whole turns. Raises ValueError where the orders are not
    determined by the angles covered.
    """
    design = harmonic_design(angle_rad, orders)
    fit = linear_fit(design, y)
    if not fit.full_rank:
        raise ValueError("the angles covered do not determine the orders asked for")
    covariance = hac_covariance(design, fit.residuals)
    return HarmonicFit(
        tuple(orders),
        float(fit.coefficients[0]),
        fit.coefficients[1::2],
        fit.coefficients[2::2],
        covariance,
        y - fit.residuals,
    )


def whole_cycles(phase_rad: Array, cycles: float = 1.0) -> NDArray[np.intp]:
    """Row numbers that cut a monotonic phase [n] into stretches of `cycles` whole cycles.

    The first cut is the first row; stretches between consecutive cuts differ from whole cycles
    by less than one sample.
    """
    advance = np.abs(phase_rad - phase_rad[0]) / (2.0 * math.pi * cycles)
    monotonic = np.maximum.accumulate(advance)
    marks = np.arange(0.0, math.floor(float(monotonic[-1])) + 1.0)
    cuts: NDArray[np.intp] = np.unique(np.searchsorted(monotonic, marks - 1e-12))
    return cuts


def sums_between(values: Array | Complex, cuts: NDArray[np.intp]) -> Array | Complex:
    """Sums of values [n] over the stretches between consecutive cuts."""
    running = np.concatenate([[0], np.cumsum(values)])
    return np.diff(running[cuts])


def hermite(nodes: Array, values: Array, x: Array) -> tuple[Array, Array]:
    """A smooth curve through values [m] at increasing nodes [m]: its value and slope at x [n].

    Piecewise cubic with the slopes of second-order differences at the nodes; continued by the
    first and last piece outside them. Reference: Fritsch and Carlson, SIAM J. Numer. Anal. 17,
    1980, eq. 4 (basis).
    """
    slopes = np.gradient(values, nodes)
    index = np.clip(np.searchsorted(nodes, x, side="right") - 1, 0, nodes.size - 2)
    width = np.diff(nodes)[index]
    u = (x - nodes[index]) / width
    rise = values[index + 1] - values[index]
    left, right = slopes[index] * width, slopes[index + 1] * width
    square, cube = 3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise
    value: Array = values[index] + u * (left + u * (square + u * cube))
    slope: Array = (left + u * (2.0 * square + 3.0 * u * cube)) / width
    return value, slope
