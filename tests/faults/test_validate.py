"""One fault at a time into a healthy capture; the docstring says what must come of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.motor import agree
from pipeline.contracts.registry import gates
from pipeline.contracts.requirements import requirements
from pipeline.contracts.validate import validate
from pipeline.physics.glossary import TESTS as TEST_NAMES
from pipeline.records.capture import Campaign, Capture
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding
from tests.faults.healthy import (
    TESTS,
    Motor,
    capture_of,
    cogging,
    column,
    current_step,
    dq_columns,
    drive,
    flux_map,
    hand_turn,
    heat_run,
    holding_current,
    lcr,
    open_circuit,
    resistance,
    spin_down,
    torque_map,
    with_column,
    with_rows,
)

MOTOR = Motor()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(20260302)


def refused(capture: Capture) -> CaptureError:
    """The refusal of a capture; fails if it is let through."""
    with pytest.raises(CaptureError) as caught:
        validate(capture, {})
    assert caught.value.message, "a refusal says what is wrong"
    assert caught.value.remedy, "a refusal says what to do"
    return caught.value


def warned(capture: Capture) -> tuple[Capture, Finding]:
    """The capture that came through, and its only finding."""
    passed, findings = validate(capture, {})
    assert len(findings) == 1, [finding.line() for finding in findings]
    assert findings[0].severity == "warning"
    assert findings[0].file == capture.path
    return passed, findings[0]


# --- healthy captures -------------------------------------------------------------------------


@pytest.mark.parametrize("size", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("test", sorted(TESTS))
def test_healthy(test: str, size: float) -> None:
    """Nothing is said of, or taken from, a healthy capture of a motor of any size."""
    for seed in range(2):
        capture = TESTS[test](MOTOR.scaled(size), np.random.default_rng(seed))
        passed, findings = validate(capture, {})
        assert findings == ()
        assert passed.masks == ()


def test_every_test_has_a_healthy_capture_and_a_gate() -> None:
    """No test of the contract is left without a gate or out of this file."""
    assert set(TESTS) == set(TEST_NAMES)
    for test in TEST_NAMES:
        assert requirements(test)
        assert any(test in gate.tests for gate in gates()), test


def test_healthy_without_noise(rng: np.random.Generator) -> None:
    """A simulated step without any noise settles on one value: no saturation, no stuck channel."""
    capture = current_step(MOTOR, rng)
    t = column(capture, "t_s")
    tau = MOTOR.ld_h / MOTOR.r_ohm
    current = np.where(t > t[300], MOTOR.rated_a * -np.expm1(-(t - t[300]) / tau), 0.0)
    capture = with_column(capture, "ia_a", current.astype(np.float32))
    capture = with_column(capture, "vab_v", np.where(t > t[300], 9.6, 0.0))
    assert validate(capture, {})[1] == ()


# --- the contract -----------------------------------------------------------------------------


def test_time_nan(rng: np.random.Generator) -> None:
    """Refused: NaN time, with the rows it spans."""
    capture = spin_down(MOTOR, rng)
    t = column(capture, "t_s")
    t[[70, 90]] = np.nan
    error = refused(with_column(capture, "t_s", t))
    assert (error.code, error.rows) == ("time_not_finite", (70, 90))


def test_time_unsorted(rng: np.random.Generator) -> None:
    """Refused: two rows in the wrong order, and a repeated time, are at the later row."""
    capture = spin_down(MOTOR, rng)
    t = column(capture, "t_s")
    t[[500, 501]] = t[[501, 500]]
    error = refused(with_column(capture, "t_s", t))
    assert (error.code, error.rows) == ("time_not_increasing", (501, 501))
    t = column(capture, "t_s")
    t[900] = t[899]
    assert refused(with_column(capture, "t_s", t)).rows == (900, 900)


def test_infinity(rng: np.random.Generator) -> None:
    """Refused: infinity is no number; both signs count."""
    capture = heat_run(MOTOR, rng)
    temperature = column(capture, "temp_winding_degc")
    temperature[[10, 20]] = np.inf, -np.inf
    error = refused(with_column(capture, "temp_winding_degc", temperature))
    assert (error.code, error.rows) == ("infinite_value", (10, 20))


def test_implausible_value(rng: np.random.Generator) -> None:
    """Refused: kelvin written as degrees lie outside the glossary's range."""
    capture = heat_run(MOTOR, rng)
    kelvin = column(capture, "temp_winding_degc") + 273.15 + 120.0
    error = refused(with_column(capture, "temp_winding_degc", kelvin))
    assert (error.code, error.rows) == ("implausible_value", (0, 8999))
    assert "9000 of 9000" in error.message
    assert "conf/source" in error.remedy


