"""Records as plain JSON values and back, by the kinds of their fields alone."""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

Record = TypeVar("Record")


def plain_of(value: Any) -> Any:
    """A record as maps, lists, texts and numbers; raises ValueError for NaN and infinity."""
    if is_dataclass(value):
        return {field.name: plain_of(getattr(value, field.name)) for field in fields(value)}
    if isinstance(value, Mapping):
        return {str(key): plain_of(value[key]) for key in sorted(value)}
    if isinstance(value, (tuple, list)):
        return [plain_of(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("a record holds a number that is not finite")
    return value


def record_of(kind: type[Record], said: Any) -> Record:
    """The record that `plain_of` wrote; keys that it has no field for are passed over.

    Raises LookupError, TypeError or ValueError where `said` is no such record.
    """
    made: Record = _made(kind, said)
    return made


@cache
def hints_of(kind: type) -> Mapping[str, Any]:
    """The kinds of a record's fields."""
    return get_type_hints(kind)


def _made(kind: Any, said: Any) -> Any:
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        return kind(**{n: _made(hint, said[n]) for n, hint in hints_of(kind).items()})
    if origin in (Union, types.UnionType):
        one = next(one for one in inner if one is not type(None))
        return None if said is None and type(None) in inner else _made(one, said)
    if origin is tuple:
        if not isinstance(said, list):
            raise TypeError(f"{said!r} is no list")
        return tuple(_made(inner[0], item) for item in said)
    return _scalar(kind, said)


def _scalar(kind: Any, said: Any) -> Any:
    if get_origin(kind) is Literal:
        if said not in get_args(kind):
            raise ValueError(f"{said!r} is none of {', '.join(map(str, get_args(kind)))}")
        return said
    if kind is float and isinstance(said, int) and not isinstance(said, bool):
        return float(said)
    if not isinstance(said, kind) or (isinstance(said, bool) and kind is not bool):
        raise TypeError(f"{said!r} is no {kind.__name__}")
    return said
