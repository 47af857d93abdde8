"""What any one file holds, whether or not it is a capture, and a source map to start from."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from pipeline.io.ingest.capture_reader import wanted
from pipeline.io.ingest.files import read_whole
from pipeline.io.ingest.identification import identify
from pipeline.io.ingest.metadata import CONTRACT_VERSION, SIDECAR_SUFFIX, capture_meta
from pipeline.io.ingest.survey import question_of
from pipeline.io.inspection.file_names import name_patterns
from pipeline.io.inspection.parts import parts_of
from pipeline.io.inspection.proposals import FieldSeen, StreamSeen, propose
from pipeline.io.inspection.sniff import encoding_of, numeric_columns, sniff
from pipeline.io.inspection.starter_map import Shape, map_text
from pipeline.io.maps.columns import last_part, to_frame
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.maps.units import FOREIGN_UNITS, Scale
from pipeline.io.mcap.container import MAGIC, Layout, scan
from pipeline.io.mcap.tables import read_tables
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT
from pipeline.io.tables.csv_table import MAX_HEAD_BYTES, check_text, read_csv, split_comments
from pipeline.io.tables.foreign import Reader, readers
from pipeline.io.tables.raw_table import RawTable
from pipeline.physics.glossary import COLUMNS
from pipeline.records.errors import CaptureError
from pipeline.records.naming import counted
from pipeline.records.parse import whole

_NOTABLE_JITTER = 0.01
_GAP = 1.5


@dataclass(frozen=True, slots=True)
class InspectReport:
    """What `describe` found. `faults` says what stands in the way of reading the file.

    `form` is mcap, text, unknown or the name of a reader. `shape` is that of a file that needs a
    source map, and `starter` the map.
    """

    path: str
    form: str
    size: int
    sha256: str
    checksums: str
    metadata: tuple[tuple[str, str], ...]
    source: str | None
    streams: tuple[StreamSeen, ...]
    faults: tuple[str, ...]
    starter: str = ""
    shape: Shape | None = None

    @property
    def columns(self) -> frozenset[str]:
        """Columns that the file holds under their own name, or probably."""
        names = (seen.column for stream in self.streams for seen in stream.fields)
        return frozenset(one for one in names if one is not None)


@dataclass(slots=True)
class _Look:
    """One file while it is looked into."""

    name: str
    data: bytes
    sources: Mapping[str, SourceMap]
    answers: Mapping[str, str]
    form: str = "unknown"
    checksums: str = "none"
    metadata: dict[str, str] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    source: str | None = None

    def report(self, shape: Shape, *, lacks: bool, foreign: bool) -> InspectReport:
        """What was found; with a map to start from where the file lacks one."""
        needs = bool(shape.streams) and (foreign or lacks)
        starter = ""
        if needs:
            answered = frozenset(field.column for field in shape.fields if field.column)
            names = name_patterns([self.name], frozenset(self.answers), answered)
            metadata = {key: value for key, value in self.answers.items() if "." not in key}
            starter = map_text([shape], names, metadata, by_name=foreign)
        return InspectReport(
            self.name,
            self.form,
            len(self.data),
            hashlib.sha256(self.data).hexdigest(),
            self.checksums,
            tuple(self.metadata.items()),
            self.source,
            shape.streams,
            tuple(self.faults),
            starter,
            shape if needs else None,
        )


def describe(
    path: Path,
    sources: Mapping[str, SourceMap],
    answers: Mapping[str, str] | None = None,
) -> InspectReport:
    """Looks into any file, whether or not it is a capture.

    Parameters
    ----------
    path
        The file.
    sources
        Source maps by name.
    answers
        What the file does not say: `unit.NAME`, `column.NAME`, metadata.

    Returns
    -------
    InspectReport
        What it holds, what prevents a run, and a source map to start from where it lacks one.

    Raises
    ------
    CaptureError
        The file cannot be opened at all.
    UsageError
        An answer cannot be meant.

    """
    content = read_whole(path)
    look_at = _Look(path.name, content, sources, answers or {})
    reader = _reader_of(path, content, sources)
    if reader is not None:
        report = _foreign(look_at, reader)
    elif content.startswith(MAGIC):
        report = _mcap(look_at)
    else:
        report = _text(look_at)
    if "contract" in dict(report.metadata):
        return report
    return replace(report, faults=(*report.faults, *_unused(path, report, sources)))


def _unused(path: Path, report: InspectReport, sources: Mapping[str, SourceMap]) -> list[str]:
    """Why `run` does not use a file that states no contract, where its faults do not say."""
    answer = identify(path.parent, question_of(path), sources)
    if answer.entry is not None:
        return _metadata_faults(answer.entry.stated)
    if answer.findings or report.faults or not report.streams:
        remarks = (f"{finding.message}; {finding.remedy}" for finding in answer.findings)
        return [words for words in remarks if words not in report.faults]
    remedy = f"state `contract: {CONTRACT_VERSION}` in its metadata or NAME{SIDECAR_SUFFIX}"
    remedy += ", or finish the source map below" if report.starter else ": it lacks nothing else"
    return [f"`run` takes it for no capture, for nothing states `contract`; {remedy}"]


def _reader_of(path: Path, data: bytes, sources: Mapping[str, SourceMap]) -> Reader | None:
    """The reader that the suffix names, or a map that recognises the file; None for MCAP and text.

    A form without a suffix of its own, a table in JSON, is known by its map alone.
    """
    suffix = PurePosixPath(path.name).suffix.lower()
    reader = next((one for one in readers().values() if suffix in one.suffixes), None)
    if reader is not None or data.startswith(MAGIC):
        return reader
    head = _head(data)
    named = (one.reader for one in sources.values() if one.recognises(path.name, head, ()))
    return next((readers()[name] for name in named if name in readers()), None)


def _head(data: bytes) -> str:
    """The beginning of a file as maps recognise it."""
    return data[:MAX_HEAD_BYTES].decode("latin-1").replace("\r\n", "\n")


def _foreign(look_at: _Look, reader: Reader) -> InspectReport:
    look_at.form = reader.name
    streams: tuple[StreamSeen, ...] = ()
    try:
        tables = reader.read(look_at.data)
        look_at.metadata = dict(reader.metadata(look_at.data))
        streams = tuple(_stream(table, reader.name, look_at.answers) for table in tables)
    except CaptureError as fault:
        look_at.faults.append(str(fault))
    topics = [stream.name for stream in streams]
    head = None if reader.suffixes else _head(look_at.data)
    look_at.source = _matched(look_at.name, head, topics, look_at.sources)
    suffix = PurePosixPath(look_at.name).suffix
    shape = Shape(streams, suffixes=(suffix,), reader=reader.name)
    return look_at.report(shape, lacks=look_at.source is None, foreign=False)


def _mcap(look_at: _Look) -> InspectReport:
    look_at.form, faults = "mcap", look_at.faults
    look_at.checksums = "none that covers the whole file"
    topics: list[str] = []
    tables: list[RawTable] = []
    try:
        layout = scan(look_at.data)
        look_at.metadata = layout.metadata_named("capture")
        if layout.data_crc_holds:
            look_at.checksums = "cover every byte, and hold"
        tables = _tables(layout, look_at.metadata.get("joint"), faults)
        topics = [channel.topic for channel in layout.definitions.channels.values()]
    except CaptureError as fault:
        faults.append(str(fault))
    metadata = look_at.metadata
    contract = "contract" in metadata
    foreign = contract and "source" not in metadata and _column_faults(tables, metadata, faults)
    if contract:
        faults += _metadata_faults(metadata)
    look_at.source = _matched(look_at.name, None, topics, look_at.sources)
    streams = tuple(_stream(table, "messages", look_at.answers) for table in tables)
    shape = Shape(streams, topics=tuple(topics))
    return look_at.report(shape, lacks=not contract, foreign=foreign)


def _tables(layout: Layout, joint: str | None, faults: list[str]) -> list[RawTable]:
    try:
        return read_tables(layout, lambda _topic, _name: True, joint)
    except CaptureError as fault:
        faults.append(str(fault))
        return []


def _text(look_at: _Look) -> InspectReport:
    content, faults = look_at.data, look_at.faults
    shape = Shape(())
    head = ""
    try:
        check_text(content)
        look_at.metadata, begin = split_comments(content)
        head = _head(content)
        start = content[begin : begin + MAX_HEAD_BYTES]
        encoding = encoding_of(start)
        form = sniff(start.decode(encoding, "replace"))
        if form is None:
            faults.append("no table of numbers is found in it")
        else:
            dialect, header = replace(form[0], encoding=encoding), form[1]
            parsed = read_csv(content, dialect, numeric_columns(content[begin:], dialect))
            stated = "sha256_rows covers the rows, and holds"
            look_at.checksums = stated if parsed.verified else "none"
            stream = _stream(parsed.table, "text", look_at.answers)
            columns = _in_si_units(parsed.table, stream.fields)
            streams = (replace(stream, parts=parts_of(look_at.name, columns)),)
            suffix = PurePosixPath(look_at.name).suffix
            marked = content.startswith(b"\xef\xbb\xbf")
            shape = Shape(streams, dialect, header, suffixes=(suffix,), marked=marked)
    except CaptureError as fault:
        faults.append(str(fault))
    metadata = look_at.metadata
    contract = "contract" in metadata and "source" not in metadata
    foreign = not faults and contract and _contract_faults(content, metadata, faults)
    if contract:
        faults += _metadata_faults(metadata)
    look_at.source = _matched(look_at.name, head, [], look_at.sources)
    lacks = "contract" not in metadata and not _but_for_the_key(content, metadata, shape.streams)
    look_at.form = "text" if head else "unknown"
    return look_at.report(shape, lacks=lacks, foreign=foreign)


def _but_for_the_key(
    data: bytes, metadata: Mapping[str, str], streams: Sequence[StreamSeen]
) -> bool:
    """Whether a table would be a capture of the contract if it only stated `contract`."""
    stated = not _metadata_faults({"contract": CONTRACT_VERSION, **metadata})
    known = any(field.certain for stream in streams for field in stream.fields)
    return stated and known and not _contract_faults(data, metadata, [])


def _contract_faults(data: bytes, metadata: Mapping[str, str], faults: list[str]) -> bool:
    """Whether `run` cannot read the table as the contract's own; the reason joins the faults."""
    try:
        table = read_csv(data, CONTRACT_DIALECT, lambda name: wanted(None, name)).table
    except CaptureError as fault:
        faults.append(str(fault))
        return True
    return _column_faults([table], metadata, faults)


