"""Rounding to a converter's steps, against the converter itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.numerics.quantisation import (
    EXACT,
    covariance_alike,
    noise_after_rounding,
    noise_before_rounding,
    resolution,
    rounded_column,
    rounding_rms,
    spread_alike,
    steps_of,
)

STEP = 0.25


def levels_and_ramps(sigma: float, seed: int = 0) -> np.ndarray:
    """Noise on 40 levels and the ramps between them, rounded."""
    rng = np.random.default_rng(seed)
    ends = STEP * rng.uniform(-40.0, 40.0, 40)
    rows = [np.full(200, x) for x in ends] + [np.linspace(-9.0, 9.0, 2000)]
    clean = np.concatenate(rows)
    return STEP * np.round((clean + sigma * rng.standard_normal(clean.size)) / STEP)


@pytest.mark.parametrize("share", [0.0, 0.1, 0.2, 0.3, 0.4])
def test_what_rounding_leaves_in_a_mean(share: float) -> None:
    """Means of 20,000 samples of 300 levels are off by as much; by q/sqrt(12) without noise."""
    rng = np.random.default_rng(1)
    levels = rng.uniform(0.0, 1.0, 300)
    off = [np.mean(np.round(x + share * rng.standard_normal(20_000))) - x for x in levels]
    expected = rounding_rms(STEP, share * STEP) / STEP
    assert np.sqrt(np.mean(np.square(off))) == pytest.approx(expected, abs=0.012)


@pytest.mark.parametrize("share", [0.05, 0.2, 0.3, 0.6, 1.0, 3.0])
def test_noise_before_the_converter_from_what_came_out(share: float) -> None:
    signal = levels_and_ramps(share * STEP)
    after = noise_after_rounding(signal, STEP)
    assert noise_before_rounding(after, STEP) == pytest.approx(share * STEP, rel=0.25, abs=0.01)


def test_a_stuck_level_has_no_noise_and_the_error_of_its_step() -> None:
    """All samples of a level on one code: no scatter, and off by q/sqrt(12) all the same."""
    signal = np.repeat([0.0, 5.0, 0.0], 300) * STEP
    step = resolution(signal)
    assert step == 5.0 * STEP
    assert noise_after_rounding(signal, step) < 0.2 * step
    assert rounding_rms(step, 0.0) == pytest.approx(step / np.sqrt(12.0), rel=0.01)


def test_the_step_is_the_least_spacing_and_not_the_rounding_of_a_sum() -> None:
    signal = levels_and_ramps(0.5 * STEP)
    assert resolution(signal) == pytest.approx(STEP)
    assert resolution(signal + 1e-13 * (np.arange(signal.size) % 2)) == pytest.approx(
        STEP, rel=1e-9
    )
    assert resolution(np.ones(5)) == 0.0
    assert rounding_rms(0.0, 1.0) == 0.0


def scatter_after(sigma: float) -> float:
    """Of a rounded level in steps, over all levels alike: from the probability of each code."""
    codes = np.arange(-15, 16)
    squares = []
    for level in np.linspace(-0.5, 0.5, 201):
        above = norm.cdf((codes + 0.5 - level) / sigma) - norm.cdf((codes - 0.5 - level) / sigma)
        squares.append(float(above @ codes**2 - (above @ codes) ** 2))
    return float(np.sqrt(np.trapezoid(squares, dx=1.0 / 200.0)))


@pytest.mark.parametrize("sigma", [0.08, 0.15, 0.3, 0.6, 1.5])
def test_noise_before_the_converter_from_the_normal_integral(sigma: float) -> None:
    assert noise_before_rounding(scatter_after(sigma), 1.0) == pytest.approx(sigma, rel=0.01)


def test_much_noise_gains_a_twelfth_of_the_steps_square() -> None:
    for share in (2.0, 3.0):
        expected = STEP * np.sqrt(share**2 - 1.0 / 12.0)
        assert noise_before_rounding(share * STEP, STEP) == pytest.approx(expected, rel=1e-12)
    assert noise_before_rounding(0.7, 0.0) == 0.7


@pytest.mark.parametrize("kept", [2, 3, 5])
def test_digits_of_a_file_are_a_step_a_decade(kept: int) -> None:
    rng = np.random.default_rng(kept)
    values = rng.uniform(0.02, 7.0, 400) * rng.choice([-1.0, 1.0], 400)
    written = np.array([float(f"{x:.{kept}g}") for x in values])
    decade = np.floor(np.log10(np.abs(written)))
    steps = steps_of(np.append(written, [0.0, np.nan]))
    assert steps[:400] == pytest.approx(10.0 ** (decade - kept + 1.0))
    assert np.max(np.abs(written - values) / steps[:400]) <= 0.5 + 1e-6


def test_decimals_and_converters_have_one_step_and_exact_numbers_none() -> None:
    rng = np.random.default_rng(1)
    values = rng.uniform(-30.0, 30.0, 200)
    assert steps_of(np.round(values, 1)) == pytest.approx(np.full(200, 0.1))
    of_ten_bits = 60.0 / 1024.0
    assert steps_of(of_ten_bits * np.round(values / of_ten_bits)) == pytest.approx(
        np.full(200, of_ten_bits)
    )
    assert not steps_of(values).any()
    assert not steps_of(np.array([np.nan, 0.0])).any()
    # three levels that were set have a least spacing, and no step
    assert not steps_of(np.repeat([0.0, 1.2345678, 2.4691356], 9)).any()


def test_what_rounding_leaves_has_the_sign_and_the_cell_of_its_level() -> None:
    """Without noise q/√12, of both senses; half a step of noise hides it."""
    rng = np.random.default_rng(2)
    levels = np.repeat(np.arange(-7.0, 8.0) + 0.3, 200)
    each = [slice(200 * k, 200 * (k + 1)) for k in range(15)]
    still = rounded_column(STEP * np.round(levels), each)
    assert still.error_of_mean(slice(0, 200)).u == pytest.approx(-STEP / np.sqrt(12.0), rel=0.03)
    assert still.error_of_mean(slice(0, 200)).cell == 7
    noise = 0.5 * rng.standard_normal(levels.size)
    noisy = rounded_column(STEP * np.round(levels + noise), each)
    assert abs(noisy.error_of_mean(slice(0, 200)).u) < 0.02 * STEP
    assert rounded_column(levels + noise, each).error_of_mean(slice(0, 200)) == EXACT
    assert rounded_column(np.full(9, np.nan), each[:1]).error_of_mean(slice(0, 9)) == EXACT


def test_a_level_near_a_threshold_has_the_noise_of_the_others() -> None:
    """It scatters by half a step at a fifth of a step of noise, and is as far off as any other. One
    that stands still may be off by all that rounding leaves without noise.
    """
    rng = np.random.default_rng(3)
    levels = np.repeat(np.arange(-20.0, 20.0) * 0.975 + 0.46, 200)
    each = [slice(200 * k, 200 * (k + 1)) for k in range(40)]
    read = STEP * np.round(levels + 0.18 * rng.standard_normal(levels.size))
    column = rounded_column(read, each)
    wanted = rounding_rms(STEP, 0.18 * STEP)
    for rows in each:
        found = column.error_of_mean(rows)
        assert 0.7 * wanted < abs(found.u) <= STEP / np.sqrt(12.0)


def test_errors_of_one_cell_are_one() -> None:
    covariance = covariance_alike(np.array([2.0, -2.0, 3.0]), ["a", "a", "b"])
    assert covariance.tolist() == [[4.0, -4.0, 0.0], [-4.0, 4.0, 0.0], [0.0, 0.0, 9.0]]
    levers = np.array([[1.0, 1.0, 1.0], [1.0, -1.0, 0.5]])
    spread = spread_alike(levers, np.array([2.0, -2.0, 3.0]), ["a", "a", "b"])
    assert spread == pytest.approx(levers @ covariance @ levers.T)


def test_what_moves_between_levels_is_no_noise() -> None:
    """Edges that ring for a tenth of the rows, beside levels that stand still."""
    rings = 3.0 * np.sin(np.arange(20.0)) * 0.8 ** np.arange(20.0)
    levels = [np.append(k + rings, np.full(180, k)) for k in np.arange(-7.0, 8.0) + 0.3]
    column = STEP * np.round(np.concatenate(levels))
    each = [slice(200 * k + 20, 200 * (k + 1)) for k in range(15)]
    still = rounded_column(column, each).error_of_mean(each[0])
    assert abs(still.u) == pytest.approx(STEP / np.sqrt(12.0), rel=0.03)


def test_a_level_without_noise_beside_levels_with_it() -> None:
    rng = np.random.default_rng(4)
    levels = np.repeat(np.arange(-8.0, 8.0) * 0.95, 200)
    noise = np.where(np.arange(levels.size) < 200, 0.0, 0.6) * rng.standard_normal(levels.size)
    each = [slice(200 * k, 200 * (k + 1)) for k in range(16)]
    column = rounded_column(STEP * np.round(levels + noise), each)
    assert abs(column.error_of_mean(each[0]).u) == pytest.approx(STEP / np.sqrt(12.0), rel=0.03)
    assert abs(column.error_of_mean(each[9]).u) < 0.02 * STEP
