"""Tables of a capture: slow streams, columns without values, faults, clocks."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.clocks import _slow_columns, held_apart, streams_split
from pipeline.contracts.schemas import check_columns, check_tables
from pipeline.contracts.validate import (
    _filled_rows,
    _rows_once,
    _with_shaft_angle,
    _without_blanks,
)
from pipeline.records.errors import CaptureError
from tests.unit.contracts.signals import OPTIONS
from tests.unit.contracts.test_gate_limits import GATES, capture

CLOCK = np.arange(0.0, 1.0, 1e-3)


def test_slow_streams_have_a_table_of_their_own() -> None:
    """Half of the rows is dense; a value in every row of a part is no slow stream."""
    size = 400
    t_s = np.arange(size) * 1e-3
    every = np.where(np.arange(size) % 3 == 0, 1.0 * t_s, np.nan)
    early = np.where(np.arange(size) < 100, t_s, np.nan)
    table = pl.DataFrame({"t_s": t_s, "iq_a": t_s, "temp_case_degc": every, "id_a": early})
    assert [*_slow_columns(table, 0.5)] == ["temp_case_degc"]
    assert _slow_columns(table, 0.3) == {}
    assert _slow_columns(table.drop("iq_a"), 0.5) == {}
    made = replace(capture("drive", iq_a=t_s), tables=(table,))
    parted = streams_split(made, 0.5)
    assert [t.columns for t in parted.tables] == [
        ["t_s", "iq_a", "id_a"],
        ["t_s", "temp_case_degc"],
    ]
    assert parted.tables[1].height == 134
    assert parted.tables[1]["t_s"][1] == pytest.approx(3e-3)
    assert streams_split(made, 0.3) is made


def test_blanks_in_the_same_rows_are_one_stream() -> None:
    """Currents and voltages of every tenth row, parted, were drawn out to the angle's clock."""
    blank = np.where(np.arange(1000) % 10 == 3, np.sin(30.0 * CLOCK), np.nan)
    made = capture("drive", t_s=CLOCK, theta_mech_rad=CLOCK, iq_a=blank, vq_v=2.0 * blank)
    parted = streams_split(made, 0.5)
    assert [t.columns for t in parted.tables] == [
        ["t_s", "theta_mech_rad"],
        ["t_s", "iq_a", "vq_v"],
    ]
    assert parted.tables[1].height == 100


def held(values: np.ndarray, shift: np.ndarray | int = 0) -> np.ndarray:
    """Each value for ten rows of the clock, the first ones for `shift` rows less."""
    place = (np.arange(CLOCK.size) + shift) // 10
    return values[np.clip(place, 0, values.size - 1)]


