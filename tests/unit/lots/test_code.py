"""The same captures under two versions: what is the same, what changed, what was lost."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import pytest

from pipeline.lots.code import Pair, compare_versions
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.datasheet import Check, Datasheet
from pipeline.records.estimate import not_identifiable
from pipeline.records.lot_constant import ConstantResult
from pipeline.records.lot_regression import LotRegression
from tests.unit.lots.production import group, limits, members, sheet

LIMITS = limits(("ld_h", "psi_pm_wb"))
U = 1e-4


def compared(before: list[Datasheet], after: list[Datasheet]) -> LotRegression:
    old, new = members(before, "baseline"), members(after, "candidate")
    groups = tuple(
        replace(group(side, found), code_versions=codes)
        for side, found, codes in (("baseline", old, ("1",)), ("candidate", new, ("2", "3")))
    )
    pairs = [Pair(a, b) for a, b in zip(old, new, strict=True)]
    return compare_versions(pairs, groups, LIMITS, CONSTANTS)  # type: ignore[arg-type]


def one(**changes: float) -> tuple[LotRegression, ConstantResult]:
    """A motor whose Ld was 1 ± 1e-4 under the old version; `value` and `u` are the new ones."""
    before = sheet("m", "lot", "S1", {"ld_h": 1.0}, u=U)
    after = sheet("m", "lot", "S1", {"ld_h": changes.get("value", 1.0)}, u=changes.get("u", U))
    found = compared([before], [after])
    return found, found.constants[0]


@pytest.mark.parametrize(
    ("in_u", "verdict", "decision"),
    [
        (0.0, "pass", "pass"),
        (0.3, "pass", "pass"),
        (-0.36, "marginal", "conditional_pass"),
        (0.98, "marginal", "conditional_pass"),
        (-1.02, "fail", "fail"),
    ],
)
def test_a_change_counts_in_units_of_the_old_u(in_u: float, verdict: str, decision: str) -> None:
    """Up to a third it is the same, up to one it is remarked, above one a version is wrong."""
    found, constant = one(value=1.0 + in_u * U)
    assert (found.verdict, constant.verdict) == (verdict, verdict)
    assert constant.conformity.counts[0].decision == decision
    assert [c.motors for c in constant.conformity.counts] == [1]
    assert constant.effect.in_sd == pytest.approx(in_u, abs=1e-9)
    assert constant.effect.difference == pytest.approx(in_u * U, abs=1e-13)
    assert constant.conformity.worst == decision
    assert constant.conformity.worst_motor == (None if decision == "pass" else "m")
    assert [m.decision for m in constant.motors] == ["not_evaluated", decision]
    assert f"Code 2, 3 {'gives' if verdict != 'fail' else 'does not'}" in found.headline
    assert constant.decides
    assert (constant.unit, constant.words) == ("H", CONSTANTS["ld_h"].words)


def test_rounding_is_no_change_even_without_u() -> None:
    exact = sheet("m", "lot", "S1", {"ld_h": 1.0}, u=0.0)
    same = sheet("m", "lot", "S1", {"ld_h": 1.0 + 1e-15}, u=0.0)
    other = sheet("m", "lot", "S1", {"ld_h": 1.0 - 1e-6}, u=0.0)
    assert compared([exact], [same]).constants[0].verdict == "pass"
    failed = compared([exact], [other]).constants[0]
    assert (failed.verdict, failed.effect.in_sd) == ("fail", None)
    assert "without a stated u" in failed.why


@pytest.mark.parametrize(
    ("factor", "verdict"), [(1.01, "pass"), (3.0, "marginal"), (0.3, "marginal")]
)
def test_another_u_is_remarked(factor: float, verdict: str) -> None:
    _, constant = one(u=factor * U)
    assert constant.verdict == verdict
    assert (f"m {factor:.3g} times" in constant.why) == (verdict == "marginal")


def without(name: str, whole: Datasheet, gone: bool = False) -> Datasheet:
    """The sheet without a constant: not there at all, or not identifiable."""
    left: Mapping = {n: e for n, e in whole.constants.items() if n != name}
    lost = {} if gone else {name: not_identifiable(name, "H", "test", "record more")}
    return replace(whole, constants={**left, **lost})


@pytest.mark.parametrize("gone", [True, False])
def test_what_is_lost_fails_and_what_is_new_does_not(gone: bool) -> None:
    whole = sheet("m", "lot", "S1", {"ld_h": 1.0, "psi_pm_wb": 2.0}, u=U)
    less = without("ld_h", whole, gone)
    lost, kept = compared([whole], [less]).constants
    assert (lost.verdict, kept.verdict) == ("fail", "pass")
    assert (lost.why, lost.missing) == ("1 motor lost it, m first", ("m: lost",))
    assert lost.conformity.worst == "not_evaluated"
    new, _ = compared([less], [whole]).constants
    assert (new.verdict, new.missing) == ("not_evaluated", ("m: new",))
    assert [c.name for c in compared([less], [less]).constants] == ["psi_pm_wb"]


def failing(whole: Datasheet, *names: str) -> Datasheet:
    return replace(whole, checks=tuple(Check(name, "fail", "x") for name in names))


def test_a_check_that_fails_anew_fails() -> None:
    plain = sheet("m", "lot", "S1", {"ld_h": 1.0}, u=U)
    worse = compared([failing(plain, "both")], [failing(plain, "both", "kt_vs_ke")])
    assert [(e.name, e.verdict) for e in worse.effects] == [("check kt_vs_ke", "fail")]
    assert ": 1 motor, m" in worse.effects[0].why
    assert worse.verdict == "fail"
    better = compared([failing(plain, "kt_vs_ke")], [plain])
    assert [(e.verdict, e.why) for e in better.effects] == [
        ("marginal", "no longer failing it: 1 motor")
    ]


def test_the_worst_of_several_motors_is_named() -> None:
    before = [sheet(f"m{k}", "lot", "S1", {"ld_h": 1.0}, u=U) for k in range(3)]
    after = [
        sheet(f"m{k}", "lot", "S1", {"ld_h": 1.0 + change * U}, u=U)
        for k, change in enumerate((0.1, -0.9, 0.5))
    ]
    (constant,) = compared(before, after).constants
    assert constant.conformity.worst_motor == "m1"
    assert constant.why.startswith("largest change −0.9 u (m1)")
    assert [(c.decision, c.motors) for c in constant.conformity.counts] == [
        ("conditional_pass", 2),
        ("pass", 1),
    ]
