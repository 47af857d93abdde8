"""Every number of a gate from both sides, a few per cent away, on captures made for it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.contracts import duplicates, motor
from pipeline.contracts.duplicates import _fingerprint, _holds, _same_rows, once
from pipeline.contracts.gates import (
    clock_jump,
    isolated_readings,
    phase_order,
    pole_pairs,
    saturation,
    speed_against_angle,
    stuck_channel,
    torque_sign,
)
from pipeline.contracts.rotation import (
    integral,
    line_voltage_vector,
    shaft_angle,
    turned_rad,
    turning,
)
from pipeline.contracts.schemas import check_columns, check_tables
from pipeline.contracts.validate import _slow_columns, _streams_apart, _without_blanks
from pipeline.records.capture import Campaign
from pipeline.records.errors import CaptureError
from tests.unit.contracts.test_gate_limits import GATES, TURN, capture, noise, said

VOLTS = ("vab_v", "vbc_v", "vca_v")
AMPS = ("ia_a", "ib_a", "ic_a")


def turned(names, phase, size=10.0):
    """Three signals of a vector that turns forward with the phase [n]."""
    return {n: size * np.cos(phase - k * TURN / 3.0) for k, n in enumerate(names)}


# Turning


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
    assert integral(t, np.array([1.0, 3.0, 3.0, 1.0])) == pytest.approx([0.0, 2.0, 8.0, 10.0])
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


# Phase order


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


# Clock


@pytest.mark.parametrize(("gap", "expected"), [(1.45, ""), (1.55, "refused")])
def test_a_gap_begins_at_one_and_a_half_intervals(gap: float, expected: str) -> None:
    rows = np.arange(200.0)
    t_s = np.where(rows < 100, rows, rows - 1.0 + gap) * 1e-3
    made = capture("drive", t_s=t_s, theta_mech_rad=rows * 0.01)
    assert said("clock_jump", made) == expected


@pytest.mark.parametrize(("skip", "expected"), [(1.95, "warned"), (2.05, "refused")])
def test_a_skip_below_the_time_bases_uncertainty_is_a_warning(skip: float, expected: str) -> None:
    """1 s of record at a relative 1e-3: one interval of 1 ms may be lost beside its own."""
    rows = np.arange(1001.0)
    t_s = np.where(rows < 500, rows, rows - 1.0 + skip) * 1e-3
    made = capture("drive", t_s=t_s, theta_mech_rad=rows * 0.01, meta={"u_rel_clock": 1e-3})
    assert said("clock_jump", made) == expected
    if expected == "warned":
        (finding,) = GATES["clock_jump"].check(made, GATES["clock_jump"].options).findings
        assert finding.rows == (499, 500)
        assert "goes on as after 0.001 s" in finding.message


def test_skips_add_up_over_gaps() -> None:
    """Two skips of 0.6 ms beyond their interval: each alone is within 1 ms, both are not."""
    rows = np.arange(1001.0)
    late = 0.6 * ((rows >= 300).astype(float) + (rows >= 600))
    made = capture("drive", t_s=(rows + late) * 1e-3, theta_mech_rad=rows * 0.01,
                   meta={"u_rel_clock": 1e-3})  # fmt: skip
    assert said("clock_jump", made) == "refused"
    one = capture("drive", t_s=(rows + 0.6 * (rows >= 300)) * 1e-3, theta_mech_rad=rows * 0.01,
                  meta={"u_rel_clock": 1e-3})  # fmt: skip
    assert said("clock_jump", one) == "warned"


@pytest.mark.parametrize(("sigmas", "expected"), [(7.7, ""), (8.3, "refused")])
def test_a_skip_stands_out_of_the_scatter_eight_times(sigmas: float, expected: str) -> None:
    """A line with a ripple of +-d on 25 rows a side, skipped by nine intervals of motion."""
    rows = np.arange(200)
    ripple = (-1.0) ** rows
    t_s = np.where(rows < 100, rows, rows + 9) * 1.0

    def shown(d):
        return capture("drive", t_s=t_s, theta_mech_rad=rows + d * ripple)

    d = 1.0
    for _ in range(40):
        values = rows + d * ripple
        left = clock_jump._line(t_s[75:100], values[75:100], 99.0)
        right = clock_jump._line(t_s[100:125], values[100:125], 109.0)
        scatter = math.hypot(left[2], right[2]) + 0.5 * abs(right[1] - left[1])
        moved = abs(right[0] - left[0] - 0.5 * (left[1] + right[1]) * 10.0)
        d *= moved / scatter / sigmas
    assert moved / scatter == pytest.approx(sigmas, rel=1e-3)
    assert said("clock_jump", shown(d)) == expected


def test_only_rows_near_a_gap_are_looked_at() -> None:
    """The line is through 25 rows: a bend before them does not count, one of the first does."""
    rows = np.arange(200.0)
    t_s = np.where(rows < 100, rows, rows + 9.0)
    options = GATES["clock_jump"].options
    for back, there in ((25, True), (24, False)):
        bend = np.where(rows < 100 - back, 30.0 * (100 - back - rows), 0.0)
        made = capture("drive", t_s=t_s, theta_mech_rad=rows + bend)
        table = made.tables[0]
        assert clock_jump._went_on(table, "theta_mech_rad", 99, 1.0, options) is there


# Speed against angle


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
        assert (speed_against_angle.speed_over_angle(made, 1.0) is not None) is there
    flat = capture("drive", theta_mech_rad=np.zeros(99), omega_mech_rad_s=np.full(99, 2e4))
    assert speed_against_angle.speed_over_angle(flat, 1.0) == math.inf
    assert speed_against_angle.speed_over_angle(ratio_of(1.7), 1.0) == pytest.approx(1.7)


# Torque sign


def blocks(x, y, **more):
    """A hundred blocks of ten rows each."""
    wide = {n: np.repeat(v, 10) for n, v in {"iq_a": x, "torque_shaft_nm": y, **more}.items()}
    return capture("drive" if more else "torque_map", **wide)


@pytest.mark.parametrize(("correlation", "expected"), [(-0.49, ""), (-0.51, "refused"), (0.9, "")])
def test_a_torque_that_falls_with_its_current(correlation: float, expected: str) -> None:
    k = np.arange(100)
    x, other = np.cos(TURN * k / 100.0), np.sin(TURN * k / 100.0)
    y = correlation * x + math.sqrt(1.0 - correlation**2) * other
    assert said("torque_sign", blocks(5.0 * x, 0.3 * y)) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.19, ""), (0.21, "refused")])
def test_a_drive_falls_by_a_fifth_of_what_its_voltage_promises(share: float, expected: str) -> None:
    """1.5 * 2 V / 30 rad/s promise 0.1 N.m an ampere; slow rows promise nothing."""
    k = np.arange(100)
    x = np.cos(TURN * 7 * k / 100.0)
    speed = np.where(k % 3 == 0, 14.0, 30.0)
    volts = np.where(k % 3 == 0, 50.0, 2.0)
    drift = 0.4 * (k / 100.0) ** 2
    made = blocks(x, -share * 0.1 * x + drift, vq_v=volts, omega_mech_rad_s=speed)
    assert said("torque_sign", made) == expected


def test_a_parabola_in_time_is_taken_off() -> None:
    t = np.linspace(-1.0, 1.0, 50)
    wave = np.sin(40.0 * t)
    both = np.column_stack([3.0 + 2.0 * t - 5.0 * t**2, wave])
    left = torque_sign._without_drift(both)
    assert left[:, 0] == pytest.approx(0.0, abs=1e-9)
    basis = np.vander(t, 3)
    assert basis.T @ left[:, 1] == pytest.approx(0.0, abs=1e-9)
    assert np.abs(left[:, 1]).max() > 0.5
    still = np.zeros(5)
    assert torque_sign._promised_nm_a(still, still) == np.inf
    assert torque_sign._promised_nm_a(np.full(5, -2.0), np.full(5, 30.0)) == pytest.approx(0.1)


# Stuck and cut


OPTIONS = {name: GATES[name].options for name in GATES}


@pytest.mark.parametrize(("fall", "frozen"), [(0.19, False), (0.21, True)])
def test_zeros_count_where_the_signal_drops_to_them_from_afar(fall: float, frozen: bool) -> None:
    """Range ±5: a fifth is 2."""
    rng = np.random.default_rng(1)
    values = rng.uniform(-4.9, 4.9, 4000)
    values[:2] = -5.0, 5.0
    values[999] = 10.0 * fall
    values[1000:1200] = 0.0
    rows = stuck_channel.frozen_rows(values, OPTIONS["stuck_channel"])
    assert np.count_nonzero(rows) == (200 if frozen else 0)
    start = np.concatenate([np.zeros(200), values[:800], values[1200:-1], [4.9]])
    assert not stuck_channel.frozen_rows(start, OPTIONS["stuck_channel"]).any()


@pytest.mark.parametrize(("share", "expected"), [(0.19, "warned"), (0.21, "refused")])
def test_a_fifth_of_the_rows_may_stand_still(share: float, expected: str) -> None:
    rng = np.random.default_rng(2)
    values = rng.standard_normal(5000)
    values[1000 : 1000 + round(share * 5000)] = 0.5
    made = capture("drive", iq_a=values, vq_v=rng.standard_normal(5000))
    assert said("stuck_channel", made) == expected
    dead = capture("drive", iq_a=np.ones(500), vq_v=values[:500])
    assert said("stuck_channel", dead) == "refused"


@pytest.mark.parametrize(("repeats", "settles"), [(24, False), (25, True)])
def test_a_signal_that_repeats_beside_a_run_settles(repeats: int, settles: bool) -> None:
    """Of the 49 steps of the 50 rows before it, more than half repeat."""
    rng = np.random.default_rng(5)
    before = np.cumsum(np.concatenate([[1.0], np.where(np.arange(49) < repeats, 0.0, 0.01)]))
    values = np.concatenate(
        [rng.standard_normal(60), before, np.full(30, 7.0), rng.standard_normal(60)]
    )
    assert stuck_channel._settles(values, 110, 30) is settles
    turned = values[::-1]
    assert stuck_channel._settles(turned, 60, 30) is settles


def cut(values, stop):
    return np.clip(values, -stop, stop)


@pytest.mark.parametrize(("share", "expected"), [(0.045, "warned"), (0.056, "refused")])
def test_a_twentieth_of_the_rows_may_be_cut(share: float, expected: str) -> None:
    """A sine of steps all its own, cut at the height that the share leaves."""
    wave = np.sin(np.arange(20000) * 0.0123456) * 10.0
    stop = float(np.quantile(np.abs(wave), 1.0 - share))
    made = capture("drive", iq_a=cut(wave, stop), vq_v=np.cos(np.arange(20000) * 0.1))
    assert np.mean(np.abs(cut(wave, stop)) == stop) == pytest.approx(share, abs=0.002)
    assert said("saturation", made) == expected


@pytest.mark.parametrize(("inside", "found"), [(49, False), (51, True)])
def test_fewer_than_a_twentieth_between_the_extremes_are_two_levels(
    inside: int, found: bool
) -> None:
    values = np.repeat([5.0, 0.0, -5.0], [475, inside, 525 - inside])
    values[475 : 475 + inside] = np.random.default_rng(0).uniform(-4.0, 4.0, inside)
    rows = saturation.clipped_rows(values, OPTIONS["saturation"])
    assert bool(rows.any()) is found


@pytest.mark.parametrize(("pace", "found"), [(1.9, False), (2.1, True)])
def test_a_cut_signal_comes_at_its_full_pace(pace: float, found: bool) -> None:
    """Codes of 1: the samples next to the flat stretch move by `pace` codes."""
    rise = np.arange(0.0, 60.0) * pace
    fine = np.array([0.0, 1.0] * 20)
    values = np.concatenate([-fine - 1.0, rise, np.full(40, 60.0 * pace), rise[::-1], -fine - 1.0])
    assert saturation.clipped_rows(values, OPTIONS["saturation"]).any() == found


@pytest.mark.parametrize(("length", "found"), [(2, False), (3, True)])
def test_two_equal_peaks_are_chance(length: int, found: bool) -> None:
    rng = np.random.default_rng(0)
    values = rng.uniform(-1.0, 1.0, 100)
    values[50 : 50 + length] = 2.0
    rows = saturation.clipped_rows(values, {**OPTIONS["saturation"], "chance": 0.99})
    assert np.count_nonzero(rows) == (length if found else 0)
    assert not saturation.clipped_rows(
        values[30:79], {**OPTIONS["saturation"], "chance": 0.99}
    ).any()


@pytest.mark.parametrize(("chance", "found"), [(1e-5, False), (1e-3, True)])
def test_a_cut_stretch_is_longer_than_chance_allows(chance: float, found: bool) -> None:
    """A tenth repeats inside: 1000 * 0.1^(L - 1) is 1e-4 for a run of eight."""
    rng = np.random.default_rng(6)
    values = rng.uniform(-1.0, 1.0, 1000)
    values[10::10] = values[9:-1:10]
    values[500:508] = 2.0
    rows = saturation.clipped_rows(values, {**OPTIONS["saturation"], "chance": chance})
    assert bool(rows.any()) is found


def test_the_pace_beside_a_flat_stretch_is_of_eight_steps_a_side() -> None:
    steps = np.arange(100.0)
    flat = np.zeros(101, dtype=bool)
    flat[40:50] = True
    # 32 to 39 before it and 49 to 56 after it; the steps inside are none
    assert saturation._pace_beside(steps, flat) == 44.0
    assert saturation._pace_beside(steps, np.roll(flat, -38)) == 13.5  # 0, 1 and 11 to 18


# Isolated readings


@pytest.mark.parametrize(("times", "count"), [(7.9, 0), (8.1, 1)])
def test_a_reading_alone_leaves_by_eight_times_what_is_usual(times: float, count: int) -> None:
    """A ramp of one a row, both ways: 99 % depart by nothing, the usual step is 1."""
    values = np.arange(1000.0)
    values[500] += times + 1.0
    # neighbours differ by 2, so the departure of `times` (to the next row) is against 2
    assert np.count_nonzero(isolated_readings.isolated(values, 8.0)) == 0
    values[500] = 500.0 + 2.0 * times + 1.0
    assert np.count_nonzero(isolated_readings.isolated(values, 8.0)) == count
    assert np.count_nonzero(isolated_readings.isolated(-values, 8.0)) == count
    flat = np.zeros(1000)
    flat[::2] = 0.1
    flat[501] = -0.1 * times
    assert np.count_nonzero(isolated_readings.isolated(flat, 8.0)) <= 1


def test_a_quantum_is_usual() -> None:
    """A shaft that rests and steps by one code now and then: seven codes are no stranger."""
    stairs = np.floor(np.arange(1000) / 100.0)
    for codes, count in ((8.0, 0), (9.0, 1)):
        values = stairs.copy()
        values[350] += codes
        assert np.count_nonzero(isolated_readings.isolated(values, 8.0)) == count


@pytest.mark.parametrize(("rows", "interval", "expected"), [
    (499, 1e-3, ""), (500, 1e-3, "warned"), (600, 0.0205, ""), (600, 0.0195, "warned"),
])  # fmt: skip
def test_isolated_readings_need_rows_and_a_rate(rows: int, interval: float, expected: str) -> None:
    t_s = np.arange(rows) * interval
    speed = 50.0 + np.arange(rows) * 0.01
    speed[200] = 0.0
    made = capture("drive", t_s=t_s, omega_mech_rad_s=speed)
    assert said("isolated_readings", made) == expected
    if expected:
        passed = GATES["isolated_readings"].check(made, OPTIONS["isolated_readings"])
        assert "the first 0 between 51.99 and 52.01" in passed.findings[0].message
        assert np.flatnonzero(~passed.masks[0].keep).tolist() == [200]


# Pole pairs


def geared(count, *, cycles=30.0, ripple=0.0, plate=None, rows=8001):
    angle = np.linspace(0.0, cycles * TURN / count, rows)
    phase = count * angle + ripple * np.sin(np.linspace(0.0, 5.0, rows))
    return capture("open_circuit", theta_mech_rad=angle, meta={"pole_pairs": plate},
                   **turned(VOLTS, phase))  # fmt: skip


@pytest.mark.parametrize(
    ("count", "cycles", "expected"),
    [(7.019, 30.0, ""), (7.021, 30.0, "warned"), (6.981, 30.0, ""), (6.979, 30.0, "warned"),
     (7.3, 2.97, ""), (7.3, 3.03, "warned")],
)  # fmt: skip
def test_a_count_is_whole_to_a_fiftieth(count: float, cycles: float, expected: str) -> None:
    assert said("pole_pairs", geared(count, cycles=cycles)) == expected


@pytest.mark.parametrize(
    ("plate", "words"),
    [(7, None), (14, "number of poles"), (8, "nameplate says 8"), (None, None)],
)
def test_a_count_against_the_nameplate(plate, words) -> None:
    passed = GATES["pole_pairs"].check(geared(7.0, plate=plate), OPTIONS["pole_pairs"])
    assert [f.code for f in passed.findings] == ["pole_pairs_nameplate"] * (words is not None)
    if words:
        assert words in passed.findings[0].message
        assert ("number of poles" in passed.findings[0].message) is (plate == 14)


def test_the_unit_in_which_a_count_is_whole() -> None:
    """Degrees or rpm scale a count by 180/pi or 30/pi; a slip may meet a factor by chance."""
    degrees, rpm = math.pi / 180.0, math.pi / 30.0
    unit = pole_pairs._unit
    assert "degrees, which makes 7.000" in unit(7.0 * degrees, 0.0, 0.02, None)
    # what is whole in rpm is so in degrees too, six times as many: the nameplate tells
    assert unit(3.0 * rpm, 0.0, 0.02, 3) == "the speed is in rpm, which makes 3.000"
    assert unit(3.0 * rpm, 0.0, 0.02, 18) == "the angle is in degrees, which makes 18.000"
    assert "makes 18.000, or the speed is in rpm, which" in unit(3.0 * rpm, 0.0, 0.02, None)
    # rpm makes of 9 a count of 0.94: only the nameplate tells it from a slip
    assert unit(9.0 * rpm, 0.0, 0.02, None) == ""
    assert "9.000" in unit(9.0 * rpm, 0.0, 0.02, 9)
    assert unit(7.019 * degrees, 0.0, 0.02, None) != ""
    assert unit(7.021 * degrees, 0.0, 0.02, None) == ""
    # two u of the count in that unit widen it; where u there is a tenth, nothing is said
    assert unit(7.05 * degrees, 0.016 * degrees, 0.02, None) != ""
    assert unit(7.0 * degrees, 0.099 * degrees, 0.02, None) != ""
    assert unit(7.0 * degrees, 0.101 * degrees, 0.02, None) == ""
    assert unit(0.01 * degrees, 0.0, 0.02, None) == ""
    # 28 and 29 degrees are below one half of a count, 30 are not
    assert unit(28.0 * degrees, 0.0, 0.02, None) != ""
    assert unit(30.0 * degrees, 0.0, 0.02, None) == ""


# Duplicates


def rows_of(values, path="a.csv", **meta):
    made = capture("drive", path=path, iq_a=np.asarray(values), meta=meta)
    return replace(made, integrity="unverified")


def test_a_run_that_holds_another() -> None:
    long = np.arange(100.0)
    assert _holds(long, long[40:60])
    assert _holds(long[40:60], long)
    assert _holds(long, long[40:60] + 0.9e-6 * 99.0)
    assert not _holds(long, long[40:60] + 1.1e-6 * 99.0)
    # all but a tenth of the shorter one may run over the end
    assert _holds(long, np.arange(91.0, 101.0))
    assert not _holds(long, np.arange(92.0, 102.0))
    wrong = long[40:60].copy()
    wrong[7] += 1.0
    assert not _holds(long, wrong)
    # the first value stands in other places before, and too near to the end after that
    repeated = np.concatenate([[40.0, 0.0], long])
    assert _holds(repeated, long[40:60])
    often = np.concatenate([np.tile([40.0, 1.0], duplicates.POLICY.begins), long])
    assert not _holds(often, long[40:60])
    assert _holds(often[2:], long[40:60])


def test_rows_are_known_by_columns_of_six_values() -> None:
    few, enough = np.arange(60.0) % 5, np.arange(60.0) % 6
    made = capture("drive", iq_a=few, id_a=enough, vq_v=np.ones(60))
    assert set(_fingerprint(made)) == {"id_a"}
    holed = np.where(np.arange(60) == 3, np.nan, np.arange(60.0))
    assert _fingerprint(capture("drive", iq_a=holed))["iq_a"].size == 59
    one, two = {"a": np.arange(9.0)}, {"a": np.arange(9.0), "b": np.arange(9.0)}
    assert _same_rows(two, one)
    assert _same_rows(one, two)
    assert not _same_rows({"a": one["a"], "c": one["a"]}, two)
    assert not _same_rows({}, two)
    assert not _same_rows({"a": one["a"], "b": 2.0 * one["a"]}, two)


def test_of_two_recordings_the_longer_then_the_verified_then_the_first_counts() -> None:
    values = np.arange(50.0)
    kept, found = once([rows_of(values[:40], "a.csv"), rows_of(values, "b.csv")])
    assert [c.path for c in kept] == ["b.csv"]
    assert "all its rows stand in b.csv" in found[0].message
    sealed = replace(rows_of(values, "c.csv"), integrity="verified")
    kept, found = once([rows_of(values, "b.csv"), sealed])
    assert [c.path for c in kept] == ["c.csv"]
    assert "it holds the rows of c.csv" in found[0].message
    kept, found = once([rows_of(values, "b.csv", lot="L1"), rows_of(values, "a.csv")])
    assert [c.path for c in kept] == ["a.csv"]
    assert "whose lot differ" in found[0].message
    kept, found = once([rows_of(values, "b.csv"), rows_of(values[::-1], "a.csv")])
    assert [c.path for c in kept] == ["a.csv", "b.csv"]
    assert found == ()


# One motor's captures


def test_time_constants_of_steps_count_where_there_is_an_edge() -> None:
    """t_s a hundred times slower is named; with two of each, both are, the usual in between."""
    t = np.arange(-2000, 8000)
    current = np.where(t > 0, -np.expm1(-t / 1000.0), 0.0)

    def step(scale, path):
        return capture("current_step", path=path, ia_a=current, t_s=t * 1e-6 * scale)

    flat = capture("current_step", path="flat.csv", ia_a=np.full(9, 2.0), t_s=np.arange(9.0))
    assert motor._settling_s(step(1.0, "a")) == pytest.approx(1e-3, rel=0.01)
    assert motor._settling_s(flat) == math.inf
    made = (step(1.0, "a.csv"), step(1.0, "b.csv"), step(130.0, "c.csv"), flat)
    found = [f for f in motor.agree(Campaign("m", made)) if f.code == "clock_contradiction"]
    assert [f.file for f in found] == ["c.csv"]
    assert "settles in 0.13 s, where 0.000999 s is usual" in found[0].message


def test_what_captures_state_differently_is_named() -> None:
    def stated(path, value):
        extra = {} if value is None else {"r_phase_ohm": f"{value}", "u_r_phase_ohm": "0.01"}
        return capture("drive", path=path, iq_a=1.0, meta={"extra": extra})

    made = (stated("a.csv", None), stated("b.csv", 0.5), stated("c.csv", 0.7), stated("d.csv", 0.5))
    found = [f for f in motor.agree(Campaign("m", made)) if f.code == "statement_contradiction"]
    assert [f.file for f in found] == ["c.csv"]
    assert "stated as 0.7, but as 0.5" in found[0].message
    assert "in b.csv and 1 more" in found[0].message


# Tables


def test_slow_streams_have_a_table_of_their_own() -> None:
    """Half of the rows is dense; a value in every row of a part is no slow stream."""
    size = 400
    t_s = np.arange(size) * 1e-3
    every = np.where(np.arange(size) % 3 == 0, 1.0 * t_s, np.nan)
    early = np.where(np.arange(size) < 100, t_s, np.nan)
    table = pl.DataFrame({"t_s": t_s, "iq_a": t_s, "temp_case_degc": every, "id_a": early})
    assert _slow_columns(table, 0.5) == ["temp_case_degc"]
    assert _slow_columns(table, 0.3) == []
    assert _slow_columns(table.drop("iq_a"), 0.5) == []
    made = replace(capture("drive", iq_a=t_s), tables=(table,))
    parted = _streams_apart(made, 0.5)
    assert [t.columns for t in parted.tables] == [
        ["t_s", "iq_a", "id_a"],
        ["t_s", "temp_case_degc"],
    ]
    assert parted.tables[1].height == 134
    assert parted.tables[1]["t_s"][1] == pytest.approx(3e-3)
    assert _streams_apart(made, 0.3) is made


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


# Other limits


@pytest.mark.parametrize(("volts", "expected"), [(1.9e-3, "warned"), (2.1e-3, ""), (990.0, ""),
                                                 (1010.0, "warned")])  # fmt: skip
def test_resistances_that_windings_have(volts: float, expected: str) -> None:
    for pair, line in (("ab", "ia_a"), ("bc", "ic_a")):
        columns = {f"v{pair}_v": np.full(99, volts), line: np.full(99, -1.0)}
        made = capture("resistance", meta={"pair": pair}, **columns)
        assert said("plausible_terminals", made) == expected


@pytest.mark.parametrize(("volts", "expected"), [(26.3, ""), (26.5, "warned")])
def test_a_voltage_above_its_link(volts: float, expected: str) -> None:
    made = capture("current_step", vab_v=np.full(99, -volts), ia_a=1.0, meta={"vdc_v": 24.0})
    assert said("plausible_terminals", made) == expected


@pytest.mark.parametrize(("per", "expected"), [(2.45, "refused"), (2.55, "warned"),
                                               (4.9, "warned"), (5.1, "")])  # fmt: skip
def test_samples_an_electrical_period_of_a_spin(per: float, expected: str) -> None:
    """By the voltages themselves where there is an angle, else by the stated pole pairs."""
    phase = np.arange(2000) * TURN / per
    made = capture("open_circuit", theta_mech_rad=phase / 5.0, **turned(VOLTS, phase))
    assert said("sampling_rate", made) == expected
    speed = np.full(400, TURN / (5.0 * per * 1e-4))
    stated = capture("open_circuit", omega_mech_rad_s=speed, vab_v=np.zeros(400),
                     meta={"pole_pairs": 5})  # fmt: skip
    assert said("sampling_rate", stated) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.098, "warned"), (0.102, "refused"),
                                                 (0.0098, ""), (0.0102, "warned")])  # fmt: skip
def test_a_sum_of_the_lines(share: float, expected: str) -> None:
    """A steady sum s of currents of rms 1 a line: s over sqrt(3) of them."""
    phase = np.linspace(0.0, 300.0 * TURN, 20001)
    size = share * math.sqrt(3.0 * 0.5) / 3.0
    lines = {n: v + size / math.sqrt(1.0 - share**2 / 3.0) for n, v in
             turned(AMPS, phase, 1.0).items()}  # fmt: skip
    made = capture("drive", **lines)
    assert said("phase_sum", made) == expected
    volts = capture("drive", **dict(zip(VOLTS, lines.values(), strict=True)))
    assert said("phase_sum", volts) == expected


@pytest.mark.parametrize(("share", "expected"), [(0.049, ""), (0.051, "warned")])
def test_five_times_a_stated_gain_excuses_a_sum(share: float, expected: str) -> None:
    phase = np.linspace(0.0, 300.0 * TURN, 20001)
    size = share * math.sqrt(1.5) / 3.0 / math.sqrt(1.0 - share**2 / 3.0)
    lines = {n: v + size for n, v in turned(AMPS, phase, 1.0).items()}
    assert said("phase_sum", capture("drive", meta={"u_rel_current": 0.01}, **lines)) == expected


@pytest.mark.parametrize(("times", "expected"), [(2.9, ""), (3.1, "warned")])
def test_a_sum_within_three_of_its_noise_is_any_channels(times: float, expected: str) -> None:
    phase = np.linspace(0.0, 300.0 * TURN, 20001)
    white = noise(20001)
    white -= white.mean()
    lines = turned(AMPS, phase, 40.0)
    lines["ia_a"] = lines["ia_a"] + white + times
    assert said("phase_sum", capture("drive", **lines)) == expected


@pytest.mark.parametrize(("upper", "expected"), [(1.0515, "warned"), (1.0575, "")])
def test_levels_of_current_a_twentieth_apart(upper: float, expected: str) -> None:
    """0.049 and 0.054 of the larger."""
    current = np.repeat([1.0, upper], 500)
    made = capture("resistance", ia_a=-current, vab_v=-current)
    assert said("current_coverage", made) == expected


def test_two_levels_of_both_currents_make_a_flux_map() -> None:
    two, one = np.array([0.0, 1.0, 0.0, 1.0]), np.zeros(4)
    assert said("current_coverage", capture("flux_map", id_a=two, iq_a=two[::-1])) == ""
    assert said("current_coverage", capture("flux_map", id_a=one, iq_a=two)) == "refused"
    assert said("current_coverage", capture("flux_map", id_a=two, iq_a=one)) == "refused"
    assert said("current_coverage", capture("flux_map", id_a=two)) == ""


def test_a_line_without_current_is_passed_over() -> None:
    """A dead first line: the pair's other one tells the resistance."""
    for volts, expected in ((1.0, ""), (1e-3, "warned")):
        made = capture("resistance", vab_v=np.full(99, volts), ia_a=0.0, ib_a=-1.0)
        assert said("plausible_terminals", made) == expected


