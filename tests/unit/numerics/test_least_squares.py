"""Certified fits of NIST StRD, and standard errors under correlated noise."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.optimize import lsq_linear

from pipeline.numerics.least_squares import (
    autocorrelation_time,
    central_jacobian,
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


@pytest.mark.parametrize(
    ("runs", "longest", "expected"),
    [
        ((8, 8), None, 5.375),
        ((8, 8), 15, 5.375),
        ((8, 8), 3, 4.75),
        ((8, 8), 2, 2.625),
        ((8, 8), 0, 1.0),
        ((4, 4, 4, 4), None, 2.125),
        ((3, 4, 2, 4, 3), None, 1.0),
        ((4, 3), None, 1.0),
        ((4, 4), None, 1.0),
        ((1,) * 32, None, 1.0),
    ],
)
def test_autocorrelation_time_of_runs_of_one_and_minus_one(runs, longest, expected):
    """Sixteen samples: rho_1 = (15 - 2 changes)/16, which is noise below 2/sqrt(16) = 1/2.

    Two runs of eight: rho_k = (16 - 3 k)/16; pairs 29/16, 17/16, 5/16 up to lag 5, then below 0.
    Four runs of four: rho = 1, 9/16, then 2/16 - 5/16 < 0 ends the sum: 2 * 25/16 - 1 = 2.125.
    """
    signs = np.repeat(np.where(np.arange(len(runs)) % 2, -1.0, 1.0), runs)
    assert autocorrelation_time(signs, longest) == pytest.approx(expected, rel=1e-12)


def test_autocorrelation_time_needs_eight_samples_and_some_power():
    assert autocorrelation_time(np.full(50, 3.0)) == 1.0
    ramp = np.arange(8.0)  # rho = 1, 5/8, ...: below 2/sqrt(8)
    assert autocorrelation_time(ramp) == 1.0
    ramp = np.arange(40.0)
    assert autocorrelation_time(ramp) == autocorrelation_time(5.0 - 2.0 * ramp) > 10.0


def test_known_sigma_gives_its_own_covariance():
    """(X'WX)^-1 by hand: a mean of weights 1/sigma², and chi² per degree of freedom."""
    sigma, y = np.array([0.5, 1.0, 2.0, 1.0]), np.array([1.0, 2.0, 5.0, 4.0])
    weight = sigma**-2
    fit = linear_fit(np.ones((4, 1)), y, sigma)
    mean = (weight * y).sum() / weight.sum()
    assert fit.coefficients == pytest.approx([mean])
    assert fit.u(0) == pytest.approx(1.0 / np.sqrt(weight.sum()))
    assert fit.chi2_dof == pytest.approx((weight * (y - mean) ** 2).sum() / 3.0)
    assert (fit.dof, fit.rank) == (3, 1)


def test_an_empty_column_takes_nothing_and_spoils_nothing():
    x = np.arange(6.0)
    fit = linear_fit(np.column_stack([x, np.zeros(6)]), 3.0 * x)
    assert fit.coefficients == pytest.approx([3.0, 0.0])
    assert fit.rank == 1


@pytest.mark.parametrize(("angle", "rank"), [(3e-10, 2), (0.5e-10, 1)])
def test_columns_part_down_to_the_rank_tolerance(angle, rank):
    """Two unit columns at an angle a have singular values near sqrt 2 and a/sqrt 2."""
    columns = np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)], [0.0, 0.0]])
    assert linear_fit(columns, np.ones(3)).rank == rank


def boxed(seed):
    """A random linear problem whose minimum lies outside the box [0, 0.3]^4."""
    rng = np.random.default_rng(seed)
    a, b = rng.standard_normal((12, 4)), rng.standard_normal(12)
    return a, b


