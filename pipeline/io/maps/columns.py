"""Raw tables into the contract's columns: names, units and signs are settled here, once."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace
from fnmatch import fnmatchcase
from typing import Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pipeline.io.maps.source_map import FieldMap, SourceMap
from pipeline.io.maps.units import scale_of
from pipeline.io.tables.raw_table import RawTable
from pipeline.physics.glossary import COLUMNS, suffix_of
from pipeline.records.errors import CaptureError

Array = NDArray[np.float64]

JOINT_COLUMNS = {
    "position": "theta_mech_rad",
    "velocity": "omega_mech_rad_s",
    "effort": "torque_shaft_nm",
}
_BRACKET = re.compile(r"^(.*?)\s*[(\[](.*)[)\]]$")
_NANOSECONDS_A_SECOND = 1e9
_STAMP = "stamp"
"""Among the fields of clocks, the stamp of a message."""


def last_part(name: str) -> str:
    """The name of a field without the messages that it is nested in.

    Parameters
    ----------
    name
        Such as `state.motor.ia_a`.

    """
    return name.rsplit(".", 1)[-1]


def foreign_unit(name: str) -> str | None:
    """The contract column that a name means except for its unit.

    Parameters
    ----------
    name
        Such as `ia_ma`, which means `ia_a`.

    Returns
    -------
    str or None
        None where it means none.

    """
    unit = last_part(name).lower()
    bracket = _BRACKET.match(unit)
    stem = bracket[1].strip() if bracket else unit.rpartition("_")[0]
    for column in COLUMNS:
        suffix = suffix_of(column)
        if stem and unit != column and stem in (column, column.removesuffix(f"_{suffix}")):
            return column
    return None


def contract_fields(names: Sequence[str], joint_state: bool) -> list[FieldMap]:
    """The contract's own columns among the fields of a table.

    Parameters
    ----------
    names
        Names of the fields; nested ones count by their last part.
    joint_state
        Whether they are of a ROS JointState, whose fields have names of their own.

    Returns
    -------
    list of FieldMap
        In the order of the names.

    Raises
    ------
    CaptureError
        A column has a foreign unit, or two fields claim it.

    """
    fields: dict[str, FieldMap] = {}
    for name in names:
        column = last_part(name)
        if joint_state:
            column = JOINT_COLUMNS.get(name, column)
        if column not in COLUMNS:
            meant = foreign_unit(name)
            if meant is not None and meant not in map(last_part, names):
                raise CaptureError(
                    "unknown_unit",
                    f"the field {name!r} is not in the contract's unit, {COLUMNS[meant].unit}",
                    f"write {meant} [{COLUMNS[meant].unit}], or add a source map that converts it",
                )
            continue
        if column in fields:
            raise CaptureError(
                "duplicate_column",
                f"the fields {fields[column].field!r} and {name!r} are both {column}",
                "choose one of them with a source map",
            )
        fields[column] = FieldMap(name, column)
    return list(fields.values())


def mapped_fields(names: Sequence[str], source: SourceMap) -> list[FieldMap]:
    """The map's fields that are there, each under the name it has in the file.

    Parameters
    ----------
    names
        Fields of the file.
    source
        The map; a `*` in one of its fields is any text, where no field has that very name.

    Returns
    -------
    list of FieldMap
        In the map's order.

    Raises
    ------
    CaptureError
        A field of the map could be several of the file, or two become one column
        (`duplicate_column`).

    """
    by_last: dict[str, list[str]] = {}
    for name in names:
        by_last.setdefault(last_part(name), []).append(name)
    fields: list[FieldMap] = []
    for part in source.fields:
        matches = [part.field] if part.field in names else by_last.get(part.field, [])
        if not matches and "*" in part.field:
            matches = [name for name in names if is_field(part.field, name)]
        if len(matches) > 1:
            raise CaptureError(
                "duplicate_column",
                f"{part.field!r} could be {' or '.join(matches)}",
                "write the full name into the source map",
            )
        fields += [replace(part, field=name) for name in matches]
    columns = [part.column for part in fields]
    twice = next((part for part in fields if columns.count(part.column) > 1), None)
    if twice is not None:
        raise CaptureError(
            "duplicate_column",
            f"two fields of the file become {twice.column}",
            "keep one of them in the source map",
        )
    return fields


def is_field(field: str, name: str) -> bool:
    """Whether a name in a file is the field that a map names.

    Parameters
    ----------
    field
        As in the map; `*` is any text.
    name
        In the file.

    """
    if field in (name, last_part(name)):
        return True
    return "*" in field and fnmatchcase(name, re.sub(r"[\[?]", "[\\g<0>]", field))


def common_starts(tables: Sequence[RawTable], source: SourceMap | None) -> dict[str, int]:
    """What the whole-number clocks of a capture's tables count from, so that tables stay in step.

    Parameters
    ----------
    tables
        Fields by their own names.
    source
        The source map; None for the contract's own form.

    Returns
    -------
    dict of str to int
        The first reading of all tables, by the clock's field.

    """
    starts: dict[str, int] = {}
    for table in tables:
        clock = next((one for one in _chosen(table, source) if one.column == "t_s"), None)
        if source is not None and source.time.origin == "stamp":
            name, counts = _STAMP, table.stamp_ns
        else:
            name, counts = ("", None) if clock is None else (clock.field, table.fields[clock.field])
        if counts is not None and counts.size and counts.dtype.kind in "iu":
            first = int(counts[0])
            starts[name] = min(first, starts.get(name, first))
    return starts


def to_frame(
    table: RawTable,
    source: SourceMap | None,
    pole_pairs: int | None = None,
    starts: Mapping[str, int] | None = None,
    *,
    timed: bool = True,
) -> pl.DataFrame | None:
    """The contract's columns of one table.

    Parameters
    ----------
    table
        Fields by their own names.
    source
        The source map; None for the contract's own form.
    pole_pairs
        Of the nameplate, for fields that a drive logs in electrical terms.
    starts
        Of `common_starts`; None for a table by itself.
    timed
        Whether the test needs a clock; blocks of a test without one have no times of their own.

    Returns
    -------
    DataFrame or None
        `t_s` first, float64, in SI units; None where it holds no column.

    Raises
    ------
    CaptureError
        A unit, the time, or a duplicate column cannot be settled.

    """
    chosen = _chosen(table, source)
    columns = {
        part.column: _converted(
            table.fields[part.field], _mechanical(part, pole_pairs), dict(table.units)
        )
        for part in chosen
        if part.column != "t_s"
    }
    if not columns:
        return None
    named = {part.field: part.column for part in chosen}
    for part in (part for part in chosen if part.times is not None):
        columns[part.column] = columns[part.column] * columns[_factor(part, named)]
    clock = next((part for part in chosen if part.column == "t_s"), None)
    starts = common_starts((table,), source) if starts is None else starts
    time = _time(table, clock, source, starts, timed)
    if time is not None:
        columns = {"t_s": time} | columns
    frame = pl.DataFrame(columns)
    return frame if source is None else _without_blank_rows(frame)


def _chosen(table: RawTable, source: SourceMap | None) -> list[FieldMap]:
    """The fields of a table that are columns."""
    names = list(table.fields)
    if source is None:
        return contract_fields(names, table.joint_state)
    return mapped_fields(names, source)


def _factor(part: FieldMap, named: Mapping[str, str]) -> str:
    """The column that a field is a share of; raises CaptureError where the file lacks it."""
    if part.times is None or part.times not in named:
        words = f"{part.field!r} is a share of {part.times!r}, which the file lacks"
        raise CaptureError("missing_column", words, "log it too, or state its size as `scale`")
    return named[part.times]


def _without_blank_rows(frame: pl.DataFrame) -> pl.DataFrame:
    """The rows of a foreign table that hold a number at all."""
    blank = np.all([np.isnan(frame[name].to_numpy()) for name in frame.columns], axis=0)
    return frame.filter(~blank) if blank.any() else frame


def _mechanical(part: FieldMap, pole_pairs: int | None) -> FieldMap:
    """The field map with the pole pairs worked into its scale."""
    if not part.per_pole_pair:
        return part
    if pole_pairs is None:
        raise CaptureError(
            "missing_metadata",
            f"{part.field} counts electrical turns, and nothing states pole_pairs",
            "state pole_pairs in the metadata, beside the file or in the source map",
        )
    return replace(part, scale=part.scale / pole_pairs)


def _converted(values: NDArray[Any], part: FieldMap, units: Mapping[str, str]) -> Array:
    """Values in the column's unit, infinite where no double holds one, which is a reading that is
    missing; raises CaptureError for complex ones.
    """
    if np.iscomplexobj(values):
        words = f"the field {part.field!r} holds complex numbers"
        remedy = "write its real and imaginary parts as two fields"
        raise CaptureError("bad_number", words, remedy)
    numbers = values.astype(np.float64, copy=False)
    if part.wraps is not None and part.column != "t_s":
        numbers = np.unwrap(numbers, period=part.wraps)
    unit = units.get(part.field) if part.unit == "row" else part.unit
    if part.unit == "row" and not unit:
        words = f"the file states no unit for {part.field!r}"
        raise CaptureError("unknown_unit", words, "write its unit into the source map")
    factor, shift = part.sign * part.scale, part.offset
    if unit is not None:
        scale = scale_of(unit, part.column)
        shift += factor * scale.shift
        factor *= scale.factor
    with np.errstate(over="ignore"):
        if factor != 1.0:
            numbers = numbers * factor
        return numbers + shift if shift else numbers


def _time(
    table: RawTable,
    clock: FieldMap | None,
    source: SourceMap | None,
    starts: Mapping[str, int],
    timed: bool,
) -> Array | None:
    origin = "field" if source is None else source.time.origin
    if origin == "increment" and source is not None:
        return _counted(table.rows, source.time.start_s, source.time.increment_s)
    if origin in ("field", "even") and clock is not None:
        time = _from_field(table, clock, source, starts)
        return _even(time) if origin == "even" else time
    clock_ns: NDArray[Any] | None = table.log_time_ns
    if origin == "stamp":
        if table.stamp_ns is None:
            words = f"the messages of {table.name} hold no stamp of seconds and nanoseconds"
            raise CaptureError("missing_time", words, "use `from: log`")
        clock_ns = table.stamp_ns - starts.get(_STAMP, 0)
    if clock_ns is None:
        return None
    time = clock_ns / _NANOSECONDS_A_SECOND
    if not table.blocks:
        return time
    increment = None if source is None else source.time.increment_s
    if increment is None and not timed:
        return None
    if increment is None:
        raise CaptureError(
            "missing_time",
            f"the blocks of {table.name} hold no t_s",
            "write t_s into every block, or state `increment_s` in a source map",
        )
    return time + increment * _place_in_block(clock_ns)


def _even(time: Array) -> Array:
    """The straight line through rounded times [s]; a gap that rounding cannot explain is refused.

    The printed times carry three digits or more, so each lies within 0.5 % of the line.
    """
    if time.size < 3 or not np.isfinite(time).all():
        return time
    row = np.arange(time.size, dtype=np.float64)
    row -= row.mean()
    step = float(row @ time / (row @ row))
    line: Array = time.mean() + step * row
    off = np.abs(time - line) > 0.006 * np.abs(time) + abs(step)
    if step <= 0 or off.any():
        first = int(np.argmax(off))
        raise CaptureError(
            "uneven_time",
            "the times do not lie on one straight line",
            "use `from: field` if the samples are not evenly spaced",
            (first, first),
        )
    return line


def _counted(rows: int, start_s: float, increment_s: float | None) -> Array:
    if increment_s is None:
        raise CaptureError(
            "missing_time",
            "no sampling increment is known",
            "state `increment_s`, or `layout.time_increment` where the file says it",
        )
    return start_s + increment_s * np.arange(rows, dtype=np.float64)


def _place_in_block(clock_ns: NDArray[np.integer[Any]]) -> Array:
    """Number of each row within its block [rows]; rows of one block share their time."""
    first = np.flatnonzero(np.append(True, clock_ns[1:] != clock_ns[:-1]))
    size = np.diff(np.append(first, clock_ns.size))
    place: Array = np.arange(clock_ns.size, dtype=np.float64)
    return place - np.repeat(first, size)


def _from_field(
    table: RawTable, clock: FieldMap, source: SourceMap | None, starts: Mapping[str, int]
) -> Array:
    """Time from a field; whole-number clocks count from their first row, so no digit is lost."""
    values = table.fields[clock.field]
    if clock.field in starts:
        values = (values - values.dtype.type(starts[clock.field])).astype(np.int64)
    wraps_at = clock.wraps or (None if source is None else source.time.wraps_at)
    if wraps_at is not None:
        numbers = values.astype(np.float64)
        steps = np.diff(numbers, prepend=numbers[:1])
        values = numbers + wraps_at * np.cumsum(steps < -wraps_at / 2)
    return _converted(values, clock, dict(table.units))