def test_sentinel(rng: np.random.Generator) -> None:
    """Refused: a sentinel for missing is a value out of range, and the row is named."""
    capture = heat_run(MOTOR, rng)
    temperature = column(capture, "temp_winding_degc")
    temperature[4321] = -9999.0
    error = refused(with_column(capture, "temp_winding_degc", temperature))
    assert (error.code, error.rows) == ("implausible_value", (4321, 4321))


def test_all_failures_at_once(rng: np.random.Generator) -> None:
    """Refused once, with every fault in the message: NaN time, infinity and range."""
    capture = heat_run(MOTOR, rng)
    for name, value in (("t_s", np.nan), ("vd_v", np.inf), ("id_a", 1e6)):
        values = column(capture, name)
        values[7] = value
        capture = with_column(capture, name, values)
    error = refused(capture)
    assert error.code == "time_not_finite"
    assert "[infinite_value] vd_v" in error.message
    assert "[implausible_value] id_a" in error.message


@pytest.mark.parametrize(
    ("test", "dropped"),
    [
        ("resistance", "ia_a"),
        ("resistance", "temp_winding_degc"),
        ("current_step", "vab_v"),
        ("current_step", "t_s"),
        ("lcr", "lab_h"),
        ("open_circuit", "theta_mech_rad omega_mech_rad_s"),
        ("open_circuit", "vab_v vbc_v"),
        ("hand_turn", "vab_v vbc_v"),
        ("cogging", "torque_shaft_nm"),
        ("torque_map", "omega_mech_rad_s"),
        ("torque_map", "vd_v"),
        ("spin_down", "omega_mech_rad_s"),
        ("heat_run", "temp_winding_degc"),
        ("heat_run", "id_a"),
        ("holding_current", "iq_a"),
        ("flux_map", "psi_q_wb"),
        ("drive", "vq_v"),
        ("drive", "theta_mech_rad omega_mech_rad_s"),
    ],
)
def test_missing_column(test: str, dropped: str, rng: np.random.Generator) -> None:
    """Refused: a capture without what its test holds at least says what is needed."""
    capture = TESTS[test](MOTOR, rng)
    table = capture.tables[0].drop(dropped.split())
    error = refused(replace(capture, tables=(table,)))
    assert error.code == "missing_column"
    assert error.message.startswith(f"{test} needs ")
    assert any(name in error.message.split("; the file has")[0] for name in dropped.split())


@pytest.mark.parametrize(
    ("test", "dropped"),
    [
        ("open_circuit", "theta_mech_rad"),
        ("open_circuit", "omega_mech_rad_s"),
        ("open_circuit", "vca_v"),
        ("hand_turn", "theta_mech_rad vbc_v"),
        ("drive", "vd_v id_a torque_shaft_nm omega_mech_rad_s"),
        ("spin_down", "theta_mech_rad"),
    ],
)
def test_what_may_be_missing(test: str, dropped: str, rng: np.random.Generator) -> None:
    """Let through: a capture holds any subset beyond the least."""
    capture = TESTS[test](MOTOR, rng)
    table = capture.tables[0].drop(dropped.split())
    assert validate(replace(capture, tables=(table,)), {})[1] == ()


def test_column_without_a_value(rng: np.random.Generator) -> None:
    """Refused: a column of nothing but NaN is a missing column, and is named as empty."""
    capture = resistance(MOTOR, rng)
    error = refused(with_column(capture, "ia_a", np.full(3000, np.nan)))
    assert error.code == "missing_column"
    assert "without a value: ia_a" in error.message


def test_current_of_the_other_line(rng: np.random.Generator) -> None:
    """Let through: the pair's current may be that of either of its two lines, not the third's."""
    capture = resistance(MOTOR, rng)
    other = capture.tables[0].rename({"ia_a": "ib_a"})
    assert validate(replace(capture, tables=(other,)), {})[1] == ()
    third = capture.tables[0].rename({"ia_a": "ic_a"})
    assert refused(replace(capture, tables=(third,))).code == "missing_column"


