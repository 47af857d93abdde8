"""Small files that claim, or unpack to, far more than they are; and how each is refused.

`python -m tests.faults.bombs FOLDER` writes them, reads each, and prints one JSON line a file.
"""

from __future__ import annotations

import gzip
import io
import json
import os
import struct
import sys
import time
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

import lz4.frame
import zstandard
from google.protobuf.descriptor_pb2 import FieldDescriptorProto, FileDescriptorProto

from tests.faults.fleet import peak_mb
from tests.unit.io.recordings import START_NS, json_messages, mcap_file, protobuf_schema

MAGIC = b"\x89MCAP0\r\n"
HEAD = b"# contract: 1\n# motor_id: bomb\n# test: drive\n"
MB = 2**20


def record(opcode: int, body: bytes) -> bytes:
    return struct.pack("<BQ", opcode, len(body)) + body


def text(value: bytes) -> bytes:
    return struct.pack("<I", len(value)) + value


def chunk(packed: bytes, size: int, crc: int, compression: bytes = b"zstd") -> bytes:
    head = struct.pack("<QQQI", 0, 0, size, crc) + text(compression)
    return record(6, head + struct.pack("<Q", len(packed)) + packed)


def file_of(*records: bytes) -> bytes:
    meta = text(b"contract") + text(b"1") + text(b"motor_id") + text(b"bomb")
    meta += text(b"test") + text(b"drive")
    said = record(12, text(b"capture") + text(meta))
    body = b"".join([record(1, bytes(8)), said, *records])
    return MAGIC + body + record(15, bytes(4)) + record(2, bytes(20)) + MAGIC


