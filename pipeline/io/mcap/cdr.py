"""ROS 2 CDR payloads decoded many messages at a time.

Fields lie in schema order, each aligned to its own size counted from the end of the 4-byte
encapsulation; only strings and sequences make positions differ from message to message.

Reference: OMG DDSI-RTPS 2.5, 10 (encapsulation); OMG DDS-XTypes 1.3, 7.4 (plain CDR).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.leaf import Leaf, Wanted, by_message, runs_of
from pipeline.io.mcap.messages import Batch
from pipeline.io.mcap.ros2msg import Field
from pipeline.io.mcap.walk import Bytes, Integers, view_at_every_byte
from pipeline.records.errors import CaptureError

_ENCAPSULATION = 4
_PADDING = 8
_MAX_ELEMENTS = 4096
_KINDS = {0: (">", 8), 1: ("<", 8), 6: (">", 4), 7: ("<", 4)}
"""Representation identifier: byte order, and the largest alignment (CDR1 8, CDR2 4)."""


def _bad(what: str) -> CaptureError:
    return CaptureError(
        "bad_message",
        f"a CDR message {what}",
        "record the test again, with the schema the messages were written with",
    )


class CdrDecoder:
    """Decodes messages of one root type; `joint` picks one joint where the type is JointState."""

    def __init__(self, layout: tuple[Field, ...]) -> None:
        self.layout = layout
        self._trail: _Trail | None = None

    def decode(self, batch: Batch, wanted: Wanted) -> dict[str, Leaf]:
        """Numeric fields of the messages of one type.

        Parameters
        ----------
        batch
            The messages.
        wanted
            Which fields are needed, by dotted name.

        Returns
        -------
        dict of Leaf
            By dotted name; a string[] field gives the places of its strings.

        Raises
        ------
        CaptureError
            A message does not fit its schema.

        """
        raw: Bytes = np.frombuffer(batch.buffer, np.uint8)
        if batch.start.size == 0:
            return {}
        if self._trail is not None and (known := self._trail.follow(batch)) is not None:
            return known
        if np.any(batch.length < _ENCAPSULATION):
            raise _bad("is shorter than its encapsulation")
        heads = batch.at(0, ">u2") if batch.stride else view_at_every_byte(raw, ">u2")[batch.start]
        if np.any(heads != heads[0]) or int(heads[0]) not in _KINDS:
            raise _bad("has an encapsulation other than plain CDR")
        order, align = _KINDS[int(heads[0])]
        body = _Pass(batch, raw, order, align, wanted)
        for part in self.layout:
            body.field(part, "", None)
        remaining = body.size - body.at
        if np.any(remaining < 0) or np.any(remaining >= _PADDING):
            raise _bad("has another length than its schema gives")
        self._trail = body.trail
        return body.collected()


@dataclass(slots=True)
class _Trail:
    """Where the fields lay in evenly spaced messages, and what must hold to find them there again.

    `checks` are positions with the count that every message has there; `fields` are names with
    position, type and count (None: a single value). All positions are after the encapsulation.
    """

    length: int
    head: int
    order: str
    checks: list[tuple[int, int]] = field(default_factory=list)
    fields: list[tuple[str, int, str, int | None]] = field(default_factory=list)

    def follow(self, batch: Batch) -> dict[str, Leaf] | None:
        """The leaves of a further batch, or None where it must be gone through anew."""
        if not batch.stride or int(batch.length[0]) != self.length:
            return None
        if (batch.at(0, ">u2") != self.head).any():
            return None
        for at, count in self.checks:
            if (batch.at(_ENCAPSULATION + at, self.order + "u4") != count).any():
                return None
        leaves: dict[str, Leaf] = {}
        for name, at, dtype, each in self.fields:
            if each is None:
                leaves[name] = Leaf(batch.at(_ENCAPSULATION + at, dtype))
            else:
                counts = np.full(batch.start.size, each, np.int64)
                leaves[name] = Leaf(batch.table(_ENCAPSULATION + at, dtype, each), counts)
        return leaves


class _Pass:
    """One decoding of one batch. `at` is each message's position after the encapsulation.

    It stays one number while every field so far had a fixed size.
    """

    def __init__(self, batch: Batch, raw: Bytes, order: str, align: int, wanted: Wanted) -> None:
        self.batch = batch
        self.buffer = batch.buffer
        self.raw = raw
        self.order = order
        self.align_most = align
        self.wanted = wanted
        self.origin = batch.start + _ENCAPSULATION
        self.size = batch.length - _ENCAPSULATION
        self.shortest = int(self.size.min())
        self.at: Any = 0
        self.counted_at: Any = 0
        self.whole: dict[str, Leaf] = {}
        self.trail: _Trail | None = None
        if batch.stride:
            head = int(batch.at(0, ">u2")[0])
            self.trail = _Trail(int(batch.length[0]), head, order)
        self.arrays: dict[str, list[tuple[Integers, NDArray[Any]]]] = {}

    def collected(self) -> dict[str, Leaf]:
        """The leaves, pieces of arrays put in message order."""
        leaves = dict(self.whole)
        for name, pieces in self.arrays.items():
            if not pieces:
                leaves[name] = Leaf(np.empty(0), np.zeros(self.origin.size, np.int64))
                continue
            owner, values = (np.concatenate(part) for part in zip(*pieces, strict=True))
            leaves[name] = by_message(owner, values, self.origin.size, places=values.ndim == 2)
        return leaves

    def field(self, part: Field, prefix: str, rows: Integers | None) -> None:
        """Take one field of the messages `rows` (None: all) and move their positions past it."""
        if part.array is None:
            self.single(part, prefix, rows)
        elif part.dtype is None or part.dtype == "string":
            self.elements(part, prefix, rows)
        else:
            self.numbers(part, prefix, rows)

    def single(self, part: Field, prefix: str, rows: Integers | None) -> None:
        if part.dtype is None:
            for inner in part.parts:
                self.field(inner, f"{prefix}{part.name}.", rows)
        elif part.dtype == "string":
            length = self.count(rows)
            start = self.places(rows)
            self.move(length, rows)
            self.note_count(length, rows)
            if self.wanted(prefix + part.name):
                self.trail = None
                text = np.stack([start, length], axis=-1)
                self.keep(prefix + part.name, text, rows)
        else:
            width = np.dtype(part.dtype).itemsize
            self.align(width, rows)
            self.move(width, rows)
            if self.wanted(prefix + part.name):
                if self.trail is not None and self.evenly(rows):
                    place = (prefix + part.name, self.at - width, self.order + part.dtype, None)
                    self.trail.fields.append(place)
                values = self.values(self.order + part.dtype, width, rows)
                self.keep(prefix + part.name, values, rows)

    def note_count(self, counts: Integers, rows: Integers | None) -> None:
        """Notes the count that was just read, or that no trail leads through such messages."""
        even = rows is None and counts.size > 0 and bool((counts == counts[0]).all())
        if self.trail is not None and even and isinstance(self.counted_at, int):
            self.trail.checks.append((self.counted_at, int(counts[0])))
        else:
            self.trail = None

    def evenly(self, rows: Integers | None) -> bool:
        """Whether the position is the same in all of evenly spaced messages."""
        return rows is None and self.batch.stride > 0 and isinstance(self.at, int)

    def values(self, dtype: str, width: int, rows: Integers | None) -> NDArray[Any]:
        """The numbers that the positions were just moved past: a view where evenly spaced."""
        if self.evenly(rows):
            return self.batch.at(_ENCAPSULATION + self.at - width, dtype)
        return view_at_every_byte(self.raw, dtype)[self.places(rows) - width]

    def keep(self, name: str, values: NDArray[Any], rows: Integers | None) -> None:
        if rows is None:
            self.whole[name] = Leaf(values, None, values.ndim == 2)
        else:
            self.arrays.setdefault(name, []).append((rows, values))

    def numbers(self, part: Field, prefix: str, rows: Integers | None) -> None:
        """An array of numbers."""
        if rows is not None and self.wanted(prefix + part.name):
            raise _bad(f"has the array {prefix + part.name!r} inside an array")
        whose = np.arange(self.origin.size) if rows is None else rows
        width = np.dtype(str(part.dtype)).itemsize
        count = self.count(rows) if part.array == 0 else np.full(whose.size, part.array, np.int64)
        if np.any(count > self.size[whose] // width + 1):
            raise _bad("has an array that is longer than the message")
        self.align(width, rows, count > 0)
        if part.array == 0:
            self.note_count(count, rows)
        even = self.evenly(rows) and bool(np.all(count == count[0]))
        first = self.at
        start = count if even else self.places(rows)
        self.move(count * width, rows)
        if not self.wanted(prefix + part.name):
            return
        dtype = self.order + str(part.dtype)
        if even:
            each = int(count[0])
            if self.trail is not None:
                self.trail.fields.append((prefix + part.name, first, dtype, each))
            values = self.batch.table(_ENCAPSULATION + first, dtype, each)
            self.whole[prefix + part.name] = Leaf(values, count)
            return
        self.whole[prefix + part.name] = Leaf(runs_of(self.buffer, dtype, start, count), count)

    def elements(self, part: Field, prefix: str, rows: Integers | None) -> None:
        """An array of messages or strings, element by element over all messages at once."""
        self.trail = None
        whose = np.arange(self.origin.size) if rows is None else rows
        if rows is not None and any(map(self.wanted, part.names(prefix))):
            raise _bad(f"has the array {prefix + part.name!r} inside an array")
        count = self.count(rows) if part.array == 0 else np.full(whose.size, part.array, np.int64)
        if np.any(count > np.minimum(self.size[whose] + 1, _MAX_ELEMENTS)):
            raise _bad("has an array that is longer than the message")
        self.at = np.broadcast_to(self.at, self.origin.shape).copy()
        element = Field(part.name, part.dtype, part.parts, None)
        for name in filter(self.wanted, part.names(prefix)):
            self.arrays.setdefault(name, [])
        for number in range(int(count.max(initial=0))):
            self.single(element, prefix, whose[count > number])
        if rows is None and self.at.size and bool(np.all(self.at == self.at[0])):
            self.at = int(self.at[0])

    def places(self, rows: Integers | None) -> Integers:
        """Byte positions in the buffer of the messages `rows`."""
        return self.origin + self.at if rows is None else self.origin[rows] + self.at[rows]

    def align(self, width: int, rows: Integers | None, only: Any = True) -> None:
        to = min(width, self.align_most)
        if rows is None:
            if only is True or bool(np.all(only)):
                self.at = -(-self.at // to) * to
            else:
                self.at = np.where(only, -(-self.at // to) * to, self.at)
        else:
            positions = self.at[rows]
            self.at[rows] = np.where(only, -(-positions // to) * to, positions)

    def move(self, by: Any, rows: Integers | None) -> None:
        """Move past `by` bytes; past the end of a message is a CaptureError."""
        if rows is None:
            uniform = np.ndim(by) == 1 and by.size and bool(np.all(by == by[0]))
            self.at = self.at + (int(by[0]) if uniform else by)
            over = (
                self.at > self.shortest if isinstance(self.at, int) else np.any(self.at > self.size)
            )
        else:
            self.at[rows] += by
            over = np.any(self.at[rows] > self.size[rows])
        if over:
            raise _bad("ends inside a field")

    def count(self, rows: Integers | None) -> Integers:
        """The 32-bit length before a string or sequence."""
        self.align(4, rows)
        self.counted_at = self.at
        self.move(4, rows)
        return self.values(self.order + "u4", 4, rows).astype(np.int64)
