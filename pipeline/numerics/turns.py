"""Whole turns of a shaft in a record, and how densely they are sampled.

Their Fourier coefficients over the angle have a noise of their own: its spectrum is averaged over
neighbouring orders only, so coloured (autocorrelated) noise is judged at its own order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import Array
from pipeline.physics.units import TURN_RAD

WHOLE_TURN = 0.98
"""Least part of a turn that counts as one at the end of a pass [1]."""
PLACES = 2**15
"""Places a turn at which angles are told apart: thirty-two an order of the highest that is asked
for.
"""


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn of one pass: angle [n, rad], value [n], sense of rotation (+1 or -1)."""

    theta_rad: Array
    value: Array
    sense: int


def passes(theta_rad: Array, back_rad: float = 0.2) -> list[tuple[slice, int]]:
    """Stretches of a record in which the shaft keeps one sense of rotation.

    Parameters
    ----------
    theta_rad
        Unwrapped shaft angle [n, rad], finite.
    back_rad
        By how much the angle falls back from its extreme at a turning point [rad], so that noise
        and vibration make none.

    Returns
    -------
    list of (slice, sense)
        Rows, and +1 or -1, in order of time; empty where the angle never moves by `back_rad`.

    Notes
    -----
    Of a long record every k-th row is used, 20,000 to 40,000 of them.

    """
    stretches: list[tuple[slice, int]] = []
    start, extreme, sense = 0, 0, 0
    step = max(1, theta_rad.size // 20_000)
    for i in range(0, theta_rad.size, step):
        moved = theta_rad[i] - theta_rad[extreme]
        if sense == 0:
            if abs(theta_rad[i] - theta_rad[start]) > back_rad:
                sense = 1 if theta_rad[i] > theta_rad[start] else -1
                extreme = i
        elif moved * sense >= 0:
            extreme = i
        elif abs(moved) > back_rad:
            stretches.append((slice(start, extreme + 1), sense))
            start, extreme, sense = extreme + 1, i, -sense
    if sense != 0:
        stretches.append((slice(start, theta_rad.size), sense))
    return stretches


def whole_turns(theta_rad: Array, value: Array) -> list[Turn]:
    """The whole turns of every pass; what is left of a pass is left out.

    Parameters
    ----------
    theta_rad
        Unwrapped shaft angle [n, rad].
    value
        What is measured over the angle [n, any unit]; rows that are not finite are left out.

    Returns
    -------
    list of Turn
        In order of time. The last turn of a pass may lack up to 1 - `WHOLE_TURN` of a turn.

    """
    turns = []
    finite = np.isfinite(theta_rad) & np.isfinite(value)
    theta_rad, value = theta_rad[finite], value[finite]
    for rows, sense in passes(theta_rad):
        angle, y = theta_rad[rows], value[rows]
        if angle.size < 16:
            continue
        travelled = (angle - angle[0]) * sense / TURN_RAD
        count = int(np.floor(travelled.max() + 1.0 - WHOLE_TURN))
        for j in range(count):
            of_turn = (travelled >= j) & (travelled < j + 1)
            turns.append(Turn(angle[of_turn], y[of_turn], sense))
    return turns


def largest_order(turns: Sequence[Turn], ceiling: int) -> int:
    """The highest order that every turn samples with more than two positions a cycle.

    Parameters
    ----------
    turns
        Turns of the shaft.
    ceiling
        Highest order wanted [1/turn].

    Returns
    -------
    int
        Order [1/turn], at most `ceiling`; 0 without a turn.

    """
    counts = [np.unique(turn.theta_rad).size for turn in turns]
    return int(max(0, min(ceiling, (min(counts, default=0) - 1) // 2)))


def even_positions(turns: Sequence[Turn]) -> int | None:
    r"""How many evenly spaced positions every turn was sampled at.

    Parameters
    ----------
    turns
        Turns of the shaft, one or more.

    Returns
    -------
    int or None
        Positions a turn; None where they are uneven or differ from turn to turn.

    Notes
    -----
    On n even positions the orders k, n − k, n + k, ... are the same numbers and cannot be
    separated. n is the lowest order of the angles themselves: \|mean of exp(j n θ)\| is 1 on even
    positions, 2/π where an encoder rounds them to half of their spacing (the mean resultant length
    of directional statistics), and that of chance where they are uneven. Positions that are
    missing, or visited often, leave it.

    References
    ----------
    Mardia and Jupp, Directional Statistics, Wiley, 2000, 2.3.

    """
    counts = set()
    for turn in turns:
        places = np.mod(turn.theta_rad, TURN_RAD) * (PLACES / TURN_RAD)
        held = np.bincount(places.astype(np.int64) % PLACES, minlength=PLACES)
        length = np.abs(np.fft.rfft(held)) / turn.theta_rad.size
        even = np.flatnonzero(length[1:] >= 2.0 / np.pi)
        if even.size == 0:
            return None
        counts.add(int(even[0]) + 1)
    return counts.pop() if len(counts) == 1 else None


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
