"""Slow turns of one turn each, by an encoder with few lines: cogging is named, and nothing else."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import pipeline
from pipeline.criticism.data.machine_scale import torque_orders
from pipeline.records.capture import Campaign, Capture, CaptureMeta

TURN_RAD = 2.0 * np.pi
POLE_PAIRS, SLOTS, ORDER = 15, 27, 270


def slow_turn(
    name: str,
    cogging_nm: float,
    *,
    sense: int = 1,
    order: int = ORDER,
    noise_nm: float = 0.002,
    rows: int = 20_947,
    counts: int = 4000,
    dry_nm: float = 0.28,
) -> Capture:
    """A turn at 0.3 rad/s, of which the last sample is one before the first angle again."""
    theta = sense * TURN_RAD * np.arange(rows) / rows
    step = TURN_RAD / counts
    noise = np.random.default_rng(sense + 7).normal(0.0, noise_nm, rows)
    table = pl.DataFrame(
        {
            "t_s": np.arange(rows) * TURN_RAD / (0.3 * rows),
            "theta_mech_rad": step * (np.floor(theta / step) + 0.5),
            "torque_shaft_nm": -cogging_nm * np.sin(order * theta) - sense * dry_nm + noise,
        }
    )
    meta = CaptureMeta("m", "cogging", pole_pairs=POLE_PAIRS, slots=SLOTS)
    return Capture(name, "0", "verified", meta, (table,))


@pytest.mark.parametrize(
    ("cogging_nm", "order", "missing"),
    [
        pytest.param(0.06, ORDER, ("cogging",), marks=pytest.mark.slow),
        pytest.param(0.06, 3 * SLOTS, ("cogging",), marks=pytest.mark.slow),
        (0.0, ORDER, ()),
    ],
)
def test_cogging_of_one_turn_each_way_is_named(cogging_nm, order, missing):
    """Nothing tells the inertia: floors by the one that a rough fit ends with hid the cogging."""
    turns = tuple(slow_turn(f"{s}.csv", cogging_nm, sense=s, order=order) for s in (1, -1))
    diagnosis = pipeline.diagnose(pipeline.Recordings({"m": Campaign("m", turns)}))["m"]
    assert diagnosis.missing == missing
    assert diagnosis.verdict in (("missing",) if missing else ("adequate", "insufficient"))
    assert diagnosis.ladder[-1].held_out < 1.2


def orders_of(*turns: Capture) -> list[int]:
    """The orders that magnets and slots can make."""
    found = torque_orders(turns, 3 * ORDER)
    return [k for k in found if k % POLE_PAIRS == 0 or k % SLOTS == 0]


def test_a_second_wave_counts_of_which_an_encoder_has_few_lines_a_wave():
    """Each of 540 waves a turn has less than four of 2000 lines: of four it would stand out."""
    first, second = (slow_turn("a.csv", 0.06, order=k, counts=2000) for k in (ORDER, 2 * ORDER))
    (table,), (other,) = first.tables, second.tables
    both = table["torque_shaft_nm"] + 0.3 * other["torque_shaft_nm"]
    whole = replace(first, tables=(table.with_columns(torque_shaft_nm=both),))
    assert orders_of(whole) == [ORDER, 2 * ORDER]


def test_a_turn_that_ends_a_sample_before_it_comes_round_is_a_whole_one():
    assert orders_of(slow_turn("a.csv", 0.06)) == [ORDER]


def test_a_turn_that_lacks_values_has_the_spectrum_of_the_others():
    whole = slow_turn("a.csv", 0.06)
    (table,) = whole.tables
    lacks = np.random.default_rng(1).uniform(size=table.height) < 0.02
    holes = table.with_columns(
        theta_mech_rad=np.where(lacks, np.nan, table["theta_mech_rad"].to_numpy())
    )
    assert orders_of(replace(whole, tables=(holes,))) == [ORDER]


@pytest.mark.parametrize("counts", [3000, 4000, 5000, 10_000, 65_536])
def test_lines_of_an_encoder_do_not_beat_with_the_bins(counts):
    """In 3240 bins of 4000 lines 90, 330 and 450 would stand out too."""
    assert orders_of(slow_turn("a.csv", 0.06, counts=counts)) == [ORDER]


def test_a_capture_says_nothing_of_orders_that_its_angles_are_too_few_for():
    fine, coarse = slow_turn("a.csv", 0.06), slow_turn("b.csv", 0.06, rows=720, counts=10**6)
    assert orders_of(fine, coarse) == [ORDER]
    low = slow_turn("c.csv", 0.06, rows=720, counts=10**6, order=27)
    assert orders_of(low) == [27]
    assert orders_of(fine, low) == [ORDER]
    assert orders_of(fine, slow_turn("d.csv", 0.0)) == []
