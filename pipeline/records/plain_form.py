"""Records as plain JSON values and back, by the kinds of their fields alone."""

from __future__ import annotations

import math
import types
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, Literal, TypeVar, Union, cast, get_args, get_origin, get_type_hints

Record = TypeVar("Record")


class PlainRecord:
    """A frozen dataclass whose JSON form is an object of its fields by name."""

    __slots__ = ()

    def document(self) -> dict[str, Any]:
        """The JSON form, as `contract/outputs.md` has it; more keys are an extension of it.

        Raises
        ------
        ValueError
            For NaN or infinity.

        """
        return plain_fields(self)


def plain_of(value: Any) -> Any:
    """A record as JSON values.

    Parameters
    ----------
    value
        A record, or what a field of one may hold: mappings, tuples, named tuples, scalars.

    Returns
    -------
    dict, list or scalar
        A record or a named tuple is a dict of its fields.

    Raises
    ------
    ValueError
        For NaN or infinity.

    """
    if isinstance(value, PlainRecord):
        return value.document()
    if is_dataclass(value):
        return plain_fields(value)
    if isinstance(value, tuple) and hasattr(value, "_asdict"):
        return plain_of(value._asdict())
    if isinstance(value, Mapping):
        return {str(key): plain_of(one) for key, one in value.items()}
    if isinstance(value, (tuple, list)):
        return [plain_of(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        raise ValueError("a record holds a number that is not finite")
    return value


def plain_fields(record: Any) -> dict[str, Any]:
    """The fields of a record by name, each as a JSON value.

    Parameters
    ----------
    record
        A dataclass.

    Returns
    -------
    dict
        As `plain_of` gives each field, in the order of the fields.

    Raises
    ------
    ValueError
        A number is NaN or infinite.

    """
    return {field.name: plain_of(getattr(record, field.name)) for field in fields(record)}


def record_of(kind: type[Record], document: Any) -> Record:
    """The record that `plain_of` wrote.

    Parameters
    ----------
    kind
        A dataclass.
    document
        Its JSON form. Keys without a field are passed over; a field without a key has its default.

    Returns
    -------
    Record
        Of that kind.

    Raises
    ------
    LookupError, TypeError or ValueError
        `document` is no such record.

    """
    return cast(Record, _made(kind, document))


@cache
def hints_of(kind: type) -> Mapping[str, Any]:
    """The types of a record's fields by name, with forward references resolved.

    Parameters
    ----------
    kind
        A dataclass or named tuple.

    """
    return get_type_hints(kind)


def _made(kind: Any, document: Any) -> Any:
    origin, inner = get_origin(kind), get_args(kind)
    if origin in (Union, types.UnionType):
        return _one_of(inner, document)
    if origin is tuple:
        return _tuple(inner, document)
    if origin is Mapping:
        return {key: _made(inner[1], one) for key, one in document.items()}
    if is_dataclass(kind) or hasattr(kind, "_fields"):
        hints = hints_of(kind)
        return kind(**{n: _made(hints[n], document[n]) for n in hints if n in document})
    return _scalar(kind, document)


def _one_of(kinds: tuple[Any, ...], document: Any) -> Any:
    """The first of several kinds that a value has."""
    if document is None and types.NoneType in kinds:
        return None
    for kind in kinds:
        with suppress(LookupError, TypeError, ValueError):
            return _made(kind, document)
    raise TypeError(f"{document!r} is none of {', '.join(map(str, kinds))}")


def _tuple(kinds: tuple[Any, ...], document: Any) -> tuple[Any, ...]:
    if not isinstance(document, list):
        raise TypeError(f"{document!r} is no list")
    if kinds[-1] is Ellipsis:
        return tuple(_made(kinds[0], item) for item in document)
    return tuple(_made(kind, item) for kind, item in zip(kinds, document, strict=True))


def _scalar(kind: Any, document: Any) -> Any:
    """A text, number or word of a literal; a whole number may stand for a float."""
    if get_origin(kind) is Literal:
        if document not in get_args(kind):
            raise ValueError(f"{document!r} is none of {', '.join(map(str, get_args(kind)))}")
        return document
    kinds = (float, int) if kind is float else kind
    if not isinstance(document, kinds) or (isinstance(document, bool) and kind is not bool):
        raise TypeError(f"{document!r} is no {kind.__name__}")
    return document
