"""Source maps: a bench's names, units, signs and file layout, in YAML and checked before use."""

from __future__ import annotations

import difflib
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, fields
from fnmatch import fnmatchcase
from pathlib import Path, PurePosixPath
from typing import Any, Literal, get_args

from pipeline.io.maps.section import Section
from pipeline.io.maps.units import COUNTS, FOREIGN_UNITS, normal_unit, scale_to
from pipeline.io.storage.plain_yaml import load_plain
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect
from pipeline.physics.glossary import COLUMNS
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.parse import number

TimeFrom = Literal["field", "even", "log", "increment"]
MessageForm = Literal["auto", "row", "block"]
Pairs = tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class FieldMap:
    """One foreign field: column = sign · scale · (value in `unit`, converted) + offset.

    Attributes
    ----------
    field
        Name in the file; `*` is any text.
    column
        Column of the glossary.
    unit
        Foreign unit; None for the column's own, `row` for what the units row says.
    sign, scale, offset
        Of the conversion; the offset is in the column's unit.
    per_pole_pair
        Whether it is divided by the pole pairs of the metadata, for a drive that logs electrical
        speed.
    wraps
        Span after which a counter or an angle starts again [the field's own numbers]; a clock
        continues forwards, anything else by the shorter way.
    times
        Field of the map, in its column's unit, of which this one is a share; None for none.

    """

    field: str
    column: str
    unit: str | None = None
    sign: float = 1.0
    scale: float = 1.0
    offset: float = 0.0
    per_pole_pair: bool = False
    wraps: float | None = None
    times: str | None = None


@dataclass(frozen=True, slots=True)
class TimeMap:
    """Where `t_s` comes from.

    Attributes
    ----------
    origin
        A mapped field, the log clock, or start + increment · row; `even` is a field whose digits do
        not separate neighbouring samples, so that rows are evenly spaced along the straight line
        through it.
    wraps_at
        Value at which a clock starts again from zero [the field's unit].
    start_s, increment_s
        Used where the layout does not find them in the file [s]; an increment with the log clock
        separates the rows of one block.

    """

    origin: TimeFrom = "field"
    wraps_at: float | None = None
    start_s: float = 0.0
    increment_s: float | None = None


TIME_FROM_FIELD = TimeMap()


@dataclass(frozen=True, slots=True)
class Part:
    """Rows of a file that are one capture.

    Attributes
    ----------
    files
        Patterns of the files that are cut so.
    first, last
        Rows, counted from 0; None is the end of the file.
    metadata
        Of this capture.
    fields
        Fields beside those that all parts have in common: those of one pair, or one motor.
    number
        Place among the parts.

    """

    files: tuple[str, ...]
    first: int
    last: int | None
    metadata: Pairs
    fields: tuple[FieldMap, ...] = ()
    number: int = 1

    @property
    def whole(self) -> bool:
        """Whether it holds every row of the file."""
        return self.first == 0 and self.last is None

    @property
    def name(self) -> str:
        """What stands behind the file's stem in the path of the capture."""
        if self.fields:
            return f"part {self.number}"
        return f"rows {self.first}-{'' if self.last is None else self.last}"


