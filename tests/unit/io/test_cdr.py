"""ROS 2 CDR payloads against the public mcap-ros2 writer, and JointState."""

from __future__ import annotations

import io
import struct
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap_ros2.writer import Writer as Ros2Writer

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, mcap_file

NESTED = """
# a comment, and a constant
uint8 KIND=3
bool on
string name "drive"
float64 ia_a
pkg/Inner inner
float32[3] fixed
float64[] block
pkg/Inner[] many
int16 tail
================================================================================
MSG: pkg/Inner
uint8 small
float64 vb_v
string[] words
int64 count
"""
JOINT_STATE = """
std_msgs/Header header
string[] name
float64[] position
float64[] velocity
float64[] effort
================================================================================
MSG: std_msgs/Header
builtin_interfaces/Time stamp
string frame_id
================================================================================
MSG: builtin_interfaces/Time
int32 sec
uint32 nanosec
"""


def ros2_file(name: str, text: str, messages: list[dict[str, Any]]) -> bytes:
    """Messages written by the public library."""
    stream = io.BytesIO()
    writer = Ros2Writer(stream)
    schema = writer.register_msgdef(name, text)
    for number, message in enumerate(messages):
        time = START_NS + 1_000_000 * number
        writer.write_message("/s", schema, message, time, time, number)
    writer.finish()
    return stream.getvalue()


def fields(data: bytes, joint: str | None = None) -> dict[str, np.ndarray]:
    (table,) = read_tables(scan(data), lambda _topic, name: "words" not in name, joint)
    return table.fields


inner = st.fixed_dictionaries(
    {
        "small": st.integers(0, 255),
        "vb_v": st.floats(allow_nan=False),
        "words": st.lists(st.text(st.characters(codec="ascii"), max_size=5), max_size=3),
        "count": st.integers(-(2**63), 2**63 - 1),
    }
)
nested = st.lists(
    st.fixed_dictionaries(
        {
            "on": st.booleans(),
            "name": st.text(st.characters(codec="ascii"), max_size=9),
            "ia_a": st.floats(allow_nan=False),
            "inner": inner,
            "fixed": st.lists(st.floats(width=32, allow_nan=False), min_size=3, max_size=3),
            "block": st.just([]),
            "many": st.lists(inner, min_size=3, max_size=3),
            "tail": st.integers(-(2**15), 2**15 - 1),
        }
    ),
    min_size=1,
    max_size=5,
)


@given(nested)
@settings(max_examples=25)
def test_nested_types_texts_and_alignment_equal_the_public_writer(rows: list[Any]) -> None:
    got = fields(ros2_file("pkg/M", NESTED, rows))
    for name in ("ia_a", "tail", "on"):
        np.testing.assert_array_equal(got[name], np.repeat([row[name] for row in rows], 3))
    counts = [row["inner"]["count"] for row in rows]
    np.testing.assert_array_equal(got["inner.count"], np.repeat(counts, 3))
    np.testing.assert_array_equal(got["fixed"], np.ravel([row["fixed"] for row in rows]))
    many = [item["vb_v"] for row in rows for item in row["many"]]
    np.testing.assert_array_equal(got["many.vb_v"], many)


@pytest.mark.parametrize("order", ["<", ">"])
def test_both_byte_orders(order: str) -> None:
    head = b"\x00\x01\x00\x00" if order == "<" else b"\x00\x00\x00\x00"
    payload = head + struct.pack(order + "i4xd", -3, 0.1)
    schema = ("pkg/M", "ros2msg", b"int32 n\nfloat64 ia_a")
    data = mcap_file([("/s", START_NS, payload)], schema, "cdr")
    assert {name: values[0] for name, values in fields(data).items()} == {"n": -3, "ia_a": 0.1}


def joints(names: list[str], scale: float, efforts: bool = True) -> dict[str, Any]:
    values = [scale * (n + 1) for n in range(len(names))]
    return {
        "header": {"stamp": {"sec": 1, "nanosec": 2}, "frame_id": "base"},
        "name": names,
        "position": values,
        "velocity": [10 * v for v in values],
        "effort": [100 * v for v in values] if efforts else [],
    }


def test_joint_state_gives_the_named_joint_wherever_it_stands() -> None:
    rows = [
        joints(["a", "knee", "ab"], 1.0),
        joints(["knee", "a"], 0.5),
        joints(["x", "knee"], 2.0),
    ]
    got = fields(ros2_file("sensor_msgs/msg/JointState", JOINT_STATE, rows), "knee")
    np.testing.assert_array_equal(got["position"], [2.0, 0.5, 4.0])
    np.testing.assert_array_equal(got["velocity"], [20.0, 5.0, 40.0])
    np.testing.assert_array_equal(got["effort"], [200.0, 50.0, 400.0])


def test_a_single_joint_needs_no_name_and_absent_quantities_are_left_out() -> None:
    data = ros2_file("sensor_msgs/JointState", JOINT_STATE, [joints(["j"], 1.0, efforts=False)] * 2)
    got = fields(data)
    np.testing.assert_array_equal(got["position"], [1.0, 1.0])
    assert "effort" not in got


@pytest.mark.parametrize("joint", [None, "elbow"])
def test_an_unstated_or_absent_joint_is_refused(joint: str | None) -> None:
    data = ros2_file("sensor_msgs/msg/JointState", JOINT_STATE, [joints(["a", "b"], 1.0)])
    with pytest.raises(CaptureError) as refused:
        fields(data, joint)
    assert refused.value.code == "joint"


@given(st.binary(max_size=80))
@settings(max_examples=200)
def test_any_bytes_decode_or_are_refused(payload: bytes) -> None:
    """Nothing but CaptureError comes out of a payload that is no message."""
    schema = ("pkg/M", "ros2msg", NESTED.encode())
    try:
        fields(mcap_file([("/s", START_NS, payload)], schema, "cdr"))
    except CaptureError as fault:
        assert fault.code in ("bad_message", "ragged_block")


@pytest.mark.parametrize(
    "text", ["float64", "foo bar", "wstring x", "float64 a\nfloat64 a", "\xff"]
)
def test_a_schema_that_cannot_be_parsed_is_refused(text: str) -> None:
    data = mcap_file(
        [("/s", START_NS, b"\0\1\0\0")], ("M", "ros2msg", text.encode("latin-1")), "cdr"
    )
    with pytest.raises(CaptureError) as refused:
        fields(data)
    assert refused.value.code == "bad_schema"
