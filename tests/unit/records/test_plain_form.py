"""Records as JSON values and back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import pytest

from pipeline.records.plain_form import PlainRecord, plain_of, record_of


class Size(NamedTuple):
    """A named tuple is written by its names."""

    value: float | None
    unit: str


@dataclass(frozen=True, slots=True)
class Part(PlainRecord):
    """A record inside another one."""

    sizes: Mapping[str, Size]
    rows: tuple[int, int] | None = None


@dataclass(frozen=True, slots=True)
class Whole(PlainRecord):
    """Every kind of field."""

    name: str
    kind: Literal["a", "b"]
    parts: tuple[Part, ...]
    at: Mapping[str, float | str]
    good: bool = True


WHOLE = Whole("x", "a", (Part({"r": Size(1.5, "ohm")}, (3, 4)), Part({})), {"t": 25.0, "of": "d"})
DOCUMENT: dict[str, Any] = {
    "name": "x",
    "kind": "a",
    "parts": [
        {"sizes": {"r": {"value": 1.5, "unit": "ohm"}}, "rows": [3, 4]},
        {"sizes": {}, "rows": None},
    ],
    "at": {"t": 25.0, "of": "d"},
    "good": True,
}


def test_a_record_is_an_object_of_its_fields_and_comes_back() -> None:
    assert WHOLE.document() == plain_of(WHOLE) == DOCUMENT
    assert record_of(Whole, DOCUMENT) == WHOLE


def test_other_keys_are_passed_over_and_missing_ones_have_their_default() -> None:
    assert record_of(Part, {"sizes": {}, "more": 1}) == Part({})
    with pytest.raises(TypeError, match="sizes"):
        record_of(Part, {"rows": None})


def test_a_whole_number_stands_for_a_float_and_stays_one() -> None:
    found = record_of(Part, {"sizes": {"p": {"value": 7, "unit": "1"}}})
    assert found.document()["sizes"]["p"]["value"].__class__ is int


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("kind", "c"),
        ("name", 1),
        ("name", None),
        ("good", 1),
        ("at", {"t": None}),
        ("at", {"t": True}),
        ("parts", {}),
        ("parts", [{"sizes": {}, "rows": [1]}]),
        ("parts", [{"sizes": {}, "rows": [1, 2, 3]}]),
        ("parts", [{"sizes": {}, "rows": [1.5, 2]}]),
        ("parts", [3]),
    ],
)
def test_another_form_is_refused(key: str, value: object) -> None:
    with pytest.raises((LookupError, TypeError, ValueError)):
        record_of(Whole, {**DOCUMENT, key: value})


@pytest.mark.parametrize("number", [math.nan, math.inf])
def test_a_number_that_json_cannot_hold_is_refused(number: float) -> None:
    with pytest.raises(ValueError, match="not finite"):
        Part({"r": Size(number, "ohm")}).document()
