"""Calculator of pole pairs: from cycles, frequencies, or a speed that is reported wrongly."""

from __future__ import annotations

from pipeline.calculators.quantities import Answer, Calculator, Given, Key, Line, agreed
from pipeline.physics.pole_pairs import pole_pairs_from
from pipeline.records.errors import UsageError


def _pole_pairs(given: Given) -> Answer | None:
    implied = _implied(given)
    if not implied:
        return None
    number = round(agreed(given, {name: float(value) for name, value in implied.items()}, "count"))
    formula = "f_elec/f_mech" if "f_elec_hz" in implied else "cycles/turns"
    lines = [
        Line("pole_pairs", number, "1", formula, "electrical cycles a mechanical turn"),
        Line("poles", 2 * number, "1", "2·p", "magnets around the rotor"),
    ]
    if given.has("speed_ratio"):
        stated = _whole(given, number / given.one("speed_ratio"), 1.0)
        words = "pole pairs the drive was told"
        lines.append(Line("told", stated, "1", "p/(reported/true speed)", words))
    elif given.has("told"):
        ratio = number / given.one("told")
        words = "reported speed over true speed, as ω = ω_elec/told"
        lines.append(Line("speed_ratio", ratio, "1", "p/told", words))
    return Answer(tuple(lines), "pairs, not poles; cycles of one phase's or one pair's back-EMF")


def _implied(given: Given) -> dict[str, int]:
    """Pole pairs as each given quantity implies them."""
    pairs: dict[str, int] = {}
    if given.has("cycles"):
        turns = given.one("turns") if given.has("turns") else 1.0
        pairs["cycles"] = _whole(given, given.one("cycles"), turns)
    if given.has("f_elec_hz", "f_mech_hz"):
        pairs["f_elec_hz"] = _whole(given, given.one("f_elec_hz"), given.one("f_mech_hz"))
    if given.has("pole_pairs"):
        pairs["pole_pairs"] = _whole(given, given.one("pole_pairs"), 1.0)
    if given.has("poles"):
        pairs["poles"] = _whole(given, given.one("poles"), 2.0)
    if given.has("told", "speed_ratio"):
        pairs["told·speed_ratio"] = _whole(given, given.one("told") * given.one("speed_ratio"), 1.0)
    return pairs


def _whole(given: Given, electrical: float, mechanical: float) -> int:
    pairs = pole_pairs_from(electrical, mechanical)
    if pairs.number is None:
        raise UsageError(
            f"calc {given.kind}: {pairs.ratio:.4g} is not within 0.02 of a whole number",
            "count over more turns, or check the gear and the belt",
        )
    return pairs.number


POLE_PAIRS = Calculator(
    "pole pairs from cycles and turns, frequencies or a wrong speed",
    (
        Key("cycles", "1", "back-EMF cycles counted"),
        Key("turns", "1", "mechanical turns they were counted over; 1 if not given"),
        Key("f_elec_hz", "Hz", "electrical frequency"),
        Key("f_mech_hz", "Hz", "mechanical frequency, or rpm"),
        Key("told", "1", "pole pairs the drive was told"),
        Key("speed_ratio", "1", "reported speed over true speed"),
        Key("pole_pairs", "1", "pole pairs, for the poles", ("p",)),
        Key("poles", "1", "poles, for the pairs"),
    ),
    (
        "cycles (and turns), f_elec and f_mech, poles, or told and speed_ratio: the pole pairs",
        "one of these and speed_ratio or told: what the drive was told, or how its speed errs",
    ),
    _pole_pairs,
)
