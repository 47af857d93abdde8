"""Metadata in the names of files: which part is the motor, the test, the terminal pair."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from pathlib import PurePosixPath

from pipeline.io.inspection.labels import plain
from pipeline.io.inspection.vocabulary import DIRECTIONS, TESTS

_BREAK = r"[_\-. /]"
_LEAST_INSIDE = 4
_SERIAL = re.compile(r"[A-Za-z]{0,8}-?\d{1,10}[A-Za-z]?|[A-Za-z]+\d+-\d+")
_DATE = re.compile(r"(19|20)\d{2}-?(0[1-9]|1[0-2])-?([0-2]\d|3[01])")
_TIME = re.compile(r"([01]\d|2[0-3])[-h]?[0-5]\d([-m]?[0-5]\d)?")
_PAIRS = {"ab": "ab", "bc": "bc", "ca": "ca", "uv": "ab", "vw": "bc", "wu": "ca"}
_SPEED = re.compile(r"(?<![A-Za-z\d.])(-?\d{2,6})[_ ]?(rpm|RPM|Upm|upm|Umin|umin)(?![A-Za-z\d])")
MOTION = frozenset({"omega_mech_rad_s", "theta_mech_rad", "theta_elec_rad"})
_TABLE = frozenset({"iq_a", "torque_shaft_nm"})


@dataclass(frozen=True, slots=True)
class NamePatterns:
    """`patterns` are those of a map's `file_names`, `values` what their words mean."""

    patterns: tuple[str, ...] = ()
    values: dict[str, dict[str, str]] = field(default_factory=dict)
    keys: frozenset[str] = frozenset()
    """Metadata that every name gives."""


def name_patterns(
    paths: Sequence[str],
    stated: frozenset[str] = frozenset(),
    columns: frozenset[str] = MOTION,
) -> NamePatterns:
    """The patterns that paths of one bench have in common.

    Parameters
    ----------
    paths
        Paths of files.
    stated
        Metadata keys that the files state themselves.
    columns
        Columns that the files hold; a speed in every name is one of them where none is a motion.

    Returns
    -------
    NamePatterns
        Regular expressions with named groups, for the keys that are not stated.

    Notes
    -----
    The motor is the first part with a figure that is in every path at the same place of the words
    and is neither a test, a pair nor a date.

    """
    ways = dict.fromkeys(DIRECTIONS.split(), "")
    words_by_key = {
        "test": {path: word for path in paths if (word := _test(path))},
        "pair": {path: word for path in paths if (word := _word(path, _PAIRS))},
        "direction": {path: word for path in paths if (word := _word(path, ways))},
    }
    patterns: list[str] = []
    values: dict[str, dict[str, str]] = {}
    keys: set[str] = set()
    motor = _motor_pattern(paths)
    if motor and "motor_id" not in stated:
        patterns.append(motor)
        keys.add("motor_id")
    # where names state a direction beside it, the sign of the speed is not in its figures
    if not columns & MOTION and not words_by_key["direction"] and all(map(_SPEED.search, paths)):
        patterns.append(_SPEED.pattern.replace("(-?", "(?P<omega_mech_rad_s__rpm>-?"))
    for key, places_of_words in words_by_key.items():
        if not places_of_words or key in stated:
            continue
        words = sorted({text for text, _ in places_of_words.values()}, key=lambda w: (-len(w), w))
        group = f"(?P<{key}>{'|'.join(map(re.escape, words))})"
        bound = key != "test" or any(len(word) < _LEAST_INSIDE for word in words)
        patterns.append(f"(?:^|{_BREAK}){group}(?={_BREAK}|$)" if bound else group)
        meanings = {text: meaning for text, meaning in places_of_words.values() if meaning}
        if columns >= _TABLE and "t_s" not in columns:
            # a map of steady points has no clock
            meanings = {w: "torque_table" if m == "torque_map" else m for w, m in meanings.items()}
        if meanings:
            values[key] = dict(sorted(meanings.items()))
        if len(places_of_words) == len(paths):
            keys.add(key)
    return NamePatterns(tuple(patterns), values, frozenset(keys))


def _test(path: str) -> tuple[str, str] | None:
    """The word of a path that names a test, and the test; the longest word counts."""
    stem = _without_suffix(path)
    flat = plain(stem)
    if len(flat) != len(stem):
        return None
    words = [(word, test) for test, names in TESTS.items() for word in plain(names).split()]
    for word, test in sorted(words, key=lambda one: -len(one[0])):
        pattern = re.escape(word).replace("_", f"{_BREAK}?")
        if word.isascii() and len(word) < _LEAST_INSIDE:
            pattern = f"(?<![^_\\-. /]){pattern}(?![^_\\-. /])"
        match = re.search(pattern, flat)
        if match:
            return stem[match.start() : match.end()], test
    return None


def _word(path: str, known: Mapping[str, str]) -> tuple[str, str] | None:
    """A word of a path between breaks that is known, and its meaning."""
    for word in re.split(_BREAK, _without_suffix(path)):
        if word.lower() in known:
            return word, known[word.lower()]
    return None


def _without_suffix(path: str) -> str:
    return PurePosixPath(path).with_suffix("").as_posix()


def _motor_pattern(paths: Sequence[str]) -> str | None:
    """The pattern of the serial number, or None."""
    candidates = [_serials(path) for path in paths]
    if not candidates or not all(candidates):
        return None
    for shape in dict.fromkeys(_shape(word) for word in candidates[0]):
        if all(any(_shape(word) == shape for word in words) for words in candidates):
            return f"(?:^|{_BREAK})(?P<motor_id>{shape})(?={_BREAK}|$)"
    return None


def _serials(path: str) -> list[str]:
    """Words of a path that may be a serial number, in order."""
    words = _without_instants(re.split(r"[_ /.]", _without_suffix(path)))
    words = [p for w in words for p in ([w] if _SERIAL.fullmatch(w) else w.split("-"))]
    return [w for w in words if _SERIAL.fullmatch(w) and not _DATE.fullmatch(w) and _is_long(w)]


def _without_instants(words: Sequence[str]) -> list[str]:
    """The words but a time of day behind a date: `20240301_181530` is no serial number."""
    return [
        word
        for before, word in pairwise(["", *words])
        if not (_DATE.fullmatch(before) and _TIME.fullmatch(word))
    ]


def _is_long(word: str) -> bool:
    """Whether it is more than a bare number of a take."""
    return any(c.isalpha() for c in word) or len(word) > 2


def _shape(word: str) -> str:
    """A pattern of words of the same letters with as many figures."""
    return "".join(rf"\d{{{len(p)}}}" if p.isdigit() else p for p in re.findall(r"\d+|\D", word))
