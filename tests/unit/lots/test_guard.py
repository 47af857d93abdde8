"""Decisions with a guard band and their risks, against figures worked out elsewhere."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import multivariate_normal

from pipeline.lots.guard import Risks, Tolerance, risks


@pytest.mark.parametrize(
    ("tur", "multiple", "accept", "reject"),
    [(4.0, 0.0, 7.4e-4, 3.0e-3), (4.0, 1.0, 2e-5, 3.25e-2), (2.0, 1.0, None, 0.228)],
)
def test_published_risks(tur: float, multiple: float, accept: float | None, reject: float) -> None:
    """Two-sided, Cp 1, k = 2: tabulated for a test uncertainty ratio T/U and w = multiple · U."""
    expanded = 3.0 / tur
    found = risks(Tolerance(-3.0, 3.0, multiple * expanded), 0.0, 1.0, expanded / 2.0)
    if accept is not None:
        assert found.false_accept == pytest.approx(accept, rel=0.02)
    assert found.false_reject == pytest.approx(reject, rel=0.005)


def _by_bivariate(tolerance: Tolerance, mean: float, sd: float, u: float) -> Risks:
    """The same by the joint normal distribution of true and measured value, in rectangles."""
    total = math.hypot(sd, u)
    rho = sd / total
    joint = multivariate_normal([0.0, 0.0], [[1.0, rho], [rho, 1.0]])

    def below(eta: float, reading: float) -> float:
        point = np.clip([(eta - mean) / sd, (reading - mean) / total], -40.0, 40.0)
        return float(joint.cdf(point))

    def inside(lo: float, hi: float, a: float, b: float) -> float:
        return below(hi, b) - below(lo, b) - below(hi, a) + below(lo, a)

    lo, hi = tolerance.lower, tolerance.upper
    a, b = tolerance.accept_lower, tolerance.accept_upper
    both = inside(lo, hi, a, b) if a < b else 0.0
    accepted = below(1e9, b) - below(1e9, a) if a < b else 0.0
    conforming = below(hi, 1e9) - below(lo, 1e9)
    return Risks(accepted - both, conforming - both)


@settings(max_examples=25, deadline=None)
@given(
    mean=st.floats(-2.0, 2.0),
    sd=st.floats(0.05, 2.0),
    u=st.floats(0.02, 1.5),
    guard=st.floats(-0.5, 1.5),
    one_sided=st.booleans(),
)
def test_risks_against_independent_integration(
    mean: float, sd: float, u: float, guard: float, one_sided: bool
) -> None:
    """JCGM 106, 9.5: within 1e-3 of the bivariate normal distribution."""
    tolerance = Tolerance(-math.inf if one_sided else -1.0, 1.0, guard)
    found, other = risks(tolerance, mean, sd, u), _by_bivariate(tolerance, mean, sd, u)
    assert found.false_accept == pytest.approx(other.false_accept, abs=1e-3)
    assert found.false_reject == pytest.approx(other.false_reject, abs=1e-3)


def test_risks_by_counting() -> None:
    rng = np.random.default_rng(5)
    true = rng.normal(0.2, 0.4, 400_000)
    measured = true + rng.normal(0.0, 0.15, true.size)
    tolerance = Tolerance(-1.0, 1.0, 0.123)
    accepted = (measured >= -0.877) & (measured <= 0.877)
    fine = np.abs(true) <= 1.0
    found = risks(tolerance, 0.2, 0.4, 0.15)
    assert found.false_accept == pytest.approx(np.mean(accepted & ~fine), abs=1e-3)
    assert found.false_reject == pytest.approx(np.mean(~accepted & fine), abs=1e-3)


def test_sure_lot_of_one_value() -> None:
    """No spread between motors: all risk is the measurement's."""
    assert risks(Tolerance(-1.0, 1.0), 1.0, 0.0, 0.1).false_reject == pytest.approx(0.5, abs=1e-6)
    assert risks(Tolerance(-1.0, 1.0), 1.1, 0.0, 0.1).false_accept == pytest.approx(
        0.15866, abs=1e-4
    )


@pytest.mark.parametrize(
    ("value", "decision"),
    [
        (0.0, "pass"),
        (0.875, "pass"),
        (0.95, "conditional_pass"),
        (1.0, "conditional_pass"),
        (1.0625, "conditional_fail"),
        (1.2, "fail"),
        (-0.95, "conditional_pass"),
        (-1.2, "fail"),
    ],
)
def test_four_decisions(value: float, decision: str) -> None:
    assert Tolerance(-1.0, 1.0, 0.125).decide(value) == decision


def test_guard_band_of_95_percent() -> None:
    """W = 0.822 U (k = 2) is 1.645 u: a motor on the acceptance limit is inside with 95 %."""
    u = 0.1
    w = 0.822 * 2.0 * u
    probability = risks(Tolerance(-math.inf, 1.0, 0.0), 1.0 - w, u, 0.0)
    assert probability.false_accept == pytest.approx(0.0, abs=1e-9)
    outside = 0.5 * math.erfc(w / u / math.sqrt(2.0))
    assert outside == pytest.approx(0.05, abs=2e-4)


def test_a_value_on_a_limit_belongs_to_the_better_side() -> None:
    """Numbers that binary fractions hold exactly: each limit itself, and the next value beyond."""
    tolerance = Tolerance(-1.0, 1.0, 0.125)
    limits = {0.875: "pass", 1.0: "conditional_pass", 1.125: "conditional_fail"}
    after = {0.875: "conditional_pass", 1.0: "conditional_fail", 1.125: "fail"}
    for limit, decision in limits.items():
        for sign in (1.0, -1.0):
            assert tolerance.decide(sign * limit) == decision
            assert tolerance.decide(sign * math.nextafter(limit, 2.0)) == after[limit]
    assert (tolerance.accept_lower, tolerance.accept_upper) == (-0.875, 0.875)
    assert Tolerance(-math.inf, 1.0).decide(-1e9) == "pass"


def test_risks_of_an_exact_instrument_and_of_limits_that_cross() -> None:
    exact = risks(Tolerance(-1.0, 1.0, 0.5), 0.0, 1.0, 0.0)
    assert exact.false_accept == pytest.approx(0.0, abs=1e-12)
    # inside the tolerance, beyond the acceptance limit: 2 (Phi(1) - Phi(0.5))
    assert exact.false_reject == pytest.approx(0.299763, abs=1e-5)
    crossed = risks(Tolerance(-1.0, 1.0, 1.5), 0.0, 1.0, 0.1)
    assert crossed.false_accept == 0.0
    assert crossed.false_reject == pytest.approx(0.682689, abs=1e-6)
    assert risks(Tolerance(-1.0, 1.0), 1.0, 0.0, 0.0) == Risks(0.0, 0.0)
    assert risks(Tolerance(-1.0, 1.0), 1.5, 0.0, 0.0) == Risks(0.0, 0.0)
    for sd, u in ((-1.0, 0.1), (1.0, -0.1)):
        with pytest.raises(ValueError, match="negative"):
            risks(Tolerance(-1.0, 1.0), 0.0, sd, u)
