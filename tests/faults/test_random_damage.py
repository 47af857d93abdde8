"""Random damage to files without checksums: refused or read, and only CaptureError comes out."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from mcap.writer import CompressionType

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.inspection.describe import describe
from pipeline.io.maps.map_file import load_source_maps
from pipeline.io.mcap.container import scan
from pipeline.io.mcap.tables import read_tables
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, mcap_file, small_capture
from tests.unit.io.test_cdr import JOINT_STATE
from tests.unit.io.test_protobuf import EVERY, EveryType
from tests.unit.io.test_source_maps import (
    CONF,
    KEYSIGHT,
    MDO,
    MOTEUS,
    PICO,
    RIGOL,
    SAID,
    SIGLENT,
    TDS,
    VESC,
)

BARE = {
    "enable_data_crcs": False,
    "enable_crcs": False,
    "compression": CompressionType.NONE,
}


def protobuf_file() -> bytes:
    payloads = [
        EveryType(x1=n, x3=n, many1=[n, n + 1], many3=[n, -n]).SerializeToString()
        for n in range(20)
    ]
    messages = [("/s", START_NS + n, payload) for n, payload in enumerate(payloads)]
    return mcap_file(messages, ("p.M", "protobuf", EVERY), "protobuf", **BARE)


def joint_file() -> bytes:
    head = b"\0\1\0\0" + bytes(8) + b"\2\0\0\0b\0\0\0" + b"\1\0\0\0\2\0\0\0j\0\0\0"
    one, half = b"\1\0\0\0", np.array([0.5]).tobytes()
    body = head + one + half + (one + bytes(4) + half) * 2  # each double aligned to 8 bytes
    messages = [("/s", START_NS + n, body) for n in range(10)]
    schema = ("sensor_msgs/msg/JointState", "ros2msg", JOINT_STATE.encode())
    return mcap_file(messages, schema, "cdr", **BARE)


FILES = {
    "json": lambda: small_capture(**BARE),
    "json unchunked": lambda: small_capture(**BARE, use_chunking=False),
    "protobuf": protobuf_file,
    "joint state": joint_file,
}


@pytest.mark.parametrize("kind", FILES)
def test_damaged_recordings_never_escape(kind: str) -> None:
    """Expected: hundreds of refusals, some readings, no other exception and no warning."""
    whole = FILES[kind]()
    assert read_tables(scan(whole), lambda _topic, _name: True)
    generator = np.random.default_rng(17)
    refused = 0
    for _ in range(300):
        data = np.frombuffer(whole, np.uint8).copy()
        places = generator.integers(0, data.size, generator.integers(1, 5))
        data[places] = generator.choice([0, 1, 127, 255], places.size)
        try:
            read_tables(scan(data.tobytes()), lambda _topic, _name: True)
        except CaptureError as fault:
            assert fault.code and fault.remedy
            refused += 1
    assert refused > 100


TEXTS = (
    RIGOL,
    SIGLENT,
    MDO,
    TDS,
    PICO,
    VESC,
    MOTEUS,
    KEYSIGHT + "0,1,2\n1,2,3\n",
)
SPLINTERS = (b",", b"\n", b"\r\n", b"\r", b'"', b";", b"#", b"1e999", b"nan", b" ", b"\0", b"\xff")


@pytest.mark.parametrize("text", TEXTS)
def test_damaged_tables_never_escape(tmp_path: Path, text: str) -> None:
    """Expected: survey, reading and `inspect` refuse or read; nothing else happens."""
    maps = load_source_maps(CONF)
    (tmp_path / "x.meta.yaml").write_text(SAID)
    generator = np.random.default_rng(19)
    whole = text.encode()
    for _ in range(25):
        data = bytearray(whole)
        for place in generator.integers(0, len(data), generator.integers(1, 4)).tolist():
            data[place : place + int(generator.integers(0, 4))] = SPLINTERS[
                int(generator.integers(0, len(SPLINTERS)))
            ]
        (tmp_path / "x.csv").write_bytes(data)
        describe(tmp_path / "x.csv", maps)
        for entry in survey(tmp_path, maps).entries:
            try:
                read_capture(tmp_path, entry)
            except CaptureError as fault:
                assert fault.code and fault.remedy
