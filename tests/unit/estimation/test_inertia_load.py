"""An inertia from drives that do not log what loads the shaft."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.estimators.inertia import GIVES
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.policy import DEFAULT
from pipeline.records.capture import Campaign
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import CAMPAIGN, campaign
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import EXACT_BENCH, chain, recorded

MOTOR = replace(design("gimbal-5208"), effects={})


def without_load(captures: Campaign, drives: int) -> Campaign:
    """The campaign whose first drives say nothing of the load."""
    blind = [c.path for c in captures.of("drive")][:drives]
    return Campaign(
        captures.motor_id,
        tuple(
            replace(c, tables=tuple(t.drop("torque_shaft_nm", strict=False) for t in c.tables))
            if c.path in blind
            else c
            for c in captures.captures
        ),
    )


def found(captures: Campaign) -> dict[str, Estimate]:
    known = chain(captures, TORQUE_MAP, INERTIA)
    own = {name: known.all_of(name) for name in GIVES}
    return {name: one for name, all_ in own.items() for one in all_ if one.method == "inertia"}


def test_a_drive_that_does_not_log_its_load_is_left_out_and_named() -> None:
    captures = without_load(recorded(), 1)
    inertia = found(captures)["j_rotor_kgm2"]
    blind = captures.of("drive")[0].path
    assert inertia.number == pytest.approx(MOTOR.j_rotor_kgm2, rel=0.004)
    assert blind not in inertia.captures
    assert f"without {blind}, whose load is not logged (torque_shaft_nm)" in inertia.note


def test_loads_that_no_drive_logs_leave_no_inertia() -> None:
    """Torque that is not known goes with the acceleration: J, T_c and B are not told, and why."""
    for name, one in found(without_load(recorded(), 2)).items():
        assert one.status == "not_identifiable", name
        assert "no drive logs its load" in one.note
        assert "torque_shaft_nm" in one.note


def test_a_shaft_that_follows_its_current_runs_free() -> None:
    """Without a load and its column: J is right, its doubt in the budget and in the note."""
    plan = tuple(
        (stem, test, {**protocol, "load": 0.0} if test == "drive" else protocol)
        for stem, test, protocol in CAMPAIGN
        if test in ("torque_map", "spin_down", "drive")
    )
    captures = without_load(campaign_of(campaign(MOTOR, EXACT_BENCH, 11, plan)), 2)
    estimates = found(captures)
    inertia = estimates["j_rotor_kgm2"]
    assert inertia.number == pytest.approx(MOTOR.j_rotor_kgm2, rel=0.004)
    assert "the shaft is taken as free" in inertia.note
    for name, one in estimates.items():
        doubt = {part.source: part.u for part in one.budget}["assumed:free_shaft"]
        assert 0.0 < doubt < DEFAULT.drag.unexplained_share * one.number, name


@pytest.mark.parametrize("load", [0.05, 0.1])
def test_a_small_load_that_no_drive_logs_leaves_the_inertia_with_a_larger_u(load: float) -> None:
    """What follows no current is in the inertia's u; friction is not parted from the load."""
    plan = tuple(
        (stem, test, {**protocol, "load": load} if test == "drive" else protocol)
        for stem, test, protocol in CAMPAIGN
        if test in ("torque_map", "spin_down", "drive")
    )
    estimates = found(without_load(campaign_of(campaign(MOTOR, EXACT_BENCH, 11, plan)), 2))
    inertia = estimates["j_rotor_kgm2"]
    assert abs(inertia.number - MOTOR.j_rotor_kgm2) < 2.0 * inertia.u
    assert inertia.u < 0.15 * inertia.number
    assert "which nothing logged" in inertia.note
    for name in GIVES[1:]:
        assert not estimates[name].known
        assert "no drive logs its load" in estimates[name].note
