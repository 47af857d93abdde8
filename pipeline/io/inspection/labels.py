"""What the name of a field says: its unit, and which columns of the contract it may be."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Collection
from dataclasses import dataclass
from functools import cache

from pipeline.io.inspection.aliases import alias
from pipeline.io.inspection.vocabulary import QUALIFIERS, QUANTITIES, SYMBOLS
from pipeline.io.maps.columns import last_part
from pipeline.io.maps.units import COUNTS, FOREIGN_UNITS, OF_FRAME, normal_unit
from pipeline.physics.glossary import COLUMNS

_BRACKET = re.compile(r"^(.+?)\s*[(\[{<]\s*([^)\]}>]*?)\s*[)\]}>]\s*$")
_AFTER = re.compile(r"^(.+?)(?:\s+/\s*|\s+in\s+|,\s+)(\S+(?:\s\S+)?)$")
_CHANNEL = re.compile(r"^ch(?:annel)?\s?\d+[\s:_-]+(?=[^\s(\[])", re.IGNORECASE)
_LEAST_STEM = 4
_LETTERS = frozenset("acfhkv")
"""Ends of a name that are a phase as well as a unit: `current_a`."""
_COMPANIONS = {"a": "bc", "v": "uw", "c": "ab"}
"""Letters of the other phases beside one that is a unit too."""
_RMS = frozenset({"rms", "eff", "effektiv", "efficace"})
_IMPLIED = {"rpm": "rpm", "erpm": "rpm", "mstoday": "ms", "second": "s", "seconds": "s", "sec": "s"}


@dataclass(frozen=True, slots=True)
class Label:
    """`columns` that a name may mean, the likeliest first; none where it says nothing.

    `unit` is the unit as the table of units knows it; `unit_text` what was written, if anything.
    `exact`: the name is the contract's own.
    """

    columns: tuple[str, ...] = ()
    unit: str | None = None
    unit_text: str | None = None
    exact: bool = False


def read_label(name: str, unit_row: str | None = None, beside: Collection[str] = ()) -> Label:
    """What the name of a field and the units row say of it.

    Parameters
    ----------
    name
        Name of the field.
    unit_row
        What the units row says of it; None without such a row.
    beside
        Names of all fields of the table.

    Returns
    -------
    Label
        Columns that it may be, and its unit.

    Notes
    -----
    The unit comes from the units row, from brackets (`Speed [rpm]`), behind a stroke (`Drehzahl /
    1/min`) or from the end of the name (`time_ms`). A column whose unit cannot be had from the unit
    that is written is not meant: `T_Wicklung [C]` is no time.

    """
    if last_part(name) in COLUMNS and not unit_row:
        return Label((last_part(name),), None, None, exact=True)
    # a recorder's own number of the channel says nothing of what it recorded
    stem, text = _without_unit(_CHANNEL.sub("", name.strip()), unit_row)
    stem = last_part(stem.rstrip("."))
    dimensions = {unit for unit in FOREIGN_UNITS if text and known_unit(unit, text) is not None}
    columns = tuple(c for c in _columns(stem) if not dimensions or COLUMNS[c].unit in dimensions)
    if not text:
        head, _, tail = stem.replace(" ", "_").rpartition("_")
        if head and normal_unit(tail) == COUNTS:
            return Label(_columns(head), None, tail)
        ended = tuple(c for c in _columns(head) if known_unit(COLUMNS[c].unit, tail) is not None)
        is_unit = tail not in _LETTERS or _is_lone(name.strip(), tail, beside)
        if ended and is_unit:
            columns, text = ended, tail
        elif not columns and is_unit:
            columns, text = _by_its_end(head, tail)
    if not columns and dimensions:
        columns = _of_dimension(stem, dimensions)
    unit = known_unit(COLUMNS[columns[0]].unit, text) if columns and text else None
    implied = None
    if columns and not text:
        names = _key(stem), *words_of(stem)[-1:]
        implied = next((_IMPLIED[name] for name in names if name in _IMPLIED), None)
    unit = unit or implied
    if text and columns and OF_FRAME.issuperset(columns) and not _RMS.isdisjoint(words_of(stem)):
        # the word may stand beside the unit: `Iq rms (A)`
        text = f"{normal_unit(text)}_rms"
        unit = known_unit(COLUMNS[columns[0]].unit, text)
    return Label(columns, unit, text)


def _is_lone(name: str, tail: str, beside: Collection[str]) -> bool:
    """Whether a name that ends in a phase's letter has no companion of another phase beside it."""
    others = {name.removesuffix(tail) + other for other in _COMPANIONS.get(tail, "")}
    of_phase = not {"phase", "ph"}.isdisjoint(words_of(name))
    return bool(others) and name in beside and not of_phase and others.isdisjoint(beside)


