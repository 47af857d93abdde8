"""Source maps: a bench's names, units, signs and file layout, in YAML and checked before use."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any, Literal, get_args

from pipeline.io.storage.plain_yaml import load_plain
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect
from pipeline.physics.glossary import COLUMNS
from pipeline.records import parse
from pipeline.records.errors import CaptureError, UsageError

TimeFrom = Literal["field", "even", "log", "increment"]
MessageForm = Literal["auto", "row", "block"]
_MAX_PATTERN = 500


@dataclass(frozen=True, slots=True)
class FieldMap:
    """One foreign field: column = sign * scale * (value in `unit`, converted) + offset.

    `unit` None is the column's own unit; `row` takes what the file's units row says.
    `per_pole_pair` divides by the metadata's pole pairs, for a drive that logs electrical speed.
    """

    field: str
    column: str
    unit: str | None = None
    sign: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    per_pole_pair: bool = False


@dataclass(frozen=True, slots=True)
class TimeMap:
    """Where t_s comes from: a mapped field, the log clock, or start + increment * row.

    `even` is a field whose digits do not part neighbouring samples: the rows are evenly spaced
    along the straight line through it.
    `wraps_at` is the value, in the field's unit, at which a clock starts again from zero.
    `start_s` and `increment_s` [s] stand in where the layout does not find them in the file; an
    increment with the log clock parts the rows of one block.
    """

    origin: TimeFrom = "field"
    wraps_at: float | None = None
    start_s: float = 0.0
    increment_s: float | None = None


TIME_FROM_FIELD = TimeMap()


@dataclass(frozen=True, slots=True)
class SourceMap:
    """How to recognise a bench's files and turn them into the contract's columns.

    `reader` names the plug-in that reads a form that is neither MCAP nor a text table.
    """

    name: str
    files: tuple[str, ...] = ()
    header: str | None = None
    topics: tuple[str, ...] = ()
    layout: CsvDialect = CONTRACT_DIALECT
    fields: tuple[FieldMap, ...] = ()
    time: TimeMap = TIME_FROM_FIELD
    messages: MessageForm = "auto"
    joint: str | None = None
    reader: str | None = None
    metadata: tuple[tuple[str, str], ...] = ()
    per_file: tuple[tuple[str, tuple[tuple[str, str], ...]], ...] = ()

    def recognises(self, path: str, head: str | None, topics: Iterable[str]) -> bool:
        """Whether a file is this bench's: every criterion that the map states must hold.

        `head` is the beginning of a text file, None for an MCAP file with `topics`.
        """
        if self.files and not self.recognises_name(path):
            return False
        if self.header is not None and (
            head is None or not re.search(self.header, head, re.MULTILINE)
        ):
            return False
        if self.topics and not any(
            fnmatchcase(topic, pattern) for topic in topics for pattern in self.topics
        ):
            return False
        return bool(self.files or self.header or self.topics)

    def recognises_name(self, path: str) -> bool:
        """Whether the file's name is one of those the map lists."""
        name = PurePosixPath(path).name
        return any(fnmatchcase(name, pattern) for pattern in self.files)

    def metadata_for(self, path: str) -> dict[str, str]:
        """Fixed metadata of one file; what is said of its name counts before the rest."""
        found = dict(self.metadata)
        name = PurePosixPath(path).name
        for pattern, values in reversed(self.per_file):
            if fnmatchcase(name, pattern):
                found |= dict(values)
        return {"contract": "1"} | found


def load_source_maps(folder: Path) -> dict[str, SourceMap]:
    """All maps of a folder by name; raises UsageError naming the file and the key at fault."""
    if not folder.is_dir():
        raise UsageError(f"there is no folder of source maps {folder}", "check the configuration")
    maps = (load_source_map(path) for path in sorted(folder.glob("*.yaml")))
    return {found.name: found for found in maps}


def load_source_map(path: Path) -> SourceMap:
    """One source map; its name is the file's. Raises UsageError."""
    try:
        data = path.read_bytes()
    except OSError as fault:
        raise UsageError(f"the source map {path} cannot be read: {fault}", "check it") from fault
    return parse_source_map(data, path.stem)


def parse_source_map(data: bytes, name: str) -> SourceMap:
    """A source map from its YAML bytes. Raises UsageError."""
    try:
        plain = load_plain(data, f"the source map {name}")
    except CaptureError as fault:
        raise UsageError(fault.message, fault.remedy) from None
    top = _Section(name, "", plain)
    recognise = top.section("recognise")
    found = SourceMap(
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
        per_file=_per_file(top.section("per_file")),
    )
    top.text("about")
    recognise.close()
    top.close()
    return found


