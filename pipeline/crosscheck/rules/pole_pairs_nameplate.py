"""Whether the pole pairs that were counted, or that voltages at speed show, are the nameplate's."""

from __future__ import annotations

from collections.abc import Mapping

from pipeline.crosscheck.judge import not_evaluated
from pipeline.crosscheck.protocol import Rule
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Check
from pipeline.records.estimate import Estimate
from pipeline.records.pole_pairs import BY_VOLTAGE, contradicts, voltages_say

NAME = "pole_pairs_nameplate"
NEEDS = (
    "needs pole_pairs in the metadata, and an open_circuit spin or a log of theta_mech_rad with "
    "theta_elec_rad or voltages of two phases"
)


def check(constants: Constants, campaign: Campaign, options: Mapping[str, float]) -> Check:
    """Counted pole pairs less the nameplate's, else those of the voltages at speed less it; every
    stated nameplate must agree.
    """
    counted = constants.best("pole_pairs")
    stated = sorted({c.meta.pole_pairs for c in campaign.captures if c.meta.pole_pairs})
    if counted is None and stated:
        return _by_voltage(constants, stated, campaign)
    if counted is None or not stated:
        return not_evaluated(NAME, _needs(constants, campaign))
    wrong = [plate for plate in stated if plate != round(counted.number)]
    plates = ", ".join(str(plate) for plate in stated)
    words = f"{counted.number:g} electrical cycles a turn against a nameplate of {plates}"
    if not wrong:
        return Check(NAME, "pass", words, 0.0, 0.0, "1")
    difference = counted.number - wrong[0]
    return Check(NAME, "fail", words, difference, 0.0, "1", _suspect(counted, wrong, campaign))


def _needs(constants: Constants, campaign: Campaign) -> str:
    """What a count needs, and what is wrong with a capture that might have counted."""
    paths = tuple(f"{c.path}: " for c in campaign.captures)
    notes = [e.note for e in constants.all_of("pole_pairs") if e.note.startswith(paths)]
    return "; ".join([NEEDS, *notes])


def _by_voltage(constants: Constants, stated: list[int], campaign: Campaign) -> Check:
    """What voltages at speed say of the nameplate: they pass it where they exclude its neighbours.

    They tell pole pairs times an inductance, so an inductance that is off may be what is wrong.
    """
    seen, needs = constants.best(BY_VOLTAGE), _needs(constants, campaign)
    if seen is None:
        return not_evaluated(NAME, needs)
    wrong = [plate for plate in stated if contradicts(seen, plate)]
    plates = ", ".join(str(plate) for plate in stated)
    words = f"a nameplate of {plates}; {voltages_say(seen)}"
    if wrong:
        likely = max(round(seen.number), 1)
        odd = _odd_files(wrong, campaign)
        suspect = odd or (
            f"the stated {wrong[0]}, where {likely} is nearest: correct `pole_pairs`, or the unit "
            "of the inductances; an open_circuit spin counts them"
        )
        return Check(NAME, "fail", words, seen.number - wrong[0], 0.0, "1", suspect)
    neighbours = {plate + step for plate in stated for step in (-1, 1)} - {0}
    if not all(contradicts(seen, plate) for plate in neighbours):
        return not_evaluated(NAME, f"{words}, which holds for its neighbours too; {needs}")
    return Check(NAME, "pass", words, seen.number - stated[0], seen.u, "1")


def _odd_files(wrong: list[int], campaign: Campaign) -> str:
    """The files that state a wrong number, where most state a right one; else an empty text."""
    plates = [c for c in campaign.captures if c.meta.pole_pairs]
    odd = [c.path for c in plates if c.meta.pole_pairs in wrong]
    if 2 * len(odd) >= len(plates):
        return ""
    return f"the metadata of {', '.join(odd[:3])}: {len(odd)} of {len(plates)} captures"


def _suspect(counted: Estimate, wrong: list[int], campaign: Campaign) -> str:
    """The odd files where most nameplates are right, else what the ratio suggests."""
    if odd := _odd_files(wrong, campaign):
        return odd
    ratio = counted.number / wrong[0]
    if ratio == 0.5:
        return "2: the nameplate states poles, not pole pairs"
    if ratio == 2.0:
        return "2: the nameplate halves the pole pairs, or the speed was read twice too low"
    return "a gear between the shaft and the angle sensor, or another motor's nameplate"


RULE = Rule(NAME, check, tests=("open_circuit", "hand_turn"), quantities=("pole_pairs",))
