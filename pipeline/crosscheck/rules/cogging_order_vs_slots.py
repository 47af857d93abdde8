"""Whether the leading cogging order is one that the slots and poles make."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.physics.mechanics import cogging_order
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check

NAME = "cogging_order_vs_slots"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """The leading order over LCM(slots, 2p): a whole number in a sound motor.

    Notes
    -----
    Other multiples of the slots are marginal: unequal slots or teeth. So are multiples of p or 2p,
    unequal magnets, and once or twice a turn, unbalance. Any other order is not made by these slots
    and poles, and fails.

    References
    ----------
    Zhu and Howe, IEEE Trans. Energy Convers. 15(4), 2000, 407, doi:10.1109/60.900501.

    """
    order, pairs = constants.best("cogging_order"), constants.best("pole_pairs")
    slots = campaign.nameplate("slots")
    if order is None or pairs is None or not isinstance(slots, int):
        none = any(one.settled for one in constants.all_of("cogging_order"))
        words = "no cogging was found, so there is no cogging_order to judge"
        needs = "needs cogging found in a cogging test, pole pairs and slots"
        return not_evaluated(NAME, words if none else needs)
    leading, p = round(order.number), round(pairs.number)
    fundamental = cogging_order(slots, p)
    words = (
        f"order {leading} a turn; {slots} slots and {2 * p} poles make multiples of {fundamental}"
    )
    ratio = leading / fundamental
    if leading % fundamental == 0:
        return Check(NAME, "pass", words, ratio, 0.0, "1")
    if leading % slots == 0:
        return Check(NAME, "marginal", words, ratio, 0.0, "1", "unequal slots or teeth")
    if leading % p == 0:
        return Check(NAME, "marginal", words, ratio, 0.0, "1", "unequal magnets or poles")
    if leading <= 2:
        return Check(NAME, "marginal", words, ratio, 0.0, "1", "unbalance or eccentricity")
    return Check(NAME, "fail", words, ratio, 0.0, "1", "another motor's slots, or a gear")


RULE = Rule(NAME, check, tests=("cogging", "open_circuit"))
