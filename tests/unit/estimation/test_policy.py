"""Numbers of judgement of estimation: all in the policy, and in force where they are set."""

from __future__ import annotations

import ast
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import norm

import pipeline.estimation
from pipeline.api.options import check_options
from pipeline.estimation.alone import readings
from pipeline.estimation.policy import DEFAULT, changed, policy, under
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.errors import UsageError
from pipeline.records.policy import entries
from pipeline.settings import RunSettings

ROOT = Path(pipeline.estimation.__file__).parent
# Grids, conversions and names of places, which judge nothing.
NO_JUDGEMENT = {
    "BETWEEN", "BUMPS", "COAST", "DRIVE", "KNOTS", "LD", "LEAST_LEVELS", "LEAST_ROWS",
    "LOW_KNOTS", "LQ", "ORDERS", "RANGE_OF_THREE", "REFERENCE_DEGC", "SAME", "SPACE",
    "STEP_1_K", "TERMS", "TURN", "TURN_RAD", "WHOLE", "WITHOUT_ACCELERATION",
}  # fmt: skip


def numbers_at_the_top(tree: ast.Module) -> set[str]:
    """Names of a module that are given a number, or a row of them, when it is imported."""
    found = set()
    for node in tree.body:
        if not isinstance(node, (ast.Assign, ast.AnnAssign)) or node.value is None:
            continue
        leaves = [n for n in ast.walk(node.value) if not list(ast.iter_child_nodes(n))]
        values = {type(n.value) for n in leaves if isinstance(n, ast.Constant)}
        numeric, texts = bool(values & {int, float}), str in values
        targets = node.targets if isinstance(node, ast.Assign) else [node.target]
        if numeric and not texts:
            found |= {n.id for t in targets for n in ast.walk(t) if isinstance(n, ast.Name)}
    return found


def test_no_module_keeps_a_number_of_judgement() -> None:
    """A threshold at the top of a module is a field of the policy instead."""
    found = {
        f"{path.relative_to(ROOT)}: {name}"
        for path in sorted(ROOT.rglob("*.py"))
        for name in numbers_at_the_top(ast.parse(path.read_text()))
        if name not in NO_JUDGEMENT and path.parent.name != "policy"
    }
    assert found == set()
    assert numbers_at_the_top(ast.parse("LIMIT = 3.0")) == {"LIMIT"}


def test_every_number_says_what_it_is() -> None:
    names = [entry.name for entry in entries(DEFAULT)]
    assert len(names) == len(set(names)) > 50
    for entry in entries(DEFAULT):
        assert entry.unit
        assert len(entry.meaning) > 10, entry.name
        assert len(entry.origin.reason) > 10, entry.name


def test_the_manual_states_the_numbers_in_force() -> None:
    """A number that is changed by mistake is another than the one that the manual gives."""
    page = (ROOT.parents[1] / "docs" / "policy.md").read_text(encoding="utf-8")
    section, stated = "", {}
    for line in page.partition("## Estimators")[2].splitlines():
        if line.startswith("### "):
            section = line[4:]
        elif line.startswith("| `"):
            _, field, value, *_ = (cell.strip() for cell in line.split("|"))
            numbers = [float(one) for one in value.split(",")]
            stated[f"{section}.{field.strip('`')}"] = numbers
    for entry in entries(DEFAULT):
        assert stated.pop(entry.name) == pytest.approx(np.atleast_1d(entry.value)), entry.name
    assert stated == {}


def test_numbers_that_follow_from_a_source_follow_from_it() -> None:
    """By normal deviates, by the scatter of a scatter, by coefficients of magnets and copper."""
    evidence, spread = DEFAULT.evidence, DEFAULT.capture_spread
    assert 2.0 * norm.sf(evidence.sigmas) == pytest.approx(1.0 / 16e3, rel=0.02)
    assert 2.0 * norm.sf(DEFAULT.back_emf.standing_sigmas) == pytest.approx(2e-9, rel=0.02)
    assert 2.0 * norm.sf(DEFAULT.points.drift_sigmas) == pytest.approx(2e-9, rel=0.02)
    assert 2.0 * norm.sf(DEFAULT.steps.spike_sigmas) == pytest.approx(1e-15, rel=0.3)
    assert 1.0 / np.sqrt(2.0 * (evidence.rows - 1)) == pytest.approx(1.0 / 6.0, rel=0.03)
    assert 1.0 / np.sqrt(2.0 * DEFAULT.drag.least_freedom) == 0.25
    assert spread.inverter == pytest.approx(1e-6 * 20e3)
    for share, kelvin in (
        (spread.flux_temperature_known, 5.0),
        (spread.flux_temperature_unpowered, 10.0),
        (spread.flux_temperature_unknown, 20.0),
    ):
        assert share == pytest.approx(kelvin * abs(DEFAULT.magnet.coefficient_1_k), rel=0.1)
    assert spread.resistance_temperature_known == pytest.approx(5.0 * 0.0039, rel=0.05)


def test_every_number_is_used() -> None:
    """Each field stands in the code under its name."""
    text = "\n".join(
        path.read_text() for path in ROOT.rglob("*.py") if path.parent.name != "policy"
    )
    unused = [e.name for e in entries(DEFAULT) if f".{e.name.rsplit('.', 1)[-1]}" not in text]
    assert unused == []


def test_a_change_is_in_force_and_is_gone_again() -> None:
    changes = changed({"policy": {"drag": {"material_share": 0.05}}})
    with under(changes) as options:
        assert policy().drag.material_share == 0.05
        assert options == {"policy.drag.material_share": 0.05}
    assert policy() is DEFAULT
    with pytest.raises(ZeroDivisionError), under(changes):
        raise ZeroDivisionError
    assert policy() is DEFAULT


def test_what_is_no_field_is_refused_with_the_nearest() -> None:
    settings = RunSettings(fit={"policy": {"drag": {"material_sahre": 0.05}}})
    with pytest.raises(UsageError) as refused:
        check_options(settings)
    assert "drag.material_share" in refused.value.remedy
    check_options(RunSettings(fit={"policy": {"drag": {"material_share": 0.05}}}))


def hand_turn() -> Campaign:
    """One turn by hand at 60 degC: the magnet's coefficient is assumed."""
    t = np.arange(0.0, 2.0, 1e-3)
    angle = 2.0 * np.pi * np.clip(0.5 - 0.5 * np.cos(np.pi * t / 2.0), 0.0, 1.0)
    flux = 0.01 * np.cos(4.0 * angle)
    table = {"t_s": t, "theta_mech_rad": angle, "vab_v": np.sqrt(3.0) * np.gradient(flux, t)}
    meta = CaptureMeta("m", "hand_turn", pair="ab", ambient_degc=60.0)
    return Campaign("m", (Capture("a.csv", "0" * 64, "verified", meta, (pl.DataFrame(table),)),))


def test_a_reading_and_the_key_of_a_fit_follow_the_policy() -> None:
    campaign = hand_turn()
    changes = {"policy": {"capture_spread": {"count": 0.004}}}
    plain, wide = (
        readings(campaign, campaign.captures, options)[0].u_rel_model for options in ({}, changes)
    )
    assert plain == DEFAULT.capture_spread.count
    assert wide == 0.004
    seen: list[set[str]] = []

    def recall(estimator, known, options, fit):
        seen.append({name for name in options if name.startswith("policy.")})
        return fit()

    fit_all(campaign, {}, recall)
    assert not set().union(*seen)
    fit_all(campaign, changes, recall)
    assert seen[-1] == {"policy.capture_spread.count"}
