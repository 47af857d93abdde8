"""Harmonics of a quantity against shaft angle: which orders a turn are there, and how surely.

Every turn of every pass is a replicate. What repeats from turn to turn is signal, what differs is
noise; the noise spectrum is averaged over neighbouring orders only, so coloured (autocorrelated)
noise is judged at its own order. The test of each order is corrected for the number of orders
looked at, and an order is kept only if it also predicts turns it was not fitted to. Orders are
taken off the data one by one, strongest first, so that none is a ghost of a stronger one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.harmonics import harmonic_design
from pipeline.numerics.least_squares import linear_fit

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

TURN_RAD = 2.0 * np.pi
NEIGHBOURS = 10
DENSE = 64
MOST_LINES = 40
ALIKE = 0.3
WHOLE_TURN = 0.98
GRID_A_CYCLE = 32


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn of one pass: angle [n, rad], value [n], sense of rotation (+1 or -1)."""

    theta_rad: Array
    value: Array
    sense: int


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


@dataclass(frozen=True, slots=True)
class OrderLine:
    """One order that is really there: amplitude, its uncertainty and the corrected p-value."""

    order: int
    coefficient: complex
    u: float
    dof: float
    p_value: float

    @property
    def amplitude(self) -> float:
        """Modulus of the coefficient."""
        return abs(self.coefficient)


def passes(theta_rad: Array, back_rad: float = 0.2) -> list[tuple[slice, int]]:
    """Stretches of one sense of rotation as (slice, +1 or -1).

    A turning point is where the angle [n, rad] falls back by more than `back_rad` from its
    extreme, so noise and vibration make none.
    """
    found: list[tuple[slice, int]] = []
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
            found.append((slice(start, extreme + 1), sense))
            start, extreme, sense = extreme + 1, i, -sense
    if sense != 0:
        found.append((slice(start, theta_rad.size), sense))
    return found


def whole_turns(theta_rad: Array, value: Array) -> list[Turn]:
    """The whole turns of every pass over angle [n, rad] and value [n]; the rest is left out."""
    turns = []
    for rows, sense in passes(theta_rad):
        angle, y = theta_rad[rows], value[rows]
        fine = np.isfinite(angle) & np.isfinite(y)
        angle, y = angle[fine], y[fine]
        if angle.size < 16:
            continue
        travelled = (angle - angle[0]) * sense / TURN_RAD
        count = int(np.floor(travelled.max() + 1.0 - WHOLE_TURN))
        for j in range(count):
            of_turn = (travelled >= j) & (travelled < j + 1)
            turns.append(Turn(angle[of_turn], y[of_turn], sense))
    return turns


