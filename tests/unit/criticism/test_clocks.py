"""Clocks of logs: uneven samples are interpolated, uneven stamps are counted."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.clocks import stamps_counted
from pipeline.criticism.data.drive_log import drive_log
from pipeline.criticism.data.traces import even_clock, window_between_gaps
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.numerics.clocks import clearest_ratio, counted
from pipeline.records.capture import Capture, CaptureMeta, Mask
from tests.unit.criticism.machines import machine

CUTTING = DEFAULT.cutting

PERIOD = 1e-4


def instants(n=4000, scatter=0.05, seed=1):
    """Even instants [n, s] and the same scattered by a part of the period."""
    even = PERIOD * np.arange(n)
    return even, even + PERIOD * scatter * np.random.default_rng(seed).standard_normal(n)


def angle(t):
    """A shaft that speeds up [rad]."""
    return 40.0 * t + 90.0 * t**2 + 0.02 * np.sin(300.0 * t)


def log(stamps, theta):
    table = pl.DataFrame({"t_s": stamps, "theta_mech_rad": theta})
    return Capture("log.mcap", "0", "verified", CaptureMeta("m", "drive"), (table,))


@pytest.mark.parametrize("scatter", [0.01, 0.05, 0.2])
def test_samples_of_an_even_clock_are_taken_as_they_are_whatever_their_stamps(scatter):
    even, stamps = instants(scatter=scatter)
    for start_s in (0.0, 1.79e9):
        capture = log(start_s + stamps, angle(even))
        period, found, keep = even_clock(capture, ("theta_mech_rad",), CUTTING)
        assert period == pytest.approx(PERIOD, rel=1e-5)
        assert np.array_equal(found["theta_mech_rad"], angle(even))
        assert keep[1:-1].all()


@pytest.mark.parametrize("scatter", [0.01, 0.05, 0.2])
def test_samples_that_came_unevenly_are_interpolated(scatter):
    """Counted, they would be out by the speed times the scatter."""
    _, stamps = instants(scatter=scatter)
    period, found, keep = even_clock(log(stamps, angle(stamps)), ("theta_mech_rad",), CUTTING)
    at = stamps[0] + period * np.arange(found["theta_mech_rad"].size)
    error = found["theta_mech_rad"] - angle(at)
    assert np.abs(error[keep]).max() < 0.1 * 40.0 * PERIOD * scatter
    assert keep.mean() > 0.9


@pytest.mark.parametrize("unevenly", [False, True])
def test_a_value_that_is_missing_is_read_where_its_neighbours_were_sampled(unevenly):
    """By stamps that scatter it was off by the speed times the scatter: a torque at 24 waves a turn
    missed by 19 floors, and a sound motor was `unknown`.
    """
    even, stamps = instants(scatter=0.2)
    sampled = stamps if unevenly else even
    gone = np.random.default_rng(2).uniform(size=even.size) < 0.05
    capture = log(stamps, np.where(gone, np.nan, angle(sampled)))
    period, found, keep = even_clock(capture, ("theta_mech_rad",), CUTTING)
    at = stamps[0] + period * np.arange(keep.size) if unevenly else even
    error = np.abs(found["theta_mech_rad"] - angle(at))[keep]
    assert keep.mean() > 0.9
    assert error.max() < 0.1 * 40.0 * PERIOD * 0.2


def test_samples_that_are_missing_leave_their_numbers_out():
    """But for single ones, which are read between their neighbours."""
    even, stamps = instants()
    there = np.ones(even.size, dtype=bool)
    there[[700, 1500, 1501, 1502, 3000]] = False
    capture = log(stamps[there], angle(even)[there])
    period, found, keep = even_clock(capture, ("theta_mech_rad",), CUTTING)
    assert period == pytest.approx(PERIOD, rel=1e-5)
    single = np.isin(np.arange(even.size), [700, 3000])
    assert np.array_equal(keep[1:-1], (there | single)[1:-1])
    error = np.abs(found["theta_mech_rad"] - angle(even))
    assert error[there].max() < 1e-12
    assert error[single].max() < 0.5 * (180.0 + 0.02 * 300.0**2) * PERIOD**2


def test_a_row_that_a_gate_set_aside_is_not_read_between_others():
    """What is known of it is that something is wrong with it."""
    even, stamps = instants()
    gated = Mask("spikes", 0, np.arange(even.size) != 900)
    capture = log(stamps, angle(even)).with_masks(gated)
    _, _, keep = even_clock(capture, ("theta_mech_rad",), CUTTING)
    assert np.flatnonzero(~keep[1:-1]).tolist() == [899]


def test_windows_of_a_log_that_lost_a_tenth_of_its_rows_are_longer_than_ten_rows():
    """Between all gaps they were shorter than the mean of the speed: a false `torque_lag`."""
    even, stamps = instants()
    there = np.random.default_rng(4).uniform(size=even.size) > 0.1
    _, _, keep = even_clock(log(stamps[there], angle(even)[there]), ("theta_mech_rad",), CUTTING)
    assert window_between_gaps(PERIOD, keep, CUTTING) > 80


def test_an_angle_in_a_lost_row_bends_as_it_does_beside_it():
    """A straight line there is twice the acceleration in a second difference: waves of a coast."""
    even, _ = instants()
    there = np.ones(even.size, dtype=bool)
    there[500:3000:10] = False
    slowing = 300.0 * even - 400.0 * even**2
    _, found, keep = even_clock(log(even[there], slowing[there]), ("theta_mech_rad",), CUTTING)
    bend = np.diff(found["theta_mech_rad"], 2) / PERIOD**2
    assert keep[1:-1].all()
    assert bend == pytest.approx(np.full(bend.size, -800.0), rel=1e-3)


@pytest.mark.parametrize("missing", [1, 30])
def test_a_gap_of_samples_that_came_unevenly_is_bridged_and_not_kept(missing):
    even, stamps = instants()
    there = np.ones(even.size, dtype=bool)
    there[1500 : 1500 + missing] = False
    capture = log(stamps[there], angle(stamps[there]))
    period, found, keep = even_clock(capture, ("theta_mech_rad",), CUTTING)
    at = stamps[0] + period * np.arange(found["theta_mech_rad"].size)
    inside = (at > stamps[1499]) & (at < stamps[1500 + missing])
    assert inside.sum() >= missing
    assert not keep[inside].any()
    assert keep[~inside][1:-1].all()


def test_a_clock_that_runs_by_fits_and_starts_cannot_be_counted():
    steps = np.random.default_rng(3).choice([0.2, 1.0, 7.0], 4000, p=[0.3, 0.5, 0.2])
    assert counted(PERIOD * np.cumsum(steps), 1.6, 0.5) is None


def kept(stamps):
    """Which samples of a drive's log of these stamps are used, by number."""
    found = drive_log(log(stamps, angle(stamps)), machine())
    assert found is not None
    return found.keep


