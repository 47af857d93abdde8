"""Rows of a log that are captures of their own, proposed with evidence and cut on request."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.inspection.describe import describe
from pipeline.io.inspection.parts import parts_of
from pipeline.io.maps.map_file import parse_source_file

STEP_S = 0.01
TIME = np.arange(0.0, 20.0, STEP_S)
DRIVEN, COASTS = TIME < 6.0, (TIME >= 6.0) & (TIME < 14.0)


def day(braking_a: float = 0.0) -> dict[str, np.ndarray]:
    """Driven for six seconds, then slower from 100 rad/s to rest within eight, then at rest."""
    rng = np.random.default_rng(1)
    speed = np.where(DRIVEN, 100.0 * TIME / 6.0, np.clip(100.0 - 12.5 * (TIME - 6.0), 0.0, None))
    current = np.where(DRIVEN, 5.0, np.where(COASTS, -braking_a, 0.0))
    noisy = current + 0.01 * rng.normal(size=TIME.size)
    return {"t_s": TIME, "omega_mech_rad_s": speed, "iq_a": noisy}


def test_a_coast_and_a_rest_are_parted_from_what_was_driven() -> None:
    drive, coast, rest = parts_of("day.csv", day())
    assert (drive.first, drive.test, coast.test, rest.test) == (0, "drive", "spin_down", None)
    assert abs(coast.first - 600) <= 3
    assert abs(coast.last - 1400) <= 25
    assert (drive.last + 1, coast.last + 1) == (coast.first, rest.first)
    assert rest.last == TIME.size - 1
    assert "no current beyond 0.1 A" in coast.why
    assert "driven for 5.99 s" in drive.why


def test_the_angle_alone_shows_the_same_coast() -> None:
    columns = day()
    speed = columns.pop("omega_mech_rad_s")
    by_angle = parts_of("day.csv", {**columns, "theta_mech_rad": np.cumsum(speed) * STEP_S})
    assert [part.test for part in by_angle] == ["drive", "spin_down", None]


def test_a_shaft_that_is_braked_by_a_current_does_not_coast() -> None:
    assert parts_of("day.csv", day(braking_a=1.0)) == ()


@pytest.mark.parametrize("without", ["iq_a", "t_s", "omega_mech_rad_s"])
def test_without_current_clock_or_motion_nothing_is_proposed(without: str) -> None:
    assert parts_of("day.csv", {n: v for n, v in day().items() if n != without}) == ()


def test_a_held_speed_with_a_transducer_is_a_torque_map() -> None:
    columns = day()
    columns["omega_mech_rad_s"] = np.where(DRIVEN, 100.0 * TIME / 6.0, 80.0)
    columns["iq_a"] = np.where(DRIVEN, 5.0, np.sign(np.sin(TIME)))
    assert parts_of("day.csv", columns) == ()
    held = parts_of("day.csv", {**columns, "torque_shaft_nm": 0.1 * columns["iq_a"]})
    assert [part.test for part in held][-1] == "torque_map"
    assert "held at 80 rad/s" in held[-1].why


@pytest.mark.parametrize("asked", [False, True])
def test_a_map_cuts_a_log_only_where_that_is_asked_for(tmp_path: Path, asked: bool) -> None:
    columns = day()
    rows = zip(*columns.values(), strict=True)
    text = "t_s,omega_mech_rad_s,iq_a\n" + "".join(f"{t:.2f},{w:.3f},{i:.3f}\n" for t, w, i in rows)
    (tmp_path / "day.csv").write_text(text)
    answers = {"motor_id": "M1", "test": "drive"} | ({"captures": "proposed"} if asked else {})
    report = describe(tmp_path / "day.csv", {}, answers)
    assert "rows: 600-" in report.starter
    entries = survey(tmp_path, parse_source_file(report.starter.encode(), "found")).entries
    captures = [read_capture(tmp_path, entry) for entry in entries]
    tests = [one.meta.test for one in captures]
    assert tests == (["drive", "spin_down"] if asked else ["drive"])
    assert sum(table.height for one in captures for table in one.tables) <= TIME.size
