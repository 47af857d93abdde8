"""Every truncation and every single-bit flip of small recordings with checksums over everything."""

from __future__ import annotations

import time
from dataclasses import dataclass

from mcap.writer import CompressionType

from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import small_capture

LAYOUTS = {
    "zstd": {"compression": CompressionType.ZSTD},
    "lz4": {"compression": CompressionType.LZ4},
    "not packed": {"compression": CompressionType.NONE},
    "no chunks": {"use_chunking": False},
}


@dataclass(frozen=True)
class Damage:
    """What became of the damaged copies of one layout."""

    layout: str
    size_bytes: int
    truncations: int
    flips: int
    silent: tuple[str, ...]
    untyped: tuple[str, ...]
    seconds: float


def read(data: bytes) -> list[dict[str, bytes]]:
    """Every value that a file gives, as bytes."""
    tables = read_tables(scan(data), lambda _topic, _name: True)
    return [{name: values.tobytes() for name, values in t.fields.items()} for t in tables]


def damage(layout: str, step: int = 1) -> Damage:
    """Reads every copy, or every `step`-th; what is read at all counts as silent."""
    whole = small_capture(**LAYOUTS[layout])
    assert read(whole)
    silent: list[str] = []
    untyped: list[str] = []

    def attempt(name: str, data: bytes) -> None:
        try:
            read(data)
        except CaptureError as fault:
            assert fault.remedy
        except Exception as fault:  # noqa: BLE001 (that is what is looked for)
            untyped.append(f"{name}: {type(fault).__name__}: {fault}")
        else:
            silent.append(name)

    start = time.perf_counter()
    cuts = range(0, len(whole), step)
    for stop in cuts:
        attempt(f"cut at byte {stop}", whole[:stop])
    bits = range(0, 8 * len(whole), step)
    for bit in bits:
        flipped = bytearray(whole)
        flipped[bit // 8] ^= 1 << (bit % 8)
        attempt(f"bit {bit % 8} of byte {bit // 8}", bytes(flipped))
    seconds = time.perf_counter() - start
    counts = len(cuts), len(bits)
    return Damage(layout, len(whole), *counts, tuple(silent), tuple(untyped), seconds)
