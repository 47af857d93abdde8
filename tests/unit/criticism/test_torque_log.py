"""Logs of current and torque without a voltage: they have the errors of any drive."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.noise_floors import reading_error
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE

MOTOR = replace(design("gimbal-5208"), effects={})
VOLTS = ("vd_v", "vq_v")
STEP_NM = 0.05


def recorded(*lost: str, drives: int = 2) -> Campaign:
    plan = tuple((f"drive_{n}", "drive", {"segments": 6}) for n in range(drives))
    whole = campaign_of(campaign(MOTOR, Bench(), 3, plan))

    def part(capture: Capture) -> Capture:
        return replace(capture, tables=tuple(t.drop(lost, strict=False) for t in capture.tables))

    return replace(whole, captures=tuple(map(part, whole.captures)))


@pytest.mark.parametrize(
    "lost", [pytest.param(VOLTS, marks=pytest.mark.slow), ("theta_mech_rad", *VOLTS)]
)
def test_a_log_without_voltages_that_lacks_nothing_names_nothing(lost) -> None:
    """Rest, pulses and lines of the encoder were no errors of theirs: `current_delay`."""
    found = diagnose(recorded(*lost), ModelSpec(), Constants())
    assert found.verdict in ("adequate", "insufficient")
    assert not found.missing


def torque_errors(whole: Campaign) -> np.ndarray:
    """What the torque of the only log may be off by [W, N·m], order 0."""
    size = machine_of(whole, Constants())
    assert size is not None
    (log,) = segments(whole, size)
    values = {**BASE, **dict.fromkeys(size.unlogged, 0.0)}
    place = log.channels.index("torque_shaft_nm")
    return reading_error(log, Model(size, ()), values)[place, :, 0]


@pytest.mark.parametrize("lost", [(), VOLTS])
def test_a_torque_that_jumps_is_known_to_a_quarter_of_a_sample(lost) -> None:
    """A log at 1 kHz with steps of the load was 3 noise floors off."""
    whole = recorded(*lost, drives=1)
    (capture,) = whole.captures
    (table,) = capture.tables
    after = np.arange(table.height) >= table.height // 2
    jumps = table.with_columns(pl.col("torque_shaft_nm") + STEP_NM * pl.Series(after))
    smooth = torque_errors(whole)
    stepped = torque_errors(replace(whole, captures=(replace(capture, tables=(jumps,)),)))
    more = np.sqrt(np.clip(stepped**2 - smooth**2, 0.0, None))
    size = machine_of(whole, Constants())
    assert size is not None
    (log,) = segments(whole, size)
    assert log.weak is not None
    at = after.argmax() - log.weak.starts
    inside = (at > 2) & (at < log.weak.length - 2)
    assert inside.any()
    expected = 0.25 * STEP_NM * np.abs(log.weak.functions[0, 0][at[inside]])
    assert more[inside] == pytest.approx(expected, rel=0.2, abs=0.02 * expected.max())
