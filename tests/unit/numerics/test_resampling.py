"""Block bootstrap, cluster errors and forward selection against theory."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import f, linregress

from pipeline.numerics.bootstrap import block_bootstrap, block_length
from pipeline.numerics.clusters import cluster_covariance
from pipeline.numerics.coasting import coast_down, coasting_rows
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
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


@pytest.mark.parametrize(("n", "length"), [(8, 2), (27, 3), (125, 5), (5, 1), (3, 1)])
def test_block_length_grows_with_the_cube_root(n: int, length: int) -> None:
    """Alternating signs count one by one; a quarter of a short series is the most."""
    assert block_length(np.where(np.arange(n) % 2, -1.0, 1.0)) == length


def test_block_length_follows_the_correlation() -> None:
    """Runs of eight ones and eight minus ones count as 43/8 samples: (43/8)^(2/3) 16^(1/3) = 7.7,
    of which a series of 16 allows 4.
    """
    assert block_length(np.repeat([1.0, -1.0], 8)) == 4
    runs = np.repeat(np.where(np.arange(40) % 2, -1.0, 1.0), 25)
    tau = autocorrelation_time(runs)
    assert tau > 10.0
    assert block_length(runs) == round((tau**2 * 1000) ** (1 / 3))


def test_blocks_are_neighbours_and_wrap_round_the_end() -> None:
    n, length = 23, 5
    rows = np.arange(n)
    drawn = block_bootstrap(lambda part: part, rows, length, 50, np.random.default_rng(5))
    assert drawn.shape == (50, n)
    inside = np.arange(1, n) % length != 0
    assert (np.diff(drawn, axis=1)[:, inside] % n == 1).all()
    starts = drawn[:, ::length]
    assert set(starts.ravel()) == set(range(n))


def test_cluster_covariance_by_hand() -> None:
    """A mean of four in two clusters, residuals -1, 0 | 2, -1: sums -1, 1; 2/16 * 2/1 * 3/3."""
    design = np.full((4, 1), 1.0)
    residuals = np.array([-1.0, 0.0, 2.0, -1.0])
    covariance, dof = cluster_covariance(design, residuals, np.ones(4), np.array([9, 9, 4, 4]))
    assert dof == 1
    assert covariance[0, 0] == pytest.approx(2.0 / 16.0 * 2.0)


def test_clusters_of_one_row_each_are_the_robust_covariance() -> None:
    """HC1 of White: X'X^-1 X' diag(r²) X X'X^-1 n/(n-k), weights and units included."""
    rng = np.random.default_rng(6)
    design, sigma = rng.standard_normal((30, 3)) * [1.0, 1e3, 1e-3], rng.uniform(0.5, 2.0, 30)
    y = rng.standard_normal(30)
    fit = linear_fit(design, y, sigma)
    x, r = design / sigma[:, None], fit.residuals / sigma
    bread = np.linalg.inv(x.T @ x)
    known = bread @ (x.T * r**2) @ x @ bread * 30 / 27
    covariance, dof = cluster_covariance(design, fit.residuals, sigma, np.arange(30))
    assert dof == 29
    assert np.allclose(covariance, known, rtol=1e-8, atol=0.0)


def test_one_cluster_has_one_degree_of_freedom_and_no_division_by_zero() -> None:
    design = np.column_stack([np.ones(3), np.zeros(3)])
    covariance, dof = cluster_covariance(design, np.ones(3), np.ones(3), np.zeros(3, int))
    assert dof == 1
    assert covariance[0, 0] == pytest.approx(1.0 * 2.0)
    assert covariance[1, 1] == 0.0


def f_of_one(x: np.ndarray, y: np.ndarray) -> float:
    """p-value of a straight line through x against the mean alone, by scipy."""
    return float(linregress(x, y).pvalue)


def test_forward_selection_takes_at_the_level_and_not_below() -> None:
    """One candidate: F(1, n - 2) is the square of the regression's t, so the p-values agree."""
    rng = np.random.default_rng(11)
    x, y = rng.standard_normal(12), rng.standard_normal(12)
    base, p = np.ones((12, 1)), f_of_one(x, y)
    assert 0.01 < p < 0.9
    assert needed_columns(base, {"x": x}, y, np.ones(12), 1.001 * p) == ["x"]
    assert needed_columns(base, {"x": x}, y, np.ones(12), 0.999 * p) == []
    # of three candidates each is held to a third of the level
    flat = {"x": x, "one": np.ones(12), "two": np.full(12, 2.0)}
    assert needed_columns(base, flat, y, np.ones(12), 3.003 * p) == ["x"]
    assert needed_columns(base, flat, y, np.ones(12), 2.997 * p) == []


def test_forward_selection_weighs_rows_by_their_noise() -> None:
    """Rows of half the noise count fourfold: the same as those rows four times."""
    rng = np.random.default_rng(12)
    x, y = rng.standard_normal(14), rng.standard_normal(14)
    sigma = np.where(np.arange(14) < 7, 0.5, 1.0)
    scaled = linear_fit(np.column_stack([np.ones(14), x]), y, sigma)
    alone = linear_fit(np.ones((14, 1)), y, sigma)
    fall = alone.chi2_dof * 13 - scaled.chi2_dof * 12
    p = float(f.sf(fall / scaled.chi2_dof, 1, 12))
    assert needed_columns(np.ones((14, 1)), {"x": x}, y, sigma, 1.001 * p) == ["x"]
    assert needed_columns(np.ones((14, 1)), {"x": x}, y, sigma, 0.999 * p) == []


