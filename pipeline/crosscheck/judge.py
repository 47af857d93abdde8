"""How a measured ratio is judged: an allowance for the model, and both uncertainties.

A deviation passes up to `allowance + 2 u`, is marginal up to `allowance + 3 u` and fails beyond.
The allowance is the systematic error of the comparison itself (a small-signal inductance against a
step, say); u is the standard uncertainty of the ratio with shared gains cancelled. Where 2 u
exceeds `resolution` times the allowance a pass would mean nothing and the check is not evaluated.
A suspect is named only where the ratio's coverage interval holds its number: no allowance widens
that interval, for a number outside it is not what was measured.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from pipeline.physics.suspects import MOST_SUSPECTS, Quantity, convention_suspect, conventions_hit
from pipeline.records.datasheet import Check, CheckStatus
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import (
    METHODS,
    Budget,
    coverage_factor,
    effective_dof,
    propagate,
    standard_uncertainty,
    without_between,
)

RESOLUTION = 5.0


class Ratio(NamedTuple):
    """A ratio of two like quantities [1], its standard uncertainty and degrees of freedom."""

    value: float
    u: float
    dof: float = math.inf

    @classmethod
    def of(cls, value: float, budget: Budget) -> Ratio:
        """The ratio whose uncertainty is this budget [1].

        Parameters
        ----------
        value
            The ratio [1].
        budget
            Its contributions [1].

        """
        return cls(value, standard_uncertainty(budget), effective_dof(budget))


def ratio_of(top: Estimate, bottom: Estimate) -> Ratio:
    """The ratio of two estimates, with what they share taken into account.

    Parameters
    ----------
    top, bottom
        Estimates of like quantities; `bottom` is not zero.

    Returns
    -------
    Ratio
        What methods disagree by is left out of its uncertainty, for that is what is to be judged.

    Notes
    -----
    First order: u² = Σ_s (u_s,top/bottom − ratio u_s,bottom/bottom)² over the sources s of both
    budgets, in which a gain that both share cancels.

    References
    ----------
    JCGM 100:2008 (GUM), 5.2 (correlated input quantities).

    """
    ratio = top.number / bottom.number
    upper, lower = (without_between(e.budget, METHODS) for e in (top, bottom))
    terms = [(1.0 / bottom.number, upper), (-ratio / bottom.number, lower)]
    return Ratio.of(ratio, propagate(terms))


def judge_deviation(deviation: float, u: float, allowance: float) -> CheckStatus:
    """The status of a deviation from what is expected.

    Parameters
    ----------
    deviation
        Measured less expected [any unit].
    u
        Its standard uncertainty [same unit].
    allowance
        Systematic error of the comparison itself [same unit].

    Returns
    -------
    status
        `fail` beyond allowance + 3 u. Otherwise `not_evaluated` where 2 u exceeds `RESOLUTION`
        times the allowance, `pass` up to allowance + 2 u and `marginal` above. Also `not_evaluated`
        for numbers that are not finite.

    Examples
    --------
    >>> [judge_deviation(d, 0.01, 0.02) for d in (0.03, 0.045, 0.06)]
    ['pass', 'marginal', 'fail']
    >>> judge_deviation(0.0, 0.06, 0.02)
    'not_evaluated'

    """
    if not (math.isfinite(deviation) and math.isfinite(u)):
        return "not_evaluated"
    if abs(deviation) > allowance + 3.0 * u:
        return "fail"
    if 2.0 * u > RESOLUTION * allowance:
        return "not_evaluated"
    return "pass" if abs(deviation) <= allowance + 2.0 * u else "marginal"


def judge_ratio(
    name: str,
    ratio: Ratio,
    allowance: float,
    meaning: str,
    quantity: Quantity,
    pole_pairs: int | None = None,
    otherwise: str | None = None,
) -> Check:
    """A check of a ratio that is 1 when all is well.

    Parameters
    ----------
    name
        Of the check.
    ratio
        What was measured [1].
    allowance
        Systematic error of the comparison [1].
    meaning
        What the ratio is of, in words; the interval is appended, with its coverage factor.
    quantity
        What the ratio is of, for the conventions that can enter it.
    pole_pairs
        Of the machine, where counted.
    otherwise
        The suspect where no convention's number lies in the coverage interval.

    Returns
    -------
    Check
        `value` is the ratio, `limit` the largest deviation from 1 that passes. `suspect` is set
        where the check fails or is marginal; None where the ratio is so uncertain that it lands on
        many conventions.

    """
    value, u, dof = ratio
    status = judge_deviation(value - 1.0, u, allowance)
    k = coverage_factor(dof)
    words = (
        f"{meaning}; {value:.4f} ± {k * u:.4f} (k={k:.3g}), expected 1 ± {allowance + 2.0 * u:.2g}"
    )
    suspect = None
    if status == "not_evaluated":
        words += "; too uncertain to judge"
    elif status != "pass":
        vague = len(conventions_hit(value, k * u, quantity, pole_pairs)) > MOST_SUSPECTS
        named = convention_suspect(value, k * u, quantity, pole_pairs)
        suspect = None if vague else named or otherwise
    return Check(name, status, words, value, allowance + 2.0 * u, "1", suspect)


def not_evaluated(name: str, missing: str) -> Check:
    """The check that could not be made, saying what is missing.

    Parameters
    ----------
    name
        Name of the rule.
    missing
        What is missing, in words.

    """
    return Check(name, "not_evaluated", missing)
