"""Heat runs and soaks: temperature coefficients of resistance, on small tables."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators import (
    heat_run,
    soak,
)
from pipeline.estimation.estimators.heat_run import _alpha_alone, _line, _resistance
from pipeline.estimation.thermal.heat_record import HeatRecord
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from tests.unit.estimation.signals import capture, estimates


def line_of(noise=0.0, alpha=0.0039, commanded=False, rate=1.0 / 60.0):
    t = np.arange(0.0, 300.0, 1.0)
    temp = 25.0 + 50.0 * -np.expm1(-t * rate)
    rng = np.random.default_rng(2)
    r = 0.4 * (1.0 + alpha * (temp - 25.0)) + noise * rng.standard_normal(t.size)
    made = capture("heat_run", "run", t_s=t, voltage_kind="commanded" if commanded else "measured")
    five = np.full(t.size, 5.0)
    return HeatRecord(made, t, r, five, five**2, temp, None, None, False, None)


def test_the_line_of_a_heat_run() -> None:
    record = line_of(1e-4)
    line = _line(record)
    assert line is not None
    assert line.r25_ohm == pytest.approx(0.4, rel=1e-3)
    assert line.slope_ohm_k == pytest.approx(0.4 * 0.0039, rel=5e-3)
    assert line.span_k == pytest.approx(np.ptp(record.temp_winding_degc))
    assert line.rise_rate_1_s == pytest.approx(1.0 / 60.0, rel=2e-2)
    assert line.rise_25_k_s == pytest.approx(50.0 / 60.0, rel=2e-2)
    excess = record.temp_winding_degc - 25.0
    fit = linear_fit(np.column_stack([np.ones(300), excess]), record.r_phase_ohm)
    tau = autocorrelation_time(fit.residuals)
    assert line.covariance == pytest.approx(fit.covariance * tau)
    assert line.dof == pytest.approx(298.0 / tau)
    assert _line(line_of(alpha=-0.001)) is None


@pytest.mark.parametrize(("rows", "there"), [(11, False), (12, True)])
def test_a_line_has_ten_rows_more_than_parameters(rows: int, there: bool) -> None:
    whole = line_of(1e-4)
    sampled = np.linspace(0, whole.t_s.size - 1, rows).round().astype(int)
    columns = ("t_s", "r_phase_ohm", "temp_winding_degc")
    few = replace(whole, **{name: getattr(whole, name)[sampled] for name in columns})
    assert (_line(few) is not None) is there


def test_alpha_and_r25_of_one_run_and_what_they_rest_on() -> None:
    """Alpha = s/R25 with their correlation; gains cancel; R25 by the thermometer's slope."""
    line = _line(line_of(1e-4))
    assert line is not None
    options = heat_run.ESTIMATOR.options
    r25 = _resistance(line, options, [])
    parts = {p.source: p.u for p in r25.budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * line.r25_ohm)
    assert parts["current@s"] == pytest.approx(-0.002 * line.r25_ohm)
    assert parts["temperature@s"] == pytest.approx(-0.5 * line.slope_ohm_k)
    assert parts["assumed:voltage_offset_v"] == pytest.approx(0.0005 / 5.0)
    driven = _resistance(replace(line, record=line_of(commanded=True)), options, [])
    assert {p.source: p.u for p in driven.budget}["assumed:voltage_offset_v"] == pytest.approx(0.06)
    alpha = _alpha_alone(line, r25, options, [])
    value = line.slope_ohm_k / line.r25_ohm
    assert alpha.number == pytest.approx(value)
    parts = {p.source: p.u for p in alpha.budget}
    assert abs(parts.get("voltage@s", 0.0)) < 1e-12
    assert parts["temperature@s"] == pytest.approx(value**2 * 0.5)
    lag_k = line.rise_rate_1_s + value * line.rise_25_k_s
    assert parts["assumed:thermometer_lag"] == pytest.approx(value * lag_k * 0.5)
    v, (a, b) = line.covariance, (-value / line.r25_ohm, 1.0 / line.r25_ohm)
    u = math.sqrt(a * a * v[0, 0] + b * b * v[1, 1] + 2.0 * a * b * v[0, 1])
    assert alpha.u_a == pytest.approx(u)


def soaked(temp, alpha=0.0038, pair="ab", noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    i = np.repeat([1.0, 2.0, -1.0, -2.0], 200) + 1e-6 * rng.standard_normal(800)
    v = 0.8 * (1.0 + alpha * (temp - 25.0)) * i + noise * rng.standard_normal(800)
    columns = {f"v{pair}_v": v, f"i{pair[0]}_a": i, "temp_winding_degc": np.full(800, temp)}
    return capture("resistance", f"{pair}{temp}", pair=pair, t_s=np.arange(800) * 1e-3, **columns)


@pytest.mark.parametrize(("span", "there"), [(9.9, False), (10.1, True)])
def test_copper_of_a_soaked_pair(span: float, there: bool) -> None:
    """Of the pairs that were measured ten kelvin apart; another pair does not count."""
    runs = [
        soaked(20.0, noise=1e-5),
        soaked(20.0 + span, noise=1e-5, seed=1),
        soaked(20.0, 0.009, "bc"),
    ]
    found = estimates(soak.ESTIMATOR, *runs)["temp_coeff_copper_1_k"]
    assert found.known is there
    if there:
        assert found.number == pytest.approx(0.0038, rel=1e-3)
        assert (found.at["temp_low_degc"], found.at["temp_high_degc"]) == pytest.approx(
            (20.0, 30.1)
        )
        parts = {p.source: p.u for p in found.budget}
        assert parts["temperature@s"] == pytest.approx(0.0038**2 * 0.5, rel=5e-3)
        assert abs(parts.get("voltage@s", 0.0)) < 1e-8


def test_a_coefficient_that_the_scatter_hides_is_not_published() -> None:
    """Within a fifth of itself it is."""
    rough = [soaked(20.0, noise=0.2, seed=3), soaked(31.0, noise=0.2, seed=4)]
    assert not estimates(soak.ESTIMATOR, *rough)["temp_coeff_copper_1_k"].known
    allowed = estimates(soak.ESTIMATOR, *rough, worst_u_rel=50.0)["temp_coeff_copper_1_k"]
    assert allowed.u_a > 0.2 * abs(allowed.number)


def test_a_thermometer_that_lags_is_in_the_budget_of_both_results() -> None:
    """By half a second: R25 too large by what the winding warms in it, the slope too small."""
    record = line_of(1e-5)
    warming = 50.0 / 60.0 * np.exp(-record.t_s / 60.0)
    late = _line(replace(record, temp_winding_degc=record.temp_winding_degc - 0.5 * warming))
    true = _line(record)
    assert late is not None and true is not None
    options = heat_run.ESTIMATOR.options
    of_r25 = {p.source: p.u for p in _resistance(true, options, []).budget}
    of_slope = {p.source: p.u for p in heat_run._slope_budget(true, options)}
    assert late.r25_ohm - true.r25_ohm == pytest.approx(-of_r25[heat_run.LAG], rel=0.05)
    assert late.slope_ohm_k - true.slope_ohm_k == pytest.approx(-of_slope[heat_run.LAG], rel=0.05)
