"""Logs whose file keeps a number of digits: the steps of a column depend on its size."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

import pipeline
from pipeline.criticism.data.kept_digits import at_largest_step, largest_step
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

RAMP = np.linspace(-3.0, 1500.0, 4001)


def written(column: np.ndarray, digits: int) -> np.ndarray:
    """What a reader gets of numbers that were printed with so many digits."""
    return np.array([float(f"{value:.{digits}g}") for value in column])


@pytest.mark.parametrize(("digits", "step"), [(3, 10.0), (6, 0.01), (7, 1e-3)])
def test_the_step_is_that_of_the_largest_values(digits: int, step: float) -> None:
    assert largest_step(written(RAMP, digits)) == pytest.approx(step)


@pytest.mark.parametrize(
    "column",
    [RAMP, written(RAMP, 9), 2.0 * np.pi / 2**14 * np.round(RAMP * 40.0), np.zeros(5)],
    ids=["float", "nine digits", "encoder", "zero"],
)
def test_what_has_more_digits_or_none_has_no_step(column: np.ndarray) -> None:
    assert largest_step(column) == 0.0


def test_a_log_in_decimals_and_a_table_without_a_clock_stay_as_they_are() -> None:
    decimals = pl.DataFrame({"t_s": 1e-3 * np.arange(4001), "theta_mech_rad": np.round(RAMP, 3)})
    assert at_largest_step(decimals) is decimals
    table = pl.DataFrame({"theta_mech_rad": written(RAMP, 4)})
    assert at_largest_step(table) is table


def test_small_values_are_in_the_steps_of_large_ones_and_missing_ones_stay() -> None:
    theta = written(RAMP, 6)
    theta[7] = np.nan
    log = pl.DataFrame({"t_s": 1e-3 * np.arange(4001), "theta_mech_rad": theta})
    even = at_largest_step(log)["theta_mech_rad"].to_numpy()
    assert np.array_equal(np.isnan(even), np.isnan(theta))
    known = even[np.isfinite(even)]
    assert known == pytest.approx(0.01 * np.round(known / 0.01), abs=1e-9)
    assert np.nanmax(np.abs(even - RAMP)) <= 0.0101


def found(test: str, digits: int, **effects: float) -> pipeline.Diagnosis:
    """Of a servo, by the captures of one test whose columns keep some digits."""
    motor = replace(design("servo-ipm"), effects={}).having(**effects)
    plan = tuple(step for step in CAMPAIGN if step[1] == test)
    made = campaign_of(campaign(motor, Bench(), 5, plan))
    captures = []
    for log in made.captures:
        table = log.tables[0]
        names = set(table.columns) - {"t_s"}
        kept = [pl.Series(name, written(table[name].to_numpy(), digits)) for name in names]
        captures.append(replace(log, tables=(table.with_columns(kept),)))
    whole = replace(made, captures=tuple(captures))
    return pipeline.diagnose(pipeline.Recordings({"m": whole}))["m"]


@pytest.mark.parametrize(
    ("test", "digits"),
    [("spin_down", 6), pytest.param("torque_map", 3, marks=pytest.mark.slow)],
)
def test_a_sound_motor_is_quiet_in_few_digits(test: str, digits: int) -> None:
    """Two coasts in six digits were `unknown`, at 2.9 floors."""
    diagnosis = found(test, digits)
    assert (diagnosis.missing, diagnosis.remainder) == ((), ())
    assert diagnosis.verdict != "unknown"
    assert diagnosis.ladder[-1].held_out < 1.1


@pytest.mark.parametrize("digits", [6, pytest.param(4, marks=pytest.mark.slow)])
def test_what_few_digits_still_show_is_named(digits: int) -> None:
    diagnosis = found("spin_down", digits, windage=3e-6)
    assert diagnosis.missing == ("windage",)
