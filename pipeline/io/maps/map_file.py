"""Source maps from YAML files, every key checked."""

from __future__ import annotations

import difflib
import re
from collections.abc import Mapping
from dataclasses import fields
from pathlib import Path
from typing import Any, get_args

from pipeline.io.maps.section import Section
from pipeline.io.maps.source_map import (
    FieldMap,
    MessageForm,
    Pairs,
    Part,
    SourceMap,
    TimeFrom,
    TimeMap,
    column_of,
)
from pipeline.io.maps.units import COUNTS, FOREIGN_UNITS, normal_unit
from pipeline.io.storage.plain_yaml import load_plain
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect
from pipeline.physics.glossary import COLUMNS
from pipeline.records.errors import CaptureError, UsageError


def load_source_maps(folder: Path) -> dict[str, SourceMap]:
    """All maps of a folder by name.

    Parameters
    ----------
    folder
        The folder.

    Raises
    ------
    UsageError
        There is no such folder, or a map is wrong; the message names file and key.

    """
    if not folder.is_dir():
        raise UsageError(f"there is no folder of source maps {folder}", "check the configuration")
    maps: dict[str, SourceMap] = {}
    for path in sorted(folder.glob("*.yaml")):
        maps |= load_source_file(path)
    return maps


def load_source_file(path: Path) -> dict[str, SourceMap]:
    """The maps of one file.

    Parameters
    ----------
    path
        The YAML file.

    Returns
    -------
    dict of SourceMap
        Under the name of the file, or its variants as NAME/1, NAME/2, ...

    Raises
    ------
    UsageError
        It cannot be read, or is wrong.

    """
    try:
        content = path.read_bytes()
    except OSError as fault:
        raise UsageError(f"the source map {path} cannot be read: {fault}", "check it") from fault
    return parse_source_file(content, path.stem)


def parse_source_file(data: bytes, name: str) -> dict[str, SourceMap]:
    """The maps of one YAML file by name.

    Parameters
    ----------
    data
        Content of the file.
    name
        Name of the map.

    Returns
    -------
    dict of SourceMap
        Each item of `variants` is laid over the other keys of the file, a map over a map key by
        key.

    Raises
    ------
    UsageError
        The file is wrong; the message names the key.

    """
    plain = _plain(data, name)
    variants = plain.pop("variants", None) if isinstance(plain, dict) else None
    if variants is None:
        return {name: _parsed(plain, name)}
    if not isinstance(variants, list) or not variants:
        raise UsageError(f"source map {name}: variants: is no list", "write `- recognise: ...`")
    maps = {}
    for place, variant in enumerate(variants, 1):
        label = f"{name}/{place}"
        if not isinstance(variant, dict):
            raise UsageError(f"source map {label}: is no map of keys", "write `key: value` lines")
        maps[label] = _parsed(laid_over(plain, variant), label)
    return maps


def laid_over(base: Mapping[str, Any], top: Mapping[str, Any]) -> dict[str, Any]:
    """The keys of two maps, those of the upper one first.

    Parameters
    ----------
    base
        The lower map.
    top
        The upper map; a map over a map is laid key by key.

    """
    nested = {
        key: {**base[key], **value}
        for key, value in top.items()
        if isinstance(value, dict) and isinstance(base.get(key), dict)
    }
    return {**base, **top, **nested}


def _plain(data: bytes, name: str) -> Any:
    try:
        return load_plain(data, f"the source map {name}")
    except CaptureError as fault:
        raise UsageError(fault.message, fault.remedy) from None


def _parsed(plain: Any, name: str) -> SourceMap:
    top = Section(name, "", plain)
    recognise = top.section("recognise")
    source = SourceMap(
        name,
        files=recognise.texts("files"),
        header=recognise.pattern("header"),
        topics=recognise.texts("topics"),
        layout=_layout(top.section("layout")),
        fields=_fields(top.section("fields")),
        time=_time(top.section("time")),
        messages=top.choice("messages", get_args(MessageForm), "auto"),
        joint=top.text("joint"),
        reader=top.text("reader"),
        metadata=_pairs(top.section("metadata")),
        per_file=_per_key(top.section("per_file")),
        file_names=_file_names(top),
        values=_per_key(top.section("values")),
        captures=tuple(_part(part, n) for n, part in enumerate(top.sections("captures"), 1)),
    )
    top.text("about")
    recognise.close()
    top.close()
    return source


def _layout(section: Section) -> CsvDialect:
    standard = CONTRACT_DIALECT
    values: dict[str, Any] = {}
    for part in fields(CsvDialect):
        default = getattr(standard, part.name)
        if part.name in ("header_match", "time_start", "time_increment"):
            values[part.name] = section.pattern(part.name)
        elif part.name == "names":
            values["names"] = section.texts("names") or None
        elif isinstance(default, bool):
            values[part.name] = section.flag(part.name, default)
        elif isinstance(default, int):
            values[part.name] = _whole(section, part.name, default)
        elif isinstance(default, tuple):
            values[part.name] = section.texts(part.name)
        else:
            text = section.text(part.name)
            values[part.name] = default if text is None else text
    section.close()
    return _readable(values, section)


