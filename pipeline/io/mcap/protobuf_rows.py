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
from pipeline.io.mcap.protobuf_plan import FIXED32, FIXED64, LENGTH, Message, Scalar
from pipeline.io.mcap.walk import Bytes, Integers

_WIDTH = {FIXED64: 8, FIXED32: 4}
_MIN_MESSAGES = 256
_MAX_SHAPES = 64


@dataclass(frozen=True, slots=True)
class Shape:
    """Where a message's tags and values are: offset and byte of each tag, value offset by field.

    Lengths of packed arrays count as tags; `packed` are field, offset and count of each array.
    """

    tags: tuple[tuple[int, int], ...]
    values: tuple[tuple[int, int], ...]
    packed: tuple[tuple[int, int, int], ...] = ()


def _varint(payload: bytes, at: int, most_bytes: int) -> tuple[int, int] | None:
    """A number and where it ends; None where it is longer than that or cut off."""
    value = 0
    for n, byte in enumerate(payload[at : at + most_bytes]):
        value |= (byte & 0x7F) << (7 * n)
        if byte < 0x80:
            return value, at + n + 1
    return None


def shape_of(payload: bytes, plan: Message) -> Shape | None:
    """Where tags and values of a message lie.

    Parameters
    ----------
    payload
        The message.
    plan
        Its fields.

    Returns
    -------
    Shape or None
        None unless it consists of fixed-width scalars, single or packed, each once.

    """
    marks: list[tuple[int, int]] = []
    values: dict[int, int] = {}
    packed: dict[int, tuple[int, int]] = {}
    at = 0
    while at < len(payload):
        begin, tag = at, _varint(payload, at, 2)
        if tag is None:
            return None
        number, wire, at = tag[0] >> 3, tag[0] & 7, tag[1]
        part = plan.fields.get(number)
        if not isinstance(part, Scalar) or part.wire not in _WIDTH:
            return None
        if number in values or number in packed:
            return None
        if wire == part.wire and not part.repeated:
            values[number] = at
            end = at + _WIDTH[wire]
        elif wire == LENGTH and part.repeated:
            size = _varint(payload, at, 4)
            if size is None or size[0] % _WIDTH[part.wire]:
                return None
            at = size[1]
            packed[number] = at, size[0] // _WIDTH[part.wire]
            end = at + size[0]
        else:
            return None
        marks += enumerate(payload[begin:at], begin)
        at = end
    arrays = tuple((number, *place) for number, place in packed.items())
    return Shape(tuple(marks), tuple(values.items()), arrays) if at == len(payload) else None


def shaped_rows(
    raw: Bytes, plan: Message, start: Integers, length: Integers
) -> tuple[dict[int, list[tuple[Integers, Integers]]], NDArray[np.bool_]]:
    """Places of values in messages of the common shapes.

    Parameters
    ----------
    raw
        The buffer.
    plan
        Fields of the messages.
    start
        Where each message begins [n].
    length
        How long it is [n].

    Returns
    -------
    tuple
        For each field number pairs of message numbers and byte positions of their values; and which
        messages [n] have another shape.

    """
    by_shape: dict[int, list[tuple[Integers, Integers]]] = {}
    unmatched = np.ones(start.size, bool)
    shapes = 0
    sizes, counts = np.unique(length, return_counts=True)
    for size in sizes[counts >= _MIN_MESSAGES].tolist():
        members = np.flatnonzero(length == size)
        while members.size >= _MIN_MESSAGES and shapes < _MAX_SHAPES:
            first = int(start[members[0]])
            shape = shape_of(raw[first : first + size].tobytes(), plan)
            if shape is None or shape.packed:
                break
            shapes += 1
            begin = start[members]
            equal = np.ones(members.size, bool)
            for offset, byte in shape.tags:
                equal &= raw[begin + offset] == byte
            rows = members[equal]
            for number, offset in shape.values:
                by_shape.setdefault(number, []).append((rows, start[rows] + offset))
            unmatched[rows] = False
            members = members[~equal]
    return by_shape, unmatched


def even_shape(batch: Batch, plan: Message) -> Shape | None:
    """The shape of evenly spaced messages that all have the shape of the first.

    Parameters
    ----------
    batch
        The messages.
    plan
        Their fields.

    Returns
    -------
    Shape or None
        None for any other messages.

    """
    first = int(batch.start[0])
    shape = shape_of(batch.buffer[first : first + int(batch.length[0])], plan)
    if shape is None or any((batch.at(at, "u1") != byte).any() for at, byte in shape.tags):
        return None
    return shape