def test_empty(rng: np.random.Generator) -> None:
    """Refused: a table without rows."""
    capture = drive(MOTOR, rng)
    assert refused(replace(capture, tables=(capture.tables[0].head(0),))).code == "no_rows"


def test_text_instead_of_numbers(rng: np.random.Generator) -> None:
    """Refused, never coerced: a column of text."""
    capture = drive(MOTOR, rng)
    table = capture.tables[0].with_columns(pl.col("vq_v").cast(pl.String))
    error = refused(replace(capture, tables=(table,)))
    assert error.code in {"not_numeric", "missing_column"}
    assert "vq_v" in error.message


def test_unknown_test(rng: np.random.Generator) -> None:
    """Refused: a test that the contract does not know, with those it does."""
    capture = drive(MOTOR, rng)
    error = refused(replace(capture, meta=replace(capture.meta, test="burn_in")))
    assert error.code == "unknown_test"
    assert "burn_in" in error.message
    assert "spin_down" in error.message


@pytest.mark.parametrize(
    ("key", "value", "code"),
    [
        ("pair", "ac", "unknown_metadata"),
        ("winding", "star", "unknown_metadata"),
        ("pole_pairs", 0, "implausible_metadata"),
        ("u_rel_current", -0.1, "implausible_metadata"),
        ("ambient_degc", 298.0, "implausible_metadata"),
    ],
)
def test_metadata(key: str, value: object, code: str, rng: np.random.Generator) -> None:
    """Refused: metadata that cannot be true."""
    capture = resistance(MOTOR, rng)
    error = refused(replace(capture, meta=replace(capture.meta, **{key: value})))
    assert error.code == code
    assert key in error.message


# --- missing and stuck ------------------------------------------------------------------------


def test_nan_rows_are_set_aside(rng: np.random.Generator) -> None:
    """Warned: rows without a needed value are masked and counted, no others."""
    capture = torque_map(MOTOR, rng)
    torque = column(capture, "torque_shaft_nm")
    torque[1000:1400] = np.nan
    passed, finding = warned(with_column(capture, "torque_shaft_nm", torque))
    assert (finding.code, finding.rows) == ("missing_values", (1000, 1399))
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


# --- the clock --------------------------------------------------------------------------------


def test_dropped_samples(rng: np.random.Generator) -> None:
    """Warned: 300 of 40,000 rows lost in one piece are counted and placed."""
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
    assert refused(with_column(capture, "t_s", t)).code == "clock_jump"


def test_clock_set_back(rng: np.random.Generator) -> None:
    """Refused: the clock is set back by a second, at the row where it happens."""
    capture = drive(MOTOR, rng)
    t = column(capture, "t_s")
    t[20000:] -= 1.0
    error = refused(with_column(capture, "t_s", t))
    assert (error.code, error.rows) == ("time_not_increasing", (20000, 20000))


# --- converters -------------------------------------------------------------------------------


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


# --- phases -----------------------------------------------------------------------------------


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_swapped_phases(sense: float, rng: np.random.Generator) -> None:
    """Refused in either sense of rotation: two leads exchanged turn the back-EMF backwards."""
    capture = open_circuit(MOTOR, rng, sense)
    assert validate(capture, {})[1] == ()
    ab, bc, ca = (column(capture, f"v{pair}_v") for pair in ("ab", "bc", "ca"))
    for name, values in (("vab_v", -ab), ("vbc_v", -ca), ("vca_v", -bc)):
        capture = with_column(capture, name, values)
    error = refused(capture)
    assert error.code == "swapped_phases"
    assert "-7.00 cycles a turn" in error.message


def test_swapped_phases_with_speed_alone(rng: np.random.Generator) -> None:
    """Refused as well where only two voltages and a speed were recorded."""
    capture = open_circuit(MOTOR, rng)
    table = capture.tables[0].drop("theta_mech_rad", "vca_v")
    table = table.rename({"vab_v": "vbc_v", "vbc_v": "vab_v"})
    assert refused(replace(capture, tables=(table,))).code == "swapped_phases"


@pytest.mark.parametrize("make", [drive, torque_map])
def test_reversed_angle_under_current(make, rng: np.random.Generator) -> None:
    """Refused: v_q falls where the speed rises, so angle and phases oppose each other."""
    capture = make(MOTOR, rng)
    for name in ("theta_mech_rad", "omega_mech_rad_s"):
        capture = with_column(capture, name, -column(capture, name))
    assert refused(capture).code == "swapped_phases"


