"""Messages out of chunks: unpacked within limits, checksummed, and checked against their index."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap import records as rec
from pipeline.io.mcap.container import Definitions, Layout, check_definitions
from pipeline.io.mcap.unpack import unpack
from pipeline.io.mcap.walk import HEAD_BYTES, Integers, view_at_every_byte, walk
from pipeline.io.mcap.wire import Fields, corrupt

_BATCH_BYTES = 8 * 2**20
_ALONE_BYTES = 2**18
"""Chunks of this size are batches of their own; smaller ones are put together."""


_HEADS = np.dtype(
    {
        "names": ["opcode", "length", "channel", "log_time"],
        "formats": ["u1", "<u8", "<u2", "<u8"],
        "offsets": [0, 1, HEAD_BYTES, HEAD_BYTES + 6],
        "itemsize": HEAD_BYTES + rec.MESSAGE_HEAD_BYTES,
    }
)


@dataclass(frozen=True, slots=True)
class Batch:
    """Messages in one buffer.

    Attributes
    ----------
    buffer
        The bytes.
    start, length
        Of each payload [n, bytes].
    channel
        Of each message [n].
    log_time
        Of each message [n, ns].
    stride
        Distance between payloads where all have one length and one channel, else 0.

    """

    buffer: bytes
    start: Integers
    length: Integers
    channel: NDArray[np.uint16]
    log_time: NDArray[np.uint64]
    stride: int = 0

    def at(self, offset: int, dtype: str) -> NDArray[Any]:
        """Values at one offset of every payload, where there is a stride.

        Parameters
        ----------
        offset
            Bytes from the begin of the payload.
        dtype
            numpy's name of the type.

        Returns
        -------
        array [n]
            A view.

        """
        first = int(self.start[0]) + offset
        return np.ndarray((self.start.size,), dtype, self.buffer, first, (self.stride,))

    def table(self, offset: int, dtype: str, count: int) -> NDArray[Any]:
        """Arrays at one offset of every payload, where there is a stride.

        Parameters
        ----------
        offset
            Bytes from the begin of the payload.
        dtype
            numpy's name of the type.
        count
            Items an array.

        Returns
        -------
        array [n, count]
            A view.

        """
        first = int(self.start[0]) + offset
        strides = (self.stride, np.dtype(dtype).itemsize)
        return np.ndarray((self.start.size, count), dtype, self.buffer, first, strides)

    def counts(self) -> dict[int, int]:
        """How many messages each channel has."""
        if self.stride:
            return {int(self.channel[0]): self.start.size}
        channels, counts = np.unique(self.channel, return_counts=True)
        return dict(zip(channels.tolist(), counts.tolist(), strict=True))

    def of(self, channels: list[int]) -> Batch:
        """The messages of some channels, in file order.

        Parameters
        ----------
        channels
            Their ids.

        """
        if self.stride and int(self.channel[0]) in channels:
            return self
        keep = np.isin(self.channel, channels)
        return self if keep.all() else replace(self.rows(keep), stride=0)

    def rows(self, which: NDArray[np.bool_] | slice) -> Batch:
        """Some of the messages, in file order.

        Parameters
        ----------
        which
            A mask or a slice of the messages; one that keeps gaps keeps no stride.

        """
        names = ("start", "length", "channel", "log_time")
        return replace(self, **{name: getattr(self, name)[which] for name in names})


def batches(layout: Layout) -> Iterator[Batch]:
    """All messages of a file in batches of several chunks.

    Parameters
    ----------
    layout
        As `scan` found it; it learns the schemas and channels that lie in chunks.

    Yields
    ------
    Batch
        Messages with their channel, log time and the place of their payload, in the file's order.

    Raises
    ------
    CaptureError
        A chunk, its index, a definition or, once all are through, the statistics contradict the
        file (`corrupt`).

    """
    ledger = _Ledger(layout.definitions)
    for batch in _all(layout):
        ledger.add(batch)
        yield batch
    ledger.close(layout)


def count_messages(layout: Layout) -> int:
    """How many messages a file holds.

    Parameters
    ----------
    layout
        The scanned file.

    Returns
    -------
    int
        Each message is unpacked and checked as when it is decoded.

    """
    return sum(int(batch.start.size) for batch in batches(layout))


def _all(layout: Layout) -> Iterator[Batch]:
    if layout.loose_start.size:
        yield _batch(layout.data, layout.loose_start, layout.loose_length)
    pending: list[bytes] = []
    spans: list[tuple[Integers, Integers]] = []
    held = 0
    first = int(layout.loose_start.size)
    for chunk in layout.chunks:
        buffer = unpack(layout.data, chunk, first)
        alone = len(buffer) >= _ALONE_BYTES
        if pending and (alone or held >= _BATCH_BYTES):
            yield _join(pending, spans)
            pending, spans, held = [], [], 0
        if alone:
            batch = _regular(layout, chunk, buffer) or _batch(
                buffer, *_in_chunk(layout, chunk, buffer)
            )
            first += batch.start.size
            yield batch
            continue
        start, length = _in_chunk(layout, chunk, buffer)
        first += start.size
        pending.append(buffer)
        spans.append((start + held, length))
        held += len(buffer)
    if pending:
        yield _join(pending, spans)


def _regular(layout: Layout, chunk: rec.Chunk, buffer: bytes) -> Batch | None:
    """The messages of a chunk of one channel, evenly spaced and of one length; None otherwise.

    The index is proved against every message as in `_indexed`, by views with a stride.
    """
    indexes = layout.message_indexes[chunk.offset]
    if len(indexes) != 1 or indexes[0].count < 2:
        return None
    count, number = indexes[0].count, indexes[0].channel_id
    table = np.frombuffer(layout.data, "<u8", 2 * count, indexes[0].begin).reshape(-1, 2)
    first, stride = int(table[0, 1]), int(table[1, 1]) - int(table[0, 1])
    head = HEAD_BYTES + rec.MESSAGE_HEAD_BYTES
    if stride < head or first + count * stride > len(buffer):
        return None
    rows = np.ndarray((count,), _HEADS, buffer, first, (stride,))
    times = table[:, 0]
    if (
        np.any(table[:, 1] != np.arange(first, first + count * stride, stride, dtype=np.uint64))
        or np.any(rows["opcode"] != rec.MESSAGE)
        or np.any(rows["length"] != stride - HEAD_BYTES)
        or np.any(rows["channel"] != number)
        or np.any(rows["log_time"] != times)
        or times.min() < chunk.start_time
        or times.max() > chunk.end_time
    ):
        return None  # what is wrong with it, if anything, is reported by the general way
    definitions, stop = layout.definitions, first + count * stride
    _walked(definitions, buffer, 0, first, allow_messages=False)
    _walked(definitions, buffer, stop, len(buffer), allow_messages=False)
    start = np.arange(first + head, stop + head, stride, dtype=np.int64)
    length = np.full(count, stride - head, np.int64)
    channel = np.full(count, number, np.uint16)
    return Batch(buffer, start, length, channel, times.astype(np.uint64), stride)


def _join(pending: list[bytes], spans: list[tuple[Integers, Integers]]) -> Batch:
    buffer = pending[0] if len(pending) == 1 else b"".join(pending)
    start = np.concatenate([span[0] for span in spans])
    length = np.concatenate([span[1] for span in spans])
    return _batch(buffer, start, length)


def _batch(buffer: bytes, start: Integers, length: Integers) -> Batch:
    head = rec.MESSAGE_HEAD_BYTES
    if start.size == 0:
        nothing = np.empty(0, np.uint64)
        return Batch(buffer, start, length, nothing.astype(np.uint16), nothing)
    channel = view_at_every_byte(buffer, "<u2")[start].astype(np.uint16)
    log_time = view_at_every_byte(buffer, "<u8")[start + 6].astype(np.uint64)
    return Batch(buffer, start + head, length - head, channel, log_time)


def _in_chunk(layout: Layout, chunk: rec.Chunk, buffer: bytes) -> tuple[Integers, Integers]:
    """Body start and length [n] of the chunk's messages, in order of their place."""
    indexes = layout.message_indexes[chunk.offset]
    if not indexes:
        start, length = _walked(layout.definitions, buffer, 0, len(buffer), allow_messages=True)
    else:
        start, length = _indexed(layout, chunk, buffer, indexes)
    if np.any(length < rec.MESSAGE_HEAD_BYTES):
        raise corrupt(f"a message in the chunk at byte {chunk.offset} is shorter than its own head")
    if start.size:
        times = view_at_every_byte(buffer, "<u8")[start + 6]
        if times.min() < chunk.start_time or times.max() > chunk.end_time:
            raise corrupt(f"the chunk at byte {chunk.offset} holds messages outside its own times")
    return start, length


