"""Phases, signs, pole pairs and speed, one fault at a time into a healthy capture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.gates import phase_sum
from pipeline.contracts.requirements import LINE_CURRENTS
from pipeline.contracts.validate import validate
from pipeline.records.capture import Capture
from tests.faults.healthy import (
    Motor,
    capture_of,
    column,
    dq_columns,
    drive,
    hand_turn,
    open_circuit,
    spin_down,
    torque_map,
    with_column,
    with_rows,
)
from tests.faults.verdicts import refused, warned

MOTOR = Motor()


# --- phases ---------------------------------------------------------------------------------------


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


@pytest.mark.parametrize(
    ("u_rel", "codes"), [(None, ["current_sum"]), (0.01, []), (0.0, ["current_sum"])]
)
def test_only_stated_gains_excuse_a_sum(
    u_rel: float | None, codes: list[str], rng: np.random.Generator
) -> None:
    """5 % of one gain, 2.9 % as a sum: silent where 1 % is stated (k = 5), warned where none is."""
    capture = _three_currents(drive(MOTOR, rng), 1.05)
    capture = replace(capture, meta=replace(capture.meta, u_rel_current=u_rel))
    assert [finding.code for finding in validate(capture, {})[1]] == codes


@pytest.mark.parametrize("make", [drive, torque_map])
def test_two_line_currents_swapped(make, rng: np.random.Generator) -> None:
    """Refused: b and c exchanged, so that the currents turn against the shaft; silent in order."""
    healthy = _three_currents(make(MOTOR, rng), 1.0)
    assert validate(healthy, {})[1] == ()
    table = healthy.tables[0]
    swapped = table.with_columns(ib_a=table["ic_a"], ic_a=table["ib_a"])
    error = refused(replace(healthy, tables=(swapped,)))
    assert error.code == "swapped_phases"
    assert "line currents turn c-b-a" in error.message
    two = replace(healthy, tables=(swapped.drop("ia_a"),))
    assert refused(two).code == "swapped_phases"


def test_line_currents_sampled_too_slowly_are_not_called_swapped(rng: np.random.Generator) -> None:
    """Not refused: at 0.9 of the electrical frequency currents seem to turn back, slowly."""
    healthy = _three_currents(torque_map(MOTOR, rng), 1.0)
    rate_hz = 0.9 * MOTOR.pole_pairs * 0.4 * MOTOR.top_rad_s / (2.0 * np.pi)
    every = round(1.0 / (rate_hz * 5e-5))
    found = validate(with_rows(healthy, np.arange(16000) % every == 0), {})[1]
    assert "swapped_phases" not in [finding.code for finding in found]


def test_a_few_clean_rows_show_a_wrong_current_sum(rng: np.random.Generator) -> None:
    """Warned: a thousand rows are enough for 5 % of one gain where there is little noise."""
    few = with_rows(_three_currents(drive(MOTOR, rng), 1.05), np.arange(40000) < 1000)
    table = few.tables[0].select("ia_a", "ib_a", "ic_a")
    assert phase_sum.sum_share(table, LINE_CURRENTS, 3.0) > 0.01
    white = pl.DataFrame({name: rng.normal(size=1000) for name in LINE_CURRENTS})
    assert phase_sum.sum_share(white, LINE_CURRENTS, 0.0) == 0.0


def test_voltages_that_do_not_sum_to_zero(rng: np.random.Generator) -> None:
    """Refused: one probe at ten to one where the others are at one to one."""
    capture = open_circuit(MOTOR, rng)
    error = refused(with_column(capture, "vca_v", 10.0 * column(capture, "vca_v")))
    assert error.code == "voltage_sum"


# --- pole pairs, angle and speed ------------------------------------------------------------------


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
    ("kept", "factor", "words"),
    [
        ("theta_mech_rad", 180.0 / np.pi, "the angle is in degrees"),
        ("omega_mech_rad_s", 30.0 / np.pi, "the speed is in rpm"),
    ],
)
def test_cycles_a_turn_in_another_unit(
    kept: str, factor: float, words: str, rng: np.random.Generator
) -> None:
    """Refused: with nothing beside it a foreign unit still shows in the count of cycles a turn."""
    other = {"theta_mech_rad": "omega_mech_rad_s", "omega_mech_rad_s": "theta_mech_rad"}[kept]
    capture = open_circuit(MOTOR, rng)
    capture = replace(capture, tables=(capture.tables[0].drop(other),))
    error = refused(with_column(capture, kept, factor * column(capture, kept)))
    assert error.code == "pole_pairs_not_whole"
    assert f"{words}, which makes 7.0" in error.message


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


@pytest.mark.parametrize(
    ("still", "moving"),
    [("theta_mech_rad", "omega_mech_rad_s"), ("omega_mech_rad_s", "theta_mech_rad")],
)
def test_a_sensor_that_stands_while_the_shaft_turns(
    still: str, moving: str, rng: np.random.Generator
) -> None:
    """Refused: the sensor that stands still is named, and no unit is blamed for it."""
    capture = drive(MOTOR, rng)
    error = refused(with_column(capture, still, np.zeros(column(capture, still).size)))
    assert f"{still} says that the shaft stands while {moving}" in error.message
    assert "inf" not in error.message.split()
    assert "sensor" in error.remedy


def test_a_clock_in_milliseconds(rng: np.random.Generator) -> None:
    """Refused: the speed is 1000 times the angle's rate, and the clock is what is suspected."""
    capture = spin_down(MOTOR, rng)
    error = refused(with_column(capture, "t_s", 1e3 * column(capture, "t_s")))
    assert error.code == "speed_against_angle"
    assert "1000 times" in error.message
    assert "clock t_s is in ms" in error.message


