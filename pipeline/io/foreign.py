"""Readers of foreign file forms: one file each in `readers/`, named by a source map."""

from __future__ import annotations

import importlib
import pkgutil
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cache

from pipeline.io import readers as readers_room
from pipeline.io.raw_table import RawTable
from pipeline.records.errors import UsageError


@dataclass(frozen=True, slots=True)
class Reader:
    """How one foreign form becomes a raw table.

    read(data): the table of the file's bytes; raises CaptureError. metadata(data): what the file
    itself says, as texts, under the contract's keys.
    """

    name: str
    read: Callable[[bytes], RawTable]
    metadata: Callable[[bytes], Mapping[str, str]]


@cache
def readers() -> dict[str, Reader]:
    """Every reader by name."""
    found: dict[str, Reader] = {}
    for name in sorted(m.name for m in pkgutil.iter_modules(readers_room.__path__)):
        reader = importlib.import_module(f"{readers_room.__name__}.{name}").READER
        found[reader.name] = reader
    return found


def find_reader(name: str) -> Reader:
    """The reader of a name; raises UsageError naming the known ones."""
    known = readers()
    if name not in known:
        raise UsageError(f"there is no reader {name!r}", f"use one of {', '.join(known)}")
    return known[name]
