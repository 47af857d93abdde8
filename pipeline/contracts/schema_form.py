"""JSON Schemas of records: what the kinds of their fields allow."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import is_dataclass
from types import NoneType, UnionType
from typing import Annotated, Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import NDArray

from pipeline.records.field_kinds import EXTENSION, Keyword

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
ARRAYS: Mapping[Any, Schema] = {
    NDArray[np.int64]: {"type": "array", "items": {"type": ["integer", "array"]}},
    NDArray[np.float64]: {"type": "array", "items": {"type": ["number", "null", "array"]}},
}
SCALARS: Mapping[Any, str] = {float: "number", int: "integer", str: "string", bool: "boolean"}


def object_of(needed: Mapping[str, Any], more: Mapping[str, Any] | None = None) -> Schema:
    """An object; other keys than those named are allowed.

    Parameters
    ----------
    needed
        Kinds of keys that it must hold, or their schemas.
    more
        Those of keys that it may hold.

    """
    kinds = {**needed, **(more or {})}
    return {
        "type": "object",
        "properties": {name: of_kind(kind) for name, kind in kinds.items()},
        "required": sorted(needed),
    }


def document(identity: str, words: str, body: Schema) -> Schema:
    """The schema of a file.

    Parameters
    ----------
    identity
        Such as `findings/1`; the file holds it under `schema`.
    words
        Title in a few words.
    body
        Schema of the file's keys; it is changed in place.

    """
    body["properties"]["schema"] = {"const": identity}
    body["required"] = sorted({*body["required"], "schema"})
    return {"$schema": DIALECT, "$id": f"urn:{identity}", "title": words, **body}


def list_of(items: Schema) -> Schema:
    """A list of one kind of item.

    Parameters
    ----------
    items
        Schema of an item.

    """
    return {"type": "array", "items": items}


def map_of(values: Schema) -> Schema:
    """An object of one kind of value under any name.

    Parameters
    ----------
    values
        Schema of a value.

    """
    return {"type": "object", "additionalProperties": values}


def of_record(record: type, *, without: Sequence[str] = (), **changed: Any) -> Schema:
    """The schema of a record: every field is a needed key, save an `Extension`.

    Parameters
    ----------
    record
        A dataclass or a named tuple.
    without
        Fields that are not written.
    **changed
        Kinds or schemas of keys that its JSON form has beside its fields, or unlike them.

    """
    hints = get_type_hints(record, include_extras=True)
    kinds = {name: kind for name, kind in hints.items() if name not in without} | changed
    more = {name: kind for name, kind in kinds.items() if EXTENSION in _marks(kind)}
    return object_of({name: kind for name, kind in kinds.items() if name not in more}, more)


def of_kind(kind: Any) -> Schema:
    """The schema of a field of a record.

    Parameters
    ----------
    kind
        Its type: a record, a tuple, a mapping, a literal, an array, a scalar, or several of these;
        a schema is its own.

    """
    if isinstance(kind, dict):
        return kind
    origin, inner = get_origin(kind), get_args(kind)
    if origin is Annotated:
        keywords = [mark for mark in _marks(kind) if isinstance(mark, Keyword)]
        return of_kind(inner[0]) | {word.name: word.value for word in keywords}
    if origin in FORMS:
        return FORMS[origin](inner)
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        return of_record(kind)
    return ARRAYS.get(kind) or {"type": SCALARS[kind]}


def _marks(kind: Any) -> tuple[Any, ...]:
    return kind.__metadata__ if get_origin(kind) is Annotated else ()


def _any_of(kinds: tuple[Any, ...]) -> Schema:
    """One of several kinds; a whole number is a number."""
    kinds = tuple(kind for kind in kinds if kind is not int or float not in kinds)
    schemas = [{"type": "null"} if kind is NoneType else of_kind(kind) for kind in kinds]
    return schemas[0] if len(schemas) == 1 else {"anyOf": schemas}


def _tuple(kinds: tuple[Any, ...]) -> Schema:
    """A list of one kind of item, of any length or of one."""
    length = {} if kinds[-1] is Ellipsis else {"minItems": len(kinds), "maxItems": len(kinds)}
    return list_of(of_kind(kinds[0])) | length


FORMS: Mapping[Any, Callable[[tuple[Any, ...]], Schema]] = {
    Union: _any_of,
    UnionType: _any_of,
    tuple: _tuple,
    Mapping: lambda kinds: map_of(of_kind(kinds[1])),
    Literal: lambda kinds: {"enum": list(kinds)},
}
