"""Every number of the gate of a clock's jumps from both sides, a few per cent away."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.gates import (
    clock_jump,
)
from tests.unit.contracts.test_gate_limits import GATES, capture, said


@pytest.mark.parametrize(("gap", "expected"), [(1.45, ""), (1.55, "refused")])
def test_a_gap_begins_at_one_and_a_half_intervals(gap: float, expected: str) -> None:
    rows = np.arange(200.0)
    t_s = np.where(rows < 100, rows, rows - 1.0 + gap) * 1e-3
    made = capture("drive", t_s=t_s, theta_mech_rad=rows * 0.01)
    assert said("clock_jump", made) == expected


@pytest.mark.parametrize(("skip", "expected"), [(1.95, "warned"), (2.05, "refused")])
def test_a_skip_below_the_time_bases_uncertainty_is_a_warning(skip: float, expected: str) -> None:
    """1 s of record at a relative 1e-3: one interval of 1 ms may be lost beside its own."""
    rows = np.arange(1001.0)
    t_s = np.where(rows < 500, rows, rows - 1.0 + skip) * 1e-3
    made = capture("drive", t_s=t_s, theta_mech_rad=rows * 0.01, meta={"u_rel_clock": 1e-3})
    assert said("clock_jump", made) == expected
    if expected == "warned":
        (finding,) = GATES["clock_jump"].check(made, GATES["clock_jump"].options).findings
        assert finding.rows == (499, 500)
        assert "goes on as after 0.001 s" in finding.message


def test_skips_add_up_over_gaps() -> None:
    """Two skips of 0.6 ms beyond their interval: each alone is within 1 ms, both are not."""
    rows = np.arange(1001.0)
    late = 0.6 * ((rows >= 300).astype(float) + (rows >= 600))
    made = capture("drive", t_s=(rows + late) * 1e-3, theta_mech_rad=rows * 0.01,
                   meta={"u_rel_clock": 1e-3})  # fmt: skip
    assert said("clock_jump", made) == "refused"
    one = capture("drive", t_s=(rows + 0.6 * (rows >= 300)) * 1e-3, theta_mech_rad=rows * 0.01,
                  meta={"u_rel_clock": 1e-3})  # fmt: skip
    assert said("clock_jump", one) == "warned"


@pytest.mark.parametrize(("sigmas", "expected"), [(7.7, ""), (8.3, "refused")])
def test_a_skip_stands_out_of_the_scatter_eight_times(sigmas: float, expected: str) -> None:
    """A line with a ripple of +-d on 25 rows a side, skipped by nine intervals of motion."""
    rows = np.arange(200)
    ripple = (-1.0) ** rows
    t_s = np.where(rows < 100, rows, rows + 9) * 1.0

    def shown(d):
        return capture("drive", t_s=t_s, theta_mech_rad=rows + d * ripple)

    d = 1.0
    for _ in range(40):
        values = rows + d * ripple
        left = clock_jump._line(t_s[75:100], values[75:100], 99.0)
        right = clock_jump._line(t_s[100:125], values[100:125], 109.0)
        scatter = math.hypot(left[2], right[2]) + 0.5 * abs(right[1] - left[1])
        moved = abs(right[0] - left[0] - 0.5 * (left[1] + right[1]) * 10.0)
        d *= moved / scatter / sigmas
    assert moved / scatter == pytest.approx(sigmas, rel=1e-3)
    assert said("clock_jump", shown(d)) == expected


def test_only_rows_near_a_gap_are_looked_at() -> None:
    """The line is through 25 rows: a bend before them does not count, one of the first does."""
    rows = np.arange(200.0)
    t_s = np.where(rows < 100, rows, rows + 9.0)
    options = GATES["clock_jump"].options
    for back, there in ((25, True), (24, False)):
        bend = np.where(rows < 100 - back, 30.0 * (100 - back - rows), 0.0)
        made = capture("drive", t_s=t_s, theta_mech_rad=rows + bend)
        table = made.tables[0]
        assert clock_jump._went_on(table, "theta_mech_rad", 99, 1.0, options) is there


def turning_back(rows: np.ndarray) -> np.ndarray:
    """Angle [rad] of a shaft that slows down and turns on over 80 ms, at rows of 1 ms."""
    return 20e-3 * rows + 0.8 * np.cos(2.0 * math.pi * (rows - 250) / 80.0)


@pytest.mark.parametrize(("at", "lost"), [(240, 40), (260, 40), (270, 30)])
def test_a_shaft_that_turned_back_while_samples_were_lost_is_no_skip(at: int, lost: int) -> None:
    """It is back near where it was, so that a straight line alone takes it for a skip."""
    kept = np.delete(np.arange(600), np.arange(at, at + lost))
    made = capture("drive", t_s=kept * 1e-3, theta_mech_rad=turning_back(kept))
    assert said("clock_jump", made) == ""


@pytest.mark.parametrize("at", [240, 250])
def test_a_clock_that_skips_while_a_shaft_turns_back_is_refused(at: int) -> None:
    rows = np.arange(600)
    t_s = np.where(rows < at, rows, rows + 100) * 1e-3
    made = capture("drive", t_s=t_s, theta_mech_rad=turning_back(rows))
    assert said("clock_jump", made) == "refused"


def test_a_table_without_a_clock_and_a_clock_that_stands() -> None:
    rows = np.arange(600.0)
    made = capture("drive", t_s=rows * 1e-3, theta_mech_rad=rows * 0.01)
    other = pl.DataFrame({"temp_case_degc": rows})
    both = replace(made, tables=(other, *made.tables, made.tables[0].head(2)))
    for gate in ("clock_jump", "dropped_samples", "isolated_readings"):
        assert said(gate, both) == ""
    speed = 50.0 + rows * 0.01
    speed[200] = 0.0
    still = capture("drive", t_s=np.zeros(600), omega_mech_rad_s=speed)
    assert said("isolated_readings", still) == ""
