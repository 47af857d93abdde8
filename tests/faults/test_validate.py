"""Healthy captures, and the contract's columns, units and metadata, one fault at a time."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.protocol import Gate, Passed
from pipeline.contracts.registry import gates
from pipeline.contracts.requirements import requirements
from pipeline.contracts.validate import validate
from pipeline.physics.glossary import TESTS as TEST_NAMES
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError, merged
from tests.faults.healthy import (
    TESTS,
    Motor,
    column,
    current_step,
    drive,
    heat_run,
    open_circuit,
    resistance,
    spin_down,
    with_column,
    with_rows,
)
from tests.faults.verdicts import refused, warned

MOTOR = Motor()


# --- healthy captures -----------------------------------------------------------------------------


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


# --- the contract ---------------------------------------------------------------------------------


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
        ("current_step", "vab_v"),
        ("current_step", "t_s"),
        ("lcr", "lab_h"),
        ("open_circuit", "vab_v vbc_v vca_v"),
        ("hand_turn", "vab_v vbc_v"),
        ("cogging", "torque_shaft_nm"),
        ("torque_map", "omega_mech_rad_s theta_mech_rad"),
        ("torque_map", "iq_a"),
        ("torque_map", "torque_shaft_nm vq_v"),
        ("spin_down", "omega_mech_rad_s theta_mech_rad"),
        ("heat_run", "temp_winding_degc"),
        ("heat_run", "id_a"),
        ("holding_current", "iq_a"),
        ("flux_map", "psi_q_wb"),
        ("drive", "iq_a vq_v"),
        ("torque_table", "torque_shaft_nm"),
        ("drive", "theta_mech_rad omega_mech_rad_s"),
    ],
)
def test_missing_column(test: str, dropped: str, rng: np.random.Generator) -> None:
    """Refused: a capture without what its test holds at least says what is needed."""
    capture = TESTS[test](MOTOR, rng)
    table = capture.tables[0].drop(dropped.split(), strict=False)
    error = refused(replace(capture, tables=(table,)))
    assert error.code == "missing_column"
    assert error.message.startswith(f"{test} needs ")
    assert any(name in error.message.split("; the file has")[0] for name in dropped.split())


@pytest.mark.parametrize(
    ("test", "dropped"),
    [
        ("resistance", "temp_winding_degc"),
        ("open_circuit", "theta_mech_rad"),
        ("open_circuit", "omega_mech_rad_s"),
        ("open_circuit", "vca_v"),
        ("open_circuit", "vbc_v vca_v"),
        ("open_circuit", "theta_mech_rad omega_mech_rad_s vbc_v vca_v"),
        ("torque_map", "vd_v vq_v"),
        ("torque_map", "vd_v vq_v id_a"),
        ("torque_map", "torque_shaft_nm"),
        ("spin_down", "omega_mech_rad_s"),
        ("hand_turn", "theta_mech_rad vbc_v"),
        ("drive", "vd_v id_a torque_shaft_nm omega_mech_rad_s"),
        ("drive", "vd_v id_a iq_a torque_shaft_nm"),
        ("spin_down", "theta_mech_rad"),
    ],
)
def test_what_may_be_missing(test: str, dropped: str, rng: np.random.Generator) -> None:
    """Let through: a capture holds any subset beyond the least."""
    capture = TESTS[test](MOTOR, rng)
    table = capture.tables[0].drop(dropped.split(), strict=False)
    assert validate(replace(capture, tables=(table,)), {})[1] == ()


def test_column_without_a_value(rng: np.random.Generator) -> None:
    """Refused: a column of nothing but NaN is a missing column, and is named as empty."""
    capture = resistance(MOTOR, rng)
    error = refused(with_column(capture, "ia_a", np.full(3000, np.nan)))
    assert error.code == "missing_column"
    assert "without a value: ia_a" in error.message


def test_column_without_a_value_that_is_not_needed(rng: np.random.Generator) -> None:
    """Warned, and the column is as good as not there: two line voltages of three will do."""
    capture = open_circuit(MOTOR, rng)
    blank = with_column(capture, "vca_v", np.full(24000, np.nan))
    passed, finding = warned(blank)
    assert finding.code == "empty_column"
    assert "vca_v" in finding.message
    assert passed.columns == capture.columns - {"vca_v"}


@pytest.mark.parametrize(
    ("stated", "said"),
    [
        (None, ()),
        ("2026-01-05T08:00:00Z", ()),
        ("2026-01-05T08:00:00.250+00:00", ()),
        ("20260105T080000Z", ()),
        ("2026-01-05T08:00:00", ("started_at",)),
        ("2026-01-05T08:00:00+01:00", ("started_at",)),
        ("2026-01-05", ("started_at",)),
        ("05.01.2026 08:00", ("started_at",)),
        ("yesterday", ("started_at",)),
    ],
)
def test_start_of_the_recording(
    stated: str | None, said: tuple[str, ...], rng: np.random.Generator
) -> None:
    """Warned, never refused: a start that is not ISO 8601 with date, time and UTC."""
    capture = spin_down(MOTOR, rng)
    capture = replace(capture, meta=replace(capture.meta, started_at=stated))
    assert tuple(finding.code for finding in validate(capture, {})[1]) == said


def test_a_gate_that_breaks_refuses_by_name(
    rng: np.random.Generator, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Refused: what a gate could not judge is not let through, and no other exception comes out."""

    def breaks(capture: Capture, options: Mapping[str, float]) -> Passed:
        raise ZeroDivisionError(f"{capture.path} {len(options)}")

    odd = Gate("odd", ("drive", "spin_down"), breaks)
    monkeypatch.setattr("pipeline.contracts.validate.gates", lambda: (odd, *gates()))
    error = refused(drive(MOTOR, rng))
    assert error.code == "gate_failed"
    assert "odd broke on this capture: ZeroDivisionError" in error.message
    assert "gates.odd.enabled=0" in error.remedy
    still = with_rows(spin_down(MOTOR, rng), np.arange(2000) < 150)
    assert refused(still).code == "speed_coverage"


