"""Missing, stuck and saturated channels and a faulty clock, one fault at a time."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.contracts.validate import validate
from tests.faults.healthy import (
    Motor,
    cogging,
    column,
    current_step,
    drive,
    heat_run,
    open_circuit,
    spin_down,
    torque_map,
    with_column,
    with_rows,
)
from tests.faults.verdicts import refused, warned

MOTOR = Motor()


# --- missing and stuck ----------------------------------------------------------------------------


def test_nan_rows_are_set_aside(rng: np.random.Generator) -> None:
    """Warned: rows without a needed value are masked and counted, no others."""
    capture = torque_map(MOTOR, rng)
    torque = column(capture, "torque_shaft_nm")
    torque[1000:1400] = np.nan
    passed, finding = warned(with_column(capture, "torque_shaft_nm", torque))
    assert (finding.code, finding.rows) == ("missing_values", (1000, 1399))
    t_s = column(capture, "t_s")
    assert finding.message.endswith(f" ({t_s[1000]:.6g} to {t_s[1399]:.6g} s)")
    assert [mask.dropped for mask in passed.masks] == [400]
    assert passed.arrays("iq_a")["iq_a"].size == 15600


def test_nan_where_not_needed(rng: np.random.Generator) -> None:
    """Let through: NaN in a column that the test can do without."""
    capture = torque_map(MOTOR, rng)
    temperature = column(capture, "temp_winding_degc")
    temperature[100:9000] = np.nan
    passed, findings = validate(with_column(capture, "temp_winding_degc", temperature), {})
    assert (findings, passed.masks) == ((), ())


def test_slow_channel_in_a_fast_table(rng: np.random.Generator) -> None:
    """Let through: a needed temperature written every hundredth row is no fault."""
    capture = heat_run(MOTOR, rng)
    temperature = column(capture, "temp_winding_degc")
    temperature[np.arange(9000) % 100 != 0] = np.nan
    passed, findings = validate(with_column(capture, "temp_winding_degc", temperature), {})
    assert (findings, passed.masks) == ((), ())


@pytest.mark.parametrize("name", ["temp_winding_degc", "temp_magnet_degc"])
def test_slow_channel_is_there_on_the_fast_clock(name: str, rng: np.random.Generator) -> None:
    """Let through: a temperature every hundredth row costs none of the rows in between."""
    capture = drive(MOTOR, rng)
    current = column(capture, "iq_a")
    slow = 20.0 + 1e-4 * np.arange(current.size)
    slow[np.arange(current.size) % 100 != 0] = np.nan
    passed, findings = validate(with_column(capture, name, slow), {})
    data = passed.arrays("iq_a", name)
    last = current.size - (current.size - 1) % 100
    assert (findings, data["iq_a"].size) == ((), current.size)
    assert data[name][:last] == pytest.approx(20.0 + 1e-4 * np.arange(last))


def test_a_channel_that_ends_early_is_no_slow_one(rng: np.random.Generator) -> None:
    """Let through: nothing is drawn over rows in which a fast channel was not recorded."""
    capture = drive(MOTOR, rng)
    torque = np.full(column(capture, "iq_a").size, 0.1)
    torque[1000:-1000] = np.nan
    passed, _ = validate(with_column(capture, "torque_shaft_nm", torque), {})
    assert np.isnan(passed.arrays("iq_a", "torque_shaft_nm")["torque_shaft_nm"][1000:-1000]).all()


def test_dead_channel(rng: np.random.Generator) -> None:
    """Refused: a torque of zero in every row of a torque map."""
    capture = torque_map(MOTOR, rng)
    error = refused(with_column(capture, "torque_shaft_nm", np.zeros(16000)))
    assert error.code == "stuck_channel"
    assert "torque_shaft_nm is 0 in every row" in error.message


def test_frozen_for_a_while(rng: np.random.Generator) -> None:
    """Warned: a noisy channel that repeats one code for 300 rows; exactly these are masked."""
    capture = drive(MOTOR, rng)
    current = column(capture, "iq_a")
    current[20000:20300] = current[20000]
    passed, finding = warned(with_column(capture, "iq_a", current))
    assert finding.code == "stuck_channel"
    assert passed.masks[0].dropped == pytest.approx(300, abs=2)
    assert not passed.masks[0].keep[20000:20300].any()


def test_switched_off_drive(rng: np.random.Generator) -> None:
    """Let through: a drive that is off for a second logs exact zeros, reached from near zero."""
    capture = drive(MOTOR, rng)
    t = column(capture, "t_s")
    for name in ("iq_a", "vq_v"):
        values = column(capture, name) * np.minimum(1.0, np.abs(t - 1.5) / 1.0 - 0.5).clip(0.0)
        values[(t > 1.0) & (t < 2.0)] = 0.0
        capture = with_column(capture, name, values)
    assert [f.code for f in validate(capture, {})[1]] == []


# --- converters -----------------------------------------------------------------------------------


def test_saturation_of_a_few_rows(rng: np.random.Generator) -> None:
    """Warned: back-EMF peaks cut at the top speed; exactly the flat rows are masked."""
    capture = open_circuit(MOTOR, rng)
    voltage = column(capture, "vab_v")
    stop = 0.9 * voltage.max()
    passed, finding = warned(with_column(capture, "vab_v", np.minimum(voltage, stop)))
    assert finding.code == "saturation"
    flat = passed.masks[0].keep == np.False_
    assert np.all(voltage[flat] >= stop)
    assert np.count_nonzero(flat) > 0.9 * np.count_nonzero(voltage > stop)


def test_saturation_of_many_rows(rng: np.random.Generator) -> None:
    """Refused: the current stands at the converter's stop for a quarter of the drive."""
    capture = drive(MOTOR, rng)
    current = column(capture, "iq_a")
    error = refused(
        with_column(capture, "iq_a", np.clip(current, *np.quantile(current, [0.1, 0.85])))
    )
    assert error.code == "saturation"


