"""The digest of values in memory: records, tables and arrays by what they hold."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Set
from dataclasses import fields, is_dataclass
from pathlib import PurePath
from typing import Any

import numpy as np


def content_digest(value: Any) -> str:
    """sha256 of all that a value holds, the same in every process.

    Parameters
    ----------
    value
        None, text, numbers, lists, tuples, sets and maps with text for keys, of these or of
        records (dataclasses), paths, numpy arrays and polars tables. Of a record every field
        counts; of a table the order, names and kinds of its columns, what is missing, and every
        bit of the numbers; of a map not the order.

    Raises
    ------
    TypeError
        For anything else: what cannot be digested must not be left out.

    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), default=_plain)
    return hashlib.sha256(text.encode("ascii")).hexdigest()


def _plain(value: Any) -> Any:
    """What JSON has no form for, as lists that begin with its kind."""
    if is_dataclass(value) and not isinstance(value, type):
        own = [[field.name, getattr(value, field.name)] for field in fields(value)]
        return ["record", type(value).__name__, own]
    if isinstance(value, PurePath):
        return ["path", value.as_posix()]
    if isinstance(value, Set):
        return ["set", sorted(content_digest(item) for item in value)]
    if isinstance(value, Mapping):
        return dict(value)
    return _numbers(value)


def _numbers(value: Any) -> Any:
    """The form of arrays, of numpy's own numbers and of tables."""
    if isinstance(value, np.ndarray):
        return ["array", value.dtype.str, list(value.shape), _bytes_digest(value)]
    if isinstance(value, np.generic):
        return value.item()
    if hasattr(value, "iter_columns"):
        return ["table", value.height, [_column(column) for column in value.iter_columns()]]
    raise TypeError(f"{type(value).__name__} has no digest")


def _column(column: Any) -> list[Any]:
    """Name, kind, missing rows and values of one column of a table."""
    missing = _bytes_digest(column.is_null().to_numpy()) if column.null_count() else None
    values = column.to_numpy()
    values_form = column.to_list() if values.dtype.hasobject else _bytes_digest(values)
    return [column.name, str(column.dtype), missing, values_form]


def _bytes_digest(array: np.ndarray[Any, Any]) -> str:
    if array.dtype.hasobject:
        raise TypeError("an array of objects has no digest")
    return hashlib.sha256(np.ascontiguousarray(array).data).hexdigest()