class _Section:
    """One map of the YAML, read key by key; a key nobody asked for is an error."""

    def __init__(self, source: str, where: str, plain: Any) -> None:
        self.source = source
        self.where = where
        if plain is None or plain == "":
            plain = {}
        if not isinstance(plain, dict):
            raise self.fault("", "is no map of keys", "write `key: value` lines")
        self.left: dict[str, Any] = dict(plain)
        self.asked: list[str] = []

    def fault(self, key: str, what: str, remedy: str) -> UsageError:
        place = ".".join(part for part in (self.where, key) if part) or "the top"
        return UsageError(f"source map {self.source}: {place}: {what}", remedy)

    def take(self, key: str) -> Any:
        self.asked.append(key)
        return self.left.pop(key, None)

    def close(self) -> None:
        for key in self.left:
            near = difflib.get_close_matches(key, self.asked, 1)
            hint = f"did you mean {near[0]!r}?" if near else f"known keys: {', '.join(self.asked)}"
            raise self.fault(key, "is no key of a source map", hint)

    def section(self, key: str) -> _Section:
        inner = self.take(key)
        return _Section(self.source, f"{self.where}.{key}".strip("."), inner)

    def text(self, key: str) -> str | None:
        value = self.take(key)
        if value is not None and not isinstance(value, str):
            raise self.fault(key, "is not a single text", "write one value")
        return value

    def texts(self, key: str) -> tuple[str, ...]:
        value = self.take(key)
        value = [value] if isinstance(value, str) else value or []
        if not isinstance(value, list) or not all(isinstance(item, str) for item in value):
            raise self.fault(key, "is no list of texts", "write `[a, b]`")
        return tuple(value)

    def pattern(self, key: str) -> str | None:
        value = self.text(key)
        if value is None:
            return None
        try:
            if len(value) > _MAX_PATTERN:
                raise re.error("it is too long")
            re.compile(value)
        except (re.error, RecursionError, OverflowError) as fault:
            raise self.fault(key, f"is no regular expression: {fault}", "correct it") from None
        return value

    def number(self, key: str, default: float | None) -> float | None:
        value = self.text(key)
        if value is None:
            return default
        found = parse.number(value)
        if found is None:
            raise self.fault(key, f"{value[:60]!r} is no number", "write a number")
        return found

    def flag(self, key: str, default: bool) -> bool:
        value = self.text(key)
        if value is None:
            return default
        if value not in ("true", "false"):
            raise self.fault(key, f"{value!r} is neither true nor false", "write true or false")
        return value == "true"

    def choice(self, key: str, known: tuple[str, ...], default: str) -> Any:
        value = self.text(key)
        if value is not None and value not in known:
            raise self.fault(key, f"{value!r} is unknown", f"use one of {', '.join(known)}")
        return default if value is None else value


def _layout(section: _Section) -> CsvDialect:
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
    for key in ("separator", "decimal"):
        values[key] = {"tab": "\t", "space": " "}.get(values[key], values[key])
        if len(values[key].encode()) != 1:
            raise section.fault(key, "is not one character", "write one, `tab` or `space`")
    if values["separator"] == values["decimal"]:
        raise section.fault("decimal", "is the separator too", "write two different characters")
    return _readable(section, CsvDialect(**values))


def _readable(section: _Section, layout: CsvDialect) -> CsvDialect:
    """The layout; refuses one whose units row is among the rows."""
    if layout.units_row and not layout.skip_after_header:
        raise section.fault("units_row", "is not skipped", "write `skip_after_header: 1` or more")
    return layout


def _whole(section: _Section, key: str, default: int) -> int:
    number = section.number(key, default)
    if number is None or number != int(number) or not 0 <= number <= 10_000:
        raise section.fault(key, "is no whole number from 0 to 10000", "count the lines")
    return int(number)


def _fields(section: _Section) -> tuple[FieldMap, ...]:
    found: list[FieldMap] = []
    for name in list(section.left):
        plain = section.take(name)
        plain = {"column": plain} if isinstance(plain, str) else plain
        part = _Section(section.source, f"fields.{name}", plain)
        column = part.text("column")
        if column not in COLUMNS:
            near = difflib.get_close_matches(column or "", list(COLUMNS), 3)
            hint = f"did you mean {', '.join(near)}?" if near else f"one of {', '.join(COLUMNS)}"
            raise part.fault("column", f"{column!r} is no column of the contract", hint)
        sign = part.number("sign", 1.0)
        if sign not in (1.0, -1.0):
            raise part.fault("sign", "is neither 1 nor -1", "put a factor into `scale`")
        scale, offset = part.number("scale", 1.0), part.number("offset", 0.0)
        if not scale:
            raise part.fault("scale", "is zero", "write the factor")
        unit, per_pole_pair = part.text("unit"), part.flag("per_pole_pair", False)
        found.append(FieldMap(name, column, unit, sign, scale, offset or 0.0, per_pole_pair))
        part.close()
    return tuple(found)


def _time(section: _Section) -> TimeMap:
    found = TimeMap(
        section.choice("from", get_args(TimeFrom), "field"),
        section.number("wraps_at", None),
        section.number("start_s", 0.0) or 0.0,
        section.number("increment_s", None),
    )
    section.close()
    for key, value in (("wraps_at", found.wraps_at), ("increment_s", found.increment_s)):
        if value is not None and value <= 0:
            raise section.fault(key, "is not above zero", "write a positive number")
    return found


def _pairs(section: _Section) -> tuple[tuple[str, str], ...]:
    return tuple((key, section.text(key) or "") for key in list(section.left))


def _per_file(section: _Section) -> tuple[tuple[str, tuple[tuple[str, str], ...]], ...]:
    return tuple((pattern, _pairs(section.section(pattern))) for pattern in list(section.left))


def find_map(maps: Mapping[str, SourceMap], name: str) -> SourceMap:
    """The map of a name; raises UsageError naming the known ones."""
    if name not in maps:
        raise UsageError(f"there is no source map {name!r}", f"use one of {', '.join(maps)}")
    return maps[name]