@pytest.mark.parametrize("size", [0.1, 10.0])
def test_saturated_step(size: float, rng: np.random.Generator) -> None:
    """Refused: a clipped step has no integral, however few rows; the size does not matter."""
    motor = MOTOR.scaled(size)
    capture = current_step(motor, rng)
    current = np.minimum(column(capture, "ia_a"), 0.9 * motor.rated_a)
    error = refused(with_column(capture, "ia_a", current))
    assert error.code == "saturation"
    assert "larger range" in error.remedy


def test_voltage_limit_of_the_inverter(rng: np.random.Generator) -> None:
    """Let through: a commanded voltage that stands at the inverter's limit is no clipped signal."""
    capture = drive(MOTOR, rng)
    voltage = column(capture, "vq_v")
    limited = with_column(capture, "vq_v", np.clip(voltage, -8.0, 8.0))
    assert limited.meta.voltage_kind == "commanded"
    assert validate(limited, {})[1] == ()


# --- the clock ------------------------------------------------------------------------------------


def test_dropped_samples(rng: np.random.Generator) -> None:
    """Warned: 300 of 40,000 rows lost in one piece are counted and with_folder_names."""
    capture = drive(MOTOR, rng)
    keep = np.ones(40000, dtype=bool)
    keep[5000:5300] = False
    _, finding = warned(with_rows(capture, keep))
    assert (finding.code, finding.rows) == ("dropped_samples", (4999, 5000))
    assert "about 300 samples are missing in 1 gaps, 0.75 %" in finding.message


def test_scattered_drops(rng: np.random.Generator) -> None:
    """Warned: single rows lost at random are all counted."""
    capture = open_circuit(MOTOR, rng)
    keep = rng.random(24000) > 0.01
    keep[[0, -1]] = True
    _, finding = warned(with_rows(capture, keep))
    assert finding.code == "dropped_samples"
    assert f"about {np.count_nonzero(~keep)} samples" in finding.message


