"""Operating points, flux pairs, slopes of torque and lines of resistance, worked out by hand."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical.direct_current import Point as DcPoint
from pipeline.estimation.electrical.flux_pairs import (
    Flux,
    _corrected,
    _lateness,
    _less_drop,
    _matched,
    current_lag,
    flux_pairs,
    frame_of,
    instant_voltage,
)
from pipeline.estimation.electrical.operating_points import (
    Point,
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
from pipeline.estimation.estimators import resistance
from pipeline.estimation.estimators.inductance_rated import (
    Result,
    _direct,
    _evidence,
    _hold_doubt,
    _Look,
    _other_side,
    _quadrature,
)
from pipeline.estimation.estimators.resistance import (
    _birge,
    _imbalance,
    _unknown_drop_ohm,
    columns_of,
    fit_direct_current,
    terminal_voltage,
)
from pipeline.estimation.estimators.torque_map import (
    Regression,
    _drag,
    _enough,
    _lack,
    _regress,
    _sigma,
    _untested_form,
    torque,
)
from pipeline.estimation.mechanical.torque_slope import Slope, slope_without_d
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.plateaus import white_noise_sigma
from pipeline.physics.conventions import COPPER_COEFFICIENT_25_1_K
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, known_value

P, PSI, LD, LQ, R, W = 4, 0.01, 2e-3, 3e-3, 0.5, 100.0
MAP = capture("torque_map", voltage_timing="instant", t_s=np.arange(3.0))


def point(iq, id_=0.0, *, w=W, group=0, source=MAP, period=1e-4, rows=100, u=0.0, **more):
    """A point of a motor with constant inductances; torque 1.5 p (psi + (Ld - Lq) id) iq."""
    omega = P * w
    psi_d, psi_q = PSI + LD * id_, LQ * iq
    values = {
        "group": group, "rows": rows, "omega_mech_rad_s": w, "id_a": id_, "iq_a": iq,
        "vd_v": R * id_ - omega * psi_q, "vq_v": R * iq + omega * psi_d,
        "torque_nm": 1.5 * P * (psi_d * iq - psi_q * id_), "u_torque_nm": 0.0, "u_vd_v": u,
        "u_vq_v": 2.0 * u, "temp_magnet_degc": 25.0, "cos_turn": 0.0, "sin_turn": 0.0,
        "period_s": period, "capture": source,
    }  # fmt: skip
    return Point(**{**values, **more})


def both(iq, id_=0.0, **more):
    return [point(iq, id_, **more), point(-iq, id_, **more)]


GRID = [*both(10.0), *both(10.0, -5.0), *both(5.0, -10.0), *both(5.0), point(0.0)]


# Flux pairs


def test_flux_of_pairs_whatever_the_resistance() -> None:
    found = flux_pairs(GRID, P)
    assert [(f.id_a, f.iq_a) for f in found] == [
        (0.0, 10.0), (-5.0, 10.0), (-10.0, 5.0), (0.0, 5.0), (0.0, 0.0)
    ]  # fmt: skip
    for one in found:
        assert one.psi_d_wb == pytest.approx(PSI + LD * one.id_a)
        assert one.psi_q_wb == pytest.approx(LQ * one.iq_a)
    backwards = flux_pairs([replace(p, group=1) for p in map(at_speed(-60.0), GRID)], P)
    assert [f.psi_q_wb for f in backwards] == pytest.approx([f.psi_q_wb for f in found])


def at_speed(w):
    return lambda p: point(p.iq_a, p.id_a, w=w, group=p.group)


def test_standard_errors_of_a_pair_and_of_a_point_by_itself() -> None:
    """Of a mean of two: u/sqrt(2)/w; v_q makes psi_d, v_d makes psi_q. Alone: u sqrt(0.5)..."""
    pair = flux_pairs(both(10.0, u=0.02), P)[0]
    omega = P * W
    assert pair.u_q_wb == pytest.approx(0.02 / math.sqrt(2.0) / omega)
    assert pair.u_d_wb == pytest.approx(0.04 / math.sqrt(2.0) / omega)
    alone = next(f for f in flux_pairs([*both(10.0), point(0.0, u=0.02)], P) if f.iq_a == 0.0)
    assert alone.u_d_wb == pytest.approx(0.04 / omega)


def test_what_of_the_angle_differs_from_pair_to_pair_is_uncertainty() -> None:
    """Voltages of two pairs turned by ±e: wobble e (rms, one parameter), times the voltage."""
    e = 0.01
    turned = []
    for sign, iq in ((1.0, 10.0), (-1.0, 5.0)):
        for p in both(iq):
            v = complex(p.vd_v, p.vq_v) * cmath.exp(1j * sign * e)
            turned.append(replace(p, vd_v=v.real, vq_v=v.imag))
    matched, largest = _matched(turned)
    offset, late, wobble = _lateness(matched, P, largest)
    assert (offset, late) == (0.0, pytest.approx(0.0, abs=1e-6))
    # two angles of +-e about their mean, one degree of freedom left
    assert wobble == pytest.approx(e * math.sqrt(2.0), rel=1e-3)
    first = flux_pairs(turned, P)[0]
    half, gap = complex(0.0, W * P * PSI), complex(P * W * LQ * 10.0, -R * 10.0)
    assert first.u_d_wb == pytest.approx(
        wobble * (abs(half.real) + abs(gap.real)) / math.sqrt(2.0) / (P * W), rel=0.03)  # fmt: skip
    assert first.u_q_wb == pytest.approx(
        wobble * (abs(half.imag) + abs(gap.imag)) / math.sqrt(2.0) / (P * W), rel=0.03)  # fmt: skip


def test_only_like_points_make_a_pair() -> None:
    """Three per cent of the largest current, of either, in one group."""

    def count(one, other):
        return len(_matched([one, other, point(100.0, group=9)])[0])

    assert count(point(50.0), point(-52.9)) == 1
    assert count(point(50.0), point(-53.1)) == 0
    assert count(point(50.0, 2.9), point(-50.0)) == 1
    assert count(point(50.0, 3.1), point(-50.0)) == 0
    assert count(point(50.0), point(-50.0, group=1)) == 0
    assert count(point(1.45), point(50.0)) == 1  # a point without current is a pair with itself
    assert count(point(1.55), point(50.0)) == 0
    assert _matched([point(3.0, -7.0)])[1] == 7.0


@pytest.mark.parametrize("timing", ["instant", "held", "centred"])
def test_a_voltage_at_the_sampling_instant(timing: str) -> None:
    """The mean of e^{jwt} over a period after, or about, the instant, by integration."""
    made = replace(MAP, meta=replace(MAP.meta, voltage_timing=timing))
    omega, period = P * 300.0, 2e-4
    start = {"instant": 0.0, "held": 0.0, "centred": -0.5 * period}[timing]
    t = start + (np.arange(10_000) + 0.5) / 10_000 * period
    mean = complex(np.mean(np.exp(1j * omega * t))) if timing != "instant" else 1.0 + 0.0j
    v = complex(1.0, 2.0)
    seen = v * mean
    p = replace(point(1.0, w=300.0, period=period, source=made), vd_v=seen.real, vq_v=seen.imag)
    assert instant_voltage(p, P) == pytest.approx(v, rel=1e-6)


@pytest.mark.parametrize(("offset", "late"), [(0.05, 0.0), (0.0, 3e-5), (-0.04, 2e-5)])
def test_a_turned_frame_and_late_voltages_are_parted_by_two_speeds(offset, late) -> None:
    """Voltages at angle offset + late w_e: their sum of a pair points along j w_e psi."""
    points = []
    for group, w in enumerate((50.0, 200.0)):
        for p in both(10.0, w=w, group=group) + both(5.0, w=w, group=group):
            turn = cmath.exp(1j * (offset + late * P * w))
            v, i = complex(p.vd_v, p.vq_v) * turn, complex(p.id_a, p.iq_a) * cmath.exp(1j * offset)
            points.append(replace(p, vd_v=v.real, vq_v=v.imag, id_a=i.real, iq_a=i.imag))
    # the d current of the turned frame is below 3 % of the largest only for small angles
    found = _lateness([(a, b) for a, b in zip(points[::2], points[1::2], strict=True)], P, 1e3)
    assert found == pytest.approx((offset, late, 0.0), abs=1e-9)
    one = _lateness([(points[0], points[1])], P, 1e3)
    assert one == pytest.approx((0.0, late + offset / (P * 50.0), 0.0), abs=1e-9)
    for p, plain in zip(points[:1], both(10.0, w=50.0), strict=False):
        current, voltage = _corrected(p, P, offset, late, 0.0)
        assert current == pytest.approx(complex(plain.id_a, plain.iq_a))
        assert voltage == pytest.approx(complex(plain.vd_v, plain.vq_v))
        ahead = _corrected(p, P, offset, late, 1e-4)[0]
        assert ahead == pytest.approx(current * cmath.exp(1e-4j * P * 50.0))
    assert _lateness([], P, 10.0) == (0.0, 0.0, 0.0)


@pytest.mark.parametrize(("ratio", "two"), [(0.91, False), (0.89, True)])
def test_two_speeds_are_a_tenth_apart(ratio: float, two: bool) -> None:
    pairs = []
    for group, w in enumerate((100.0, 100.0 * ratio)):
        a, b = both(10.0, w=w, group=group)
        turn = cmath.exp(0.03j)
        seen = [complex(p.vd_v, p.vq_v) * turn for p in (a, b)]
        pairs.append(
            [replace(p, vd_v=v.real, vq_v=v.imag) for p, v in zip((a, b), seen, strict=True)]
        )
    assert (_lateness(pairs, P, 10.0)[0] != 0.0) is two
    assert frame_of([p for pair in pairs for p in pair], P)[0] == pytest.approx(-0.03 * two)


def test_a_drop_along_the_axis_is_taken_off_beside_it() -> None:
    """V = 2 + 3j along 4 + 1j: beside the d axis 2 * 1/4 of the drop; along q, of the other."""
    assert _less_drop(2.0 + 3.0j, 4.0 + 1.0j, 1.0, 1.0) == pytest.approx(2.0 + 2.5j)
    # on the q axis: along 4, aside -1 (d is minus the j of q), v along 3
    assert _less_drop(2.0 + 3.0j, 1.0 + 4.0j, 1.0j, 1.0) == pytest.approx(2.0 - 0.75 + 3.0j)
    assert _less_drop(2.0 + 3.0j, 1.9 + 1.0j, 1.0, 1.0) == 2.0 + 3.0j
    assert _less_drop(2.0 + 3.0j, 2.1 + 1.0j, 1.0, 1.0) != 2.0 + 3.0j


def lagging(delay, noise=0.0, seed=0, offset=0.0):
    rng = np.random.default_rng(seed)
    points = []
    for group, w in enumerate((-150.0, 40.0, 150.0)):
        for iq in (-10.0, -5.0, -2.0, 2.0, 5.0, 10.0):
            for id_ in (-8.0, -4.0, 0.0, 4.0):
                # the true current is ahead of the one read by w_e d, so torque follows that
                true = complex(id_, iq) * cmath.exp(1j * P * w * delay)
                t = 1.5 * P * PSI * true.imag
                t += 0.02 * group + noise * rng.standard_normal()
                points.append(point(iq, id_, w=w, group=group, torque_nm=t))
    return points


def test_currents_sampled_late_show_in_the_torque_of_d_current() -> None:
    assert current_lag(lagging(2e-5), P, 0.0) == pytest.approx(2e-5, rel=0.02)
    assert current_lag(lagging(-2e-5), P, 0.0) == pytest.approx(-2e-5, rel=0.02)
    assert current_lag(lagging(2e-5), P, 0.1) == pytest.approx(2e-5 / math.cos(0.1), rel=0.02)
    blind = [replace(p, torque_nm=math.nan) for p in lagging(2e-5)]
    assert current_lag(blind, P, 0.0) == 0.0
    flat = [p for p in lagging(2e-5) if p.id_a == 0.0]
    assert current_lag(flat, P, 0.0) == 0.0
    assert current_lag(lagging(0.0, noise=1e-3), P, 0.0) == 0.0


@pytest.mark.parametrize("levels", [(-8.0, -4.0, 0.0), (-8.0, -4.0, 0.0, 4.0), (-5.0, 0.0, 5.0)])
@pytest.mark.parametrize("l_d", [1e-3, 3e-3, 6e-3])
def test_a_delay_of_a_salient_rotor_is_read_whatever_the_d_currents(l_d: float, levels) -> None:
    """Reluctance torque turns with the current too: without it up to 2.7 times too much."""
    delay, points = 2e-5, []
    for group, w in enumerate((-150.0, 40.0, 150.0)):
        for iq in (-10.0, -5.0, -2.0, 2.0, 5.0, 10.0):
            for id_ in levels:
                true = complex(id_, iq) * cmath.exp(1j * P * w * delay)
                t = 1.5 * P * (PSI + (l_d - LQ) * true.real) * true.imag + 0.02 * group
                points.append(point(iq, id_, w=w, group=group, torque_nm=t))
    assert current_lag(points, P, 0.0) == pytest.approx(delay, rel=0.01)


@pytest.mark.parametrize(("share", "seen"), [(0.097, False), (0.103, True)])
def test_d_current_counts_from_a_tenth_of_the_q_currents_span(share: float, seen: bool) -> None:
    points = []
    for group, w in enumerate((-150.0, 40.0, 150.0)):
        for iq in (-10.0, -5.0, -2.0, 2.0, 5.0, 10.0):
            for id_ in (-1.0, -0.5, 0.0):
                i = complex(id_ * share * 20.0, iq)
                true = i * cmath.exp(1j * P * w * 2e-5)
                t = 1.5 * P * PSI * true.imag
                points.append(point(iq, i.real, w=w, group=group, torque_nm=t))
    assert bool(current_lag(points, P, 0.0)) is seen


# Rated inductances


def flux(id_, iq, d, q, *, group=0, u_d=1e-6, u_q=1e-6, temp=25.0):
    return Flux(group, id_, iq, d, q, u_d, u_q, temp)


def test_lq_at_the_largest_q_current_without_d() -> None:
    """Two of 10 A weigh by their u; 9.6 A and those with d current are left out."""
    fluxes = [
        flux(0.0, 10.0, 0.0, 0.030, u_q=1e-4), flux(0.0, 9.8, 0.0, 0.0294 + 9.8e-4, u_q=2e-4),
        flux(0.0, 9.6, 0.0, 9.9), flux(-5.0, 12.0, 0.0, 9.9), flux(0.0, 3.0, 0.0, 9.9),
    ]  # fmt: skip
    found = _quadrature(fluxes, 0.0)
    assert found is not None
    # 3 mH with weight 4/5 and 3.1 mH with 1/5
    assert found.value_h == pytest.approx(3.02e-3)
    assert found.u_h == pytest.approx(math.hypot(0.8 * 1e-4 / 10.0, 0.2 * 2e-4 / 9.8))
    assert (found.id_a, found.iq_a) == (0.0, 10.0)
    assert _quadrature([flux(0.0, 0.0, 1.0, 1.0)], 0.0) is None
    assert _quadrature([], 0.0) is None
    near, far = flux(0.29, 10.0, 0.0, 0.03), flux(0.31, 10.0, 0.0, 0.03)
    assert _quadrature([near], 0.0) is not None
    assert _quadrature([far], 0.0) is None


def test_ld_from_no_d_current_to_the_largest() -> None:
    """-8 A of d at 2 A of q against 0 A: (psi(-8) - psi(0))/(-8), the negative side first."""
    fluxes = [
        flux(0.0, 2.0, 0.010, 0.0), flux(-8.0, 2.0, -0.006, 0.0, u_d=3e-6),
        flux(8.0, 2.0, 0.024, 0.0), flux(0.0, 6.0, 0.011, 0.0), flux(-8.0, 6.0, -0.011, 0.0),
        flux(-4.0, 2.0, 9.9, 0.0), flux(0.0, 2.0, 0.010, 0.0, group=1),
    ]  # fmt: skip
    found = _direct(fluxes, 0.0)
    assert found is not None
    assert found.value_h == pytest.approx(0.016 / 8.0)
    assert found.u_h == pytest.approx(math.hypot(1e-6, 3e-6) / 8.0)
    assert (found.id_a, found.iq_a) == (-8.0, 2.0)
    # only positive d current: that side
    positive = _direct([f for f in fluxes if f.id_a >= 0.0], 0.0)
    assert positive is not None
    assert (positive.value_h, positive.id_a) == (pytest.approx(0.014 / 8.0), 8.0)
    words = _other_side(fluxes, 0.0, found)
    assert words == "1750 µH at 8 A of d current"
    assert _other_side([f for f in fluxes if f.id_a <= 0.0], 0.0, found) == ""
    # warm magnets take off alpha dT psi
    warm = [fluxes[0], replace(fluxes[1], temp_magnet_degc=45.0)]
    moved = _direct(warm, -0.001)
    assert moved is not None
    assert moved.value_h == pytest.approx((-0.016 + 0.001 * 20.0 * 0.010) / -8.0)
    assert _direct([fluxes[0], fluxes[3]], 0.0) is None


def test_two_pairs_of_ld_weigh_by_their_variance() -> None:
    fluxes = []
    for group, (value, u) in enumerate(((2e-3, 1e-6), (2.3e-3, 3e-6))):
        zero = flux(0.0, 2.0, 0.01, 0.0, group=group, u_d=0.0)
        fluxes += [zero, flux(-8.0, 2.0, 0.01 - 8.0 * value, 0.0, group=group, u_d=u)]
    found = _direct(fluxes, 0.0)
    assert found is not None
    assert found.value_h == pytest.approx(0.9 * 2e-3 + 0.1 * 2.3e-3)
    assert found.u_h == pytest.approx(math.hypot(0.9 * 1e-6, 0.1 * 3e-6) / 8.0)


def test_what_a_held_vector_may_be_of_its_mean() -> None:
    """(1/cos(wT/2) - 1)/sqrt(3) of centred means, the mean over points; others none."""
    centred = replace(MAP, meta=replace(MAP.meta, voltage_timing="centred"))
    points = [point(1.0, w=w, source=centred, period=1e-3) for w in (100.0, -400.0)]
    halves = [0.5 * P * w * 1e-3 for w in (100.0, 400.0)]
    expected = sum(1.0 / math.cos(h) - 1.0 for h in halves) / 2.0 / math.sqrt(3.0)
    assert _hold_doubt([*points, point(1.0)], P) == pytest.approx(expected)
    assert _hold_doubt([point(1.0)], P) == 0.0
    fast = [point(1.0, w=1e4, source=centred, period=1e-3)]
    assert _hold_doubt(fast, P) == pytest.approx((1.0 / math.cos(1.0) - 1.0) / math.sqrt(3.0))


# Operating points


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
    one = _point(made, data, slice(200, 1000))
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
    assert one.u_torque_nm == pytest.approx(expected)
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


def test_temperature_and_pole_pairs_where_nobody_measured_them() -> None:
    assert pole_pairs_of(Constants((known_value("pole_pairs", 6.99),)), 5) == 7
    assert pole_pairs_of(Constants(), 5) == 5
    assert pole_pairs_of(Constants(), "5") is None
    bare = turning(10.0)
    one = _point(bare, {**{n: np.full(1000, np.nan) for n in ("temp_magnet_degc", "id_a")},
                        **bare.arrays(*bare.tables[0].columns)}, slice(0, 1000))  # fmt: skip
    assert one.temp_magnet_degc == 25.0


# Torque


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


def test_columns_of_the_torque() -> None:
    points = [point(2.0, -1.0, cos_turn=0.5, sin_turn=-0.25, w=-5.0, temp_magnet_degc=35.0),
              point(-4.0, 3.0, group=1)]  # fmt: skip
    base, more = torque(points, -0.002)
    assert base["speed 0"].tolist() == [1.0, 0.0]
    assert base["iq"] == pytest.approx([2.0 * 0.98, -4.0])
    assert base["id iq"].tolist() == [-2.0, -12.0]
    expected = {
        "iq^3": [8.0, -64.0], "iq^5": [32.0, -1024.0], "|iq| sense": [-2.0, 4.0],
        "id": [-1.0, 3.0], "id sense": [1.0, 3.0], "id cos": [-0.5, 0.0], "id sin": [0.25, 0.0],
        "id^2 iq": [2.0, -36.0], "id iq^3": [-8.0, -192.0], "id^3 iq": [-2.0, -108.0],
        "id^2 iq^3": [8.0, -576.0], "iq^2 - id^2": [3.0, 7.0],
    }  # fmt: skip
    assert {name: column.tolist() for name, column in more.items()} == expected
    for share, there in ((0.097, False), (0.103, True)):
        pair = [point(-5.0, 0.0), point(5.0, share * 10.0)]
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
    values, covariance, dof, why = _drag(points, model)
    assert why == ""
    assert values == pytest.approx([0.1, 2e-3])
    design = np.column_stack([-np.sign(speeds), -np.array(speeds), np.ones(4)])
    inverse = np.linalg.inv(design.T @ design) @ design.T
    assert covariance == pytest.approx((inverse @ block @ inverse.T)[:2, :2])
    assert dof == 12
    # an offset that is off by much widens it, and has one degree of freedom
    off = [*offsets[:3], offsets[3] + 0.1]
    _, wide, dof, why = _drag(points, regression(model.names, off, block, dof=12))
    left = linear_fit(design, np.array(off)).residuals
    lack = float(left @ left) / 2.5e-6
    assert _lack(left, block, 1) == pytest.approx(lack)
    assert wide == pytest.approx(lack * covariance)
    assert dof == 1
    assert _untested_form(points, model, 0) == ()


def test_drag_needs_three_speeds_and_both_senses() -> None:
    for speeds in ((-100.0, 100.0), (50.0, 80.0, 120.0)):
        points, offsets = speeds_of(speeds)
        model = regression([f"speed {g}" for g in range(len(speeds))], offsets)
        assert "three speeds" in _drag(points, model)[3]
    points, offsets = speeds_of((-100.0, 40.0, 100.0))
    model = regression([f"speed {g}" for g in range(3)], offsets)
    assert _drag(points, model)[0] == pytest.approx([0.1, 2e-3])
    (dry,), (wet,) = _untested_form(points, model, 0), _untested_form(points, model, 1)
    assert dry.u == pytest.approx(0.1 * (0.1 + 2e-3 * 40.0))
    assert wet.u == pytest.approx(dry.u / 40.0)


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
    assert (_drag(points, model)[3] == "") is fine


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


# Resistance


def dc(i, pair="ab", *, r=1.0, v0=0.0, offset=0.0, temp=25.0, alpha=COPPER_COEFFICIENT_25_1_K,
       number=0, u_v=1e-4, u_i=1e-5, **meta):  # fmt: skip
    v = offset + v0 * math.copysign(1.0, i) + r * (1.0 + alpha * (temp - 25.0)) * i
    return DcPoint(number, pair, v, i, temp, u_v, u_i, replace(MAP.meta, **meta))


def plateaus(pair="ab", number=0, **how):
    return [dc(i, pair, number=number, **how) for i in (1.0, 2.0, -1.0, -2.0)]


def test_what_plateaus_can_tell_apart() -> None:
    found = columns_of([*plateaus("bc"), *plateaus("ab", 3), dc(2.0, "ca", number=7)])
    assert found.pairs == ("ab", "bc", "ca")
    assert found.offsets == (0, 3)
    assert found.drops == ("voltage@s",)
    assert (found.drop_start, found.size) == (5, 6)
    for ratio, there in ((1.19, False), (1.21, True)):
        two = [dc(1.0), dc(-1.0), dc(ratio)]
        assert bool(columns_of(two).drops) is there
    one_sign = columns_of([dc(1.0), dc(2.0)])
    assert (one_sign.offsets, bool(one_sign.drops)) == ((), True)


def test_the_row_of_a_plateau() -> None:
    columns = columns_of([*plateaus("ab"), *plateaus("bc", 1)])
    one = dc(-2.0, "bc", number=1, r=1.5, temp=45.0)
    row = terminal_voltage(one, columns, 0.004)
    factor = 1.08
    slope = 2.0 * COPPER_COEFFICIENT_25_1_K * 20.0 * one.v_v / factor
    assert row == pytest.approx([0.0, factor * -2.0, 0.0, 1.0, -1.0, slope])


@pytest.mark.parametrize("alpha", [0.0037, 0.0042])
def test_resistance_offset_drop_and_copper_from_plateaus(alpha: float) -> None:
    points = [*plateaus(v0=0.05, offset=0.02, temp=20.0, alpha=alpha),
              *plateaus(v0=0.05, offset=-0.01, temp=70.0, alpha=alpha, number=1)]  # fmt: skip
    columns = columns_of(points)
    free = fit_direct_current(points, columns, math.inf)
    assert free.alpha_1_k == pytest.approx(alpha, rel=1e-6)
    assert free.coefficients == pytest.approx([1.0, 0.02, -0.01, 0.05], rel=1e-6)
    assert free.dof == math.inf
    held = fit_direct_current(points, columns, 1e-9, alpha / COPPER_COEFFICIENT_25_1_K - 1.0)
    assert held.alpha_1_k == pytest.approx(alpha, rel=1e-6)
    assert held.u_alpha_1_k < 1e-9
    # the prior's own share is taken out of the scatter: alpha known from the data alone
    both_known = fit_direct_current(points, columns, 0.01)
    assert both_known.u_alpha_1_k < free.u_alpha_1_k


def test_the_scatter_of_a_resistance_by_hand() -> None:
    """Two signs of one current: R = (v+ - v-)/(2 i), u = hypot(u_v, R u_i)/(sqrt(2) i)."""
    points = [dc(2.0, u_v=3e-4, u_i=4e-4), dc(-2.0, u_v=3e-4, u_i=4e-4)]
    found = fit_direct_current(points, columns_of(points), 1e-9)
    assert found.coefficients == pytest.approx([1.0, 0.0], abs=1e-12)
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(5e-4 / math.sqrt(2.0) / 2.0)


def test_points_that_scatter_beyond_chance_widen_the_covariance() -> None:
    """Beyond 1 + 3 sqrt(2/n) of chi squared; with fewer than three points over, never."""
    for dof in (3, 8):
        limit = 1.0 + 3.0 * math.sqrt(2.0 / dof)
        for chi2, widened in ((0.99 * limit, False), (1.01 * limit, True)):
            normalised = np.full(4, math.sqrt(chi2 * dof / 4.0))
            assert _birge(normalised, dof) == pytest.approx(chi2 if widened else 1.0)
    assert _birge(np.full(4, 100.0), 2) == 1.0
    rough = [replace(p, v_v=p.v_v + s * 5e-3) for p, s in
             zip(plateaus() * 2, (1, -1, 1, 1, -1, -1, 1, -1), strict=True)]  # fmt: skip
    found = fit_direct_current(rough, columns_of(rough), 0.01)
    assert found.dof == 8 - 3
    assert math.sqrt(found.covariance[0, 0]) > 10.0 * 1e-4 / math.sqrt(20.0)


def test_a_drop_that_was_not_fitted_is_an_allowance_over_the_largest_current() -> None:
    options = {"drop_measured_v": 1e-3, "drop_commanded_v": 0.3}
    one = [dc(2.0), dc(-4.0)]
    columns = resistance.Columns(("ab",), (0,), ())
    assert _unknown_drop_ohm(one, columns, "ab", options) == pytest.approx(1e-3 / 4.0)
    driven = [dc(2.0, voltage_kind="commanded"), dc(-4.0)]
    assert _unknown_drop_ohm(driven, columns, "ab", options) == pytest.approx(0.3 / 4.0)
    fitted = resistance.Columns(("ab",), (0,), ("voltage@s",))
    assert _unknown_drop_ohm(one, fitted, "ab", options) == 0.0


def test_the_imbalance_is_the_range_over_the_mean() -> None:
    """U of the extremes' difference, widened by the range of three: 3.314/(1.96 sqrt 2)."""
    values = {"r_phase_ohm": 2.0, "r_a_ohm": 1.9, "r_b_ohm": 2.2, "r_c_ohm": 1.9 + 0.0}
    covariance = np.diag([0.0, 1e-4, 4e-4, 9e-4])
    covariance[1, 2] = covariance[2, 1] = 5e-5
    found = _imbalance(values, covariance, 7.0, [dc(2.0)], [MAP])
    assert found.number == pytest.approx(0.3 / 2.0)
    u = math.sqrt(1e-4 + 4e-4 - 1e-4) / 2.0 * 3.314 / (1.960 * math.sqrt(2.0))
    assert found.u_a == pytest.approx(u)


