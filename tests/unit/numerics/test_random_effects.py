"""Scatter between values of one quantity: known truth in, its size out."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.random_effects import between


def test_values_with_honest_uncertainties_agree() -> None:
    """Over 4,000 draws chi-square has its mean, and one in a hundred is below p = 0.01."""
    rng = np.random.default_rng(3)
    u = np.array([0.5, 1.0, 2.0, 4.0])
    shared = 3.0
    covariance = np.diag(u**2) + shared**2
    drawn = [
        between(10.0 + shared * rng.standard_normal() + u * rng.standard_normal(4), covariance)
        for _ in range(4000)
    ]
    assert np.mean([d.chi2 for d in drawn]) == pytest.approx(3.0, abs=0.15)
    assert np.mean([d.p_value < 0.01 for d in drawn]) == pytest.approx(0.01, abs=0.005)


def test_the_scatter_beyond_the_covariance_comes_out() -> None:
    """Mean of sd² over draws is the variance that was put in, whatever the values share."""
    rng = np.random.default_rng(4)
    u, sd = np.array([0.5, 1.0, 1.5, 0.8, 1.2]), 3.0
    covariance = np.diag(u**2) + 25.0
    squares = [
        between(
            5.0 * rng.standard_normal() + np.hypot(u, sd) * rng.standard_normal(5), covariance
        ).sd
        ** 2
        for _ in range(4000)
    ]
    assert np.mean(squares) == pytest.approx(sd**2, rel=0.05)


def test_what_two_values_share_cancels_in_their_difference() -> None:
    """Two values 1 apart, each ± 0.1 of its own: clear, however large what they share."""
    own = np.diag([0.01, 0.01])
    apart = [between(np.array([1.0, 2.0]), own + share) for share in (0.0, 100.0)]
    assert apart[0].chi2 == pytest.approx(50.0)
    assert apart[1].chi2 == pytest.approx(50.0, rel=1e-6)
    assert apart[1].sd == pytest.approx(np.sqrt(0.5 - 0.01), rel=1e-6)


def test_a_covariance_known_from_little_data_judges_mildly() -> None:
    values, covariance = np.array([0.0, 4.0]), np.eye(2)
    assert between(values, covariance).p_value == pytest.approx(0.00468, rel=0.01)
    assert between(values, covariance, 3.0).p_value == pytest.approx(0.0663, rel=0.01)


def test_one_value_agrees() -> None:
    assert between(np.array([3.0]), np.eye(1)) == (0.0, 0, 1.0, 0.0)
