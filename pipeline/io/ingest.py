"""A folder of recordings in, captures out: the one door of this room for reading.

`survey` looks at every file once without decoding: what is a capture, what is said of it, what
cannot be used. `read_capture` then decodes one capture; it can run in any process, in any order.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Literal

import polars as pl

from pipeline.io.columns import foreign_unit, last_part, to_frame
from pipeline.io.csv_dialect import CONTRACT_DIALECT
from pipeline.io.csv_table import MAX_HEAD_BYTES, check_text, read_csv, split_comments
from pipeline.io.files import list_files, read_whole
from pipeline.io.foreign import find_reader
from pipeline.io.mcap.container import MAGIC, Layout, scan
from pipeline.io.mcap.tables import read_tables
from pipeline.io.metadata import MANIFEST, SIDECAR_SUFFIX, capture_meta, manifest, merge, sidecar
from pipeline.io.raw_table import RawTable
from pipeline.io.source_map import SourceMap, find_map
from pipeline.physics.glossary import COLUMNS, METADATA
from pipeline.records.capture import Capture, CaptureMeta, Integrity
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.finding import Finding

Form = Literal["mcap", "csv", "foreign"]
METADATA_RECORD = "capture"
_MCAP_SUFFIX = ".mcap"
_TEXT_SUFFIXES = frozenset({".csv", ".txt", ".tsv", ".log", ".dat", ".asc"})


@dataclass(frozen=True, slots=True)
class Entry:
    """A file that is a capture: where it is, what it is, and all that is said of it.

    `source` is None for the contract's own form. `path` is relative with forward slashes.
    """

    path: str
    sha256: str
    form: Form
    source: SourceMap | None
    metadata: tuple[tuple[str, str], ...]

    @property
    def said(self) -> dict[str, str]:
        """The merged metadata as texts."""
        return dict(self.metadata)


@dataclass(frozen=True, slots=True)
class Survey:
    """Captures sorted by path, what was found wrong, and the files that are no captures."""

    entries: tuple[Entry, ...]
    findings: tuple[Finding, ...]
    others: tuple[str, ...]

    @property
    def note(self) -> str:
        """One line that counts and names the files that are no captures, or an empty text."""
        if not self.others:
            return ""
        shown = ", ".join(self.others[:5]) + (", ..." if len(self.others) > 5 else "")
        return f"{len(self.others)} files are no captures and were left alone: {shown}"


def survey(folder: Path, sources: Mapping[str, SourceMap]) -> Survey:
    """Every file of a folder looked at once, in the order of its path.

    Raises UsageError where the folder is not there; a bad file becomes a finding.
    """
    listing = list_files(folder)
    findings = list(listing.findings)
    manifests = _manifests(folder, listing.paths, findings)
    entries: dict[str, Entry] = {}
    others: list[str] = []
    for path in listing.paths:
        if PurePosixPath(path).name == MANIFEST or path.endswith(SIDECAR_SUFFIX):
            continue
        try:
            entry = _entry(folder, path, listing.paths, manifests.get(path, {}), sources, findings)
        except CaptureError as fault:
            findings.append(Finding.refusal(path, fault))
            continue
        if entry is None:
            others.append(path)
        elif entry.sha256 in entries:
            findings.append(_duplicate(path, entries[entry.sha256].path))
        else:
            entries[entry.sha256] = entry
    findings += [_absent(path) for path in sorted(set(manifests) - set(listing.paths))]
    return Survey(tuple(entries.values()), tuple(sorted(findings, key=_order)), tuple(others))


def _order(finding: Finding) -> tuple[str, str, str]:
    return finding.file, finding.code, finding.message


def _duplicate(path: str, first: str) -> Finding:
    return Finding(
        path,
        "warning",
        "duplicate_content",
        f"it holds the same bytes as {first} and is used once",
        "remove one of the two",
    )


def _absent(path: str) -> Finding:
    return Finding(
        path,
        "warning",
        "manifest_missing_file",
        f"the {MANIFEST} names it, but it is not there",
        f"add the file or remove its row from the {MANIFEST}",
    )


def _manifests(
    folder: Path, paths: Iterable[str], findings: list[Finding]
) -> dict[str, dict[str, str]]:
    """What all manifests say, by path; a manifest that cannot be read is a finding."""
    said: dict[str, dict[str, str]] = {}
    for path in paths:
        if PurePosixPath(path).name == MANIFEST:
            try:
                home = PurePosixPath(path).parent.as_posix()
                found = manifest(read_whole(folder / path), "" if home == "." else home)
            except CaptureError as fault:
                findings.append(Finding.refusal(path, fault))
                continue
            for file, values in found.items():
                said[file] = values | said.get(file, {})
    return said


def _entry(
    folder: Path,
    path: str,
    paths: tuple[str, ...],
    listed: dict[str, str],
    sources: Mapping[str, SourceMap],
    findings: list[Finding],
) -> Entry | None:
    """What a file is, or None where it is no capture."""
    beside = _sidecar(folder, path, paths)
    data = read_whole(folder / path)
    if data.startswith(MAGIC) or path.lower().endswith(_MCAP_SUFFIX):
        form: Form = "mcap"
        layout = scan(data)
        own, head, topics = layout.metadata_named(METADATA_RECORD), None, _topics(layout)
    else:
        form, topics = "csv", []
        if not _is_text(path, listed, beside, sources):
            return None
        own, head = _text_head(data, bool(listed or beside))
    source, known = _source(path, own, beside, listed, head, topics, sources)
    if not known:
        return None
    if source is not None and source.reader is not None:
        form, own = "foreign", dict(find_reader(source.reader).metadata(data))
    fixed = {} if source is None else source.metadata_for(path)
    if source is not None:
        own = {key: value for key, value in own.items() if key in METADATA}
    statements = [
        ("the file", own),
        (f"NAME{SIDECAR_SUFFIX}", beside),
        (MANIFEST, listed),
    ]
    said, contradictions = merge(path, statements)
    findings += contradictions
    said = fixed | said
    digest = hashlib.sha256(data).hexdigest()
    return Entry(path, digest, form, source, tuple(sorted(said.items())))


def _topics(layout: Layout) -> list[str]:
    channels = layout.definitions.channels | layout.summary_definitions.channels
    return [channel.topic for channel in channels.values()]


def _is_text(
    path: str,
    listed: Mapping[str, str],
    beside: Mapping[str, str],
    sources: Mapping[str, SourceMap],
) -> bool:
    """Whether a file's name, or what is said of it, makes it worth reading as text."""
    suffix = PurePosixPath(path).suffix.lower()
    named = any(source.files and source.recognises_name(path) for source in sources.values())
    return suffix in _TEXT_SUFFIXES or bool(listed) or bool(beside) or named


