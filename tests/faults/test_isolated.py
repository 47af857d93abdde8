"""Readings that the real world has: lost ones, late rows, a shaft at rest; and one line a cause."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.contracts.gates.isolated_readings import isolated
from pipeline.contracts.validate import validate
from pipeline.records.finding import Finding, lines_of
from tests.faults.healthy import Motor, column, drive, heat_run, spin_down, with_column
from tests.faults.verdicts import refused, warned

MOTOR = Motor()


@pytest.mark.parametrize(
    ("make", "name"), [(drive, "omega_mech_rad_s"), (spin_down, "omega_mech_rad_s")]
)
def test_single_readings_of_nothing_are_set_aside_and_counted(
    make, name: str, rng: np.random.Generator
) -> None:
    """Warned: eleven readings of 0 rad/s amid a turning shaft; those rows go and no others."""
    capture = make(MOTOR, rng)
    values = column(capture, name)
    fast = np.flatnonzero(np.abs(values) > 0.5 * np.abs(values).max())
    lost = np.sort(rng.choice(fast[5:-5:5], 11, replace=False))
    values[lost] = 0.0
    passed, finding = warned(with_column(capture, name, values))
    assert finding.code == "isolated_readings"
    assert finding.message.startswith("11 single readings")
    left = column(passed, name)
    assert np.flatnonzero(np.isnan(left)).tolist() == lost.tolist()


def test_a_lost_angle_is_set_aside_in_a_log_of_the_angle(rng: np.random.Generator) -> None:
    """Warned: one angle of 0 in a log that has passed many turns."""
    capture = drive(MOTOR, rng)
    angle = column(capture, "theta_mech_rad")
    angle[20_000] += 40.0
    assert not isolated(column(capture, "theta_mech_rad"), 8.0).any()
    assert np.flatnonzero(isolated(angle, 8.0)).tolist() == [20_000]


@pytest.mark.parametrize("off_rad", [0.3, -0.3])
def test_an_angle_off_the_course_of_a_fast_shaft_is_missing(
    off_rad: float, rng: np.random.Generator
) -> None:
    """Warned: it comes back within a row as a shaft of 350 rad/s may move, and so stood alone."""
    capture = spin_down(MOTOR, rng)
    t_s, speed = column(capture, "t_s"), column(capture, "omega_mech_rad_s")
    angle = np.cumsum(speed * np.gradient(t_s))
    angle[300] += off_rad
    passed, finding = warned(with_column(capture, "theta_mech_rad", angle))
    assert finding.code == "isolated_readings"
    assert np.flatnonzero(np.isnan(column(passed, "theta_mech_rad"))).tolist() == [300]


@pytest.mark.parametrize("name", ["id_a", "iq_a", "torque_shaft_nm"])
def test_a_current_or_torque_of_nothing_is_missing(name: str, rng: np.random.Generator) -> None:
    """Warned: one zero in a thousand readings made a sound motor `unknown`; other columns stay."""
    capture = drive(MOTOR, rng)
    t_s = column(capture, "t_s")
    values = 8.0 + np.sin(3.0 * t_s) + rng.normal(0.0, 0.02, t_s.size)
    lost = [777, 4100, 9000, 9900, 12345]
    values[lost] = 0.0
    passed, finding = warned(with_column(capture, name, values))
    assert (finding.code, finding.message[:17]) == ("isolated_readings", "5 single readings")
    assert np.flatnonzero(np.isnan(column(passed, name))).tolist() == lost
    assert not np.isnan(column(passed, "theta_mech_rad")).any()


def test_a_torque_that_overshoots_where_the_current_steps_stays(rng: np.random.Generator) -> None:
    capture = drive(MOTOR, rng)
    rows = column(capture, "t_s").size
    current = np.where(np.arange(rows) < 5000, 2.0, 6.0) + rng.normal(0.0, 0.01, rows)
    torque = 0.1 * current + 0.05 * np.sin(0.003 * np.arange(rows)) + rng.normal(0.0, 1e-3, rows)
    torque[5000] += 0.2
    driven = with_column(with_column(capture, "iq_a", current), "torque_shaft_nm", torque)
    passed, findings = validate(driven, {})
    assert "isolated_readings" not in {finding.code for finding in findings}
    assert not np.isnan(column(passed, "torque_shaft_nm")).any()


@pytest.mark.parametrize("kind", ["noise", "quanta", "square", "many"])
def test_what_is_no_isolated_reading_stays(kind: str, rng: np.random.Generator) -> None:
    """Noise, jumps by one quantum, edges, and outliers that are a fiftieth of all rows."""
    time = np.arange(20_000) * 1e-3
    values = {
        "noise": rng.normal(0.0, 1.0, time.size),
        "quanta": np.round(100.0 * np.sin(time)),
        "square": np.where(np.sin(5 * time) > 0, 10.0, -10.0) + rng.normal(0, 0.01, time.size),
        "many": np.where(np.arange(time.size) % 50 == 0, 0.0, 100.0),
    }[kind]
    assert not isolated(values, 8.0).any()


def test_one_late_row_of_a_heat_run_is_a_warning(rng: np.random.Generator) -> None:
    """Warned: a skip of 2.4 ms in minutes changes nothing that a heat run determines."""
    capture = heat_run(MOTOR, rng)
    t = column(capture, "t_s")
    usual, length = float(t[1] - t[0]), float(t[-1] - t[0])
    clock = replace(capture.meta, u_rel_clock=4.0 * usual / length)
    capture = with_column(capture, "temp_winding_degc", 25.0 + 1e-2 * t)
    capture = replace(capture, meta=clock)
    t[4000:] += 2.0 * usual
    _, findings = validate(with_column(capture, "t_s", t), {})
    assert "clock_jump" in {one.code for one in findings}
    t[5000:] += 3.0 * usual
    assert refused(with_column(capture, "t_s", t)).code == "clock_jump"


def test_a_shaft_at_rest_has_no_sign(rng: np.random.Generator) -> None:
    """Let through: a still angle beside a speed of noise, which integrates to turns."""
    capture = drive(MOTOR, rng)
    angle = column(capture, "theta_mech_rad")
    size = angle.size
    still = with_column(capture, "theta_mech_rad", rng.normal(0.0, 1e-3, size))
    noisy = with_column(still, "omega_mech_rad_s", rng.normal(3.0, 4.0, size))
    assert "speed_against_angle" not in _codes(noisy)
    turning = with_column(still, "omega_mech_rad_s", np.full(size, 30.0) + rng.normal(0, 1, size))
    assert "speed_against_angle" in _codes(turning)


def _codes(capture) -> str:
    from pipeline.records.errors import CaptureError

    try:
        return " ".join(one.code for one in validate(capture, {})[1])
    except CaptureError as fault:
        return f"{fault.code} {fault.message}"


def test_many_warnings_of_one_cause_are_one_line_with_a_count() -> None:
    """Refusals stay a line a file; three alike are told one by one."""

    def warning(n: int, code: str) -> Finding:
        return Finding(f"f{n}.csv", "warning", code, f"message {n}", "remedy")

    many = [warning(n // 2, "gap") for n in range(291)]
    few = [warning(n, "slow") for n in range(3)]
    gone = [Finding(f"r{n}.csv", "refused", "gap", "m", "remedy") for n in range(5)]
    lines = lines_of([*many, *few, *gone])
    assert len(lines) == 1 + 3 + 5
    assert lines[0] == "warning: f0.csv: message 0; remedy [gap] (291 such warnings in 146 files)"
    assert [line for line in lines if line.startswith("refused")] == [one.line() for one in gone]
