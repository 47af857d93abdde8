"""How fast files decode, as a ratio to unpacking them and copying the bytes once.

The ratios hold on any machine; the limits are twice what was measured when they were written, so
that a lost vectorisation is seen and a busy machine is not.
"""

from __future__ import annotations

import json
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
import zstandard
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from tests.unit.io.recordings import START_NS, mcap_file, protobuf_schema

ROWS = 40_000
BLOCK = 500
NAMES = ("t_s", "id_a", "iq_a", "vd_v", "vq_v", "theta_mech_rad")


def columns() -> np.ndarray:
    values = np.random.default_rng(5).normal(size=(ROWS, len(NAMES))).round(3)
    values[:, 0] = np.arange(ROWS) / 20_000
    return values


def payloads(kind: str) -> tuple[tuple[str, str, bytes], str, list[bytes]]:
    """Schema, encoding and messages of one kind."""
    values = columns()
    blocks = values.reshape(-1, BLOCK, len(NAMES)).transpose(0, 2, 1)
    encoding, shape = kind.split()
    if encoding == "json":
        rows = values.tolist() if shape == "rows" else blocks.tolist()
        texts = [json.dumps(dict(zip(NAMES, row, strict=True))).encode() for row in rows]
        return ("S", "jsonschema", b"{}"), "json", texts
    if encoding == "cdr":
        head = b"\x00\x01\x00\x00"
        text = "\n".join(f"float64{'' if shape == 'rows' else '[]'} {name}" for name in NAMES)
        if shape == "rows":
            found = [head + row.tobytes() for row in values]
        else:
            size = np.array([BLOCK, 0], "<u4").tobytes()
            padded = [b"".join(size + part.tobytes() for part in block) for block in blocks]
            found = [head + body.replace(size, size[:4] + bytes(4)) for body in padded]
        return ("pkg/M", "ros2msg", text.encode()), "cdr", found

    def fill(file: FileDescriptorProto) -> None:
        message = file.message_type.add(name="M")
        label = FieldDescriptorProto.LABEL_OPTIONAL if shape == "rows" else 3
        for number, name in enumerate(NAMES, 1):
            message.field.add(name=name, number=number, type=1, label=label)

    schema, message = protobuf_schema(fill)
    rows = values.tolist() if shape == "rows" else blocks.tolist()
    found = [message(**dict(zip(NAMES, r, strict=True))).SerializeToString() for r in rows]
    return ("p.M", "protobuf", schema), "protobuf", found


def cpu_seconds(work: Callable[[], Any]) -> float:
    """Least CPU time of three runs [s]."""
    times = []
    for _ in range(3):
        start = time.process_time()
        work()
        times.append(time.process_time() - start)
    return min(times)


LIMITS = {
    "cdr rows": 8.0,
    "cdr blocks": 6.0,
    "protobuf rows": 12.0,
    "protobuf blocks": 6.0,
    "json rows": 22.0,
    "json blocks": 30.0,
}


@pytest.mark.parametrize("kind", LIMITS)
def test_decoding_keeps_its_ratio_to_unpacking(kind: str, benchmark: Any) -> None:
    schema, encoding, messages = payloads(kind)
    stamped = [("/s", START_NS + 50_000 * n, body) for n, body in enumerate(messages)]
    data = mcap_file(stamped, schema, encoding, chunk_size=2**20)
    packed = [(data[c.begin : c.end], c.size) for c in scan(data).chunks]

    def unpack() -> int:
        unpacker = zstandard.ZstdDecompressor()
        return sum(len(bytearray(unpacker.decompress(part))) for part, _ in packed)

    def decode() -> list[Any]:
        return read_tables(scan(data), lambda _topic, _name: True)

    (table,) = benchmark.pedantic(decode, rounds=2, warmup_rounds=1)
    for n, name in enumerate(NAMES):
        np.testing.assert_array_equal(table.fields[name], columns()[:, n])
    ratio = cpu_seconds(decode) / cpu_seconds(unpack)
    benchmark.extra_info["ratio"] = ratio
    assert ratio < LIMITS[kind]