def largest_order(turns: Sequence[Turn], ceiling: int) -> int:
    """The highest order that every turn samples with more than two positions a cycle."""
    counts = [np.unique(turn.theta_rad).size for turn in turns]
    return int(max(0, min(ceiling, (min(counts, default=0) - 1) // 2)))


def even_positions(turns: Sequence[Turn]) -> int | None:
    """How many evenly spaced positions every turn was sampled at; None where they are uneven.

    On n even positions the orders k, n - k, n + k, ... cannot be separated.
    """
    counts = set()
    for turn in turns:
        angle = np.unique(np.mod(turn.theta_rad, TURN_RAD))
        gaps = np.diff(np.append(angle, angle[0] + TURN_RAD))
        step = float(np.median(gaps[gaps > 0.3 * float(np.max(gaps))]))
        regular = np.abs(gaps - step) < 0.05 * step
        if np.count_nonzero(regular) < 0.95 * TURN_RAD / step:
            return None
        counts.add(round(TURN_RAD / step))
    return counts.pop() if len(counts) == 1 else None


def spectrum(turns: Sequence[Turn], highest: int) -> Spectrum:
    """Fourier coefficients of each turn for orders 1..`highest`.

    c_k = 2/2pi sum_i w_i y_i exp(-j k theta_i) with the trapezoidal rule's weights w_i, by fast
    transforms on a fine grid whose rounding of the angle is undone to third order. Samples far
    denser than needed are averaged first, which keeps all weights alike.
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
    """Means of value exp(-j k angle) over a turn for k = 0..highest."""
    after = np.diff(np.append(angle, angle[0] + TURN_RAD))
    weighted = value * (after + np.roll(after, 1)) / (2.0 * TURN_RAD)
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
    return total


def noise_power(spec: Spectrum) -> tuple[Array, Array, float]:
    """E|noise|² of one turn's coefficient: local mean [k], own order [k], dof of the local mean.

    From the deviations of the turns from their mean (needs two turns or more), averaged over
    `NEIGHBOURS` orders either side.
    """
    deviation = spec.coefficients - spec.coefficients.mean(axis=0)
    own = np.sum(np.abs(deviation) ** 2, axis=0) / (spec.turns - 1)
    reach = min(NEIGHBOURS, max(0, (spec.orders.size - 1) // 2))
    kernel = np.ones(2 * reach + 1)
    weight = np.convolve(np.ones(own.size), kernel, mode="same")
    local = np.convolve(own, kernel, mode="same") / weight
    dof = 2.0 * (spec.turns - 1) * float(weight.min())
    return local, own, dof


def held_out_gain(spec: Spectrum) -> Array:
    """Share [k] of turns whose own power falls when the mean of the *other* turns is taken off."""
    total = spec.coefficients.sum(axis=0)
    others = (total - spec.coefficients) / (spec.turns - 1)
    gain = np.abs(spec.coefficients) ** 2 - np.abs(spec.coefficients - others) ** 2
    share: Array = np.mean(gain > 0.0, axis=0)
    return share


def orders_present(spec: Spectrum, level: float = 0.01, share: float = 0.75) -> list[OrderLine]:
    """The orders whose mean coefficient is not noise, strongest first.

    Three tests: F = r |mean|² / local noise with (2, dof) degrees of freedom, Bonferroni-corrected
    to `level` over all orders; the same against the scatter of this very order, at 0.05 (drops
    what changes with the sense of rotation); a held-out gain in at least `share` of the turns.
    `u` is from the local noise, or from the order's own scatter where that is larger (p < 0.01).
    Needs two turns or more. Reference: Brillinger, Time Series (2001), section 5.6 (local
    averages of the periodogram).
    """
    from scipy.special import fdtrc

    local, own, dof_local = noise_power(spec)
    dof_own = 2.0 * (spec.turns - 1)
    excess = fdtrc(dof_own, dof_local, own / np.maximum(local, np.finfo(float).tiny)) < 0.01
    power = np.where(excess, own, local)
    dof = np.where(excess, dof_own, dof_local)
    mean = spec.coefficients.mean(axis=0)
    signal = spec.turns * np.abs(mean) ** 2
    tiny = np.finfo(float).tiny
    p_value = np.minimum(
        1.0, fdtrc(2.0, dof_local, signal / np.maximum(local, tiny)) * spec.orders.size
    )
    repeats = fdtrc(2.0, dof_own, signal / np.maximum(own, tiny)) < 0.05
    there = (p_value < level) & repeats & (held_out_gain(spec) >= share)
    u = np.sqrt(power / (2.0 * spec.turns))
    lines = [
        OrderLine(
            int(spec.orders[k]), complex(mean[k]), float(u[k]), float(dof[k]), float(p_value[k])
        )
        for k in np.flatnonzero(there)
    ]
    return sorted(lines, key=lambda line: (-line.amplitude, line.order))


def find_orders(
    turns: Sequence[Turn], highest: int, level: float = 0.01
) -> tuple[Spectrum, list[OrderLine]]:
    """Spectrum of the turns and the orders present, strongest first.

    The strongest order present joins (with others nearly as strong), all orders found are fitted
    to each turn together by least squares and taken off, and the rest is looked at again until
    nothing is left (or `MOST_LINES` are found). Published is the mean of an order's fits over the
    turns, with the uncertainty of `orders_present`. Reference: Högbom, Astron. Astrophys. Suppl.
    15, 1974 (CLEAN).
    """
    whole = rest = spectrum(turns, highest)
    orders: list[int] = []
    fits = np.zeros((len(turns), 0), dtype=np.complex128)
    while len(orders) < MOST_LINES:
        new = [line for line in orders_present(rest, level) if line.order not in orders]
        if not new:
            break
        orders += [line.order for line in new if line.amplitude > ALIKE * new[0].amplitude]
        fitted = [_fit_orders(turn, orders) for turn in turns]
        fits = np.array([coefficients for coefficients, _ in fitted])
        rest = spectrum([left for _, left in fitted], highest)
    back = rest.coefficients.copy()
    for column, order in enumerate(orders):
        back[:, order - 1] += fits[:, column]
    cleaned = Spectrum(whole.orders, back, whole.means, whole.senses)
    present = {line.order: line for line in orders_present(cleaned, level)}
    lines = [present[order] for order in orders if order in present]
    return cleaned, sorted(lines, key=lambda line: (-line.amplitude, line.order))


def _fit_orders(turn: Turn, orders: Sequence[int]) -> tuple[ComplexArray, Turn]:
    """Coefficients of the orders in one turn by least squares, and the turn without them."""
    design = harmonic_design(turn.theta_rad, list(orders))
    found = linear_fit(design, turn.value)
    mean = float(found.coefficients[0])
    left = Turn(turn.theta_rad, found.residuals + mean, turn.sense)
    coefficients: ComplexArray = found.coefficients[1::2] - 1j * found.coefficients[2::2]
    return coefficients, left


def waveform(lines: Sequence[OrderLine], theta_rad: Array) -> Array:
    """Sum of the orders at the angles [n, rad]."""
    out = np.zeros(theta_rad.size)
    for line in lines:
        out += np.real(line.coefficient * np.exp(1j * line.order * theta_rad))
    return out


def half_peak_to_peak(lines: Sequence[OrderLine]) -> tuple[float, float]:
    """Half the peak-to-peak of the sum of the orders, and its standard uncertainty.

    The grid follows the highest order over the common period of all, and Newton's method takes
    both extremes from it to where the slope is zero. u² = sum_k u_k² |exp(j k theta_max) -
    exp(j k theta_min)|² / 4, first order. Raises ValueError without an order.
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


def phase_modulated(lines: Sequence[OrderLine], order: int) -> list[OrderLine]:
    """The sidebands order±n (n = 1..3) that an eccentric encoder makes of one order.

    A once-a-turn angle error turns A sin(k theta) into a phase-modulated wave of the same power,
    whose first sidebands obey c[k+1]/c[k] = -conj(c[k-1]/c[k]); true sidebands of a modulated
    amplitude carry the other sign. Empty where that does not hold to a tenth and three u.
    Reference: Carson, Proc. IRE 10(1), 1922.
    """
    by_order = {line.order: line for line in lines}
    if not all(k in by_order for k in (order - 1, order, order + 1)):
        return []
    centre = by_order[order].coefficient
    upper = by_order[order + 1].coefficient / centre
    lower = by_order[order - 1].coefficient / centre
    noise = 3.0 * float(np.hypot(by_order[order + 1].u, by_order[order - 1].u)) / abs(centre)
    if abs(upper + np.conj(lower)) > noise + 0.1 * abs(upper):
        return []
    sides = [by_order.get(order + n) for n in (-3, -2, -1, 1, 2, 3)]
    return [side for side in sides if side is not None]


def detection_limit(spec: Spectrum, level: float = 0.01, power: float = 0.95) -> float:
    """The amplitude that would be found with probability `power` at every order tested.

    Approximation: threshold amplitude plus the normal quantile of its scatter, at the noisiest
    order.
    """
    from scipy.special import fdtri, ndtri

    local, _, dof = noise_power(spec)
    noise = float(np.max(local)) / spec.turns
    threshold = fdtri(2.0, dof, 1.0 - level / spec.orders.size)
    return float(np.sqrt(noise * threshold) + ndtri(power) * np.sqrt(noise / 2.0))
