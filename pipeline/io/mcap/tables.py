"""All samples of a file as raw tables: one a topic and schema, fields still by their own names.

Fields of many batches are put together as they come: each value goes to its last place once. Of a
sensor_msgs/JointState one joint's position, velocity and effort are taken.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.mcap.cdr import CdrDecoder
from pipeline.io.mcap.container import Definitions, Layout
from pipeline.io.mcap.first_fault import of_first_message
from pipeline.io.mcap.json_payload import JsonDecoder
from pipeline.io.mcap.leaf import Decoder, Leaf
from pipeline.io.mcap.messages import Batch, batches
from pipeline.io.mcap.protobuf import ProtobufDecoder
from pipeline.io.mcap.protobuf_plan import plan_of
from pipeline.io.mcap.records import Schema
from pipeline.io.mcap.ros2msg import layout_of
from pipeline.io.mcap.walk import Integers
from pipeline.io.tables.raw_table import RawTable
from pipeline.records.errors import CaptureError

WantedIn = Callable[[str, str], bool]
"""Whether a field of a topic is worth decoding: (topic, dotted name)."""
JOINT_STATE = frozenset({"sensor_msgs/msg/JointState", "sensor_msgs/JointState"})
QUANTITIES = ("position", "velocity", "effort")
_SLACK = 1.05


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
            of_stream = batch.of(stream.channels)
            if of_stream.start.size:
                leaves = _decoded(stream, of_stream, wanted, joint, first)
                stream.gathered.add(leaves, of_stream.log_time, max(len(layout.chunks), 1))
    tables = (_table(stream, first or 0) for stream in streams.values())
    return [table for table in tables if table is not None]


def _stream(
    streams: dict[tuple[str, str, Schema | None], _Stream], definitions: Definitions, number: int
) -> _Stream:
    channel = definitions.channel(number)
    schema = definitions.schemas.get(channel.schema_id)
    without_id = None if schema is None else Schema(0, schema.name, schema.encoding, schema.data)
    key = (channel.topic, channel.message_encoding, without_id)
    if key not in streams:
        decoder = decoder_of(channel.message_encoding, schema)
        streams[key] = _Stream(channel.topic, channel.message_encoding, schema, decoder)
    streams[key].channels.append(number)
    return streams[key]


def _decoded(
    stream: _Stream, batch: Batch, wanted: WantedIn, joint: str | None, first_ns: int
) -> dict[str, Leaf]:
    """The leaves of a batch; a CaptureError names the first message at fault."""
    extra = ("name", *QUANTITIES) if stream.joint_state else ()
    decoder = stream.decoder
    if decoder is None:
        return {}

    def decode(messages: Batch) -> dict[str, Leaf]:
        leaves = decoder.decode(messages, lambda n: n in extra or wanted(stream.topic, n))
        return pick_joint(messages, leaves, joint) if stream.joint_state else leaves

    try:
        leaves = decode(batch)
    except CaptureError as fault:
        raise of_first_message(fault, batch, decode, stream.gathered.messages, first_ns) from None
    return {name: leaf for name, leaf in leaves.items() if not leaf.places}


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
                f"a block of {topic} has arrays {first_name!r} and {name!r} of different length "
                f"(message {int(differs[0])})",
                "write every field of a block with one length",
                (row, row),
            )
    return first, True


def pick_joint(batch: Batch, leaves: dict[str, Leaf], joint: str | None) -> dict[str, Leaf]:
    """The quantities of one joint of joint states.

    Parameters
    ----------
    batch
        Messages of the type sensor_msgs/JointState.
    leaves
        Their decoded fields.
    joint
        Name of the joint; None means the only one.

    Returns
    -------
    dict
        Leaves by name: position, velocity and effort [messages] of the joint, a quantity that no
        message holds left out, and the fields that are no arrays.

    Raises
    ------
    CaptureError
        The joint is not stated and several are there, it is missing from a message, or a message
        has another number of values than of names (`joint`).

    References
    ----------
    ROS 2, sensor_msgs/msg/JointState.

    """
    scalars = {name: leaf for name, leaf in leaves.items() if leaf.counts is None}
    names = leaves.get("name")
    if names is None or names.counts is None:
        raise _bad("a joint state has no list of names")
    counts = names.counts
    at = _place(batch, names, counts, joint)
    for quantity in QUANTITIES:
        leaf = leaves.get(quantity)
        if leaf is None or leaf.counts is None or not leaf.counts.any():
            continue
        if np.any((leaf.counts != 0) & (leaf.counts != counts)):
            raise _bad(f"a joint state has another number of {quantity} values than of joints")
        first = np.cumsum(leaf.counts) - leaf.counts
        values = np.full(counts.size, np.nan)
        nonempty = leaf.counts > 0
        values[nonempty] = leaf.values.reshape(-1)[(first + at)[nonempty]]
        scalars[quantity] = Leaf(values)
    return scalars


def _bad(message: str) -> CaptureError:
    return CaptureError(
        "joint", message, "name the joint as `joint` in the metadata or the source map"
    )


def _place(batch: Batch, names: Leaf, counts: Integers, joint: str | None) -> Integers:
    """Place of the joint within each message [messages]."""
    if counts.size == 0 or counts.min() == 0:
        raise _bad("a joint state names no joint")
    start, length = names.values[:, 0], names.values[:, 1]
    if joint is None:
        if counts.max() > 1:
            raise _bad(f"the joint states name {int(counts.max())} joints, none is chosen")
        return np.zeros(counts.size, np.int64)
    target = joint.encode() + b"\0"
    raw = np.frombuffer(batch.buffer, np.uint8)
    equal = length == len(target)
    for offset, byte in enumerate(target):
        equal &= raw[np.minimum(start + offset, raw.size - 1)] == byte
    whose = np.repeat(np.arange(counts.size), counts)
    place = np.arange(whose.size) - np.repeat(np.cumsum(counts) - counts, counts)
    hits = np.bincount(whose[equal], minlength=counts.size)
    if np.any(hits != 1):
        row = int(np.argmax(hits != 1))
        raise CaptureError(
            "joint",
            f"the joint {joint!r} is not there exactly once",
            "check the joint's name with `inspect`",
            (row, row),
        )
    return place[equal].astype(np.int64)


class Column:
    """One field of a stream. Room that was not needed is never touched, so it costs no memory."""

    def __init__(self) -> None:
        self.array: bool | None = None
        self._buffer: NDArray[Any] = np.empty(0)
        self._size = 0
        self._dtype: np.dtype[Any] | None = None
        self._counts: list[NDArray[np.int64]] = []

    def add(self, leaf: Leaf, batches: int) -> None:
        """Takes a batch's values.

        Parameters
        ----------
        leaf
            Of the batch.
        batches
            How many of them may come in all.

        """
        self.array = leaf.counts is not None
        if leaf.counts is not None:
            self._counts.append(leaf.counts)
        self._append(leaf.values, batches)

    def skip(self, messages: int) -> None:
        """Takes in messages that do not hold the field: NaN, or no items.

        Parameters
        ----------
        messages
            How many.

        """
        if self.array:
            self._counts.append(np.zeros(messages, np.int64))
            self._append(np.empty(0), 1)
        else:
            self._append(np.full(messages, np.nan), 1)

    def _append(self, values: NDArray[Any], batches: int) -> None:
        stop = self._size + values.size
        dtype = values.dtype.newbyteorder("=")
        if self._dtype is not None:
            dtype = np.result_type(self._dtype, dtype)
        if dtype != self._dtype or stop > self._buffer.size:
            capacity = max(int(_SLACK * values.size * batches), 2 * self._size, stop)
            moved = np.empty(capacity, dtype)
            moved[: self._size] = self._buffer[: self._size]
            self._buffer, self._dtype = moved, dtype
        self._buffer[self._size : stop].reshape(values.shape)[...] = values
        self._size = stop

    def whole(self) -> Leaf:
        """All that was taken."""
        counts = np.concatenate(self._counts) if self.array else None
        return Leaf(self._buffer[: self._size], counts)


class Gathered:
    """The fields of one stream over all batches so far, and the log times of its messages [ns]."""

    def __init__(self, topic: str) -> None:
        self.topic = topic
        self.messages = 0
        self._columns: dict[str, Column] = {}
        self._times = Column()

    def add(self, leaves: dict[str, Leaf], times: NDArray[np.uint64], batches: int) -> None:
        """Takes in one batch of messages.

        Parameters
        ----------
        leaves
            Its fields by name.
        times
            Log times of its messages [ns].
        batches
            How many batches may come in all, to reserve room.

        Raises
        ------
        CaptureError
            The field is a number in one message and an array in another (`bad_message`).

        """
        for name, leaf in leaves.items():
            if name not in self._columns:
                column = Column()
                column.array = leaf.counts is not None
                if self.messages:
                    column.skip(self.messages)
                self._columns[name] = column
            if self._columns[name].array != (leaf.counts is not None):
                raise CaptureError(
                    "bad_message",
                    f"the field {name!r} of {self.topic} is a number in one message and an array "
                    f"in another (from message {self.messages} on)",
                    "write one sample, or one block, in every message",
                    (self.messages, self.messages),
                )
            self._columns[name].add(leaf, batches)
        for name in self._columns.keys() - leaves.keys():
            self._columns[name].skip(times.size)
        self._times.add(Leaf(times), batches)
        self.messages += times.size

    def leaves(self) -> dict[str, Leaf]:
        """Every field that some batch held, NaN or empty where a batch did not."""
        return {name: column.whole() for name, column in self._columns.items()}

    def log_time(self) -> NDArray[np.uint64]:
        """Log times [messages] in ns."""
        return self._times.whole().values