def _walked(
    definitions: Definitions, buffer: bytes, begin: int, end: int, *, allow_messages: bool
) -> tuple[Integers, Integers]:
    """Step over the records of [begin, end), learn the definitions, return the messages."""
    spans = walk(buffer, begin, end)
    if spans.fault is not None:
        raise corrupt(f"inside a chunk {spans.fault.message}")
    messages = spans.opcode == rec.MESSAGE
    if messages.any() and not allow_messages:
        raise corrupt("a chunk holds a message that its index leaves out")
    for number in np.flatnonzero(~messages):
        opcode, start = int(spans.opcode[number]), int(spans.start[number])
        if opcode in (rec.SCHEMA, rec.CHANNEL):
            stop = start + int(spans.length[number])
            definitions.add(opcode, Fields(buffer, start, stop, "a chunk"))
        elif opcode < rec.FIRST_PRIVATE:
            raise corrupt(f"a record of opcode {opcode} does not belong in a chunk")
    return spans.start[messages], spans.length[messages]


def _indexed(
    layout: Layout, chunk: rec.Chunk, buffer: bytes, indexes: list[rec.MessageIndex]
) -> tuple[Integers, Integers]:
    """The messages as the index places them, proved: right channel and time, none left out."""
    entries = [
        np.frombuffer(layout.data, "<u8", 2 * index.count, index.begin).reshape(-1, 2)
        for index in indexes
    ]
    channel = np.repeat([index.channel_id for index in indexes], [len(e) for e in entries])
    table = np.concatenate(entries)
    where = f"the message index of the chunk at byte {chunk.offset}"
    if np.any(table[:, 1] > max(len(buffer) - HEAD_BYTES - rec.MESSAGE_HEAD_BYTES, 0)):
        raise corrupt(f"{where} points outside the chunk")
    order = np.argsort(table[:, 1], kind="stable")
    offset = table[order, 1].astype(np.int64)
    if offset.size == 0:
        return _walked(layout.definitions, buffer, 0, len(buffer), allow_messages=False)
    words = view_at_every_byte(buffer, "<u8")
    size = words[offset + 1]
    if np.any(size > len(buffer)):
        raise corrupt(f"{where} points to no message")
    length = size.astype(np.int64)
    stop = offset + HEAD_BYTES + length
    begin = np.append(offset, len(buffer))
    if np.any(stop > begin[1:]):
        raise corrupt(f"{where} points to messages that overlap")
    raw = np.frombuffer(buffer, np.uint8)
    halves = view_at_every_byte(buffer, "<u2")
    if (
        np.any(raw[offset] != rec.MESSAGE)
        or np.any(halves[offset + HEAD_BYTES] != channel[order])
        or np.any(words[offset + HEAD_BYTES + 6] != table[order, 0])
    ):
        raise corrupt(f"{where} contradicts the messages")
    _walked(layout.definitions, buffer, 0, int(offset[0]), allow_messages=False)
    for gap in np.flatnonzero(stop != begin[1:]):
        _walked(
            layout.definitions, buffer, int(stop[gap]), int(begin[gap + 1]), allow_messages=False
        )
    return offset + HEAD_BYTES, length


