"""What one file is: its form, its source map and its metadata, without decoding its samples."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from pipeline.io.ingest.entry import Entry, Form
from pipeline.io.ingest.files import read_head, read_whole
from pipeline.io.ingest.guard import refusing
from pipeline.io.ingest.metadata import (
    MANIFEST,
    MAX_SIDECAR_BYTES,
    SIDECAR_SUFFIX,
    belongs,
    check_texts,
    merge,
    sidecar,
)
from pipeline.io.maps.map_file import find_maps
from pipeline.io.maps.source_map import SourceMap
from pipeline.io.mcap.container import MAGIC, Layout, scan
from pipeline.io.mcap.messages import count_messages
from pipeline.io.tables.csv_table import MAX_HEAD_BYTES, PACKED, check_text, split_comments
from pipeline.io.tables.foreign import find_reader, table_names
from pipeline.physics.glossary import METADATA
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.finding import Finding

METADATA_RECORD = "capture"
_MCAP_SUFFIX = ".mcap"
_TEXT_SUFFIXES = frozenset({".csv", ".txt", ".tsv", ".log", ".dat", ".asc"})
_TABLE_SUFFIXES = frozenset({".csv", ".tsv"})
_PACKED_SUFFIXES = frozenset({".gz", ".zst", ".bz2", ".xz", ".zip"})
_CONTRACT = re.compile(rb"(?:\xef\xbb\xbf)?(?:#[^\n]*\n)*?#[ \t]*contract[ \t]*:")
_FIRST_BYTES = 2**16


@dataclass(frozen=True, slots=True)
class Question:
    """One file to identify: its path, the sidecar beside it if any, and its manifest row."""

    path: str
    sidecar: str | None
    listed: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Answer:
    """What was found: an entry, or None for a file that is no capture; `findings` may refuse it.

    `sha256` is None where the file was not read to its end.
    """

    path: str
    sha256: str | None
    entry: Entry | None
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, slots=True)
class _File:
    """A file by its path, with what its sidecar and its row of a manifest state of it."""

    path: str
    beside: Mapping[str, str]
    listed: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class _Content:
    """What the bytes of a file show: form, own metadata, first lines, topics, layout of an MCAP."""

    form: Form
    metadata: Mapping[str, str]
    head: str | None
    topics: list[str]
    layout: Layout | None = None


def identify_by_head(
    folder: Path, question: Question, sources: Mapping[str, SourceMap]
) -> Answer | None:
    """The answer where name and first bytes suffice: the file is no capture.

    Parameters
    ----------
    folder
        The input folder.
    question
        The file.
    sources
        Source maps by name.

    Returns
    -------
    Answer or None
        None where the whole file must be read.

    """
    if question.sidecar is not None or question.listed:
        return None
    try:
        if _may_be_capture(folder, _File(question.path, {}, {}), sources):
            return None
    except CaptureError as fault:
        return Answer(question.path, None, None, (Finding.refusal(question.path, fault),))
    return Answer(question.path, None, None)


def identify(
    folder: Path, question: Question, sources: Mapping[str, SourceMap], *, recover: bool = False
) -> Answer:
    """Identifies one file without decoding its samples.

    Parameters
    ----------
    folder
        The input folder.
    question
        The file, its sidecar and its row of a manifest.
    sources
        Source maps by name.
    recover
        Whether the good part of an MCAP file that is cut off is used.

    Returns
    -------
    Answer
        What is wrong with the file is in its findings.

    """
    findings: list[Finding] = []
    digest: str | None = None
    entry: Entry | None = None
    try:
        with refusing():
            beside = {}
            if question.sidecar is not None:
                beside = sidecar(read_whole(folder / question.sidecar, MAX_SIDECAR_BYTES))
            file = _File(question.path, beside, dict(question.listed))
            if _may_be_capture(folder, file, sources):
                content = read_whole(folder / question.path)
                digest = hashlib.sha256(content).hexdigest()
                entry = _entry(file, content, digest, sources, findings, recover=recover)
    except CaptureError as fault:
        findings.append(Finding.refusal(question.path, fault))
        entry = None
    return Answer(question.path, digest, entry, tuple(findings))


def _may_be_capture(folder: Path, file: _File, sources: Mapping[str, SourceMap]) -> bool:
    """Whether the name, the first bytes or what is stated of a file make it worth reading."""
    if file.path.lower().endswith(_MCAP_SUFFIX) or _is_text(file, sources):
        return True
    head = read_head(folder / file.path, _FIRST_BYTES)
    return head.startswith(MAGIC) or _CONTRACT.match(head) is not None


def _is_text(file: _File, sources: Mapping[str, SourceMap]) -> bool:
    """Whether a file's name, or what is stated of it, makes it worth reading as text."""
    suffix = PurePosixPath(file.path).suffix.lower()
    named = any(source.files and source.recognises_name(file.path) for source in sources.values())
    written = suffix in _TEXT_SUFFIXES or _is_packed(file.path)
    return written or bool(file.listed) or bool(file.beside) or named


def _is_packed(path: str) -> bool:
    """Whether a name says that a capture was packed (`lcr.csv.gz`)."""
    name = PurePosixPath(path.lower())
    inside = PurePosixPath(name.stem).suffix
    return name.suffix in _PACKED_SUFFIXES and inside in {_MCAP_SUFFIX, *_TEXT_SUFFIXES}


