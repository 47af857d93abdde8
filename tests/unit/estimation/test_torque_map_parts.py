"""The parts of a torque map's regression on points whose answer is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical.operating_points import Point, _acceleration
from pipeline.estimation.estimators.torque_map import (
    Regression,
    _chosen,
    _drag,
    _enough,
    _regress,
    _sigma,
    _untested_form,
    torque,
)
from pipeline.estimation.mechanical.map_drag import lack_of_fit
from pipeline.estimation.mechanical.torque_slope import Slope, slope_without_d
from pipeline.numerics.least_squares import linear_fit
from tests.unit.estimation.points import W, point


def ripple_map(curve, levels=(2.0, 4.0, 6.0, 8.0, 10.0), w=(-50.0, 50.0, 90.0), d=(0.0,)):
    return [
        point(s * i, id_, w=speed, group=g, torque_nm=curve(s * i, id_) - 0.05 * np.sign(speed)
              - 1e-3 * speed + 0.02)
        for g, speed in enumerate(w) for i in levels for s in (-1.0, 1.0) for id_ in d
    ]  # fmt: skip


def test_a_straight_torque_has_no_doubt_of_its_form() -> None:
    rng = np.random.default_rng(0)
    points = ripple_map(lambda i, _: 0.06 * i + 1e-4 * rng.standard_normal())
    found = slope_without_d(points, 0.0, False, False)
    assert found is not None
    assert found.kt_nm_a == pytest.approx(0.06, rel=1e-3)
    assert found.dof == len(points) - 4
    design = np.column_stack([*(np.array([p.group == g for p in points], float) for g in range(3)),
                              [p.iq_a for p in points]])  # fmt: skip
    fit = linear_fit(design, np.array([p.torque_nm for p in points]))
    assert found.u_nm_a == pytest.approx(fit.u(3), rel=1e-6)
    cubic = np.column_stack([design, [(p.iq_a / 10.0) ** 3 for p in points]])
    wider = linear_fit(cubic, np.array([p.torque_nm for p in points])).coefficients[3]
    assert found.form_nm_a == pytest.approx(abs(wider - found.kt_nm_a), rel=1e-6)


def test_a_bent_torque_takes_odd_powers_while_they_count() -> None:
    rng = np.random.default_rng(1)
    points = ripple_map(lambda i, _: 0.06 * i - 3e-5 * i**3 + 1e-4 * rng.standard_normal())
    found = slope_without_d(points, 0.0, False, False)
    assert found is not None
    assert found.kt_nm_a == pytest.approx(0.06, rel=2e-3)
    # nearly all levels are needed: three at least, six points beyond the offsets
    assert slope_without_d(ripple_map(lambda i, _: 0.06 * i, (2.0, 4.0)), 0.0, False, False) is None
    few = ripple_map(lambda i, _: 0.06 * i, (2.0, 4.0, 6.0), (50.0,))
    assert len(few) == 6
    assert slope_without_d(few, 0.0, False, False) is None
    # warm magnets: K is that of 25 degC
    warm = [replace(p, temp_magnet_degc=75.0) for p in points]
    hot = slope_without_d(warm, -0.002, False, False)
    assert hot is not None
    assert hot.kt_nm_a == pytest.approx(found.kt_nm_a / 0.9, rel=1e-6)


def test_a_turned_frame_and_rubbing_have_columns_of_their_own() -> None:
    even = ripple_map(lambda i, _: 0.06 * i + 2e-4 * i**2)
    found = slope_without_d(even, 0.0, True, False)
    assert found is not None
    assert found.kt_nm_a == pytest.approx(0.06, rel=1e-9)
    rubbing = [replace(p, torque_nm=p.torque_nm - 0.002 * abs(p.iq_a) * np.sign(p.omega_mech_rad_s))
               for p in ripple_map(lambda i, _: 0.06 * i)]  # fmt: skip
    found = slope_without_d(rubbing, 0.0, False, True)
    assert found is not None
    assert found.kt_nm_a == pytest.approx(0.06, rel=1e-9)
    assert found.u_nm_a < 1e-9


def test_a_slope_scaled_keeps_its_uncertainties_positive() -> None:
    assert Slope(2.0, 0.1, 7, 0.3).times(-2.0) == Slope(-4.0, 0.2, 7, 0.6)


def test_powers_of_two_d_currents_are_no_other_column_than_reluctance() -> None:
    """A cube of d currents that are none or -1 A, but for their noise, took K_rel's place: 0.092
    for -0.013 N·m/A², and the torque equation of a sound motor failed.
    """
    rng = np.random.default_rng(5)

    def points(d):
        made = ripple_map(lambda i, id_: 0.45 * i - 0.013 * i * id_, (0.6, 1.2, 1.8, 2.4), d=d)
        return [replace(p, id_a=p.id_a + 2e-3 * rng.standard_normal()) for p in made]

    two = points((0.0, -1.0))
    bent = [replace(p, torque_nm=p.torque_nm + 0.01 * p.id_a**3 * p.iq_a)
            for p in points((0.0, -0.5, -1.0, 1.0))]  # fmt: skip
    bends = {"id^2 iq", "id^3 iq"}
    assert bends.isdisjoint(_chosen(two, 0.0, 0.05))
    assert not bends.isdisjoint(_chosen(bent, 0.0, 0.05))


def test_columns_of_the_torque() -> None:
    points = [point(2.0, -1.0, cos_turn=0.5, sin_turn=-0.25, w=-5.0, temp_magnet_degc=35.0),
              point(-4.0, 3.0, group=1)]  # fmt: skip
    base, more = torque(points, -0.002)
    assert base["speed 0"].tolist() == [1.0, 0.0]
    assert base["iq"] == pytest.approx([2.0 * 0.98, -4.0])
    assert base["id iq"].tolist() == [-2.0, -12.0]
    expected = {
        "iq^3": [8.0, -64.0], "iq^5": [32.0, -1024.0], "|iq| sense": [-2.0, 4.0],
        "|iq| id sense": [2.0, 12.0],
        "id": [-1.0, 3.0], "id sense": [1.0, 3.0], "id cos": [-0.5, 0.0], "id sin": [0.25, 0.0],
        "id^2 iq": [2.0, -36.0], "id iq^3": [-8.0, -192.0], "id^3 iq": [-2.0, -108.0],
        "id^2 iq^3": [8.0, -576.0], "iq^2 - id^2": [3.0, 7.0],
        "id speed": [5.0, 3.0 * W], "iq^2 - id^2 speed": [-15.0, 7.0 * W],
    }  # fmt: skip
    assert {name: column.tolist() for name, column in more.items()} == expected
    for share, there in ((0.048, False), (0.052, True)):
        for other in (0.0, share * 10.0):
            pair = [point(-5.0, other), point(5.0, share * 10.0)]
            assert ("id iq" in torque(pair, 0.0)[0]) is there
    assert _sigma([point(1.0, rows=25), point(1.0, rows=175)]) == pytest.approx(
        [2.0, math.sqrt(4 / 7)]
    )


def regression(names, values, covariance=None, dof=9):
    cov = np.eye(len(values)) * 1e-8 if covariance is None else covariance
    return Regression(tuple(names), np.array(values, float), cov, np.zeros(3), dof)


def test_the_torque_constant_of_a_turned_and_of_a_wobbling_frame() -> None:
    """K = hypot(K cos e, K sin e); an eccentric encoder of A rad once a turn adds A^2/4."""
    assert regression(["iq", "id"], [-3.0, 4.0]).kt_nm_a == pytest.approx(-5.0)
    found = regression(["iq", "id cos", "id sin"], [2.0, 0.06, 0.08])
    assert found.kt_nm_a == pytest.approx(2.0 * (1.0 + 0.0025 / 4.0))
    assert regression(["iq"], [0.0]).kt_nm_a == 0.0


def speeds_of(values, coulomb=0.1, viscous=2e-3, zero=0.03):
    points = [point(1.0, w=w, group=g) for g, w in enumerate(values)]
    offsets = [zero - coulomb * math.copysign(1.0, w) - viscous * w for w in values]
    return points, offsets


def test_drag_is_the_line_through_the_offsets() -> None:
    speeds = (-100.0, -40.0, 50.0, 120.0)
    points, offsets = speeds_of(speeds)
    block = np.diag([1e-6, 2e-6, 3e-6, 4e-6])
    model = regression([f"speed {g}" for g in range(4)], offsets, block, dof=12)
    drag = _drag(points, model)
    assert (drag.why, drag.windage) == ("", False)
    assert drag.values == pytest.approx([0.1, 2e-3])
    design = np.column_stack([-np.sign(speeds), -np.array(speeds), np.ones(4)])
    inverse = np.linalg.inv(design.T @ design) @ design.T
    assert drag.covariance == pytest.approx((inverse @ block @ inverse.T)[:2, :2])
    assert drag.dof == 12
    # an offset that is off by much widens it, and has one degree of freedom
    off = [*offsets[:3], offsets[3] + 0.1]
    wide = _drag(points, regression(model.names, off, block, dof=12))
    part = linear_fit(design, np.array(off))
    lack = float(part.residuals @ part.residuals) / 2.5e-6
    assert lack_of_fit(part, block) == pytest.approx(lack)
    assert wide.covariance == pytest.approx(lack * drag.covariance)
    assert wide.dof == 1
    assert _untested_form(points, model, 0) == ()


@pytest.mark.parametrize("windage", [0.0, 2e-5])
def test_a_drag_by_the_square_of_speed_is_no_viscous_one(windage: float) -> None:
    """Six speeds of a map gave a viscous drag four times too large, at ten of its u."""
    speeds = (-120.0, -80.0, -40.0, 40.0, 80.0, 120.0)
    points, offsets = speeds_of(speeds)
    noise = np.random.default_rng(6).normal(0.0, 1e-3, len(speeds))
    offsets = [o - windage * w * abs(w) + e for o, w, e in zip(offsets, speeds, noise, strict=True)]
    names = [f"speed {g}" for g in range(len(speeds))]
    drag = _drag(points, regression(names, offsets, np.eye(6) * 1e-6, dof=40))
    assert drag.windage is (windage > 0.0)
    assert np.all(np.abs(drag.values - [0.1, 2e-3]) < 3.0 * np.sqrt(np.diag(drag.covariance)))
    assert drag.covariance[1, 1] < (2e-4) ** 2


def test_drag_needs_three_speeds_and_both_senses() -> None:
    for speeds in ((-100.0, 100.0), (50.0, 80.0, 120.0)):
        points, offsets = speeds_of(speeds)
        model = regression([f"speed {g}" for g in range(len(speeds))], offsets)
        assert "three speeds" in _drag(points, model).why
    points, offsets = speeds_of((-100.0, 40.0, 100.0))
    model = regression([f"speed {g}" for g in range(3)], offsets)
    assert _drag(points, model).values == pytest.approx([0.1, 2e-3])
    (dry,), (wet,) = _untested_form(points, model, 0), _untested_form(points, model, 1)
    assert dry.u == pytest.approx(0.1 * (0.1 + 2e-3 * 40.0))
    assert wet.u == pytest.approx(dry.u / 40.0)


def test_the_form_of_drag_is_tested_by_a_third_speed_and_not_by_the_other_sense() -> None:
    for speeds, tested in (
        ((-90.0, -40.0, 40.0, 90.0), False),
        ((-90.0, -40.2, 40.0, 90.3), False),
        ((-90.0, -40.0, 40.0, 60.0, 90.0), True),
        # as many as both drags and the transducer's zero
        ((-90.0, 40.0, 60.0), False),
        ((-90.0, -40.0, 60.0, 120.0), True),
    ):
        points, offsets = speeds_of(speeds)
        model = regression([f"speed {g}" for g in range(len(speeds))], offsets)
        assert (_untested_form(points, model, 0) == ()) is tested, speeds


@pytest.mark.parametrize(("sigmas", "fine"), [(3.9, True), (4.1, False)])
def test_a_negative_drag_beyond_four_u_is_none(sigmas: float, fine: bool) -> None:
    speeds = (-100.0, 40.0, 100.0)
    points, _ = speeds_of(speeds)
    block = np.eye(3) * 1e-6
    design = np.column_stack([-np.sign(speeds), -np.array(speeds), np.ones(3)])
    inverse = np.linalg.inv(design)
    u = math.sqrt((inverse @ block @ inverse.T)[0, 0])
    _, offsets = speeds_of(speeds, coulomb=-sigmas * u)
    model = regression([f"speed {g}" for g in range(3)], offsets, block)
    assert (_drag(points, model).why == "") is fine


def test_enough_points_leave_one_over() -> None:
    assert _enough([point(i) for i in (1.0, 2.0, 3.0, 4.0)])
    assert not _enough([point(i) for i in (1.0, 2.0, 3.0)])
    assert not _enough([point(1.0)] * 4)


def test_a_regression_of_a_map_finds_k_and_the_reluctance() -> None:
    points = ripple_map(lambda i, d: 0.06 * i - 6e-3 * d * i, d=(-4.0, 0.0))
    found = _regress(points, 0.0, [])
    assert found.of("iq") == pytest.approx(0.06)
    assert found.of("id iq") == pytest.approx(-6e-3)
    assert found.of("no such") == 0.0


def test_a_dynamometer_that_gives_way_leaves_acceleration_in_the_torque() -> None:
    """The torque constant was 0.7 % off where a staircase of current rose at one d current and
    fell at the other: what turned the rotor's own inertia counted as the current's.
    """
    inertia, rng = 3e-4, np.random.default_rng(2)

    def given_way(iq: float, id_: float, w: float, group: int) -> Point:
        alpha = np.copysign(rng.uniform(10.0, 70.0), -1.0 if id_ == 0.0 else 1.0)
        torque_nm = (0.06 - 6e-3 * id_) * iq - 0.05 - inertia * alpha + 2e-5 * rng.standard_normal()
        return point(iq, id_, w=w, group=group, torque_nm=torque_nm, alpha_mech_rad_s2=alpha)

    points = [
        given_way(s * iq, id_, w, group)
        for group, w in enumerate((50.0, 90.0))
        for id_ in (-4.0, 0.0)
        for iq in (2.0, 5.0, 8.0)
        for s in (-1.0, 1.0)
    ]
    chosen = _chosen(points, 0.0, 0.01)
    found = _regress(points, 0.0, chosen)
    assert found.of("acceleration") == pytest.approx(-inertia, rel=0.05)
    assert found.of("iq") == pytest.approx(0.06, rel=1e-3)
    assert found.of("id iq") == pytest.approx(-6e-3, rel=5e-3)
    blind = [replace(p, alpha_mech_rad_s2=0.0) for p in points]
    without = _regress(blind, 0.0, _chosen(blind, 0.0, 0.01))
    assert np.std(without.residuals) > 20.0 * np.std(found.residuals)


def test_the_acceleration_of_a_settled_step_is_the_curvature_of_its_angle() -> None:
    t = np.arange(400) * 2e-4
    speed = 50.0 + 30.0 * t
    angle = 50.0 * t + 15.0 * t**2
    assert _acceleration(t, angle, 2) == pytest.approx(30.0)
    assert _acceleration(t, speed, 1) == pytest.approx(30.0)
    assert _acceleration(t, np.full(t.size, np.nan), 1) == 0.0
    assert _acceleration(t[:2], angle[:2], 2) == 0.0
