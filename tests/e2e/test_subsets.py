"""Random subsets of captures and columns: whatever is told, its 95 % interval holds."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.special import bdtr

from pipeline.criticism.comparison import compare
from pipeline.criticism.diagnosis import diagnose
from pipeline.crosscheck.plan import Aims, Known, make_plan
from pipeline.crosscheck.registry import check_all, rules
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from pipeline.simulator.truth import truth
from pipeline.stages.plan import ways_of
from pipeline.stages.steps.campaigns import campaigns
from tests.simulated import campaign_of, design

P0 = Path(__file__).parents[3] / "shared" / "data" / "rig" / "P0"
needs_p0 = pytest.mark.skipif(not P0.is_dir(), reason="../shared/data/rig/P0 is not here")
NAMES = {
    "r_ohm": "r_phase_ohm",
    "ld_h": "ld_h",
    "lq_h": "lq_h",
    "psi_wb": "psi_pm_wb",
    "j_kgm2": "j_rotor_kgm2",
    "b_nm_s_rad": "b_visc_nm_s_rad",
    "coulomb_friction.torque_nm": "torque_coulomb_nm",
    "copper_temperature.alpha_1_k": "temp_coeff_copper_1_k",
    "magnet_temperature.alpha_1_k": "temp_coeff_magnet_1_k",
}
"""Parameters of `compare`, by the constants that they are."""
QUICK = {"spin_down", "cogging", "lcr", "resistance", "open_circuit", "current_step"}
LEVEL, REACH, SURE = 0.05, 1.959964, 1e-3
Told = Iterator[tuple[str, bool]]


def part_of(captures: list[Capture], rng: np.random.Generator) -> list[Capture]:
    """Some kinds of test, some captures of these, and in every second draw some columns less."""
    kinds = sorted({one.meta.test for one in captures})
    chosen = set(rng.choice(kinds, rng.integers(1, len(kinds) + 1), replace=False).tolist())
    some = [one for one in captures if one.meta.test in chosen and rng.random() < 0.8]
    some = some or [one for one in captures if one.meta.test in chosen][:1]
    columns = sorted({name for one in some for table in one.tables for name in table.columns})
    lost = {name for name in columns if name != "t_s" and rng.random() < 0.15 * rng.integers(2)}
    return [
        replace(one, tables=tuple(table.drop(lost, strict=False) for table in one.tables))
        for one in some
    ]


def compared(part: Campaign, true: Mapping[str, float]) -> Told:
    """Every parameter, and every combination, that `compare` tells, and whether it holds."""
    known = {name: true[constant] for name, constant in NAMES.items()}
    result = compare(part, ModelSpec(), Constants())
    for name, one in result.parameters.items():
        if one.value is not None and one.u is not None:
            yield name, abs(one.value - known[name]) <= REACH * one.u
    for both in result.combinations:
        # one that an equation names begins with its name
        words = both.expression.rpartition(" = ")[2].replace("pole_pairs", repr(true["pole_pairs"]))
        for name in sorted(both.of, key=len, reverse=True):
            words = words.replace(name, repr(known[name]))
        yield both.expression, abs(both.value - eval(words)) <= REACH * both.u


def fitted(part: Campaign, true: Mapping[str, float]) -> Told:
    """Every constant that `run` tells, and whether its own interval holds the truth."""
    constants, _, _ = fit_all(part, {})
    for name in NAMES.values():
        found = constants.best(name)
        if found is not None:
            low, high = found.interval()
            yield f"run {name}", low <= true[name] <= high


def judged(parts: Iterator[tuple[Campaign, Mapping[str, float]]], least: int) -> None:
    """No interval misses more often than chance lets a sound one, and enough was told to say so."""
    tried: Counter[str] = Counter()
    missed: Counter[str] = Counter()
    for part, true in parts:
        for name, holds in (*compared(part, true), *fitted(part, true)):
            tried[name] += 1
            missed[name] += not holds
    too_often = {
        name: (missed[name], count)
        for name, count in tried.items()
        if missed[name] and bdtr(count, count, LEVEL) - bdtr(missed[name] - 1, count, LEVEL) < SURE
    }
    assert too_often == {}
    assert missed.total() <= 2 * LEVEL * tried.total()
    assert tried.total() >= least


def of_the_simulator(draws: range, kinds: set[str]) -> Iterator[tuple[Campaign, Mapping]]:
    """A motor without cogging on a station of its own for every draw."""
    motor = replace(design("gimbal-5208"), effects={})
    plan = tuple(step for step in CAMPAIGN if step[1] in kinds)
    true = truth(motor)["constants"]
    for seed in draws:
        whole = campaign_of(campaign(motor, Bench(), seed, plan))
        part = part_of(list(whole.captures), np.random.default_rng(seed))
        yield replace(whole, captures=tuple(part)), true


def of_the_rig(draws: range, kinds: set[str] | None = None) -> Iterator[tuple[Campaign, Mapping]]:
    whole = campaigns(str(P0))[0][0]
    true = json.loads((P0 / "truth.json").read_bytes())["constants"]
    captures = [one for one in whole.captures if kinds is None or one.meta.test in kinds]
    for seed in draws:
        part = part_of(captures, np.random.default_rng(seed))
        yield replace(whole, captures=tuple(part)), true


ONE = range(3, 4)
"""A draw of ten captures of five tests, among them few that take long."""


def test_intervals_of_a_subset_hold():
    judged(of_the_simulator(ONE, QUICK), 10)


@pytest.mark.slow
def test_intervals_of_a_few_subsets_hold():
    judged(of_the_simulator(range(2), QUICK), 10)


@pytest.mark.slow
@needs_p0
def test_intervals_of_a_few_subsets_of_the_rig_hold():
    judged(of_the_rig(range(4), QUICK), 10)


@pytest.mark.slow
def test_intervals_of_many_subsets_hold():
    judged(of_the_simulator(range(40), {test for _, test, _ in CAMPAIGN}), 200)


@pytest.mark.slow
@needs_p0
def test_intervals_of_many_subsets_of_the_rig_hold():
    judged(of_the_rig(range(40)), 200)


def some_captures(draws: range) -> Iterator[tuple[Campaign, Mapping]]:
    """Subsets of captures of the rig, and in every second one no voltages or no torque.

    Columns whose loss hides a state of the machine within a capture stay: of a winding that warms
    while it is driven without a thermometer, a field current that is not logged and a lagging speed
    in place of an angle `diagnose` says that it does not know what is left, which is so, and names
    the signal. Between captures a winding may be warmer, see the test below.
    """
    whole = campaigns(str(P0))[0][0]
    true = json.loads((P0 / "truth.json").read_bytes())["constants"]
    for seed in draws:
        rng = np.random.default_rng(seed)
        captures = [one for one in whole.captures if rng.random() < 0.5]
        lost = [{"vd_v", "vq_v"}, {"torque_shaft_nm"}, set(), set()][seed % 4]
        tables = [tuple(t.drop(lost, strict=False) for t in one.tables) for one in captures]
        cut = [replace(c, tables=t) for c, t in zip(captures, tables, strict=True)]
        yield replace(whole, captures=tuple(cut)), true


def says_nothing_false(parts: Iterator[tuple[Campaign, Mapping[str, float]]]) -> int:
    """No effect is named, no remainder is unknown, and every refusal and plan has words.

    Returns how many diagnoses had something to go by.
    """
    stood = 0
    for part, _ in parts:
        found = diagnose(part, ModelSpec(), Constants())
        where = sorted((one.path, sorted(one.columns)) for one in part.captures)
        assert found.missing == (), where
        assert found.verdict in ("adequate", "insufficient"), where
        assert found.ladder or any(len(note) > 40 for note in found.notes), where
        stood += bool(found.ladder)
        constants = fit_all(part, {})[0]
        tests = frozenset(one.meta.test for one in part.captures)
        known = Known(part.motor_id, constants.chosen(), check_all(constants, part, {}), tests)
        ways = {rule.name: rule.tests for rule in rules()}
        plan = make_plan(known, ways_of(), ways, Aims())
        assert plan.steps or plan.beyond or constants.chosen(), where
        assert all(step.experiments for step in plan.steps), where
    return stood


def test_a_diagnosis_and_a_plan_of_a_subset_say_nothing_false():
    assert says_nothing_false(of_the_simulator(ONE, QUICK)) >= 1


@pytest.mark.slow
def test_diagnoses_and_plans_of_a_few_subsets_say_nothing_false():
    assert says_nothing_false(of_the_simulator(range(2), QUICK)) >= 1


@pytest.mark.slow
@needs_p0
def test_diagnoses_and_plans_of_many_subsets_of_the_rig_say_nothing_false():
    assert says_nothing_false(some_captures(range(20))) >= 8


@pytest.mark.slow
@needs_p0
def test_a_warm_winding_without_a_thermometer_says_so():
    """One resistance of the rig was recorded at 65 °C: without that column, its winding fits 40 K
    warmer, and R does not seem to change.
    """
    whole = campaigns(str(P0))[0][0]
    kept = ("drive_0", "drive_1", "resistance", "cogging_cw")
    captures = [one for one in whole.captures if one.path.startswith(kept)]
    blind = [
        replace(
            one,
            tables=tuple(t.drop("temp_winding_degc", strict=False) for t in one.tables),
        )
        for one in captures
    ]
    found = diagnose(replace(whole, captures=tuple(blind)), ModelSpec(), Constants())
    (note,) = [one for one in found.notes if "log it" in one]
    warmer = float(note.partition("temp_winding_degc of about ")[2].partition(" K")[0])
    assert 30.0 < warmer < 45.0 and "resistance_ab_3" in note
    assert (found.verdict, found.missing) == ("adequate", ())