def test_field_weakening_beyond_the_magnet(rng: np.random.Generator) -> None:
    """Let through: d current that more than cancels a weak magnet turns v_q's sign, rightly."""
    weak = replace(MOTOR, psi_wb=0.001)
    t = np.arange(16000) * 5e-5
    id_ = np.repeat(weak.rated_a * np.array([-0.2, -0.6, -1.0, -0.8]), 4000)
    iq = np.tile(np.repeat([0.3 * weak.rated_a, -0.3 * weak.rated_a], 2000), 4)
    assert weak.ld_h * id_.mean() < -weak.psi_wb
    for d_current in (id_, np.full(t.size, -weak.rated_a)):
        columns = dq_columns(weak, rng, t, 100.0, d_current, iq)
        capture = capture_of("torque_map", columns, weak)
        assert validate(capture, {})[1] == ()
        reverse = with_column(capture, "omega_mech_rad_s", -column(capture, "omega_mech_rad_s"))
        reverse = with_column(reverse, "theta_mech_rad", -column(reverse, "theta_mech_rad"))
        if d_current is id_:
            assert refused(reverse).code == "swapped_phases"


def test_torque_of_the_other_sign(rng: np.random.Generator) -> None:
    """Refused: the torque falls as i_q grows."""
    capture = torque_map(MOTOR, rng)
    torque = -column(capture, "torque_shaft_nm")
    assert refused(with_column(capture, "torque_shaft_nm", torque)).code == "torque_sign"


def _three_currents(capture: Capture, gain: float, offset_a: float = 0.0) -> Capture:
    """The drive with its three line currents logged too, the third one through a faulty sensor."""
    theta = MOTOR.pole_pairs * column(capture, "theta_mech_rad")
    vector = (column(capture, "id_a") + 1j * column(capture, "iq_a")) * np.exp(1j * theta)
    turns = np.exp(-2j * np.pi / 3.0 * np.arange(3))
    a, b, c = ((vector * turn).real for turn in turns)
    columns = {"ia_a": a, "ib_a": b, "ic_a": gain * c + offset_a}
    table = capture.tables[0].with_columns(pl.Series(n, v) for n, v in columns.items())
    return replace(capture, tables=(table,))


def test_currents_that_do_not_sum_to_zero(rng: np.random.Generator) -> None:
    """Warned at 5 % of one gain, refused where one current is reversed, silent where exact."""
    healthy = drive(MOTOR, rng)
    assert validate(_three_currents(healthy, 1.0), {})[1] == ()
    _, finding = warned(_three_currents(healthy, 1.05))
    assert finding.code == "current_sum"
    table = _three_currents(healthy, 1.05).tables[0]
    power = sum(np.mean(table[n].to_numpy() ** 2) for n in ("ia_a", "ib_a", "ic_a"))
    stray = np.sqrt(np.mean((table["ic_a"].to_numpy() * 0.05 / 1.05) ** 2) / power)
    stated = float(finding.message.split(" is ")[1].split(" %")[0])
    assert stated == pytest.approx(100.0 * stray, rel=0.01)
    assert refused(_three_currents(healthy, -1.0)).code == "current_sum"


def test_voltages_that_do_not_sum_to_zero(rng: np.random.Generator) -> None:
    """Refused: one probe at ten to one where the others are at one to one."""
    capture = open_circuit(MOTOR, rng)
    error = refused(with_column(capture, "vca_v", 10.0 * column(capture, "vca_v")))
    assert error.code == "voltage_sum"


# --- pole pairs, angle and speed --------------------------------------------------------------


@pytest.mark.parametrize("make", [open_circuit, hand_turn])
def test_wrong_pole_pairs(make, rng: np.random.Generator) -> None:
    """Warned, not refused: the data say 7, the nameplate 14, which is the poles."""
    capture = make(MOTOR, rng)
    _, finding = warned(replace(capture, meta=replace(capture.meta, pole_pairs=14)))
    assert finding.code == "pole_pairs_nameplate"
    assert "7.000 cycles a turn; the nameplate says 14" in finding.message
    assert "number of poles" in finding.message


