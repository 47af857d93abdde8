"""Operating points of a capture: where they begin, what they average, which belong together."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical.operating_points import (
    PointTable,
    _alike,
    _error_of_mean,
    _numbered,
    _point,
    _settled,
    _steady,
    _whole_cycles,
    operating_points,
    pole_pairs_of,
)
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import autocorrelation_time
from pipeline.numerics.plateaus import find_plateaus, white_noise_sigma
from pipeline.records.constants import Constants
from tests.unit.estimation.points import MAP, point
from tests.unit.estimation.signals import capture, known_value


def settled(levels, each=400, noise=1e-3, seed=0, **more):
    rng = np.random.default_rng(seed)
    iq = np.repeat(levels, each) + noise * rng.standard_normal(len(levels) * each)
    t = np.arange(iq.size) * 1e-3
    blank = {"id_a": np.zeros(iq.size), "torque_shaft_nm": np.full(iq.size, np.nan)}
    return {"t_s": t, "iq_a": iq, **blank, **more}


def test_a_stretch_begins_twice_as_late_as_its_step_settles() -> None:
    """A rise over 40 rows at row 400: settled from 440, used from 480 on."""
    iq = np.concatenate([np.zeros(400), np.linspace(0.0, 5.0, 40), np.full(360, 5.0)])
    iq += 1e-3 * np.random.default_rng(0).standard_normal(800)
    data = settled([0.0, 5.0])
    data["iq_a"] = iq
    first, second = _settled(data, ("iq_a",))
    assert first.start == 0
    assert abs(first.stop - 400) <= 12
    assert abs(second.start - 480) <= 20
    assert second.stop == 800


def test_no_step_takes_more_than_half_of_a_stretch() -> None:
    """A slow rise before a short rest: from the middle of the rest on."""
    iq = np.concatenate([np.zeros(300), np.linspace(0.0, 5.0, 300), np.full(200, 5.0)])
    iq += 1e-3 * np.random.default_rng(0).standard_normal(800)
    data = settled([0.0, 5.0])
    data["iq_a"] = iq
    (rest,) = find_plateaus(iq, policy().evidence.rows, tolerance=policy().points.step_share)
    assert rest.start > 400
    (found,) = _settled(data, ("iq_a",))
    assert (found.start, found.stop) == ((rest.start + 800) // 2, 800)


def test_both_signals_have_to_be_settled() -> None:
    data = settled([0.0, 5.0, 5.0])
    data["id_a"] = np.repeat([0.0, 0.0, -3.0], 400) + 1e-3 * np.random.default_rng(
        1
    ).standard_normal(1200)
    found = _settled(data, ("id_a", "iq_a"))
    assert len(found) == 3
    assert len(_settled(data, ("iq_a",))) == 2


@pytest.mark.parametrize(("share", "steady"), [(0.0195, True), (0.0205, False)])
def test_halves_of_a_stretch_agree_to_a_fiftieth_of_the_span(share: float, steady: bool) -> None:
    signal = np.concatenate([[0.0, 10.0], np.full(50, 3.0), np.full(50, 3.0 + share * 10.0)])
    assert _steady({"x": signal}, slice(2, 102), ("x",)) is steady
    assert _steady({"x": signal * np.nan}, slice(2, 102), ("x",))


@pytest.mark.parametrize(("sigmas", "steady"), [(5.8, True), (6.2, False)])
def test_halves_agree_to_six_of_the_noise_of_their_means(sigmas: float, steady: bool) -> None:
    noise = 0.5 * (-1.0) ** np.arange(100)
    sigma = white_noise_sigma(noise)
    drift = sigmas * sigma / math.sqrt(50.0)
    part = noise + np.where(np.arange(100) < 50, 0.0, drift)
    assert _steady({"x": part}, slice(0, 100), ("x",)) is steady


@pytest.mark.parametrize(
    ("turns", "pairs", "rows"),
    [(1.25, None, 800), (1.27, None, 1000), (1.27, 4, 984), (0.6, 4, 833), (0.2, 4, 1000),
     (3.1, None, 968)],
)  # fmt: skip
def test_rows_of_whole_turns_else_of_whole_cycles(turns, pairs, rows) -> None:
    """Kept where they cost a fifth at most: 1 of 1.25 turns, 5 of 5.08 cycles, 2 of 2.4."""
    theta = np.linspace(0.0, -turns * 2.0 * math.pi, 1000)
    data = {"theta_mech_rad": np.concatenate([np.zeros(7), theta])}
    found = _whole_cycles(slice(7, 1007), data, pairs)
    assert found.stop == 1007
    assert found.stop - found.start == pytest.approx(rows, abs=1)
    blind = {"theta_mech_rad": np.full(1007, np.nan)}
    assert _whole_cycles(slice(7, 1007), blind, pairs) == slice(7, 1007)


def turning(w, rows=1000, angle=0.0, **more):
    t = np.arange(rows) * 1e-3
    columns = {
        "t_s": t, "iq_a": np.full(rows, 3.0), "theta_mech_rad": angle + w * t,
        "torque_shaft_nm": np.full(rows, 0.4), "vd_v": np.full(rows, -1.0),
        "vq_v": np.full(rows, 2.0), **more,
    }  # fmt: skip
    return capture("torque_map", "map", **columns)


def test_a_points_means() -> None:
    rng = np.random.default_rng(0)
    shaken = 0.4 + 0.01 * np.convolve(rng.standard_normal(1004), np.ones(5) / 5.0, mode="valid")
    made = turning(
        2.0 * math.pi * 3.0, torque_shaft_nm=shaken, temp_magnet_degc=np.full(1000, 40.0)
    )
    data = made.arrays(*made.tables[0].columns) | {"id_a": np.zeros(1000)}
    one = _point(made, data, slice(200, 1000), {})
    assert one.omega_mech_rad_s == pytest.approx(6.0 * math.pi)
    assert (one.iq_a, one.id_a, one.vd_v, one.vq_v) == (3.0, 0.0, -1.0, 2.0)
    assert one.temp_magnet_degc == 40.0
    assert one.period_s == pytest.approx(1e-3)
    rows = slice(200, 1000)
    assert one.rows == 800
    theta = data["theta_mech_rad"][rows]
    assert (one.cos_turn, one.sin_turn) == pytest.approx(
        (np.cos(theta).mean(), np.sin(theta).mean())
    )
    assert one.torque_nm == pytest.approx(shaken[rows].mean())
    part = shaken[rows]
    expected = part.std() * math.sqrt(autocorrelation_time(part) / part.size)
    assert _error_of_mean(part) == pytest.approx(expected)
    assert math.isnan(_error_of_mean(np.array([1.0, np.nan])))
    assert not one.standing
    table = PointTable((one, one), 1600, 2000)
    assert table.note() == "2 settled points; 400 of 2000 rows were transient"
    assert table.column("iq_a").tolist() == [3.0, 3.0]


@pytest.mark.parametrize(
    ("turns", "angle", "standing"),
    [(0.0095, True, True), (0.0105, True, False), (0.0095, False, True), (0.0105, False, False)],
)
def test_a_shaft_stands_below_a_hundredth_of_a_turn(turns, angle, standing) -> None:
    w = turns * 2.0 * math.pi / 0.999
    made = turning(w)
    if not angle:
        table = (
            made.tables[0].drop("theta_mech_rad").with_columns(omega_mech_rad_s=np.full(1000, w))
        )
        made = replace(made, tables=(table,))
    (one,) = operating_points([made], 4).points
    assert one.standing is standing


def test_an_angle_that_creeps_over_the_capture_is_no_standstill() -> None:
    """Points of 400 rows: less than a hundredth each, more than a tenth of a turn in all."""
    for turns, standing in ((0.095, True), (0.105, False)):
        t = np.arange(16_000) * 1e-3
        levels = np.repeat(np.arange(16.0) * 2.0, 1000) + 1e-3 * np.random.default_rng(
            0
        ).standard_normal(16_000)
        w = turns * 2.0 * math.pi / t[-1]
        made = capture("torque_map", t_s=t, iq_a=levels, theta_mech_rad=w * t)
        points = operating_points([made], 4).points
        assert len(points) >= 10
        assert {p.standing for p in points} == {standing}


def test_a_speed_that_creeps_over_the_capture_is_a_standstill() -> None:
    """The offset of a tacho adds up to no angle: without one, the speed of each point counts."""
    t = np.arange(16_000) * 1e-3
    levels = np.repeat(np.arange(16.0) * 2.0, 1000)
    levels += 1e-3 * np.random.default_rng(0).standard_normal(16_000)
    w = np.full(t.size, 0.15 * 2.0 * math.pi / t[-1])
    made = capture("torque_map", t_s=t, iq_a=levels, omega_mech_rad_s=w)
    points = operating_points([made], 4).points
    assert len(points) >= 10
    assert {p.standing for p in points} == {True}


def test_points_of_one_speed_and_of_one_angle_are_one_group() -> None:
    speeds = [point(1.0, w=w) for w in (100.0, 101.9, 98.1, 102.1, -100.0)]
    assert [p.group for p in _numbered(speeds)] == [0, 0, 0, 1, 2]

    def still(turn, source=MAP):
        a = 2.0 * math.pi * turn
        return point(1.0, w=0.0, cos_turn=math.cos(a), sin_turn=math.sin(a), source=source)

    angles = [still(0.3), still(0.3009), still(0.3011), still(0.9996), still(0.0003)]
    assert [p.group for p in _numbered(angles)] == [0, 0, 1, 2, 2]
    assert angles[0].angle_rad == pytest.approx(0.6 * math.pi)
    assert not _alike(speeds[0], angles[0])
    assert not _alike(angles[0], speeds[0])
    blind, other = point(1.0, w=0.0), point(1.0, w=0.0, source=replace(MAP, path="other"))
    assert math.isnan(blind.angle_rad)
    assert _alike(blind, point(2.0, w=0.0))
    assert not _alike(blind, other)


def test_a_point_as_an_instrument_that_is_off_shows_it() -> None:
    warm = capture("torque_map", t_s=np.arange(3.0), temp_magnet_degc=np.full(3, 25.0))
    off = {"current@s": 0.1, "voltage@s": 0.2, "torque@s": -0.5, "temperature@s": 4.0}
    one = point(3.0, -2.0, source=warm).shifted(off)
    plain = point(3.0, -2.0)
    assert (one.iq_a, one.id_a) == pytest.approx((3.3, -2.2))
    assert (one.vd_v, one.vq_v) == pytest.approx((1.2 * plain.vd_v, 1.2 * plain.vq_v))
    assert one.torque_nm == pytest.approx(0.5 * plain.torque_nm)
    assert one.temp_magnet_degc == 29.0
    assert point(3.0, -2.0, source=warm).shifted({}) == point(3.0, -2.0, source=warm)


def test_temperature_and_pole_pairs_where_nobody_measured_them() -> None:
    assert pole_pairs_of(Constants((known_value("pole_pairs", 6.99),)), 5) == 7
    assert pole_pairs_of(Constants(), 5) == 5
    assert pole_pairs_of(Constants(), "5") is None
    bare = turning(10.0)
    blank = {name: np.full(1000, np.nan) for name in ("temp_magnet_degc", "id_a")}
    one = _point(bare, blank | bare.arrays(*bare.tables[0].columns), slice(0, 1000), {})
    assert one.temp_magnet_degc == 25.0


def test_a_slow_log_whose_levels_are_of_few_rows() -> None:
    """A logger of 50 rows a second: 24 levels of 60 rows, of which one was settled."""
    rng = np.random.default_rng(3)
    levels = [(w, q, d) for w in (30.0, 90.0) for q in (-6, -3, 0, 3, 6, 4) for d in (-4.0, 0.0)]
    speed, iq, id_ = (np.repeat([float(one[k]) for one in levels], 60) for k in range(3))
    noise = 0.01 * rng.standard_normal((3, iq.size))
    torque = 0.28 * iq - 0.1 - 5e-4 * speed + noise[2]
    columns = {"omega_mech_rad_s": speed, "iq_a": iq + noise[0], "id_a": id_ + noise[1]}
    t_s = 0.02 * np.arange(iq.size)
    one = capture("torque_map", "map", t_s=t_s, torque_shaft_nm=torque, **columns)
    table = operating_points([one], None)
    assert len(table.points) == len(levels)
    assert table.settled_rows > 0.5 * table.rows
    got = [(p.omega_mech_rad_s, round(p.iq_a), round(p.id_a)) for p in table.points]
    assert got == [(w, q, round(d)) for w, q, d in levels]