def _readable(values: dict[str, Any], section: Section) -> CsvDialect:
    """The layout, where a table can be read by it."""
    for key in ("separator", "decimal"):
        values[key] = {"tab": "\t", "space": " "}.get(values[key], values[key])
        if len(values[key].encode()) != 1:
            raise section.fault(key, "is not one character", "write one, `tab` or `space`")
    if values["separator"] == values["decimal"]:
        raise section.fault("decimal", "is the separator too", "write two different characters")
    layout = CsvDialect(**values)
    if layout.units_row and not layout.skip_after_header:
        raise section.fault("units_row", "is not skipped", "write `skip_after_header: 1` or more")
    return layout


def _whole(section: Section, key: str, default: int) -> int:
    number = section.number(key, default)
    if number is None or number != int(number) or not 0 <= number <= 10_000:
        raise section.fault(key, "is no whole number from 0 to 10000", "count the lines")
    return int(number)


def _fields(section: Section) -> tuple[FieldMap, ...]:
    fields: list[FieldMap] = []
    for name in list(section.remaining):
        plain = section.take(name)
        plain = {"column": plain} if isinstance(plain, str) else plain
        part = Section(section.source, f"fields.{name}", plain)
        column = part.text("column")
        if column not in COLUMNS:
            close = difflib.get_close_matches(column or "", list(COLUMNS), 3)
            hint = f"did you mean {', '.join(close)}?" if close else f"one of {', '.join(COLUMNS)}"
            raise part.fault("column", f"{column!r} is no column of the contract", hint)
        sign = part.number("sign", 1.0)
        if sign not in (1.0, -1.0):
            raise part.fault("sign", "is neither 1 nor -1", "put a factor into `scale`")
        scale, offset = part.number("scale", 1.0), part.number("offset", 0.0)
        if not scale:
            raise part.fault("scale", "is zero", "write the factor")
        unit, per_pole_pair = part.text("unit"), part.flag("per_pole_pair", False)
        if unit and normal_unit(unit) == COUNTS and scale == 1.0:
            raise part.fault("unit", "counts have no size", "write what one is into `scale`")
        wraps, times = _positive(part, "wraps"), part.text("times")
        fields.append(
            FieldMap(name, column, unit, sign, scale, offset or 0.0, per_pole_pair, wraps, times)
        )
        part.close()
    known = {one.field for one in fields if one.column != "t_s" and one.times is None}
    for one in fields:
        if one.times is not None and one.times not in known:
            raise Section(section.source, f"fields.{one.field}", {}).fault(
                "times", f"{one.times!r} is no field of the map", "map that field to its column"
            )
    return tuple(fields)


def _time(section: Section) -> TimeMap:
    time = TimeMap(
        section.choice("from", get_args(TimeFrom), "field"),
        _positive(section, "wraps_at"),
        section.number("start_s", 0.0) or 0.0,
        _positive(section, "increment_s"),
    )
    section.close()
    return time


def _positive(section: Section, key: str) -> float | None:
    value = section.number(key, None)
    if value is not None and value <= 0:
        raise section.fault(key, "is not above zero", "write a positive number")
    return value


def _pairs(section: Section) -> Pairs:
    return tuple((key, section.text(key) or "") for key in list(section.remaining))


def _per_key(section: Section) -> tuple[tuple[str, Pairs], ...]:
    return tuple((key, _pairs(section.section(key))) for key in list(section.remaining))


def _file_names(section: Section) -> tuple[str, ...]:
    """The patterns of file names; each has a named group."""
    patterns = section.patterns("file_names")
    for pattern in patterns:
        if not re.compile(pattern).groupindex:
            remedy = "write `(?P<motor_id>...)` around what is metadata"
            raise section.fault("file_names", f"{pattern!r} has no named group", remedy)
        for column, unit, _ in filter(None, map(column_of, re.compile(pattern).groupindex)):
            known = FOREIGN_UNITS.get(COLUMNS[column].unit, {})
            if normal_unit(unit) not in known:
                remedy = f"write one of {', '.join(n for n in known if n.isidentifier())}"
                raise section.fault("file_names", f"{unit!r} is no unit of {column}", remedy)
    return patterns


def _part(section: Section, number: int) -> Part:
    """A capture cut from a file: `rows: 0-4999`, `rows: 5000-`, or `fields` of its own.

    Other keys are its metadata.
    """
    files, fields = section.texts("files"), _fields(section.section("fields"))
    rows = section.text("rows") or ("0-" if fields else "")
    match = re.fullmatch(r"(\d{1,12})-(\d{1,12})?", rows.replace(" ", ""))
    if match is None or (match[2] and int(match[2]) <= int(match[1])):
        raise section.fault("rows", f"{rows!r} is no range of rows", "write `0-4999` or `5000-`")
    last = int(match[2]) if match[2] else None
    return Part(files, int(match[1]), last, _pairs(section), fields, number)


def find_maps(maps: Mapping[str, SourceMap], name: str) -> dict[str, SourceMap]:
    """The map of a name, or all its variants.

    Parameters
    ----------
    maps
        Maps by name.
    name
        Name of a map.

    Raises
    ------
    UsageError
        There is none; the message names those that there are.

    """
    chosen = {key: one for key, one in maps.items() if key == name or key.startswith(f"{name}/")}
    if not chosen:
        known = dict.fromkeys(key.partition("/")[0] for key in maps)
        raise UsageError(f"there is no source map {name!r}", f"use one of {', '.join(known)}")
    return chosen
