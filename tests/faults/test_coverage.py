"""Too slow, too little, too far off: one such fault at a time into a healthy capture."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.contracts.motor import agree
from pipeline.contracts.validate import validate
from pipeline.records.capture import Campaign
from tests.faults.healthy import (
    Motor,
    cogging,
    column,
    current_step,
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
    torque_table,
    with_column,
    with_rows,
)
from tests.faults.verdicts import refused, warned

MOTOR = Motor()


def test_slow_sampling_of_a_step(rng: np.random.Generator) -> None:
    """Warned at 5 samples a time constant, refused at 1: the figure is in the message."""
    capture = current_step(MOTOR, rng)
    rows = np.arange(3000)
    _, finding = warned(with_rows(capture, rows % 30 == 0))
    assert finding.code == "sampling_rate"
    assert float(finding.message.split()[0]) == pytest.approx(5.0, rel=0.25)
    assert refused(with_rows(capture, rows % 150 == 0)).code == "sampling_rate"


def test_a_step_without_a_sample_on_its_way(rng: np.random.Generator) -> None:
    """Refused: a row before and a row after the step, and the words count no samples."""
    capture = current_step(MOTOR, rng)
    current = np.abs(column(capture, "ia_a"))
    ends = np.isin(np.arange(current.size), [current.argmin(), current.argmax()])
    error = refused(with_rows(capture, ends))
    assert error.code == "sampling_rate"
    assert error.message.startswith("no sample falls on the way of the current")


def test_a_single_row(rng: np.random.Generator) -> None:
    """Refused: one value makes no fit."""
    error = refused(with_rows(spin_down(MOTOR, rng), np.arange(2000) == 0))
    assert "has 1 value; spin_down needs 2 at least" in error.message


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
    """Warned: without the way back friction cannot be separated from cogging."""
    whole = holding_current(MOTOR, rng)
    there = with_rows(whole, np.arange(6000) < 3000)
    for captures, expected in (((there,), ["direction_coverage"]), ((whole,), [])):
        codes = [f.code for f in agree(Campaign("m", captures))]
        assert [code for code in codes if code != "one_test_only"] == expected


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


@pytest.mark.parametrize("noise_a", [0.0, 1e-3])
def test_heat_run_without_current(rng: np.random.Generator, noise_a: float) -> None:
    """Refused: a winding that the room warms tells nothing of current; the refusal says so."""
    capture = heat_run(MOTOR, rng)
    for name in ("id_a", "iq_a"):
        capture = with_column(capture, name, rng.normal(0.0, noise_a, 9000))
    error = refused(capture)
    assert "no current leaves its noise" in error.message


def test_flux_map_of_one_line(rng: np.random.Generator) -> None:
    """Refused: one level of i_d shows no d inductance."""
    capture = flux_map(MOTOR, rng)
    line = with_rows(capture, column(capture, "id_a") == 0.0)
    assert refused(line).code == "current_coverage"


def test_torque_table_of_one_current_and_of_one_sense(rng: np.random.Generator) -> None:
    """Refused: one current gives no slope. Warned: one sense hides an offset in saturation."""
    capture = torque_table(MOTOR, rng)
    current = column(capture, "iq_a")
    one = with_column(capture, "iq_a", np.full(current.size, MOTOR.rated_a))
    assert refused(one).code == "current_coverage"
    found = validate(with_rows(capture, current > 0.0), {})[1]
    assert [f.code for f in found] == ["current_coverage"]
    assert validate(capture, {})[1] == ()
