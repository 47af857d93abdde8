"""Flux linkages of open windings and their temperature coefficient, on small tables."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.electrical.back_emf import StretchFlux
from pipeline.estimation.electrical.spin_angle import Group
from pipeline.estimation.estimators import (
    open_circuit,
)
from pipeline.numerics.least_squares import linear_fit
from tests.unit.estimation.signals import capture


def group(psi, u, temp=25.0, harmonics=None, u_harmonic=1e-3, **meta):
    logged = {"temp_magnet_degc": np.full(2, temp)}
    made = capture("open_circuit", f"{psi}", t_s=np.arange(2.0), **logged, **meta)
    flux = StretchFlux(psi, u, harmonics or {}, u_harmonic, 100.0, temp, 1.0)
    return Group(made, None, None, flux, temp)  # type: ignore[arg-type]


def test_flux_and_its_coefficient_from_steady_speeds() -> None:
    """Three temperatures with their own u: weighted line, alpha by the ratio's gradient."""
    groups = [group(0.01000, 1e-6), group(0.00981, 2e-6, 45.0), group(0.009621, 1e-6, 65.0)]
    options = open_circuit.ESTIMATOR.options
    found = open_circuit._flux_estimates(groups, [], options)
    psi, alpha = found["psi_pm_wb"], found["temp_coeff_magnet_1_k"]
    excess = np.array([0.0, 20.0, 40.0])
    fit = linear_fit(
        np.column_stack([np.ones(3), excess]),
        np.array([0.01000, 0.00981, 0.009621]),
        np.array([1e-6, 2e-6, 1e-6]),
    )
    value, slope = fit.coefficients
    assert psi.number == pytest.approx(value)
    assert alpha.number == pytest.approx(slope / value)
    v, (a, b) = fit.covariance, (-slope / value**2, 1.0 / value)
    u = math.sqrt(a * a * v[0, 0] + b * b * v[1, 1] + 2 * a * b * v[0, 1])
    assert alpha.u_a == pytest.approx(u)
    parts = {p.source: p.u for p in psi.budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * value)
    assert parts["temperature@s"] == pytest.approx(-value * alpha.number * 0.5)
    parts = {p.source: p.u for p in alpha.budget}
    assert parts["temperature@s"] == pytest.approx(alpha.number**2 * 0.5)
    assert psi.at["temp_measured_high_degc"] == 65.0


@pytest.mark.parametrize(("span", "measured"), [(7.9, False), (8.1, True)])
def test_a_coefficient_needs_eight_kelvin(span: float, measured: bool) -> None:
    groups = [group(0.01, 1e-9), group(0.01 * (1.0 - 0.002 * span), 1e-9, 25.0 + span)]
    found = open_circuit._flux_estimates(groups, [], open_circuit.ESTIMATOR.options)
    assert found["temp_coeff_magnet_1_k"].known is measured


@pytest.mark.parametrize(("share", "measured"), [(0.97, True), (1.03, False)])
def test_a_coefficient_is_known_to_three_ten_thousandths(share: float, measured: bool) -> None:
    """Two equal u 20 K apart: u_alpha is near sqrt(2) u / (20 psi)."""
    alpha = -0.002
    both = math.hypot(1.0, 1.0 + 20.0 * alpha)
    u = share * 3e-4 * 20.0 * 0.01 / both
    groups = [group(0.01, u), group(0.01 * (1.0 + 20.0 * alpha), u, 45.0)]
    found = open_circuit._flux_estimates(groups, [], open_circuit.ESTIMATOR.options)
    assert found["temp_coeff_magnet_1_k"].known is measured


def test_an_assumed_coefficient_acts_by_its_lever() -> None:
    """One temperature, 20 K above: psi25 = psi/(1 + 20 alpha), and d psi25/d alpha over it."""
    groups = [group(0.0098, 1e-6, 45.0)]
    options = open_circuit.ESTIMATOR.options
    found = open_circuit._flux_estimates(groups, [], options)["psi_pm_wb"]
    factor = 1.0 - 0.0011 * 20.0
    assert found.number == pytest.approx(0.0098 / factor)
    parts = {p.source: p.u for p in found.budget}
    assert parts[open_circuit.SOURCE] == pytest.approx(-found.number * 20.0 / factor * 4e-4)


@pytest.mark.parametrize(("dof", "times"), [(2, 0.98), (2, 1.02), (7, 0.98), (7, 1.02)])
def test_scatter_beyond_chance_is_three_deviations_of_chi_squared(dof: int, times: float) -> None:
    limit = 1.0 + 3.0 * math.sqrt(2.0 / dof)
    assert open_circuit._beyond_chance(times * limit, dof) is (times > 1.0)
    assert not open_circuit._beyond_chance(1e9, 0)


def test_a_harmonic_is_the_weighted_mean_of_complex_ratios() -> None:
    """0.03 with u 1e-3 and 0.03j with u 2e-3: weights 4 to 1."""
    groups = [group(0.01, 1e-6, harmonics={5: 0.03}, u_harmonic=1e-3),
              group(0.0101, 1e-6, harmonics={5: 0.03j}, u_harmonic=2e-3)]  # fmt: skip
    found = open_circuit._harmonics(groups, tuple(g.capture for g in groups))
    fifth = found["bemf_harmonic_5"]
    mean = complex(0.8 * 0.03, 0.2 * 0.03)
    assert fifth.number == pytest.approx(abs(mean))
    chi2 = abs(0.03 - mean) ** 2 * 1e6 + abs(0.03j - mean) ** 2 * 0.25e6
    u = math.sqrt(chi2 / 2.0 / 1.25e6)
    assert fifth.u_a == pytest.approx(u)
    assert [p.dof for p in fifth.budget] == [2.0]
    assert "21 samples a cycle" in found["bemf_harmonic_7"].note
    for size, note in ((0.0029, "within noise of zero"), (0.0031, "")):
        one = [group(0.01, 1e-6, harmonics={5: complex(0.0, size)})]
        assert open_circuit._harmonics(one, (one[0].capture,))["bemf_harmonic_5"].note == note


def test_a_source_counts_by_the_weight_read_through_it() -> None:
    groups = [group(0.01, 1e-6), group(0.0101, 2e-6, station="other", u_rel_voltage=0.004)]
    gains, offsets_k = open_circuit._instrument_shares(groups, tuple(g.capture for g in groups))
    assert gains == pytest.approx({"voltage@s": 0.0008, "voltage@other": 0.0008})
    assert offsets_k == pytest.approx({"temperature@s": 0.4, "temperature@other": 0.1})


def test_plots_of_flux_over_speed_have_the_line_of_their_temperature() -> None:
    """Psi 10 mWb at 25 degC, 0.1 % less a kelvin; the line is psi(T) times the speed."""
    groups = [group(0.01 * (1.0 - 0.001 * (t - 25.0)), 1e-7, t) for t in (25.0, 45.0, 65.0)]
    psi = open_circuit._flux_estimates(groups, [], open_circuit.ESTIMATOR.options)["psi_pm_wb"]
    amplitude, flux = open_circuit._evidence(groups, psi)
    for g, line_, plain in zip(groups, amplitude.series, flux.series, strict=True):
        assert plain.fitted == pytest.approx([g.flux.psi_wb])
        assert plain.measured == pytest.approx([g.flux.psi_wb])
        assert line_.fitted == pytest.approx([g.flux.psi_wb * 100.0])
