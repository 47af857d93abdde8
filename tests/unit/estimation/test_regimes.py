"""A constant that its own regimes contradict is wide or withheld, and named."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators.inertia import ESTIMATOR
from pipeline.estimation.registry import fit_all
from pipeline.estimation.uncertainty.regimes import (
    Partition,
    Regression,
    disagreement,
    halves,
    information,
)
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import BETWEEN, type_b, without_between
from pipeline.simulator.design import Extra, Motor
from tests.recovery.simulated import MOTOR, recorded

KT = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb
KNOWN = Constants(
    (Estimate("kt_peak_nm_a", KT, "N·m/A", "measured", "given", type_b("given", 0.002 * KT)),)
)
PLAN = (
    ("spin_down_0", "spin_down", {"direction": 1}),
    ("drive_0", "drive", {"segments": 8, "segment_s": 0.15, "load": 0.0, "id_level": 0.0}),
)


def losing(share: float) -> Motor:
    """A motor that loses this share of the current's torque at rated speed, linearly in speed."""
    top = 1.2 * MOTOR.speed_rated_rad_s
    speeds = np.linspace(-top, top, 65)
    lost = -share * KT * np.abs(speeds) / MOTOR.speed_rated_rad_s
    extra = Extra("torque", "omega_mech_rad_s", tuple(speeds), tuple(lost), times="iq_a")
    return replace(MOTOR, extras=(extra,))


def inertia_of(motor: Motor, seed: int) -> Estimate:
    campaign, _ = recorded(PLAN, seed, motor)
    found = ESTIMATOR.fit(campaign, KNOWN, ESTIMATOR.options)
    return next(e for e in found.estimates if e.name == "j_rotor_kgm2")


def disagreeing(estimate: Estimate) -> float:
    """Relative uncertainty from regimes that differ."""
    parts = [p.u for p in estimate.budget if p.source == f"{BETWEEN}inertia:{estimate.name}"]
    return math.hypot(*parts) / abs(estimate.number)


@pytest.mark.parametrize("seed", [1, 2])
def test_inertia_off_with_torque_lost_to_speed_is_never_stated_narrow(seed: int) -> None:
    """Before: 5 to 26 % off with u of 1 to 2 %, z up to 12."""
    for share in (0.1, 0.4):
        found = inertia_of(losing(share), seed)
        assert abs(found.number / MOTOR.j_rotor_kgm2 - 1.0) > 0.02
        assert disagreeing(found) > 0.0
        low, high = found.interval()
        assert low <= MOTOR.j_rotor_kgm2 <= high
        assert "disagrees with itself by speed" in found.note
        named = without_between(found.budget)
        plain = replace(found, budget=[p for p in named if p.source != "assumed:drag_form"])
        assert plain.interval()[0] > MOTOR.j_rotor_kgm2


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_whole_law_does_not_contradict_itself(seed: int) -> None:
    """Nothing hidden: regimes scatter by a two-thousandth at most, and u is what it was."""
    found = inertia_of(MOTOR, seed)
    assert disagreeing(found) < 5e-4
    plain = replace(found, budget=without_between(found.budget))
    assert found.u == pytest.approx(plain.u, rel=0.03)


def test_inertia_of_regimes_far_apart_is_withheld_with_the_reason() -> None:
    """Seven tenths of the torque lost at full speed: no inertia, and the reason names regimes."""
    campaign, _ = recorded(
        (*PLAN, ("open_circuit", "open_circuit", {}), ("r", "resistance", {})), 1, losing(0.7)
    )
    found = fit_all(campaign, {})[0].chosen()["j_rotor_kgm2"]
    assert found.status == "not_identifiable"
    assert "disagrees with itself by speed" in found.note
    assert "diagnose" in found.note


def line(rng: np.random.Generator, slopes: tuple[float, float], n: int = 400) -> Regression:
    """Y = a x + b + noise with one slope below x = 0 and another above."""
    x = rng.uniform(-1.0, 1.0, n)
    y = np.where(x > 0.0, slopes[1], slopes[0]) * x + 0.3 + 0.05 * rng.standard_normal(n)
    design = np.column_stack([x, np.ones(n)])
    return Regression(design, y, np.full(n, 0.05), np.arange(n) // 8)


def by_sign(regression: Regression) -> Partition:
    return Partition("x", (regression.design[:, 0] > 0.0).astype(np.int64), ("low", "high"))


def test_a_slope_that_differs_is_found_with_its_size() -> None:
    regression = line(np.random.default_rng(1), (1.0, 1.4))
    found = disagreement(regression, 0, lambda _: [by_sign(regression)], 0.001)
    assert found is not None
    common = float(np.linalg.lstsq(regression.design, regression.y, rcond=None)[0][0])
    assert found.relative * common == pytest.approx([1.0, 1.4], abs=0.05)
    assert found.between.sd * common == pytest.approx(0.4 / math.sqrt(2.0), abs=0.04)
    assert found.part("x", 10.0).dof == 1


def test_equal_slopes_are_told_apart_once_in_a_hundred_at_most() -> None:
    """At a level of 0.05 over 300 draws: between 1 and 10 % (99.9 % of binomial draws)."""
    rng = np.random.default_rng(7)
    drawn = [line(rng, (1.0, 1.0)) for _ in range(300)]
    told = [disagreement(r, 0, lambda _, r=r: [by_sign(r)], 0.05) is not None for r in drawn]
    assert 0.01 <= np.mean(told) <= 0.10


def test_a_regime_that_tells_next_to_nothing_has_no_say() -> None:
    """Two captures, the second with a hundredth of the information and quite another slope."""
    rng = np.random.default_rng(2)
    x = np.concatenate([rng.uniform(-1, 1, 300), rng.uniform(-0.1, 0.1, 300)])
    second = np.arange(600) >= 300
    y = np.where(second, 3.0, 1.0) * x + 0.01 * rng.standard_normal(600)
    regression = Regression(
        np.column_stack([x, np.ones(600)]), y, np.full(600, 0.01), np.arange(600) // 8
    )
    capture = Partition("capture", second.astype(np.int64), ("a", "b"))
    assert information(regression, 0)[second].sum() < 0.02
    assert disagreement(regression, 0, lambda _: [capture], 0.001) is None


def test_halves_hold_half_of_the_information_each() -> None:
    values = np.arange(10.0)
    weight = np.array([0, 0, 0, 0, 0, 0, 0.2, 0.3, 0.25, 0.25])
    part = halves("v", values, "low", "high", weight, values > 4.0)
    assert part.labels.tolist() == [-1, -1, -1, -1, -1, 0, 0, 0, 1, 1]
