"""Captures that hold too little for an equation: they are left out, and nothing breaks on them."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.traces import with_values
from pipeline.criticism.residuals.segments import known_tests, segments
from pipeline.physics.glossary import TESTS_WITHOUT_CLOCK
from pipeline.records.capture import Campaign, Capture, CaptureMeta, Mask
from pipeline.records.constants import Constants

SIGNALS = ("id_a", "iq_a", "vd_v", "vq_v", "ia_a", "vab_v", "vbc_v", "torque_shaft_nm")
TABLES = ("lab_h", "rab_ohm", "psi_d_wb", "psi_q_wb")
TESTS = known_tests()
TOO_SHORT = (0, 1, 2, 8, 20)


def capture(test: str, n: int, time: np.ndarray, theta: np.ndarray, *more: pl.DataFrame) -> Capture:
    random = np.random.default_rng(n)
    columns = {name: random.normal(1.0, 0.1, n) for name in (*SIGNALS, *TABLES)}
    angle = {"theta_mech_rad": theta, "theta_elec_deg": 7.0 * np.arange(n)}
    table = pl.DataFrame({"t_s": time, **angle, **columns})
    meta = CaptureMeta("m", test, pole_pairs=4, pair="ab", theta_elec_deg=0.0)
    return Capture(f"{test}.csv", "0", "verified", meta, (table, *more))


def made_of(one: Capture):
    campaign = Campaign("m", (one,))
    return segments(campaign, machine_of(campaign, Constants()))


@pytest.mark.parametrize("n", TOO_SHORT)
@pytest.mark.parametrize("test", sorted(TESTS))
def test_a_capture_of_a_few_rows_is_left_out(test, n):
    found = made_of(capture(test, n, 1e-3 * np.arange(n), 0.03 * np.arange(n)))
    assert found == () or test in TESTS_WITHOUT_CLOCK


@pytest.mark.parametrize("test", sorted(TESTS - TESTS_WITHOUT_CLOCK))
@pytest.mark.parametrize("stopped", [np.zeros(400), np.repeat(np.arange(200.0), 2)])
def test_a_capture_whose_clock_does_not_rise_is_left_out(test, stopped):
    assert made_of(capture(test, 400, stopped, 0.03 * np.arange(400))) == ()


@pytest.mark.parametrize(("test", "n"), [*itertools.product(sorted(TESTS), (60, 400))])
def test_a_shaft_that_does_not_turn_breaks_nothing(test, n):
    """An open-circuit spin of a shaft at rest had infinitely many pole pairs."""
    one = capture(test, n, 1e-3 * np.arange(n), np.zeros(n))
    machine = machine_of(Campaign("m", (one,)), Constants())
    assert machine.pole_pairs == 4
    segments(Campaign("m", (one,)), machine)


def test_a_column_that_no_row_of_the_capture_s_clock_holds_is_as_good_as_not_there():
    """A thermometer whose own table ended before the others began."""
    time = 1e-3 * np.arange(4000)
    late = pl.DataFrame({"t_s": [-9.0, -8.0, -7.0], "temp_winding_degc": [25.0, 26.0, 27.0]})
    one = capture("torque_map", 4000, time, 0.03 * np.arange(4000), late)
    assert one.has("temp_winding_degc")
    assert not with_values(one).has("temp_winding_degc")
    (segment,) = made_of(one)
    assert "temp_winding_degc" not in segment.recorded
    assert np.isfinite(segment.weak.project(segment.recorded["iq_a"][None])).all()


def test_a_capture_whose_rows_are_all_set_aside_is_left_out():
    """Its size was NaN, and so was the machine's: a diagnosis ended in a linear algebra error."""
    one = capture("torque_map", 400, 1e-3 * np.arange(400), 0.03 * np.arange(400))
    none = replace(one, masks=(Mask("missing_values", 0, np.zeros(400, dtype=bool)),))
    assert with_values(none) is None
    scales = machine_of(Campaign("m", (none, one)), Constants()).scales
    assert scales == machine_of(Campaign("m", (one,)), Constants()).scales


def test_a_column_that_holds_no_value_in_the_rows_that_are_kept_is_as_good_as_not_there():
    one = capture("torque_map", 400, 1e-3 * np.arange(400), 0.03 * np.arange(400))
    early = np.arange(400) < 100
    warmth = pl.Series("temp_winding_degc", np.where(early, 25.0, np.nan))
    tables = (one.tables[0].with_columns(warmth),)
    late = replace(one, tables=tables, masks=(Mask("clock_jump", 0, ~early),))
    assert late.has("temp_winding_degc")
    assert not with_values(late).has("temp_winding_degc")


def test_a_capture_that_tells_all_it_says_is_not_copied():
    one = capture("torque_map", 400, 1e-3 * np.arange(400), 0.03 * np.arange(400))
    assert with_values(one) is one


def test_levels_of_few_rows_have_windows_of_their_own():
    """A multimeter's resistance test, 23 rows a level at 20 Hz, was not used at all."""
    levels, rows, rng = (-1.6, -0.8, 0.8, 1.6), 23, np.random.default_rng(2)
    amps = np.repeat(levels, rows) + 1e-4 * rng.normal(size=4 * rows)
    volts = 1.84 * amps + 1e-4 * rng.normal(size=amps.size)
    table = pl.DataFrame({"t_s": 0.05 * np.arange(amps.size), "vab_v": volts, "ia_a": amps})
    meta = CaptureMeta("m", "resistance", pole_pairs=4, pair="ab")
    (segment,) = made_of(Capture("r.csv", "0", "verified", meta, (table,)))
    weak, current = segment.weak, segment.recorded["i_pair_a"]
    seen = {round(float(np.mean(current[s : s + weak.length])), 1) for s in weak.starts}
    assert seen == set(levels)
