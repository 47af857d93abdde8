"""One line voltage over one turn by hand, no angle: pole pairs from any start angle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.estimators.hand_turn import ESTIMATOR
from pipeline.numerics.integrals import REST, cubic, trapezoid
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from tests.unit.estimation.signals import capture, estimates

PSI = 5e-3
STARTS = 24


def by_hand(p, start, *, turns=1.0, rest_s=0.15, noise_v=1e-3, seed=0):
    """From rest to rest at an uneven pace; 4 mV offset, v = d/dt sqrt(3) psi cos(p theta)."""
    rng = np.random.default_rng(seed)
    rate_hz, moving_s = 2000.0, 1.5
    t_s = np.arange(round((moving_s + 2.0 * rest_s) * rate_hz)) / rate_hz
    u = np.clip((t_s - rest_s) / moving_s, 0.0, 1.0)
    wave = sum(
        d * np.sin(2.0 * np.pi * (k + 1) * u) / (k + 1)
        for k, d in enumerate(rng.uniform(-0.25, 0.25, 3))
    )
    pace = u**2 * (1.0 - u) ** 2 * (1.0 + wave)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]))])
    scale = 2.0 * math.pi * turns / area[-1]
    v = -math.sqrt(3.0) * PSI * p * scale * pace * rate_hz * np.sin(p * scale * area + start)
    table = pl.DataFrame({"t_s": t_s, "vab_v": v + 4e-3 + noise_v * rng.standard_normal(t_s.size)})
    meta = CaptureMeta("m", "hand_turn", station="s", u_rel_voltage=0.0, ambient_degc=25.0)
    return Capture("turn", "0" * 64, "verified", meta, (table,))


def found(p, start, **how):
    fit = ESTIMATOR.fit(
        Campaign("m", (by_hand(p, start, **how),)), Constants(), dict(ESTIMATOR.options)
    )
    return {e.name: e for e in fit.estimates}


def all_starts(p, **how):
    return [found(p, 2.0 * math.pi * k / STARTS, seed=k, **how) for k in range(STARTS)]


@pytest.mark.parametrize("noise_v", [pytest.param(1e-4, marks=pytest.mark.slow), 3e-3])
@pytest.mark.parametrize("p", [*(pytest.param(p, marks=pytest.mark.slow) for p in (1, 2)), 7, 14])
def test_pole_pairs_from_every_start_angle(p, noise_v):
    """Also where an extreme of the flux is passed just after the start or before the end."""
    runs = all_starts(p, noise_v=noise_v)
    assert [run["pole_pairs"].value for run in runs] == [p] * STARTS
    for run in runs:
        psi = run["psi_pm_wb"]
        assert psi.number == pytest.approx(PSI, rel=0.08 if p == 1 else 0.03)
        assert abs(psi.number - PSI) < 4.0 * psi.u_a


@pytest.mark.parametrize(
    "p", [pytest.param(2, marks=pytest.mark.slow), 7, pytest.param(14, marks=pytest.mark.slow)]
)
def test_a_hand_that_never_quite_rests(p):
    runs = all_starts(p, rest_s=0.0)
    assert [run["pole_pairs"].value for run in runs] == [p] * STARTS


@pytest.mark.parametrize(("p", "cycles"), [(2, 1.86), (7, 6.51)])
def test_a_turn_that_falls_short_is_refused_and_its_cycles_named(p, cycles):
    """0.93 of a turn ends at another flux than it started from."""
    for run in all_starts(p, turns=0.93):
        estimate = run["pole_pairs"]
        assert estimate.status == "not_identifiable"
        assert float(estimate.note.split()[0]) == pytest.approx(cycles, abs=0.03)


def test_a_short_cycle_of_one_pole_pair_is_told_where_the_voltage_is_clean():
    """Noise of 0.1 mV: 25 degrees short is seen at every start angle."""
    for run in all_starts(1, turns=0.93, noise_v=1e-4):
        assert run["pole_pairs"].status == "not_identifiable"


@pytest.mark.parametrize("p", [7, 14])
def test_one_voltage_has_the_freedom_of_its_own_rows(p):
    """Its scatter is seen in hundreds of rows, so 95 % are two u and not the 13 of one difference.

    Four of 24 turns outside would be three chances in a hundred.
    """
    fluxes = [run["psi_pm_wb"] for run in all_starts(p, noise_v=3e-3)]
    ends = [psi.interval() for psi in fluxes]
    assert all(high - low < 6.0 * psi.u for psi, (low, high) in zip(fluxes, ends, strict=True))
    assert sum(low <= PSI <= high for low, high in ends) > STARTS - 4


def test_a_measured_magnet_coefficient_stays_the_same_error():
    """Turned at 45 degC: 20 K of the coefficient's own errors, and nothing assumed beside them."""
    turn = by_hand(7, 0.3)
    warm = replace(turn, meta=replace(turn.meta, ambient_degc=45.0))
    coefficient = Estimate(
        "temp_coeff_magnet_1_k", -0.0011, "1/K", "measured", "given", type_b("x", 1e-5)
    )
    fit = ESTIMATOR.fit(Campaign("m", (warm,)), Constants((coefficient,)), dict(ESTIMATOR.options))
    psi = next(e for e in fit.estimates if e.name == "psi_pm_wb")
    parts = {part.source: part.u for part in psi.budget}
    assert parts["x"] == pytest.approx(-20.0 * 1e-5 * psi.number)
    assert "assumed:temp_coeff_magnet_1_k" not in parts