def test_gear_between_motor_and_encoder(rng: np.random.Generator) -> None:
    """Warned: behind a 4:3 gear the cycles a turn are no whole number."""
    capture = open_circuit(MOTOR, rng)
    for name in ("theta_mech_rad", "omega_mech_rad_s"):
        capture = with_column(capture, name, 0.75 * column(capture, name))
    assert warned(capture)[1].code == "pole_pairs_not_whole"


@pytest.mark.parametrize(
    ("name", "factor", "words"),
    [
        ("omega_mech_rad_s", 9.5493, "rpm"),
        ("theta_mech_rad", 57.29578, "degrees"),
        ("omega_mech_rad_s", 7.0, "the speed is electrical"),
        ("theta_mech_rad", 1.0 / (2.0 * np.pi), "turns"),
        ("omega_mech_rad_s", -1.0, "sign"),
    ],
)
def test_speed_against_angle(
    name: str, factor: float, words: str, rng: np.random.Generator
) -> None:
    """Refused: speed and angle in different quantities; the likely mix-up is named."""
    capture = spin_down(MOTOR, rng)
    error = refused(with_column(capture, name, factor * column(capture, name)))
    assert error.code == "speed_against_angle"
    assert words in error.message


def test_speed_a_tenth_off(rng: np.random.Generator) -> None:
    """Warned, not refused: the speed is not needed where the angle is there."""
    capture = spin_down(MOTOR, rng)
    speed = 1.1 * column(capture, "omega_mech_rad_s")
    _, finding = warned(with_column(capture, "omega_mech_rad_s", speed))
    assert finding.code == "speed_against_angle"
    assert "1.1 times" in finding.message


# --- rate and coverage ------------------------------------------------------------------------


def test_slow_sampling_of_a_step(rng: np.random.Generator) -> None:
    """Warned at 5 samples a time constant, refused at 1: the figure is in the message."""
    capture = current_step(MOTOR, rng)
    rows = np.arange(3000)
    _, finding = warned(with_rows(capture, rows % 30 == 0))
    assert finding.code == "sampling_rate"
    assert float(finding.message.split()[0]) == pytest.approx(5.0, rel=0.25)
    assert refused(with_rows(capture, rows % 150 == 0)).code == "sampling_rate"


def test_aliased_back_emf(rng: np.random.Generator) -> None:
    """Refused: two samples in the shortest electrical period, by the nameplate's count."""
    capture = open_circuit(MOTOR, rng)
    error = refused(with_rows(capture, np.arange(24000) % 20 == 0))
    assert "sampling_rate" in error.code + error.message


def test_rotor_frame_aliased(rng: np.random.Generator) -> None:
    """Warned: dq columns at 1.4 samples an electrical period hide all that turns with the angle."""
    capture = drive(MOTOR, rng)
    period_s = 2.0 * np.pi / (MOTOR.pole_pairs * 0.8 * MOTOR.top_rad_s)
    every = round(period_s / 1.4 / 1e-4)
    _, finding = warned(with_rows(capture, np.arange(40000) % every == 0))
    assert finding.code == "sampling_rate"
    assert float(finding.message.split()[0]) == pytest.approx(1.4, rel=0.05)


def test_cogging_too_coarse(rng: np.random.Generator) -> None:
    """Order 84 (12 slots, 14 poles): warned at 5 samples in its period, refused at 2."""
    capture = cogging(MOTOR, rng)
    period_rows = 2.0 * np.pi / 84.0 / 0.25 / 1e-3
    rows = np.arange(26000)
    _, finding = warned(with_rows(capture, rows % round(period_rows / 5.0) == 0))
    assert finding.code == "sampling_rate"
    assert "order 84" in finding.message
    assert float(finding.message.split()[0]) == pytest.approx(5.0, rel=0.02)
    error = refused(with_rows(capture, rows % round(period_rows / 2.0) == 0))
    assert "sampling_rate" in error.code + error.message


def test_no_step(rng: np.random.Generator) -> None:
    """Refused: noise alone is no current step; the remedy names the experiment."""
    capture = current_step(MOTOR, rng)
    error = refused(with_column(capture, "ia_a", rng.normal(0.0, 1e-3, 3000)))
    assert error.code == "current_coverage"
    assert "voltage step" in error.remedy


def test_resistance_at_one_level(rng: np.random.Generator) -> None:
    """Warned: one level of current cannot part the leads' offset from R."""
    capture = with_rows(resistance(MOTOR, rng), np.arange(3000) >= 2250)
    assert warned(capture)[1].code == "current_coverage"


