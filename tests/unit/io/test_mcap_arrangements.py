"""The same samples however a recorder lays them out: the ways that are quick give what is there.

Messages of one length in a row, in one chunk or many, alone or between those of another topic, are
read in strides; whatever breaks the stride must be noticed. Values are written by struct, the
protobuf library and json, none of which the reader uses so.
"""

from __future__ import annotations

import json
import struct
from functools import cache
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto
from mcap.writer import CompressionType

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, json_messages, mcap_file, protobuf_schema

N = 3000
LARGE = 1 << 18
"""From this many bytes on a chunk is read alone."""
Message = tuple[str, int, bytes]


def fill(file: Any) -> None:
    message = file.message_type.add(name="M")
    message.field.add(name="a", number=1, type=FieldDescriptorProto.TYPE_DOUBLE, label=1)
    message.field.add(name="many", number=2, type=FieldDescriptorProto.TYPE_FLOAT, label=3)
    message.field.add(name="flag", number=3, type=FieldDescriptorProto.TYPE_FIXED32, label=1)


PROTOBUF, ProtobufMessage = protobuf_schema(fill)


def cdr(n: int, items: int) -> bytes:
    """A number, an array of `items` numbers and a flag."""
    many = [float(n + k) for k in range(items)]
    return b"\0\1\0\0" + struct.pack(f"<dI{items}fI", 0.5 * n, items, *many, n % 7 + 1)


def protobuf(n: int, items: int) -> bytes:
    many = [float(n + k) for k in range(items)]
    return ProtobufMessage(a=0.5 * n, many=many, flag=n % 7 + 1).SerializeToString()


def text(n: int, items: int) -> bytes:
    """Numbers of fixed width, so that messages have one length."""
    many = [1e4 + n + k for k in range(items)]
    return json.dumps({"a": 1e4 + 0.5 * n, "many": many, "flag": n % 7 + 1}).encode()


WRITERS = {
    "cdr": (cdr, ("p/M", "ros2msg", b"float64 a\nfloat32[] many\nuint32 flag"), 0.0),
    "protobuf": (protobuf, ("p.M", "protobuf", PROTOBUF), 0.0),
    "json": (text, ("M", "jsonschema", b"{}"), 1e4),
}


def alone(write: Any, count: int) -> list[Message]:
    """One topic, every message of one length."""
    return [("/a", START_NS + n, write(n, 2)) for n in range(count)]


def between(write: Any, count: int) -> list[Message]:
    """In the last third a second topic lies between, of the same length."""
    found = []
    for n in range(count):
        found.append(("/a", START_NS + n, write(n, 2)))
        if n > 2 * count // 3:
            found.append(("/b", START_NS + n, write(20_000 - n, 2)))
    return found


