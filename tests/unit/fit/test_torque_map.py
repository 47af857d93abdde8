"""The torque map of a warm motor, and the thermometer that tells how warm."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.fit.estimators.torque_map import ESTIMATOR
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design


def hot_map() -> Campaign:
    """One torque map with the magnet at 60 degC, by exact instruments."""
    motor = replace(design("gimbal-5208"), effects={})
    plan = (("hot", "torque_map", {"temp_magnet_degc": 60.0}),)
    return campaign_of(campaign(motor, Bench(instruments=EXACT), 1, plan))


def torque_constant(captures: Campaign, known: Constants | None = None) -> Estimate:
    found = ESTIMATOR.fit(captures, known or Constants(), ESTIMATOR.options).estimates[0]
    assert found.name == "kt_peak_nm_a"
    return found


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