def _column_faults(
    tables: Sequence[RawTable], metadata: Mapping[str, str], faults: list[str]
) -> bool:
    """Whether fields are not the contract's columns as they stand; the reason joins the faults."""
    pole_pairs = metadata.get("pole_pairs", "")
    try:
        counted = whole(pole_pairs, 1)
        frames = [to_frame(table, None, counted) for table in tables]
        if tables and all(frame is None for frame in frames):
            faults.append("it holds no column of the contract; finish the source map below")
            return True
    except CaptureError as fault:
        faults.append(str(fault))
        return True
    return False


def _metadata_faults(metadata: Mapping[str, str]) -> list[str]:
    """What `run` would say of the metadata alone; a sidecar or manifest may still fill it in."""
    try:
        capture_meta(metadata)
    except CaptureError as fault:
        return [str(fault)]
    return []


def _matched(
    name: str, head: str | None, topics: list[str], sources: Mapping[str, SourceMap]
) -> str | None:
    names = [source.name for source in sources.values() if source.recognises(name, head, topics)]
    return ", ".join(names) or None


def _stream(table: RawTable, encoding: str, answers: Mapping[str, str]) -> StreamSeen:
    dated = _by_stamps(table)
    fields = propose(dated, answers)
    time = _time_s(dated, fields)
    steps = np.diff(time) if time is not None else np.empty(0)
    step = float(np.nanmedian(steps)) if steps.size else 0.0
    rate = 1.0 / step if step > 0 else None
    clock = "" if rate is None else _clock_words(steps, step)
    stamped = dated is not table
    fields = tuple(one for one in fields if not stamped or one.name != "t_s")
    return StreamSeen(table.name, encoding, table.rows, rate, fields, clock, stamped=stamped)


