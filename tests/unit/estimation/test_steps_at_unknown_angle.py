"""Steps on all three pairs at one angle that nobody knows give both inductances."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.estimation.estimators.current_step import ESTIMATOR
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design


def steps(name: str, theta_deg: float, pairs: tuple[str, ...] = ("ab", "bc", "ca")) -> Campaign:
    """Captures of a rotor that is locked somewhere, without its angle."""
    motor = replace(design(name), effects={})
    plan = [
        (pair, "current_step", {"theta_elec_deg": theta_deg, "pair": pair, "level": 0.3})
        for pair in pairs
    ]
    made = campaign_of(campaign(motor, Bench(), 6, plan))
    unknown = [replace(c, meta=replace(c.meta, theta_elec_deg=None)) for c in made.captures]
    return replace(made, captures=tuple(unknown))


def fitted(captures: Campaign) -> dict[str, Estimate]:
    """Estimates by name."""
    options = ESTIMATOR.options
    return {e.name: e for e in ESTIMATOR.fit(captures, Constants(), options).estimates}


@pytest.mark.parametrize(
    ("name", "theta_deg"),
    [
        ("servo-ipm", 20.0),
        pytest.param("servo-ipm", 77.0, marks=pytest.mark.slow),
        ("gimbal-5208", 110.0),
    ],
)
def test_three_pairs_give_both_axes_wherever_the_rotor_stands(name: str, theta_deg: float) -> None:
    found, motor = fitted(steps(name, theta_deg)), design(name)
    for constant, true in (("ld_h", motor.ld_h), ("lq_h", motor.lq_h)):
        estimate = found[constant]
        assert abs(estimate.value - true) < 2.6 * estimate.u
        assert estimate.u < 0.01 * true
        assert "rotor angle unknown" in estimate.note


def test_two_pairs_do_not() -> None:
    found = fitted(steps("servo-ipm", 20.0, ("ab", "bc")))
    assert {e.status for e in found.values()} == {"not_identifiable"}