def _entry(
    file: _File,
    data: bytes,
    digest: str,
    sources: Mapping[str, SourceMap],
    findings: list[Finding],
    *,
    recover: bool,
) -> Entry | None:
    """What a file is, or None where it is no capture."""
    path, content = file.path, _content(file, data, sources, recover=recover)
    recovered = content.layout is not None and content.layout.cut is not None
    if content.layout is not None and recovered:
        findings.append(_recovered(path, content.layout))
    source, known = _source(file, content, sources)
    if not known:
        _not_lost(path, data)
        return None
    form, metadata = content.form, content.metadata
    if source is not None and source.reader is not None:
        form, metadata = "foreign", dict(find_reader(source.reader).metadata(data))
    fixed = {} if source is None else source.metadata_for(path)
    if source is not None:
        metadata = {key: value for key, value in metadata.items() if key in METADATA}
    statements = [
        ("the file", metadata),
        (f"NAME{SIDECAR_SUFFIX}", file.beside),
        (MANIFEST, file.listed),
    ]
    stated, contradictions = merge(path, statements)
    findings += contradictions
    stated = fixed | stated
    check_texts(stated)
    belongs(stated)
    return Entry(path, digest, form, source, tuple(sorted(stated.items())), recovered)


def _content(
    file: _File, data: bytes, sources: Mapping[str, SourceMap], *, recover: bool
) -> _Content:
    if data.startswith(MAGIC) or file.path.lower().endswith(_MCAP_SUFFIX):
        layout = scan(data, recover=recover)
        metadata = layout.metadata_named(METADATA_RECORD)
        return _Content("mcap", metadata, None, _topics(layout), layout)
    form_known = any(s.reader and _may_read(s, file) for s in sources.values())
    metadata, head = _text_head(data, bool(file.listed or file.beside) and not form_known)
    named = (s.reader for s in sources.values() if s.topics and s.recognises_name(file.path))
    return _Content("csv", metadata, head, table_names(named, data))


def _may_read(source: SourceMap, file: _File) -> bool:
    """Whether a map is named beside a file, or knows it by its name."""
    named = file.beside.get("source") or file.listed.get("source")
    return source.name.partition("/")[0] == named or source.recognises_name(file.path)


def _text_head(data: bytes, named: bool) -> tuple[dict[str, str], str]:
    """A text file's own metadata, and its beginning; unreadable text counts only if it is meant.

    A file is meant as a capture if the manifest or a sidecar says so, or its bytes hold the key.
    """
    try:
        check_text(data)
        metadata, _ = split_comments(data)
    except CaptureError:
        if named or b"contract" in data[:MAX_HEAD_BYTES].replace(b"\0", b""):
            raise
        return {}, ""
    return metadata, data[:MAX_HEAD_BYTES].decode("latin-1").replace("\r\n", "\n")


def _topics(layout: Layout) -> list[str]:
    channels = layout.definitions.channels | layout.summary_definitions.channels
    return [channel.topic for channel in channels.values()]


def _recovered(path: str, layout: Layout) -> Finding:
    """The mark on a file of which the good part is used; raises its CaptureError if it is empty."""
    count, kept_bytes = count_messages(layout), layout.kept_bytes
    if layout.cut is not None and not count:
        raise layout.cut
    reason = "" if layout.cut is None else layout.cut.message.split(";")[0]
    return Finding(
        path,
        "warning",
        "recovered",
        f"it is cut off ({reason}); the {count} messages in its first {kept_bytes} of "
        f"{len(layout.data)} bytes are used, without proof that they are all",
        "copy the file again or record the test again; recover=false refuses such files",
        (0, count - 1),
    )


def _not_lost(path: str, data: bytes) -> None:
    """Raises CaptureError for a file that is no capture only because nothing can be seen in it."""
    suffix = PurePosixPath(path).suffix.lower()
    if not data and suffix in _TABLE_SUFFIXES:
        raise CaptureError("truncated", "the file is empty", "copy it again, or remove it")
    if data.startswith(PACKED) and (suffix in _TEXT_SUFFIXES or _is_packed(path)):
        raise CaptureError("encoding", "the file is packed", "unpack it first")


def _source(
    file: _File, content: _Content, sources: Mapping[str, SourceMap]
) -> tuple[SourceMap | None, bool]:
    """The source map to read a file with (None: the contract's own form), and if it is a capture.

    A map named by `source` counts first, then the file's own `contract`, then what recognises it.
    """
    named = file.beside.get("source") or file.listed.get("source") or content.metadata.get("source")
    if named:
        try:
            maps = list(find_maps(sources, named).values())
        except UsageError as fault:
            raise CaptureError("unknown_source", fault.message, fault.remedy) from None
        fitting = [s for s in maps if s.recognises(file.path, content.head, content.topics)]
        return (fitting or maps)[0], True
    if "contract" in content.metadata:
        return None, True
    matches = [s for s in sources.values() if s.recognises(file.path, content.head, content.topics)]
    if len(matches) > 1:
        raise CaptureError(
            "ambiguous_source",
            f"the source maps {', '.join(s.name for s in matches)} all recognise it",
            f"state `source` in NAME{SIDECAR_SUFFIX} or {MANIFEST}",
        )
    if matches:
        return matches[0], True
    return None, "contract" in file.beside or "contract" in file.listed
