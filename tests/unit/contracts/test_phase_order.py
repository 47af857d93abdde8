"""Every number of the gate of the phase order from both sides, a few per cent away."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.contracts.gates import (
    phase_order,
)
from pipeline.contracts.rotation import (
    turning,
)
from tests.unit.contracts.signals import AMPS, VOLTS, turned
from tests.unit.contracts.test_gate_limits import GATES, TURN, capture, said


@pytest.mark.parametrize(("cycles", "expected"), [(0.97, ""), (1.03, "refused")])
def test_a_cycle_shows_a_sense_of_rotation(cycles: float, expected: str) -> None:
    angle = np.linspace(0.0, cycles * TURN / 5.0, 2000)
    made = capture("hand_turn", theta_mech_rad=angle, **turned(VOLTS, -5.0 * angle))
    assert said("phase_order", made) == expected
    right = capture("hand_turn", theta_mech_rad=angle, **turned(VOLTS, 5.0 * angle))
    assert said("phase_order", right) == ""


@pytest.mark.parametrize(("sigmas", "expected"), [(4.8, ""), (5.2, "refused")])
def test_a_sense_of_rotation_by_five_of_its_scatter(sigmas: float, expected: str) -> None:
    """Blocks of equal travel whose phase goes back by 1 ± d in turn: u = d/sqrt(n)."""
    options = GATES["phase_order"].options
    rows, blocks = 4001, 200
    each = 20
    d = math.sqrt(blocks - 1) / sigmas
    step = np.repeat(-1.0 - d * (-1.0) ** np.arange(blocks), each) * 0.02 / d
    phase = np.concatenate([[0.0], np.cumsum(step)])
    angle = np.arange(rows) * 0.02 / d
    made = capture("hand_turn", theta_mech_rad=angle, **turned(VOLTS, phase))
    found = turning(made)
    assert found is not None
    assert -found.cycles_per_turn / found.u == pytest.approx(sigmas, rel=0.01)
    assert found.cycles > options["cycles"]
    assert said("phase_order", made) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.97, "refused"), (1.03, "")])
def test_currents_that_turn_back_by_the_count_itself(share: float, expected: str) -> None:
    """Within a tenth of the stated count; within a fifth of a common part; from one cycle on."""
    angle = np.linspace(0.0, 20.0, 4000)

    def made(count=7.0, common=0.0, travel=angle, plate=7):
        lines = turned(AMPS, -count * travel)
        lines = {n: v + common for n, v in lines.items()}
        return capture("drive", theta_mech_rad=travel, meta={"pole_pairs": plate}, **lines)

    assert said("phase_order", made(7.0 * (1.0 + 0.1 * share))) == expected
    assert said("phase_order", made(7.0 * (1.0 - 0.1 * share))) == expected
    # a common part c of currents of 10: c / sqrt(50 + c^2) is a fifth at c = 1.443
    assert said("phase_order", made(common=1.4434 * share)) == expected
    short = np.linspace(0.0, TURN / 7.0 * 1.0 / share, 4000)
    assert said("phase_order", made(travel=short)) == expected
    assert said("phase_order", made(plate=None)) == ""
    assert said("phase_order", made(count=-7.0)) == ""


def test_the_common_share_by_hand() -> None:
    """1, 1, 4: mean 2 over an rms of sqrt(6)."""
    made = capture("drive", ia_a=np.ones(9), ib_a=np.ones(9), ic_a=np.full(9, 4.0))
    assert phase_order._common_share(made) == pytest.approx(2.0 / math.sqrt(6.0))
    assert phase_order._common_share(capture("drive", ia_a=1.0, ib_a=np.ones(9))) == 0.0
    assert phase_order._common_share(capture("drive", ia_a=0.0, ib_a=0.0, ic_a=np.zeros(9))) == 0.0


def frame(slope, *, d=0.0, swing=0.0, seed=0, scatter=0.0, rows=4000):
    """v_q = 0.4 i_q + slope w + 0.01 w i_d, with an i_d of d ± swing."""
    k = np.arange(rows) // (rows // 100)
    rng = np.random.default_rng(seed)
    speed, i_q = 100.0 + 50.0 * np.sin(0.7 * k), 4.0 * np.cos(1.9 * k)
    i_d = d + swing * np.sin(3.1 * k)
    error = rng.standard_normal(100)[k] * scatter
    return capture("torque_map", vq_v=0.4 * i_q + slope * speed + 0.01 * speed * i_d + error,
                   omega_mech_rad_s=speed, iq_a=i_q, id_a=i_d)  # fmt: skip


def test_the_slope_of_the_back_emf() -> None:
    assert phase_order.back_emf_slope(frame(0.03))[0] == pytest.approx(0.03)
    assert phase_order.back_emf_slope(frame(0.03, d=-1.0, swing=1.0))[0] == pytest.approx(0.03)
    # a steady d current may cancel the magnet: beyond a twentieth of the largest current
    assert phase_order.back_emf_slope(frame(0.03, d=0.21)) == (0.0, np.inf)
    assert phase_order.back_emf_slope(frame(0.03, d=0.19))[0] == pytest.approx(0.0319, rel=1e-3)
    # a swing of less than that is none: its own column is left out
    small = phase_order.back_emf_slope(frame(0.03, swing=0.09))
    assert small[0] == pytest.approx(0.03, rel=0.02)
    assert small[1] > 1e-6
    assert phase_order.back_emf_slope(frame(0.03, swing=0.11))[1] < 1e-6
    assert said("phase_order", frame(0.03)) == ""
    assert said("phase_order", frame(-0.03)) == "refused"
    few = frame(0.03).tables[0].head(99)
    assert phase_order.back_emf_slope(replace(frame(0.03), tables=(few,))) == (0.0, np.inf)


def test_a_slope_and_its_standard_error() -> None:
    """Against the normal equations without scaling."""
    rng = np.random.default_rng(3)
    x = rng.standard_normal((60, 3)) * np.array([1.0, 20.0, 0.05])
    y = x @ np.array([0.5, -0.1, 4.0]) + 0.3 * rng.standard_normal(60)
    slope, u = phase_order._first_slope(x, y)
    inverse = np.linalg.inv(x.T @ x)
    beta = inverse @ x.T @ y
    left = y - x @ beta
    assert slope == pytest.approx(beta[0])
    assert u == pytest.approx(math.sqrt(left @ left / 57.0 * inverse[0, 0]))
    assert phase_order._first_slope(np.column_stack([x[:, 0], 0.0 * y]), y) == (0.0, np.inf)


@pytest.mark.parametrize(("condition", "there"), [(970.0, True), (1030.0, False)])
def test_speeds_and_currents_that_go_together_show_no_slope(condition: float, there: bool) -> None:
    """Two unit columns at an angle a have condition 1/tan(a/2)."""
    half = math.atan(1.0 / condition)
    one, other = np.zeros(50), np.zeros(50)
    one[::2], other[1::2] = 1.0, 1.0
    x = np.column_stack([math.cos(half) * one + math.sin(half) * other,
                         math.cos(half) * one - math.sin(half) * other])  # fmt: skip
    assert np.linalg.cond(x) == pytest.approx(condition, rel=1e-3)
    assert np.isfinite(phase_order._first_slope(x, one)[1]) == there


@pytest.mark.parametrize(("sigmas", "expected"), [(0.9, ""), (1.1, "refused")])
def test_a_falling_voltage_by_five_of_its_scatter(sigmas: float, expected: str) -> None:
    """The scatter is chosen so that the slope is that many times five standard errors."""
    unit = frame(0.0, scatter=1.0, seed=4)
    u = phase_order.back_emf_slope(unit)[1]
    free = phase_order.back_emf_slope(unit)[0]
    made = frame(-5.0 * sigmas * u - free, scatter=1.0, seed=4)
    slope, same = phase_order.back_emf_slope(made)
    assert slope / same == pytest.approx(-5.0 * sigmas, rel=1e-6)
    assert said("phase_order", made) == expected


def test_a_steady_d_current_counts_by_its_largest() -> None:
    """0.19 to 0.21 of a limit of 0.2: some of it may cancel the magnet."""
    assert phase_order.back_emf_slope(frame(0.03, d=0.2, swing=0.02)) == (0.0, np.inf)