@pytest.mark.parametrize("rule", [trapezoid, cubic])
def test_a_straight_line_is_integrated_exactly_on_an_uneven_clock(rule):
    t_s = np.cumsum(np.random.default_rng(0).uniform(0.9, 1.1, 50))
    expected = 1.5 * (t_s**2 - t_s[0] ** 2) + 2.0 * (t_s - t_s[0])
    assert rule(t_s, 3.0 * t_s + 2.0) == pytest.approx(expected, rel=1e-12)


def test_the_integral_of_a_sine_is_short_by_a_fourth_power_of_its_step():
    """The trapezoid alone is short by a second power: 2 % here for 0.1 %."""
    t_s = np.arange(1000) * 0.5
    flux = cubic(t_s, np.exp(1j * t_s))
    size = float(np.std(flux[1:-1]))
    assert size - 1.0 == pytest.approx(-REST * 0.5**4, rel=0.1)


def test_a_gap_is_bridged_by_a_straight_line():
    """Slopes of noise beside a gap of 100 rows would stand for a hundred steps."""
    t_s = np.delete(np.arange(400) * 1e-3, np.s_[150:250])
    v = np.random.default_rng(1).standard_normal(t_s.size)
    flux = cubic(t_s, v)
    assert flux[150] - flux[149] == pytest.approx(0.5 * (v[149] + v[150]) * 0.101)


@pytest.mark.parametrize("rate_hz", [100.0, 150.0, 200.0, 500.0])
@pytest.mark.parametrize("columns", [("vab_v",), ("vab_v", "vbc_v"), ("vab_v", "theta_mech_rad")])
def test_few_rows_a_cycle_do_not_bend_the_flux(columns, rate_hz):
    """A turn of p = 7 in 1.5 s, 11 to 54 rows in its fastest cycle: psi is low within three u_a,
    and where the phase is known at every row by a tenth of what trapezoids would take.
    """
    rng = np.random.default_rng(0)
    t_s = np.arange(round(2.1 * rate_hz)) / rate_hz
    u = np.clip((t_s - 0.3) / 1.5, 0.0, 1.0)
    theta = 2.0 * math.pi * (u - np.sin(2.0 * math.pi * u) / (2.0 * math.pi)) + 0.4
    omega = 2.0 * math.pi * (1.0 - np.cos(2.0 * math.pi * u)) / 1.5
    v = [-7.0 * PSI * omega * np.sin(7.0 * theta - 2.0 * math.pi * k / 3.0) for k in range(3)]
    noise = 2e-4 * rng.standard_normal((2, t_s.size))
    data = {
        "vab_v": v[0] - v[1] + noise[0],
        "vbc_v": v[1] - v[2] + noise[1],
        "theta_mech_rad": theta,
    }
    turn = capture("hand_turn", t_s=t_s, **{name: data[name] for name in columns})
    psi = estimates(ESTIMATOR, turn)["psi_pm_wb"]
    assert abs(psi.number - PSI) < 3.0 * psi.u_a
    if len(columns) == 2:
        step = 7.0 * float(omega.max()) / rate_hz
        assert abs(psi.number / PSI - 1.0) < 0.1 * step**2 / 12.0


@pytest.mark.parametrize("columns", [("vab_v",), ("vab_v", "vbc_v")])
def test_one_row_is_no_turn(columns):
    turn = capture("hand_turn", t_s=np.zeros(1), **{name: np.ones(1) for name in columns})
    assert estimates(ESTIMATOR, turn)["psi_pm_wb"].status == "not_identifiable"
