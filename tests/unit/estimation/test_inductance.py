"""Ld and Lq from steps and meter readings written out in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.electrical.terminals import PAIRS
from pipeline.estimation.estimators import (
    current_step,
    lcr,
)
from pipeline.estimation.policy import changed, under
from pipeline.records.capture import Capture, CaptureMeta
from tests.unit.estimation.signals import capture, estimates, near

# Current step


def step_capture(
    pair, theta_deg, volts, l_ll, *, seed, timing="instant", edge=0.3, r=0.8, i_sigma=2e-3
):
    """Exact response of a constant L; the edge lies `edge` of a sample before a sample."""
    rng = np.random.default_rng(seed)
    dt, n, tau = 1e-5, 3000, l_ll / r
    t = np.arange(n) * dt
    on, off = (200 - edge) * dt, (2000 - edge) * dt

    def area(x):
        return np.clip(x - on, 0.0, off - on) * volts

    def rise(x):
        return -np.expm1(-np.maximum(x, 0.0) / tau)

    voltage = {
        "instant": volts * ((t >= on) & (t < off)),
        "held": (area(t + dt) - area(t)) / dt,
        "centred": (area(t + dt / 2) - area(t - dt / 2)) / dt,
    }[timing]
    current = volts / r * (rise(t - on) - rise(t - off)) + 0.03
    columns = {
        "t_s": t,
        f"v{pair}_v": voltage + 1e-3 * rng.standard_normal(n),
        f"i{pair[0]}_a": current + i_sigma * rng.standard_normal(n),
    }
    meta = {"pair": pair, "theta_elec_deg": theta_deg, "voltage_timing": timing}
    return capture("current_step", f"{pair}_{theta_deg}_{volts}", **meta, **columns)


def terminal(pair, theta_deg, ld, lq):
    turn = math.radians(2 * theta_deg + {"ab": 60.0, "bc": -180.0, "ca": -60.0}[pair])
    return (ld + lq) + (ld - lq) * math.cos(turn)


@pytest.mark.parametrize(
    ("timing", "edge"),
    [
        ("instant", 0.9),
        pytest.param("held", 0.0, marks=pytest.mark.slow),
        ("centred", 0.5),
        *(pytest.param("instant", edge, marks=pytest.mark.slow) for edge in (0.0, 0.5)),
        *(pytest.param("centred", edge, marks=pytest.mark.slow) for edge in (0.0, 0.9)),
    ],
)
def test_the_edge_between_samples_does_not_bias_l(timing, edge):
    """A trapezoid across the edge would be half a sample off: 1 % of L here."""
    captures = [
        step_capture(
            "ab",
            theta,
            v,
            terminal("ab", theta, 2e-4, 3e-4),
            seed=k,
            timing=timing,
            edge=edge,
        )
        for k, (theta, v) in enumerate([(-30.0, 4.0), (-30.0, -4.0), (60.0, 4.0), (60.0, -4.0)])
    ]
    found = estimates(current_step.ESTIMATOR, *captures)
    assert near(found["ld_h"], 2e-4)
    assert near(found["lq_h"], 3e-4)
    assert found["ld_h"].u_a < 3e-4 * 2e-4


def test_any_pair_at_any_angle():
    places = [("ab", 10.0), ("bc", 35.0), ("ca", 100.0), ("ca", 170.0)]
    captures = [
        step_capture(pair, theta, 3.0, terminal(pair, theta, 1.5e-4, 4e-4), seed=k)
        for k, (pair, theta) in enumerate(places)
    ]
    found = estimates(current_step.ESTIMATOR, *captures)
    assert near(found["ld_h"], 1.5e-4)
    assert near(found["lq_h"], 4e-4)


def test_gains_enter_l_as_voltage_over_current():
    captures = [step_capture("ab", -30.0, v, 4e-4, seed=k) for k, v in enumerate((3.0, 5.0))]
    found = estimates(current_step.ESTIMATOR, *captures)
    sources = {part.source: part.u for part in found["ld_h"].budget}
    assert sources["voltage@s"] == pytest.approx(0.001 * 2e-4, rel=0.02)
    assert sources["current@s"] == pytest.approx(-0.002 * 2e-4, rel=0.02)
    assert found["lq_h"].status == "not_identifiable"
    assert "q axis" in found["lq_h"].note


def test_saturation_is_extrapolated_to_zero_current():
    """I = (psi/L)(1 + k psi²) integrated with 50 substeps; 17 % less L at the largest current."""
    rng = np.random.default_rng(8)
    captures = []
    for volts in (0.8, 2.4, 4.0):
        psi, current, dt, n = 0.0, np.zeros(3000), 1e-5, 3000
        for k in range(n):
            v = volts if 200 <= k < 2000 else 0.0
            current[k] = psi / 6e-4 * (1 + 2e4 * psi**2)
            for _ in range(10):
                i_mid = psi / 6e-4 * (1 + 2e4 * psi**2)
                mid = psi + 0.5e-6 * (v - 0.8 * i_mid)
                psi += 1e-6 * (v - 0.8 * (mid / 6e-4 * (1 + 2e4 * mid**2)))
        columns = {
            "t_s": np.arange(n) * dt,
            "vab_v": np.where((np.arange(n) >= 200) & (np.arange(n) < 2000), volts, 0.0)
            + 1e-3 * rng.standard_normal(n),
            "ia_a": current + 2e-3 * rng.standard_normal(n),
        }
        captures.append(
            capture("current_step", f"{volts}", pair="ab", theta_elec_deg=60.0, **columns)
        )
    found = estimates(current_step.ESTIMATOR, *captures)["lq_h"]
    assert found.number == pytest.approx(3e-4, rel=1.5e-3)
    assert "incremental -" in found.note


# LCR


STEPS = [(-30.0, 4.0), (-30.0, -4.0), (60.0, 4.0), (60.0, -4.0)]


def steps_with_a_slow_clock(factor):
    """Four steps of one rotor, the second with its time multiplied."""
    captures = [
        step_capture("ab", theta, v, terminal("ab", theta, 2e-4, 3e-4), seed=k)
        for k, (theta, v) in enumerate(STEPS)
    ]
    slow = captures[1].tables[0].with_columns(pl.col("t_s") * factor)
    captures[1] = replace(captures[1], tables=(slow,))
    return captures


@pytest.mark.filterwarnings("error")
def test_a_step_of_another_clock_is_named_and_no_number_is_made_of_it():
    """A common fit follows the slow capture: 0.2 H with a small u, or a NaN."""
    captures = steps_with_a_slow_clock(1e3)
    found = estimates(current_step.ESTIMATOR, *captures)
    assert {e.status for e in found.values()} == {"not_identifiable"}
    for estimate in found.values():
        assert captures[1].path in estimate.note and captures[0].path not in estimate.note


@pytest.mark.slow
@pytest.mark.filterwarnings("error")
def test_no_number_is_made_of_a_search_for_l_that_fits_no_step():
    """Fault: one clock off by a thousand. Unbounded, an edge runs off and the current overflows."""
    with under(changed({"policy": {"steps": {"most_apart": 1e300}}})):
        found = estimates(current_step.ESTIMATOR, *steps_with_a_slow_clock(1e3))
    for estimate in found.values():
        assert estimate.status == "not_identifiable"
        assert "no step on a locked rotor" in estimate.note


def lcr_capture(offset_deg, pairs=("ab",), angles=None, seed=0):
    rng = np.random.default_rng(seed)
    angles = np.arange(0.0, 360.0, 15.0) if angles is None else np.array(angles)
    columns = {
        f"l{p}_h": np.array([terminal(p, a + offset_deg, 2e-4, 3e-4) for a in angles])
        + 4e-7 * rng.standard_normal(angles.size)
        for p in pairs
    }
    return columns, angles


def test_lcr_over_angle_finds_a_rotor_zero_that_is_off():
    columns, angles = lcr_capture(12.0)
    found = estimates(lcr.ESTIMATOR, capture("lcr", theta_elec_deg=angles, **columns))
    assert near(found["ld_h"], 2e-4)
    assert near(found["lq_h"], 3e-4)
    assert abs(found["lcr_angle_offset_deg"].number) == pytest.approx(12.0, abs=0.5)


def test_three_pairs_at_one_unknown_angle_give_both():
    columns, _ = lcr_capture(0.0, ("ab", "bc", "ca"), [37.0] * 4)
    found = estimates(lcr.ESTIMATOR, capture("lcr", **columns))
    assert found["ld_h"].number == pytest.approx(2e-4, rel=3e-3)
    assert found["lq_h"].number == pytest.approx(3e-4, rel=3e-3)
    assert "rotor angle unknown" in found["ld_h"].note


@pytest.mark.parametrize("seed", range(8))
def test_equal_inductances_at_an_unknown_angle_are_not_parted_by_their_noise(seed):
    """Twenty positions, 0.2 % of noise: sorted by size the low one would be 0.2 % low each time,
    three of its own standard uncertainties, and the ratio of the two the wrong side of one.
    """
    rng = np.random.default_rng(seed)
    columns = {f"l{p}_h": 4e-4 * (1.0 + 2e-3 * rng.standard_normal(20)) for p in ("ab", "bc", "ca")}
    found = estimates(lcr.ESTIMATOR, capture("lcr", **columns))
    assert found["ld_h"].number == found["lq_h"].number == pytest.approx(2e-4, rel=1e-3)
    assert near(found["ld_h"], 2e-4, 2.0)
    assert found["ld_h"].u_a < 1e-6
    assert "cannot be distinguished" in found["ld_h"].note


def test_a_small_saliency_beyond_the_noise_is_told():
    """3 % at twenty unknown angles, ten times what the noise of one position makes."""
    rng = np.random.default_rng(0)
    angles = rng.uniform(0.0, 360.0, 20)
    columns = {
        f"l{p}_h": np.array([terminal(p, a, 2e-4, 2.065e-4) for a in angles])
        + 8e-7 * rng.standard_normal(20)
        for p in ("ab", "bc", "ca")
    }
    found = estimates(lcr.ESTIMATOR, capture("lcr", **columns))
    assert found["lq_h"].number / found["ld_h"].number == pytest.approx(1.0325, abs=3e-3)


def test_three_pairs_at_a_stated_angle_tell_the_axes():
    """Ld above Lq, which the guess 'low is d' would exchange."""
    columns = {f"l{p}_h": np.array([terminal(p, 0.0, 3e-4, 2e-4)] * 3) for p in ("ab", "bc", "ca")}
    meta = CaptureMeta("m", "lcr", theta_elec_deg=0.0)
    one = Capture("c", "0" * 64, "verified", meta, (pl.DataFrame(columns),))
    found = estimates(lcr.ESTIMATOR, one)
    assert found["ld_h"].number == pytest.approx(3e-4)
    assert found["lq_h"].number == pytest.approx(2e-4)


@pytest.mark.parametrize("inductances_h", [(3e-4, 2e-4), (2e-4, 3e-4)])
def test_one_position_at_a_stated_angle_tells_the_axes(inductances_h):
    """Three readings: too few for a fit over the angle, and 20 degrees off either axis."""
    columns = {f"l{p}_h": np.array([terminal(p, 20.0, *inductances_h)]) for p in PAIRS}
    found = estimates(lcr.ESTIMATOR, capture("lcr", theta_elec_deg=np.array([20.0]), **columns))
    assert (found["ld_h"].number, found["lq_h"].number) == pytest.approx(inductances_h)
    assert found["lcr_angle_offset_deg"].status == "not_identifiable"
    assert "rotor angle unknown" not in found["ld_h"].note


def test_the_scatter_of_a_rotor_zero_is_that_of_its_noise():
    """24 angles, s = 0.4 uH, Lq - Ld = 100 uH: each part of the swing is known to s sqrt(2/24), the
    angle to half of that share of it. 60 tables tell their mean to 15 %/sqrt(60).
    """
    angles = np.arange(0.0, 360.0, 15.0)
    u = []
    for seed in range(60):
        columns, _ = lcr_capture(12.0, seed=seed)
        found = estimates(lcr.ESTIMATOR, capture("lcr", theta_elec_deg=angles, **columns))
        u.append(found["lcr_angle_offset_deg"].u_a)
    expected = 0.5 * math.degrees(4e-7 * math.sqrt(2.0 / 24.0) / 1e-4)
    assert np.sqrt(np.mean(np.square(u))) == pytest.approx(expected, rel=0.06)