def growing(write: Any, count: int) -> list[Message]:
    """Blocks of two, then of three, then of two; one message in the middle is longer."""
    sizes = np.repeat([2, 3, 2, 5, 2], [count // 3, count // 3, 500, 1, count // 3 - 501])
    return [("/a", START_NS + n, write(n, items)) for n, items in enumerate(sizes.tolist())]


def swapped(write: Any, count: int) -> list[Message]:
    """Written in another order than they were logged."""
    found = alone(write, count)
    found[100], found[2000] = found[2000], found[100]
    return found


@cache
def size_of(write: Any, n: int, payload: bytes) -> int:
    """How many items a message was written with."""
    return next(items for items in (2, 3, 5) if write(n, items) == payload)


@cache
def arranged(arrangement: Any, write: Any, count: int) -> tuple[Message, ...]:
    """The messages of an arrangement, which are cut into chunks of several sizes."""
    return tuple(arrangement(write, count))


@pytest.mark.parametrize("arrangement", [alone, between, growing, swapped])
@pytest.mark.parametrize("encoding", WRITERS)
@pytest.mark.parametrize(
    "chunk_size",
    [
        3000,
        pytest.param(1 << 16, marks=pytest.mark.slow),
        LARGE,
        pytest.param(1 << 24, marks=pytest.mark.slow),
    ],
)
def test_every_arrangement_gives_the_samples_that_were_written(
    encoding: str, arrangement: Any, chunk_size: int
) -> None:
    write, schema, base = WRITERS[encoding]
    messages = arranged(arrangement, write, 12_000 if chunk_size >= LARGE else N)
    packing = CompressionType.NONE if chunk_size > 3000 else CompressionType.ZSTD
    data = mcap_file(messages, schema, encoding, chunk_size=chunk_size, compression=packing)
    tables = {t.name: t for t in read_tables(scan(data), lambda _topic, _name: True)}
    assert set(tables) == {topic for topic, _, _ in messages}
    for topic, table in tables.items():
        own = sorted((time, payload) for name, time, payload in messages if name == topic)
        since = np.array([time - START_NS for time, _ in own])
        numbers = since if topic == "/a" else 20_000 - since
        pairs = zip(numbers.tolist(), own, strict=True)
        items = [size_of(write, n, payload) for n, (_, payload) in pairs]
        starts = zip(numbers.tolist(), items, strict=True)
        expected = [base + n + k for n, many in starts for k in range(many)]
        assert table.fields["many"].tolist() == expected
        assert table.fields["a"].tolist() == np.repeat(base + 0.5 * numbers, items).tolist()
        assert table.fields["flag"].tolist() == np.repeat(numbers % 7 + 1, items).tolist()


@pytest.mark.parametrize("encoding", WRITERS)
@pytest.mark.parametrize("chunk_size", [3000, 1 << 24])
def test_scalars_alone_and_log_times(encoding: str, chunk_size: int) -> None:
    """Times are counted from the file's first message, whichever topic that is of."""
    write, schema, base = WRITERS[encoding]
    messages: list[Message] = [("/b", START_NS - 500, write(7, 1))]
    messages += [("/a", START_NS + 3 * n, write(n, 1)) for n in range(N)]
    data = mcap_file(messages, schema, encoding, chunk_size=chunk_size)
    tables = read_tables(scan(data), lambda _topic, name: name == "a")
    assert [t.name for t in tables] == ["/b", "/a"]
    assert tables[1].fields.keys() == {"a"}
    assert tables[1].fields["a"].tolist() == [base + 0.5 * n for n in range(N)]
    assert tables[1].log_time_ns.tolist() == [500 + 3 * n for n in range(N)]
    assert tables[0].log_time_ns.tolist() == [0]


BROKEN = {
    "cdr": lambda payload: payload[:-3],
    "protobuf": lambda payload: payload[:-3],
    "json": lambda payload: payload[:-3] + b'"x}',
}


@pytest.mark.parametrize("arrangement", [alone, between])
@pytest.mark.parametrize("encoding", WRITERS)
@pytest.mark.parametrize("chunk_size", [3000, 1 << 24])
@pytest.mark.parametrize(
    "number",
    [0, pytest.param(1, marks=pytest.mark.slow), pytest.param(2345, marks=pytest.mark.slow), N - 1],
)
def test_a_refused_message_is_named_with_its_number_and_time(
    encoding: str, arrangement: Any, chunk_size: int, number: int
) -> None:
    """Expected: the first one at fault of its topic, however many chunks and topics there are."""
    write, schema, _ = WRITERS[encoding]
    messages = [
        (topic, START_NS + n * 1000, one)
        for n, (topic, _, one) in enumerate(arranged(arrangement, write, N))
    ]
    of_topic = [n for n, (topic, _, _) in enumerate(messages) if topic == "/a"]
    for at in {number, N - 1}:
        topic, time, payload = messages[of_topic[at]]
        messages[of_topic[at]] = (topic, time, BROKEN[encoding](payload))
    data = mcap_file(messages, schema, encoding, chunk_size=chunk_size)
    with pytest.raises(CaptureError) as refused:
        read_tables(scan(data), lambda _topic, _name: True)
    fault = refused.value
    assert fault.code == "bad_message"
    assert fault.rows == (number, number)
    seconds = of_topic[number] * 1e-6
    assert f"(message {number}, {seconds:.9g} s after the first of the file)" in fault.message


def test_a_field_that_becomes_an_array_is_named_with_the_message() -> None:
    rows = [{"a": float(n)} for n in range(2000)] + [{"a": [float(n)]} for n in range(2000)]
    data = mcap_file(json_messages(rows), ("M", "jsonschema", b"{}"), chunk_size=3000)
    with pytest.raises(CaptureError) as refused:
        read_tables(scan(data), lambda _topic, _name: True)
    (row, _) = refused.value.rows or (0, 0)
    assert row == 2000
