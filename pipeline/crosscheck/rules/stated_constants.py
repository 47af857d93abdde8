"""Stated constants against what the captures say of them."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import judge_ratio, not_evaluated, ratio_of
from pipeline.crosscheck.protocol import Rule
from pipeline.physics.suspects import Quantity
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.estimate import Estimate
from pipeline.records.stated import METHOD

NAME = "stated_constants"
OTHERWISE = "another motor, another temperature, or the source of the statement"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Of the constants that are both stated and measured, the one that is farthest off.

    Each is the measured value over the stated one, judged by both uncertainties.
    """
    judged = [
        _check(stated, measured, options["allowance"])
        for stated in constants.estimates
        if stated.method == METHOD
        and (measured := constants.best(stated.name)) is not None
        and measured.method != METHOD
        and stated.number != 0.0
    ]
    if not judged:
        return not_evaluated(NAME, "needs a constant that is both stated and measured")
    return max(judged, key=lambda one: abs((one.value or 1.0) - 1.0) / (one.limit or 1.0))


def _check(stated: Estimate, measured: Estimate, allowance: float) -> Check:
    meaning = f"{stated.name}: measured over stated, {measured.number:.4g} over {stated.number:.4g}"
    ratio = ratio_of(measured, stated)
    return judge_ratio(NAME, ratio, allowance, meaning, _quantity(stated.name), None, OTHERWISE)


def _quantity(name: str) -> Quantity:
    """What conventions can enter a constant, by what its name begins with."""
    if name.startswith(("kt_", "ke_", "kv_", "psi_")):
        return "coupling"
    if name.startswith("tau_"):
        return "time_constant"
    if name.startswith("temp_coeff"):
        return "temperature_coefficient"
    return "impedance"


RULE = Rule(NAME, check, {"allowance": 0.01})
