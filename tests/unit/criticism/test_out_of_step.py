"""Rows of a drive's log at whose speed its encoder counts in step with them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.shaft_angle import out_of_step
from pipeline.records.capture import Capture, CaptureMeta
from tests.unit.criticism.machines import machine

STEP_RAD, WINDOW, ROWS = 2.0 * np.pi / 4096, 40, 1000


def kept(
    counts: tuple[float, ...], timing: str = "instant", step_rad: float = STEP_RAD, wave: float = 0
) -> list[float]:
    """Share of the rows that are kept at each speed [counts a row], away from where it changes; the
    angle of an encoder off its centre has a `wave` of so many rows.
    """
    paces = np.repeat(counts, ROWS)
    if wave:
        paces += 0.3 * np.sin(2.0 * np.pi * np.arange(paces.size) / wave)
    turned = STEP_RAD * np.cumsum(paces)
    theta = STEP_RAD * np.floor(turned / STEP_RAD)
    meta = CaptureMeta("m", "drive", voltage_timing=timing)
    capture = Capture("log.csv", "0", "verified", meta, (pl.DataFrame({"theta_mech_rad": theta}),))
    motor = replace(machine(), encoder_rad=step_rad)
    keep = out_of_step(capture, theta, np.ones(theta.size, dtype=bool), motor, WINDOW)
    return [float(part[100:-100].mean()) for part in np.split(keep, len(counts))]


@pytest.mark.parametrize("whole", [1.0, 27.0, -47.004])
def test_rows_in_step_with_the_counts_are_left_out(whole):
    assert kept((5.3, whole, 0.01, 30.5)) == [1.0, 0.0, 1.0, 1.0]


def test_rows_that_are_means_or_of_no_known_encoder_are_kept():
    assert kept((5.3, 27.0, 30.5), "centred") == [1.0, 1.0, 1.0]
    assert kept((5.3, 27.0, 30.5), step_rad=0.0) == [1.0, 1.0, 1.0]


def test_of_a_log_that_is_mostly_in_step_all_rows_are_kept():
    assert kept((27.0, 12.0, 30.5)) == [1.0, 1.0, 1.0]


def test_where_rows_in_step_would_leave_no_window_all_are_kept():
    """A fiftieth of the rows of a torque map, none of them far from the next, took all of it."""
    assert kept((27.0,), wave=2 * WINDOW - 5) == [1.0]
    (share,) = kept((27.0,), wave=8 * WINDOW)
    assert 0.7 < share < 0.99
