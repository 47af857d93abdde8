"""Harmonics of a quantity against shaft angle: which orders a turn are there, and how surely.

Every turn of every pass is a replicate. What repeats from turn to turn is signal, what differs is
noise; the noise spectrum is averaged over neighbouring orders only, so coloured (autocorrelated)
noise is judged at its own order. The test of each order is corrected for the number of orders
looked at, and an order is kept only if it also predicts turns it was not fitted to.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]

TURN_RAD = 2.0 * np.pi
NEIGHBOURS = 10
WHOLE_TURN = 0.98


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
    """The highest order that the sampling of every turn resolves with eight positions a cycle."""
    counts = [np.unique(turn.theta_rad).size for turn in turns]
    return int(min(ceiling, min(counts) // 8))


def spectrum(turns: Sequence[Turn], highest: int) -> Spectrum:
    """Fourier coefficients of each turn for orders 1..`highest`.

    Samples are averaged in equal angle bins (at least four a cycle of the highest order; empty
    ones are bridged linearly), each bin standing at its mean angle; averaging over a bin of width
    w damps order k by sinc(k w / 2), which is undone.
    """
    bins = int(2 ** np.ceil(np.log2(4 * max(highest, 4))))
    rows, means = [], []
    for turn in turns:
        profile = _binned(turn, bins)
        transform = np.fft.rfft(profile) / bins
        rows.append(2.0 * transform[1 : highest + 1])
        means.append(float(transform[0].real))
    orders = np.arange(1, highest + 1)
    damping = np.sinc(orders / bins)
    shift = np.exp(-1j * orders * np.pi / bins)
    coefficients = np.array(rows) * (shift / damping)
    senses = np.array([turn.sense for turn in turns], dtype=np.int64)
    return Spectrum(orders.astype(np.int64), coefficients, np.array(means), senses)


def _binned(turn: Turn, bins: int) -> Array:
    position = np.mod(turn.theta_rad, TURN_RAD) * (bins / TURN_RAD)
    index = np.minimum(position.astype(np.int64), bins - 1)
    count = np.bincount(index, minlength=bins)
    total = np.bincount(index, weights=turn.value, minlength=bins)
    filled = np.flatnonzero(count)
    grid = np.arange(bins, dtype=np.float64)
    means = total[filled] / count[filled]
    profile: Array = np.interp(grid, filled.astype(np.float64), means, period=float(bins))
    return profile


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


def waveform(lines: Sequence[OrderLine], theta_rad: Array) -> Array:
    """Sum of the orders at the angles [n, rad]."""
    out = np.zeros(theta_rad.size)
    for line in lines:
        out += np.real(line.coefficient * np.exp(1j * line.order * theta_rad))
    return out


def half_peak_to_peak(lines: Sequence[OrderLine], points: int = 20_000) -> tuple[float, float]:
    """Half the peak-to-peak of the sum of the orders, and its standard uncertainty.

    u² = sum_k u_k² |exp(j k theta_max) - exp(j k theta_min)|² / 4, first order.
    """
    theta = np.linspace(0.0, TURN_RAD, points, endpoint=False)
    wave = waveform(lines, theta)
    top, bottom = theta[int(np.argmax(wave))], theta[int(np.argmin(wave))]
    variance = sum(
        line.u**2 * abs(np.exp(1j * line.order * top) - np.exp(1j * line.order * bottom)) ** 2 / 4
        for line in lines
    )
    return float(np.ptp(wave)) / 2.0, float(np.sqrt(variance))


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