def _by_its_end(head: str, tail: str) -> tuple[tuple[str, ...], str | None]:
    """Columns of a name whose end is a unit, and the unit: `battery_V`, `iq_actual_mA`, "tick_us".

    A single letter is a unit only where the rest says of what.
    """
    dimensions = {unit for unit in FOREIGN_UNITS if known_unit(unit, tail) is not None}
    columns = _of_dimension(head, dimensions) if dimensions else ()
    if len(tail) == 1 and not _marks(words_of(head)):
        return (), None
    return columns, tail if dimensions else None


def known_unit(target: str, text: str) -> str | None:
    """The unit as the table of units knows it, whatever its capitals, or None.

    Capitals count where the table has both (`mohm` and `Mohm`).

    Parameters
    ----------
    target
        Unit of the glossary that it converts to.
    text
        The unit as it is written.

    Returns
    -------
    str or None
        None where there is no such unit. Capitals count where the table has both (`mohm` and
        `Mohm`).

    """
    known = FOREIGN_UNITS.get(target, {})
    unit = normal_unit(text)
    if unit in known:
        return unit
    return next((name for name in known if name.lower() == unit.lower()), None)


def words_of(text: str) -> tuple[str, ...]:
    """The words of a name in small letters without accents; compounds are separated at capitals.

    Parameters
    ----------
    text
        The name.

    """
    spaced = re.sub(r"(?<=[a-z])(?=[A-Z])", " ", text)
    return tuple(re.findall(r"[^\W_]+", plain(spaced)))


def plain(text: str) -> str:
    """Small letters without accents; `ß` is `ss`.

    Parameters
    ----------
    text
        Any text.

    """
    flat = unicodedata.normalize("NFKD", text.casefold())
    return unicodedata.normalize("NFC", "".join(c for c in flat if unicodedata.category(c) != "Mn"))


def matches(words: tuple[str, ...], stems: tuple[str, ...]) -> bool:
    """Whether a word is one of some stems, or contains one that is long or not Latin.

    Parameters
    ----------
    words
        Words of a name.
    stems
        Stems to find in them.

    """
    long = [stem for stem in stems if len(stem) >= _LEAST_STEM or not stem.isascii()]
    return any(word in stems or any(stem in word for stem in long) for word in words)


def _without_unit(bare: str, unit_row: str | None) -> tuple[str, str | None]:
    """The name without its unit, and the unit that is written, if any."""
    bracket = _BRACKET.match(bare)
    if bracket:
        return bracket[1], unit_row or bracket[2] or None
    after = _AFTER.match(bare)
    if after and any(known_unit(unit, after[2]) for unit in FOREIGN_UNITS):
        return after[1], unit_row or after[2]
    return bare, unit_row or None


def _key(name: str) -> str:
    return re.sub(r"[^a-z0-9]", "", name.lower())


def _columns(stem: str) -> tuple[str, ...]:
    """Columns that a name without its unit may mean, the likeliest first."""
    known = alias(_key(stem)) if stem.isascii() else None
    if known is not None and len(_key(stem)) > 1:
        return (known,)
    return tuple(dict.fromkeys([*([known] if known else []), *_by_words(stem)]))