@pytest.mark.parametrize(("u", "expected"), [(0.097, "warned"), (0.103, "")])
def test_a_count_that_is_known_to_a_tenth(u: float, expected: str) -> None:
    """Blocks of equal travel of 7.3 ± d cycles a turn: u = d/sqrt(n - 1)."""
    blocks, each = 200, 20
    d = u * math.sqrt(blocks - 1)
    step = np.repeat(7.3 + d * (-1.0) ** np.arange(blocks), each) * 0.01
    angle = np.arange(blocks * each + 1) * 0.01
    phase = np.concatenate([[0.0], np.cumsum(step)])
    made = capture("open_circuit", theta_mech_rad=angle, **turned(VOLTS, phase))
    found = turning(made)
    assert found is not None
    assert found.u == pytest.approx(u, rel=0.01)
    assert said("pole_pairs", made) == expected


def test_fewer_rows_than_blocks_say_nothing_of_the_torque() -> None:
    for rows, expected in ((99, ""), (100, "refused")):
        x = np.cos(np.arange(rows) * 0.7)
        made = capture("torque_map", iq_a=x, torque_shaft_nm=-x)
        assert said("torque_sign", made) == expected


def test_a_shaft_that_rests_at_first_still_shows_its_count() -> None:
    angle = np.concatenate([np.zeros(2000), np.linspace(0.0, 20.0, 4000)])
    found = turning(capture("open_circuit", theta_mech_rad=angle, **turned(VOLTS, 7.0 * angle)))
    assert found is not None
    assert found.cycles_per_turn == pytest.approx(7.0, rel=1e-6)


