"""The records of an MCAP file as frozen nouns, each parsed with every length checked."""

from __future__ import annotations

from dataclasses import dataclass

from isal.isal_zlib import crc32

from pipeline.io.mcap.limits import (
    MAX_CHUNK_BYTES,
    MAX_RATIO,
    MAX_RATIO_FLOOR_BYTES,
    MAX_SCHEMA_BYTES,
)
from pipeline.io.mcap.wire import Fields, corrupt, too_large

HEADER, FOOTER, SCHEMA, CHANNEL, MESSAGE, CHUNK, MESSAGE_INDEX, CHUNK_INDEX = range(1, 9)
ATTACHMENT, ATTACHMENT_INDEX, STATISTICS, METADATA, METADATA_INDEX = range(9, 14)
SUMMARY_OFFSET, DATA_END = 14, 15
FIRST_PRIVATE = 0x80
MESSAGE_HEAD_BYTES = 22
"""Channel (2), sequence (4), log time (8) and publish time (8) before a message's payload."""


@dataclass(frozen=True, slots=True)
class Schema:
    """How the messages of a channel are laid out."""

    id: int
    name: str
    encoding: str
    data: bytes


@dataclass(frozen=True, slots=True)
class Channel:
    """A stream of messages of one encoding; schema 0 means none."""

    id: int
    schema_id: int
    topic: str
    message_encoding: str
    metadata: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Chunk:
    """A packed run of records: where it lies and what it claims."""

    offset: int
    length: int
    start_time: int
    end_time: int
    size: int
    crc: int
    compression: str
    begin: int
    end: int

    @property
    def packed(self) -> int:
        """Packed bytes."""
        return self.end - self.begin


@dataclass(frozen=True, slots=True)
class MessageIndex:
    """Where a channel's messages lie in the chunk before: bytes [begin, end) of the file."""

    offset: int
    length: int
    channel_id: int
    begin: int
    end: int

    @property
    def count(self) -> int:
        """How many messages it lists."""
        return (self.end - self.begin) // 16


@dataclass(frozen=True, slots=True)
class ChunkIndex:
    """The summary's claim on one chunk."""

    start_time: int
    end_time: int
    offset: int
    length: int
    message_indexes: tuple[tuple[int, int], ...]
    message_index_length: int
    compression: str
    packed: int
    size: int


@dataclass(frozen=True, slots=True)
class Located:
    """An attachment or metadata record: where it lies and what its index must say."""

    offset: int
    length: int
    facts: tuple[object, ...]


@dataclass(frozen=True, slots=True)
class Metadata:
    """A named map of text."""

    name: str
    entries: tuple[tuple[str, str], ...]


@dataclass(frozen=True, slots=True)
class Statistics:
    """The summary's claim on how much there is."""

    messages: int
    schemas: int
    channels: int
    attachments: int
    metadata: int
    chunks: int
    start_time: int
    end_time: int
    per_channel: tuple[tuple[int, int], ...]


def schema(fields: Fields) -> Schema:
    """Parses a Schema record.

    Parameters
    ----------
    fields
        Of the record.

    Raises
    ------
    CaptureError
        The id is 0, or the schema is too large.

    """
    schema_read = Schema(fields.u16(), fields.text(), fields.text(), fields.blob())
    if schema_read.id == 0:
        raise corrupt("a schema has the id 0")
    if len(schema_read.data) > MAX_SCHEMA_BYTES:
        raise too_large(f"the schema {schema_read.name!r} has {len(schema_read.data)} bytes")
    return schema_read


def channel(fields: Fields) -> Channel:
    """Parses a Channel record.

    Parameters
    ----------
    fields
        Of the record.

    """
    number, schema_id = fields.u16(), fields.u16()
    topic, encoding = fields.text(), fields.text()
    return Channel(number, schema_id, topic, encoding, tuple(sorted(fields.text_map().items())))


