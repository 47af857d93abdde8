"""The protobuf descriptor in a channel's schema, turned into a plan of numeric fields.

Reference: https://protobuf.dev/programming-guides/encoding/ (wire types, packed fields) and
https://protobuf.dev/programming-guides/field_presence/ (omitted fields).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pipeline.io.mcap.limits import MAX_DEPTH, MAX_FIELDS
from pipeline.io.mcap.records import Schema
from pipeline.records.errors import CaptureError

VARINT, FIXED64, LENGTH, FIXED32 = 0, 1, 2, 5
_SCALARS: dict[int, tuple[int, str]] = {
    1: (FIXED64, "<f8"),
    2: (FIXED32, "<f4"),
    3: (VARINT, "<i8"),
    4: (VARINT, "<u8"),
    5: (VARINT, "<i4"),
    6: (FIXED64, "<u8"),
    7: (FIXED32, "<u4"),
    8: (VARINT, "?"),
    13: (VARINT, "<u4"),
    14: (VARINT, "<i4"),
    15: (FIXED32, "<i4"),
    16: (FIXED64, "<i8"),
    17: (VARINT, "zigzag32"),
    18: (VARINT, "zigzag64"),
}
_MESSAGE_TYPE, _REPEATED, _REQUIRED = 11, 3, 2


@dataclass(frozen=True, slots=True)
class Scalar:
    """A numeric field: its wire type, how its value reads, and whether absence means zero."""

    name: str
    wire: int
    dtype: str
    repeated: bool
    zero_when_absent: bool


@dataclass(frozen=True, slots=True)
class Message:
    """A (nested) message: its fields by number; fields that are no numbers are left out."""

    name: str
    repeated: bool
    fields: dict[int, Scalar | Message]

    def names(self, prefix: str = "") -> list[str]:
        """Dotted names of all numeric fields below.

        Parameters
        ----------
        prefix
            Before each name.

        """
        paths: list[str] = []
        for part in self.fields.values():
            if isinstance(part, Message):
                paths += part.names(f"{prefix}{part.name}.")
            else:
                paths.append(prefix + part.name)
        return paths


def plan_of(schema: Schema) -> Message:
    """The plan by which messages of a schema's root type are decoded.

    Parameters
    ----------
    schema
        Whose data are a FileDescriptorSet.

    Returns
    -------
    Message
        Numeric fields by tag, nested ones within.

    Raises
    ------
    CaptureError
        The descriptor is broken, lacks a type, or has too many fields (`bad_schema`).

    References
    ----------
    Protocol Buffers, descriptor.proto and Encoding,
    https://protobuf.dev/programming-guides/encoding/.

    """
    from google.protobuf.descriptor_pb2 import FileDescriptorSet
    from google.protobuf.message import DecodeError

    try:
        files = FileDescriptorSet.FromString(schema.data)
    except (DecodeError, UnicodeDecodeError, RecursionError):
        raise _bad(schema, "is no FileDescriptorSet") from None
    types: dict[str, tuple[Any, Any]] = {}
    for file in files.file:
        package = f".{file.package}" if file.package else ""
        for message in file.message_type:
            _register(types, f"{package}.{message.name}", message, file)
    root = types.get("." + schema.name.lstrip("."))
    if root is None:
        raise _bad(schema, f"does not define {schema.name!r}")
    return _Planner(schema, types).message("", False, root, 0)


def _bad(schema: Schema, what: str) -> CaptureError:
    return CaptureError(
        "bad_schema",
        f"the protobuf schema {schema.name!r} {what}",
        "write the channel's FileDescriptorSet, dependencies included, into its schema",
    )


def _register(types: dict[str, tuple[Any, Any]], name: str, message: Any, file: Any) -> None:
    types[name] = (message, file)
    for nested in message.nested_type:
        _register(types, f"{name}.{nested.name}", nested, file)


class _Planner:
    def __init__(self, schema: Schema, types: dict[str, tuple[Any, Any]]) -> None:
        self.schema = schema
        self.types = types
        self.count = 0

    def message(
        self, name: str, repeated: bool, field_lists: tuple[Any, Any], depth: int
    ) -> Message:
        descriptor, file = field_lists
        fields: dict[int, Scalar | Message] = {}
        if depth <= MAX_DEPTH:
            for part in descriptor.field:
                self.count += 1
                if self.count > MAX_FIELDS:
                    raise _bad(self.schema, f"has more than {MAX_FIELDS} fields")
                planned = self.field(part, file, depth)
                if planned is not None:
                    fields[part.number] = planned
        return Message(name, repeated, fields)

    def field(self, part: Any, file: Any, depth: int) -> Scalar | Message | None:
        if not isinstance(part.name, str) or not isinstance(part.type_name, str):
            raise _bad(self.schema, "has a name that is not UTF-8")
        repeated = part.label == _REPEATED
        if part.type == _MESSAGE_TYPE:
            declared = self.types.get(part.type_name)
            if declared is None:
                raise _bad(self.schema, f"uses {part.type_name!r} without defining it")
            if _recursive(part.type_name, declared[0], self.types):
                return None
            return self.message(part.name, repeated, declared, depth + 1)
        if part.type not in _SCALARS:
            return None
        wire, dtype = _SCALARS[part.type]
        return Scalar(part.name, wire, dtype, repeated, _implicit(part, file))


def _implicit(part: Any, file: Any) -> bool:
    """Whether an omitted field means zero (implicit presence), not missing."""
    if part.HasField("oneof_index") or part.proto3_optional or part.label == _REQUIRED:
        return False
    if file.syntax == "proto3":
        return True
    if file.syntax != "editions":
        return False
    of_part, of_file = part.options.features, file.options.features
    presence = of_part.field_presence or of_file.field_presence
    return bool(presence == 2)


def _recursive(name: str, descriptor: Any, types: dict[str, tuple[Any, Any]]) -> bool:
    """Whether a message type contains itself; such trees hold no samples and are left out."""
    visited: set[str] = set()
    stack = [descriptor]
    while stack:
        for part in stack.pop().field:
            if part.type == _MESSAGE_TYPE and part.type_name not in visited:
                if part.type_name == name:
                    return True
                visited.add(part.type_name)
                if part.type_name in types:
                    stack.append(types[part.type_name][0])
    return False