@pytest.mark.parametrize("gate", ["stuck_channel", "saturation"])
def test_a_run_is_by_chance_at_one_in_a_million(gate: str) -> None:
    """Half of the samples repeat: a run just shorter than 1 + log(1e-6/n)/log(p) is chance."""
    from pipeline.contracts.waveform import longest_likely_run

    found = {}
    for repeats in range(340, 410):
        rng = np.random.default_rng(repeats)
        values = rng.uniform(-1.0, 1.0, 1000)
        pairs = rng.permutation(np.r_[1:440:2, 601:1000:2])[:repeats]  # none beside the run
        values[pairs] = values[pairs - 1]
        for length in range(22, 30):
            one = values.copy()
            one[500 : 500 + length] = 0.3 if gate == "stuck_channel" else 1.5
            inside = one if gate == "stuck_channel" else one[one != 1.5]
            inside = inside if gate == "stuck_channel" else inside[inside != inside.min()]
            found[repeats, length] = (longest_likely_run(inside, 1e-6) - length, one)
    near = {k: v for k, v in found.items() if abs(v[0]) < 0.12}
    assert {v[0] > 0.0 for v in near.values()} == {True, False}
    rows_of_ = {"stuck_channel": stuck_channel.frozen_rows, "saturation": saturation.clipped_rows}
    for over, values in near.values():
        assert bool(rows_of_[gate](values, OPTIONS[gate]).any()) is (over < 0.0)


