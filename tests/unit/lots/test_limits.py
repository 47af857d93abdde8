"""Limits files: what they mean, and what the linter finds in them."""

from __future__ import annotations

from pathlib import Path

import pytest

from pipeline.estimation.registry import estimators
from pipeline.io.storage.limits import read_limits, release_conditions, required_constants
from pipeline.lots.limits_lint import lint
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.errors import UsageError
from pipeline.records.limits import Amount, Limits, amount_from
from pipeline.settings import configuration_folder

GOOD = """
required: [r_phase_ohm]
golden: [GM-1]
rules: {alpha: 0.01, min_lots: 10, k: 3}
constants:
  psi_pm_wb:
    nominal: 0.0071
    tolerance: 3 %
    minimum: 0.0068
    guard_band: 0.822 U
    decision_rule: guarded
    equivalence_margin: [1 %, 1.5 sd]
    decides: no
  r_phase_ohm: {tolerance: 0.02}
"""


def written(tmp_path: Path, text: str) -> Limits:
    path = tmp_path / "own.yaml"
    path.write_text(text)
    return read_limits(path)


def test_a_file_as_it_is_meant(tmp_path: Path) -> None:
    limits = written(tmp_path, GOOD)
    psi, r = limits.constants
    assert (limits.alpha, limits.min_lots, limits.k) == (0.01, 10, 3.0)
    assert limits.golden == ("GM-1",)
    assert psi.nominal == 0.0071
    assert psi.tolerance == Amount(0.03, "nominal")
    assert psi.margins == (Amount(0.01, "nominal"), Amount(1.5, "sd"))
    assert (psi.rule, psi.decides) == ("guarded", False)
    assert r.nominal is None
    assert r.tolerance == Amount(0.02, "unit")
    assert lint(limits, CONSTANTS) == ()


@pytest.mark.parametrize(
    ("text", "amount"),
    [
        ("3 %", Amount(0.03, "nominal")),
        ("1.5 sd", Amount(1.5, "sd")),
        ("0.822 U", Amount(0.822, "U")),
        ("U", Amount(1.0, "U")),
        ("0.0002", Amount(0.0002, "unit")),
    ],
)
def test_amounts(text: str, amount: Amount) -> None:
    assert amount_from(text) == amount


@pytest.mark.parametrize("path", sorted((configuration_folder() / "limits").glob("*.yaml")))
def test_the_files_of_the_project_are_clean(path: Path) -> None:
    terms = {term.name: term for estimator in estimators() for term in estimator.terms}
    assert lint(read_limits(path), {**terms, **CONSTANTS}) == ()


@pytest.mark.parametrize(
    ("constant", "fault"),
    [
        ("{nominal: 1, tolerance: 3 %, minimum: 0.98}", "minimum 0.98 is tighter than its design"),
        ("{nominal: 1, tolerance: 0.03, maximum: 1.02}", "maximum 1.02 is tighter than its design"),
        ("{nominal: 1, minimum: 1.1}", "minimum 1.1 leaves the nominal 1 outside"),
        ("{minimum: 2, maximum: 1}", "minimum 2 is not below maximum 1"),
        ("{nominal: 1, tolerance: 1 %, guard_band: 0.02}", "leaves nothing of the tolerance"),
        ("{nominal: 1, tolerance: -1 %}", "tolerance is not positive"),
        ("{nominal: 1, tolerance: 2 U}", "a worse bench would pass more"),
        ("{nominal: 1, tolerance: 1 %, guard_band: -0.001}", "guard_band is negative"),
        ("{equivalence_margin: 0}", "equivalence_margin is not positive"),
        ("{nominal: 1, tolerance: 1 %, equivalence_margin: 5 %}", "wider than the tolerance"),
        ("{tolerate_within_margin: yes}", "needs an equivalence_margin"),
        ("{nominal: -5}", "beyond what the glossary takes for plausible"),
    ],
)
def test_faults_of_a_constant(tmp_path: Path, constant: str, fault: str) -> None:
    text = f"required: []\nconstants:\n  r_phase_ohm: {constant}\n"
    assert any(fault in one for one in lint(written(tmp_path, text), CONSTANTS))


@pytest.mark.parametrize(
    ("rules", "fault"),
    [
        ("{alpha: 0}", "alpha 0"),
        ("{min_lots: 2}", "min_lots 2"),
        ("{k: 0}", "coverage factor"),
        ("{order_share: 2}", "no share"),
        ("{code_limit: 0.1}", "code_negligible is above"),
    ],
)
def test_faults_of_the_rules(tmp_path: Path, rules: str, fault: str) -> None:
    text = f"required: []\nrules: {rules}\n"
    assert any(fault in one for one in lint(written(tmp_path, text), CONSTANTS))


@pytest.mark.parametrize(
    "rules", ["{order_share: 0.05}", "{order_share: 0}", "{alpha: 0.4}", "{min_lots: 3}"]
)
def test_rules_inside_their_bounds_have_no_fault(tmp_path: Path, rules: str) -> None:
    assert lint(written(tmp_path, f"required: []\nrules: {rules}\n"), CONSTANTS) == ()


def test_every_fault_at_once(tmp_path: Path) -> None:
    text = "required: []\ngolden: [a, a]\nconstants: {nothing_v: {}, ld_h: {tolerance: -1}}\n"
    found = lint(written(tmp_path, text), CONSTANTS)
    assert len(found) == 3


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("constants: {r_phase_ohm: {tolerence: 1}}\nrequired: []", "no key 'tolerence'"),
        ("required: []\nconstants: {r_phase_ohm: {tolerance: wide}}", "is no number"),
        ("required: []\nconstants: {r_phase_ohm: {decision_rule: lenient}}", "no decision rule"),
        ("required: []\nconstants: {r_phase_ohm: {decides: perhaps}}", "decides is 'perhaps'"),
        ("required: []\nconstants: [r_phase_ohm]", "constants holds no keys"),
        ("required: []\nrules: {alpha: low}", "alpha: 'low' is no number"),
        ("required: []\nrules: {nonsense: 1}", "no key 'nonsense'"),
        ("required: []\nextra: 1", "no key 'extra'"),
        ("required: [bogus]", "no constant 'bogus'"),
        ("about: nothing", "needs `required:`"),
        ("required: &a []\nconstants: {r_phase_ohm: *a}", "alias"),
        ("- a list", "holds no keys"),
        ("required: [\n", "YAML"),
    ],
)
def test_what_cannot_be_read(tmp_path: Path, text: str, words: str) -> None:
    with pytest.raises(UsageError, match=words) as caught:
        written(tmp_path, text)
    assert caught.value.exit_code == 2


def test_required_constants_of_the_default() -> None:
    path = configuration_folder() / "limits" / "default.yaml"
    assert "psi_pm_wb" in required_constants(path)
    assert set(required_constants(path)) <= {one.name for one in read_limits(path).constants}


@pytest.mark.parametrize(("line", "gates"), [("", True), ("model_gates: no\n", False)])
def test_a_file_says_whether_the_model_gates_a_release(
    tmp_path: Path, line: str, gates: bool
) -> None:
    path = tmp_path / "own.yaml"
    path.write_text(f"required: [ld_h]\n{line}")
    assert release_conditions(path) == (("ld_h",), gates)
    path.write_text("required: [ld_h]\nmodel_gates: perhaps\n")
    with pytest.raises(UsageError, match="model_gates is 'perhaps'; write yes or no"):
        release_conditions(path)
