"""An inertia from drives that do not log what loads the shaft."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.estimation.estimators.inertia import GIVES
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.estimation.policy import DEFAULT
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import CAMPAIGN, campaign
from tests.simulated import campaign_of, design
from tests.unit.estimation.mechanical import EXACT_BENCH, chain, recorded
from tests.unit.estimation.signals import capture, estimates, known_value

KT_NM_A, J_KGM2, COULOMB_NM, VISCOUS, LOAD_SHARE = 0.08, 4e-4, 0.01, 1e-4, 0.2
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


@pytest.mark.parametrize("load", [0.05, pytest.param(0.1, marks=pytest.mark.slow)])
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


def driven(seed: int, *, held_against: bool) -> Capture:
    """A log whose load is not on record; a speed loop holds the current against it, or not."""
    rng = np.random.default_rng(seed)
    t_s = np.arange(0.0, 12.0, 1e-3)
    phases = rng.uniform(0.0, 2 * np.pi, (2, 12))
    rates = rng.uniform(4.0, 30.0, (2, 12))
    sums = [np.sin(np.outer(t_s, r) + p).sum(axis=1) for r, p in zip(rates, phases, strict=True)]
    size_nm = KT_NM_A * 3.0
    wanted, load = size_nm * sums[0], LOAD_SHARE * size_nm * sums[1]
    gain = (wanted if held_against else wanted - load) / J_KGM2
    omega = 150.0 + np.cumsum(gain) * 1e-3
    theta = np.cumsum(omega) * 1e-3
    drag = COULOMB_NM * np.sign(omega) + VISCOUS * omega
    current = (wanted + (load if held_against else 0.0) + drag) / KT_NM_A
    return capture("drive", f"d{seed}", t_s=t_s, iq_a=current, id_a=0 * t_s, theta_mech_rad=theta)


@pytest.mark.parametrize("held_against", [True, False])
def test_the_inertia_lies_between_both_ways_a_load_may_act(held_against: bool) -> None:
    """In the middle of both regressions: neither case is off to one side by more than its u."""
    known = Constants((known_value("kt_peak_nm_a", KT_NM_A, 1e-6, "N·m/A"),))
    off = []
    for seed in range(6):
        one = estimates(INERTIA, driven(seed, held_against=held_against), known=known)[GIVES[0]]
        doubt = {part.source: part.u for part in one.budget}["assumed:free_shaft"]
        assert 0.003 * J_KGM2 < doubt < 0.1 * J_KGM2
        assert abs(one.number - J_KGM2) < 2.0 * one.u
        off.append((one.number - J_KGM2) / doubt)
    # half of the way from one regression to the other is one half width of the doubt
    assert 0.5 < np.mean(off) * (1.0 if held_against else -1.0) < 1.5
