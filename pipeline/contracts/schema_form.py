"""The words of JSON Schema: objects, lists, numbers, and the schema of a record."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import is_dataclass
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin

from pipeline.records.plain_form import hints_of

Schema = dict[str, Any]

DIALECT = "https://json-schema.org/draft/2020-12/schema"
TEXT: Schema = {"type": "string"}
NAME: Schema = {"type": "string", "minLength": 1}
NUMBER: Schema = {"type": "number"}
WHOLE: Schema = {"type": "integer"}
SPREAD: Schema = {"type": "number", "minimum": 0}
SHARE: Schema = {"type": "number", "minimum": 0, "maximum": 1}
COUNT: Schema = {"type": "integer", "minimum": 0}
SHA256: Schema = {"type": "string", "pattern": "^[0-9a-f]{64}$"}


def or_null(schema: Schema) -> Schema:
    """A schema, or null.

    Parameters
    ----------
    schema
        The schema.

    """
    return {"anyOf": [schema, {"type": "null"}]}


def one_of(literal: Any) -> Schema:
    """One of the values of a literal type.

    Parameters
    ----------
    literal
        A `Literal`.

    """
    return {"enum": list(get_args(literal))}


def list_of(items: Schema, **more: Any) -> Schema:
    """A list of one kind of item.

    Parameters
    ----------
    items
        Schema of an item.
    **more
        Further keys, such as `minItems`.

    """
    return {"type": "array", "items": items, **more}


def map_of(values: Schema) -> Schema:
    """An object of one kind of value under any name.

    Parameters
    ----------
    values
        Schema of a value.

    """
    return {"type": "object", "additionalProperties": values}


def object_of(needed: Mapping[str, Schema], more: Mapping[str, Schema] | None = None) -> Schema:
    """An object; other keys than those named are allowed.

    Parameters
    ----------
    needed
        Schemas of keys that it must hold.
    more
        Schemas of keys that it may hold.

    """
    return {
        "type": "object",
        "properties": {**needed, **(more or {})},
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


def of_kind(kind: Any) -> Schema:
    """The schema of a field of a record.

    Parameters
    ----------
    kind
        Its type: a record, a tuple, a mapping, a literal, a scalar, or one of these or None.

    """
    origin, inner = get_origin(kind), get_args(kind)
    if is_dataclass(kind) and isinstance(kind, type):
        return object_of({name: of_kind(hint) for name, hint in hints_of(kind).items()})
    if origin in (Union, UnionType):
        (one,) = (part for part in inner if part is not type(None))
        return or_null(of_kind(one))
    if origin is tuple:
        return list_of(of_kind(inner[0]))
    if origin is Mapping:
        return map_of(of_kind(inner[1]))
    if origin is Literal:
        return one_of(kind)
    return {float: NUMBER, int: WHOLE, str: TEXT, bool: {"type": "boolean"}}[kind]