def test_a_table_without_a_clock_and_a_clock_that_stands() -> None:
    rows = np.arange(600.0)
    made = capture("drive", t_s=rows * 1e-3, theta_mech_rad=rows * 0.01)
    other = pl.DataFrame({"temp_case_degc": rows})
    both = replace(made, tables=(other, *made.tables, made.tables[0].head(2)))
    for gate in ("clock_jump", "dropped_samples", "isolated_readings"):
        assert said(gate, both) == ""
    speed = 50.0 + rows * 0.01
    speed[200] = 0.0
    still = capture("drive", t_s=np.zeros(600), omega_mech_rad_s=speed)
    assert said("isolated_readings", still) == ""


def test_noise_of_a_resting_speed_is_no_motion() -> None:
    """The angle stands: integrated noise makes turns. It turns: the speed is held against it."""
    white = 40.0 * noise(4000)
    white -= white.mean()
    t_s = np.arange(4000) * 0.05
    resting = capture("drive", t_s=t_s, theta_mech_rad=np.zeros(4000), omega_mech_rad_s=white)
    assert np.abs(integral(t_s, white)).max() > TURN
    assert speed_against_angle.speed_over_angle(resting, 1.0) is None
    angle = 1.0 * t_s
    moving = capture("drive", t_s=t_s, theta_mech_rad=angle, omega_mech_rad_s=white)
    assert speed_against_angle.speed_over_angle(moving, 1.0) is not None


