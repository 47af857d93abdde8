"""A bench whose encoder has its zero anywhere against the magnet."""

from __future__ import annotations

from dataclasses import replace

import polars as pl
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.recovery.simulated import BENCH, MOTOR, recorded


@pytest.mark.parametrize("zero_rad", [0.4, 2.6, 3.14, 3.9])
def test_an_encoder_s_zero_may_stand_opposite_the_magnet(zero_rad: float) -> None:
    """From the usual zero a fit put the magnet to nothing: thousands of floors on a sound motor."""
    tests = tuple((name, name, {}) for name in ("open_circuit", "drive"))
    campaign = recorded(tests, 3, bench=BENCH)[0]
    turned = pl.col("theta_mech_rad") + zero_rad / MOTOR.pole_pairs
    captures = [
        replace(c, tables=tuple(t.with_columns(turned) for t in c.tables))
        if c.meta.test == "open_circuit"
        else c
        for c in campaign.captures
    ]
    found = diagnose(replace(campaign, captures=tuple(captures)), ModelSpec(), Constants())
    assert found.missing == ()
    assert found.verdict != "unknown"
    assert found.ladder[-1].held_out < 1.3
