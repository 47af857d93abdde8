"""All samples of a file as raw tables: one a topic and schema, fields still by their own names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.cdr import CdrDecoder
from pipeline.io.mcap.container import Definitions, Layout
from pipeline.io.mcap.joint import JOINT_STATE, QUANTITIES, pick_joint
from pipeline.io.mcap.json_payload import JsonDecoder
from pipeline.io.mcap.leaf import Decoder, Leaf
from pipeline.io.mcap.messages import Batch, batches
from pipeline.io.mcap.protobuf import ProtobufDecoder
from pipeline.io.mcap.protobuf_plan import plan_of
from pipeline.io.mcap.records import Schema
from pipeline.io.mcap.ros2msg import layout_of
from pipeline.io.raw_table import RawTable
from pipeline.records.errors import CaptureError

WantedIn = Callable[[str, str], bool]
"""Whether a field of a topic is worth decoding: (topic, dotted name)."""


@dataclass(slots=True)
class _Stream:
    """One topic's channels of one schema, and what has been decoded of them so far."""

    topic: str
    encoding: str
    schema: Schema | None
    decoder: Decoder | None
    channels: list[int] = field(default_factory=list)
    parts: list[tuple[dict[str, Leaf], NDArray[np.uint64]]] = field(default_factory=list)

    @property
    def joint_state(self) -> bool:
        return self.schema is not None and self.schema.name in JOINT_STATE


def decoder_of(encoding: str, schema: Schema | None) -> Decoder | None:
    """The decoder for a channel, or None where its encoding carries no samples we know."""
    if encoding == "json" and (schema is None or schema.encoding in ("jsonschema", "")):
        return JsonDecoder()
    if schema is None:
        return None
    if encoding == "protobuf" and schema.encoding == "protobuf":
        return ProtobufDecoder(plan_of(schema))
    if encoding == "cdr" and schema.encoding == "ros2msg":
        return CdrDecoder(layout_of(schema))
    return None


def read_tables(layout: Layout, wanted: WantedIn, joint: str | None = None) -> list[RawTable]:
    """Every stream's wanted fields, in order of log time; streams without any are left out.

    The whole file is read and checked, whatever is wanted. Raises CaptureError.
    """
    streams: dict[tuple[str, str, Schema | None], _Stream] = {}
    known: dict[int, _Stream] = {}
    first: int | None = None
    for batch in batches(layout):
        if batch.start.size == 0:
            continue
        low = int(batch.log_time.min())
        first = low if first is None else min(first, low)
        for number in batch.counts():
            if number not in known:
                known[number] = _stream(streams, layout.definitions, number)
        for stream in streams.values():
            _decode(stream, batch.of(stream.channels), wanted, joint)
    tables = (_table(stream, first or 0) for stream in streams.values())
    return [table for table in tables if table is not None]


def _stream(
    streams: dict[tuple[str, str, Schema | None], _Stream],
    definitions: Definitions,
    number: int,
) -> _Stream:
    channel = definitions.channel(number)
    schema = definitions.schemas.get(channel.schema_id)
    same = None if schema is None else Schema(0, schema.name, schema.encoding, schema.data)
    key = (channel.topic, channel.message_encoding, same)
    if key not in streams:
        decoder = decoder_of(channel.message_encoding, schema)
        streams[key] = _Stream(channel.topic, channel.message_encoding, schema, decoder)
    streams[key].channels.append(number)
    return streams[key]


def _decode(stream: _Stream, batch: Batch, wanted: WantedIn, joint: str | None) -> None:
    if stream.decoder is None or batch.start.size == 0:
        return
    extra = ("name", *QUANTITIES) if stream.joint_state else ()
    leaves = stream.decoder.decode(batch, lambda name: name in extra or wanted(stream.topic, name))
    if stream.joint_state:
        leaves = pick_joint(batch, leaves, joint)
    leaves = {name: leaf for name, leaf in leaves.items() if leaf.values.ndim == 1}
    stream.parts.append((leaves, batch.log_time))


def _table(stream: _Stream, first: int) -> RawTable | None:
    names = list(dict.fromkeys(name for leaves, _ in stream.parts for name in leaves))
    if not names:
        return None
    messages = sum(times.size for _, times in stream.parts)
    leaves = {name: _whole(stream, name) for name in names}
    counts, blocks = _counts(stream.topic, leaves, messages)
    log_time = np.concatenate([times for _, times in stream.parts])
    log_time -= np.uint64(first)
    ordered = not np.any(log_time[1:] < log_time[:-1])
    fields: dict[str, NDArray[Any]] = {}
    for name, leaf in leaves.items():
        if counts is not None and leaf.counts is None:
            fields[name] = np.repeat(leaf.values, counts)
        elif leaf.counts is None or leaf.counts.any():
            fields[name] = leaf.values
    if counts is not None:
        log_time = np.repeat(log_time, counts)
    if not ordered:
        order = np.argsort(log_time, kind="stable")
        log_time = log_time[order]
        fields = {name: values[order] for name, values in fields.items()}
    return RawTable(stream.topic, fields, log_time, blocks, stream.joint_state)


def _whole(stream: _Stream, name: str) -> Leaf:
    """One field over all batches; NaN, or no items, where a batch does not hold it."""
    parts = [(leaves.get(name), times.size) for leaves, times in stream.parts]
    arrays = {leaf.counts is not None for leaf, _ in parts if leaf is not None}
    if len(arrays) > 1:
        raise CaptureError(
            "bad_message",
            f"the field {name!r} of {stream.topic} is a number here and an array there",
            "write one sample, or one block, in every message",
        )
    is_array = arrays == {True}
    values: list[NDArray[Any]] = []
    counts: list[NDArray[np.int64]] = []
    for leaf, size in parts:
        if leaf is None:
            values.append(np.empty(0) if is_array else np.full(size, np.nan))
            counts.append(np.zeros(size, np.int64))
        else:
            values.append(leaf.values)
            if leaf.counts is not None:
                counts.append(leaf.counts)
    return Leaf(np.concatenate(values), np.concatenate(counts) if is_array else None)


def _counts(
    topic: str, leaves: dict[str, Leaf], messages: int
) -> tuple[NDArray[np.int64] | None, bool]:
    """Rows of each message, None where each is one sample; and whether messages are blocks."""
    arrays = {
        name: leaf.counts
        for name, leaf in leaves.items()
        if leaf.counts is not None and leaf.counts.any()
    }
    if not arrays:
        empty = all(leaf.counts is not None for leaf in leaves.values())
        return (np.zeros(messages, np.int64), True) if empty else (None, False)
    first_name, first = next(iter(arrays.items()))
    for name, counts in arrays.items():
        differs = np.flatnonzero(counts != first)
        if differs.size:
            row = int(first[: differs[0]].sum())
            raise CaptureError(
                "ragged_block",
                f"a block of {topic} has arrays {first_name!r} and {name!r} of different length",
                "write every field of a block with one length",
                (row, row),
            )
    return first, True