def test_current_of_the_other_line(rng: np.random.Generator) -> None:
    """Let through: the pair's current may be that of either of its two lines, not the third's.

    What goes into one line comes out of the other.
    """
    capture = resistance(MOTOR, rng)
    out = capture.tables[0].rename({"ia_a": "ib_a"})
    assert refused(replace(capture, tables=(out,))).code == "power_sign"
    other = out.with_columns(-pl.col("ib_a"))
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


# --- options --------------------------------------------------------------------------------------


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


def test_each_fault_stands_with_its_rows_and_its_remedy() -> None:
    """Refused once: code, rows and remedy are the first one's, the others keep theirs."""
    first = CaptureError("cause", "A is so", "mend A", (3, 5))
    others = [CaptureError("other", "B is so", "mend B", (7, 9)), CaptureError("c", "C", "mend A")]
    error = merged([first, *others])
    assert (error.code, error.rows, error.remedy) == ("cause", (3, 5), "mend A")
    assert error.message == "A is so; also [other] B is so (rows 7-9; mend B); also [c] C"


def test_a_cause_is_told_before_what_it_brings_about(rng: np.random.Generator) -> None:
    """Refused: a wrapped and a stuck angle make a wrong rate of the angle as well."""
    capture = spin_down(MOTOR, rng)
    angle = column(capture, "theta_mech_rad")
    wrapped = refused(with_column(capture, "theta_mech_rad", angle % (2.0 * np.pi)))
    assert wrapped.code == "wrapped_angle"
    assert "; also [speed_against_angle]" in wrapped.message
    assert "unwrap" in wrapped.remedy
    assert "leave it out" not in wrapped.remedy
    stuck = refused(with_column(capture, "theta_mech_rad", np.full(2000, 0.3)))
    assert stuck.code == "stuck_channel"
    assert stuck.rows == (0, 1999)
    assert "; also [speed_against_angle]" in stuck.message