@dataclass(frozen=True, slots=True)
class SourceMap:
    """How to recognise the files of a bench and convert them into the contract's columns.

    Attributes
    ----------
    name
        Of the map.
    files, header, topics
        Criteria, which must all hold: patterns of names, a regular expression of the header,
        patterns of topics.
    layout, fields, time, messages, joint
        How tables, columns and time are read.
    reader
        Plug-in for a form that is neither MCAP nor a text table.
    metadata, per_file
        Fixed metadata, of all files and by pattern of the name.
    file_names
        Regular expressions whose named groups are metadata.
    values
        What a word of a file name means, by metadata key.
    captures
        How a file is cut into several captures.

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
    metadata: Pairs = ()
    per_file: tuple[tuple[str, Pairs], ...] = ()
    file_names: tuple[str, ...] = ()
    values: tuple[tuple[str, Pairs], ...] = ()
    captures: tuple[Part, ...] = ()

    def recognises(self, path: str, head: str | None, topics: Iterable[str]) -> bool:
        """Whether a file is of this bench.

        Parameters
        ----------
        path
            Path of the file.
        head
            Beginning of a text file; None for an MCAP file.
        topics
            Topics of an MCAP file.

        Returns
        -------
        bool
            Every criterion that the map states must hold, and it must state one.

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
        """Whether the name of a file is one of those that the map lists.

        Parameters
        ----------
        path
            Path of the file.

        """
        return _is_named(path, self.files)

    def parts_of(self, path: str) -> tuple[Part, ...]:
        """The captures that a file is cut into.

        Parameters
        ----------
        path
            Path of the file.

        Returns
        -------
        tuple of Part
            Empty where it is one capture as a whole.

        """
        return tuple(p for p in self.captures if not p.files or _is_named(path, p.files))

    def metadata_for(self, path: str) -> dict[str, str]:
        """Fixed metadata of one file.

        Parameters
        ----------
        path
            Path of the file; what is stated for its name takes precedence.

        """
        metadata = dict(self.metadata) | self._from_name(path)
        name = PurePosixPath(path).name
        for pattern, values in reversed(self.per_file):
            if fnmatchcase(name, pattern):
                metadata |= dict(values)
        return {"contract": "1"} | metadata

    def _from_name(self, path: str) -> dict[str, str]:
        """What the patterns of `file_names` find in a path, the first that finds a key winning."""
        metadata: dict[str, str] = {}
        values = {key: dict(words) for key, words in self.values}
        for pattern in self.file_names:
            match = re.search(pattern, path)
            for key, word in (match.groupdict() if match else {}).items():
                if word and column_of(key) is None:
                    metadata.setdefault(key, values.get(key, {}).get(word, word))
        return metadata

    def columns_from_name(self, path: str) -> dict[str, float]:
        """Columns that are one number in the whole file, which its name states.

        Parameters
        ----------
        path
            Path of the file.

        Returns
        -------
        dict of float
            By column, in its own unit: of `wot_3000rpm.csv` 314.2 rad/s, by a group
            `omega_mech_rad_s__rpm` around the figures.

        """
        columns: dict[str, float] = {}
        for pattern in self.file_names:
            match = re.search(pattern, path)
            for key, word in (match.groupdict() if match else {}).items():
                meant, value = column_of(key), number(word.replace(",", ".")) if word else None
                if meant is not None and value is not None:
                    column, unit, sign = meant
                    scale = scale_to(unit, COLUMNS[column].unit)
                    columns.setdefault(column, sign * value * scale.factor + scale.shift)
        return columns


def column_of(group: str) -> tuple[str, str, float] | None:
    """The column, unit and sign that a named group of a file name's pattern stands for.

    Parameters
    ----------
    group
        Column and unit with two underscores between, as in `omega_mech_rad_s__rpm`; `minus_` before
        the unit where the name leaves out a minus.

    Returns
    -------
    tuple or None
        None of a group that is metadata.

    Examples
    --------
    >>> column_of("omega_mech_rad_s__minus_rpm"), column_of("motor_id")
    (('omega_mech_rad_s', 'rpm', -1.0), None)

    """
    column, _, unit = group.rpartition("__")
    if column not in COLUMNS:
        return None
    minus = unit.startswith("minus_")
    return column, unit.removeprefix("minus_"), -1.0 if minus else 1.0


def _is_named(path: str, patterns: Iterable[str]) -> bool:
    name = PurePosixPath(path).name
    return any(fnmatchcase(name, pattern) for pattern in patterns)


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


def parse_source_map(data: bytes, name: str) -> SourceMap:
    """A source map without variants from its YAML bytes. Raises UsageError.

    Parameters
    ----------
    data
        YAML bytes.
    name
        Name of the map.

    """
    return _parsed(_plain(data, name), name)


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
    for key in ("separator", "decimal"):
        values[key] = {"tab": "\t", "space": " "}.get(values[key], values[key])
        if len(values[key].encode()) != 1:
            raise section.fault(key, "is not one character", "write one, `tab` or `space`")
    if values["separator"] == values["decimal"]:
        raise section.fault("decimal", "is the separator too", "write two different characters")
    return _readable(section, CsvDialect(**values))


def _readable(section: Section, layout: CsvDialect) -> CsvDialect:
    """The layout; refuses one whose units row is among the rows."""
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
