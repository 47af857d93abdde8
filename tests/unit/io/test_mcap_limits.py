"""What a file may claim: the last that is believed and the first that is not."""

from __future__ import annotations

import json
import struct
from typing import Any

import numpy as np
import pytest
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto
from mcap.writer import CompressionType

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.records import Chunk
from pipeline.io.mcap.tables import read_tables
from pipeline.io.mcap.unpack import unpack
from pipeline.io.mcap.walk import walk
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, mcap_file, protobuf_schema


def fields(data: bytes, joint: str | None = None) -> dict[str, np.ndarray]:
    (table,) = read_tables(scan(data), lambda _topic, _name: True, joint)
    return table.fields


def refused(data: bytes, joint: str | None = None) -> CaptureError:
    with pytest.raises(CaptureError) as fault:
        fields(data, joint)
    return fault.value


def deep(levels: int) -> bytes:
    """`{"b": 1, "a": {"a": ... {"a": 1}}}` with so many objects inside the first."""
    return b'{"b": 1, "a": ' + b'{"a": ' * levels + b"1" + b"}" * levels + b"}"


def in_json(payloads: list[bytes]) -> bytes:
    """The second message lacks a key of the first, so each is read with care."""
    messages = [("/s", START_NS + n, p) for n, p in enumerate([*payloads, b'{"other": 5}'])]
    return mcap_file(messages, chunk_size=1 << 25)


def test_json_nests_32_objects_deep() -> None:
    assert fields(in_json([deep(32)]))["b"].tolist()[0] == 1.0
    assert refused(in_json([deep(33)])).code == "bad_message"


def test_json_streams_have_4096_fields() -> None:
    wide = [{f"f{k}": k for k in range(half, half + 2048)} for half in (0, 2048)]
    payloads = [json.dumps(one).encode() for one in wide]
    messages = [("/s", START_NS + n, p) for n, p in enumerate(payloads)]
    assert len(fields(mcap_file(messages, chunk_size=1 << 20))) == 4096
    payloads[1] = json.dumps(wide[1] | {"one_more": 1.0}).encode()
    messages = [("/s", START_NS + n, p) for n, p in enumerate(payloads)]
    assert refused(mcap_file(messages, chunk_size=1 << 20)).code == "bad_message"


@pytest.mark.parametrize(("extra", "taken"), [(0, True), (1, False)])
def test_a_json_message_has_16_mebibytes(extra: int, taken: bool) -> None:
    payload = b'{"a": 1.5' + b" " * (16 * 2**20 - 10 + extra) + b"}"
    data = mcap_file(
        [("/s", START_NS, payload)], chunk_size=1 << 25, compression=CompressionType.NONE
    )
    if taken:
        assert fields(data)["a"].tolist() == [1.5]
    else:
        assert refused(data).code in ("bad_message", "limit")


def ros2(text: str, payload: bytes) -> bytes:
    return mcap_file([("/s", START_NS, payload)], ("p/M", "ros2msg", text.encode()), "cdr")


def nested_ros2(levels: int) -> str:
    parts = ["p/T1 t" if levels else "float64 a"]
    for k in range(1, levels + 1):
        inner = f"p/T{k + 1} t" if k < levels else "float64 a"
        parts.append(f"{'=' * 80}\nMSG: p/T{k}\n{inner}")
    return "\n".join(parts)


def test_ros2_types_nest_32_deep() -> None:
    payload = b"\0\1\0\0" + struct.pack("<d", 2.5)
    (values,) = fields(ros2(nested_ros2(32), payload)).values()
    assert values.tolist() == [2.5]
    assert refused(ros2(nested_ros2(33), payload)).code == "bad_schema"


def test_ros2_messages_have_4096_fields() -> None:
    text = "\n".join(f"uint8 f{k}  # a comment # in a comment" for k in range(4096))
    got = fields(ros2(text, b"\0\1\0\0" + bytes(k % 251 for k in range(4096))))
    assert got["f4095"].tolist() == [4095 % 251]
    more = refused(ros2(f"{text}\nuint8 last", b"\0\1\0\0" + bytes(4097)))
    assert more.code == "bad_schema"


def test_a_type_that_holds_itself_is_left_out_and_the_rest_is_read() -> None:
    """A tree of nodes holds no samples; a type that only names another one does."""

    def fill(file: FileDescriptorProto) -> None:
        kind = FieldDescriptorProto
        node = file.message_type.add(name="Node")
        node.field.add(name="x", number=1, type=kind.TYPE_DOUBLE, label=1)
        link = file.message_type.add(name="Link")
        node.field.add(name="link", number=2, type=kind.TYPE_MESSAGE, label=1, type_name=".p.Link")
        link.field.add(name="next", number=1, type=kind.TYPE_MESSAGE, label=1, type_name=".p.Node")
        inner = file.message_type.add(name="Inner")
        inner.field.add(name="v", number=1, type=kind.TYPE_DOUBLE, label=1)
        root = file.message_type.add(name="M")
        root.field.add(name="a", number=1, type=kind.TYPE_DOUBLE, label=1)
        root.field.add(name="tree", number=2, type=kind.TYPE_MESSAGE, label=1, type_name=".p.Node")
        root.field.add(name="in", number=3, type=kind.TYPE_MESSAGE, label=1, type_name=".p.Inner")

    schema, message = protobuf_schema(fill)
    payload = message(a=1.5, tree={"x": 2.0, "link": {"next": {"x": 3.0}}}, **{"in": {"v": 4.0}})
    data = mcap_file(
        [("/s", START_NS, payload.SerializeToString())], ("p.M", "protobuf", schema), "protobuf"
    )
    got = fields(data)
    assert {name: values.tolist() for name, values in got.items()} == {"a": [1.5], "in.v": [4.0]}


