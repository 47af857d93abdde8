"""Certified fits of NIST StRD, and standard errors under correlated noise."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.least_squares import (
    autocorrelation_time,
    gauss_newton,
    linear_fit,
)
from pipeline.numerics.selection import needed_columns


def text(numbers):
    return np.array(numbers.split(), dtype=float)


def test_linear_fit_matches_nist_norris():
    """NIST StRD Norris: certified coefficients, standard errors and residual deviation."""
    x = text(
        "0.2 337.4 118.2 884.6 10.1 226.5 666.3 996.3 448.6 777.0 558.2 0.4 "
        "0.6 775.5 666.9 338.0 447.5 11.6 556.0 228.1 995.8 887.6 120.2 0.3 "
        "0.3 556.8 339.1 887.2 999.0 779.0 11.1 118.3 229.2 669.1 448.9 0.5"
    )
    y = text(
        "0.1 338.8 118.1 888.0 9.2 228.1 668.5 998.5 449.1 778.9 559.2 0.3 "
        "0.1 778.1 668.8 339.3 448.9 10.8 557.7 228.3 998.0 888.8 119.6 0.3 "
        "0.6 557.6 339.3 888.0 998.5 778.9 10.2 117.6 228.9 668.4 449.2 0.2"
    )
    fit = linear_fit(np.column_stack([np.ones(x.size), x]), y)
    assert fit.coefficients == pytest.approx([-0.262323073774029, 1.00211681802045], rel=1e-12)
    assert [fit.u(0), fit.u(1)] == pytest.approx([0.232818234301152, 0.429796848199937e-3])
    assert np.sqrt(fit.chi2_dof) == pytest.approx(0.884796396144373)
    assert fit.dof == 34


@pytest.mark.filterwarnings("error")
def test_no_freedom_is_no_certainty():
    """Two points on a line: exact coefficients, uncertainty without bound, no warning."""
    fit = linear_fit(np.array([[1.0, 0.0], [0.0, 1.0]]), np.array([3.0, 5.0]))
    assert fit.coefficients == pytest.approx([3.0, 5.0])
    assert fit.dof == 0
    assert [fit.u(0), fit.u(1)] == [np.inf, np.inf]


def test_correlated_rows_admit_fewer_columns():
    """60 rows that count as six have room for three columns: the base and two, at any level."""
    rng = np.random.default_rng(4)
    base = np.ones((60, 1))
    candidates = {f"c{k}": rng.standard_normal(60) for k in range(8)}
    y = np.sum(list(candidates.values()), axis=0)
    assert len(needed_columns(base, candidates, y, np.ones(60), 8.0, None, 10.0)) == 2
    assert len(needed_columns(base, candidates, y, np.ones(60), 8.0, 8, 10.0)) == 2
    assert len(needed_columns(base, candidates, y, np.ones(60), 8.0)) == 8


def test_gauss_newton_matches_nist_misra1a():
    """NIST StRD Misra1a, y = b1 (1 - exp(-b2 x)), from the certified file's first start."""
    y = text("10.07 14.73 17.94 23.93 29.61 35.18 40.02 44.82 50.76 55.05 61.01 66.40 75.47 81.78")
    x = text("77.6 114.9 141.1 190.8 239.9 289.0 332.8 378.4 434.8 477.3 536.8 593.1 689.1 760.0")

    def model(b):
        decay = np.exp(-b[1] * x)
        return b[0] * (1 - decay) - y, np.column_stack([1 - decay, b[0] * x * decay])

    fit = gauss_newton(model, np.array([500.0, 1e-4]), tolerance=1e-10, iterations=200)
    assert fit.converged
    assert fit.parameters == pytest.approx([2.3894212918e2, 5.5015643181e-4], rel=1e-8)
    scale = np.sqrt(fit.cost / 12)
    certified = [2.7070075241, 7.2668688436e-6]
    assert [fit.u(0) * scale, fit.u(1) * scale] == pytest.approx(certified, rel=1e-6)


def test_gauss_newton_stays_inside_bounds():
    def model(b):
        return np.array([b[0] + 1.0]), np.array([[1.0]])

    fit = gauss_newton(model, np.array([3.0]), low=np.array([0.0]))
    assert fit.parameters[0] == 0.0


def test_rank_is_reported_where_columns_coincide():
    x = np.arange(10.0)
    fit = linear_fit(np.column_stack([x, 2.0 * x]), x)
    assert fit.rank == 1
    assert not fit.full_rank


@pytest.mark.parametrize(("phi", "expected"), [(0.0, 1.0), (0.5, 3.0), (0.8, 9.0)])
def test_autocorrelation_time_of_first_order_noise(phi, expected):
    """(1 + phi)/(1 - phi) for an AR(1) process."""
    rng = np.random.default_rng(3)
    noise = rng.standard_normal(60_000)
    for k in range(1, noise.size):
        noise[k] += phi * noise[k - 1]
    assert autocorrelation_time(noise) == pytest.approx(expected, rel=0.12)
