"""Readers of foreign file forms: one file each in `readers/`, named by a source map."""

from __future__ import annotations

import importlib
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from types import ModuleType

from pipeline.io.tables.raw_table import RawTable
from pipeline.plugins import discover
from pipeline.records.errors import CaptureError, UsageError


@dataclass(frozen=True, slots=True)
class Reader:
    """How one foreign form becomes raw tables, one a clock.

    read(data): the tables of the file's bytes; raises CaptureError. metadata(data): what the file
    itself says, as texts, under the contract's keys. suffixes: those of the form's files, by
    which `inspect` knows them.
    """

    name: str
    read: Callable[[bytes], Sequence[RawTable]]
    metadata: Callable[[bytes], Mapping[str, str]] = lambda _: {}
    suffixes: tuple[str, ...] = ()


def library(module: str, extra: str) -> ModuleType:
    """An optional library.

    Parameters
    ----------
    module
        Its name.
    extra
        The extra of this package that brings it.

    Raises
    ------
    CaptureError
        It is not installed; the remedy names the extra.

    """
    try:
        return importlib.import_module(module)
    except ImportError:
        raise CaptureError(
            "missing_library",
            f"reading it takes {module.split('.', maxsplit=1)[0]}, which is not installed",
            f"pip install 'motor-datasheets[{extra}]'",
        ) from None


@cache
def readers() -> dict[str, Reader]:
    """Every reader by name."""
    return {one.name: one.value for one in discover("pipeline.io.readers", "READER", Reader)}


def find_reader(name: str) -> Reader:
    """The reader of a name.

    Parameters
    ----------
    name
        Name of the plug-in.

    Raises
    ------
    UsageError
        There is none; the message names those that there are.

    """
    known = readers()
    if name not in known:
        raise UsageError(f"there is no reader {name!r}", f"use one of {', '.join(known)}")
    return known[name]


def table_names(readers_named: Iterable[str | None], data: bytes) -> list[str]:
    """Names of a file's tables.

    Parameters
    ----------
    readers_named
        Names of readers; the first that is not None is used.
    data
        Content of the file.

    Returns
    -------
    list of str
        Empty where no reader is named.

    """
    name = next((one for one in readers_named if one), None)
    return [] if name is None else [table.name for table in find_reader(name).read(data)]
