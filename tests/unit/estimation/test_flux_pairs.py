"""Flux linkages from pairs of operating points, and the inductances they give, by hand."""

from __future__ import annotations

import cmath
import math
from dataclasses import replace

import numpy as np
import pytest

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
from pipeline.estimation.estimators.inductance_rated import (
    Result,
    _direct,
    _evidence,
    _hold_doubt,
    _Look,
    _other_side,
    _quadrature,
    _without_ripple,
)
from tests.unit.estimation.points import GRID, LD, LQ, MAP, PSI, P, R, W, both, point
from tests.unit.estimation.signals import known_value


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


def test_a_vector_held_for_a_period_bends_the_flux_off_its_circle() -> None:
    """The flux goes along a chord; what it lacks of the circle, over L, drops R in the mean."""
    period, resistance, magnet = 2e-3, 0.5, 0.01
    held = replace(MAP, meta=replace(MAP.meta, voltage_timing="held"))
    points = [replace(p, capture=held) for p in GRID]
    given = known_value("r_phase_ohm", resistance, unit="ohm")
    corrected = _without_ripple([replace(p, period_s=period) for p in points], P, magnet, given)
    moved = [
        complex(new.vd_v - old.vd_v, new.vq_v - old.vq_v)
        for new, old in zip(corrected, points, strict=True)
    ]
    first = flux_pairs([replace(p, period_s=period) for p in points], P)
    ld, lq = _direct(first, magnet), _quadrature(first, magnet)
    assert ld is not None and lq is not None
    omega = P * points[0].omega_mech_rad_s
    t = np.linspace(0.0, period, 2001)
    for one, found in zip(points, moved, strict=True):
        centre = instant_voltage(replace(one, period_s=period), P)
        flux = centre / (1j * omega)
        ends = flux * np.exp(1j * omega * np.array([0.0, period]))
        chord = ends[0] + (ends[1] - ends[0]) * t / period
        lacks = np.mean(flux - chord * np.exp(-1j * omega * t))
        current = complex(lacks.real / ld.value_h, lacks.imag / lq.value_h)
        expected = resistance * current * np.exp(0.5j * omega * period)
        assert found == pytest.approx(expected, rel=0.05, abs=1e-4)


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
    # more positive than negative d current: the larger
    less = [replace(f, id_a=-5.0) if f.id_a == -8.0 else f for f in fluxes]
    larger = _direct(less, 0.0)
    assert larger is not None
    assert larger.id_a == 8.0
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
    centred = replace(MAP, meta=replace(MAP.meta, voltage_timing="centred", pwm_hz=1000.0))
    points = [point(1.0, w=w, source=centred, period=1e-3) for w in (100.0, -400.0)]
    halves = [0.5 * P * w * 1e-3 for w in (100.0, 400.0)]
    expected = sum(1.0 / math.cos(h) - 1.0 for h in halves) / 2.0 / math.sqrt(3.0)
    assert _hold_doubt([*points, point(1.0)], P) == pytest.approx(expected)
    assert _hold_doubt([point(1.0)], P) == 0.0
    fast = [point(1.0, w=1e4, source=centred, period=1e-3)]
    assert _hold_doubt(fast, P) == pytest.approx((1.0 / math.cos(1.0) - 1.0) / math.sqrt(3.0))
    unstated = replace(centred, meta=replace(centred.meta, pwm_hz=None))
    assert _hold_doubt([replace(fast[0], capture=unstated)], P) == 0.0, "slower than any inverter"


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
