"""Periodic signals against an angle or a phase: columns of harmonics, cycle counting."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def harmonic_design(angle_rad: Array, orders: Sequence[int]) -> Array:
    """Columns of a Fourier series: 1, then cos and sin of each order times the angle.

    Parameters
    ----------
    angle_rad
        Angle [n, rad].
    orders
        Cycles a turn of the angle, k of them.

    Returns
    -------
    array [n, 1 + 2k]
        1, cos o₁θ, sin o₁θ, cos o₂θ, ...

    """
    columns = [np.ones(angle_rad.size)]
    for order in orders:
        columns += [np.cos(order * angle_rad), np.sin(order * angle_rad)]
    return np.column_stack(columns)


def whole_cycles(phase_rad: Array, cycles: float = 1.0) -> NDArray[np.intp]:
    """Rows that cut a phase into stretches of whole cycles.

    Parameters
    ----------
    phase_rad
        Phase that rises or falls throughout but for noise [n, rad].
    cycles
        Cycles a stretch [1].

    Returns
    -------
    array
        Rising row numbers, the first one 0. A stretch between two of them differs from whole cycles
        by less than one sample; what follows the last is less than a stretch.

    Examples
    --------
    >>> whole_cycles(np.linspace(0.0, 4.0 * math.pi, 9)).tolist()
    [0, 4, 8]

    """
    advance = np.abs(phase_rad - phase_rad[0]) / (2.0 * math.pi * cycles)
    monotonic = np.maximum.accumulate(advance)
    marks = np.arange(0.0, math.floor(float(monotonic[-1])) + 1.0)
    return np.unique(np.searchsorted(monotonic, marks - 1e-12))


def hermite(nodes: Array, values: Array, x: Array) -> tuple[Array, Array]:
    """A smooth curve through given points: its value and its slope.

    Parameters
    ----------
    nodes
        Abscissae [m], rising, two or more.
    values
        Ordinates [m].
    x
        Where the curve is wanted [n]; outside the nodes the first and last piece go on.

    Returns
    -------
    value [n]
        Of the curve, in the unit of the values.
    slope [n]
        Its derivative by x.

    Notes
    -----
    Piecewise cubic Hermite. The slopes at the nodes are second-order differences, at the two ends
    those of the chords; they are not limited, so the curve may overshoot.

    References
    ----------
    Fritsch and Carlson, SIAM J. Numer. Anal. 17(2), 1980, 238, eq. 4 (the basis),
    doi:10.1137/0717021.

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