def zstd_frame(window_byte: int, content: bytes) -> bytes:
    """A frame without content size, by hand (RFC 8878, 3.1.1): window 2^(10 + e) (1 + m/8)."""
    head = b"\x28\xb5\x2f\xfd" + bytes([0x00, window_byte])
    return head + ((len(content) << 3) | 1).to_bytes(3, "little") + content


@pytest.mark.parametrize(("window_byte", "taken"), [(17 << 3, True), ((17 << 3) | 1, False)])
def test_a_zstd_window_has_128_mebibytes(window_byte: int, taken: bool) -> None:
    packed = zstd_frame(window_byte, b"records")
    chunk = Chunk(**chunk_of(packed, 7))
    if taken:
        assert unpack(packed, chunk) == b"records"
    else:
        with pytest.raises(CaptureError, match="does not unpack"):
            unpack(packed, chunk)


def chunk_of(packed: bytes, size: int) -> dict[str, Any]:
    return {
        "offset": 0,
        "length": len(packed),
        "start_time": 0,
        "end_time": 0,
        "size": size,
        "crc": 0,
        "compression": "zstd",
        "begin": 0,
        "end": len(packed),
    }


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def test_a_run_of_records_ends_with_their_opcode_and_with_their_length() -> None:
    """Thirty alike are counted at once; the next of another kind, or size, is not among them."""
    bodies = [(5, b"12345678")] * 30 + [(0x81, b"12345678")] + [(5, b"12345678")] * 30
    bodies += [(5, b"123456789")] + [(5, b"12345678")] * 12
    data = b"".join(record(opcode, body) for opcode, body in bodies)
    spans = walk(data, 0, len(data))
    assert spans.fault is None
    assert spans.opcode.tolist() == [opcode for opcode, _ in bodies]
    assert spans.length.tolist() == [len(body) for _, body in bodies]
    starts = np.cumsum([0, *(9 + len(body) for _, body in bodies)])[:-1] + 9
    assert spans.start.tolist() == starts.tolist()
    cut = walk(data, 0, len(data) - 1)
    assert cut.fault is not None
    assert cut.opcode.size == len(bodies) - 1


JOINTS = "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort"


def joint_state(names: list[str], **quantities: list[float]) -> bytes:
    """A JointState by hand, without its header."""
    body = struct.pack("<I", len(names))
    for name in names:
        text = name.encode() + b"\0"
        body += b"\0" * (-len(body) % 4) + struct.pack("<I", len(text)) + text
    for quantity in ("position", "velocity", "effort"):
        values = quantities.get(quantity, [])
        body += b"\0" * (-len(body) % 4) + struct.pack("<I", len(values))
        if values:
            body += b"\0" * (-len(body) % 8) + struct.pack(f"<{len(values)}d", *values)
    return b"\0\1\0\0" + body


def joints(payloads: list[bytes]) -> bytes:
    messages = [("/s", START_NS + n, p) for n, p in enumerate(payloads)]
    return mcap_file(messages, ("sensor_msgs/JointState", "ros2msg", JOINTS.encode()), "cdr")


def test_a_quantity_that_is_missing_hides_no_other() -> None:
    payload = joint_state(["a", "b"], velocity=[1.0, 2.0], effort=[3.0, 4.0])
    got = fields(joints([payload]), "b")
    assert {name: values.tolist() for name, values in got.items()} == {
        "velocity": [2.0],
        "effort": [4.0],
    }
    some = joint_state(["b", "a"], velocity=[5.0, 6.0])
    got = fields(joints([payload, some]), "b")
    assert got["velocity"].tolist() == [2.0, 5.0]
    np.testing.assert_array_equal(got["effort"], [4.0, np.nan])


@pytest.mark.parametrize("values", [[1.0], [1.0, 2.0, 3.0]])
def test_as_many_values_as_joints(values: list[float]) -> None:
    payload = joint_state(["a", "b"], velocity=values)
    assert "another number of velocity" in refused(joints([payload]), "a").message


def test_joint_states_without_names_are_refused() -> None:
    assert "names no joint" in refused(joints([joint_state([])]), "a").message
    assert "2 joints" in refused(joints([joint_state(["a", "b"], effort=[1.0, 2.0])])).message
