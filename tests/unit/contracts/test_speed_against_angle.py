"""Every number of the gate of speed against angle from both sides, a few per cent away."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts.gates import (
    speed_against_angle,
)
from pipeline.numerics.integrals import trapezoid
from tests.unit.contracts.test_gate_limits import TURN, capture, noise, said


def ratio_of(ratio, turns=3.0, rows=2000, plate=None):
    angle = np.linspace(0.0, turns * TURN, rows)
    speed = np.full(rows, ratio * angle[-1] / ((rows - 1) * 1e-4))
    return capture("drive", theta_mech_rad=angle, omega_mech_rad_s=speed,
                   meta={"pole_pairs": plate})  # fmt: skip


@pytest.mark.parametrize(
    ("ratio", "expected"),
    [(1.029, ""), (1.031, "warned"), (1.195, "warned"), (1.205, "refused"), (0.971, ""),
     (0.969, "warned"), (0.805, "warned"), (0.795, "refused")],
)  # fmt: skip
def test_a_speed_off_the_angles(ratio: float, expected: str) -> None:
    assert said("speed_against_angle", ratio_of(ratio)) == expected


@pytest.mark.parametrize(("turns", "expected"), [(0.97, ""), (1.03, "refused")])
def test_less_than_a_turn_says_nothing_of_the_speed(turns: float, expected: str) -> None:
    """Of the larger of the two: the speed makes so many turns, the angle none."""
    rows = 2000
    speed = np.full(rows, turns * TURN / ((rows - 1) * 1e-4))
    made = capture("drive", theta_mech_rad=np.zeros(rows), omega_mech_rad_s=speed)
    assert said("speed_against_angle", made) == expected


@pytest.mark.parametrize(("name", "factor"), [
    ("the speed is in rpm", 60.0 / TURN), ("the speed was converted twice", TURN / 60.0),
    ("in degrees a second", 360.0 / TURN), ("the angle is in degrees", TURN / 360.0),
    ("the angle is in turns", TURN), ("in turns a second", 1.0 / TURN),
    ("t_s is in ms", 1e3), ("t_s is in µs", 1e6), ("sign turned", -1.0),
    ("the speed is electrical", 7.0), ("the angle is electrical", 1.0 / 7.0),
])  # fmt: skip
def test_the_unit_that_a_ratio_is(name: str, factor: float) -> None:
    """Two per cent around the exact factor, from the definition of the units."""
    for off in (0.981, 1.019):
        assert name in speed_against_angle._suspect(off * factor, 7)
    for off in (0.979, 1.021):
        assert name not in speed_against_angle._suspect(off * factor, 7)
    assert speed_against_angle._suspect(7.0, None) == ""
    assert speed_against_angle._suspect(1.0, 1) == ""


def over_angle(made):
    found = speed_against_angle.speed_over_angle(made, 1.0)
    return None if found is None else found[0]


@pytest.mark.parametrize(("share", "resting"), [(0.27, True), (0.23, False)])
def test_a_quarter_of_a_resting_speeds_power_is_white(share: float, resting: bool) -> None:
    """White noise of power 1 beside an offset of the rest."""
    white = noise(4000)
    power = float(np.mean((white - white.mean()) ** 2))
    offset = math.sqrt(1.0 / share - power)
    assert speed_against_angle.is_noise(white - white.mean() + offset) is resting


def test_few_rows_say_nothing_of_the_speed() -> None:
    for rows, there in ((39, False), (40, True)):
        made = ratio_of(2.0, rows=rows)
        assert (over_angle(made) is not None) is there
    flat = capture("drive", theta_mech_rad=np.zeros(99), omega_mech_rad_s=np.full(99, 2e4))
    assert over_angle(flat) == math.inf
    assert over_angle(ratio_of(1.7)) == pytest.approx(1.7)


def test_noise_of_a_resting_speed_is_no_motion() -> None:
    """The angle stands: integrated noise makes turns. It turns: the speed is held against it."""
    white = 40.0 * noise(4000)
    white -= white.mean()
    t_s = np.arange(4000) * 0.05
    resting = capture("drive", t_s=t_s, theta_mech_rad=np.zeros(4000), omega_mech_rad_s=white)
    assert np.abs(trapezoid(t_s, white)).max() > TURN
    assert over_angle(resting) is None
    angle = 1.0 * t_s
    moving = capture("drive", t_s=t_s, theta_mech_rad=angle, omega_mech_rad_s=white)
    assert over_angle(moving) is not None


def test_a_table_without_angle_or_too_short_is_passed_over() -> None:
    made = ratio_of(1.7)
    other = pl.DataFrame({"t_s": [0.0, 1.0], "iq_a": [0.0, 1.0]})
    still = made.tables[0].with_columns(pl.col("^(theta|omega)_.*$") * 0.01)
    late = replace(made, tables=(other, made.tables[0].head(9), still, *made.tables))
    assert over_angle(late) == pytest.approx(1.7)


@pytest.mark.parametrize(("ratio", "swing_rad", "warned"), [(0.95, 0.01, 1), (0.95, 0.6, 0)])
def test_a_shaft_that_swings_scatters_about_its_ratio(
    ratio: float, swing_rad: float, warned: int
) -> None:
    """It turns at 50 rad/s and swings seven times a record; a filter takes the speed's swing."""
    t_s = np.linspace(0.0, 1.0, 2000)
    swing = swing_rad * np.sin(2.0 * math.pi * 7.3 * t_s)
    made = capture(
        "drive",
        t_s=t_s,
        theta_mech_rad=50.0 * t_s + swing,
        omega_mech_rad_s=np.full(t_s.size, 50.0 * ratio),
    )
    options = speed_against_angle.GATE.options
    assert len(speed_against_angle.check(made, options).findings) == warned


def test_a_pause_that_nobody_states_is_not_integrated_over() -> None:
    """The speed of a swinging shaft is no straight line over the rows that are missing."""
    t = np.linspace(0.0, 4.0, 4001)
    t = t[(t < 1.0) | (t > 2.5)]
    w = 2.0 * np.pi * 0.5
    made = capture("drive", t_s=t, theta_mech_rad=30.0 * np.sin(w * t) / w,
                   omega_mech_rad_s=30.0 * np.cos(w * t))  # fmt: skip
    assert said("speed_against_angle", made) == ""
