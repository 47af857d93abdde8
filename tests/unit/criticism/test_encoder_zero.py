"""A bench whose encoder has its zero anywhere against the magnet."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import polars as pl
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.recovery.simulated import BENCH, MOTOR, recorded


def turned(campaign: Campaign, zeros: Iterable[float]) -> Campaign:
    """The campaign with the encoder's zero of each open-circuit spin moved [electrical rad]."""
    left = iter(zeros)
    captures = []
    for c in campaign.captures:
        spin = c.meta.test == "open_circuit"
        angle = pl.col("theta_mech_rad") + (next(left) / MOTOR.pole_pairs if spin else 0.0)
        tables = tuple(t.with_columns(angle) for t in c.tables) if spin else c.tables
        captures.append(replace(c, tables=tables))
    return replace(campaign, captures=tuple(captures))


@pytest.mark.parametrize("zero_rad", [0.4, 2.6, 3.14, 3.9])
def test_an_encoder_s_zero_may_stand_opposite_the_magnet(zero_rad: float) -> None:
    """From the usual zero a fit put the magnet to nothing: thousands of floors on a sound motor."""
    tests = tuple((name, name, {}) for name in ("open_circuit", "drive"))
    campaign = recorded(tests, 3, bench=BENCH)[0]
    found = diagnose(turned(campaign, [zero_rad]), ModelSpec(), Constants())
    assert found.missing == ()
    assert found.verdict != "unknown"
    assert found.ladder[-1].held_out < 1.3


def test_an_incremental_encoder_counts_from_where_it_was_switched_on() -> None:
    tests = (
        ("open_circuit_0", "open_circuit", {}),
        ("open_circuit_1", "open_circuit", {}),
        ("drive", "drive", {}),
    )
    campaign = recorded(tests, 3, bench=BENCH)[0]
    found = diagnose(turned(campaign, [1.0, 3.5]), ModelSpec(), Constants())
    assert found.missing == ()
    assert found.verdict != "unknown"
    assert found.ladder[-1].held_out < 1.3
