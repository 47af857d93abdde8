"""Clocks of messages: the stamps of their senders, and whole numbers in several topics."""

from __future__ import annotations

import io
import json
from pathlib import Path

import numpy as np
import pytest
from mcap_ros2.writer import Writer as Ros2Writer

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.inspection.describe import describe
from pipeline.io.maps.map_file import parse_source_file
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from tests.unit.io.recordings import START_NS, mcap_file
from tests.unit.io.test_cdr import JOINT_STATE

JOINT_MAP = """
recognise: {topics: ['/joint_states']}
fields: {position: theta_mech_rad, effort: iq_a}
metadata: {motor_id: m, test: drive}
"""
N, PERIOD_NS = 40, 2_000_000


def bag(stamped: bool = True) -> bytes:
    """Joint states every 2 ms, which a recorder got in bursts of ten."""
    stream = io.BytesIO()
    writer = Ros2Writer(stream)
    schema = writer.register_msgdef("sensor_msgs/msg/JointState", JOINT_STATE)
    for n in range(N):
        sent_ns = 1_700_000_000_999_000_000 + n * PERIOD_NS if stamped else 0
        stamp = {"sec": sent_ns // 10**9, "nanosec": sent_ns % 10**9}
        message = {
            "header": {"stamp": stamp, "frame_id": ""},
            "name": ["knee"],
            "position": [0.1 * n],
            "velocity": [50.0],
            "effort": [1.0 + n],
        }
        got_ns = START_NS + 10 * PERIOD_NS * (n // 10)
        writer.write_message("/joint_states", schema, message, got_ns, got_ns, n)
    writer.finish()
    return stream.getvalue()


def read(folder: Path, data: bytes, text: str) -> Capture:
    """The only capture of a folder with one file, by a source map."""
    (folder / "a.mcap").write_bytes(data)
    found = survey(folder, {"bench": parse_source_file(text.encode(), "bench")["bench"]})
    return read_capture(folder, found.entries[0])


def test_rows_are_at_the_stamps_of_the_sender(tmp_path: Path) -> None:
    (table,) = read(tmp_path, bag(), JOINT_MAP + "time: {from: stamp}\n").tables
    np.testing.assert_allclose(table["t_s"], 2e-3 * np.arange(N), atol=1e-12)
    assert table["iq_a"].to_list() == [1.0 + n for n in range(N)]
    (by_log,) = read(tmp_path, bag(), JOINT_MAP + "time: {from: log}\n").tables
    assert by_log["t_s"].n_unique() == N // 10


def test_messages_without_a_stamp_are_refused_with_what_to_write(tmp_path: Path) -> None:
    data = mcap_file(
        [("/joint_states", START_NS, b'{"position": 1.0, "effort": 2.0}')], metadata={}
    )
    with pytest.raises(CaptureError, match="stamp") as refused:
        read(tmp_path, data, JOINT_MAP + "time: {from: stamp}\n")
    assert refused.value.code == "missing_time"
    assert "from: log" in refused.value.remedy


@pytest.mark.parametrize("stamped", [True, False])
def test_inspect_proposes_stamps_that_go_on(tmp_path: Path, stamped: bool) -> None:
    """Those of a driver that leaves them zero are none."""
    (tmp_path / "a.mcap").write_bytes(bag(stamped))
    report = describe(tmp_path / "a.mcap", {})
    assert report.starter is not None
    assert f"from: {'stamp' if stamped else 'log'}\n" in report.starter
    assert ("stamp.sec" in report.starter) is not stamped
    if stamped:
        assert report.streams[0].rate_hz == pytest.approx(500.0)


def test_topics_with_whole_numbers_for_a_clock_stay_in_step(tmp_path: Path) -> None:
    """Each counted from its own first row, so that one that begins later was moved to the first."""
    stream = io.BytesIO()
    writer = Ros2Writer(stream)
    for topic, name, first_us in (("/a", "iq_a", 0), ("/b", "theta_mech_rad", 7000)):
        schema = writer.register_msgdef(f"p/M{topic[1:].upper()}", f"int64 at\nfloat64 {name}\n")
        for n in range(30):
            message = {"at": 10**15 + first_us + 500 * n, name: 1.0 * n}
            writer.write_message(topic, schema, message, START_NS, START_NS, n)
    writer.finish()
    text = (
        "recognise: {topics: ['/a', '/b']}\n"
        "fields: {at: {column: t_s, unit: us}, iq_a: iq_a, theta_mech_rad: theta_mech_rad}\n"
        "metadata: {motor_id: m, test: drive}\n"
    )
    capture = read(tmp_path, stream.getvalue(), text)
    starts = {table.columns[1]: table["t_s"][0] for table in capture.tables}
    assert starts == pytest.approx({"iq_a": 0.0, "theta_mech_rad": 7e-3})


def test_rows_of_one_message_follow_its_stamp_by_the_increment(tmp_path: Path) -> None:
    messages = []
    for n in range(5):
        stamp = {"sec": 7 + n, "nanosec": 500_000_000}
        block = {"header": {"stamp": stamp}, "position": [0.1, 0.2, 0.3], "effort": [1.0, 2.0, 3.0]}
        messages.append(("/joint_states", START_NS, json.dumps(block).encode()))
    text = JOINT_MAP + "messages: block\ntime: {from: stamp, increment_s: 0.25}\n"
    (table,) = read(tmp_path, mcap_file(messages, metadata={}), text).tables
    expected = (np.arange(5.0)[:, None] + 0.25 * np.arange(3.0)).ravel()
    np.testing.assert_allclose(table["t_s"], expected, atol=1e-12)