@pytest.mark.parametrize("seed", range(6))
def test_gauss_newton_in_a_box_against_scipy(seed):
    """Bounds that hold and bounds that let go: scipy's active-set solver finds the same point."""
    a, b = boxed(seed)
    low, high = np.zeros(4), np.full(4, 0.3)
    known = lsq_linear(a, b, (low, high), method="bvls", tol=1e-14).x
    fit = gauss_newton(lambda x: (a @ x - b, a), np.array([0.0, 0.3, 0.1, 0.9]), low, high)
    assert fit.converged
    assert fit.parameters == pytest.approx(known, abs=1e-6)
    assert fit.cost == pytest.approx(float(((a @ known - b) ** 2).sum()), rel=1e-9)


def test_one_step_solves_a_linear_problem():
    a, b = boxed(1)
    fit = gauss_newton(lambda x: (a @ x - b, a), np.full(4, 5.0), iterations=1)
    assert fit.parameters == pytest.approx(np.linalg.lstsq(a, b)[0], rel=1e-10)
    assert not fit.converged
    assert np.allclose(fit.covariance, np.linalg.inv(a.T @ a), rtol=1e-9)
    assert fit.u(2) == pytest.approx(np.sqrt(np.linalg.inv(a.T @ a)[2, 2]))


def test_gauss_newton_follows_the_banana_valley():
    """Rosenbrock's function from its standard start: full steps rise, shorter ones reach (1, 1)."""

    def model(x):
        residuals = np.array([10.0 * (x[1] - x[0] ** 2), 1.0 - x[0]])
        return residuals, np.array([[-20.0 * x[0], 10.0], [-1.0, 0.0]])

    fit = gauss_newton(model, np.array([-1.2, 1.0]), iterations=100)
    assert fit.converged
    assert fit.parameters == pytest.approx([1.0, 1.0], abs=1e-6)


def test_a_step_that_leads_nowhere_is_shortened():
    """Of arctan from 3 full steps diverge (|x| > 1.39), and a model may end in infinity."""

    def model(x):
        wild = np.abs(x) > 10.0
        return np.where(wild, np.inf, np.arctan(x)), np.diag(1.0 / (1.0 + x**2))

    fit = gauss_newton(model, np.array([3.0]))
    assert fit.converged
    assert fit.parameters == pytest.approx([0.0], abs=1e-6)


def test_central_differences_are_exact_on_parabolas():
    def function(x):
        return np.array([x[0] ** 2 + 3.0 * x[1], x[0] * x[1], 7.0])

    jacobian = central_jacobian(function, np.array([2.0, -5.0]), np.array([0.5, 0.25]))
    assert np.allclose(jacobian, [[4.0, 3.0], [-5.0, 2.0], [0.0, 0.0]], atol=1e-12)


def test_a_coefficient_that_no_row_tells_has_no_uncertainty_of_the_minimum_norm():
    """Two columns that coincide and one that is told by itself."""
    rng = np.random.default_rng(3)
    common, alone = rng.standard_normal((2, 200))
    fit = linear_fit(np.column_stack([common, common, alone]), common + alone, 1e-3)
    assert [fit.u(index) for index in (0, 1)] == [np.inf, np.inf]
    assert fit.u(2) == pytest.approx(1e-3 / np.linalg.norm(alone), rel=0.05)
    assert np.sqrt(fit.covariance[0, 0]) < 1e-3


def test_a_nonlinear_fit_knows_a_product_and_neither_factor():
    t = np.linspace(0.0, 1.0, 50)

    def model(p):
        slopes = np.column_stack([p[1] * t, p[0] * t])
        return (p[0] * p[1] * t - 6.0 * t) / 1e-3, slopes / 1e-3

    fit = gauss_newton(model, np.array([1.0, 5.0]))
    assert fit.parameters.prod() == pytest.approx(6.0)
    assert [fit.u(0), fit.u(1)] == [np.inf, np.inf]
    product = fit.u_of(np.array([fit.parameters[1], fit.parameters[0]]))
    assert product == pytest.approx(1e-3 / np.linalg.norm(t), rel=1e-6)
