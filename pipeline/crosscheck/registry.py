"""Finds the rules (one file each in `rules/`) and applies them to one motor."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from functools import cache

from pipeline.crosscheck.agreement import failing
from pipeline.crosscheck.judge import not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.plugins import discover
from pipeline.records.agreement import Disagreement
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

BROKEN = (ValueError, ArithmeticError, LookupError, TypeError)


@cache
def rules() -> tuple[Rule, ...]:
    """Every rule, by name."""
    return tuple(one.value for one in discover("pipeline.crosscheck.rules", "RULE", Rule))


def check_all(
    constants: Constants,
    campaign: Campaign,
    options: Mapping[str, Mapping[str, float]],
    apart: Sequence[Disagreement] = (),
) -> tuple[Check, ...]:
    """Every check of one motor.

    Parameters
    ----------
    constants
        All estimates of the motor.
    campaign
        Its captures.
    options
        Options by the name of the rule, beside or over the rule's own.
    apart
        Quantities in which the captures disagree.

    Returns
    -------
    tuple of Check
        In the order of their names. A check that rests on a quantity in `apart` fails with the
        files that are of another motor: two motors have no convention. A rule that breaks on this
        data has judged nothing: its check is not evaluated and says so.

    """
    checks = []
    for rule in rules():
        if concerned := [one for one in apart if one.quantity in rule.quantities]:
            checks.append(failing(rule.name, concerned))
            continue
        chosen = {**rule.options, **options.get(rule.name, {})}
        try:
            checks.append(_finite(rule.check(constants, campaign, chosen)))
        except BROKEN as error:
            words = f"broke on this data: {type(error).__name__}: {error}; report it with this line"
            checks.append(not_evaluated(rule.name, words))
    return tuple(checks)


def _finite(check: Check) -> Check:
    """The check, or that it was not made where its value or limit is no finite number."""
    numbers = (x for x in (check.value, check.limit) if x is not None)
    if all(math.isfinite(x) for x in numbers):
        return check
    return not_evaluated(check.name, f"{check.value} against {check.limit} judges nothing")
