"""Protobuf payloads decoded many messages at a time: one cursor a message, moved together.

Every step reads the tags under all cursors and handles equal tags with a few numpy operations, so
omitted zeros, fields in another order, and nested messages cost no Python loop over messages.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.leaf import Leaf, Wanted, by_message, runs_of, spread
from pipeline.io.mcap.messages import Batch
from pipeline.io.mcap.protobuf_plan import FIXED32, FIXED64, LENGTH, VARINT, Message, Scalar
from pipeline.io.mcap.protobuf_rows import even_shape, shaped_rows
from pipeline.io.mcap.walk import Bytes, Integers, view_at_every_byte
from pipeline.records.errors import CaptureError

_RUN_AFTER = 16
_WIDTH = {FIXED64: 8, FIXED32: 4}


def _bad(what: str) -> CaptureError:
    return CaptureError(
        "bad_message",
        f"a protobuf message {what}",
        "record the test again, with the schema the messages were written with",
    )


@dataclass(slots=True)
class _Events:
    """Occurrences of one field in the order met: whose, where, how many bytes (or which value)."""

    owner: list[Integers] = field(default_factory=list)
    start: list[Integers] = field(default_factory=list)
    extent: list[NDArray[Any]] = field(default_factory=list)
    wire: list[int] = field(default_factory=list)

    def add(self, owner: Integers, start: Integers, extent: NDArray[Any], wire: int) -> None:
        self.owner.append(owner)
        self.start.append(start)
        self.extent.append(extent)
        self.wire.append(wire)


class ProtobufDecoder:
    """Decodes messages of one root type."""

    def __init__(self, plan: Message) -> None:
        self.plan = plan

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
            By dotted name; omitted zeros are 0, absent optional fields NaN.

        """
        if batch.stride and (leaves := self._evenly(batch, wanted)) is not None:
            return leaves
        pass_ = _Pass(batch.buffer, wanted)
        owner = np.arange(batch.start.size, dtype=np.int64)
        spans = _Spans(batch.start, batch.start + batch.length, owner)
        pass_.message(self.plan, "", spans, owner.size)
        return pass_.leaves

    def _evenly(self, batch: Batch, wanted: Wanted) -> dict[str, Leaf] | None:
        """The leaves of evenly spaced messages of one shape, copied by stride."""
        shape = even_shape(batch, self.plan)
        if shape is None:
            return None
        values = dict(shape.values)
        packed = {number: place for number, *place in shape.packed}
        rows = batch.start.size
        leaves: dict[str, Leaf] = {}
        for number, part in self.plan.fields.items():
            if not any(map(wanted, _names(part, ""))):
                continue
            if isinstance(part, Message):
                return None
            if number in values:
                leaves[part.name] = Leaf(batch.at(values[number], part.dtype))
            elif number in packed:
                at, count = packed[number]
                table = batch.table(at, part.dtype, count)
                leaves[part.name] = Leaf(table, np.full(rows, count, np.int64))
            elif part.repeated:
                leaves[part.name] = Leaf(
                    np.empty(0, _storage(part.dtype)), np.zeros(rows, np.int64)
                )
            else:
                leaves[part.name] = Leaf(_absent(part, rows))
        return leaves


@dataclass(frozen=True, slots=True)
class _Spans:
    """Bytes [start, end) of messages, and the row that each belongs to."""

    start: Integers
    end: Integers
    owner: Integers


