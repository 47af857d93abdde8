"""Names of the glossary in words, and the units that they end in."""

from __future__ import annotations

import re

from pipeline.physics.glossary import COLUMNS, suffix_of, unit_of
from pipeline.physics.notation import unit_text

_QUANTITIES = {
    "t": "time",
    "theta": "angle",
    "omega": "speed",
    "alpha": "acceleration",
    "temp": "temperature",
    "torque": "torque",
    "i": "current",
    "v": "voltage",
    "psi": "flux linkage",
}
_QUALIFIERS = {"mech": "shaft", "elec": "electrical", "pair": "line"}
_AXES = {"ia", "ib", "ic", "id", "iq", "va", "vb", "vc", "vd", "vq", "vab", "vbc", "vca", "vdc"}
_BETWEEN = {"rab", "rbc", "rca", "lab", "lbc", "lca"}
"""Resistances and inductances between two terminals."""
_NAME = re.compile(r"\b[a-z]+(?:_[a-z0-9]+)+\b")


def quantity_words(name: str) -> str:
    """A glossary name without its unit, in words: `temp_winding_degc` is winding temperature.

    Parameters
    ----------
    name
        Name of the glossary, ending in its unit.

    """
    suffix = suffix_of(name)
    stem = name[: -len(suffix) - 1] if suffix else name
    first, *rest = stem.split("_")
    if first in _AXES and not rest:
        return f"{first[0]}_{first[1:]}"
    if first in _BETWEEN and not rest:
        return f"{first[0].upper()}_{first[1:]}"
    quantity = _QUANTITIES.get(first, first)
    if first in _QUANTITIES and len(rest) == 1:
        return f"{_QUALIFIERS.get(rest[0], rest[0])} {quantity}"
    return " ".join([quantity, *rest])


def in_words(text: str) -> str:
    """A text with the names of columns in words: `drag as a curve of shaft speed`.

    Parameters
    ----------
    text
        Prose that has glossary names in it.

    """
    return _NAME.sub(lambda hit: quantity_words(hit[0]) if hit[0] in COLUMNS else hit[0], text)


def unit_words(name: str) -> str:
    """The unit that a name ends in, as people write it; 1 where it has none.

    Parameters
    ----------
    name
        Name of the glossary, ending in its unit.

    """
    return unit_text(unit_of(name)) or "1"


def with_unit(name: str) -> str:
    """A glossary name in words with its unit: `shaft speed [rad/s]`.

    Parameters
    ----------
    name
        Name of the glossary, ending in its unit.

    """
    return f"{quantity_words(name)} [{unit_words(name)}]"