def test_too_many_drops(rng: np.random.Generator) -> None:
    """Refused: a third of the record is gone."""
    capture = drive(MOTOR, rng)
    keep = np.ones(40000, dtype=bool)
    keep[10000:24000] = False
    assert refused(with_rows(capture, keep)).code == "dropped_samples"


def test_a_recorder_that_pauses_loses_nothing(rng: np.random.Generator) -> None:
    """Let through: gaps beyond the stated `pause_s`; what is lost between pauses still counts."""
    capture = drive(MOTOR, rng)
    keep = np.ones(40000, dtype=bool)
    keep[10000:24000] = False
    paused = with_rows(capture, keep)
    paused = replace(paused, meta=replace(paused.meta, pause_s=0.5))
    assert validate(paused, {})[1] == ()
    every_s = float(column(capture, "t_s")[1] - column(capture, "t_s")[0])
    keep[5000:5300] = False
    lossy = with_rows(capture, keep)
    _, finding = warned(replace(lossy, meta=replace(lossy.meta, pause_s=1000.0 * every_s)))
    assert "about 300 samples are missing in 1 gaps" in finding.message


def test_drop_inside_the_step(rng: np.random.Generator) -> None:
    """Refused: few rows, but the current rises in the gap, so its integral is unknown."""
    capture = current_step(MOTOR, rng)
    keep = np.ones(3000, dtype=bool)
    keep[310:360] = False
    error = refused(with_rows(capture, keep))
    assert (error.code, error.rows) == ("dropped_samples", (309, 310))
    keep = np.ones(3000, dtype=bool)
    keep[2500:2550] = False
    assert warned(with_rows(capture, keep))[1].code == "dropped_samples"


def test_jittering_logger(rng: np.random.Generator) -> None:
    """Let through: a logger that stalls for seven intervals and catches up loses nothing."""
    capture = drive(MOTOR, rng)
    t = column(capture, "t_s")
    for start in range(1000, 39000, 2000):
        t[start : start + 8] = t[start + 7] - 1e-5 * np.arange(7, -1, -1)
    values = {
        name: np.interp(t, column(capture, "t_s"), column(capture, name))
        for name in ("theta_mech_rad", "omega_mech_rad_s", "iq_a", "vq_v")
    }
    capture = with_column(capture, "t_s", t)
    for name, moved in values.items():
        capture = with_column(capture, name, moved)
    assert validate(capture, {})[1] == ()


@pytest.mark.parametrize("jump_s", [0.01, 0.5, 3600.0])
@pytest.mark.parametrize(
    ("make", "row"), [(spin_down, 700), (drive, 16000), (open_circuit, 9000), (cogging, 4000)]
)
def test_clock_jump(make, row: int, jump_s: float, rng: np.random.Generator) -> None:
    """Refused: the clock skips ahead while the shaft goes on turning as between two samples."""
    capture = make(MOTOR, rng)
    t = column(capture, "t_s")
    t[row:] += jump_s
    error = refused(with_column(capture, "t_s", t))
    assert "clock_jump" in (error.code, *error.message.replace("[", "").replace("]", "").split())
    assert error.rows == (row - 1, row)


def test_clock_jump_in_a_step(rng: np.random.Generator) -> None:
    """Refused: the current rises on across ten missing intervals as if there were none."""
    capture = current_step(MOTOR, rng)
    t = column(capture, "t_s")
    t[350:] += 30.0 * (t[1] - t[0])
    error = refused(with_column(capture, "t_s", t))
    assert error.code == "clock_jump"
    assert f"({t[349]:.6g} to {t[350]:.6g} s)" in error.message


def test_clock_set_back(rng: np.random.Generator) -> None:
    """Refused: the clock is set back by a second, at the row where it happens."""
    capture = drive(MOTOR, rng)
    t = column(capture, "t_s")
    t[20000:] -= 1.0
    error = refused(with_column(capture, "t_s", t))
    assert (error.code, error.rows) == ("time_not_increasing", (20000, 20000))
    assert error.message.endswith(f" (at {t[20000]:.6g} s)")
