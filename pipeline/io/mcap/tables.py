"""All samples of a file as raw tables: one a topic and schema, fields still by their own names."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.cdr import CdrDecoder
from pipeline.io.mcap.container import Definitions, Layout
from pipeline.io.mcap.gather import Gathered
from pipeline.io.mcap.joint import JOINT_STATE, QUANTITIES, pick_joint
from pipeline.io.mcap.json_payload import JsonDecoder
from pipeline.io.mcap.leaf import Decoder, Leaf
from pipeline.io.mcap.messages import Batch, batches
from pipeline.io.mcap.protobuf import ProtobufDecoder
from pipeline.io.mcap.protobuf_plan import plan_of
from pipeline.io.mcap.records import Schema
from pipeline.io.mcap.ros2msg import layout_of
from pipeline.io.tables.raw_table import RawTable
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
    gathered: Gathered = field(init=False)

    def __post_init__(self) -> None:
        self.gathered = Gathered(self.topic)

    @property
    def joint_state(self) -> bool:
        return self.schema is not None and self.schema.name in JOINT_STATE


def decoder_of(encoding: str, schema: Schema | None) -> Decoder | None:
    """The decoder of a channel's messages.

    Parameters
    ----------
    encoding
        Of the messages: json, protobuf or cdr.
    schema
        Of the channel, None where it has none.

    Returns
    -------
    Decoder or None
        None where the encoding, or the schema's, carries no samples that are known here.

    Raises
    ------
    CaptureError
        The schema cannot be parsed.

    References
    ----------
    MCAP well-known message and schema encodings, https://mcap.dev/spec/registry.

    """
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
    """Every stream's wanted fields, in order of log time.

    Parameters
    ----------
    layout
        Of the file.
    wanted
        Whether a field of a topic is worth decoding: (topic, dotted name).
    joint
        Name of the joint, for joint states of several.

    Returns
    -------
    list of RawTable
        One a topic and schema, log time in ns from the first message of the file; streams without a
        wanted field are left out.

    Raises
    ------
    CaptureError
        Something in the file is wrong: all of it is read and checked, whatever is wanted.

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
            _decode(stream, batch.of(stream.channels), wanted, joint, len(layout.chunks))
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


def _decode(
    stream: _Stream, batch: Batch, wanted: WantedIn, joint: str | None, batches_in_all: int
) -> None:
    if stream.decoder is None or batch.start.size == 0:
        return
    extra = ("name", *QUANTITIES) if stream.joint_state else ()
    leaves = stream.decoder.decode(batch, lambda name: name in extra or wanted(stream.topic, name))
    if stream.joint_state:
        leaves = pick_joint(batch, leaves, joint)
    leaves = {name: leaf for name, leaf in leaves.items() if not leaf.places}
    stream.gathered.add(leaves, batch.log_time, max(batches_in_all, 1))


def _table(stream: _Stream, first: int) -> RawTable | None:
    leaves = stream.gathered.leaves()
    if not leaves:
        return None
    counts, blocks = _counts(stream.topic, leaves, stream.gathered.messages)
    log_time = stream.gathered.log_time()
    log_time -= np.uint64(first)
    fields: dict[str, NDArray[Any]] = {}
    for name, leaf in leaves.items():
        if counts is not None and leaf.counts is None:
            fields[name] = np.repeat(leaf.values, counts)
        elif leaf.counts is None or leaf.counts.any():
            fields[name] = leaf.values
    if np.any(log_time[1:] < log_time[:-1]):
        if counts is not None:
            log_time, counts = np.repeat(log_time, counts), None
        order = np.argsort(log_time, kind="stable")
        log_time = log_time[order]
        fields = {name: values[order] for name, values in fields.items()}
    return RawTable(stream.topic, fields, log_time, blocks, stream.joint_state, rows_each=counts)


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
