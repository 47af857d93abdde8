"""Limits worked out in the constant's unit, just inside and just outside each of them."""

from __future__ import annotations

import math

import pytest

from pipeline.lots.bounds import Held, _inside, conformity, hold
from pipeline.lots.guard import Tolerance, risks
from pipeline.lots.sample import Value
from pipeline.records.limits import Amount, ConstantLimits


def value(motor: str, u: float = 0.01) -> Value:
    return Value(motor, "L", "candidate", "S", ("S",), 0.0, u, u, {}, (), frozenset())


def held(limits: ConstantLimits, numbers: dict[str, float], u: float = 0.01, **more: float | None):
    made = [value(name, u) for name in numbers]
    baseline, sd = more.get("baseline", 1.0), more.get("sd", 0.1)
    return hold(limits, made, numbers, baseline, sd, 2.0)


def test_a_tolerance_either_side_of_nominal_with_a_guard_band_in_u() -> None:
    """10 ± 0.5, guard band 0.822 U with U = 2 · 0.1: accepted within 10 ± 0.3356."""
    limits = ConstantLimits("r", 10.0, Amount(0.5, "unit"))
    numbers = {"in": 10.33, "band": 10.34, "edge": 9.51, "out": 9.45, "far": 9.3}
    found = held(limits, numbers, 0.1)
    assert found.decisions == {
        "in": "pass",
        "band": "conditional_pass",
        "edge": "conditional_pass",
        "out": "conditional_fail",
        "far": "fail",
    }
    bounds = found.bounds
    assert bounds is not None
    assert (bounds.lower, bounds.upper) == pytest.approx((9.5, 10.5))
    assert bounds.guard_band == pytest.approx(0.1644)
    assert (bounds.accept_lower, bounds.accept_upper) == pytest.approx((9.6644, 10.3356))


def test_each_motor_has_the_guard_band_of_its_own_u() -> None:
    limits = ConstantLimits("r", 10.0, Amount(0.5, "unit"))
    made = [value("sharp", 0.01), value("loud", 0.2), value("third", 0.1)]
    numbers = dict.fromkeys(("sharp", "loud", "third"), 10.4)
    found = hold(limits, made, numbers, None, None, 2.0)
    assert found.decisions["sharp"] == "pass"
    assert found.decisions["loud"] == "conditional_pass"
    # the band shown is that of the median motor: U = 2 · 0.1
    assert found.bounds is not None
    assert found.bounds.guard_band == pytest.approx(0.1644)


@pytest.mark.parametrize(
    ("rule", "decisions"),
    [
        ("four_way", ["conditional_pass", "conditional_fail"]),
        ("guarded", ["fail", "fail"]),
        ("simple", ["pass", "fail"]),
    ],
)
def test_rules(rule: str, decisions: list[str]) -> None:
    limits = ConstantLimits("r", 10.0, Amount(0.5, "unit"), rule=rule)  # type: ignore[arg-type]
    found = held(limits, {"a": 10.45, "b": 10.55}, 0.1)
    assert list(found.decisions.values()) == decisions


def test_test_limits_replace_the_design_on_their_side() -> None:
    limits = ConstantLimits("r", 10.0, Amount(0.5, "unit"), minimum=9.0, rule="simple")
    found = held(limits, {"a": 9.01, "b": 8.99, "c": 10.49, "d": 10.51})
    assert list(found.decisions.values()) == ["pass", "fail", "pass", "fail"]
    one_sided = held(ConstantLimits("r", maximum=2.0, rule="simple"), {"a": -50.0, "b": 2.01})
    assert list(one_sided.decisions.values()) == ["pass", "fail"]
    assert one_sided.bounds is not None
    assert (one_sided.bounds.lower, one_sided.bounds.upper) == (None, 2.0)
    assert one_sided.bounds.accept_lower is None


def test_without_limits_there_is_no_decision_and_the_margin_stays() -> None:
    assert held(ConstantLimits("r"), {"a": 1.0}).bounds is None
    found = held(ConstantLimits("r", margins=(Amount(0.5, "sd"),)), {"a": 1.0}, sd=0.2)
    assert found.margin == pytest.approx(0.1)
    assert found.decisions == {}
    assert found.bounds is not None
    assert found.bounds.margin == pytest.approx(0.1)
    relative = ConstantLimits("r", tolerance=Amount(0.1, "%"))
    assert held(relative, {"a": 1.0}, baseline=None).bounds is None


def test_the_largest_margin_counts() -> None:
    margins = (Amount(0.5, "sd"), Amount(0.07, "unit"))
    assert held(ConstantLimits("r", margins=margins), {"a": 1.0}, sd=0.2).margin == 0.1
    assert held(ConstantLimits("r", margins=margins), {"a": 1.0}, sd=0.1).margin == 0.07
    assert held(ConstantLimits("r", margins=margins), {"a": 1.0}, sd=None).margin == 0.07


def test_conformity_counts_names_the_worst_and_tells_the_risks() -> None:
    limits = ConstantLimits("r", 10.0, Amount(0.5, "unit"), rule="simple")
    numbers = {"a": 10.1, "b": 10.6, "c": 9.1, "d": 9.9}
    found = held(limits, numbers, 0.1)
    made = [value(name, 0.1) for name in numbers]
    told = conformity(found, made, numbers, 9.9, 0.5)
    assert [(c.decision, c.motors) for c in told.counts] == [("fail", 2), ("pass", 2)]
    assert (told.worst, told.worst_motor) == ("fail", "c")
    expected = risks(Tolerance(9.5, 10.5), 9.9, math.sqrt(0.25 - 0.01), 0.1)
    assert told.risk_false_accept == expected.false_accept > 0.0
    assert told.risk_false_reject == expected.false_reject > 0.0
    fine = conformity(found, [made[0]], numbers, 10.1, None)
    assert (fine.worst, fine.worst_motor, fine.risk_false_accept) == ("pass", None, None)
    nobody = conformity(found, [], numbers, 0.0, None)
    assert (nobody.worst, nobody.worst_motor, nobody.counts) == ("not_evaluated", None, ())


@pytest.mark.parametrize(
    ("value", "inside"), [(1.0, 0.1), (1.05, 0.05), (0.93, 0.03), (1.2, -0.1), (0.8, -0.1)]
)
def test_how_far_inside_counts_to_the_nearer_limit(value: float, inside: float) -> None:
    held = Held(None, None, {}, Tolerance(0.9, 1.1))
    assert _inside(held, value) == pytest.approx(inside)
    assert _inside(Held(None, None, {}, None), value) == 0.0
