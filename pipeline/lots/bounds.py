"""A constant's limits worked out in its unit, and every motor's value held against them."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import median

from pipeline.lots.guard import Risks, Tolerance, risks
from pipeline.lots.sample import Value
from pipeline.records.limits import RULES, ConstantLimits
from pipeline.records.lot_constant import Bounds, Conformity, Count, Decision

WORST: tuple[Decision, ...] = (
    "fail",
    "conditional_fail",
    "conditional_pass",
    "pass",
    "not_evaluated",
)


@dataclass(frozen=True, slots=True)
class Held:
    """A constant's limits in its unit, and what they say of each motor (by motor_id)."""

    bounds: Bounds | None
    margin: float | None
    decisions: Mapping[str, Decision]
    tolerance: Tolerance | None


def hold(
    limits: ConstantLimits,
    values: Sequence[Value],
    corrected: Mapping[str, float],
    baseline_mean: float | None,
    sd: float | None,
    k: float,
) -> Held:
    """Decides on every motor's value by the limits of a constant.

    Parameters
    ----------
    limits
        Of the constant, as in the limits file.
    values
        One a motor.
    corrected
        The same without their station's bias, by motor_id [unit].
    baseline_mean
        Mean of the baseline's lots [unit], the nominal where none is stated.
    sd
        Standard deviation of motors within a lot [unit], for limits that count in it.
    k
        Coverage factor of U = k u [1].

    Returns
    -------
    Held
        Without decisions where neither limit can be worked out, as without a nominal.

    Notes
    -----
    The guard band counts in the motor's own U where the limits file counts it in U.

    References
    ----------
    JCGM 106:2012, 8.3 (guard bands).

    """
    nominal = limits.nominal if limits.nominal is not None else baseline_mean
    typical_u = k * median(v.u for v in values) if values else None
    margin = _margin(limits, nominal, sd, typical_u)
    span = _span(limits, nominal, sd)
    if span is None:
        bare = Bounds(nominal, None, None, None, None, 0.0, RULES[limits.rule], margin)
        return Held(bare if margin is not None else None, margin, {}, None)
    low, high = span
    decisions = {
        v.motor_id: _decision(
            limits,
            Tolerance(low, high, _guard(limits, nominal, sd, k * v.u)),
            corrected[v.motor_id],
        )
        for v in values
    }
    band = _guard(limits, nominal, sd, typical_u or 0.0)
    tolerance = Tolerance(low, high, band)
    bounds = Bounds(
        nominal,
        _finite(low),
        _finite(high),
        _finite(tolerance.accept_lower),
        _finite(tolerance.accept_upper),
        band,
        RULES[limits.rule],
        margin,
    )
    return Held(bounds, margin, decisions, tolerance)


def conformity(
    held: Held,
    candidate: Sequence[Value],
    corrected: Mapping[str, float],
    mean: float,
    sd: float | None,
) -> Conformity:
    """The candidate's motors by decision, the worst first, and the rule's risks for such a lot.

    Parameters
    ----------
    held
        The limits and the decision on every motor.
    candidate
        Values of the candidate's motors.
    corrected
        Values without their station's bias, by motor_id [unit].
    mean
        Of the candidate's motors [unit].
    sd
        Standard deviation of the candidate's values [unit], that of measuring among it.

    Returns
    -------
    Conformity
        Without risks where a limit, `sd` or a motor is missing.

    """
    decided = [(held.decisions.get(v.motor_id, "not_evaluated"), v) for v in candidate]
    counts = tuple(
        Count(decision, number)
        for decision in WORST
        if (number := sum(1 for one, _ in decided if one == decision))
    )
    worst: Decision = counts[0].decision if counts else "not_evaluated"
    inside = {
        v.motor_id: _inside(held, corrected[v.motor_id]) for one, v in decided if one == worst
    }
    named = min(inside, key=lambda motor: (inside[motor], motor), default=None)
    risk: Risks | None = None
    if held.tolerance is not None and sd is not None and candidate:
        u = median(v.u for v in candidate)
        risk = risks(held.tolerance, mean, math.sqrt(max(sd**2 - u**2, 0.0)), u)
    return Conformity(
        counts,
        worst,
        None if worst in ("pass", "not_evaluated") else named,
        None if risk is None else risk.false_accept,
        None if risk is None else risk.false_reject,
    )


def _inside(held: Held, value: float) -> float:
    """How far a value lies within the tolerance [unit], negative outside."""
    if held.tolerance is None:
        return 0.0
    return min(value - held.tolerance.lower, held.tolerance.upper - value)


def _finite(value: float) -> float | None:
    return value if math.isfinite(value) else None


def _margin(
    limits: ConstantLimits, nominal: float | None, sd: float | None, expanded_u: float | None
) -> float | None:
    if nominal is None:
        return None
    sizes = [margin.in_unit(nominal, sd, expanded_u) for margin in limits.margins]
    return max((size for size in sizes if size), default=None)


def _span(
    limits: ConstantLimits, nominal: float | None, sd: float | None
) -> tuple[float, float] | None:
    """Lower and upper limit [unit], infinite where there is none; None without either."""
    low, high = -math.inf, math.inf
    if limits.tolerance is not None and nominal is not None:
        width = limits.tolerance.in_unit(nominal, sd, None)
        if width is not None:
            low, high = nominal - width, nominal + width
    low = low if limits.minimum is None else limits.minimum
    high = high if limits.maximum is None else limits.maximum
    return None if math.isinf(low) and math.isinf(high) else (low, high)


def _guard(
    limits: ConstantLimits, nominal: float | None, sd: float | None, expanded_u: float
) -> float:
    if limits.rule == "simple":
        return 0.0
    return limits.guard_band.in_unit(nominal or 0.0, sd, expanded_u) or 0.0


def _decision(limits: ConstantLimits, tolerance: Tolerance, value: float) -> Decision:
    decision = tolerance.decide(value)
    if limits.rule == "guarded" and decision.startswith("conditional"):
        return "fail"
    return decision
