"""What a calculator is given and what it answers: keys with units in, lines with formulas out."""

from __future__ import annotations

import difflib
import math
import re
import textwrap
from collections.abc import Callable, Mapping
from dataclasses import dataclass

from pipeline.physics.glossary import suffix_of
from pipeline.physics.suspects import Quantity, convention_suspect
from pipeline.physics.units import RAD_S_PER_RPM
from pipeline.records.errors import UsageError

AGREEMENT = 5e-3
TYPED = 0.01
WIDTH = 80
"""Columns of a terminal."""
"""How far typed numbers of a few digits may lie off a convention's own, relative."""
_NUMBER = re.compile(r"([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*)")
_SPELLINGS = str.maketrans({"·": "", ".": "", "*": "", " ": "", "Ω": "ohm", "µ": "u", "μ": "u"})

# Other spellings and multiples of each unit, in that unit; the unit itself is always understood.
_MULTIPLES: dict[str, dict[str, float]] = {
    "ohm": {"mohm": 1e-3, "kohm": 1e3},
    "H": {"mH": 1e-3, "uH": 1e-6},
    "V": {"mV": 1e-3},
    "A": {"mA": 1e-3},
    "Wb": {"mWb": 1e-3, "uWb": 1e-6, "Vs": 1.0, "mVs": 1e-3},
    "N·m": {"mNm": 1e-3, "Ncm": 1e-2},
    "N·m/A": {"mNm/A": 1e-3, "Ncm/A": 1e-2},
    "V·s/rad": {"V/(rad/s)": 1.0, "mVs/rad": 1e-3, "V/krpm": 1e-3 / RAD_S_PER_RPM},
    "V/krpm": {"mV/rpm": 1.0, "V/rpm": 1e3},
    "rad/s": {"rpm": RAD_S_PER_RPM, "krpm": 1e3 * RAD_S_PER_RPM},
    "Hz": {"kHz": 1e3, "rpm": 1.0 / 60.0},
    "degC": {"C": 1.0, "°C": 1.0},
    "1/K": {"%/K": 1e-2, "ppm/K": 1e-6},
    "deg": {"°": 1.0},
}


@dataclass(frozen=True, slots=True)
class Key:
    """A quantity that may be given: its name ends in its unit and may be typed without it.

    `low` [unit] is the smallest sensible value, excluded. `many`: a list, as in 4,8.

    Attributes
    ----------
    name, unit, words
        Its name ends in its unit, and may be typed without it.
    other_names
        Further names.
    low
        Smallest sensible value [unit], excluded.
    many
        Whether it is a list, as in 4,8.
    choices
        Texts of which it is one.

    """

    name: str
    unit: str
    words: str
    other_names: tuple[str, ...] = ()
    low: float = 0.0
    many: bool = False
    choices: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Every name under which it may be given."""
        suffix = suffix_of(self.name)
        short = (self.name.removesuffix(f"_{suffix}"),) if suffix else ()
        return (self.name, *short, *self.other_names)


@dataclass(frozen=True, slots=True)
class Given:
    """What the user gave, in the keys' units."""

    kind: str
    numbers: Mapping[str, tuple[float, ...]]
    texts: Mapping[str, str]

    def has(self, *names: str) -> bool:
        """Whether all of some quantities were given.

        Parameters
        ----------
        *names
            Names of keys.

        """
        return all(name in self.numbers for name in names)

    def any(self, *names: str) -> tuple[str, ...]:
        """Those of some quantities that were given.

        Parameters
        ----------
        *names
            Names of keys.

        """
        return tuple(name for name in names if name in self.numbers)

    def one(self, name: str) -> float:
        """A number that was given.

        Parameters
        ----------
        name
            Name of the key.

        Returns
        -------
        float
            The first, of a list.

        """
        return self.numbers[name][0]


@dataclass(frozen=True, slots=True)
class Line:
    """One answer: name, value [unit], the formula it came by and what it stands for."""

    name: str
    value: float | int | str
    unit: str = ""
    formula: str = ""
    words: str = ""


