"""Fourier coefficients over the shaft angle, turn by turn, and their noise.

The noise spectrum is averaged over neighbouring orders only, so coloured (autocorrelated) noise is
judged at its own order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import Array
from pipeline.numerics.turns import Turn
from pipeline.physics.units import TURN_RAD

ComplexArray = NDArray[np.complex128]

NEIGHBOURS = 10
"""Orders on either side whose noise is averaged."""
DENSE = 64
"""Samples an order beyond which they are averaged in bins."""


@dataclass(frozen=True, slots=True)
class Spectrum:
    """Fourier coefficients of each turn: value = mean + Re(sum_k c_k exp(j k theta)).

    `orders` [k], `coefficients` [r, k], `means` [r], `senses` [r].
    """

    orders: NDArray[np.int64]
    coefficients: ComplexArray
    means: Array
    senses: NDArray[np.int64]

    @property
    def turns(self) -> int:
        """Number of replicates r."""
        return int(self.means.size)


def spectrum(turns: Sequence[Turn], highest: int) -> Spectrum:
    """Fourier coefficients of each turn over the shaft angle.

    Parameters
    ----------
    turns
        Turns of the shaft.
    highest
        Highest order [1/turn].

    Returns
    -------
    Spectrum
        Orders 1 to `highest`, in the unit of the turns' values.

    Notes
    -----
    c_k = 2 Σ_i w_i y_i exp(−j k θ_i), with weights w_i of the trapezoidal rule, Σ w_i = 1. The sums
    are fast transforms on a fine grid; that an angle is rounded to the grid is undone to third
    order of its Taylor series. Samples more than `DENSE` an order are averaged in bins first, which
    keeps the weights alike.

    """
    rows, means = [], []
    for turn in turns:
        transform = _transform(*_points(turn, highest), highest)
        rows.append(2.0 * transform[1:])
        means.append(float(transform[0].real))
    orders = np.arange(1, highest + 1, dtype=np.int64)
    senses = np.array([turn.sense for turn in turns], dtype=np.int64)
    return Spectrum(orders, np.array(rows), np.array(means), senses)


def _points(turn: Turn, highest: int) -> tuple[Array, Array]:
    """Distinct angles [m, rad] in one turn, ascending, and the mean value at each."""
    angle = np.mod(turn.theta_rad, TURN_RAD)
    if angle.size > DENSE * highest:
        bins = 2 ** int(np.log2(angle.size / 8))
        index = np.minimum((angle * (bins / TURN_RAD)).astype(np.int64), bins - 1)
    else:
        index = np.unique(angle, return_inverse=True)[1]
    count = np.bincount(index)
    filled = np.flatnonzero(count)
    where = np.bincount(index, weights=angle)[filled] / count[filled]
    value = np.bincount(index, weights=turn.value)[filled] / count[filled]
    return where, value


def _transform(angle: Array, value: Array, highest: int) -> ComplexArray:
    """Means of value exp(-j k angle) over a turn for k = 0..highest.

    The mean is taken off first: angles that are rounded beat with the rows, and what the weights
    leave of a constant at an order grows with it.
    """
    after = np.diff(np.append(angle, angle[0] + TURN_RAD))
    weight = (after + np.roll(after, 1)) / (2.0 * TURN_RAD)
    mean = float(weight @ value)
    weighted = weight * (value - mean)
    cells = int(2 ** np.ceil(np.log2(16 * max(highest, 4))))
    nearest = np.round(angle * (cells / TURN_RAD))
    off: Array = angle - nearest * (TURN_RAD / cells)
    index = nearest.astype(np.int64) % cells
    orders = np.arange(highest + 1)
    total: ComplexArray = np.zeros(highest + 1, dtype=np.complex128)
    factor: ComplexArray = np.ones(highest + 1, dtype=np.complex128)
    for power in range(4):
        moment = np.bincount(index, weights=weighted * off**power, minlength=cells)
        total += factor * np.fft.rfft(moment)[: highest + 1]
        factor = np.asarray(factor * (-1j * orders) / (power + 1.0), dtype=np.complex128)
    total[0] += mean
    return total


def noise_power(spec: Spectrum) -> tuple[Array, Array, float]:
    """Mean square of the noise in one turn's coefficients, from how the turns differ.

    Parameters
    ----------
    spec
        Coefficients of two turns or more.

    Returns
    -------
    local [k]
        E|noise|² [unit²], averaged over `NEIGHBOURS` orders either side.
    own [k]
        The same of each order alone [unit²], with 2 (turns − 1) degrees of freedom.
    dof
        Degrees of freedom of `local`, where the fewest orders were averaged.

    """
    deviation = spec.coefficients - spec.coefficients.mean(axis=0)
    by_turn = np.sum(np.abs(deviation) ** 2, axis=0) / (spec.turns - 1)
    reach = min(NEIGHBOURS, max(0, (spec.orders.size - 1) // 2))
    kernel = np.ones(2 * reach + 1)
    weight = np.convolve(np.ones(by_turn.size), kernel, mode="same")
    local = np.convolve(by_turn, kernel, mode="same") / weight
    dof = 2.0 * (spec.turns - 1) * float(weight.min())
    return local, by_turn, dof


def held_out_gain(spec: Spectrum) -> Array:
    """Share of the turns whose own power falls when the mean of the other turns is taken off.

    Parameters
    ----------
    spec
        Coefficients of two turns or more.

    Returns
    -------
    array [k]
        0 to 1, each order; 0.5 or so is chance where the noise is strong.

    """
    total = spec.coefficients.sum(axis=0)
    others = (total - spec.coefficients) / (spec.turns - 1)
    gain = np.abs(spec.coefficients) ** 2 - np.abs(spec.coefficients - others) ** 2
    return np.mean(gain > 0.0, axis=0)
