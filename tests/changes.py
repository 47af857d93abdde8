"""Every record that differs from another in one thing: found from the kinds of its fields alone.

A field that is added to a record is changed here without a word.
"""

from __future__ import annotations

import math
import types
import typing
from collections.abc import Iterator, Mapping
from dataclasses import MISSING, fields, is_dataclass, replace
from functools import cache
from typing import Any, Literal, Union, get_args, get_origin

import numpy as np
import polars as pl

from pipeline.records.errors import PipelineError

Change = tuple[str, Any]
"""Where the change is (`entries.0.source.fields.0.unit`), and the whole value with it."""
NOT_ALLOWED = (ValueError, PipelineError)


def changes(value: Any, kind: Any = Any, at: str = "") -> Iterator[Change]:
    """Values that differ in one thing; raises TypeError for what it knows no change of."""
    if is_dataclass(value):
        yield from _of_record(value, at)
        return
    if _may_be_none(kind) and value is not None:
        yield at, None
    if isinstance(value, Mapping):
        yield from _of_map(value, kind, at)
    elif isinstance(value, (tuple, list)):
        yield from _of_sequence(value, kind, at)
    elif isinstance(value, pl.DataFrame):
        yield from _of_table(value, at)
    elif isinstance(value, np.ndarray):
        flipped = value.copy()
        flipped[0] = not flipped[0] if value.dtype == bool else flipped[0] + 1
        yield at, flipped
    else:
        yield from ((at, other) for other in _of_scalar(value, kind))


def _of_record(record: Any, at: str) -> Iterator[Change]:
    hints = _hints(type(record))
    for field in fields(record):
        place = f"{at}.{field.name}".strip(".")
        count = 0
        for where, other in changes(getattr(record, field.name), hints[field.name], place):
            try:
                made = replace(record, **{field.name: other})
            except NOT_ALLOWED:
                continue
            count += 1
            yield where, made
        if not count:
            raise TypeError(f"{type(record).__name__}.{field.name}: no change of it is known")


def _of_map(value: Mapping[str, Any], kind: Any, at: str) -> Iterator[Change]:
    inner = get_args(kind)[1] if len(get_args(kind)) == 2 else Any
    yield f"{at}.+", {**value, "added": sample(inner)}
    for key in value:
        rest = {k: v for k, v in value.items() if k != key}
        yield f"{at}.-{key}", rest
        yield f"{at}.~{key}", {**rest, f"{key}x": value[key]}
        for where, other in changes(value[key], inner, f"{at}.{key}"):
            yield where, {**value, key: other}


def _of_sequence(value: Any, kind: Any, at: str) -> Iterator[Change]:
    kinds = get_args(_of(kind))
    inner = kinds[0] if kinds else Any
    make = type(value)
    if not kinds or kinds[-1] is Ellipsis or make is list:
        extra = value[-1] if value else sample(inner)
        yield f"{at}.+", make([*value, extra])
        if value:
            yield f"{at}.-", make(value[:-1])
        if len(value) > 1:
            yield f"{at}.order", make([*value[1:], value[0]])
    for number, item in enumerate(value):
        own = inner if not kinds or kinds[-1] is Ellipsis or make is list else kinds[number]
        for where, other in changes(item, own, f"{at}.{number}"):
            yield where, make([*value[:number], other, *value[number + 1 :]])


def _of_table(table: pl.DataFrame, at: str) -> Iterator[Change]:
    yield f"{at}.rows", table.head(table.height - 1)
    yield f"{at}.order", table.reverse()
    yield f"{at}.columns", table.select(reversed(table.columns))
    for name in table.columns:
        column = table[name]
        yield f"{at}.-{name}", table.drop(name)
        yield f"{at}.~{name}", table.rename({name: f"{name}x"})
        yield f"{at}.{name}.kind", table.with_columns(column.cast(pl.Float32))
        last = np.nextafter(column[-1], math.inf)
        for word, other in (("ulp", last), ("nan", math.nan), ("none", None), ("-0", -0.0)):
            values = pl.Series(name, [*column[:-1], other], column.dtype)
            yield f"{at}.{name}.{word}", table.with_columns(values)


def _of_scalar(value: Any, kind: Any) -> Iterator[Any]:
    kind = _of(kind)
    if get_origin(kind) is Literal:
        yield from (other for other in get_args(kind) if other != value)
    elif value is None:
        yield sample(kind)
    elif isinstance(value, bool):
        yield not value
    elif isinstance(value, int):
        yield value + 1
    elif isinstance(value, float):
        yield math.nextafter(value, math.inf)
        yield -value - 1.0
    elif isinstance(value, str):
        yield f"{value} "
        yield f"x{value}"
    else:
        raise TypeError(f"{type(value).__name__}: no change of it is known")


def sample(kind: Any) -> Any:
    """Some value of a kind."""
    kind = _of(kind)
    origin, inner = get_origin(kind) or kind, get_args(kind)
    if origin is Literal:
        return inner[0]
    if is_dataclass(kind) and isinstance(kind, type):
        hints = _hints(kind)
        needed = [f.name for f in fields(kind) if f.default is f.default_factory is MISSING]
        return kind(**{name: sample(hints[name]) for name in needed})
    if origin is tuple:
        several = inner[-1] is Ellipsis
        return tuple(sample(one) for one in (inner[:-1] if several else inner))
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return {"sample": sample(inner[1])}
    plain = {str: "sample", int: 1, float: 1.5, bool: True, Any: 1.5, list: [1.5], object: 1.5}
    return plain[origin]


def _of(kind: Any) -> Any:
    """The kind itself of one that may also be None."""
    if get_origin(kind) in (Union, types.UnionType):
        return next(one for one in get_args(kind) if one is not type(None))
    return kind


def _may_be_none(kind: Any) -> bool:
    return get_origin(kind) in (Union, types.UnionType) and type(None) in get_args(kind)


@cache
def _hints(kind: type) -> Mapping[str, Any]:
    return typing.get_type_hints(kind, localns={"pl": pl})
