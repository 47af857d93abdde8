"""Harmonics of a quantity against shaft angle: which orders a turn are there, with what confidence.

Every turn of every pass is a replicate. What repeats from turn to turn is signal, what differs is
noise (`turns`). The test of each order is corrected for the number of orders tested, and an
order is kept only if it also predicts turns it was not fitted to. Orders are taken off the data one
by one, strongest first, so that none is leakage of a stronger one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.harmonics import harmonic_design
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.turns import (
    ComplexArray,
    Spectrum,
    Turn,
    held_out_gain,
    noise_power,
    spectrum,
)

MOST_LINES = 40
"""Most orders that are found."""
ALIKE = 0.3
"""Least amplitude, of the strongest one's, of orders that join together with it [1]."""


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
       sense of rotation.
    3. `held_out_gain` of at least `share`.

    References
    ----------
    Brillinger, Time Series: Data Analysis and Theory, SIAM, 2001, section 5.6 (local averages of
    the periodogram), doi:10.1137/1.9780898719246.

    """
    from scipy.special import fdtrc

    local, by_turn, dof_local = noise_power(spec)
    dof_own = 2.0 * (spec.turns - 1)
    tiny = np.finfo(float).tiny
    floored = np.maximum(local, tiny)
    excess = fdtrc(dof_own, dof_local, by_turn / floored) < 0.01
    power = np.where(excess, by_turn, local)
    dof = np.where(excess, dof_own, dof_local)
    mean = spec.coefficients.mean(axis=0)
    signal = spec.turns * np.abs(mean) ** 2
    p_value = np.minimum(1.0, fdtrc(2.0, dof_local, signal / floored) * spec.orders.size)
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
    """The orders present over the shaft angle, none of them leakage of a stronger one.

    Parameters
    ----------
    turns
        Two turns or more.
    highest
        Highest order tested [1/turn].
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
    tested again, until nothing is left or `MOST_LINES` are found.

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