class _Pass:
    """One decoding of one batch."""

    def __init__(self, buffer: bytes, wanted: Wanted) -> None:
        self.buffer = buffer
        self.raw: Bytes = np.frombuffer(buffer, np.uint8)
        self.wanted = wanted
        self.leaves: dict[str, Leaf] = {}

    def message(
        self,
        plan: Message,
        prefix: str,
        spans: _Spans,
        rows: int,
        counts: Integers | None = None,
    ) -> None:
        """Decode spans into leaves of `rows` values.

        `counts` [messages] is given below a repeated message, whose elements are the rows.
        """
        fields = {
            number: part
            for number, part in plan.fields.items()
            if any(map(self.wanted, _names(part, prefix)))
        }
        events = self.occurrences(plan, fields, spans)
        present = np.zeros(rows, bool)
        present[spans.owner] = True
        for number, part in fields.items():
            of_field = events[number]
            if isinstance(part, Message):
                self.nested(part, prefix, of_field, rows, counts)
            elif not part.repeated:
                self.leaves[prefix + part.name] = Leaf(
                    self.singular(part, of_field, rows, present), counts
                )
            elif counts is None:
                self.leaves[prefix + part.name] = self.repeated(part, of_field, rows)
            else:
                raise _bad(f"has the array {prefix + part.name!r} inside an array")

    def occurrences(
        self, plan: Message, fields: dict[int, Scalar | Message], spans: _Spans
    ) -> dict[int, _Events]:
        """Occurrences of `fields`: messages of the common shapes at once, the rest by cursor."""
        start, end, owner = spans.start, spans.end, spans.owner
        if np.any(np.diff(owner) <= 0):
            return self.events(fields, spans)
        places, unmatched = shaped_rows(self.raw, plan, start, end - start)
        by_cursor = _Spans(start[unmatched], end[unmatched], owner[unmatched])
        events = self.events(fields, by_cursor)
        for number, part in fields.items():
            for rows, at in places.get(number, ()):
                if isinstance(part, Scalar):
                    events[number].add(owner[rows], at, at, part.wire)
        return events

    def nested(
        self, part: Message, prefix: str, events: _Events, rows: int, counts: Integers | None
    ) -> None:
        """A message field: merged into its owner's row, or one row an element if repeated."""
        owner, start, length = _joined(events)
        prefix = f"{prefix}{part.name}."
        if not part.repeated:
            self.message(part, prefix, _Spans(start, start + length, owner), rows, counts)
            return
        if counts is not None:
            raise _bad(f"has the array {prefix[:-1]!r} inside an array")
        order = np.argsort(owner, kind="stable")
        elements = np.arange(order.size, dtype=np.int64)
        per_message = np.bincount(owner, minlength=rows).astype(np.int64)
        spans = _Spans(start[order], start[order] + length[order], elements)
        self.message(part, prefix, spans, order.size, per_message)

    def events(self, fields: dict[int, Scalar | Message], spans: _Spans) -> dict[int, _Events]:
        """Step all cursors through their spans and note the occurrences of `fields`."""
        events = {number: _Events() for number in fields}
        start, end = spans.start, spans.end
        if np.any(end < start) or np.any(end > self.raw.size):
            raise _bad("is longer than its record")
        cursor = start.copy()
        active = np.flatnonzero(cursor < end)
        last_tag, repeats = -1, 0
        while active.size:
            tags, after = self.varint(cursor[active], end[active])
            low, high = int(tags.min()), int(tags.max())
            repeats = repeats + 1 if low == high == last_tag else 0
            last_tag = low if low == high else -1
            for tag in [low] if low == high else np.unique(tags).tolist():
                of_tag = slice(None) if low == high else tags == tag
                rows, value = active[of_tag], after[of_tag]
                part, wire = fields.get(tag >> 3), tag & 7
                if tag >> 3 == 0:
                    raise _bad("has a field numbered 0")
                if repeats >= _RUN_AFTER and wire in _WIDTH and isinstance(part, Scalar):
                    self.runs(events[tag >> 3], tag, rows, value, cursor, spans)
                    continue
                extent, stop = self.extent(wire, value, end[rows])
                if part is not None:
                    _check_wire(part, wire)
                    at = value if wire != LENGTH else stop - extent
                    events[tag >> 3].add(spans.owner[rows], at, extent, wire)
                cursor[rows] = stop
            active = active[cursor[active] < end[active]]
        return events

    def extent(self, wire: int, at: Integers, end: Integers) -> tuple[NDArray[Any], Integers]:
        """Size [bytes] of the values (the value itself of a varint), and where they stop."""
        if wire == VARINT:
            return self.varint(at, end)
        if wire in _WIDTH:
            extent = np.full(at.size, _WIDTH[wire], np.int64)
            stop = at + _WIDTH[wire]
        elif wire == LENGTH:
            size, begin = self.varint(at, end)
            if np.any(size > np.uint64(self.raw.size)):
                raise _bad("has a field that is longer than its record")
            extent = size.astype(np.int64)
            stop = begin + extent
        else:
            raise _bad(f"uses the wire type {wire}")
        if np.any(stop > end):
            raise _bad("ends inside a field")
        return extent, stop

    def varint(self, at: Integers, end: Integers) -> tuple[NDArray[np.uint64], Integers]:
        """Values [n] of the varints at `at`, and where they stop."""
        if np.any(at >= end):
            raise _bad("ends inside a field")
        byte = self.raw[at]
        value = (byte & 0x7F).astype(np.uint64)
        after = at + 1
        more = np.flatnonzero(byte & 0x80)
        shift = 7
        while more.size:
            if shift > 63:
                raise _bad("has a number of more than 64 bits")
            positions = after[more]
            if np.any(positions >= end[more]):
                raise _bad("ends inside a field")
            byte = self.raw[positions]
            value[more] |= (byte & 0x7F).astype(np.uint64) << np.uint64(shift)
            after[more] += 1
            more = more[(byte & 0x80) != 0]
            shift += 7
        return value, after

    def runs(
        self,
        events: _Events,
        tag: int,
        rows: Integers,
        value: Integers,
        cursor: Integers,
        spans: _Spans,
    ) -> None:
        """An unpacked array: per message, all following items of the same tag at once."""
        width = _WIDTH[tag & 7]
        for row, at in zip(rows.tolist(), value.tolist(), strict=True):
            begin, stop = int(cursor[row]), int(spans.end[row])
            stride = at - begin + width
            most = (stop - begin) // stride
            if most == 0:
                raise _bad("ends inside a field")
            equal = np.ones(most, bool)
            for offset in range(at - begin):
                column = np.ndarray((most,), np.uint8, self.buffer, begin + offset, (stride,))
                equal &= column == self.raw[begin + offset]
            count = most if equal.all() else int(np.argmin(equal))
            places = at + stride * np.arange(count, dtype=np.int64)
            size = np.full(count, width, np.int64)
            events.add(np.full(count, spans.owner[row]), places, size, tag & 7)
            cursor[row] = begin + count * stride

    def singular(
        self, part: Scalar, events: _Events, rows: int, present: NDArray[np.bool_]
    ) -> NDArray[Any]:
        """Values [rows] of a scalar field, the last occurrence counting."""
        dtype = np.dtype(_storage(part.dtype))
        values = np.zeros(rows, dtype)
        missing = np.ones(rows, bool) if not part.zero_when_absent else ~present
        for owner, start, extent in zip(events.owner, events.start, events.extent, strict=True):
            values[owner] = self.read(part, start, extent)
            missing[owner] = False
        if missing.any():
            values = values.astype(np.float64)
            values[missing] = np.nan
        return values

    def repeated(self, part: Scalar, events: _Events, rows: int) -> Leaf:
        """Values of an array field, packed or not, in message order."""
        if (
            len(events.owner) == 1
            and events.wire[0] == LENGTH
            and np.all(np.diff(events.owner[0]) > 0)
        ):
            counts = np.zeros(rows, np.int64)
            counts[events.owner[0]], values = self.packed(part, events.start[0], events.extent[0])
            return Leaf(values, counts)
        owners: list[Integers] = []
        pieces: list[NDArray[Any]] = []
        for owner, start, extent, wire in zip(
            events.owner, events.start, events.extent, events.wire, strict=True
        ):
            if wire != LENGTH:
                owners.append(owner)
                pieces.append(self.read(part, start, extent))
                continue
            count, values = self.packed(part, start, extent)
            owners.append(np.repeat(owner, count))
            pieces.append(values)
        if not pieces:
            empty = np.empty(0, _storage(part.dtype))
            return Leaf(empty, np.zeros(rows, np.int64))
        return by_message(np.concatenate(owners), np.concatenate(pieces), rows)

    def packed(
        self, part: Scalar, start: Integers, extent: Integers
    ) -> tuple[Integers, NDArray[Any]]:
        """Counts and values of packed arrays that lie at `start` and have `extent` bytes."""
        if part.wire == VARINT:
            return self.packed_varints(part, start, extent)
        width = _WIDTH[part.wire]
        if np.any(extent % width):
            raise _bad("has a packed array that ends inside an item")
        count: Integers = extent // width
        return count, runs_of(self.buffer, part.dtype, start, count)

    def packed_varints(
        self, part: Scalar, start: Integers, extent: Integers
    ) -> tuple[Integers, NDArray[Any]]:
        """The same for varints: items end where a byte's top bit is clear."""
        places = spread(start, extent, 1)
        whose = np.repeat(np.arange(start.size), extent)
        last = self.raw[places] < 0x80
        stop = np.cumsum(extent)
        if extent.size and not last[stop[extent > 0] - 1].all():
            raise _bad("has a packed array that ends inside an item")
        ends = np.flatnonzero(last)
        begins = np.concatenate(([0], ends[:-1] + 1)) if ends.size else ends
        values, _ = self.varint(places[begins], places[ends] + 1)
        count = np.bincount(whose[ends], minlength=start.size).astype(np.int64)
        return count, _as_type(values, part.dtype)

    def read(self, part: Scalar, start: Integers, extent: NDArray[Any]) -> NDArray[Any]:
        """Values of single occurrences."""
        if part.wire == VARINT:
            return _as_type(extent, part.dtype)
        return view_at_every_byte(self.raw, part.dtype)[start]


