"""Protobuf payloads against the public protobuf library, over every field type and shape."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from hypothesis import given, settings
from hypothesis import strategies as st

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, mcap_file, protobuf_schema

F = FieldDescriptorProto
TYPES = {
    F.TYPE_DOUBLE: st.floats(width=64),
    F.TYPE_FLOAT: st.floats(width=32),
    F.TYPE_INT32: st.integers(-(2**31), 2**31 - 1),
    F.TYPE_INT64: st.integers(-(2**63), 2**63 - 1),
    F.TYPE_UINT32: st.integers(0, 2**32 - 1),
    F.TYPE_UINT64: st.integers(0, 2**64 - 1),
    F.TYPE_SINT32: st.integers(-(2**31), 2**31 - 1),
    F.TYPE_SINT64: st.integers(-(2**63), 2**63 - 1),
    F.TYPE_FIXED32: st.integers(0, 2**32 - 1),
    F.TYPE_FIXED64: st.integers(0, 2**64 - 1),
    F.TYPE_SFIXED32: st.integers(-(2**31), 2**31 - 1),
    F.TYPE_SFIXED64: st.integers(-(2**63), 2**63 - 1),
    F.TYPE_BOOL: st.booleans(),
}


def add_field(
    message: Any, name: str, number: int, kind: int, label: int = F.LABEL_OPTIONAL
) -> Any:
    return message.field.add(name=name, number=number, type=kind, label=label)


def every_type(file: FileDescriptorProto) -> None:
    """`p.M` with a scalar and an array of every type, and a text between them."""
    message = file.message_type.add(name="M")
    for kind in TYPES:
        add_field(message, f"x{kind}", kind, kind)
        add_field(message, f"many{kind}", 100 + kind, kind, F.LABEL_REPEATED)
    add_field(message, "text", 50, F.TYPE_STRING)


EVERY, EveryType = protobuf_schema(every_type)


def decode(payloads: list[bytes], schema: bytes) -> dict[str, np.ndarray]:
    messages = [("/s", START_NS + n, payload) for n, payload in enumerate(payloads)]
    data = mcap_file(messages, ("p.M", "protobuf", schema), "protobuf")
    (table,) = read_tables(scan(data), lambda _topic, name: not name.startswith("text"))
    return table.fields


rows = st.lists(
    st.fixed_dictionaries(
        {"text": st.text(max_size=5)} | {f"x{kind}": values for kind, values in TYPES.items()}
    ),
    min_size=1,
    max_size=12,
)


@given(rows)
@settings(max_examples=25)
def test_scalars_of_every_type_equal_the_library(rows: list[dict[str, Any]]) -> None:
    got = decode([EveryType(**row).SerializeToString() for row in rows], EVERY)
    for kind in TYPES:
        expected = np.array([getattr(EveryType(**row), f"x{kind}") for row in rows])
        np.testing.assert_array_equal(got[f"x{kind}"], expected)


@given(st.lists(st.integers(0, 40), min_size=1, max_size=6), st.randoms(use_true_random=False))
@settings(max_examples=30)
def test_packed_arrays_equal_the_library(sizes: list[int], random: Any) -> None:
    """Blocks of any size, empty ones and multi-byte varints among them."""
    generator = np.random.default_rng(random.randrange(2**32))
    blocks = [
        {
            f"many{F.TYPE_DOUBLE}": generator.normal(size=n),
            f"many{F.TYPE_SINT64}": generator.integers(-(2**62), 2**62, n).tolist(),
            f"many{F.TYPE_INT32}": generator.integers(-(2**31), 2**31, n).tolist(),
            f"many{F.TYPE_FLOAT}": generator.normal(size=n).astype(np.float32),
        }
        for n in sizes
    ]
    if sum(sizes) == 0:
        return
    got = decode([EveryType(**block).SerializeToString() for block in blocks], EVERY)
    for name in blocks[0]:
        np.testing.assert_array_equal(got[name], np.concatenate([b[name] for b in blocks]))


@pytest.mark.parametrize("n", [1, 5, 400])
@pytest.mark.parametrize("numbers", [(1, 2), (300, 301)])
def test_unpacked_arrays_are_arrays_too(n: int, numbers: tuple[int, int]) -> None:
    """proto2 writers repeat the tag before every item, of one byte or of two."""

    def fill(file: FileDescriptorProto) -> None:
        message = file.message_type.add(name="M")
        for number, name in zip(numbers, ("ia_a", "t_s"), strict=True):
            part = add_field(message, name, number, F.TYPE_DOUBLE, F.LABEL_REPEATED)
            part.options.packed = False

    schema, message = protobuf_schema(fill)
    values = np.random.default_rng(1).normal(size=(2, 3, n))
    payloads = [message(ia_a=a, t_s=t).SerializeToString() for a, t in zip(*values, strict=True)]
    got = decode(payloads, schema)
    np.testing.assert_array_equal(got["ia_a"], values[0].ravel())
    np.testing.assert_array_equal(got["t_s"], values[1].ravel())


def nested(file: FileDescriptorProto) -> None:
    inner = file.message_type.add(name="Inner")
    add_field(inner, "ia_a", 1, F.TYPE_DOUBLE)
    add_field(inner, "ib_a", 2, F.TYPE_DOUBLE)
    outer = file.message_type.add(name="M")
    add_field(outer, "t_s", 1, F.TYPE_DOUBLE)
    add_field(outer, "one", 2, F.TYPE_MESSAGE).type_name = ".p.Inner"
    add_field(outer, "many", 3, F.TYPE_MESSAGE, F.LABEL_REPEATED).type_name = ".p.Inner"
    part = add_field(outer, "maybe", 4, F.TYPE_DOUBLE)
    part.proto3_optional, part.oneof_index = True, 0
    outer.oneof_decl.add(name="_maybe")


def test_nested_messages_are_flattened_and_absent_ones_are_missing() -> None:
    schema, message = protobuf_schema(nested)
    payloads = [
        message(t_s=0.0, one={"ia_a": 1.0}).SerializeToString(),
        message(t_s=1.0, one={}, maybe=0.0).SerializeToString(),
        message(t_s=2.0).SerializeToString(),
    ]
    got = decode(payloads, schema)
    np.testing.assert_array_equal(got["t_s"], [0, 1, 2])
    np.testing.assert_array_equal(got["one.ia_a"], [1.0, 0.0, np.nan])
    np.testing.assert_array_equal(got["one.ib_a"], [0.0, 0.0, np.nan])
    np.testing.assert_array_equal(got["maybe"], [np.nan, 0.0, np.nan])


def test_an_array_of_messages_is_a_block_with_its_omitted_zeros() -> None:
    schema, message = protobuf_schema(nested)
    blocks = [[{"ia_a": 1.0}, {}, {"ib_a": 2.0}], [{"ia_a": 3.0, "ib_a": 4.0}]]
    payloads = [message(many=block).SerializeToString() for block in blocks]
    got = decode(payloads, schema)
    np.testing.assert_array_equal(got["many.ia_a"], [1.0, 0.0, 0.0, 3.0])
    np.testing.assert_array_equal(got["many.ib_a"], [0.0, 0.0, 2.0, 4.0])


def test_many_messages_of_few_shapes_read_as_the_library_reads_them() -> None:
    """Omitted zeros, a field in another order and an odd message among 3,000 common ones."""
    generator = np.random.default_rng(3)
    kept = (F.TYPE_DOUBLE, F.TYPE_FLOAT, F.TYPE_FIXED64, F.TYPE_SFIXED32)
    rows = [
        {f"x{kind}": int(generator.integers(0, 2)) * (n + kind) for kind in kept}
        for n in range(3000)
    ]
    rows[1000]["x8"] = True
    payloads = [EveryType(**row).SerializeToString() for row in rows]
    payloads[2000] = EveryType(x1=1.0).SerializeToString() + EveryType(x2=2.0).SerializeToString()
    payloads[2001] = EveryType(x2=2.0).SerializeToString() + EveryType(x1=1.0).SerializeToString()
    payloads[2002] = EveryType(x1=1.0).SerializeToString() + EveryType(x1=2.0).SerializeToString()
    got = decode(payloads, EVERY)
    for kind in (*kept, F.TYPE_BOOL):
        name = f"x{kind}"
        np.testing.assert_array_equal(
            got[name], [getattr(EveryType.FromString(p), name) for p in payloads]
        )


def test_the_last_value_of_a_repeated_scalar_field_counts() -> None:
    """Concatenated messages merge (the wire format's own rule)."""
    payload = EveryType(x1=1.0).SerializeToString() + EveryType(x1=2.0).SerializeToString()
    np.testing.assert_array_equal(decode([payload], EVERY)["x1"], [2.0])


@given(st.binary(max_size=60))
@settings(max_examples=150)
def test_any_bytes_decode_or_are_refused(payload: bytes) -> None:
    """Nothing but CaptureError comes out of a payload that is no message."""
    try:
        decode([payload], EVERY)
    except CaptureError as fault:
        assert fault.code in ("bad_message", "ragged_block")
