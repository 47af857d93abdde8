"""Which pole pairs constants may rest on: counted, or stated and not contradicted."""

from __future__ import annotations

from typing import NamedTuple

from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.pole_pairs import BY_VOLTAGE, contradicts, voltages_say


class PolePairsToUse(NamedTuple):
    """Pole pairs, None where there are none to rest on, and on what they rest, in words."""

    number: int | None
    words: str


def pole_pairs_to_use(known: Constants, campaign: Campaign) -> PolePairsToUse:
    """Counted pole pairs, else stated ones that the voltages at speed do not contradict.

    Parameters
    ----------
    known
        Constants found so far: `pole_pairs` where counted, and `pole_pairs_by_voltage`.
    campaign
        The motor's captures, whose metadata state pole pairs.

    """
    counted, seen = known.best("pole_pairs"), known.best(BY_VOLTAGE)
    if counted is not None:
        return PolePairsToUse(round(counted.number), "")
    stated = campaign.nameplate("pole_pairs")
    voltages = "" if seen is None else f"; {voltages_say(seen)}"
    if not isinstance(stated, int):
        return PolePairsToUse(None, f"state pole_pairs, or record an open_circuit spin{voltages}")
    if seen is not None and contradicts(seen, stated):
        return PolePairsToUse(
            None,
            f"the captures state {stated} pole pairs{voltages}: correct `pole_pairs`, or the "
            "inductances, or record an open_circuit spin, which counts them",
        )
    rests = f"rests on the {stated} pole pairs that the captures state"
    return PolePairsToUse(stated, f"{rests}{voltages or '; nothing recorded counts them'}")