# Plots and doubts of rated inductances


def test_what_the_fastest_point_turns_while_currents_are_late() -> None:
    look = _Look([point(1.0, w=50.0), point(1.0, w=-300.0)], P, 0.0, [], 0.1, 2e-5)
    assert look.behind_rad == pytest.approx(2e-5 * P * 300.0)


def test_lines_of_a_published_inductance_go_through_the_flux_at_no_current() -> None:
    fluxes = flux_pairs(GRID, P)
    q, d = _evidence(fluxes, Result(LD, 0.0, -10.0, 5.0), Result(LQ, 0.0, 0.0, 10.0))
    for plot, slope in ((q, LQ), (d, LD)):
        assert len(plot.series) == 3
        for series in plot.series:
            assert np.all(np.diff(series.x) >= 0.0)
            if series.fitted.size > 1:
                assert np.diff(series.fitted) == pytest.approx(slope * np.diff(series.x))
            if np.any(np.abs(series.x) < 0.3) or plot is q:
                near = np.abs(series.x) < 0.3
                assert series.fitted[near] == pytest.approx(series.measured[near])
    labels = [series.label for series in q.series]
    assert labels == ["id_a -10 A", "id_a -5 A", "id_a 0 A"]
    zero = q.series[2]
    assert zero.x.tolist() == [0.0, 5.0, 10.0]
    assert zero.fitted == pytest.approx(zero.measured)
    assert _evidence([], None, None) == ()
