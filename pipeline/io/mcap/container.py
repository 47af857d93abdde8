"""The strict scan: a file's structure, definitions, checksums and index, proved before decoding.

The scan goes over the top-level records once, front to back, and believes the summary only where
it repeats what the data section says. Chunks stay packed.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field

import numpy as np
from isal.isal_zlib import crc32

from pipeline.io.mcap import records as rec
from pipeline.io.mcap.limits import MAX_WHOLE_FLOOR_BYTES, MAX_WHOLE_RATIO
from pipeline.io.mcap.walk import HEAD_BYTES, Integers, RecordSpans, walk
from pipeline.io.mcap.wire import Fields, corrupt, too_large, truncated
from pipeline.records.errors import CaptureError

MAGIC = b"\x89MCAP0\r\n"
_DATA_SECTION = frozenset(
    {
        rec.SCHEMA,
        rec.CHANNEL,
        rec.MESSAGE,
        rec.CHUNK,
        rec.MESSAGE_INDEX,
        rec.ATTACHMENT,
        rec.METADATA,
    }
)


@dataclass
class Definitions:
    """Schemas and channels by id; an id never changes its meaning."""

    schemas: dict[int, rec.Schema] = field(default_factory=dict)
    channels: dict[int, rec.Channel] = field(default_factory=dict)

    def add(self, opcode: int, fields: Fields) -> None:
        """Takes in a Schema or Channel record.

        Parameters
        ----------
        opcode
            Of the record.
        fields
            Its fields.

        Raises
        ------
        CaptureError
            An id changes its meaning.

        """
        if opcode == rec.SCHEMA:
            schema = rec.schema(fields)
            if self.schemas.setdefault(schema.id, schema) != schema:
                raise corrupt(f"the schema id {schema.id} is defined twice, differently")
            return
        channel = rec.channel(fields)
        if self.channels.setdefault(channel.id, channel) != channel:
            raise corrupt(f"the channel id {channel.id} is defined twice, differently")

    def channel(self, number: int) -> rec.Channel:
        """The channel of an id that messages use.

        Parameters
        ----------
        number
            The id.

        Raises
        ------
        CaptureError
            The channel or its schema is not defined.

        """
        channel = self.channels.get(number)
        if channel is None:
            raise corrupt(f"messages of channel {number}, which is nowhere defined")
        if channel.schema_id and channel.schema_id not in self.schemas:
            raise corrupt(f"the channel {channel.topic!r} names a schema that is not there")
        return channel


@dataclass
class Layout:
    """What a scan found. `loose_*` are the messages outside chunks: body start and length [n]."""

    data: bytes
    definitions: Definitions = field(default_factory=Definitions)
    summary_definitions: Definitions = field(default_factory=Definitions)
    metadata: list[rec.Metadata] = field(default_factory=list)
    metadata_places: list[rec.Located] = field(default_factory=list)
    attachments: list[rec.Located] = field(default_factory=list)
    chunks: list[rec.Chunk] = field(default_factory=list)
    message_indexes: dict[int, list[rec.MessageIndex]] = field(default_factory=dict)
    chunk_indexes: list[rec.ChunkIndex] = field(default_factory=list)
    attachment_indexes: list[rec.Located] = field(default_factory=list)
    metadata_indexes: list[rec.Located] = field(default_factory=list)
    statistics: rec.Statistics | None = None
    loose_start: Integers = field(default_factory=lambda: np.empty(0, np.int64))
    loose_length: Integers = field(default_factory=lambda: np.empty(0, np.int64))
    data_crc_holds: bool = False
    cut: CaptureError | None = None
    """Why the file is known to be cut off, where its good part is used all the same."""
    kept_bytes: int = 0
    """Bytes of a cut file up to the end of its last whole record."""

    @property
    def messages_seen(self) -> int:
        """Messages the scan knows of so far, packed ones by their index."""
        indexed = sum(index.count for indexes in self.message_indexes.values() for index in indexes)
        return indexed + int(self.loose_start.size)

    def metadata_named(self, name: str) -> dict[str, str]:
        """The merged metadata records of one name.

        Parameters
        ----------
        name
            Of the records.

        Raises
        ------
        CaptureError
            Two of them contradict each other.

        """
        merged: dict[str, str] = {}
        for record in self.metadata:
            for key, value in record.entries if record.name == name else ():
                if merged.setdefault(key, value) != value:
                    raise corrupt(f"two metadata records {name!r} contradict each other on {key!r}")
        return merged


def scan(data: bytes, *, recover: bool = False) -> Layout:
    """The layout of a whole MCAP file, proved before anything is decoded.

    Parameters
    ----------
    data
        Bytes of the file.
    recover
        Whether to take the whole records of a file that lacks its end; `Layout.cut` then says so.

    Returns
    -------
    Layout
        Where chunks, messages and metadata lie; chunks stay packed.

    Raises
    ------
    CaptureError
        It is no MCAP file (`not_mcap`), lacks its end (`truncated`), contradicts the format, its
        index or a checksum (`corrupt`), or claims to unpack to too much (`limit`).

    References
    ----------
    MCAP Format Specification, version 0, https://mcap.dev/spec.

    """
    if not data.startswith(MAGIC):
        raise CaptureError(
            "not_mcap",
            "the file is named .mcap but does not begin as an MCAP file does",
            "record it as MCAP, or give it the suffix of what it is",
        )
    layout = Layout(data)
    complete = data.endswith(MAGIC) and len(data) >= 2 * len(MAGIC)
    spans = walk(data, len(MAGIC), len(data) - len(MAGIC) if complete else len(data))
    end = _data_section(layout, spans)
    if not complete or spans.fault is not None or end is None:
        cut = _cut(layout, spans.fault)
        if complete or not recover:
            raise cut
        return _good_part(layout, spans, end, cut)
    _data_end(layout, spans, end)
    _summary(layout, spans, end)
    _check_index(layout)
    return layout


def _good_part(layout: Layout, spans: RecordSpans, end: int | None, cut: CaptureError) -> Layout:
    """The layout of the whole records of a file that lacks its end; nothing proves it complete.

    The summary is not believed, and the last chunk is walked, for its index may be cut off too.
    """
    if spans.opcode.size == 0:
        raise cut
    if end is not None:
        _data_end(layout, spans, end)
        layout.data_crc_holds = False
    if layout.chunks:
        layout.message_indexes[layout.chunks[-1].offset] = []
    _check_size(layout)
    layout.cut = cut
    layout.kept_bytes = int(spans.start[-1] + spans.length[-1])
    return layout


def _cut(layout: Layout, fault: CaptureError | None) -> CaptureError:
    first = layout.messages_seen
    detail = fault.message if fault else "the end of the file is missing"
    return truncated(f"{detail}; {first} messages precede it", (first, first))


def _data_section(layout: Layout, spans: RecordSpans) -> int | None:
    """Take the data section in; the number of its DataEnd record, or None if there is none."""
    if spans.opcode.size == 0:
        return None
    if spans.opcode[0] != rec.HEADER:
        raise corrupt("the first record is not a header")
    header = _fields(layout, spans, 0, "the header")
    header.text()
    header.text()
    ends = np.flatnonzero(spans.opcode == rec.DATA_END)
    end = int(ends[0]) if ends.size else spans.opcode.size
    loose = np.flatnonzero(spans.opcode[:end] == rec.MESSAGE)
    layout.loose_start, layout.loose_length = spans.start[loose], spans.length[loose]
    if np.any(layout.loose_length < rec.MESSAGE_HEAD_BYTES):
        raise corrupt("a message is shorter than its own head")
    for number in np.flatnonzero(spans.opcode[:end] != rec.MESSAGE)[1:]:
        _data_record(layout, spans, int(number))
    return end if ends.size else None


def _fields(layout: Layout, spans: RecordSpans, number: int, what: str) -> Fields:
    start = int(spans.start[number])
    return Fields(layout.data, start, start + int(spans.length[number]), what)


def _data_record(layout: Layout, spans: RecordSpans, number: int) -> None:
    opcode = int(spans.opcode[number])
    if opcode >= rec.FIRST_PRIVATE:
        return
    offset = int(spans.start[number]) - HEAD_BYTES
    length = int(spans.length[number]) + HEAD_BYTES
    if opcode not in _DATA_SECTION:
        raise corrupt(f"the record at byte {offset} (opcode {opcode}) does not belong there")
    fields = _fields(layout, spans, number, f"the record at byte {offset}")
    if opcode in (rec.SCHEMA, rec.CHANNEL):
        layout.definitions.add(opcode, fields)
    elif opcode == rec.CHUNK:
        layout.chunks.append(rec.chunk(fields, offset, length))
        layout.message_indexes[offset] = []
    elif opcode == rec.MESSAGE_INDEX:
        if not layout.chunks:
            raise corrupt(f"the message index at byte {offset} follows no chunk")
        index = rec.message_index(fields, offset, length)
        layout.message_indexes[layout.chunks[-1].offset].append(index)
    elif opcode == rec.ATTACHMENT:
        layout.attachments.append(rec.attachment(fields, offset, length))
    else:
        layout.metadata.append(rec.metadata(fields))
        place = rec.Located(offset, length, (layout.metadata[-1].name,))
        layout.metadata_places.append(place)


def _data_end(layout: Layout, spans: RecordSpans, end: int) -> None:
    stated = _fields(layout, spans, end, "the end of the data section").u32()
    section = memoryview(layout.data)[: int(spans.start[end]) - HEAD_BYTES]
    if stated and stated != crc32(section):
        rows = (0, max(layout.messages_seen - 1, 0))
        raise corrupt("the data section fails its checksum", rows)
    layout.data_crc_holds = stated != 0


def _summary(layout: Layout, spans: RecordSpans, end: int) -> None:
    """Everything after the data section, under the footer's checksum."""
    last = spans.opcode.size - 1
    if last <= end or spans.opcode[last] != rec.FOOTER:
        raise _cut(layout, None)
    footer = _fields(layout, spans, last, "the footer")
    first_byte = int(spans.start[end] + spans.length[end])
    footer_byte = int(spans.start[last]) - HEAD_BYTES
    summary_start, offset_start = footer.u64(), footer.u64()
    covered = memoryview(layout.data)[first_byte : footer.position]
    stated = footer.u32()
    if stated and stated != crc32(covered):
        raise corrupt("the summary section fails its checksum")
    if summary_start != (first_byte if footer_byte > first_byte else 0):
        raise corrupt("the footer points to the wrong place for the summary")
    offsets = [n for n in range(end + 1, last) if spans.opcode[n] == rec.SUMMARY_OFFSET]
    expected = int(spans.start[offsets[0]]) - HEAD_BYTES if offsets else 0
    if offset_start not in (expected, 0 if offsets else footer_byte):
        raise corrupt("the footer points to the wrong place for the summary offsets")
    groups: dict[int, list[int]] = {}
    for number in range(end + 1, last):
        _summary_record(layout, spans, number)
        groups.setdefault(int(spans.opcode[number]), []).append(number)
    for number in offsets:
        _check_group(layout, spans, number, groups)