def test_samples_beside_lost_ones_are_kept():
    """Thirty-six of them went with every gap."""
    even, _ = instants()
    there = np.ones(even.size, dtype=bool)
    there[[700, 1500, 1501, 1502, 3000]] = False
    lost = np.flatnonzero(~there)
    without = np.setdiff1d(np.arange(1, even.size - 1), lost)
    assert kept(even[there])[without].all()
    assert np.array_equal(np.flatnonzero(~kept(even[there])[1:-1]) + 1, [1500, 1501, 1502])


def test_samples_that_a_host_read_late_and_then_at_once_are_not():
    """It gets old values: a reading two periods after the last, and two that follow at once."""
    even, _ = instants()
    late = even.copy()
    late[700:703] = even[702] - PERIOD * np.array([1.0, 0.5, 0.0])
    found = kept(late)
    assert not found[690:720].any()
    assert found[1:680].all() and found[730:-1].all()


@pytest.mark.parametrize("scatter", [0.05, 0.2])
def test_a_capture_is_counted_where_its_angle_shows_that_only_the_stamps_are_uneven(scatter):
    """An inertia of a sound motor was 3 to 28 % off at 3 to 4 u by stamps that scatter by 20 %."""
    even, stamps = instants(scatter=scatter)
    passed, findings = stamps_counted(log(np.sort(stamps), angle(even)))
    assert passed.tables[0]["t_s"].to_numpy() == pytest.approx(even, abs=0.02 * PERIOD)
    assert [f.code for f in findings] == ["scattered_stamps"]
    unevenly = log(np.sort(stamps), angle(np.sort(stamps)))
    assert stamps_counted(unevenly)[0] is unevenly
    resting = log(np.sort(stamps), 0.3 + 0.0 * even)
    assert stamps_counted(resting)[0] is resting


def test_a_temperature_in_tenths_says_nothing_of_the_clock():
    """It stands still but for a step or two: what floating point leaves there is no motion."""
    even, stamps = instants(scatter=0.15)
    number = np.arange(stamps.size)
    for degrees in (np.full(stamps.size, 25.0), np.where(number < 2000, 25.0, 25.1)):
        assert 0.5 < clearest_ratio(stamps, number, [degrees]) < 2.0
    assert clearest_ratio(stamps, number, [degrees, angle(even)]) < 0.5


@pytest.mark.parametrize(("scatter", "wrong"), [(0.1, 0.0), (0.16, 2e-3)])
def test_stamps_that_scatter_are_numbered_though_a_tenth_of_the_rows_is_lost(scatter, wrong):
    """A count from step to step goes wrong once in some hundred rows, and stays so."""
    random = np.random.default_rng(3)
    number = np.flatnonzero(random.uniform(size=8000) > 0.1)
    number = number[(number < 2000) | (number > 2266)]
    stamps = np.sort(PERIOD * (number + scatter * random.standard_normal(number.size)))
    clock = counted(stamps, 1.6, 0.5)
    assert clock is not None
    period, counts = clock
    assert period == pytest.approx(PERIOD, rel=1e-4)
    assert np.mean(counts - counts[0] != number - number[0]) <= wrong
    assert (np.diff(counts) > 0).all()