class _Ledger:
    """Counts what is handed out and holds it against definitions and statistics."""

    def __init__(self, definitions: Definitions) -> None:
        self.definitions = definitions
        self.counts: dict[int, int] = {}
        self.first: int | None = None
        self.last: int | None = None

    def add(self, batch: Batch) -> None:
        """Count one batch; a message of an undefined channel is corrupt."""
        if batch.start.size == 0:
            return
        for channel, count in batch.counts().items():
            self.definitions.channel(channel)
            self.counts[channel] = self.counts.get(channel, 0) + count
        low, high = int(batch.log_time.min()), int(batch.log_time.max())
        self.first = low if self.first is None else min(self.first, low)
        self.last = high if self.last is None else max(self.last, high)

    def close(self, layout: Layout) -> None:
        """Hold the summary's definitions and statistics against what was handed out."""
        check_definitions(layout)
        stated = layout.statistics
        if stated is None:
            return
        counted = rec.Statistics(
            sum(self.counts.values()),
            len(self.definitions.schemas),
            len(self.definitions.channels),
            len(layout.attachments),
            len(layout.metadata),
            len(layout.chunks),
            self.first or 0,
            self.last or 0,
            tuple(sorted(self.counts.items())),
        )
        nonzero = tuple((channel, count) for channel, count in stated.per_channel if count)
        if (stated.messages, nonzero) != (counted.messages, counted.per_channel):
            raise corrupt(
                f"the statistics name {stated.messages} messages, the file holds {counted.messages}"
            )
        for name in ("schemas", "channels", "attachments", "metadata", "chunks"):
            if getattr(stated, name) != getattr(counted, name):
                raise corrupt(f"the statistics contradict the file on its {name}")
        if (stated.start_time, stated.end_time) != (counted.start_time, counted.end_time):
            raise corrupt("the statistics contradict the file on its first or last time")
