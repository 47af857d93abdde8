"""Small-signal inductance of the LCR meter against that of the current steps."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import judge_ratio, not_evaluated, ratio_of
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "lcr_vs_step_inductance"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """The LCR meter's Ld and Lq over the steps'; the axis that deviates most is reported.

    Notes
    -----
    The option `allowance` [1] covers eddy currents in magnets and laminations, which the meter's
    frequency excites more than a step. "Most" is |ratio − 1| − 2 u.

    """
    ratios = []
    for name in ("ld_h", "lq_h"):
        meter, step = constants.by("lcr", name), constants.by("current_step", name)
        if meter is not None and step is not None:
            ratios.append((ratio_of(meter, step), name))
    if not ratios:
        return not_evaluated(NAME, "needs an lcr table and current_step captures")
    ratio, name = max(ratios, key=lambda item: abs(item[0].value - 1.0) - 2.0 * item[0].u)
    return judge_ratio(
        NAME,
        ratio,
        options["allowance"],
        f"{name} by the LCR meter over {name} by current steps",
        "impedance",
        otherwise="eddy currents at the meter's frequency, or saturation by the step",
    )


RULE = Rule(
    NAME, check, {"allowance": 0.05}, tests=("lcr", "current_step"), quantities=("ld_h", "lq_h")
)
