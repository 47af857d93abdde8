"""Periodic signals against an angle or a phase: columns of harmonics, cycle counting."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def harmonic_design(angle_rad: Array, orders: Sequence[int]) -> Array:
    """Columns [n, 1 + 2k]: 1, cos and sin of each order times angle."""
    columns = [np.ones(angle_rad.size)]
    for order in orders:
        columns += [np.cos(order * angle_rad), np.sin(order * angle_rad)]
    return np.column_stack(columns)


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
