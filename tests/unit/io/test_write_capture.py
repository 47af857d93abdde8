"""Written captures come back bit for bit, by the public decoders and by this project's reader."""

from __future__ import annotations

import hashlib
import io
import json
import math
import struct
import time

import numpy as np
import pytest
from mcap.reader import make_reader

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.storage.write_capture import Format, csv_bytes, mcap_bytes, write_capture
from pipeline.records.errors import CaptureError

META = {
    "contract": "1",
    "motor_id": "000123",
    "test": "drive",
    "started_at": "2026-01-05T08:00:00Z",
}
T = np.arange(1201) / 8000.0
TABLE = {
    "t_s": T,
    "id_a": np.sin(70 * T) / 3.0,
    "iq_a": np.cos(50 * T) * 1e-7,
    "vd_v": np.round(T * 100) / 64.0,
    "vq_v": -np.exp(T),
    "theta_mech_rad": 1e5 + T,
}
FORMATS = [
    Format(encoding, block, compression)  # type: ignore[arg-type]
    for encoding in ("json", "protobuf", "cdr")
    for block in (None, 500)
    for compression in ("none", "lz4", "zstd")
]
IDS = [f"{f.encoding}-{f.block_rows}-{f.compression}" for f in FORMATS]


def read_back(folder):
    found = survey(folder, {})
    assert [f.message for f in found.findings] == []
    (entry,) = found.entries
    return read_capture(folder, entry)


def decoded(content, encoding):
    """Columns by the public decoders."""
    import io

    factories = []
    if encoding == "protobuf":
        from mcap_protobuf.decoder import DecoderFactory as Protobuf

        factories.append(Protobuf())
    elif encoding == "cdr":
        from mcap_ros2.decoder import DecoderFactory as Ros

        factories.append(Ros())
    reader = make_reader(io.BytesIO(content), validate_crcs=True, decoder_factories=factories)
    columns: dict[str, list[float]] = {name: [] for name in TABLE}
    messages = (
        (json.loads(m.data) for _, _, m in reader.iter_messages())
        if encoding == "json"
        else (m for _, _, _, m in reader.iter_decoded_messages())
    )
    for message in messages:
        for name, column in columns.items():
            value = message[name] if isinstance(message, dict) else getattr(message, name)
            column.extend(np.atleast_1d(np.asarray(value, dtype=float)).tolist())
    return columns


@pytest.mark.parametrize("form", FORMATS, ids=IDS)
def test_public_decoders_and_our_reader_give_the_samples_back(form, tmp_path):
    path = write_capture(tmp_path, "drive_0", META, [TABLE], form)
    columns = decoded(path.read_bytes(), form.encoding)
    capture = read_back(tmp_path)
    assert capture.integrity == "verified"
    assert (capture.meta.motor_id, capture.meta.test) == ("000123", "drive")
    for name, values in TABLE.items():
        assert np.array_equal(columns[name], values)
        assert np.array_equal(capture.tables[0][name].to_numpy(), values)


def test_tables_of_two_clocks_are_two_topics(tmp_path):
    slow = {"t_s": T[::100], "temp_winding_degc": 25.0 + T[::100]}
    write_capture(tmp_path, "drive_0", META, [TABLE, slow], Format("protobuf"))
    capture = read_back(tmp_path)
    assert sorted(table.height for table in capture.tables) == [13, 1201]
    with pytest.raises(ValueError, match="one table"):
        write_capture(tmp_path, "drive_0", META, [TABLE, slow], Format("csv"))


def test_csv_is_sealed_and_reads_back(tmp_path):
    table = {**TABLE, "iq_a": np.where(T < 0.01, np.nan, TABLE["iq_a"])}
    content = write_capture(tmp_path, "drive_0", META, [table], Format("csv")).read_bytes()
    head = [line for line in content.splitlines(keepends=True) if line.startswith(b"#")]
    body = content[sum(map(len, head)) :]
    seal = next(line for line in head if b"sha256_rows" in line).decode().split(": ")[1].strip()
    assert seal == f"{hashlib.sha256(body).hexdigest()}/1201"
    capture = read_back(tmp_path)
    assert capture.integrity == "verified"
    for name, values in table.items():
        assert np.array_equal(capture.tables[0][name].to_numpy(), values, equal_nan=True)


def test_missing_values_are_null_in_json_and_nan_elsewhere():
    table = {"t_s": np.array([0.0, 1.0]), "id_a": np.array([math.nan, 2.0])}
    assert b"NaN" not in mcap_bytes(META, [table], Format("json", compression="none"))
    assert b'"id_a":[null,2.0]' in mcap_bytes(META, [table], Format("json", compression="none"))
    raw = mcap_bytes(META, [table], Format("cdr", block_rows=None, compression="none"))
    assert struct.pack("<2d", 1.0, 2.0) in raw


@pytest.mark.parametrize("form", FORMATS, ids=IDS)
def test_the_same_capture_is_the_same_bytes(form):
    assert mcap_bytes(META, [TABLE], form) == mcap_bytes(META, [TABLE], form)


def test_log_time_counts_from_the_start_in_nanoseconds():
    import io

    content = mcap_bytes(META, [TABLE], Format("protobuf", block_rows=None))
    stamps = [m.log_time for _, _, m in make_reader(io.BytesIO(content)).iter_messages()]
    assert stamps[0] == 1_767_600_000 * 10**9
    assert np.array_equal(np.diff(stamps), np.full(1200, 125_000))


def test_a_flipped_bit_is_refused_or_changes_no_sample(tmp_path):
    """At 150 places of a small file: what is still called verified still holds the samples."""
    table = {name: column[:20] for name, column in TABLE.items()}
    content = mcap_bytes(META, [table], Format("cdr", compression="none"))
    rng = np.random.default_rng(0)
    for at in rng.choice(len(content), 150, replace=False):
        bad = bytearray(content)
        bad[at] ^= 1 << int(rng.integers(8))
        (tmp_path / "x.mcap").write_bytes(bad)
        found = survey(tmp_path, {})
        if found.entries:
            try:
                capture = read_capture(tmp_path, found.entries[0])
            except CaptureError:
                continue
            if capture.integrity == "verified":
                for name, values in table.items():
                    assert np.array_equal(capture.tables[0][name].to_numpy(), values)


def test_columns_of_unequal_length_are_refused(tmp_path):
    with pytest.raises(ValueError, match="unequal"):
        write_capture(tmp_path, "x", META, [{"t_s": T, "id_a": T[:5]}], Format("cdr"))
    assert csv_bytes(META, TABLE) == csv_bytes(META, TABLE)


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo"])
def test_a_start_without_a_zone_is_in_utc(zone, monkeypatch):
    """The contract's start is in UTC: the bytes are the same wherever they are written."""
    table = {"t_s": np.arange(3.0)}
    said, stated = (
        {"contract": "1", "started_at": f"2026-01-05T08:00:00{end}"} for end in ("", "Z")
    )
    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        clocks = [_first_log_time(mcap_bytes(m, [table], Format("json"))) for m in (said, stated)]
    finally:
        monkeypatch.undo()
        time.tzset()
    assert clocks[0] == clocks[1]


def _first_log_time(content: bytes) -> int:
    return next(iter(make_reader(io.BytesIO(content)).iter_messages()))[2].log_time
