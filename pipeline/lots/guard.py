"""Decisions on a measured value against a tolerance, with a guard band, and their risks.

References: [1] JCGM 106:2012, 8.3 (guard bands) and 9.5 (global risks). [2] ILAC-G8:09/2019, 4.2
(binary and non-binary statements). [3] ISO/IEC 17025:2017, 7.8.6 (the rule is stated).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import cache

import numpy as np
from scipy.special import ndtr

from pipeline.records.capture import Array
from pipeline.records.lot_constant import Decision

NODES = 400
REACH_SD = 9.0


@dataclass(frozen=True, slots=True)
class Tolerance:
    """Limits of a constant.

    Attributes
    ----------
    lower, upper
        Tolerance limits [unit]; infinite on a side without one.
    guard_band
        w [unit]: the acceptance limits lie w inside the tolerance, outside for a negative w.

    """

    lower: float
    upper: float
    guard_band: float = 0.0

    @property
    def accept_lower(self) -> float:
        """Lower acceptance limit A = T + w [unit]."""
        return self.lower + self.guard_band

    @property
    def accept_upper(self) -> float:
        """Upper acceptance limit A = T − w [unit]."""
        return self.upper - self.guard_band

    def decide(self, value: float) -> Decision:
        """The four-way statement on a value.

        Parameters
        ----------
        value
            Measured [unit].

        Returns
        -------
        Decision
            `pass` within the acceptance limits, `conditional_pass` between them and the tolerance,
            `conditional_fail` beyond the tolerance by no more than the guard band, else `fail`.

        References
        ----------
        ILAC-G8:09/2019, 4.2 (non-binary statements with guard band).

        Examples
        --------
        >>> [Tolerance(0.0, 10.0, 1.0).decide(x) for x in (5.0, 9.5, 10.5, 12.0)]
        ['pass', 'conditional_pass', 'conditional_fail', 'fail']

        """
        inside = min(value - self.lower, self.upper - value)
        if inside >= 0.0:
            return "pass" if inside >= self.guard_band else "conditional_pass"
        return "conditional_fail" if -inside <= self.guard_band else "fail"


@dataclass(frozen=True, slots=True)
class Risks:
    """Shares of all motors: accepted though outside the tolerance; rejected though inside."""

    false_accept: float
    false_reject: float


def risks(tolerance: Tolerance, mean: float, sd: float, u: float) -> Risks:
    """Global consumer's and producer's risk of accepting within the acceptance limits.

    Parameters
    ----------
    tolerance
        Limits and guard band [unit].
    mean, sd
        Of the motors' true values, Gaussian [unit].
    u
        Standard uncertainty of a measurement [unit].

    Returns
    -------
    Risks
        Shares of all motors [1].

    Raises
    ------
    ValueError
        `sd` or `u` is negative.

    Notes
    -----
    R_C = ∫ outside T of φ(η) P(accept | η) dη

    R_P = ∫ inside T of φ(η) (1 − P(accept | η)) dη, each by Gauss-Legendre rules of `NODES` points
    over the pieces between the limits, within `REACH_SD` standard deviations.

    References
    ----------
    JCGM 106:2012, 9.5.

    """
    if sd < 0.0 or u < 0.0:
        raise ValueError("standard deviations are not negative")
    if sd == 0.0:
        accept = float(_accepted(np.array([mean]), tolerance, u)[0])
        outside = not tolerance.lower <= mean <= tolerance.upper
        return Risks(accept, 0.0) if outside else Risks(0.0, 1.0 - accept)
    edges = (tolerance.lower, tolerance.upper, tolerance.accept_lower, tolerance.accept_upper)
    low, high = mean - REACH_SD * sd, mean + REACH_SD * sd
    cuts = sorted({low, high, *(min(max(edge, low), high) for edge in edges)})
    accept = reject = 0.0
    for start, end in itertools.pairwise(cuts):
        eta, weight = _nodes(start, end)
        density = np.exp(-0.5 * ((eta - mean) / sd) ** 2) / (sd * math.sqrt(2.0 * math.pi))
        taken = _accepted(eta, tolerance, u)
        middle = 0.5 * (start + end)
        if tolerance.lower <= middle <= tolerance.upper:
            reject += float(np.sum(weight * density * (1.0 - taken)))
        else:
            accept += float(np.sum(weight * density * taken))
    return Risks(accept, reject)


def _accepted(eta: Array, tolerance: Tolerance, u: float) -> Array:
    """Probability that a motor of true value eta [n, unit] is measured within A."""
    low, high = tolerance.accept_lower, tolerance.accept_upper
    if low > high:
        return np.zeros(eta.shape)
    if u == 0.0:
        return ((eta >= low) & (eta <= high)).astype(float)
    return ndtr((high - eta) / u) - ndtr((low - eta) / u)


def _nodes(start: float, end: float) -> tuple[Array, Array]:
    x, weight = _rule()
    half = 0.5 * (end - start)
    return start + half * (x + 1.0), half * weight


@cache
def _rule() -> tuple[Array, Array]:
    """Nodes and weights on [-1, 1]."""
    x, weight = np.polynomial.legendre.leggauss(NODES)
    return x, weight
