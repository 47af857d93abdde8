"""The wave that some orders make together, and its peak."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pipeline.numerics.least_squares import Array
from pipeline.numerics.orders import OrderLine
from pipeline.physics.units import TURN_RAD

GRID_A_CYCLE = 32
"""Grid points a cycle of the highest order, among which an extreme is sought."""


def waveform(lines: Sequence[OrderLine], theta_rad: Array) -> Array:
    """Sum of the orders at given angles.

    Parameters
    ----------
    lines
        The orders.
    theta_rad
        Shaft angle [n, rad].

    Returns
    -------
    array [n]
        Σ Re(c_k exp(j k θ)), without a mean, in the unit of the coefficients.

    """
    wave = np.zeros(theta_rad.size)
    for line in lines:
        wave += np.real(line.coefficient * np.exp(1j * line.order * theta_rad))
    return wave


def half_peak_to_peak(lines: Sequence[OrderLine]) -> tuple[float, float]:
    """Half the peak-to-peak of the sum of the orders, and its standard uncertainty.

    Parameters
    ----------
    lines
        The orders, one or more.

    Returns
    -------
    value, u
        In the unit of the coefficients.

    Raises
    ------
    ValueError
        There is no order.

    Notes
    -----
    u² = Σ u_k² |exp(j k θ_max) − exp(j k θ_min)|²/4, to first order. The extremes are the largest
    and the smallest point of a grid of `GRID_A_CYCLE` points a cycle of the highest order, moved to
    where the slope is zero by Newton's method.

    Examples
    --------
    >>> line = OrderLine(12, 0.03 + 0.04j, 0.001, 10.0, 0.0)
    >>> [round(number, 6) for number in half_peak_to_peak([line])]
    [0.05, 0.001]

    """
    if not lines:
        raise ValueError("no order, no peak")
    orders = [line.order for line in lines]
    period = TURN_RAD / np.gcd.reduce(orders)
    cells = max(1024, GRID_A_CYCLE * max(orders) // int(np.gcd.reduce(orders)))
    theta = np.arange(cells) * (period / cells)
    wave = waveform(lines, theta)
    top, bottom = (
        _extreme(lines, float(theta[index]), period / cells)
        for index in (int(np.argmax(wave)), int(np.argmin(wave)))
    )
    variance = sum(
        line.u**2 * abs(np.exp(1j * line.order * top) - np.exp(1j * line.order * bottom)) ** 2 / 4
        for line in lines
    )
    high, low = waveform(lines, np.array([top, bottom]))
    return float(high - low) / 2.0, float(np.sqrt(variance))


def _extreme(lines: Sequence[OrderLine], theta_rad: float, cell_rad: float) -> float:
    """The angle of zero slope within a cell of `theta_rad`, by Newton's method."""
    start = theta_rad
    for _ in range(8):
        turning = [line.coefficient * np.exp(1j * line.order * theta_rad) for line in lines]
        slope = -sum(line.order * value.imag for line, value in zip(lines, turning, strict=True))
        bend = -sum(line.order**2 * value.real for line, value in zip(lines, turning, strict=True))
        if bend == 0.0:
            break
        theta_rad = float(np.clip(theta_rad - slope / bend, start - cell_rad, start + cell_rad))
    return theta_rad
