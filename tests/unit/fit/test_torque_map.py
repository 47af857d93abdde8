"""A warm motor: the thermometer that tells how warm, and what is assumed of its magnets."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.fit.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.fit.estimators.open_circuit import ESTIMATOR as OPEN_CIRCUIT
from pipeline.fit.estimators.torque_map import ESTIMATOR
from pipeline.fit.magnet_coefficient import SOURCE, U_USUAL_1_K
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design

EXACT_BENCH = Bench(instruments=EXACT)


def hot_map(*others: str) -> Campaign:
    """A torque map, and other tests, with the magnet at 60 degC, by exact instruments."""
    motor = replace(design("gimbal-5208"), effects={})
    plan = tuple((name, name, {"temp_magnet_degc": 60.0}) for name in ("torque_map", *others))
    return campaign_of(campaign(motor, EXACT_BENCH, 1, plan))


def torque_constant(captures: Campaign, known: Constants | None = None) -> Estimate:
    found = ESTIMATOR.fit(captures, known or Constants(), ESTIMATOR.options).estimates[0]
    assert found.name == "kt_peak_nm_a"
    return found


def test_torque_constant_at_25_degrees() -> None:
    """At 60 degC the magnet has lost 3.85 %; the constant of 25 degC is what is published."""
    motor = replace(design("gimbal-5208"), effects={})
    warm = {"temp_magnet_degc": 60.0}
    plan = (("hot", "torque_map", warm), ("back", "torque_map", {**warm, "speed": -0.3}))
    captures = campaign_of(campaign(motor, EXACT_BENCH, 1, plan))
    coefficient = Estimate(
        "temp_coeff_magnet_1_k", -0.0011, "1/K", "measured", "given", type_b("x", 1e-5)
    )
    known = Constants((coefficient,))
    kt = torque_constant(captures, known)
    truth = 1.5 * motor.pole_pairs * motor.psi_pm_wb
    assert kt.number == pytest.approx(truth, rel=5e-4)
    assert next(p.u for p in kt.budget if p.source == "x") != 0.0
    assumed = torque_constant(captures)
    share = next(p.u for p in assumed.budget if p.source == SOURCE)
    assert abs(share) / truth == pytest.approx(35.0 * U_USUAL_1_K / (1 - 0.0385), rel=0.05)


def test_one_thermometer_is_one_source_of_the_torque_constant() -> None:
    """It may read the map's magnet high and was in the coefficient too: the two add up."""
    captures = hot_map()
    meta = captures.captures[0].meta
    source = f"temperature@{meta.station}"
    budget = (*type_b(source, 2e-6), *type_b("other", 1e-5))
    known = Estimate("temp_coeff_magnet_1_k", -0.0011, "1/K", "measured", "given", budget)
    kt = torque_constant(captures, Constants((known,)))
    parts = {part.source: part.u for part in kt.budget}
    assert len(parts) == len(kt.budget)
    # K25 is high by alpha times the thermometer's error, and low by 35 K times alpha's.
    expected = 0.0011 * (meta.u_temp_degc or 0.0) - 35.0 * 2e-6
    assert parts[source] == pytest.approx(kt.number * expected / (1 - 0.0385), rel=0.02)


def with_slow_magnet_temperature(capture: Capture, every: int) -> Capture:
    """The capture with the magnet's temperature on a slower clock, whose last row comes early."""
    fast = capture.tables[0]
    slow = fast.select("t_s", "temp_magnet_degc")[::every]
    return replace(capture, tables=(fast.drop("temp_magnet_degc"), slow))


def test_a_slow_thermometer_serves_the_last_step_as_well() -> None:
    """At 60 degC, read every 50 rows: the last step's last rows have no reading after them."""
    captures = hot_map()
    slow = replace(
        captures,
        captures=tuple(with_slow_magnet_temperature(c, 50) for c in captures.captures),
    )
    kt, usual = (torque_constant(c).number for c in (slow, captures))
    assert kt == pytest.approx(usual, rel=2e-4)


def test_what_is_assumed_of_the_magnets_is_one_error_of_kt_and_ke() -> None:
    """Both at 60 degC and brought to 25 by the same guess: their ratio does not depend on it."""
    captures = hot_map("open_circuit")
    kt = torque_constant(captures)
    psi = OPEN_CIRCUIT.fit(captures, Constants(), OPEN_CIRCUIT.options).estimates[0]
    shares = [
        next(part.u for part in one.budget if part.source == SOURCE) / one.number
        for one in (kt, psi)
    ]
    assert abs(shares[0]) > 30.0 * U_USUAL_1_K
    assert shares[0] == pytest.approx(shares[1], rel=0.02)


def test_inertia_from_a_hot_drive_carries_what_is_assumed_of_the_magnets() -> None:
    """Kt is known at 25 degC; at 60 the torque is 35 K of the coefficient off, and so is J.

    No load torque is logged, which would give J another scale.
    """
    captures = hot_map("drive", "spin_down")
    drive = captures.of("drive")[0]
    unloaded = replace(drive, tables=(drive.tables[0].drop("torque_shaft_nm"),))
    campaign_of_two = Campaign("m", (unloaded, *captures.of("spin_down")))
    kt = Estimate("kt_peak_nm_a", 0.0746, "N·m/A", "measured", "given", type_b("kt", 1e-5))
    found = INERTIA.fit(campaign_of_two, Constants((kt,)), INERTIA.options).estimates[0]
    share = next(part.u for part in found.budget if part.source == SOURCE) / found.number
    assert share == pytest.approx(35.0 * U_USUAL_1_K / (1 - 0.0385), rel=0.05)
