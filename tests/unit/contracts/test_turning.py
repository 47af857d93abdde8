"""How far angle and voltages of a capture turn, and what that is known to."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.contracts.rotation import (
    line_voltage_vector,
    shaft_angle,
    turned_rad,
    turning,
)
from pipeline.numerics.integrals import trapezoid
from tests.unit.contracts.signals import VOLTS, turned
from tests.unit.contracts.test_gate_limits import TURN, capture


@pytest.mark.parametrize("names", [VOLTS, VOLTS[:2], VOLTS[1:], ("vab_v", "vca_v")])
def test_two_line_voltages_are_three(names) -> None:
    phase = np.linspace(0.0, 12.0, 900)
    whole = turned(VOLTS, phase)
    made = capture("open_circuit", **{n: whole[n] for n in names})
    found = line_voltage_vector(made)
    assert found is not None
    assert np.unwrap(np.angle(found[1])) == pytest.approx(phase, abs=1e-9)
    assert line_voltage_vector(capture("open_circuit", vab_v=whole["vab_v"])) is None
    blank = capture("open_circuit", vab_v=whole["vab_v"], vbc_v=np.full(900, np.nan))
    assert line_voltage_vector(blank) is None


def test_an_angle_on_another_clock_and_a_speed_instead() -> None:
    t = np.array([0.0, 1.0, 3.0, 4.0])
    angle = np.array([0.0, np.nan, 6.0, 7.0])
    made = capture("drive", t_s=t, theta_mech_rad=angle)
    assert shaft_angle(made, np.array([1.5, 3.5])) == pytest.approx([3.0, 6.5])
    assert np.isnan(shaft_angle(made, np.array([-0.1, 4.1]))).all()
    speed = capture("drive", t_s=t, omega_mech_rad_s=np.array([1.0, 3.0, 3.0, 1.0]))
    assert shaft_angle(speed, t) == pytest.approx([0.0, 2.0, 8.0, 10.0])
    assert trapezoid(t, np.array([1.0, 3.0, 3.0, 1.0])) == pytest.approx([0.0, 2.0, 8.0, 10.0])
    assert turned_rad(speed) == pytest.approx(10.0)
    assert turned_rad(capture("drive", theta_mech_rad=-angle)) == pytest.approx(7.0)
    assert turned_rad(capture("drive", iq_a=t)) is None
    lonely = capture("drive", t_s=t, theta_mech_rad=np.array([np.nan, 1.0, np.nan, np.nan]))
    assert shaft_angle(lonely, t) is None
    # an angle alone, or a speed alone, on whatever clock; the first table with either counts
    assert turned_rad(capture("drive", t_s=t, omega_mech_rad_s=-np.ones(4))) == pytest.approx(4.0)


def test_blocks_in_which_the_voltage_is_weak_say_nothing() -> None:
    """A tenth of the usual size: half the rows at 9 % turn the wrong way and do not count."""
    rows = 4000
    angle = np.linspace(0.0, 20.0, rows)
    for weak, expected in ((0.09, 5.0), (0.2, 2.0)):
        first = np.arange(rows) < rows // 2
        phase = np.where(first, 5.0 * angle, -1.0 * angle + 6.0 * angle[rows // 2])
        size = np.where(first, 1.0, weak)
        made = {n: v * size for n, v in turned(VOLTS, phase).items()}
        found = turning(capture("open_circuit", theta_mech_rad=angle, **made))
        assert found is not None
        assert found.cycles_per_turn == pytest.approx(expected, abs=0.06)
    assert found.top_hz == pytest.approx(5.0 * 20.0 / (rows * 1e-4) / TURN, rel=2e-3)
    few = capture("open_circuit", theta_mech_rad=angle[:15], **{n: v[:15] for n, v in made.items()})
    assert turning(few) is None
    still = capture("open_circuit", theta_mech_rad=np.ones(rows), **made)
    assert turning(still) is None


def test_sixteen_rows_are_two_blocks() -> None:
    angle = np.arange(16.0) * 0.1
    found = turning(capture("open_circuit", theta_mech_rad=angle, **turned(VOLTS, 3.0 * angle)))
    assert found is not None
    assert found.cycles_per_turn == pytest.approx(3.0)
    assert found.cycles == pytest.approx(4.5 / TURN)


def test_a_shaft_that_rests_at_first_still_shows_its_count() -> None:
    angle = np.concatenate([np.zeros(2000), np.linspace(0.0, 20.0, 4000)])
    found = turning(capture("open_circuit", theta_mech_rad=angle, **turned(VOLTS, 7.0 * angle)))
    assert found is not None
    assert found.cycles_per_turn == pytest.approx(7.0, rel=1e-6)


def test_a_short_record_has_blocks_of_eight_rows() -> None:
    """400 rows are 50 blocks: the scatter is that of their increments."""
    angle = np.linspace(0.0, 10.0, 400)
    phase = 5.0 * angle + 0.05 * np.sin(40.0 * angle)
    found = turning(capture("open_circuit", theta_mech_rad=angle, **turned(VOLTS, phase)))
    assert found is not None
    edges = np.linspace(0, 399, 51).astype(int)
    electrical, mechanical = np.diff(phase[edges]), np.diff(angle[edges])
    slope = mechanical @ electrical / (mechanical @ mechanical)
    left = electrical - slope * mechanical
    u = math.sqrt(left @ left / 49.0 / (mechanical @ mechanical))
    assert found.cycles_per_turn == pytest.approx(slope)
    assert found.u == pytest.approx(u)


def test_a_voltage_that_misses_a_row_is_there() -> None:
    phase = np.linspace(0.0, 12.0, 900)
    lines = turned(VOLTS, phase)
    lines["vbc_v"] = np.where(np.arange(900) == 7, np.nan, lines["vbc_v"])
    found = line_voltage_vector(capture("open_circuit", vab_v=lines["vab_v"], vbc_v=lines["vbc_v"]))
    assert found is not None
    assert np.count_nonzero(np.isfinite(found[1])) == 899