def test_resistance_without_current(rng: np.random.Generator) -> None:
    """Refused: no current, no resistance."""
    capture = resistance(MOTOR, rng)
    error = refused(with_column(capture, "ia_a", rng.normal(0.0, 1e-3, 3000)))
    assert "current_coverage" in error.code + error.message


def test_milliampere(rng: np.random.Generator) -> None:
    """Warned: milliampere recorded as ampere make a resistance that no winding has."""
    capture = resistance(MOTOR, rng)
    capture = with_column(capture, "ia_a", 1e3 * column(capture, "ia_a"))
    _, finding = warned(capture)
    assert finding.code == "implausible_resistance"
    assert "mA" in finding.remedy


def test_more_volts_than_the_link(rng: np.random.Generator) -> None:
    """Warned: 9.6 V between two terminals of an inverter on 5 V; silent on 12 V."""
    capture = current_step(MOTOR, rng)
    on = {v: replace(capture, meta=replace(capture.meta, vdc_v=v)) for v in (5.0, 12.0)}
    assert warned(on[5.0])[1].code == "voltage_above_link"
    assert validate(on[12.0], {})[1] == ()


def test_half_a_turn(rng: np.random.Generator) -> None:
    """Refused: cogging and a hand turn need a whole mechanical turn, and the refusal says so."""
    for make in (cogging, hand_turn, holding_current):
        capture = make(MOTOR, rng)
        angle = column(capture, "theta_mech_rad")
        half = with_rows(capture, angle - angle.min() < np.pi)
        error = refused(half)
        assert error.code == "angle_coverage"
        assert "one mechanical turn" in error.remedy


def test_one_way_holding_current(rng: np.random.Generator) -> None:
    """Warned: without the way back friction cannot be told from cogging."""
    capture = with_rows(holding_current(MOTOR, rng), np.arange(6000) < 3000)
    assert warned(capture)[1].code == "angle_coverage"


def test_few_locked_angles(rng: np.random.Generator) -> None:
    """Warned at two rotor angles, refused at one (0° and 180° electrical are the same)."""
    capture = lcr(MOTOR, rng)
    angle = column(capture, "theta_elec_deg")
    assert warned(with_rows(capture, np.isin(angle, [0.0, 90.0])))[1].code == "angle_coverage"
    assert refused(with_rows(capture, np.isin(angle, [0.0, 180.0]))).code == "angle_coverage"


def test_coast_that_stays(rng: np.random.Generator) -> None:
    """Refused: the speed hardly falls, so there is nothing to part Coulomb from viscous drag."""
    capture = with_rows(spin_down(MOTOR, rng), np.arange(2000) < 150)
    error = refused(capture)
    assert error.code == "speed_coverage"
    assert "coast" in error.remedy


def test_torque_map_at_standstill(rng: np.random.Generator) -> None:
    """Warned: nothing is seen of speed, though torque against current still is."""
    capture = torque_map(MOTOR, rng)
    capture = with_column(capture, "omega_mech_rad_s", rng.normal(0.0, 1e-3, 16000))
    capture = with_column(capture, "theta_mech_rad", rng.normal(0.3, 1e-5, 16000))
    assert warned(capture)[1].code == "speed_coverage"


def test_cold_heat_run(rng: np.random.Generator) -> None:
    """Warned: a winding that warms by a fraction of a kelvin."""
    capture = heat_run(MOTOR, rng)
    cold = 25.0 + 0.005 * (column(capture, "temp_winding_degc") - 25.0)
    assert warned(with_column(capture, "temp_winding_degc", cold))[1].code == "current_coverage"


def test_flux_map_of_one_line(rng: np.random.Generator) -> None:
    """Refused: one level of i_d shows no d inductance."""
    capture = flux_map(MOTOR, rng)
    line = with_rows(capture, column(capture, "id_a") == 0.0)
    assert refused(line).code == "current_coverage"


# --- several captures of one motor ------------------------------------------------------------


def _campaign(*captures: Capture) -> Campaign:
    named = tuple(replace(c, path=f"{i}_{c.path}") for i, c in enumerate(captures))
    return Campaign("made-up-1", named)


