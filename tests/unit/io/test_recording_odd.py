"""Odd captures still make recordings: what is not there is left out, never a failure."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pipeline.io.recordings.capture import recording_bytes
from pipeline.io.recordings.motor import motor_bytes, segment_id
from pipeline.io.recordings.readback import entities, recording_property
from pipeline.records.capture import Campaign, Capture, CaptureMeta, Mask
from pipeline.records.evidence import Evidence, Series
from pipeline.records.finding import Finding
from pipeline.stages.steps.replay import replay
from tests.unit.stages.test_replay import make_sheet

NAN = float("nan")
THREADS = Path("/proc/self/task")
DQ = ("vd_v", "vq_v", "id_a", "iq_a", "theta_mech_rad", "torque_shaft_nm")


def dq(rows: int, value: float, t_s: object = None) -> pl.DataFrame:
    clock = np.arange(rows) * 1e-4 if t_s is None else t_s
    return pl.DataFrame({"t_s": clock} | {name: np.full(rows, value) for name in DQ})


ODD = {
    "one row": (dq(1, 1.0),),
    "two rows": (dq(2, 1.0),),
    "nothing but time": (pl.DataFrame({"t_s": np.arange(10) * 1e-3}),),
    "all missing": (dq(2000, NAN),),
    "all zero": (dq(2000, 0.0),),
    "no instant is finite": (dq(2000, 1.0, np.full(2000, NAN)),),
    "no rows": (dq(0, 1.0),),
    "no table": (),
    "huge": (dq(2000, 1e30),),
    "rows without time": (pl.DataFrame({"id_a": [1.0, NAN], "psi_d_wb": [0.1, 0.2]}),),
    "two clocks": (
        dq(2000, 1.0),
        pl.DataFrame({"t_s": [0.0, 0.1], "temp_winding_degc": [25.0, NAN]}),
    ),
}


def made(tables: tuple[pl.DataFrame, ...], motor_id: str = "m") -> Capture:
    meta = CaptureMeta(motor_id, "drive", pole_pairs=4)
    masks = [Mask("rate", 0, np.arange(tables[0].height) % 3 > 0)] if tables else []
    return Capture("a/odd 1.mcap", "0" * 64, "verified", meta, tables, tuple(masks))


@pytest.mark.skipif(not THREADS.is_dir(), reason="the system lists no threads")
def test_recordings_leave_no_threads_behind() -> None:
    """A stream of Rerun keeps two threads and its buffers, also when nothing refers to it."""
    capture = made((dq(2000, 1.0),))
    recording_bytes(capture, ())
    before = len(list(THREADS.iterdir()))
    for _ in range(5):
        recording_bytes(capture, ())
    assert len(list(THREADS.iterdir())) <= before


@pytest.mark.parametrize("kind", ODD)
def test_an_odd_capture_makes_a_recording_of_it_and_of_its_motor(kind: str, tmp_path: Path) -> None:
    capture, sheet = made(ODD[kind]), make_sheet()
    told = replay(capture, sheet)
    path = tmp_path / "x.rrd"
    path.write_bytes(recording_bytes(capture, told, sheet))
    assert {"/findings", "/datasheet"} <= set(entities(path))
    path.write_bytes(motor_bytes(Campaign("m", (capture,)), sheet, told, ()))
    assert {"/sheet", "/checks", "/constants", "/findings"} <= set(entities(path))


def test_evidence_that_is_all_missing_or_empty_is_no_trouble(tmp_path: Path) -> None:
    t_s, nothing = np.arange(50) * 1e-3, np.full(50, NAN)
    evidence = (
        Evidence(
            "a", "A", "t_s", "vq_v", "line", (Series("", t_s, nothing, nothing),), "a/odd 1.mcap"
        ),
        Evidence(
            "b",
            "B",
            "t_s",
            "vd_v",
            "line",
            (Series("", t_s[:0], t_s[:0], t_s[:0]),),
            "a/odd 1.mcap",
        ),
    )
    path = tmp_path / "x.rrd"
    path.write_bytes(recording_bytes(made(ODD["two clocks"]), evidence, make_sheet()))
    assert "/model/a/0_0" in entities(path)


def test_names_that_no_font_and_no_file_system_has_keep_motors_apart(tmp_path: Path) -> None:
    """Emoji, slashes and points in a serial number; the row of the table says what can be drawn."""
    names = ("../M🛞.1", "M🛞 1", "M‹1F6DE› 1")
    seen = set()
    for name in names:
        sheet = make_sheet().__class__(**{**_fields(make_sheet()), "motor_id": name})
        capture = made(ODD["two rows"], name)
        found = Finding(capture.path, "warning", "odd", "✘ 🛞", "ask")
        path = tmp_path / "x.rrd"
        path.write_bytes(recording_bytes(capture, (), sheet, (found,)))
        path.write_bytes(motor_bytes(Campaign(name, (capture,)), sheet, (), (found,)))
        seen.add(segment_id(sheet))
        assert "🛞" not in "".join(recording_property(path, "motor", "id"))
    assert len(seen) == len(names)


def _fields(sheet: object) -> dict[str, object]:
    from dataclasses import fields

    return {field.name: getattr(sheet, field.name) for field in fields(sheet)}  # type: ignore[arg-type]