def test_speed_against_angle_of_a_shaft_that_ends_where_it_began(rng: np.random.Generator) -> None:
    """Refused: a reversing drive turns as far back as forth, and is in rpm all the same."""
    capture = drive(MOTOR, rng)
    speed = 9.5493 * column(capture, "omega_mech_rad_s")
    error = refused(with_column(capture, "omega_mech_rad_s", speed))
    assert error.code == "speed_against_angle"


def test_speed_a_tenth_off(rng: np.random.Generator) -> None:
    """Warned, not refused: the speed is not needed where the angle is there."""
    capture = spin_down(MOTOR, rng)
    speed = 1.1 * column(capture, "omega_mech_rad_s")
    _, finding = warned(with_column(capture, "omega_mech_rad_s", speed))
    assert finding.code == "speed_against_angle"
    assert "1.1 times" in finding.message


def _loaded(rng: np.random.Generator, load_nm: float) -> Capture:
    """The drive with a load of this size on its shaft, which the current carries."""
    capture = drive(MOTOR, rng)
    load = load_nm * np.sign(np.sin(2.0 * np.pi * column(capture, "t_s") / 0.7))
    kt = 1.5 * MOTOR.pole_pairs * MOTOR.psi_wb
    noise = rng.normal(0.0, 1e-3, load.size)
    capture = with_column(capture, "iq_a", column(capture, "iq_a") + load / kt)
    return with_column(capture, "torque_shaft_nm", load + noise)


def test_torque_of_the_other_sign_in_a_drive_log(rng: np.random.Generator) -> None:
    """Refused as in a map; the healthy log is let through."""
    healthy = _loaded(rng, 0.5)
    assert validate(healthy, {})[1] == ()
    torque = -column(healthy, "torque_shaft_nm")
    assert refused(with_column(healthy, "torque_shaft_nm", torque)).code == "torque_sign"


@pytest.mark.parametrize("share", [1e-3, 0.1])
def test_a_drifting_torque_of_a_free_shaft_has_no_sign(
    share: float, rng: np.random.Generator
) -> None:
    """Let through: a transducer that drifts down while the current creeps up, on a free shaft."""
    healthy = drive(MOTOR, rng)
    ramp = np.linspace(0.0, 1.0, column(healthy, "t_s").size)
    current = column(healthy, "iq_a") * 0.1 + 0.2 * MOTOR.rated_a * ramp
    creeping = with_column(healthy, "iq_a", current)
    for torque in (-share * ramp, -1e-2 * share * current):
        noisy = torque + rng.normal(0.0, 1e-4 * share, ramp.size)
        validate(with_column(creeping, "torque_shaft_nm", noisy), {})
