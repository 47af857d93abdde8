"""A torque map whose rows are settled points is a table."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.registry import gates
from pipeline.contracts.settled_points import as_settled_points
from pipeline.contracts.validate import validate
from pipeline.records.errors import CaptureError
from tests.unit.settled import settled


@pytest.mark.parametrize("clock", [True, False])
def test_a_map_of_settled_points_is_read_as_a_table(clock):
    """It was refused: for a current that holds no level, or for want of a clock."""
    capture, findings = validate(settled("torque_map", clock=clock), {})
    assert capture.meta.test == "torque_table"
    assert [f.code for f in findings].count("settled_points") == 1


def test_levels_that_are_held_need_a_clock():
    """A log without a clock may be anything: its rows are no settled points."""
    made = settled("torque_map")
    (table,) = made.tables
    held = table[np.repeat(np.arange(table.height), 40)]
    with pytest.raises(CaptureError, match="t_s"):
        validate(replace(made, tables=(held,)), {})


def test_a_sorted_one_as_well():
    made = settled("torque_map", clock=True)
    (table,) = made.tables
    ordered = table.sort("omega_mech_rad_s", "iq_a").with_columns(table["t_s"])
    read, _ = as_settled_points(replace(made, tables=(ordered,)))
    assert read.meta.test in ("torque_table", "torque_map")


def test_levels_that_are_held_stay_a_map():
    made = settled("torque_map", clock=True)
    (table,) = made.tables
    rows = np.repeat(np.arange(table.height), 40)
    held = table[rows].with_columns(pl.Series("t_s", np.arange(rows.size) * 1e-3))
    read, findings = as_settled_points(replace(made, tables=(held,)))
    assert read.meta.test == "torque_map" and findings == []


def test_a_current_of_noise_alone_is_no_table():
    rng = np.random.default_rng(3)
    made = settled("torque_map", clock=True)
    (table,) = made.tables
    noise = table.with_columns(pl.Series("iq_a", 1e-3 * rng.normal(size=table.height)))
    read, findings = as_settled_points(replace(made, tables=(noise,)))
    assert read.meta.test == "torque_map" and findings == []


def test_other_tests_are_not_looked_at():
    made = settled("torque_table")
    assert as_settled_points(made) == (made, [])
    assert gates()
