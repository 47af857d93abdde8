"""Protobuf messages of one shape: same length, same tags at the same places, read without cursors.

A recorder that writes numbers of fixed width gives few shapes: which zeros are left out.
Each shape is learned from one message and proved on all others of its length, tag by tag; what does
not fit, and shapes that few messages have, go the general way.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.messages import Batch
from pipeline.io.mcap.protobuf_plan import FIXED32, FIXED64, Message, Scalar
from pipeline.io.mcap.walk import Bytes, Integers

_WIDTH = {FIXED64: 8, FIXED32: 4}
_MIN_MESSAGES = 256
_MAX_SHAPES = 64


@dataclass(frozen=True, slots=True)
class Shape:
    """Where a message's tags and values are: offset and byte of each tag, value offset by field."""

    tags: tuple[tuple[int, int], ...]
    values: tuple[tuple[int, int], ...]


def shape_of(payload: bytes, plan: Message) -> Shape | None:
    """The shape of a message of fixed-width scalars, each once; None for any other message."""
    tags: list[tuple[int, int]] = []
    values: dict[int, int] = {}
    at = 0
    while at < len(payload):
        number, wire, begin = 0, 0, at
        while True:
            if at >= len(payload) or at - begin > 1:
                return None
            byte = payload[at]
            number |= (byte & 0x7F) << (7 * (at - begin))
            tags.append((at, byte))
            at += 1
            if byte < 0x80:
                break
        number, wire = number >> 3, number & 7
        part = plan.fields.get(number)
        fits = isinstance(part, Scalar) and not part.repeated and part.wire == wire
        if not fits or wire not in _WIDTH or number in values:
            return None
        values[number] = at
        at += _WIDTH[wire]
    return Shape(tuple(tags), tuple(values.items())) if at == len(payload) else None


def shaped_rows(
    raw: Bytes, plan: Message, start: Integers, length: Integers
) -> tuple[dict[int, list[tuple[Integers, Integers]]], NDArray[np.bool_]]:
    """Places of values in messages of the common shapes, and which messages [n] are left over.

    For each field number: pairs of message numbers and byte positions of their values.
    """
    found: dict[int, list[tuple[Integers, Integers]]] = {}
    left = np.ones(start.size, bool)
    shapes = 0
    sizes, counts = np.unique(length, return_counts=True)
    for size in sizes[counts >= _MIN_MESSAGES].tolist():
        members = np.flatnonzero(length == size)
        while members.size >= _MIN_MESSAGES and shapes < _MAX_SHAPES:
            first = int(start[members[0]])
            shape = shape_of(raw[first : first + size].tobytes(), plan)
            if shape is None:
                break
            shapes += 1
            begin = start[members]
            same = np.ones(members.size, bool)
            for offset, byte in shape.tags:
                same &= raw[begin + offset] == byte
            rows = members[same]
            for number, offset in shape.values:
                found.setdefault(number, []).append((rows, start[rows] + offset))
            left[rows] = False
            members = members[~same]
    return found, left


def even_rows(batch: Batch, plan: Message) -> dict[int, int] | None:
    """Value offset by field in evenly spaced messages of one shape; None for any others."""
    first = int(batch.start[0])
    shape = shape_of(batch.buffer[first : first + int(batch.length[0])], plan)
    if shape is None or any(np.any(batch.at(at, "u1") != byte) for at, byte in shape.tags):
        return None
    return dict(shape.values)