@dataclass(frozen=True, slots=True)
class Answer:
    """The lines of a calculation and the convention they hold in."""

    lines: tuple[Line, ...]
    convention: str


@dataclass(frozen=True, slots=True)
class Calculator:
    """One kind of calculation; `ways` says which keys together give an answer."""

    words: str
    keys: tuple[Key, ...]
    ways: tuple[str, ...]
    answer: Callable[[Given], Answer | None]

    def index(self) -> dict[str, Key]:
        """Every name that may be typed; a short name means the first key that claims it."""
        names: dict[str, Key] = {key.name: key for key in self.keys}
        for key in self.keys:
            for name in key.names:
                names.setdefault(name, key)
        return names

    def shown_names(self) -> dict[str, Key]:
        """The keys by the name that is easiest to type."""
        index = self.index()
        return {
            next((n for n in key.names[1:] if index[n] is key), key.name): key for key in self.keys
        }


def parse(kind: str, calculator: Calculator, mapping: Mapping[str, str]) -> Given:
    """The typed keys as numbers in the keys' units.

    Parameters
    ----------
    kind
        Name of the calculator, for messages.
    calculator
        Its keys, with their units.
    mapping
        What was typed, by the name under which it was: a number, one with a unit, a list or a
        choice.

    Returns
    -------
    Given
        Numbers [the key's unit] and texts by the key's full name.

    Raises
    ------
    UsageError
        A key is unknown or given twice, or a value is no number of the key's unit or not above the
        key's lowest.

    """
    index = calculator.index()
    numbers: dict[str, tuple[float, ...]] = {}
    texts: dict[str, str] = {}
    for typed, text in mapping.items():
        key = index.get(typed)
        if key is None:
            near = difflib.get_close_matches(typed, index, 1)
            known = ", ".join(calculator.shown_names())
            hint = f"did you mean {near[0]}=?" if near else f"known are {known}"
            raise UsageError(f"calc {kind}: no key {typed!r}", hint)
        if key.name in numbers or key.name in texts:
            raise UsageError(f"calc {kind}: {key.name} is given twice", "give it once")
        if key.choices:
            texts[key.name] = _choice(kind, key, text)
        else:
            numbers[key.name] = _values(kind, key, text)
    return Given(kind, numbers, texts)


def _choice(kind: str, key: Key, text: str) -> str:
    if text not in key.choices:
        raise UsageError(
            f"calc {kind}: {key.name}={text} is none of the known",
            f"one of {', '.join(key.choices)}",
        )
    return text


def _values(kind: str, key: Key, text: str) -> tuple[float, ...]:
    parts = text.strip().removeprefix("[").removesuffix("]").split(",")
    if len(parts) > 1 and not key.many:
        raise UsageError(f"calc {kind}: {key.name}={text} is a list", "give one number")
    return tuple(_value(kind, key, part.strip()) for part in parts)


def _value(kind: str, key: Key, text: str) -> float:
    match = _NUMBER.fullmatch(text)
    units = {key.unit: 1.0, "" if key.unit == "1" else key.unit: 1.0} | _MULTIPLES.get(key.unit, {})
    scales = {unit.translate(_SPELLINGS): factor for unit, factor in units.items()}
    typed = "" if match is None else match[2].translate(_SPELLINGS)
    if match is None or (typed and typed not in scales):
        raise UsageError(
            f"calc {kind}: {key.name}={text} is no number of {key.unit or 'no unit'}",
            f"write a number, or a number with one of {', '.join(u for u in units if u)}",
        )
    value = float(match[1]) * scales.get(typed, 1.0)
    if not math.isfinite(value):
        raise UsageError(f"calc {kind}: {key.name}={text}", "it is too large for a number")
    if value <= key.low:
        least = f"{key.low:g} {_unit(key.unit)}".rstrip()
        raise UsageError(f"calc {kind}: {key.name}={text}", f"it must be above {least}")
    return value