def test_forward_selection_of_dependent_rows_has_fewer_degrees_of_freedom() -> None:
    """Twelve rows that count as six: F is halved, and its denominator has five degrees, not ten."""
    rng = np.random.default_rng(11)
    x, y = rng.standard_normal(12), rng.standard_normal(12)
    found = linregress(x, y)
    statistic = found.rvalue**2 / (1.0 - found.rvalue**2) * 10.0
    p = float(f.sf(statistic / 2.0, 1, 5))
    base = np.ones((12, 1))
    assert needed_columns(base, {"x": x}, y, np.ones(12), 1.001 * p, None, 2.0) == ["x"]
    assert needed_columns(base, {"x": x}, y, np.ones(12), 0.999 * p, None, 2.0) == []


def test_forward_selection_takes_an_exact_column_and_at_most_as_many_as_told() -> None:
    x, z = np.arange(10.0), np.arange(10.0) ** 2
    base = np.ones((10, 1))
    assert needed_columns(base, {"x": x}, 2.0 + 3.0 * x, np.ones(10)) == ["x"]
    both = {"x": x, "z": z}
    y = z + 0.3 * np.cos(x)
    assert needed_columns(base, both, y, np.ones(10), 1.0, 1) == ["z"]
    assert needed_columns(base, both, y, np.ones(10), 1.0, 0) == []
    assert needed_columns(base, {}, y, np.ones(10)) == []
    assert needed_columns(base, {"x": x}, np.full(10, 4.0), np.ones(10)) == []


def test_coasts_start_where_the_drive_lets_go_and_end_near_rest() -> None:
    """Held at 200, let fall; then the other way at 100; a nudge to 9 of 200 is no coast."""
    down = np.linspace(200.0, 0.0, 401)  # 0.5 a row
    held = np.full(50, 200.0)
    other = -np.linspace(100.0, 0.0, 401)
    nudge = np.linspace(9.0, 0.0, 19)
    speed = np.concatenate([held, down, np.zeros(20), other, np.zeros(20), nudge])
    forward, backward = coasting_rows(speed)
    # TOP: 99.5 % of 200 is 199, row 2 of the fall; REST: 0.5 % of 200 is 1, row 398 the last
    assert forward == (slice(50 + 2, 50 + 399), 1)
    first = 50 + 401 + 20
    # 99.5 % of 100 is 99.5, row 2 of the fall; 1 is row 396
    assert backward == (slice(first + 2, first + 397), -1)
    assert coasting_rows(np.zeros(30)) == []
    assert coasting_rows(np.zeros(0)) == []
    assert len(coasting_rows(np.concatenate([speed, np.linspace(10.5, 0.0, 19)]))) == 3


def test_coast_down_under_constant_drag_is_a_parabola_and_then_rest() -> None:
    """Speed w0 - a t until w0/a; the angle is w0²/(2 a) at rest."""
    theta, omega = coast_down(np.array([-1.0, 0.0, 1.0, 3.0, 5.0, 9.0]), 50.0, lambda w: 10 + 0 * w)
    assert omega == pytest.approx([50.0, 50.0, 40.0, 20.0, 0.0, 0.0], abs=1e-9)
    assert theta == pytest.approx([0.0, 0.0, 45.0, 105.0, 125.0, 125.0], abs=1e-9)


@pytest.mark.parametrize(("factor", "joins"), [(1.02, True), (0.98, False)])
def test_the_second_column_is_judged_with_the_first_one_in(factor: float, joins: bool) -> None:
    """By its F(1, n - k - 2), from two least-squares fits; one candidate is left then."""
    rng = np.random.default_rng(5)
    n = 14
    x, z = rng.standard_normal((2, n))
    y = 3.0 * x + 0.8 * z + 0.6 * rng.standard_normal(n)
    base = np.ones((n, 1))

    def left(*columns: np.ndarray) -> float:
        design = np.column_stack([base, *columns])
        return float(np.sum((y - design @ np.linalg.lstsq(design, y, rcond=None)[0]) ** 2))

    dof = n - 3
    p = float(f.sf((left(x) - left(x, z)) / (left(x, z) / dof), 1.0, dof))
    assert 1e-4 < p < 0.5
    chosen = needed_columns(base, {"x": x, "z": z}, y, np.ones(n), factor * p)
    assert chosen == (["x", "z"] if joins else ["x"])


@pytest.mark.parametrize("seed", [94, 98, 319, 333])
def test_no_rounding_makes_a_variance_negative(seed: int) -> None:
    """Two columns that nearly go together, in two clusters: the root of it was nan."""
    rng = np.random.default_rng(seed)
    x = rng.standard_normal(60)
    near = x + 10.0 ** rng.uniform(-8.0, -5.0) * rng.standard_normal(60)
    design = np.column_stack([x, near, rng.standard_normal(60)])
    noise = rng.standard_normal(60)
    left = noise - design @ np.linalg.lstsq(design, noise, rcond=None)[0]
    covariance, _ = cluster_covariance(design, left, np.ones(60), np.arange(60) // 30)
    assert (np.diag(covariance) >= 0.0).all()
