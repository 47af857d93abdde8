"""What a cross-check is: one file in `rules/`, one `RULE`."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

RuleFunction = Callable[[Constants, Campaign, Mapping[str, float]], Check]


@dataclass(frozen=True, slots=True)
class Rule:
    """One check of `contract/outputs.md`: `check(constants, campaign, options)` is pure.

    Attributes
    ----------
    name
        Of the check, as in the datasheet.
    check
        Of the motor's constants, its captures and the options; with too little to judge it returns
        a Check of status `not_evaluated` that says what is missing.
    options
        Numbers of judgement by name, with their defaults; `conf/` can override each.
    tests
        Tests that the check rests on, the one to repeat first when it fails first.
    quantities
        Those of `records.agreement` that it takes for one motor's; where captures disagree on one
        of them the check fails before it is made.

    """

    name: str
    check: RuleFunction
    options: Mapping[str, float] = field(default_factory=dict)
    tests: tuple[str, ...] = ()
    quantities: tuple[str, ...] = ()
