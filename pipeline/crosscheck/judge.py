"""How a measured ratio is judged: an allowance for the model, and both uncertainties.

A deviation passes up to `allowance + 2 u`, is marginal up to `allowance + 3 u` and fails beyond.
The allowance is what the comparison itself cannot promise (a small-signal inductance against a
step, say); u is the standard uncertainty of the ratio with shared gains cancelled. Where 2 u
exceeds `resolution` times the allowance a pass would mean nothing and the check is not evaluated.
"""

from __future__ import annotations

import math

from pipeline.physics.conventions import MOST_SUSPECTS, convention_suspect, conventions_hit
from pipeline.records.datasheet import Check, CheckStatus
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import Budget, propagate, standard_uncertainty

RESOLUTION = 5.0


def ratio_of(top: Estimate, bottom: Estimate) -> tuple[float, float]:
    """The ratio of two estimates and its standard uncertainty, correlations included."""
    ratio = top.number / bottom.number
    budget: Budget = propagate(
        [(1.0 / bottom.number, top.budget), (-ratio / bottom.number, bottom.budget)]
    )
    return ratio, standard_uncertainty(budget)


def judge_deviation(deviation: float, u: float, allowance: float) -> CheckStatus:
    """The status of a deviation from what is expected; all three in one unit."""
    if not (math.isfinite(deviation) and math.isfinite(u)):
        return "not_evaluated"
    if abs(deviation) > allowance + 3.0 * u:
        return "fail"
    if 2.0 * u > RESOLUTION * allowance:
        return "not_evaluated"
    return "pass" if abs(deviation) <= allowance + 2.0 * u else "marginal"


def judge_ratio(
    name: str,
    ratio: float,
    u: float,
    allowance: float,
    meaning: str,
    pole_pairs: int | None = None,
    otherwise: str | None = None,
) -> Check:
    """A check of a ratio that is 1 when all is well.

    `value` is the ratio, `limit` the largest deviation from 1 that passes. On anything but a
    pass, `suspect` names the convention whose number the ratio lands on, else `otherwise`; nothing
    where the ratio is so uncertain that it lands on many.
    """
    status = judge_deviation(ratio - 1.0, u, allowance)
    words = f"{meaning}; {ratio:.4f} ± {2.0 * u:.4f} (k=2), expected 1 within the limit"
    suspect = None
    if status == "not_evaluated":
        words += "; too uncertain to judge"
    elif status != "pass":
        vague = len(conventions_hit(ratio, u, pole_pairs)) > MOST_SUSPECTS
        suspect = None if vague else convention_suspect(ratio, u, pole_pairs) or otherwise
    return Check(name, status, words, ratio, allowance + 2.0 * u, "1", suspect)


def not_evaluated(name: str, missing: str) -> Check:
    """The check that could not be made, saying what is missing."""
    return Check(name, "not_evaluated", missing)