def chunk(fields: Fields, offset: int, length: int) -> Chunk:
    """Parses the head of a Chunk record.

    Parameters
    ----------
    fields
        Of the record.
    offset
        Where it begins in the file [bytes].
    length
        Of the record [bytes].

    Returns
    -------
    Chunk
        Its claims are checked against the limits before it is unpacked.

    Raises
    ------
    CaptureError
        It claims to unpack to too much, or ends before it starts.

    """
    start_time, end_time, size, crc = fields.u64(), fields.u64(), fields.u64(), fields.u32()
    compression = fields.text()
    begin, end = fields.span(fields.u64())
    if size > MAX_CHUNK_BYTES:
        raise too_large(f"the chunk at byte {offset} claims to unpack to {size} bytes")
    if size > MAX_RATIO_FLOOR_BYTES and size > MAX_RATIO * max(end - begin, 1):
        raise too_large(
            f"the chunk at byte {offset} claims to unpack {end - begin} bytes to {size}"
        )
    if start_time > end_time:
        raise corrupt(f"the chunk at byte {offset} ends before it starts")
    return Chunk(offset, length, start_time, end_time, size, crc, compression, begin, end)


def message_index(fields: Fields, offset: int, length: int) -> MessageIndex:
    """Parses the head of a MessageIndex record; its entries stay where they are.

    Parameters
    ----------
    fields
        Of the record.
    offset
        Where it begins in the file [bytes].
    length
        Of the record [bytes].

    """
    channel_id = fields.u16()
    begin, end = fields.span(fields.u32())
    if (end - begin) % 16:
        raise corrupt(f"the message index at byte {offset} holds a partial entry")
    return MessageIndex(offset, length, channel_id, begin, end)


def chunk_index(fields: Fields) -> ChunkIndex:
    """Parses a ChunkIndex record.

    Parameters
    ----------
    fields
        Of the record.

    """
    start_time, end_time, offset, length = (fields.u64() for _ in range(4))
    head = start_time, end_time, offset, length, tuple(sorted(fields.counts()))
    return ChunkIndex(*head, fields.u64(), fields.text(), fields.u64(), fields.u64())


def attachment(fields: Fields, offset: int, length: int) -> Located:
    """Checks the checksum of an Attachment and keeps what its index must repeat.

    Parameters
    ----------
    fields
        Of the record.
    offset
        Where it begins in the file [bytes].
    length
        Of the record [bytes].

    """
    begin = fields.position
    log_time, create_time, name, media = fields.u64(), fields.u64(), fields.text(), fields.text()
    size = fields.u64()
    fields.span(size)
    covered = fields.position
    crc = fields.u32()
    if crc and crc != crc32(memoryview(fields.data)[begin:covered]):
        raise corrupt(f"the attachment {name!r} at byte {offset} fails its checksum")
    return Located(offset, length, (log_time, create_time, size, name, media))


def attachment_index(fields: Fields) -> Located:
    """Parses an AttachmentIndex record.

    Parameters
    ----------
    fields
        Of the record.

    """
    offset, length, log_time, create_time, size = (fields.u64() for _ in range(5))
    return Located(offset, length, (log_time, create_time, size, fields.text(), fields.text()))


def metadata(fields: Fields) -> Metadata:
    """Parses a Metadata record.

    Parameters
    ----------
    fields
        Of the record.

    """
    return Metadata(fields.text(), tuple(fields.text_map().items()))


def metadata_index(fields: Fields) -> Located:
    """Parses a MetadataIndex record.

    Parameters
    ----------
    fields
        Of the record.

    """
    return Located(fields.u64(), fields.u64(), (fields.text(),))


def statistics(fields: Fields) -> Statistics:
    """Parses a Statistics record.

    Parameters
    ----------
    fields
        Of the record.

    """
    counts = fields.u64(), fields.u16(), fields.u32(), fields.u32(), fields.u32(), fields.u32()
    times = fields.u64(), fields.u64()
    return Statistics(*counts, *times, tuple(sorted(fields.counts())))
