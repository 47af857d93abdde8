"""The walker over record lengths: where every record of a region begins, at numpy speed."""

from __future__ import annotations

import struct
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.wire import truncated
from pipeline.records.errors import CaptureError

HEAD_BYTES = 9
"""Opcode (1) and body length (8) before every record's body."""
_HEAD = struct.Struct("<BQ")
_RUN_AFTER = 8
_RUN_BLOCK = 4096

Bytes = NDArray[np.uint8]
Integers = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class RecordSpans:
    """Opcode [n], first body byte [n] and body length [n] of consecutive records.

    `fault` says why the walk stopped before the end, with all whole records before it kept.
    """

    opcode: Bytes
    start: Integers
    length: Integers
    fault: CaptureError | None = None


def view_at_every_byte(data: Bytes | bytes, dtype: str) -> NDArray[np.generic]:
    """Unaligned view whose element i is the `dtype` that begins at byte i.

    Parameters
    ----------
    data
        The bytes.
    dtype
        numpy's name of the type.

    Returns
    -------
    array
        Unaligned and overlapping, without a copy.

    """
    width = np.dtype(dtype).itemsize
    raw = np.frombuffer(data, dtype=np.uint8)
    return np.ndarray((max(raw.size - width + 1, 0),), dtype, raw, 0, (1,))


def walk(data: bytes, start: int, end: int) -> RecordSpans:
    """The records that fill a stretch of bytes.

    Parameters
    ----------
    data
        Bytes of the file.
    start, end
        The stretch [byte], end excluded.

    Returns
    -------
    RecordSpans
        Opcode, start and length of each record's content; with a fault where a record claims more
        bytes than are there, the records before it.

    Notes
    -----
    A record is an opcode of one byte, a length of eight, little-endian, and its content. Equal
    lengths come in runs, so after a few equal records the run is measured with a strided view
    instead of being stepped through.

    References
    ----------
    MCAP Format Specification, version 0, "Records", https://mcap.dev/spec.

    """
    opcodes: list[Bytes] = []
    starts: list[Integers] = []
    lengths: list[Integers] = []
    singles: list[tuple[int, int, int]] = []
    position, previous, equal = start, (-1, -1), 0
    fault = None
    while position < end:
        head = _head(data, position, end)
        if isinstance(head, CaptureError):
            fault = head
            break
        equal = equal + 1 if head == previous else 0
        previous = head
        opcode, length = head
        if equal < _RUN_AFTER:
            singles.append((opcode, position + HEAD_BYTES, length))
            position += HEAD_BYTES + length
            continue
        count = _run(data, position, end, opcode, length)
        _flush(singles, opcodes, starts, lengths)
        stride = HEAD_BYTES + length
        opcodes.append(np.full(count, opcode, np.uint8))
        starts.append(position + HEAD_BYTES + stride * np.arange(count, dtype=np.int64))
        lengths.append(np.full(count, length, np.int64))
        position += stride * count
        equal = 0
    _flush(singles, opcodes, starts, lengths)
    if not opcodes:
        empty = np.empty(0, np.int64)
        return RecordSpans(np.empty(0, np.uint8), empty, empty, fault)
    return RecordSpans(
        np.concatenate(opcodes), np.concatenate(starts), np.concatenate(lengths), fault
    )


def _head(data: bytes, position: int, end: int) -> tuple[int, int] | CaptureError:
    if position + HEAD_BYTES > end:
        return truncated(f"the record at byte {position} is cut off")
    opcode, length = _HEAD.unpack_from(data, position)
    if length > end - position - HEAD_BYTES:
        return truncated(
            f"the record at byte {position} claims {length} bytes, "
            f"{end - position - HEAD_BYTES} are there"
        )
    return opcode, length


def _run(data: bytes, position: int, end: int, opcode: int, length: int) -> int:
    """How many equal records follow one another from here; at least one does."""
    stride = HEAD_BYTES + length
    most = (end - position) // stride
    count = 0
    while count < most:
        block = min(_RUN_BLOCK, most - count)
        offset = position + count * stride
        ops = np.ndarray((block,), np.uint8, data, offset, (stride,))
        sizes = np.ndarray((block,), "<u8", data, offset + 1, (stride,))
        equal = (ops == opcode) & (sizes == length)
        if not equal.all():
            return count + int(np.argmin(equal))
        count += block
    return count


def _flush(
    singles: list[tuple[int, int, int]],
    opcodes: list[Bytes],
    starts: list[Integers],
    lengths: list[Integers],
) -> None:
    if singles:
        table = np.array(singles, dtype=np.int64)
        opcodes.append(table[:, 0].astype(np.uint8))
        starts.append(table[:, 1])
        lengths.append(table[:, 2])
        singles.clear()
