"""Block bootstrap, cluster errors and forward selection against theory."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.bootstrap import block_bootstrap, block_length
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.coasting import coast_down
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.selection import needed_columns


def autoregressive(n: int, rho: float, rng: np.random.Generator) -> np.ndarray:
    shocks = rng.standard_normal(n)
    series = np.empty(n)
    series[0] = shocks[0] / np.sqrt(1.0 - rho**2)
    for k in range(1, n):
        series[k] = rho * series[k - 1] + shocks[k]
    return series


def test_block_bootstrap_of_a_correlated_mean() -> None:
    """Var(mean) of an AR(1) is 1 / (n (1 - rho)²); the plain formula is 3 times too small here."""
    rng = np.random.default_rng(1)
    n, rho = 4000, 0.8
    series = autoregressive(n, rho, rng)
    draws = block_bootstrap(
        lambda part: part.mean(keepdims=True), series, block_length(series), 400, rng
    )
    theory = 1.0 / np.sqrt(n) / (1.0 - rho)
    assert float(draws.std(ddof=1)) == pytest.approx(theory, rel=0.2)
    assert series.std() / np.sqrt(n) < 0.5 * theory


def test_block_length_of_white_noise_is_short() -> None:
    rng = np.random.default_rng(2)
    white, red = rng.standard_normal(1000), autoregressive(1000, 0.95, rng)
    assert block_length(white) == 10
    assert block_length(red) > 30


def test_cluster_covariance_sees_shared_errors() -> None:
    """With m equal errors a cluster: the variance of a mean is that of G errors, not of G m."""
    rng = np.random.default_rng(3)
    groups, size = 400, 10
    shared = np.repeat(rng.standard_normal(groups), size)
    design, ones = np.ones((shared.size, 1)), np.ones(shared.size)
    fit = linear_fit(design, shared)
    covariance, dof = cluster_covariance(
        design, fit.residuals, ones, np.repeat(np.arange(groups), size)
    )
    assert dof == groups - 1
    assert np.sqrt(covariance[0, 0]) == pytest.approx(1.0 / np.sqrt(groups), rel=0.1)
    assert fit.u(0) < 0.5 / np.sqrt(groups)


def test_forward_selection_takes_what_is_there_and_little_else() -> None:
    rng = np.random.default_rng(4)
    n = 300
    columns = {f"c{k}": rng.standard_normal(n) for k in range(20)}
    base = np.ones((n, 1))
    y = 2.0 + 0.5 * columns["c3"] - 0.4 * columns["c11"] + rng.standard_normal(n)
    assert sorted(needed_columns(base, columns, y, np.ones(n))) == ["c11", "c3"]
    false = sum(
        len(needed_columns(base, columns, rng.standard_normal(n), np.ones(n), 0.05))
        for _ in range(100)
    )
    assert false <= 15


def test_forward_selection_ignores_copies_of_the_base() -> None:
    x = np.linspace(0.0, 1.0, 50)
    base = np.column_stack([np.ones(50), x])
    copies = {"copy": 3.0 - 2.0 * x}
    assert needed_columns(base, copies, np.sin(9.0 * x), np.ones(50)) == []


def test_coast_down_against_the_closed_form() -> None:
    """Speed (w0 + r) e^(-bt) - r with r = a/b, its integral, rest after b t = ln(1 + w0/r)."""
    a, b, start = 90.0, 0.5, 250.0
    stop = np.log1p(start * b / a) / b
    t = np.linspace(0.0, 0.999 * stop, 700)
    theta, omega = coast_down(t, start, lambda w: a + b * w)
    decay = np.exp(-b * t)
    assert omega == pytest.approx((start + a / b) * decay - a / b, abs=1e-8)
    assert theta == pytest.approx((start + a / b) * (1.0 - decay) / b - a / b * t, abs=1e-8)
    rest, still = coast_down(np.array([stop, stop + 1.0]), start, lambda w: a + b * w)
    assert rest[0] == pytest.approx(rest[1], rel=1e-9)
    assert still == pytest.approx(0.0, abs=1e-6)
