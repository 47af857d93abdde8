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


def record_of(kind: type[Record], document: Any) -> Record:
    """The record that `plain_of` wrote; keys that it has no field for are passed over.

    Raises LookupError, TypeError or ValueError where `document` is no such record.
    """
    made: Record = _made(kind, document)
    return made


@cache
def hints_of(kind: type) -> Mapping[str, Any]:
    """The kinds of a record's fields."""
    return get_type_hints(kind)


def _made(kind: Any, document: Any) -> Any:
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        return kind(**{n: _made(hint, document[n]) for n, hint in hints_of(kind).items()})
    if origin in (Union, types.UnionType):
        one = next(one for one in inner if one is not type(None))
        return None if document is None and type(None) in inner else _made(one, document)
    if origin is tuple:
        if not isinstance(document, list):
            raise TypeError(f"{document!r} is no list")
        return tuple(_made(inner[0], item) for item in document)
    return _scalar(kind, document)


def _scalar(kind: Any, document: Any) -> Any:
    if get_origin(kind) is Literal:
        if document not in get_args(kind):
            raise ValueError(f"{document!r} is none of {', '.join(map(str, get_args(kind)))}")
        return document
    if kind is float and isinstance(document, int) and not isinstance(document, bool):
        return float(document)
    if not isinstance(document, kind) or (isinstance(document, bool) and kind is not bool):
        raise TypeError(f"{document!r} is no {kind.__name__}")
    return document