def _text_head(data: bytes, named: bool) -> tuple[dict[str, str], str]:
    """A text file's own metadata, and its beginning; unreadable text counts only if it is meant.

    A file is meant as a capture if the manifest or a sidecar says so, or its bytes hold the key.
    """
    try:
        check_text(data)
        own, _ = split_comments(data)
    except CaptureError:
        if named or b"contract" in data[:MAX_HEAD_BYTES].replace(b"\0", b""):
            raise
        return {}, ""
    return own, data[:MAX_HEAD_BYTES].decode("latin-1").replace("\r\n", "\n")


def _sidecar(folder: Path, path: str, paths: tuple[str, ...]) -> dict[str, str]:
    """What the file beside says: NAME.meta.yaml for NAME.csv (or NAME.csv.meta.yaml)."""
    stem = PurePosixPath(path).with_suffix("").as_posix()
    for candidate in (path + SIDECAR_SUFFIX, stem + SIDECAR_SUFFIX):
        if candidate in paths:
            return sidecar(read_whole(folder / candidate))
    return {}


def _source(
    path: str,
    own: Mapping[str, str],
    beside: Mapping[str, str],
    listed: Mapping[str, str],
    head: str | None,
    topics: list[str],
    sources: Mapping[str, SourceMap],
) -> tuple[SourceMap | None, bool]:
    """The source map to read a file with (None: the contract's own form), and if it is a capture.

    A map named by `source` counts first, then the file's own `contract`, then what recognises it.
    """
    named = beside.get("source") or listed.get("source") or own.get("source")
    if named:
        try:
            return find_map(sources, named), True
        except UsageError as fault:
            raise CaptureError("unknown_source", fault.message, fault.remedy) from None
    if "contract" in own:
        return None, True
    matches = [s for s in sources.values() if s.recognises(path, head, topics)]
    if len(matches) > 1:
        raise CaptureError(
            "ambiguous_source",
            f"the source maps {', '.join(s.name for s in matches)} all recognise it",
            f"state `source` in NAME{SIDECAR_SUFFIX} or {MANIFEST}",
        )
    if matches:
        return matches[0], True
    return None, "contract" in beside or "contract" in listed


def read_capture(folder: Path, entry: Entry) -> Capture:
    """Decode one capture; raises CaptureError with what is wrong, and MachineError for the disk."""
    data = read_whole(folder / entry.path)
    if hashlib.sha256(data).hexdigest() != entry.sha256:
        raise CaptureError("changed", "the file changed while it was read", "run again")
    meta = capture_meta(entry.said)
    if entry.form == "mcap":
        raw, source, verified = _read_mcap(data, entry)
    elif entry.form == "foreign":
        raw, source, verified = _read_foreign(data, entry)
    else:
        raw, source, verified = _read_csv(data, entry)
    frames = [frame for table in raw if (frame := _frame(table, source, meta)) is not None]
    if not frames:
        raise CaptureError(
            "missing_column",
            "it holds no column of the contract",
            "run `inspect` on it for its fields and a source map to start from",
        )
    integrity: Integrity = "verified" if verified else "unverified"
    return Capture(entry.path, entry.sha256, integrity, meta, tuple(_sorted(frames)))


def _frame(table: RawTable, source: SourceMap | None, meta: CaptureMeta) -> pl.DataFrame | None:
    return to_frame(table, source, meta.pole_pairs)


def _sorted(frames: list[pl.DataFrame]) -> list[pl.DataFrame]:
    """Tables in an order that the order of topics in the file has no part in."""
    return sorted(frames, key=lambda frame: (frame.columns, -frame.height))


def _wanted(source: SourceMap | None, name: str) -> bool:
    if source is None:
        return last_part(name) in COLUMNS or foreign_unit(name) is not None
    return any(name == part.field or last_part(name) == part.field for part in source.fields)


def _read_mcap(data: bytes, entry: Entry) -> tuple[list[RawTable], SourceMap | None, bool]:
    layout = scan(data)
    source = entry.source
    joint = entry.said.get("joint") or (source.joint if source else None)
    tables = read_tables(layout, lambda _topic, name: _wanted(source, name), joint)
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
    return [find_reader(source.reader).read(data)], source, False


def _read_csv(data: bytes, entry: Entry) -> tuple[list[RawTable], SourceMap | None, bool]:
    source = entry.source
    dialect = CONTRACT_DIALECT if source is None else source.layout
    found = read_csv(data, dialect, lambda name: _wanted(source, name), entry.path)
    if source is not None:
        time = source.time
        start = time.start_s if found.time_start is None else found.time_start
        step = time.increment_s if found.time_increment is None else found.time_increment
        source = replace(source, time=replace(time, start_s=start, increment_s=step))
    return [found.table], source, found.verified
