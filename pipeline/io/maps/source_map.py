"""Source maps: a bench's names, units, signs and file layout."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from fnmatch import fnmatchcase
from pathlib import PurePosixPath
from typing import Literal

from pipeline.io.maps.units import scale_of
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT, CsvDialect
from pipeline.physics.glossary import COLUMNS
from pipeline.records.parse import number

TimeFrom = Literal["field", "even", "log", "stamp", "increment"]
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
        A mapped field, the log clock, the stamp in a message's header, or start + increment · row;
        `even` is a field whose digits do not separate neighbouring samples, so that rows are evenly
        spaced along the straight line through it.
    wraps_at
        Value at which a clock starts again from zero [the field's unit].
    start_s, increment_s
        Used where the layout does not find them in the file [s]; an increment with the log clock or
        with stamps separates the rows of one block.

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
        for key, word in self._named(path):
            if column_of(key) is None:
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
        for key, word in self._named(path):
            meant, value = column_of(key), number(word.replace(",", "."))
            if meant is not None and value is not None:
                column, unit, sign = meant
                scale = scale_of(unit, column)
                columns.setdefault(column, sign * value * scale.factor + scale.shift)
        return columns

    def _named(self, path: str) -> Iterator[tuple[str, str]]:
        """Named groups of the patterns of `file_names` and what they are in a path."""
        for match in (re.search(pattern, path) for pattern in self.file_names):
            if match is not None:
                yield from ((key, word) for key, word in match.groupdict().items() if word)


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
