"""A cogging order above half of the positions that a rotor was held at."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.estimate import Estimate

SLOTS, PAIRS, ORDER, CURRENT_A = 24, 11, 264, 0.3
STEP_RAD = 2.0 * np.pi / 2**12


def held(positions: int) -> dict[str, Estimate]:
    """Cogging by the order of slots and poles, read by an encoder of twelve bits there and back."""
    rng = np.random.default_rng(positions)
    once = np.repeat(np.arange(positions + 1) * 2.0 * np.pi / positions, 4)
    theta, sense = np.concatenate([once, once[::-1]]), np.repeat([1.0, -1.0], once.size)
    current = CURRENT_A * np.cos(ORDER * theta + 0.3) + 0.05 * sense
    read = STEP_RAD * np.round((theta + 1e-4 * rng.standard_normal(theta.size)) / STEP_RAD)
    extra = {"kt_peak_nm_a": "0.2", "u_kt_peak_nm_a": "0.0002"}
    meta = CaptureMeta("m", "holding_current", slots=SLOTS, pole_pairs=PAIRS, extra=extra)
    table = pl.DataFrame(
        {
            "t_s": 0.01 * np.arange(theta.size),
            "theta_mech_rad": read,
            "iq_a": current + 1e-3 * rng.standard_normal(theta.size),
        }
    )
    campaign = Campaign("m", (Capture("held.csv", "0" * 64, "verified", meta, (table,)),))
    wanted = frozenset({"cogging_order", "cogging_amplitude_nm", "cogging_peak_nm"})
    known, _, _ = fit_all(campaign, {}, only=wanted)
    by_method = [one for one in known.estimates if one.method == "holding_current"]
    return {one.name: one for one in by_method if one.name in wanted}


def test_positions_that_are_too_few_show_the_order_and_no_peak() -> None:
    """360 positions show order 264 as 96; what the wave does between them they do not."""
    found = held(360)
    assert found["cogging_order"].value == ORDER
    assert "hold at more" in found["cogging_order"].note
    assert found["cogging_amplitude_nm"].number == pytest.approx(0.2 * CURRENT_A, rel=0.03)
    assert not found["cogging_peak_nm"].known
    assert "360 positions" in found["cogging_peak_nm"].note


def test_positions_that_are_enough_show_both() -> None:
    found = held(720)
    assert found["cogging_order"].value == ORDER
    assert found["cogging_peak_nm"].number == pytest.approx(0.2 * CURRENT_A, rel=0.1)