def _absent(part: Scalar, rows: int) -> NDArray[Any]:
    """Values [rows] of a scalar field that no message holds."""
    if part.zero_when_absent:
        return np.zeros(rows, np.dtype(_storage(part.dtype)))
    return np.full(rows, np.nan)


def _names(part: Scalar | Message, prefix: str) -> list[str]:
    if isinstance(part, Message):
        return part.names(f"{prefix}{part.name}.")
    return [prefix + part.name]


def _check_wire(part: Scalar | Message, wire: int) -> None:
    expected = LENGTH if isinstance(part, Message) else part.wire
    packed = isinstance(part, Scalar) and part.repeated and wire == LENGTH
    if wire != expected and not packed:
        raise _bad(f"writes the field {part.name!r} in another type than its schema says")


def _storage(dtype: str) -> str:
    return {"zigzag32": "<i4", "zigzag64": "<i8"}.get(dtype, dtype)


def _as_type(values: NDArray[np.uint64], dtype: str) -> NDArray[Any]:
    """Varint values read as their field's type (two's complement or zigzag)."""
    if dtype.startswith("zigzag"):
        unsigned = (values >> np.uint64(1)) ^ (~(values & np.uint64(1)) + np.uint64(1))
        return unsigned.view(np.int64).astype(_storage(dtype))
    if dtype == "?":
        return np.asarray(values != 0)
    return np.asarray(values.astype(dtype))


def _joined(events: _Events) -> tuple[Integers, Integers, Integers]:
    if not events.owner:
        empty = np.empty(0, np.int64)
        return empty, empty, empty
    return (
        np.concatenate(events.owner),
        np.concatenate(events.start),
        np.concatenate(events.extent).astype(np.int64),
    )
