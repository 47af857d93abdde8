"""Whether the three phases have one resistance."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import judge_deviation, not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "resistance_balance"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Largest less smallest phase resistance over their mean, near zero.

    Notes
    -----
    The option `allowance` [1], two per cent, is what leads and turn counts of a sound winding stay
    within; more is a bad joint, a missing turn or a contact.

    """
    imbalance = constants.best("resistance_imbalance")
    if imbalance is None:
        return not_evaluated(NAME, "needs a resistance capture on each of the pairs ab, bc and ca")
    allowance = options["allowance"]
    status = judge_deviation(imbalance.number, imbalance.u, allowance)
    limit = allowance + 2.0 * imbalance.u
    words = (
        f"largest less smallest phase resistance over their mean; {imbalance.number:.4f} ± "
        f"{2.0 * imbalance.u:.4f} (k=2), at most {limit:.3g}"
    )
    suspect = "a joint, a missing turn or a terminal contact" if status == "fail" else None
    return Check(NAME, status, words, imbalance.number, limit, "1", suspect)


RULE = Rule(NAME, check, {"allowance": 0.02}, tests=("resistance",), quantities=("r_phase_ohm",))
