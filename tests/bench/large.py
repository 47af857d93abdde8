"""Large recordings made quickly: 20 kHz samples of a converter's resolution, chunks of a recorder.

The files are byte for byte of the format that the public `mcap` writer makes, with chunk, data and
summary checksums and a message index; only the making is vectorised.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import zstandard
from google.protobuf.descriptor_pb2 import (
    FieldDescriptorProto,
    FileDescriptorProto,
    FileDescriptorSet,
)

NAMES = ("t_s", "id_a", "iq_a", "vd_v", "vq_v", "theta_mech_rad")
BLOCK = 1000
CHUNK_BYTES = 2**20
START_NS = 1_700_000_000_000_000_000
MAGIC = b"\x89MCAP0\r\n"


def samples(rows: int) -> np.ndarray:
    """Rows of a drive's log [rows, 6]: noise of a few counts on slow waves, 16-bit converters."""
    random = np.random.default_rng(5)
    t = np.arange(rows) / 20_000
    wave = np.stack([np.sin(6.28 * f * t) for f in (0.7, 1.3, 11.0, 17.0)], axis=1)
    counts = np.round(8000 * wave + random.normal(0, 12, wave.shape))
    theta = np.round(t * 37.0 * 16384 / 6.283185307179586) * (6.283185307179586 / 16384)
    return np.column_stack([t, counts * (50.0 / 32768), theta])


def text(value: str | bytes) -> bytes:
    raw = value.encode() if isinstance(value, str) else value
    return struct.pack("<I", len(raw)) + raw


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


@dataclass(frozen=True)
class Kind:
    """Schema name, schema encoding, schema, message encoding."""

    name: str
    schema_encoding: str
    schema: bytes
    encoding: str


def kind_of(kind: str) -> Kind:
    encoding, shape = kind.split()
    repeated = "" if shape == "rows" else "[]"
    if encoding == "cdr":
        lines = "\n".join(f"float64{repeated} {name}" for name in NAMES)
        return Kind("pkg/M", "ros2msg", lines.encode(), "cdr")
    if encoding == "json":
        return Kind("S", "jsonschema", b"{}", "json")
    file = FileDescriptorProto(name="m.proto", package="p", syntax="proto3")
    message = file.message_type.add(name="M")
    label = FieldDescriptorProto.LABEL_OPTIONAL if shape == "rows" else 3
    for number, name in enumerate(NAMES, 1):
        message.field.add(name=name, number=number, type=1, label=label)
    return Kind("p.M", "protobuf", FileDescriptorSet(file=[file]).SerializeToString(), "protobuf")