def _in_si_units(table: RawTable, fields: Sequence[FieldSeen]) -> dict[str, NDArray[np.float64]]:
    """The columns [n] of a table whose unit is known."""
    columns = {}
    for seen in fields:
        if seen.column is None or seen.question is not None or seen.wraps or seen.times:
            continue
        scale = FOREIGN_UNITS[COLUMNS[seen.column].unit].get(seen.unit or "", Scale(1.0))
        values = table.fields[seen.name].astype(np.float64)
        columns[seen.column] = values * (seen.scale or scale.factor) + scale.shift
    time = _time_s(table, fields)
    return columns if time is None else {**columns, "t_s": time}


def _clock_words(steps: NDArray[np.float64], step: float) -> str:
    """Jitter and gaps of a clock, steps [s] against their median, where there are any."""
    remarks = []
    jitter = float(np.nanmedian(np.abs(steps - step))) / step
    if jitter > _NOTABLE_JITTER:
        remarks.append(f"steps vary by {jitter:.1%}")
    gaps = int(np.count_nonzero(steps > _GAP * step))
    if gaps:
        longest = float(np.nanmax(steps))
        remarks.append(f"{counted(gaps, 'gap')}, the longest {longest:.4g} s")
    back = int(np.count_nonzero(steps <= 0))
    if back:
        remarks.append(f"it stands or goes back at {counted(back, 'row')}")
    return "; ".join(remarks)


def _by_stamps(table: RawTable) -> RawTable:
    """A table with `t_s` in the place of the stamps of its messages, where it has no `t_s` and each
    was sent after the one before. A recorder notes when it got a message, which may be in bursts.
    """
    parts, stamps = table.stamp_fields, table.stamp_ns
    if parts is None or stamps is None or stamps.size < 2 or table.blocks:
        return table
    if "t_s" in map(last_part, table.fields) or not (np.diff(stamps) > 0).all():
        return table
    others = {name: values for name, values in table.fields.items() if name not in parts}
    return replace(table, fields={"t_s": (stamps - stamps[0]) / 1e9, **others})


def _time_s(table: RawTable, fields: Sequence[FieldSeen]) -> NDArray[np.float64] | None:
    """Time [s] by the field that is t_s, its unit known, or by the log clock."""
    clock = next((one for one in fields if one.column == "t_s" and not one.question), None)
    if clock is not None:
        values = table.fields[clock.name].astype(np.float64)
        if clock.wraps:
            values = values + clock.wraps * np.cumsum(np.diff(values, prepend=values[:1]) < 0)
        factor = FOREIGN_UNITS["s"][clock.unit].factor if clock.unit and not clock.scale else 1.0
        return values * factor * (clock.scale or 1.0)
    if table.log_time_ns is None or table.blocks:
        return None
    return table.log_time_ns.astype(np.float64) / 1e9