def _by_words(stem: str) -> tuple[str, ...]:
    words = words_of(stem)
    marks = _marks(words)
    if "not measured" in marks:
        return ()
    quantities = [name for name, stems in _quantities().items() if matches(words, stems)]
    if not quantities and words:
        quantities = list(_of_symbol(words[0]))
    columns = [column for name in quantities for column in _of(name, marks)]
    return tuple(dict.fromkeys(columns))


def _of_symbol(word: str) -> tuple[str, ...]:
    """What the letter that begins a name stands for: `T`, `U`, `I1`, `iq`."""
    if word in SYMBOLS:
        return SYMBOLS[word]
    return ()


def _of_dimension(stem: str, dimensions: set[str]) -> tuple[str, ...]:
    """Columns of a unit's dimension, by what else the name says."""
    words = words_of(stem)
    marks = _marks(words)
    if "not measured" in marks:
        return ()
    names = [name for name, (unit, _) in QUANTITIES.items() if unit in dimensions]
    known = [name for name, stems in _quantities().items() if matches(words, stems)]
    if known:  # the words say another quantity than the unit does
        return ()
    return tuple(dict.fromkeys(column for name in names for column in _of(name, marks)))


def _marks(words: tuple[str, ...]) -> frozenset[str]:
    """What the words of a name say beside the quantity."""
    return frozenset(name for name, stems in _qualifiers().items() if matches(words, stems))


@cache
def _quantities() -> dict[str, tuple[str, ...]]:
    return {name: tuple(plain(words).split()) for name, (_, words) in QUANTITIES.items()}


@cache
def _qualifiers() -> dict[str, tuple[str, ...]]:
    return {name: tuple(plain(words).split()) for name, words in QUALIFIERS.items()}


def _of(quantity: str, marks: frozenset[str]) -> tuple[str, ...]:
    """Columns of a quantity with such marks, the likeliest first."""
    if quantity in ("current", "voltage"):
        return _electric(quantity, marks)
    axis = next((one[0] for one in ("d axis", "q axis") if one in marks), None)
    if quantity == "temperature":
        places = [p for p in ("winding", "magnet", "case", "ambient") if p in marks]
        places = places or (["winding", "case"] if "motor" in marks else [])
        every = ("winding", "case", "magnet", "ambient")
        return tuple(f"temp_{place}_degc" for place in (places or every))
    if quantity == "flux":
        return (f"psi_{axis}_wb",) if axis else ("psi_d_wb", "psi_q_wb")
    if quantity == "inductance":
        pairs = [pair for pair in ("ab", "bc", "ca") if pair in marks]
        return tuple(f"l{pair}_h" for pair in (pairs or ["ab"]))
    if quantity == "resistance":
        pairs = [pair for pair in ("ab", "bc", "ca") if pair in marks]
        return tuple(f"r{pair}_ohm" for pair in (pairs or ["ab"]))
    simple = {
        "time": "t_s",
        "torque": "torque_shaft_nm",
        "speed": "omega_mech_rad_s",
        "angle": "theta_elec_rad" if "electrical" in marks else "theta_mech_rad",
        "frequency": "freq_hz",
    }
    return (simple[quantity],) if quantity in simple else ()


def _electric(quantity: str, marks: frozenset[str]) -> tuple[str, ...]:
    """Columns of a voltage or a current: of an axis, the DC link, a pair or a phase."""
    letter, unit = ("i", "a") if quantity == "current" else ("v", "v")
    order = ["d axis", "q axis", "bus", *(["ab", "bc", "ca"] if letter == "v" else []), *"abc"]
    mark = next((one for one in order if one in marks), None)
    if mark is None:
        several = ("iq_a", "ia_a", "idc_a"), ("vdc_v", "vab_v", "va_v", "vq_v")
        return several[letter == "v"]
    return (f"{letter}{'dc' if mark == 'bus' else mark.split()[0]}_{unit}",)
