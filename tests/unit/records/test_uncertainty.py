"""Uncertainty budgets against the closed forms of the GUM."""

from __future__ import annotations

import math

import pytest

from pipeline.records.estimate import Estimate, derived
from pipeline.records.uncertainty import (
    Contribution,
    covariance,
    effective_dof,
    propagate,
    standard_uncertainty,
    type_a,
    type_b,
)


def test_a_gain_shared_by_both_cancels_in_a_ratio() -> None:
    """U/I with one gain on U alone keeps it; I/I keeps nothing (GUM 5.2.2, correlated inputs)."""
    top = type_b("current@rig", 0.02)
    bottom = type_b("current@rig", 0.01)
    # x = 2 and y = 1 with one relative gain error of 1 %: x/y is exactly 2.
    ratio = propagate([(1.0, top), (-2.0, bottom)])
    assert standard_uncertainty(ratio) == pytest.approx(0.0, abs=1e-15)
    assert covariance(top, bottom) == pytest.approx(2e-4)


def test_independent_sources_add_in_squares_and_keep_their_kind() -> None:
    budget = propagate([(3.0, type_a("scatter:x", 1.0, 9.0)), (4.0, type_b("lcr@rig", 1.0))])
    assert standard_uncertainty(budget) == pytest.approx(5.0)
    assert standard_uncertainty(budget, "A") == pytest.approx(3.0)
    assert standard_uncertainty(budget, "B") == pytest.approx(4.0)


def test_welch_satterthwaite_worked_by_hand() -> None:
    """GUM G.2b for u = (3, 4), dof = (9, 16): 5^4 / (81/9 + 256/16) = 25."""
    budget = (Contribution("a", 3.0, "A", 9.0), Contribution("b", 4.0, "A", 16.0))
    assert effective_dof(budget) == pytest.approx(25.0)
    assert effective_dof(type_b("gain", 1.0)) == math.inf


def test_interval_widens_with_few_degrees_of_freedom() -> None:
    """Student's t for 0.975 and 4 dof is 2.7764 (tables)."""
    few = Estimate("r_phase_ohm", 1.0, "ohm", "measured", "x", type_a("s", 0.1, 4.0))
    low, high = few.interval()
    assert high - 1.0 == pytest.approx(0.27764, rel=1e-4)
    assert 1.0 - low == pytest.approx(0.27764, rel=1e-4)


def test_a_derived_constant_carries_the_correlation_of_its_parents() -> None:
    """Lq/Ld read with one voltage gain: the gain is gone, the scatter stays."""
    gain, scatter = type_b("voltage@rig", 2e-6), type_a("scatter:q", 1e-6, 30.0)
    lq = Estimate("lq_h", 2e-4, "H", "measured", "step", (*gain, *scatter))
    ld = Estimate("ld_h", 1e-4, "H", "measured", "step", type_b("voltage@rig", 1e-6))
    ratio = derived(
        "saliency_ratio", "1", 2.0, [(1.0 / ld.number, lq), (-2.0 / ld.number, ld)], "derived"
    )
    assert ratio.u_b == pytest.approx(0.0, abs=1e-12)
    assert ratio.u_a == pytest.approx(0.01)
    assert ratio.dof == pytest.approx(30.0)


def test_a_value_is_none_exactly_when_not_identifiable() -> None:
    with pytest.raises(ValueError, match="not identifiable"):
        Estimate("ld_h", None, "H", "measured", "x")
    with pytest.raises(ValueError, match="finite"):
        Estimate("ld_h", math.nan, "H", "measured", "x")
