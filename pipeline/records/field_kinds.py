"""Kinds of fields: what a record's annotation adds to its type for the published JSON Schema.

Python and `record_of` see the bare type. `contracts.json_schema` reads the limits.
"""

from __future__ import annotations

from typing import Annotated, Any, NamedTuple, TypeVar

Field = TypeVar("Field")


class Keyword(NamedTuple):
    """A keyword of JSON Schema with its value, such as `minimum` and 0."""

    name: str
    value: Any


EXTENSION = "extension"
"""Marks a key beyond the contract: it is written, and a reader may do without it."""

Extension = Annotated[Field, EXTENSION]
Spread = Annotated[float, Keyword("minimum", 0)]
Share = Annotated[float, Keyword("minimum", 0), Keyword("maximum", 1)]
SpreadOrNull = Annotated[float, Keyword("minimum", 0), Keyword("type", ["number", "null"])]
"""Infinity is written as null."""
ShareOrNull = Annotated[Share, Keyword("type", ["number", "null"])]
"""NaN is written as null."""
Count = Annotated[int, Keyword("minimum", 0)]
Name = Annotated[str, Keyword("minLength", 1)]
Sha256 = Annotated[str, Keyword("pattern", "^[0-9a-f]{64}$")]
