"""Ratios judged with both uncertainties, and the suspect that a magic number names."""

from __future__ import annotations

import math

import pytest

from pipeline.crosscheck.judge import Ratio, judge_deviation, judge_ratio, ratio_of
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_a, type_b


@pytest.mark.parametrize(
    ("deviation", "status"),
    [(0.011, "pass"), (-0.0119, "pass"), (0.0125, "marginal"), (0.0131, "fail"), (-0.2, "fail")],
)
def test_passes_to_two_u_beyond_the_allowance_and_fails_after_three(
    deviation: float, status: str
) -> None:
    assert judge_deviation(deviation, u=0.001, allowance=0.01) == status


def test_a_pass_that_means_nothing_is_not_a_pass() -> None:
    assert judge_deviation(0.0, u=0.05, allowance=0.01) == "not_evaluated"
    assert judge_deviation(math.nan, u=0.001, allowance=0.01) == "not_evaluated"
    assert judge_deviation(1.0, u=0.05, allowance=0.01) == "fail"


def test_line_to_line_taken_for_phase_is_named() -> None:
    check = judge_ratio("kt_vs_ke", Ratio(math.sqrt(3.0), 0.002), 0.01, "Kt over Ke", "coupling")
    assert check.status == "fail"
    assert check.suspect is not None
    assert "1.7321" in check.suspect


def test_ratio_cancels_the_shared_gain() -> None:
    kt = Estimate("kt", 0.15, "N·m/A", "measured", "a", type_b("current@r", 3e-4))
    ke = Estimate("ke", 0.15, "N·m/A", "derived", "b", type_a("s", 1.5e-4))
    ratio, u, _ = ratio_of(kt, ke)
    assert ratio == pytest.approx(1.0)
    assert u == pytest.approx(math.hypot(0.002, 0.001))


def test_a_ratio_that_could_be_anything_names_no_suspect() -> None:
    """0.26 ± 0.27 reaches from 2 to 2 pi and beyond: neither a convention nor another cause."""
    words = ("tau over L/R", "impedance", None, "leads")
    check = judge_ratio("tau", Ratio(0.2648, 0.14), 0.04, *words)
    assert (check.status, check.suspect) == ("fail", None)
    sure = judge_ratio("tau", Ratio(0.2648, 0.001), 0.04, *words)
    assert sure.suspect == "leads"


@pytest.mark.parametrize(("value", "u"), [(0.968, 0.003), (1.037, 0.003)])
def test_a_convention_outside_the_interval_is_not_told(value: float, u: float) -> None:
    """Published: 0.968 and 1.037 +- 0.006 (k=2), both told as six-step no-load speed (1.0472)."""
    check = judge_ratio("kt_vs_ke", Ratio(value, u), 0.01, "Kt over Ke", "coupling", 7, "a gain")
    assert (check.status, check.suspect) == ("fail", "a gain")
    assert f"{value:.4f} ± {2.0 * u:.4f} (k=2)" in check.meaning


def test_few_degrees_of_freedom_widen_the_interval_and_say_by_how_much() -> None:
    """Of 3 degrees of freedom k is 3.31 (GUM table G.2): 1.1027 is within that, not within 2 u."""
    check = judge_ratio("kt_vs_ke", Ratio(1.09, 0.005, 3.0), 0.01, "Kt over Ke", "coupling")
    assert "1.0900 ± 0.0165 (k=3.31)" in check.meaning
    assert (check.suspect or "").startswith("1.1027")
    sure = judge_ratio("kt_vs_ke", Ratio(1.09, 0.005), 0.01, "Kt over Ke", "coupling")
    assert sure.suspect is None


def test_a_torque_in_newton_centimetres_is_named() -> None:
    words = ("Kt over Ke", "coupling", 10, "gain of the torque")
    check = judge_ratio("kt_vs_ke", Ratio(100.0002, 0.3), 0.01, *words)
    assert check.suspect is not None
    assert "N·cm" in check.suspect
