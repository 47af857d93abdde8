"""Logs that lost single rows, or values in them: the noise of what is read between others."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import pipeline
from pipeline.criticism.data.machine_scale import encoder_step, machine_of
from pipeline.criticism.data.segment import Cache, row_index
from pipeline.criticism.data.traces import READ_BETWEEN
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.noise_propagation import noise_floor
from pipeline.criticism.residuals.segments import segments
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, log, machine

PLAN = (("drive_0", "drive", {}), ("spin_down", "spin_down", {}))


def without_rows(table: pl.DataFrame, random: np.random.Generator) -> pl.DataFrame:
    return table.filter(random.uniform(size=table.height) > 0.1)


def without_values(table: pl.DataFrame, random: np.random.Generator) -> pl.DataFrame:
    lacks = {
        name: np.where(random.uniform(size=table.height) < 0.05, np.nan, table[name].to_numpy())
        for name in table.columns
        if name != "t_s"
    }
    return table.with_columns(**lacks)


def recorded(motor: str, bits: int, seed: int, damage) -> Campaign:
    """A motor without effects, whose logs of an encoder are damaged."""
    bench = Bench(instruments=EXACT, encoder_bits=bits)
    made = campaign_of(campaign(replace(design(motor), effects={}), bench, seed, PLAN))
    random = np.random.default_rng(seed)
    captures = tuple(
        replace(one, tables=tuple(damage(table, random) for table in one.tables))
        for one in made.captures
    )
    return replace(made, captures=captures)


@pytest.mark.parametrize("damage", [without_rows, without_values])
def test_the_step_of_an_encoder_is_seen_beside_rows_that_are_read_between_others(damage):
    one, step_rad = recorded("gimbal-5208", 13, 3, damage), 2.0 * np.pi / 2**13
    assert encoder_step(one, DEFAULT) == pytest.approx(step_rad, rel=1e-4)
    for segment in segments(one, machine_of(one, Constants(), DEFAULT)):
        assert segment.sensors.angle_step_rad == pytest.approx(step_rad, rel=1e-4)
        assert segment.sensors.readings == 1


def test_a_log_of_a_row_shows_no_step_and_one_without_a_clock_its_own():
    """They are not used, and stand beside others."""
    one = recorded("gimbal-5208", 13, 3, without_rows)
    (drive,) = one.of("drive")
    (table,) = drive.tables
    timeless = table.head(400).with_columns(t_s=pl.lit(0.0))
    for short, step in ((table.head(1), 0.0), (timeless, 2.0 * np.pi / 2**13)):
        alone = replace(one, captures=(replace(drive, tables=(short,)),))
        assert encoder_step(alone, DEFAULT) == step


def test_a_row_that_is_read_between_others_repeats_their_noise():
    """A cubic counts rows beside a lost one 5/3 times and the next 5/6: 35/18 more a lost row."""
    whole, share = log(noise=1.0), 0.1
    random = np.random.default_rng(4)
    apart = np.zeros(whole.size)
    apart[2:-2:4] = random.uniform(size=apart[2:-2:4].size) < 4.0 * share
    holes = replace(whole, recorded={**whole.recorded, READ_BETWEEN: apart}, cache=Cache())
    group, _, valid, groups = row_index(whole)
    mean = group[valid] == groups.index(("vq_v", 0))
    floors = [noise_floor(one, Model(machine(), ()), BASE, 1)[mean] for one in (whole, holes)]
    power = [float(np.mean(floor**2)) for floor in floors]
    assert power[1] / power[0] == pytest.approx(1.0 + 35.0 / 18.0 * apart.mean(), rel=0.06)


@pytest.mark.parametrize(
    ("motor", "bits", "seed", "damage"),
    [
        ("servo-ipm", 12, 2, without_rows),
        ("gimbal-5208", 14, 2, without_rows),
        ("gimbal-5208", 14, 3, without_values),
    ],
)
def test_sound_logs_with_rows_that_are_read_between_others_are_quiet(motor, bits, seed, damage):
    """The coast was over its floor by up to 5.5 at orders of its slots, which nothing explained."""
    one = recorded(motor, bits, seed, damage)
    diagnosis = pipeline.diagnose(pipeline.Recordings({one.motor_id: one}))[one.motor_id]
    assert diagnosis.missing == ()
    assert not any(left.matters for left in diagnosis.remainder)
