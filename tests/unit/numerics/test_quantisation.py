"""Rounding to a converter's steps, against the converter itself."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import norm

from pipeline.numerics.quantisation import (
    noise_after_rounding,
    noise_before_rounding,
    resolution,
    rounding_rms,
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
