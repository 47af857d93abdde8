"""Captures decoded: what `survey` found to be one becomes a `Capture`, in any process and order."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path

import polars as pl

from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.files import read_whole
from pipeline.io.ingest.guard import refusing
from pipeline.io.ingest.metadata import capture_meta
from pipeline.io.ingest.survey import Survey, survey
from pipeline.io.maps.columns import (
    common_starts,
    foreign_unit,
    is_field,
    last_part,
    to_frame,
)
from pipeline.io.maps.source_map import Part, SourceMap
from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT
from pipeline.io.tables.csv_table import read_csv
from pipeline.io.tables.foreign import find_reader
from pipeline.io.tables.raw_table import RawTable, is_of_stamp
from pipeline.physics.glossary import COLUMNS, TESTS_WITHOUT_CLOCK
from pipeline.records.capture import Capture, Integrity
from pipeline.records.errors import CaptureError

__all__ = ["Entry", "Survey", "read_capture", "survey"]


def read_capture(folder: Path, entry: Entry) -> Capture:
    """Decodes one capture.

    Parameters
    ----------
    folder
        The input folder.
    entry
        What `survey` found of the file.

    Returns
    -------
    Capture
        Columns by their glossary names, in SI units.

    Raises
    ------
    CaptureError
        The file is not what it should be; the message says where.
    MachineError
        The disk failed.

    """
    with refusing():
        return _read_capture(folder, entry)


def _read_capture(folder: Path, entry: Entry) -> Capture:
    content = read_whole(folder / entry.path)
    if hashlib.sha256(content).hexdigest() != entry.sha256:
        raise CaptureError("changed", "the file changed while it was read", "run again")
    meta = capture_meta(entry.stated)
    if entry.part is not None and entry.part.fields and entry.source is not None:
        fields = (*entry.source.fields, *entry.part.fields)
        entry = replace(entry, source=replace(entry.source, fields=fields))
    if entry.form == "mcap":
        raw, source, verified = _read_mcap(content, entry)
    elif entry.form == "foreign":
        raw, source, verified = _read_foreign(content, entry)
    else:
        raw, source, verified = _read_csv(content, entry)
    starts = common_starts(raw, source)
    # a torque map may be a table of settled points, which its rows show
    timed = meta.test not in {*TESTS_WITHOUT_CLOCK, "torque_map"}
    framed = (to_frame(table, source, meta.pole_pairs, starts, timed=timed) for table in raw)
    frames = [frame for frame in framed if frame is not None]
    if source is not None:
        frames = _with_columns(frames, source.columns_from_name(entry.path))
    if entry.form == "foreign":
        _once(frames)
    frames = _cut(frames, entry.part)
    if not frames:
        raise CaptureError(
            "missing_column",
            "it holds no column of the contract",
            "run `inspect` on it for its fields and a source map to start from",
        )
    integrity: Integrity = "verified" if verified else "unverified"
    # an order that the order of topics in the file has no part in
    tables = tuple(sorted(frames, key=lambda frame: (frame.columns, -frame.height)))
    return Capture(entry.capture_path, entry.sha256, integrity, meta, tables)


def _with_columns(frames: list[pl.DataFrame], stated: Mapping[str, float]) -> list[pl.DataFrame]:
    """The frames, with columns of one number that none of them has beside the first."""
    present = {name for frame in frames for name in frame.columns}
    more = [pl.lit(value).alias(name) for name, value in stated.items() if name not in present]
    return [frames[0].with_columns(more), *frames[1:]] if frames and more else frames


def _once(frames: list[pl.DataFrame]) -> None:
    """Raises CaptureError for a column that several tables of a form hold: two motors in a log."""
    columns = [name for frame in frames for name in frame.columns if name != "t_s"]
    twice = next((name for name in columns if columns.count(name) > 1), None)
    if twice is not None:
        raise CaptureError(
            "duplicate_column",
            f"{columns.count(twice)} tables of the file become {twice}",
            "name the fields of each motor in `captures` of a source map, a capture each",
        )


def _cut(frames: list[pl.DataFrame], part: Part | None) -> list[pl.DataFrame]:
    """The rows of a part; raises CaptureError where the file has several clocks or fewer rows."""
    if part is None or part.whole or not frames:
        return frames
    if len(frames) > 1:
        words = f"{len(frames)} tables of different clocks cannot be cut by rows"
        raise CaptureError("bad_part", words, "leave `captures` out of the source map")
    last = frames[0].height - 1 if part.last is None else part.last
    if not part.first < last < frames[0].height:
        words = f"there are no {part.name} in {frames[0].height} rows"
        raise CaptureError("bad_part", words, "correct `captures` in the source map")
    return [frames[0].slice(part.first, last - part.first + 1)]


def wanted(source: SourceMap | None, name: str) -> bool:
    """Whether a column of a file is needed.

    Parameters
    ----------
    source
        The source map that it is read by; None for the contract's own form.
    name
        Name of the column in the file.

    Returns
    -------
    bool
        Of the contract's form, every column of the glossary, in another unit too.

    """
    if source is None:
        return last_part(name) in COLUMNS or foreign_unit(name) is not None
    if source.time.origin == "stamp" and is_of_stamp(name):
        return True
    return any(is_field(part.field, name) for part in source.fields)


def _read_mcap(data: bytes, entry: Entry) -> tuple[list[RawTable], SourceMap | None, bool]:
    layout = scan(data, recover=entry.recovered)
    source = entry.source
    joint = entry.stated.get("joint") or (source.joint if source else None)
    tables = read_tables(layout, lambda _topic, name: wanted(source, name), joint)
    form = "auto" if source is None else source.messages
    for table in tables:
        if form != "auto" and table.blocks != (form == "block"):
            raise CaptureError(
                "message_form",
                f"the messages of {table.name} are not what the source map says ({form})",
                "correct `messages` in the source map",
            )
    return tables, source, layout.data_crc_holds


def _read_foreign(data: bytes, entry: Entry) -> tuple[list[RawTable], SourceMap | None, bool]:
    source = entry.source
    if source is None or source.reader is None:
        raise CaptureError("unknown_source", "no reader is named", "add a source map")
    return list(find_reader(source.reader).read(data)), source, False


def _read_csv(data: bytes, entry: Entry) -> tuple[list[RawTable], SourceMap | None, bool]:
    source = entry.source
    dialect = CONTRACT_DIALECT if source is None else source.layout
    table = read_csv(data, dialect, lambda name: wanted(source, name), entry.path)
    if source is not None:
        time = source.time
        start = time.start_s if table.time_start is None else table.time_start
        step = time.increment_s if table.time_increment is None else table.time_increment
        source = replace(source, time=replace(time, start_s=start, increment_s=step))
    return [table.table], source, table.verified
