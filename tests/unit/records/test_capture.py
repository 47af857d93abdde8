"""Columns of several clocks put on one."""

from __future__ import annotations

import numpy as np
import polars as pl
import pytest

from pipeline.records.capture import Capture, CaptureMeta, Mask
from pipeline.records.row_means import bridged, row_means, slower_rows


def test_a_stream_of_which_every_row_is_set_aside_is_missing() -> None:
    """Its column is blank on the other clock, as a value beyond its span is."""
    fast = pl.DataFrame({"t_s": np.arange(6.0), "iq_a": np.ones(6)})
    slow = pl.DataFrame({"t_s": [0.0, 5.0], "temp_winding_degc": [20.0, 21.0]})
    aside = Mask("gate", 1, np.zeros(2, dtype=bool))
    capture = Capture("c", "0" * 64, "verified", CaptureMeta("m", "drive"), (fast, slow), (aside,))
    data = capture.arrays("iq_a", "temp_winding_degc")
    assert np.isnan(data["temp_winding_degc"]).all()
    assert data["iq_a"].size == 6


def rows_beside(timing: str, fast_hz: float = 2000.0) -> tuple[dict[str, np.ndarray], Capture]:
    """Rows of 5 ms of a current, beside a torque and an angle on a clock of their own."""
    fast_s = np.arange(0.0, 0.1, 1.0 / fast_hz)
    ringing = 2.0 + 10.0 * fast_s + 0.5 * np.sin(2.0 * np.pi * 380.0 * fast_s)
    fast = {"t_s": fast_s, "torque_shaft_nm": ringing, "theta_mech_rad": 3.0 * fast_s**2}
    row_s = np.arange(0.0025, 0.09, 0.005)
    slow = {"t_s": row_s, "id_a": 0.0 * row_s, "iq_a": np.ones(row_s.size), "vd_v": 0.0 * row_s}
    meta = CaptureMeta("m", "torque_map", voltage_timing=timing)
    tables = (pl.DataFrame(slow), pl.DataFrame(fast))
    capture = Capture("c", "0" * 64, "verified", meta, tables)
    names = ("t_s", "id_a", "iq_a", "vd_v", "torque_shaft_nm", "theta_mech_rad")
    return capture.arrays(*names), capture


def test_a_fast_column_is_a_mean_beside_slow_rows_that_are_means() -> None:
    data, _ = rows_beside("centred")
    line = 2.0 + 10.0 * data["t_s"]
    # 380 Hz over 5 ms: 1.9 periods, whose mean is 0.05 of the amplitude at the most
    assert np.abs(data["torque_shaft_nm"] - line).max() < 0.03
    assert data["theta_mech_rad"] == pytest.approx(3.0 * data["t_s"] ** 2, abs=1e-6)


def test_a_fast_column_is_an_instant_beside_slow_rows_that_are_instants() -> None:
    data, _ = rows_beside("instant")
    line = 2.0 + 10.0 * data["t_s"]
    assert np.abs(data["torque_shaft_nm"] - line).max() > 0.3


def test_a_row_is_averaged_over_what_is_recorded_of_it() -> None:
    row_s, sample_s = np.array([-0.1, 0.0, 1.0, 2.0, 3.1]), np.linspace(0.0, 3.0, 31)
    means = row_means(row_s, sample_s, sample_s)
    assert np.isnan(means[[0, 4]]).all()
    assert means[1:4] == pytest.approx([0.25, 1.0, 2.0])
    assert not slower_rows(sample_s, sample_s)
    assert not slower_rows(row_s[:1], sample_s)


def test_waves_stay_on_their_own_clock_beside_an_angle_of_another() -> None:
    """Straight lines took 0.35 % of a voltage of 20 samples a turn, and with it of Ke."""
    own_s, other_s = np.arange(0.0, 0.1, 1e-4), np.arange(3e-5, 0.1, 0.9e-4)
    voltage = {"t_s": own_s, "vab_v": np.cos(3000.0 * own_s), "vbc_v": np.sin(3000.0 * own_s)}
    motion = {"t_s": other_s, "theta_mech_rad": 300.0 * other_s}
    motion |= {"omega_mech_rad_s": np.full(other_s.size, 300.0), "temp_magnet_degc": 25.0}
    tables = (pl.DataFrame(motion), pl.DataFrame(voltage))
    capture = Capture("c", "0" * 64, "verified", CaptureMeta("m", "open_circuit"), tables)
    data = capture.arrays("t_s", *voltage, *motion)
    assert data["vab_v"] == pytest.approx(voltage["vab_v"], abs=1e-12)
    assert data["theta_mech_rad"][1:-1] == pytest.approx(300.0 * own_s[1:-1])


@pytest.mark.parametrize("beside", [-2, 2, 3])
def test_a_row_without_a_value_bends_whatever_else_is_missing_near_it(beside):
    """Where a second row lacked its own, a straight line was taken."""
    t_s = 1e-3 * np.arange(40)
    bent = 3.0 + 200.0 * t_s - 4e4 * t_s**2 + 1e6 * t_s**3
    column = bent.copy()
    column[[20, 20 + beside]] = np.nan
    assert bridged(t_s, column) == pytest.approx(bent, rel=1e-12)


@pytest.mark.parametrize("timing", ["instant", "centred"])
def test_faster_columns_come_onto_the_rows_of_a_slow_table(timing: str) -> None:
    """Means of a row where voltages are, else what there was at its instant; masks move along."""
    fast_s = np.arange(100) * 1e-3
    fast = pl.DataFrame({"t_s": fast_s, "iq_a": fast_s, "vq_v": np.tile([1.0, 3.0], 50)})
    slow = pl.DataFrame({"t_s": fast_s[::10], "theta_mech_rad": 5.0 * fast_s[::10]})
    warm = pl.DataFrame({"t_s": [0.0, 0.09], "temp_winding_degc": [25.0, 26.0]})
    aside = Mask("gate", 1, np.arange(10) != 4)
    meta = CaptureMeta("m", "drive", voltage_timing=timing)
    made = Capture("log.csv", "0" * 64, "verified", meta, (fast, slow, warm), (aside,))
    joined = made.on_rows_of(1)
    assert [table.height for table in joined.tables] == [10, 2]
    assert set(joined.tables[0].columns) == {"t_s", "theta_mech_rad", "iq_a", "vq_v"}
    assert joined.kept(0).tolist() == aside.keep.tolist()
    inner = joined.tables[0]["iq_a"].to_numpy()[1:-1]
    assert inner == pytest.approx(fast_s[::10][1:-1], abs=1e-9)
    volts = joined.tables[0]["vq_v"].to_numpy()[1:-1]
    assert volts == pytest.approx(2.0 if timing == "centred" else 1.0, abs=0.11)
    assert made.on_rows_of(0) is made
