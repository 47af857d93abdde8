"""Names of the glossary in words, and the units that they end in."""

from __future__ import annotations

from pipeline.physics.glossary import suffix_of, unit_of
from pipeline.physics.notation import unit_text

_SPOKEN = {
    "t": "time",
    "theta": "angle",
    "omega": "speed",
    "alpha": "acceleration",
    "temp": "temperature",
}
_AXES = {"ia", "ib", "ic", "id", "iq", "va", "vb", "vc", "vd", "vq", "vab", "vbc", "vca", "vdc"}


def quantity_words(name: str) -> str:
    """A glossary name without its unit, in words: `temp_winding_degc` is temperature winding.

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
    return " ".join([_SPOKEN.get(first, first), *rest])


def unit_words(name: str) -> str:
    """The unit that a name ends in, as people write it; 1 where it has none.

    Parameters
    ----------
    name
        Name of the glossary, ending in its unit.

    """
    return unit_text(unit_of(name)) or "1"


def with_unit(name: str) -> str:
    """A glossary name in words with its unit: `speed mech [rad/s]`.

    Parameters
    ----------
    name
        Name of the glossary, ending in its unit.

    """
    return f"{quantity_words(name)} [{unit_words(name)}]"