def zeros(count: int) -> bytes:
    """A zstd frame of many zeros that does not say how many."""
    out = io.BytesIO()
    with zstandard.ZstdCompressor().stream_writer(out, closefd=False) as stream:
        for _ in range(count // MB):
            stream.write(bytes(MB))
    return out.getvalue()


def deep_tree(file: FileDescriptorProto) -> None:
    """Each message holds the next one four times: 4^12 fields at the bottom."""
    for level in range(12):
        message = file.message_type.add(name="M" if level == 0 else f"L{level}")
        for n in range(1, 5):
            optional = FieldDescriptorProto.LABEL_OPTIONAL
            if level == 11:
                message.field.add(name=f"x{n}", number=n, type=1, label=optional)
            else:
                of = f".p.L{level + 1}"
                message.field.add(name=f"x{n}", number=n, type=11, label=optional, type_name=of)


def protobuf_tree() -> bytes:
    schema, _ = protobuf_schema(deep_tree)
    messages = [("/s", START_NS + n, b"") for n in range(100)]
    return mcap_file(messages, ("p.M", "protobuf", schema), "protobuf", META)


def ros_tree() -> bytes:
    parts = []
    for level in range(20):
        of = "float64" if level == 19 else f"p/L{level + 1}"
        mark = "" if level == 0 else "=" * 80 + f"\nMSG: p/L{level}\n"
        parts.append(mark + "\n".join(f"{of} x{n}" for n in range(4)))
    schema = ("p/M", "ros2msg", "\n".join(parts).encode())
    return mcap_file([("/s", START_NS, b"\0\1\0\0")], schema, "cdr", META)


def ros_strings() -> bytes:
    """A hundred thousand empty strings in one message."""
    body = b"\0\1\0\0" + struct.pack("<I", 100_000) + struct.pack("<II", 1, 0) * 100_000
    schema = ("p/M", "ros2msg", b"string[] name\nfloat64 iq_a")
    return mcap_file([("/s", START_NS, body)] * 3, schema, "cdr", META)


META = {"contract": "1", "motor_id": "bomb", "test": "drive"}
NESTED = b'{"t_s":' + b"[" * 200_000 + b"]" * 200_000 + b"}"
ROW = "t_s,iq_a\n" + "0.0,1.0\n" * 2
BOMBS: dict[str, Callable[[], bytes]] = {
    "zstd, 4 GiB out of 100 declared bytes.mcap": lambda: file_of(chunk(zeros(4096 * MB), 100, 0)),
    "zstd, 4 GiB out of 64 MiB.mcap": lambda: file_of(chunk(zeros(4096 * MB), 64 * MB, 0)),
    "declares 1 TiB.mcap": lambda: file_of(chunk(b"x" * 100, 2**40, 0)),
    "declares 2^63.mcap": lambda: file_of(chunk(b"x" * 100, 2**63, 0)),
    "lz4, 256 MiB out of 1000.mcap": lambda: file_of(
        chunk(lz4.frame.compress(bytes(256 * MB)), 1000, 0, b"lz4")
    ),
    "a thousand modest chunks.mcap": lambda: file_of(
        *[chunk(zstandard.compress(bytes(32 * MB)) + b"", 32 * MB, 0)] * 1000
    ),
    "a record of 2^62 bytes.mcap": lambda: MAGIC + struct.pack("<BQ", 6, 2**62) + bytes(100),
    "an attachment of 2^62 bytes.mcap": lambda: file_of(
        record(9, bytes(16) + text(b"a") + text(b"b") + struct.pack("<Q", 2**62))
    ),
    "nested JSON.mcap": lambda: mcap_file([("/s", START_NS, NESTED)], None, "json", META),
    "long JSON numbers.mcap": lambda: mcap_file(
        [("/s", START_NS, b'{"t_s": ' + b"9" * 100_000 + b"}")] * 20, None, "json", META
    ),
    "many JSON keys.mcap": lambda: mcap_file(
        json_messages([{f"k{n}_{m}_a": 1.0 for n in range(2000)} for m in range(20)]),
        None,
        "json",
        META,
    ),
    "a protobuf tree.mcap": protobuf_tree,
    "a ROS tree.mcap": ros_tree,
    "many strings.mcap": ros_strings,
    "zstd.csv": lambda: zstandard.compress(HEAD + ROW.encode() + bytes(512 * MB)),
    "gzip.csv": lambda: gzip.compress(HEAD + ROW.encode() + bytes(256 * MB)),
    "zlib.csv": lambda: zlib.compress(HEAD + ROW.encode() + bytes(64 * MB)),
    "wide.csv": lambda: HEAD + b",".join(b"c%d_a" % n for n in range(200_000)) + b"\n",
    "wider.csv": lambda: HEAD + b"t_s" + b",iq_a" * 10_000_000,
    "one long line.csv": lambda: HEAD + b"t_s,iq_a\n0.0," + b"1" * 20_000_000,
    "all separators.csv": lambda: HEAD + b"t_s,iq_a\n" + b"," * 20_000_000 + b"\n",
    "many keys.csv": lambda: b"".join(b"# k%d: v\n" % n for n in range(1_000_000)),
}
ALIASES = b"contract: 1\nmotor_id: &a [x,x,x,x,x,x,x,x,x]\n" + b"".join(
    b"k%d: &b%d [%s]\n" % (n, n, b",".join([b"*a"] * 9)) for n in range(12)
)
BESIDE = {"aliases.csv": (ROW.encode(), ALIASES), "deep.csv": (ROW.encode(), b"a: " + b"[" * 10**5)}


def write(folder: Path) -> Iterator[Path]:
    """Writes each bomb into a folder of its own."""
    contents = {name: (make, None) for name, make in BOMBS.items()}
    contents |= {name: ((lambda own=own: own), beside) for name, (own, beside) in BESIDE.items()}
    for number, (name, (make, beside)) in enumerate(contents.items()):
        place = folder / f"{number:02d}"
        place.mkdir(parents=True, exist_ok=True)
        (place / name).write_bytes(make())
        if beside is not None:
            (place / name).with_suffix(".meta.yaml").write_bytes(beside)
        yield place / name


def refuse(path: Path) -> dict[str, object]:
    """How one file is refused, after how much computing [s]; the peak is the process's so far."""
    from pipeline.io.ingest.capture_reader import read_capture, survey
    from pipeline.records.errors import CaptureError

    start = time.process_time()
    found = survey(path.parent, {})
    codes = [finding.code for finding in found.findings]
    for entry in found.entries:
        try:
            read_capture(path.parent, entry)
        except CaptureError as fault:
            codes.append(fault.code)
        else:
            codes.append("READ")
    seconds = time.process_time() - start
    peak = round(peak_mb(os.getpid()))
    return {"file": path.name, "codes": codes, "seconds": seconds, "peak_mb": peak}


if __name__ == "__main__":
    for place in sorted(Path(sys.argv[1]).glob("*/*.[mc][cs][av]*")):
        sys.stdout.write(json.dumps(refuse(place)) + "\n")
