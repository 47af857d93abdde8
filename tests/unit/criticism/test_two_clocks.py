"""Logs of a drive whose torque or angle is on a slower clock than its currents."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pipeline
from pipeline.criticism.data.acceleration import acceleration_at_samples, shows_acceleration
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from pipeline.simulator.effects import parameters
from tests.simulated import campaign_of, design

TESTS = ("drive_0", "torque_map_slow", "spin_down_forward", "open_circuit_forward", "resistance_ab")


TORQUE, ANGLE = "torque_shaft_nm", "theta_mech_rad"


def found(name: str, every: int, column: str = TORQUE, **effects: float) -> pipeline.Diagnosis:
    """Of a motor by five captures, a column of its drive in every n-th row alone."""
    motor = replace(design(name), effects={}).having(**effects)
    plan = tuple(step for step in CAMPAIGN if step[0] in TESTS)
    made = campaign_of(campaign(motor, Bench(), 5, plan))
    captures = []
    for log in made.captures:
        table = log.tables[0]
        tables = log.tables
        if log.meta.test in ("drive", "torque_map"):
            slow = table.select("t_s", column).gather_every(every)
            tables = (table.drop(column), slow)
        captures.append(replace(log, tables=tables))
    whole = replace(made, captures=tuple(captures))
    return pipeline.diagnose(pipeline.Recordings({"m": whole}))["m"]


@pytest.mark.parametrize(
    ("name", "every"),
    [
        ("gimbal-5208", 10),
        pytest.param("gimbal-5208", 2, marks=pytest.mark.slow),
        pytest.param("servo-ipm", 20, marks=pytest.mark.slow),
        pytest.param("joint-11p", 10, marks=pytest.mark.slow),
    ],
)
def test_a_sound_motor_is_quiet_whatever_the_clock_of_its_torque(name: str, every: int) -> None:
    """The noise of an acceleration at single samples made an inertia that multiplies it smaller,
    and the floor with it: J was a hundredth, at 31 floors.
    """
    diagnosis = found(name, every)
    assert (diagnosis.verdict, diagnosis.missing) == ("adequate", ())
    inertia = diagnosis.constants["j_rotor_kgm2"]
    assert inertia.value == pytest.approx(design(name).j_rotor_kgm2, rel=0.01)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torque_lag", "load_dependent_friction", "angle_eccentricity"])
def test_what_a_log_of_two_clocks_shows_is_named(name: str) -> None:
    size = parameters(name, replace(design("servo-ipm"), effects={}))["size"]
    diagnosis = found("servo-ipm", 5, **{name: size})
    assert (diagnosis.verdict, diagnosis.missing) == ("missing", (name,))


@pytest.mark.parametrize(
    ("name", "every"),
    [("servo-ipm", 10), pytest.param("joint-11p", 4, marks=pytest.mark.slow)],
)
def test_a_log_is_on_the_clock_of_its_angle(name: str, every: int) -> None:
    """An angle on straight lines jumps in pace at each of its samples, by orders of the torque and
    of the voltage: 1.2 and 2.9 floors, or a `torque_lag`.
    """
    diagnosis = found(name, every, ANGLE)
    assert (diagnosis.verdict, diagnosis.missing) == ("adequate", ())
    assert diagnosis.ladder[-1].held_out < 1.0


@pytest.mark.slow
def test_what_a_log_of_a_slow_angle_shows_is_named() -> None:
    size = parameters("saturation", replace(design("gimbal-5208"), effects={}))["size"]
    diagnosis = found("gimbal-5208", 4, ANGLE, saturation=size)
    assert (diagnosis.verdict, diagnosis.missing) == ("missing", ("saturation",))


@pytest.mark.parametrize(("bits", "shown"), [(28, True), (12, False)])
def test_an_acceleration_at_samples_is_known_by_a_fine_angle(bits: int, shown: bool) -> None:
    """By a coarse one its noise has more than a hundredth of its power."""
    period, every = 1e-4, 12
    t = period * np.arange(2000)
    step = 2.0 * np.pi / 2**bits
    theta = step * np.round((3.0 * t**2 + 0.01 * np.sin(200.0 * t)) / step)
    true = 6.0 - 400.0 * np.sin(200.0 * t)
    found = acceleration_at_samples(theta, period, every)[every:-every]
    assert (found == pytest.approx(true[every:-every], abs=10.0)) == shown
    assert shows_acceleration(theta, every, DEFAULT.cutting) == shown
    assert not shows_acceleration(theta[: 2 * every], every, DEFAULT.cutting)