def test_values_that_a_bus_holds_are_samples_once() -> None:
    """A sound motor missed by 12 noise floors: nine rows of ten repeated the last message."""
    generator = np.random.default_rng(3)
    current, speed = generator.normal(size=(2, 101))
    current[40] = current[39]
    jitter = generator.integers(0, 2, CLOCK.size // 10).repeat(10)
    made = capture(
        "drive",
        t_s=CLOCK,
        theta_mech_rad=CLOCK**2,
        iq_a=held(current),
        vq_v=held(2.0 * current),
        omega_mech_rad_s=held(speed, 4 + jitter),
    )
    kept, findings = held_apart(made)
    assert [t.columns for t in kept.tables] == [
        ["t_s", "theta_mech_rad"],
        ["t_s", "iq_a", "vq_v"],
        ["t_s", "omega_mech_rad_s"],
    ]
    assert kept.tables[1]["t_s"].to_numpy() == pytest.approx(CLOCK[10::10])
    assert kept.tables[1]["iq_a"].to_numpy() == pytest.approx(current[1:100])
    assert [f.code for f in findings] == ["held_values"]
    assert "iq_a, vq_v, omega_mech_rad_s: new in every 10th row" in findings[0].message


def test_values_that_a_bus_holds_beside_rows_that_hold_none() -> None:
    """A torque of 100 Hz counted as one of 1 kHz that is 5 ms late, and J came out threefold."""
    values = np.random.default_rng(4).normal(size=101)
    blank = np.where(np.random.default_rng(6).uniform(size=CLOCK.size) < 0.05, np.nan, 1.0)
    made = capture("drive", t_s=CLOCK, iq_a=CLOCK**2, torque_shaft_nm=held(values) * blank)
    kept, findings = held_apart(made)
    assert [f.code for f in findings] == ["held_values"]
    assert kept.tables[1]["torque_shaft_nm"].to_numpy() == pytest.approx(values[1:100])


@pytest.mark.parametrize(
    "values",
    [
        np.round(np.sin(40.0 * CLOCK) + 0.01 * np.random.default_rng(1).normal(size=1000), 1),
        np.repeat(np.arange(80.0), 100),
        np.random.default_rng(2).normal(size=1000),
        np.zeros(1000),
    ],
    ids=["coarse", "plateaus", "new in every row", "constant"],
)
def test_coarse_values_and_plateaus_are_not_held(values: np.ndarray) -> None:
    clock = np.arange(values.size) * 1e-3
    made = capture("drive", t_s=clock, theta_mech_rad=np.repeat(clock[::10], 10), iq_a=values)
    assert held_apart(made) == (made, [])


def test_a_voltage_that_an_inverter_holds_is_whole() -> None:
    """A current that is new in every row follows each step of the voltage."""
    steps = held(np.random.default_rng(5).normal(size=101))
    current = np.cumsum(steps) * 1e-2
    made = capture("drive", t_s=CLOCK, vq_v=steps, iq_a=current)
    assert held_apart(made) == (made, [])
    none = np.zeros(CLOCK.size)
    made = capture("drive", t_s=CLOCK, theta_mech_rad=CLOCK, vq_v=steps, iq_a=steps, id_a=none)
    assert held_apart(made)[0].tables[1].columns == ["t_s", "vq_v", "iq_a"]
    alone, findings = held_apart(capture("drive", t_s=CLOCK, theta_mech_rad=CLOCK, vq_v=steps))
    assert [t.columns for t in alone.tables] == [["t_s", "theta_mech_rad"], ["t_s", "vq_v"]]
    assert len(findings) == 1


@pytest.mark.parametrize(("pwm_hz", "apart"), [(100.0, False), (160.0, True), (None, False)])
def test_a_voltage_that_is_held_for_longer_than_the_drive_holds_it_is_a_bus(
    pwm_hz: float | None, apart: bool
) -> None:
    """Ten rows of 1 ms: one PWM period of 100 Hz, and more than one and a half of 160 Hz."""
    steps = held(np.random.default_rng(5).normal(size=101))
    current = np.cumsum(steps) * 1e-2
    made = capture("drive", meta={"pwm_hz": pwm_hz}, t_s=CLOCK, vq_v=steps, iq_a=current)
    tables = [table.columns for table in held_apart(made)[0].tables]
    assert tables == ([["t_s", "iq_a"], ["t_s", "vq_v"]] if apart else [["t_s", "vq_v", "iq_a"]])


def test_an_angle_of_a_bus_has_changes_of_many_sizes_and_one_of_an_encoder_has_not() -> None:
    """A coast by a held angle was 1e9 times its floor; an encoder's own steps come on no clock."""
    at_s = np.arange(101) * 0.01
    made = capture("drive", t_s=CLOCK, iq_a=CLOCK**2, theta_mech_rad=held(20.0 * at_s**2))
    kept, findings = held_apart(made)
    assert [t.columns for t in kept.tables] == [["t_s", "iq_a"], ["t_s", "theta_mech_rad"]]
    assert [f.code for f in findings] == ["held_values"]
    step = 2.0 * np.pi / 512
    encoder = step * np.floor(100.0 * CLOCK)
    made = capture("drive", t_s=CLOCK, iq_a=CLOCK**2, theta_mech_rad=encoder)
    assert held_apart(made) == (made, [])


def test_an_electrical_angle_alone_is_that_of_the_shaft_by_the_stated_pole_pairs() -> None:
    """Such a drive's sheet was empty, and the motor `unknown` at 28 noise floors."""
    columns = {"t_s": CLOCK, "iq_a": CLOCK, "theta_elec_rad": 7.0 * CLOCK}
    made = capture("drive", meta={"pole_pairs": 7}, **columns)
    turned, findings = _with_shaft_angle(made)
    assert turned.tables[0]["theta_mech_rad"].to_numpy() == pytest.approx(CLOCK)
    assert not turned.has("theta_elec_rad")
    assert [f.code for f in findings] == ["stated_pole_pairs"]
    for other in (
        capture("drive", **columns),
        capture("open_circuit", meta={"pole_pairs": 7}, **columns),
        capture("drive", meta={"pole_pairs": 7}, omega_mech_rad_s=CLOCK, **columns),
        capture("drive", meta={"pole_pairs": 7}, t_s=CLOCK, iq_a=CLOCK, theta_mech_rad=CLOCK),
    ):
        assert _with_shaft_angle(other) == (other, [])


def test_columns_without_a_value_are_not_there() -> None:
    made = capture("drive", iq_a=np.ones(9), id_a=np.full(9, np.nan))
    kept, findings = _without_blanks(made)
    assert [f.code for f in findings] == ["empty_column"]
    assert kept.tables[0].columns == ["iq_a", "t_s"]
    assert _without_blanks(capture("drive", iq_a=np.ones(9)))[1] == []
    clock = replace(made, tables=(*made.tables, pl.DataFrame({"t_s": [0.0], "id_a": [np.nan]})))
    assert len(_without_blanks(clock)[0].tables) == 1


def test_a_fault_names_its_rows_and_a_few_values() -> None:
    values = np.ones(20)
    values[[3, 9, 11, 15]] = np.inf
    with pytest.raises(CaptureError) as found:
        check_tables(capture("drive", iq_a=values))
    assert found.value.code == "infinite_value"
    assert found.value.rows == (3, 15)
    assert "in 4 of 20 rows (inf, inf, inf" in str(found.value)
    t_s = np.array([0.0, 1.0, 1.0, 2.0, 1.5])
    with pytest.raises(CaptureError) as found:
        check_tables(capture("drive", t_s=t_s, iq_a=np.ones(5)))
    assert (found.value.code, found.value.rows) == ("time_not_increasing", (2, 4))


def test_every_table_with_rows_has_a_clock() -> None:
    made = capture("drive", iq_a=np.ones(9), vq_v=1.0, theta_mech_rad=np.arange(9.0))
    other = pl.DataFrame({"temp_case_degc": [1.0]})
    check_columns(replace(made, tables=(*made.tables, other.clear())))
    with pytest.raises(CaptureError, match="has no t_s"):
        check_columns(replace(made, tables=(*made.tables, other)))
    with pytest.raises(CaptureError, match="no sample"):
        check_columns(replace(made, tables=(made.tables[0].clear(),)))


def test_a_channel_with_values_in_half_of_the_rows_is_no_slow_one() -> None:
    """Exactly half counts as dense: its blanks are set aside; one row less is a slow stream."""
    for there, masks in ((200, 1), (199, 0)):
        current = np.where(np.arange(400) < there, 1.0, np.nan)
        made = capture("drive", iq_a=current, vq_v=1.0, theta_mech_rad=np.arange(400.0))
        try:
            passed = GATES["missing_values"].check(made, OPTIONS["missing_values"])
        except CaptureError:
            assert masks == 0
            continue
        assert len(passed.masks) == masks


def test_the_end_of_a_buffer_that_was_not_filled_is_left_out() -> None:
    """Rows that repeat the last one, clock and all; a clock that stands elsewhere is a fault."""
    t_s, iq_a = np.arange(40) * 1e-3, np.sin(np.arange(40))
    iq_a[4] = np.nan
    t_s[33:], iq_a[33:] = 0.033, 0.0
    made, findings = _filled_rows(capture("drive", t_s=t_s, iq_a=iq_a))
    assert [(f.code, f.rows) for f in findings] == [("unfilled_rows", (33, 39))]
    assert made.tables[0]["t_s"].to_list() == t_s[:33].tolist()
    check_tables(made)
    blank = capture("drive", t_s=np.r_[0.0, 1.0, 2.0, 2.0], iq_a=np.full(4, np.nan))
    assert _filled_rows(blank)[0].tables[0].height == 2
    for row in (10, 38):
        again = np.arange(40) * 1e-3
        again[row + 1] = again[row]
        kept = capture("drive", t_s=again, iq_a=np.arange(40.0))
        assert _filled_rows(kept) == (kept, [])
        with pytest.raises(CaptureError, match="does not increase"):
            check_tables(kept)


def test_a_row_that_a_bus_sent_twice_is_one_sample() -> None:
    """Rows that repeat the one before, clock and all, are left out and counted; others are not."""
    t_s, iq_a = np.arange(40) * 1e-3, np.sin(np.arange(40))
    rows = np.sort(np.r_[np.arange(40), 3, 17, 17])
    made, findings = _rows_once(capture("drive", t_s=t_s[rows], iq_a=iq_a[rows]))
    assert [(f.code, f.rows) for f in findings] == [("repeated_rows", (4, 20))]
    assert "3 of 43 rows" in findings[0].message
    assert made.tables[0]["t_s"].to_list() == t_s.tolist()
    again = capture("drive", t_s=t_s[rows], iq_a=np.arange(43.0))
    assert _rows_once(again) == (again, [])


def test_a_drive_of_torque_and_motion_says_how_its_torque_is_a_current() -> None:
    """Efforts of a robot's joint states are computed from the current."""
    columns = {"t_s": np.arange(9.0), "theta_mech_rad": np.arange(9.0)}
    with pytest.raises(CaptureError, match=r"column\.NAME=iq_a"):
        check_columns(capture("drive", torque_shaft_nm=np.ones(9), **columns))
    with pytest.raises(CaptureError, match="record what is missing"):
        check_columns(capture("drive", **columns))


def test_line_currents_of_a_drive_say_what_is_to_be_logged() -> None:
    """Without an angle they show the electrical speed alone; id_a and iq_a are never made up."""
    lines = {name: np.sin(CLOCK + shift) for name, shift in (("ia_a", 0.0), ("ib_a", -2.1))}
    with pytest.raises(CaptureError) as refused:
        check_columns(capture("drive", t_s=CLOCK, **lines))
    assert "needs iq_a" in refused.value.message
    assert "nothing of the motor" in refused.value.remedy
    assert "iq_a" in refused.value.remedy