def agreed(given: Given, values: Mapping[str, float], quantity: Quantity = "coupling") -> float:
    """The one value that several keys imply.

    Parameters
    ----------
    given
        What was typed, for messages and for the pole pairs.
    values
        What each key implies, in one unit; at least one.
    quantity
        What the values are of, for the conventions that they may differ by.

    Returns
    -------
    float
        The first of them.

    Raises
    ------
    UsageError
        Another one differs from it by more than `AGREEMENT`; the message names the convention that
        their ratio lands on.

    """
    (first, value), *others = values.items()
    pairs = round(given.one("pole_pairs")) if given.has("pole_pairs") else None
    for name, other in others:
        if abs(other - value) > AGREEMENT * abs(value):
            suspect = convention_suspect(other / value, TYPED * other / value, quantity, pairs)
            why = f"ratio {other / value:.4f}{f', on {suspect}' if suspect else ''}"
            raise UsageError(
                f"calc {given.kind}: {first} and {name} contradict each other ({why})", "give one"
            )
    return value


def render(kind: str, calculator: Calculator, given: Given, answer: Answer) -> str:
    """The printed answer: what was given, every line with its formula, the convention.

    Parameters
    ----------
    kind
        Name of the calculation.
    calculator
        The calculation.
    given
        What was given.
    answer
        What follows from it.

    """
    units = {key.name: key.unit for key in calculator.keys}
    shown = [
        f"{name} = {', '.join(number(v) for v in values)} {_unit(units[name])}".rstrip()
        for name, values in given.numbers.items()
    ]
    shown += [f"{name} = {text}" for name, text in given.texts.items()]
    rows = [
        (line.name, f"{number(line.value)} {_unit(line.unit)}".strip(), line.formula, line.words)
        for line in answer.lines
    ]
    widths = [max(len(row[column]) for row in rows) for column in range(3)]
    lines = [
        (f"  {name:<{widths[0]}} = {value:<{widths[1]}}  {formula:<{widths[2]}}", words)
        for name, value, formula, words in rows
    ]
    wide = any(len(line) + 2 + len(words) > WIDTH for line, words in lines)
    gap = "\n      " if wide else "  "
    body = [f"{line.rstrip() if wide else line}{gap}{words}".rstrip() for line, words in lines]
    head = f"{kind}: {calculator.words}"
    return "\n".join(
        [head, f"given: {'; '.join(shown)}", *body, f"convention: {answer.convention}"]
    )


def number(value: float | int | str) -> str:
    """Six significant digits, whole numbers as they are.

    Parameters
    ----------
    value
        The number.

    """
    return f"{value:.6g}" if isinstance(value, float) else str(value)


def _unit(unit: str) -> str:
    return "" if unit == "1" else unit


def usage(kinds: Mapping[str, Calculator], kind: str | None = None) -> str:
    """The kinds of calculation, or the keys of one and what can be calculated from them.

    Parameters
    ----------
    kinds
        Calculations by name.
    kind
        One of them; None lists all.

    """
    if kind is None:
        width = max(map(len, kinds))
        return "\n".join(f"  {name:<{width}}  {kinds[name].words}" for name in kinds)
    calculator = kinds[kind]
    rows = list(calculator.shown_names().items())
    width = max(len(name) for name, _ in rows)
    lines = [*_wrapped(f"calc {kind}: {calculator.words}", 2), "", "give"]
    for way in calculator.ways:
        lines += _wrapped(f"  {way}", 4)
    lines += ["", "keys"]
    for name, key in rows:
        lines += _wrapped(f"  {name:<{width}}  {_key_words(name, key)}", width + 4)
    return "\n".join(lines)


def _wrapped(text: str, indent: int) -> list[str]:
    """Lines that a terminal shows whole, those after the first set in by `indent` columns."""
    return textwrap.wrap(text, WIDTH, subsequent_indent=" " * indent, break_long_words=False)


def _key_words(shown: str, key: Key) -> str:
    unit = "|".join(key.choices) or _unit(key.unit)
    others = [name for name in key.other_names if name != shown]
    also = f"; also {', '.join(others)}" if others else ""
    return f"[{unit}] {key.words}{also}" if unit else f"{key.words}{also}"