def test_stamps_without_a_clock_are_not_numbered():
    stamps = np.cumsum(np.random.default_rng(4).exponential(PERIOD, 4000))
    assert counted(stamps, 1.6, 0.5) is None


def coast(n=900, period=1e-3, seed=4):
    """Instants [n, s] that scatter by a fiftieth of a period, and an angle [rad] of a coast."""
    t = period * (np.arange(n) + 0.02 * np.random.default_rng(seed).standard_normal(n))
    return t, 250.0 * t - 135.0 * t**2


def test_a_shaft_numbers_samples_whose_stamps_are_whole_milliseconds():
    """Of two samples in one millisecond the second was dropped: the stamps are even, and wrong."""
    t, theta = coast()
    stamps = np.floor(1e3 * t) / 1e3
    first = np.diff(stamps, prepend=-np.inf) > 0.0
    known = counted(stamps[first], CUTTING.clock_missing, CUTTING.clock_scatter)
    assert known is not None
    assert not np.array_equal(known[1], np.flatnonzero(first) - np.flatnonzero(first)[0])
    capture = log(stamps[first], theta[first])
    period, found, keep = even_clock(capture, ("theta_mech_rad",), CUTTING)
    assert period == pytest.approx(1e-3, rel=1e-3)
    numbers = np.flatnonzero(first)
    expected = theta[numbers[0] : numbers[-1] + 1]
    assert found["theta_mech_rad"].size == expected.size
    # read between rows that scatter by a fiftieth, each of a quarter of a radian
    assert np.abs(found["theta_mech_rad"] - expected)[keep].max() < 5.0 * 0.02 * 0.25
    counted_capture, findings = stamps_counted(capture)
    assert [finding.code for finding in findings] == ["scattered_stamps"]
    steps = np.diff(counted_capture.tables[0]["t_s"].to_numpy())
    assert np.allclose(steps, np.diff(numbers) * 1e-3, rtol=1e-3)


@pytest.mark.parametrize("scatter", [0.3, 0.45])
def test_a_shaft_numbers_samples_whose_stamps_scatter_and_of_which_many_are_lost(scatter):
    t, theta = coast(n=3000, period=2e-4)
    rng = np.random.default_rng(9)
    stamps = t + 2e-4 * scatter * np.clip(rng.standard_normal(t.size), -1.0, 1.0)
    kept = (rng.uniform(size=t.size) > 0.1) & (np.diff(stamps, prepend=-np.inf) > 0.0)
    kept &= stamps >= np.maximum.accumulate(stamps)
    numbers = np.flatnonzero(kept)
    found = counted(stamps[kept], CUTTING.clock_missing, CUTTING.clock_scatter, [theta[kept]])
    assert found is not None
    assert found[0] == pytest.approx(2e-4, rel=1e-3)
    assert np.array_equal(found[1], numbers - numbers[0])


def test_a_shaft_that_turns_back_numbers_samples_beside_gaps():
    """Where it hardly moves the stamps number them, where a sample that is one off is as good."""
    t, _ = coast(n=20000, period=5e-5)
    step = 2.0 * np.pi / 2**15
    theta = step * np.round(30.0 * np.sin(8.0 * t) / step)
    rng = np.random.default_rng(2)
    stamps = t + 2e-5 * np.clip(rng.standard_normal(t.size), -1.2, 1.2)
    kept = rng.uniform(size=t.size) > 0.1
    for begin in (3000, 11000, 16500):
        kept[begin : begin + 650] = False
    kept &= stamps > np.maximum.accumulate(np.append(-np.inf, stamps[:-1]))
    numbers = np.flatnonzero(kept)
    found = counted(stamps[kept], CUTTING.clock_missing, CUTTING.clock_scatter, [theta[kept]])
    assert counted(stamps[kept], CUTTING.clock_missing, CUTTING.clock_scatter) is None
    assert found is not None
    assert found[0] == pytest.approx(5e-5, rel=1e-5)
    off = found[1] - (numbers - numbers[0])
    assert np.abs(off).max() <= 1
    pace = np.abs(np.cos(8.0 * t[kept]))
    assert not off[pace > 0.3].any()


@pytest.mark.parametrize("steps_a_row", [0.7, 1.23, 2.6])
def test_an_angle_in_steps_as_large_as_its_motion_numbers_nothing(steps_a_row):
    """One or two steps from row to row are no one or two samples."""
    even, stamps = instants(scatter=0.2)
    coarse = np.floor(steps_a_row * np.arange(even.size) + 0.3) * 2.0 * np.pi / 2048
    arguments = np.sort(stamps), CUTTING.clock_missing, CUTTING.clock_scatter
    found = counted(*arguments, [coarse])
    assert found is not None
    assert found[0] == pytest.approx(PERIOD, rel=1e-4)
    assert np.array_equal(found[1], np.arange(even.size))
