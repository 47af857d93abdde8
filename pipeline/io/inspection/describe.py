"""What any one file holds, whether or not it is a capture, and a source map to start from."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np

from pipeline.io.ingest.capture_reader import wanted
from pipeline.io.ingest.files import read_whole
from pipeline.io.ingest.metadata import CONTRACT_VERSION, SIDECAR_SUFFIX, capture_meta
from pipeline.io.ingest.survey import look, question_of
from pipeline.io.inspection.aliases import guess
from pipeline.io.inspection.sniff import encoding_of, numeric_columns, sniff
from pipeline.io.inspection.starter_map import FieldSeen, StreamSeen, starter_map
from pipeline.io.maps.columns import to_frame
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.mcap.container import MAGIC, Layout, scan
from pipeline.io.mcap.tables import read_tables
from pipeline.io.tables.csv_dialect import CONTRACT_DIALECT
from pipeline.io.tables.csv_table import MAX_HEAD_BYTES, check_text, read_csv, split_comments
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError
from pipeline.records.parse import whole


@dataclass(frozen=True, slots=True)
class InspectReport:
    """What `describe` found. `faults` says what stands in the way of reading the file."""

    path: str
    form: Literal["mcap", "text", "unknown"]
    size: int
    sha256: str
    checksums: str
    metadata: tuple[tuple[str, str], ...]
    source: str | None
    streams: tuple[StreamSeen, ...]
    faults: tuple[str, ...]
    starter: str

    @property
    def columns(self) -> frozenset[str]:
        """Columns that the file holds under their own name, or by a guess."""
        found = (seen.guess for stream in self.streams for seen in stream.fields)
        return frozenset(one.column for one in found if one is not None)


def describe(path: Path, sources: Mapping[str, SourceMap]) -> InspectReport:
    """Look into any file; raises CaptureError only where it cannot be opened at all."""
    data = read_whole(path)
    look_into = _mcap if data.startswith(MAGIC) else _text
    report = look_into(path.name, data, sources)
    if "contract" in dict(report.metadata):
        return report
    return replace(report, faults=(*report.faults, *_unused(path, report, sources)))


def _unused(path: Path, report: InspectReport, sources: Mapping[str, SourceMap]) -> list[str]:
    """Why `run` does not use a file that states no contract, where its faults do not say."""
    answer = look(path.parent, question_of(path), sources)
    if answer.entry is not None:
        return _metadata_faults(answer.entry.said)
    if answer.findings or report.faults or not report.streams:
        told = (f"{finding.message}; {finding.remedy}" for finding in answer.findings)
        return [words for words in told if words not in report.faults]
    remedy = f"state `contract: {CONTRACT_VERSION}` in its metadata or NAME{SIDECAR_SUFFIX}"
    remedy += ", or finish the source map below" if report.starter else ": it lacks nothing else"
    return [f"`run` takes it for no capture, for nothing states `contract`; {remedy}"]


def _mcap(name: str, data: bytes, sources: Mapping[str, SourceMap]) -> InspectReport:
    faults: list[str] = []
    metadata: dict[str, str] = {}
    topics: list[str] = []
    tables: list[RawTable] = []
    checksums = "none that covers the whole file"
    try:
        layout = scan(data)
        metadata = layout.metadata_named("capture")
        if layout.data_crc_holds:
            checksums = "cover every byte, and hold"
        tables = _tables(layout, metadata.get("joint"), faults)
        topics = [channel.topic for channel in layout.definitions.channels.values()]
    except CaptureError as fault:
        faults.append(str(fault))
    contract = "contract" in metadata
    foreign = contract and "source" not in metadata and _column_faults(tables, metadata, faults)
    if contract:
        faults += _metadata_faults(metadata)
    matched = _matched(name, None, topics, sources)
    streams = tuple(_stream(table, "messages") for table in tables)
    starter = ""
    if streams and (foreign or not contract):
        starter = starter_map(streams, CONTRACT_DIALECT, None, topics, by_name=foreign)
    return _report(name, "mcap", data, checksums, metadata, matched, streams, faults, starter)


def _tables(layout: Layout, joint: str | None, faults: list[str]) -> list[RawTable]:
    try:
        return read_tables(layout, lambda _topic, _name: True, joint)
    except CaptureError as fault:
        faults.append(str(fault))
        return []


def _text(name: str, data: bytes, sources: Mapping[str, SourceMap]) -> InspectReport:
    faults: list[str] = []
    metadata: dict[str, str] = {}
    table = None
    dialect, header = CONTRACT_DIALECT, None
    checksums = "none"
    head = ""
    try:
        check_text(data)
        metadata, begin = split_comments(data)
        head = data[:MAX_HEAD_BYTES].decode("latin-1").replace("\r\n", "\n")
        start = data[begin : begin + MAX_HEAD_BYTES]
        encoding = encoding_of(start)
        found = sniff(start.decode(encoding, "replace"))
        if found is None:
            faults.append("no table of numbers is found in it")
        else:
            dialect, header = replace(found[0], encoding=encoding), found[1]
            parsed = read_csv(data, dialect, numeric_columns(data[begin:], dialect))
            table = parsed.table
            checksums = "sha256_rows covers the rows, and holds" if parsed.verified else "none"
    except CaptureError as fault:
        faults.append(str(fault))
    contract = "contract" in metadata and "source" not in metadata
    foreign = not faults and contract and _contract_faults(data, metadata, faults)
    if contract:
        faults += _metadata_faults(metadata)
    matched = _matched(name, head, [], sources)
    streams = () if table is None else (_stream(table, "text"),)
    starter = ""
    lacks = "contract" not in metadata and not _but_for_the_key(data, metadata, streams)
    if table is not None and (foreign or lacks):
        starter = starter_map(streams, dialect, header, [], by_name=foreign)
    form: Literal["text", "unknown"] = "text" if head else "unknown"
    return _report(name, form, data, checksums, metadata, matched, streams, faults, starter)


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


def _report(
    name: str,
    form: Literal["mcap", "text", "unknown"],
    data: bytes,
    checksums: str,
    metadata: Mapping[str, str],
    source: str | None,
    streams: tuple[StreamSeen, ...],
    faults: list[str],
    starter: str,
) -> InspectReport:
    digest = hashlib.sha256(data).hexdigest()
    said = tuple(metadata.items())
    return InspectReport(
        name, form, len(data), digest, checksums, said, source, streams, tuple(faults), starter
    )


def _matched(
    name: str, head: str | None, topics: list[str], sources: Mapping[str, SourceMap]
) -> str | None:
    found = [source.name for source in sources.values() if source.recognises(name, head, topics)]
    return ", ".join(found) or None


def _stream(table: RawTable, encoding: str) -> StreamSeen:
    units = dict(table.units)
    fields = tuple(
        FieldSeen(
            name,
            float(values[0]) if values.size else None,
            guess(name, units.get(name)),
            guess(name) == guess(name, units.get(name)) and _is_column(name),
        )
        for name, values in table.fields.items()
    )
    return StreamSeen(table.name, encoding, table.rows, _rate_hz(table), fields)


def _is_column(name: str) -> bool:
    found = guess(name)
    return found is not None and name.rsplit(".", 1)[-1] == found.column


def _rate_hz(table: RawTable) -> float | None:
    """Median rate [Hz] by t_s or the log clock."""
    time = table.fields.get("t_s")
    if time is None and table.log_time_ns is not None and not table.blocks:
        time = table.log_time_ns / 1e9
    if time is None or time.size < 2:
        return None
    step = float(np.nanmedian(np.diff(time.astype(np.float64))))
    return 1.0 / step if step > 0 else None