def test_one_value_is_no_dead_channel() -> None:
    values = np.full(500, np.nan)
    values[3] = 2.0
    rng = np.random.default_rng(0)
    one = capture("drive", iq_a=values, vq_v=rng.standard_normal(500))
    assert said("stuck_channel", one) == ""
    values[9] = 2.0
    two = capture("drive", iq_a=values, vq_v=rng.standard_normal(500))
    assert said("stuck_channel", two) == "refused"


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


def test_a_steady_d_current_counts_by_its_largest() -> None:
    """0.19 to 0.21 of a limit of 0.2: some of it may cancel the magnet."""
    assert phase_order.back_emf_slope(frame(0.03, d=0.2, swing=0.02)) == (0.0, np.inf)


def test_a_table_without_angle_or_too_short_is_passed_over() -> None:
    made = ratio_of(1.7)
    other = pl.DataFrame({"t_s": [0.0, 1.0], "iq_a": [0.0, 1.0]})
    late = replace(made, tables=(other, made.tables[0].head(9), *made.tables))
    assert speed_against_angle.speed_over_angle(late, 1.0) == pytest.approx(1.7)


def test_a_line_without_a_value_leaves_the_step_to_the_others() -> None:
    t = np.arange(-200, 2000)
    current = np.where(t > 0, -np.expm1(-t / 5.0), 0.0)
    blank = np.full(t.size, np.nan)
    made = capture("current_step", ia_a=blank, ib_a=10.0 * current)
    assert said("sampling_rate", made) == "warned"