def test_healthy_campaign(rng: np.random.Generator) -> None:
    """Nothing is said of a motor with all its tests."""
    captures = [make(MOTOR, rng) for make in TESTS.values()]
    assert agree(_campaign(*captures, cogging(MOTOR, rng, -1.0))) == ()


@pytest.mark.parametrize(
    ("key", "value"), [("pole_pairs", 14), ("winding", "delta"), ("motor_type", "other")]
)
def test_captures_that_disagree(key: str, value: object, rng: np.random.Generator) -> None:
    """Warned, neither refused: the finding stands at the odd one out and names the other file."""
    odd = spin_down(MOTOR, rng)
    odd = replace(odd, meta=replace(odd.meta, **{key: value}))
    findings = agree(_campaign(resistance(MOTOR, rng), odd, lcr(MOTOR, rng)))
    assert [(f.file, f.code, f.severity) for f in findings] == [
        ("1_spin_down.csv", f"{key}_contradiction", "warning")
    ]
    assert str(value) in findings[0].message
    assert "0_resistance.csv" in findings[0].message


def test_two_captures_that_disagree(rng: np.random.Generator) -> None:
    """Warned once, whichever way round the two come."""
    one, other = resistance(MOTOR, rng), open_circuit(MOTOR, rng)
    other = replace(other, meta=replace(other.meta, pole_pairs=14))
    for captures in ((one, other), (other, one)):
        codes = [f.code for f in agree(_campaign(*captures))]
        assert codes == ["pole_pairs_contradiction"]


def test_one_test_only(rng: np.random.Generator) -> None:
    """Warned: a motor with one test only is told what to ask next."""
    findings = agree(_campaign(resistance(MOTOR, rng), resistance(MOTOR, rng)))
    assert [f.code for f in findings] == ["one_test_only"]
    assert "plan motor=made-up-1" in findings[0].remedy


def test_one_direction_of_cogging(rng: np.random.Generator) -> None:
    """Warned: two captures, both forward; silent as soon as one goes back."""
    others = (resistance(MOTOR, rng), cogging(MOTOR, rng))
    findings = agree(_campaign(*others, cogging(MOTOR, rng)))
    assert [f.code for f in findings] == ["direction_coverage"]
    assert agree(_campaign(*others, cogging(MOTOR, rng, -1.0))) == ()


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_both_directions_in_one_capture(sense: float, rng: np.random.Generator) -> None:
    """Silent: one capture that turns there and back, whichever way it starts."""
    capture = cogging(MOTOR, rng)
    angle = column(capture, "theta_mech_rad")
    there_and_back = sense * 2.0 * np.minimum(angle, angle[::-1])
    capture = with_column(capture, "theta_mech_rad", there_and_back)
    assert agree(_campaign(resistance(MOTOR, rng), capture)) == ()


def test_one_sign_of_torque(rng: np.random.Generator) -> None:
    """Warned: motoring only, over all torque maps of the motor together."""
    motoring = with_rows(torque_map(MOTOR, rng), np.arange(16000) >= 8000)
    braking = with_rows(torque_map(MOTOR, rng), np.arange(16000) < 8000)
    other = resistance(MOTOR, rng)
    assert [f.code for f in agree(_campaign(motoring, other))] == ["current_coverage"]
    assert agree(_campaign(motoring, braking, other)) == ()


# --- options ----------------------------------------------------------------------------------


def test_options_override_and_switch_off(rng: np.random.Generator) -> None:
    """A gate's threshold and its switch are the configuration's."""
    capture = drive(MOTOR, rng)
    keep = np.ones(40000, dtype=bool)
    keep[5000:5300] = False
    lossy = with_rows(capture, keep)
    assert len(validate(lossy, {})[1]) == 1
    assert validate(lossy, {"dropped_samples": {"enabled": 0.0}})[1] == ()
    with pytest.raises(CaptureError, match="samples are missing"):
        validate(lossy, {"dropped_samples": {"refuse_share": 0.005}})


def test_refusals_are_merged(rng: np.random.Generator) -> None:
    """Refused once, by the first gate's code, with what the other gates say in the message."""
    capture = spin_down(MOTOR, rng)
    speed = np.full(2000, 9.5493 * 240.0)
    speed[::2] += 0.1
    error = refused(with_column(capture, "omega_mech_rad_s", speed))
    codes = {error.code} | {word.strip("[]") for word in error.message.split() if word[0] == "["}
    assert codes == {"speed_against_angle", "speed_coverage"}