def payloads(kind: str, values: np.ndarray) -> list[bytes] | np.ndarray:
    """Messages of one kind: a matrix of bytes [messages, size] where all have one length."""
    encoding, shape = kind.split()
    if encoding == "json":
        import polars as pl

        frame = pl.DataFrame(dict(zip(NAMES, values.T.copy(), strict=True)))
        if shape == "blocks":
            place = pl.Series("block", np.arange(values.shape[0]) // BLOCK)
            frame = frame.group_by(place, maintain_order=True).agg(pl.all()).drop("block")
        return frame.write_ndjson().rstrip("\n").encode().split(b"\n")  # type: ignore[union-attr]
    if shape == "blocks":
        blocks = values.reshape(-1, BLOCK, len(NAMES)).transpose(0, 2, 1)
        size = 8 * BLOCK
        if encoding == "cdr":
            head = struct.pack("<I", BLOCK)
            first = b"\0\1\0\0" + head + bytes(4)
            return [
                first + (head + bytes(4)).join(part.tobytes() for part in block) for block in blocks
            ]
        return [
            b"".join(
                bytes([8 * n + 2]) + varint(size) + part.tobytes()
                for n, part in enumerate(block, 1)
            )
            for block in blocks
        ]
    if encoding == "cdr":
        rows = np.empty(values.shape[0], [("head", "u1", 4), ("body", "<f8", len(NAMES))])
        rows["head"] = (0, 1, 0, 0)
        rows["body"] = values
        return rows.view("u1").reshape(values.shape[0], -1)
    # A zero is left out by protobuf; the log has none after the first instant.
    filled = np.where(values == 0.0, 1e-9, values)
    fields = [item for n in range(len(NAMES)) for item in ((f"t{n}", "u1"), (f"v{n}", "<f8"))]
    rows = np.empty(values.shape[0], fields)
    for n in range(len(NAMES)):
        rows[f"t{n}"], rows[f"v{n}"] = 8 * (n + 1) + 1, filled[:, n]
    return rows.view("u1").reshape(values.shape[0], -1)


def varint(value: int) -> bytes:
    found = b""
    while value > 0x7F:
        found += bytes([value & 0x7F | 0x80])
        value >>= 7
    return found + bytes([value])


def _chunks(
    messages: list[bytes] | np.ndarray, period_ns: int
) -> Iterator[tuple[bytes, np.ndarray, np.ndarray]]:
    """Records of each chunk, and log times and offsets of its messages."""
    if isinstance(messages, np.ndarray):
        stride = 31 + messages.shape[1]
        share = max(CHUNK_BYTES // stride, 1)
        for at in range(0, len(messages), share):
            part = messages[at : at + share]
            head = [("op", "u1"), ("n", "<u8"), ("ch", "<u2"), ("seq", "<u4")]
            times = [("log", "<u8"), ("pub", "<u8"), ("body", "u1", part.shape[1])]
            rows = np.zeros(len(part), [*head, *times])
            rows["op"], rows["n"], rows["ch"], rows["body"] = 5, 22 + part.shape[1], 1, part
            rows["seq"] = np.arange(at, at + len(part))
            rows["log"] = rows["pub"] = START_NS + period_ns * np.arange(at, at + len(part))
            yield rows.tobytes(), rows["log"].copy(), stride * np.arange(len(part))
        return
    at = 0
    while at < len(messages):
        parts, offsets, size, first = [], [], 0, at
        while at < len(messages) and size < CHUNK_BYTES:
            stamp = START_NS + period_ns * at
            body = struct.pack("<HIQQ", 1, at, stamp, stamp) + messages[at]
            offsets.append(size)
            parts.append(record(5, body))
            size += len(parts[-1])
            at += 1
        log = START_NS + period_ns * np.arange(first, at, dtype=np.int64)
        yield b"".join(parts), log.astype("<u8"), np.array(offsets)


def large_file(kind: str, megabytes: float, compression: str = "zstd") -> tuple[bytes, np.ndarray]:
    """An MCAP file of about that size unpacked, and the samples in it [rows, 6]."""
    shape = kind_of(kind)
    each = {"cdr": 83, "protobuf": 85, "json": 150}[shape.encoding]
    each = each if kind.endswith("rows") else (48 if shape.encoding != "json" else 65)
    rows = max(int(megabytes * 1e6 / each) // BLOCK, 2) * BLOCK
    values = samples(rows)
    messages = payloads(kind, values)
    period = 50_000 * (rows // len(messages))
    schema = struct.pack("<H", 1) + text(shape.name) + text(shape.schema_encoding)
    schema += text(shape.schema)
    channel = struct.pack("<HH", 1, 1) + text("/s") + text(shape.encoding) + text("")
    meta = text("capture") + text(text("contract") + text("1"))
    out = [MAGIC, record(1, text("") + text("")), record(3, schema), record(4, channel)]
    out.append(record(12, meta))
    position = sum(map(len, out))
    indexes, first, last, crc = [], 0, 0, 0
    packer = zstandard.ZstdCompressor(3)
    for plain, log, offset in _chunks(messages, period):
        packed = packer.compress(plain) if compression else plain
        begin, end = int(log[0]), int(log[-1])
        head = struct.pack("<QQQI", begin, end, len(plain), zlib.crc32(plain))
        body = head + text(compression) + struct.pack("<Q", len(packed)) + packed
        chunk = record(6, body)
        table = np.stack([log.astype("<u8"), offset.astype("<u8")], axis=1).tobytes()
        index = record(7, struct.pack("<H", 1) + text(table))
        place = struct.pack("<HQ", 1, position + len(chunk))
        summary = struct.pack("<QQQQ", begin, end, position, len(chunk)) + text(place)
        summary += struct.pack("<Q", len(index)) + text(compression)
        indexes.append(record(8, summary + struct.pack("<QQ", len(packed), len(plain))))
        out += [chunk, index]
        position += len(chunk) + len(index)
        first, last = first or begin, end
    for part in out:
        crc = zlib.crc32(part, crc)
    out.append(record(15, struct.pack("<I", crc)))
    position += 13
    count = text(struct.pack("<HQ", 1, len(messages)))
    statistics = struct.pack("<QHIIIIQQ", len(messages), 1, 1, 0, 1, len(indexes), first, last)
    tail = b"".join(
        [record(3, schema), record(4, channel), record(11, statistics + count), *indexes]
    )
    footer = struct.pack("<BQQQ", 2, 20, position, 0)
    out += [tail, footer, struct.pack("<I", zlib.crc32(tail + footer)), MAGIC]
    return b"".join(out), values
