"""Docstrings of the public API: every parameter, result, error and field is documented."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import pytest

import pipeline

HEAD = re.compile(r"^(\w[\w ]*)\n-+$", re.MULTILINE)
ENTRY = re.compile(r"^\**(\w+(?:, \w+)*) :", re.MULTILINE)

FUNCTIONS = [n for n in pipeline.__all__ if inspect.isfunction(getattr(pipeline, n))]
RECORDS = [n for n in pipeline.__all__ if inspect.isclass(getattr(pipeline, n))]


def sections(item: Any) -> dict[str, str]:
    """The text of each section of a docstring by its title."""
    parts = HEAD.split(inspect.cleandoc(item.__doc__ or ""))
    return dict(zip(["", *parts[1::2]], [parts[0], *parts[2::2]], strict=True))


def entries(text: str) -> set[str]:
    return {name for names in ENTRY.findall(text) for name in names.split(", ")}


def parameters(function: Callable[..., Any]) -> set[str]:
    return {name for name in inspect.signature(function).parameters if name != "self"}


def methods() -> list[Any]:
    return [
        pytest.param(value, id=f"{name}.{key}")
        for name in RECORDS
        for key, value in inspect.getmembers(getattr(pipeline, name), inspect.isfunction)
        if not key.startswith("_") and value.__module__.startswith("pipeline.")
    ]


def faults(function: Callable[..., Any]) -> list[str]:
    """What the docstring of a function lacks."""
    found = sections(function)
    named = entries(found.get("Parameters", ""))
    wrong = [f"undocumented: {name}" for name in sorted(parameters(function) - named)]
    wrong += [f"no such parameter: {name}" for name in sorted(named - parameters(function))]
    if "Returns" not in found:
        wrong.append("no Returns")
    raised = set(re.findall(r"raise (\w+)", inspect.getsource(function)))
    wrong += [f"not in Raises: {e}" for e in sorted(raised) if e not in found.get("Raises", "")]
    first = inspect.cleandoc(function.__doc__ or "").partition("\n\n")[0]
    return wrong + ([] if first.endswith(".") else ["no sentence first"])


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_public_function_is_documented(name: str) -> None:
    function = getattr(pipeline, name)
    assert faults(function) == []
    found = sections(function)
    assert "Raises" in found
    assert ">>> import pipeline" in found["Examples"]


@pytest.mark.parametrize("method", methods())
def test_every_method_of_a_result_is_documented(method: Callable[..., Any]) -> None:
    assert faults(method) == []


@pytest.mark.parametrize("name", RECORDS)
def test_every_field_and_property_of_a_result_is_documented(name: str) -> None:
    record = getattr(pipeline, name)
    own = {field.name for field in fields(record)}
    assert entries(sections(record)["Attributes"]) == own
    for key, value in inspect.getmembers(record, lambda member: isinstance(member, property)):
        assert value.__doc__, key


@pytest.mark.parametrize("name", FUNCTIONS)
def test_numbers_that_are_handed_in_have_a_unit(name: str) -> None:
    """Options and stated constants are numbers of a unit; the docstring says where it is from."""
    text = sections(getattr(pipeline, name))["Parameters"]
    for part in re.split(r"^(?=\w+(?:, \w+)* :)", text, flags=re.MULTILINE):
        kind = part.partition("\n")[0]
        if "mapping" in kind or "ReadLimits" in kind:
            assert re.search(r"\[.+\]", part), part


def test_references_lead_to_a_document() -> None:
    """Each reference has a DOI, and the text cites it."""
    cited = 0
    for name in FUNCTIONS:
        found = sections(getattr(pipeline, name))
        if "References" in found:
            cited += 1
            assert "https://doi.org/10." in found["References"]
            first = found["References"].split()[0].strip(",")
            assert f"({first}" in found["Notes"]
    assert cited >= 3


def test_a_lacking_docstring_is_seen() -> None:
    def function(one: int, two: int) -> int:  # noqa: D417
        """Adds.

        Parameters
        ----------
        one, three : int
            Numbers.

        """
        if two < 0:
            raise ValueError(two)
        return one + two

    assert faults(function) == [
        "undocumented: two",
        "no such parameter: three",
        "no Returns",
        "not in Raises: ValueError",
    ]