def _summary_record(layout: Layout, spans: RecordSpans, number: int) -> None:
    opcode = int(spans.opcode[number])
    fields = _fields(layout, spans, number, "the summary")
    if opcode in (rec.SCHEMA, rec.CHANNEL):
        layout.summary_definitions.add(opcode, fields)
    elif opcode == rec.STATISTICS:
        if layout.statistics is not None:
            raise corrupt("the summary holds its statistics twice")
        layout.statistics = rec.statistics(fields)
    elif opcode == rec.CHUNK_INDEX:
        layout.chunk_indexes.append(rec.chunk_index(fields))
    elif opcode == rec.ATTACHMENT_INDEX:
        layout.attachment_indexes.append(rec.attachment_index(fields))
    elif opcode == rec.METADATA_INDEX:
        layout.metadata_indexes.append(rec.metadata_index(fields))
    elif opcode != rec.SUMMARY_OFFSET and opcode < rec.FIRST_PRIVATE:
        raise corrupt(f"a record of opcode {opcode} does not belong in the summary")


def _check_group(
    layout: Layout, spans: RecordSpans, number: int, groups: dict[int, list[int]]
) -> None:
    fields = _fields(layout, spans, number, "a summary offset")
    opcode, start, length = fields.u8(), fields.u64(), fields.u64()
    if not length:
        return
    members = groups.get(opcode, [])
    begin = int(spans.start[members[0]]) - HEAD_BYTES if members else -1
    stop = int(spans.start[members[-1]] + spans.length[members[-1]]) if members else -1
    if (start, start + length) != (begin, stop):
        raise corrupt(f"a summary offset points to the wrong place for opcode {opcode}")


