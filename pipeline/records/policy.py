"""Constants of judgement as fields of frozen records: unit, meaning, origin, and how to override.

A policy is a frozen dataclass whose fields are sections; a section is a frozen dataclass whose
fields are numbers or rows of numbers. What each of them is stands under Attributes of its section:
`name : unit`, the meaning, and on a new line the origin, such as `chosen: why it is that`.
"""

from __future__ import annotations

import inspect
import math
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, fields, is_dataclass, replace
from difflib import get_close_matches
from functools import cache
from typing import Any, Literal, TypeVar, cast

from pipeline.records.content import content_digest
from pipeline.records.errors import UsageError

Number = float | int | tuple[float, ...]
Overrides = tuple[tuple[str, Number], ...]
"""Full names of fields, such as `selection.tie`, with the values that replace the defaults."""
Kind = Literal["derived", "calibrated", "chosen"]
Made = TypeVar("Made")
_NUMBER = re.compile(r"^(\w+) : (.+)\n((?: {4}.+\n?)+)", re.MULTILINE)
_ORIGIN = re.compile(" (derived|calibrated|chosen): ")


@dataclass(frozen=True, slots=True)
class Origin:
    """Where a number comes from: derived from what, calibrated by which command, chosen why."""

    kind: Kind
    reason: str


@dataclass(frozen=True, slots=True)
class Entry:
    """One number of a policy by its full name, as the table in docs/policy.md has it."""

    name: str
    value: Number
    unit: str
    meaning: str
    origin: Origin


def section(kind: type[Made]) -> Made:
    """A field that holds a section with its defaults.

    Parameters
    ----------
    kind
        The class of the section.

    """
    return field(default_factory=kind)


def entries(policy: Any) -> Iterator[Entry]:
    """Every number of a policy, section by section in the order of their fields.

    Parameters
    ----------
    policy
        A policy.

    Yields
    ------
    Entry
        Full name, value, unit, meaning and origin.

    """
    for name, section, value in _numbers(policy):
        yield Entry(name, value, *_about(section)[name.rpartition(".")[2]])


@cache
def _about(section: type) -> dict[str, tuple[str, str, Origin]]:
    """Unit, meaning and origin of the numbers of a section, as its docstring has them."""
    about = {}
    for name, unit, text in _NUMBER.findall(inspect.getdoc(section) or ""):
        meaning, kind, reason = _ORIGIN.split(" ".join(text.split()), maxsplit=1)
        about[name] = unit, meaning, Origin(cast(Kind, kind), reason)
    return about


def _numbers(policy: Any, before: str = "") -> Iterator[tuple[str, type, Number]]:
    """Full name, section and value of every number."""
    for one in fields(policy):
        value, name = getattr(policy, one.name), f"{before}{one.name}"
        if is_dataclass(value):
            yield from _numbers(value, f"{name}.")
        else:
            yield name, type(policy), value


def overrides(policy: Any, given: Mapping[str, Any]) -> Overrides:
    """The numbers of a nested mapping that differ from those of a policy, by full name.

    Parameters
    ----------
    policy
        The policy with its defaults.
    given
        Sections and their fields, as `conf/policy/NAME.yaml` has them.

    Raises
    ------
    UsageError
        For an unknown field, with the nearest name; for a value that is no finite number of the
        default's kind; for one of the other sign, since no judgement changes its sense.

    """
    known = {name: value for name, _, value in _numbers(policy)}
    changed = {}
    for name, value in _flat(given):
        if name not in known:
            near = get_close_matches(name, known, 1, 0.5) or _same_field(name, known)
            hint = f"did you mean {near[0]}?" if near else "docs/policy.md lists the fields"
            raise UsageError(f"policy: no field {name!r}", hint)
        number = _as(known[name], value, name)
        if number != known[name]:
            changed[name] = number
    return tuple(sorted(changed.items()))


def with_overrides(policy: Made, changes: Overrides) -> Made:
    """A policy with some of its numbers replaced; the names must be fields of it.

    Parameters
    ----------
    policy
        The policy; it is not changed.
    changes
        Full names of its fields with new values, as `overrides` gives them.

    """
    for name, value in changes:
        policy = _replaced(policy, name.split("."), value)
    return policy


def policy_digest(policy: Any) -> str:
    """sha256 of the names and values of a policy, not of units, meanings and origins.

    Parameters
    ----------
    policy
        A policy.

    """
    return content_digest({name: value for name, _, value in _numbers(policy)})


def _flat(given: Mapping[str, Any], before: str = "") -> Iterator[tuple[str, Any]]:
    for name, value in given.items():
        if isinstance(value, Mapping):
            yield from _flat(value, f"{before}{name}.")
        else:
            yield f"{before}{name}", value


def _same_field(name: str, known: Mapping[str, Any]) -> list[str]:
    """Fields of any section whose own name is near the last part of a name."""
    last = {full.rsplit(".", 1)[-1]: full for full in known}
    return [last[one] for one in get_close_matches(name.rsplit(".", 1)[-1], last, 1)]


def _as(default: Number, value: Any, name: str) -> Number:
    """A value as a number of the default's kind."""
    if isinstance(default, tuple):
        if not isinstance(value, (list, tuple)) or not value:
            raise UsageError(f"policy.{name}={value} is no list", f"write [{default[0]:g}, ...]")
        return tuple(float(_finite(one, name)) for one in value)
    number = _finite(value, name)
    if number * default < 0.0 or (number == 0.0) != (default == 0.0):
        hint = f"the default is {default:g}"
        raise UsageError(f"policy.{name}={value} is not of the default's sign", hint)
    if isinstance(default, int):
        if number != int(number):
            raise UsageError(f"policy.{name}={value} is no whole number", f"such as {default}")
        return int(number)
    return float(number)


def _finite(value: Any, name: str) -> float | int:
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not math.isfinite(value):
        raise UsageError(f"policy.{name}={value} is no finite number", "write a number")
    return value


def _replaced(policy: Made, path: list[str], value: Number) -> Made:
    head, rest = path[0], path[1:]
    new = _replaced(getattr(policy, head), rest, value) if rest else value
    return replace(policy, **{head: new})  # type: ignore[type-var]
