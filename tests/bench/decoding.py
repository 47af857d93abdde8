"""Decoding against unpacking and copying once, and against the public loop: ratios of one run."""

from __future__ import annotations

import io
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import zstandard

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from tests.bench.large import NAMES, large_file

TARGETS = {
    "cdr rows": 1.3,
    "cdr blocks": 1.3,
    "protobuf rows": 2.5,
    "protobuf blocks": 1.3,
    "json rows": 8.0,
    "json blocks": 8.0,
}
PUBLIC = {"cdr rows": 35.0, "protobuf rows": 35.0}


@dataclass(frozen=True)
class Ratio:
    """`ratio` to unpacking and copying; `public` times the public loop's CPU time, or None."""

    kind: str
    megabytes: float
    ratio: float
    rows_a_second: float
    public: float | None


def cpu_seconds(work: Callable[[], Any], runs: int = 3) -> float:
    """Least CPU time of some runs [s]."""
    times = []
    for _ in range(runs):
        start = time.process_time()
        result = work()
        times.append(time.process_time() - start)
        del result
    return min(times)


def measure(kind: str, megabytes: float, *, public: bool = False) -> Ratio:
    """Decodes a large file; raises AssertionError where a sample differs from what was written."""
    data, values = large_file(kind, megabytes)
    chunks = scan(data).chunks
    packed = [data[c.begin : c.end] for c in chunks]
    plain = sum(c.size for c in chunks)

    def unpack() -> bytearray:
        unpacker, out, at = zstandard.ZstdDecompressor(), bytearray(plain), 0
        for part in packed:
            body = unpacker.decompress(part)
            out[at : at + len(body)] = body
            at += len(body)
        return out

    def decode() -> Any:
        return read_tables(scan(data), lambda _topic, _name: True)

    (table,) = decode()
    for n, name in enumerate(NAMES):
        written = values[:, n]
        if kind == "protobuf rows":
            written = np.where(written == 0.0, 1e-9, written)
        assert np.array_equal(table.fields[name], written)
    del table
    base, ours = cpu_seconds(unpack), cpu_seconds(decode)
    times = public_loop(kind, data) / ours if public else None
    return Ratio(kind, plain / 1e6, ours / base, len(values) / ours, times)


def public_loop(kind: str, data: bytes) -> float:
    """CPU time of the public reader's decoding loop over the file [s]."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory as Protobuf
    from mcap_ros2.decoder import DecoderFactory as Ros2

    factory = Protobuf() if kind.startswith("protobuf") else Ros2()

    def loop() -> float:
        reader = make_reader(io.BytesIO(data), decoder_factories=[factory], validate_crcs=True)
        return sum(message.iq_a for _, _, _, message in reader.iter_decoded_messages())

    return cpu_seconds(loop, 1)