def _check_index(layout: Layout) -> None:
    """The summary's index must name each chunk, attachment and metadata record exactly once."""
    if not layout.chunks:
        check_definitions(layout)
    _check_size(layout)
    if layout.chunk_indexes:
        actual = [_index_of(layout, chunk) for chunk in layout.chunks]
        _match("chunk", layout.chunk_indexes, actual)
    if layout.attachment_indexes:
        _match("attachment", layout.attachment_indexes, layout.attachments)
    if layout.metadata_indexes:
        _match("metadata", layout.metadata_indexes, layout.metadata_places)


def _check_size(layout: Layout) -> None:
    """Each chunk may be modest and a thousand of them a bomb."""
    unpacked_bytes = sum(chunk.size for chunk in layout.chunks)
    if unpacked_bytes > max(MAX_WHOLE_FLOOR_BYTES, MAX_WHOLE_RATIO * len(layout.data)):
        raise too_large(f"its {len(layout.data)} bytes claim to unpack to {unpacked_bytes}")


def check_definitions(layout: Layout) -> None:
    """Refuses a file whose summary changes a definition of its data section.

    Parameters
    ----------
    layout
        The scanned file, with packed definitions read.

    Raises
    ------
    CaptureError
        A definition differs.

    """
    for name in ("schemas", "channels"):
        known = getattr(layout.definitions, name)
        for number, stated in getattr(layout.summary_definitions, name).items():
            if known.get(number) != stated:
                raise corrupt(f"the summary contradicts the data section on the {name}")


def _index_of(layout: Layout, chunk: rec.Chunk) -> rec.ChunkIndex:
    indexes = layout.message_indexes[chunk.offset]
    return rec.ChunkIndex(
        chunk.start_time,
        chunk.end_time,
        chunk.offset,
        chunk.length,
        tuple(sorted((index.channel_id, index.offset) for index in indexes)),
        sum(index.length for index in indexes),
        chunk.compression,
        chunk.packed,
        chunk.size,
    )


def _match(what: str, stated: Iterable[object], actual: Iterable[object]) -> None:
    named, held = list(stated), list(actual)
    if len(named) != len(held):
        raise corrupt(f"the index names {len(named)} {what} records, the file holds {len(held)}")
    if set(named) != set(held):
        raise corrupt(f"the index contradicts the file on a {what} record")
