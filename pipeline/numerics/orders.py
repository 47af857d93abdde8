"""Harmonics of a quantity against shaft angle: which orders a turn are there, with what confidence.

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
from pipeline.numerics.least_squares import Array, linear_fit
from pipeline.physics.units import TURN_RAD

ComplexArray = NDArray[np.complex128]

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
    Of a long record every k-th row is looked at, 20,000 to 40,000 of them.

    """
    senses: list[tuple[slice, int]] = []
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
            senses.append((slice(start, extreme + 1), sense))
            start, extreme, sense = extreme + 1, i, -sense
    if sense != 0:
        senses.append((slice(start, theta_rad.size), sense))
    return senses


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
    fine = np.isfinite(theta_rad) & np.isfinite(value)
    theta_rad, value = theta_rad[fine], value[fine]
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
    """How many evenly spaced positions every turn was sampled at.

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
    separated.

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


def orders_present(spec: Spectrum, level: float = 0.01, share: float = 0.75) -> list[OrderLine]:
    """The orders whose mean coefficient is not noise, strongest first.

    Parameters
    ----------
    spec
        Coefficients of two turns or more.
    level
        Chance that any order at all is found in noise [1].
    share
        Least share of the turns that the others' mean has to predict [1].

    Returns
    -------
    list of OrderLine
        `u` is the standard uncertainty of the amplitude from the local noise, or from the order's
        own scatter where that is larger (p < 0.01).

    Notes
    -----
    An order has to pass three tests:

    1. F = r |mean|²/local noise with (2, dof) degrees of freedom, for r turns, at `level` over the
       number of orders (Bonferroni).
    2. The same against the scatter of this very order, at 0.05. It drops what changes with the
    sense
       of rotation.
    3. `held_out_gain` of at least `share`.

    References
    ----------
    Brillinger, Time Series: Data Analysis and Theory, SIAM, 2001, section 5.6 (local averages of
    the
    periodogram), doi:10.1137/1.9780898719246.

    """
    from scipy.special import fdtrc

    local, by_turn, dof_local = noise_power(spec)
    dof_own = 2.0 * (spec.turns - 1)
    excess = fdtrc(dof_own, dof_local, by_turn / np.maximum(local, np.finfo(float).tiny)) < 0.01
    power = np.where(excess, by_turn, local)
    dof = np.where(excess, dof_own, dof_local)
    mean = spec.coefficients.mean(axis=0)
    signal = spec.turns * np.abs(mean) ** 2
    tiny = np.finfo(float).tiny
    p_value = np.minimum(
        1.0, fdtrc(2.0, dof_local, signal / np.maximum(local, tiny)) * spec.orders.size
    )
    repeats = fdtrc(2.0, dof_own, signal / np.maximum(by_turn, tiny)) < 0.05
    present = (p_value < level) & repeats & (held_out_gain(spec) >= share)
    u = np.sqrt(power / (2.0 * spec.turns))
    lines = [
        OrderLine(
            int(spec.orders[k]), complex(mean[k]), float(u[k]), float(dof[k]), float(p_value[k])
        )
        for k in np.flatnonzero(present)
    ]
    return sorted(lines, key=lambda line: (-line.amplitude, line.order))


def find_orders(
    turns: Sequence[Turn], highest: int, level: float = 0.01
) -> tuple[Spectrum, list[OrderLine]]:
    """The orders present over the shaft angle, none of them the ghost of a stronger one.

    Parameters
    ----------
    turns
        Two turns or more.
    highest
        Highest order looked at [1/turn].
    level
        Chance that any order at all is found in noise [1].

    Returns
    -------
    spectrum
        Coefficients of each turn: those of the orders found by least squares, all others of the
        rest.
    lines
        The orders present, strongest first: means over the turns, with the uncertainty of
        `orders_present`.

    Notes
    -----
    The strongest order present joins, with those of at least `ALIKE` of its amplitude. All orders
    found so far are fitted to each turn together by least squares and taken off, and the rest is
    looked at again, until nothing is left or `MOST_LINES` are found.

    References
    ----------
    Högbom, Astron. Astrophys. Suppl. 15, 1974, 417 (CLEAN).

    """
    whole = remaining = spectrum(turns, highest)
    orders: list[int] = []
    fits = np.zeros((len(turns), 0), dtype=np.complex128)
    while len(orders) < MOST_LINES:
        new = [line for line in orders_present(remaining, level) if line.order not in orders]
        if not new:
            break
        orders += [line.order for line in new if line.amplitude > ALIKE * new[0].amplitude]
        fitted = [_fit_orders(turn, orders) for turn in turns]
        fits = np.array([coefficients for coefficients, _ in fitted])
        remaining = spectrum([residual for _, residual in fitted], highest)
    back = remaining.coefficients.copy()
    for column, order in enumerate(orders):
        back[:, order - 1] += fits[:, column]
    cleaned = Spectrum(whole.orders, back, whole.means, whole.senses)
    present = {line.order: line for line in orders_present(cleaned, level)}
    lines = [present[order] for order in orders if order in present]
    return cleaned, sorted(lines, key=lambda line: (-line.amplitude, line.order))


def _fit_orders(turn: Turn, orders: Sequence[int]) -> tuple[ComplexArray, Turn]:
    """Coefficients of the orders in one turn by least squares, and the turn without them."""
    design = harmonic_design(turn.theta_rad, list(orders))
    fit = linear_fit(design, turn.value)
    mean = float(fit.coefficients[0])
    residual = Turn(turn.theta_rad, fit.residuals + mean, turn.sense)
    coefficients: ComplexArray = fit.coefficients[1::2] - 1j * fit.coefficients[2::2]
    return coefficients, residual


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


def phase_modulated(lines: Sequence[OrderLine], order: int) -> list[OrderLine]:
    """The sidebands of an order that an eccentric encoder makes, and not the motor.

    Parameters
    ----------
    lines
        All orders found.
    order
        The order whose sidebands are in question [1/turn]; it need not be among the lines.

    Returns
    -------
    list of OrderLine
        Those of order ± 1, 2, 3 that were found; empty where the two first ones are not both there,
        or do not obey the relation below to a tenth and three standard uncertainties.

    Notes
    -----
    An angle error once a turn makes A sin(kθ) a phase-modulated wave, whose first sidebands obey
    c[k+1]/c[k] = −conj(c[k−1]/c[k]). Sidebands of a modulated amplitude carry the other sign.

    References
    ----------
    Carson, Notes on the theory of modulation, Proc. IRE 10(1), 1922, 57.

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
    """The amplitude that would be found at whatever order it were.

    Parameters
    ----------
    spec
        Coefficients of two turns or more.
    level
        Chance that any order at all is found in noise [1].
    power
        Probability with which it would be found [1].

    Returns
    -------
    float
        Amplitude [unit of the coefficients].

    Notes
    -----
    √(N F) + z √(N/2): N the noise power of the mean at the noisiest order, F the threshold of the
    test, z the normal quantile of `power`. An approximation; the held-out test is not in it.

    """
    from scipy.special import fdtri, ndtri

    local, _, dof = noise_power(spec)
    noise = float(np.max(local)) / spec.turns
    threshold = fdtri(2.0, dof, 1.0 - level / spec.orders.size)
    return float(np.sqrt(noise * threshold) + ndtri(power) * np.sqrt(noise / 2.0))
