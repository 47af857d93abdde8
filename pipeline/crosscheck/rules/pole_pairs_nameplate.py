"""Whether the counted pole pairs are those of the nameplate."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.estimate import Estimate

NAME = "pole_pairs_nameplate"


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Counted pole pairs less the nameplate's; every stated nameplate must agree."""
    counted = constants.best("pole_pairs")
    stated = sorted({c.meta.pole_pairs for c in campaign.captures if c.meta.pole_pairs})
    if counted is None or not stated:
        return not_evaluated(NAME, "needs pole_pairs in the metadata and an open_circuit spin")
    wrong = [plate for plate in stated if plate != round(counted.number)]
    plates = ", ".join(str(plate) for plate in stated)
    words = f"{counted.number:g} electrical cycles a turn against a nameplate of {plates}"
    if not wrong:
        return Check(NAME, "pass", words, 0.0, 0.0, "1")
    difference = counted.number - wrong[0]
    return Check(NAME, "fail", words, difference, 0.0, "1", _suspect(counted, wrong, campaign))


def _suspect(counted: Estimate, wrong: list[int], campaign: Campaign) -> str:
    """The odd files where most nameplates are right, else what the ratio suggests."""
    plates = [c for c in campaign.captures if c.meta.pole_pairs]
    odd = [c.path for c in plates if c.meta.pole_pairs in wrong]
    if 2 * len(odd) < len(plates):
        return f"the metadata of {', '.join(odd[:3])}: {len(odd)} of {len(plates)} captures"
    ratio = counted.number / wrong[0]
    if ratio == 0.5:
        return "2: the nameplate states poles, not pole pairs"
    if ratio == 2.0:
        return "2: the nameplate halves the pole pairs, or the speed was read twice too low"
    return "a gear between the shaft and the angle sensor, or another motor's nameplate"


RULE = Rule(NAME, check, tests=("open_circuit", "hand_turn"), quantities=("pole_pairs",))
