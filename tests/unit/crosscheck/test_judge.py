"""Ratios judged with both uncertainties, and the suspect that a magic number names."""

from __future__ import annotations

import math

import pytest

from pipeline.crosscheck.judge import judge_deviation, judge_ratio, ratio_of
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
    check = judge_ratio("kt_vs_ke", math.sqrt(3.0), 0.002, 0.01, "Kt over Ke")
    assert check.status == "fail"
    assert check.suspect is not None
    assert "1.7321" in check.suspect


def test_ratio_cancels_the_shared_gain() -> None:
    kt = Estimate("kt", 0.15, "N·m/A", "measured", "a", type_b("current@r", 3e-4))
    ke = Estimate("ke", 0.15, "N·m/A", "derived", "b", type_a("s", 1.5e-4))
    ratio, u = ratio_of(kt, ke)
    assert ratio == pytest.approx(1.0)
    assert u == pytest.approx(math.hypot(0.002, 0.001))


def test_a_ratio_that_could_be_anything_names_no_suspect() -> None:
    """0.26 ± 0.27 reaches from 2 to 2 pi and beyond: neither a convention nor another cause."""
    check = judge_ratio("tau", 0.2648, 0.1363, 0.04, "tau over L/R", None, "leads")
    assert (check.status, check.suspect) == ("fail", None)
    sure = judge_ratio("tau", 0.2648, 0.001, 0.04, "tau over L/R", None, "leads")
    assert sure.suspect == "leads"


def test_a_torque_in_newton_centimetres_is_named() -> None:
    check = judge_ratio("kt_vs_ke", 100.0002, 0.3, 0.01, "Kt over Ke", 10, "gain of the torque")
    assert check.suspect is not None
    assert "N·cm" in check.suspect
