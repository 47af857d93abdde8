"""A ros2msg schema parsed into a layout of fields.

Reference: https://mcap.dev/spec/registry (ros2msg: concatenated definitions, separated by lines of
80 `=` and `MSG: package/Type`) and https://docs.ros.org/en/rolling/Concepts/Basic/About-Interfaces.html.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

from pipeline.io.mcap.limits import MAX_CHUNK_BYTES, MAX_DEPTH, MAX_FIELDS
from pipeline.io.mcap.records import Schema
from pipeline.records.errors import CaptureError
from pipeline.records.parse import ParseError, decoded, whole

_DTYPES = {
    "bool": "?",
    "byte": "u1",
    "char": "u1",
    "uint8": "u1",
    "int8": "i1",
    "uint16": "u2",
    "int16": "i2",
    "uint32": "u4",
    "int32": "i4",
    "uint64": "u8",
    "int64": "i8",
    "float32": "f4",
    "float64": "f8",
}
_FIELD = re.compile(r"^([A-Za-z][\w/]*)(<=\d+)?(\[(?:<=)?(\d*)\])?\s+([A-Za-z]\w*)(\s.*)?$")
_CONSTANT = re.compile(r"^[A-Za-z]\w*(<=\d+)?\s+[A-Za-z]\w*\s*=")
_KNOWN = {
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec",
    "builtin_interfaces/Duration": "int32 sec\nuint32 nanosec",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id",
}


@dataclass(frozen=True, slots=True)
class Field:
    """One field. `dtype` is numpy's, `string`, or None with `parts` for a nested message.

    `array` is None for a single value, 0 for a sequence of any length, n for exactly n.
    """

    name: str
    dtype: str | None
    parts: tuple[Field, ...]
    array: int | None

    def names(self, prefix: str = "") -> list[str]:
        """Dotted names of all fields below.

        Parameters
        ----------
        prefix
            Before each name.

        """
        if self.dtype is not None:
            return [prefix + self.name]
        return [name for part in self.parts for name in part.names(f"{prefix}{self.name}.")]


def layout_of(schema: Schema) -> tuple[Field, ...]:
    """The fields of a schema's root message, in the order in which they are encoded.

    Parameters
    ----------
    schema
        Whose data are concatenated message definitions.

    Returns
    -------
    tuple of Field
        Nested messages hold their own.

    Raises
    ------
    CaptureError
        The text cannot be parsed, names an unknown type, nests too deep, or has too many fields.

    References
    ----------
    MCAP well-known schema encodings, ros2msg, https://mcap.dev/spec/registry.

    """
    try:
        text = decoded(schema.data)
    except ParseError as fault:
        raise _bad(schema, str(fault)) from None
    sections = re.split(r"^={3,}\s*$", text, flags=re.MULTILINE)
    definitions = dict(_KNOWN)
    for section in sections[1:]:
        head, _, body = section.strip().partition("\n")
        if not head.startswith("MSG:"):
            raise _bad(schema, "has a section without a `MSG:` line")
        definitions[_short(head[4:].strip())] = body
    package = schema.name.split("/", 1)[0] if "/" in schema.name else ""
    return _Parser(schema, definitions).fields(sections[0], package, 0)


def _short(name: str) -> str:
    """`pkg/msg/Type` and `pkg/Type` are one type."""
    parts = name.split("/")
    return f"{parts[0]}/{parts[-1]}" if len(parts) == 3 else name


def _bad(schema: Schema, what: str) -> CaptureError:
    return CaptureError(
        "bad_schema",
        f"the ros2msg schema {schema.name!r} {what}",
        "record with the complete message definition, nested types included",
    )


class _Parser:
    def __init__(self, schema: Schema, definitions: dict[str, str]) -> None:
        self.schema = schema
        self.definitions = definitions
        self.count = 0

    def fields(self, text: str, package: str, depth: int) -> tuple[Field, ...]:
        if depth > MAX_DEPTH:
            raise _bad(self.schema, f"nests deeper than {MAX_DEPTH}")
        fields: list[Field] = []
        for line in text.splitlines():
            bare = line.split("#", 1)[0].strip()
            if not bare or _CONSTANT.match(bare):
                continue
            match = _FIELD.match(bare)
            if match is None:
                raise _bad(self.schema, f"has the line {bare[:60]!r}")
            self.count += 1
            if self.count > MAX_FIELDS:
                raise _bad(self.schema, f"has more than {MAX_FIELDS} fields")
            array = self.array(match[3], match[4])
            fields.append(self.field(match[1], match[5], array, package, depth))
        if len({part.name for part in fields}) != len(fields):
            raise _bad(self.schema, "has a field twice")
        return tuple(fields)

    def array(self, brackets: str | None, bound: str | None) -> int | None:
        """The `array` of a field from `[...]` and the digits in it."""
        if brackets is None:
            return None
        if "<=" in brackets or not bound:
            return 0
        count = whole(bound, 1, MAX_CHUNK_BYTES)
        if count is None:
            words = f"has an array of {bound[:20]} items, where 1 to {MAX_CHUNK_BYTES} are possible"
            raise _bad(self.schema, words)
        return count

    def field(self, kind: str, name: str, array: int | None, package: str, depth: int) -> Field:
        if kind in _DTYPES:
            return Field(name, _DTYPES[kind], (), array)
        if kind == "string":
            return Field(name, "string", (), array)
        if kind == "wstring":
            raise _bad(self.schema, f"has the wstring {name!r}, which is not supported")
        full = _short(kind) if "/" in kind else f"{package}/{kind}"
        if kind == "Header":
            full = "std_msgs/Header"
        if full not in self.definitions:
            raise _bad(self.schema, f"uses {kind!r} without defining it")
        parts = self.fields(self.definitions[full], full.split("/", 1)[0], depth + 1)
        return Field(name, None, parts, array)
