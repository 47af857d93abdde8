"""A dead time that the drive compensates: what is left is near zero current alone."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.pruning import reshaped
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import LIBRARY, log, machine

LOST_V, GIVEN_V, RAMP_A = 0.5, 0.45, 1.5
MOTOR = replace(design("gimbal-5208"), effects={})
SMALL = (-0.6, -0.2, -0.1, -0.05, -0.02, 0.02, 0.05, 0.1, 0.2, 0.6)
PLAN = (
    *(step for step in CAMPAIGN if step[0] in ("resistance_ab", "spin_down_cw")),
    ("drive_0", "drive", {"load": 0.0}),
    ("drive_1", "drive", {"load": 0.0}),
    (
        "torque_map",
        "torque_map",
        {"speed": 0.1, "id_levels": (0.0, -0.1), "iq_levels": SMALL, "dwell_s": 0.15},
    ),
)


def compensated(width_a: float = 1e-6, ramp_a: float = RAMP_A) -> Segment:
    """A log of a drive that gives back, in proportion to small currents, what dead time takes."""
    plain = log(noise=1.0)
    recorded = plain.recorded
    current = recorded["id_a"] + 1j * recorded["iq_a"]
    left = np.zeros(current.size, dtype=complex)
    for k in range(3):
        axis = np.exp(1j * (7 * recorded["theta_mech_rad"] - k * 2.0 * np.pi / 3.0))
        phase = (current * axis).real
        lost = LOST_V * np.tanh(phase / width_a) - GIVEN_V * np.clip(phase / ramp_a, -1.0, 1.0)
        left += 2.0 / 3.0 * lost / axis
    volts = {"vd_v": recorded["vd_v"] + left.real, "vq_v": recorded["vq_v"] + left.imag}
    return replace(plain, recorded={**recorded, **volts})


def fitted(*left_out: int, log: Segment | None = None) -> LinearSystem:
    """A log by a dead time, with the terms that are not left out."""
    effect = replace(LIBRARY["dead_time"], left_out=left_out)
    return fit_of([log or compensated()], Model(machine(), (effect,))).system


@pytest.mark.slow
def test_a_compensation_is_told_from_the_dead_time_that_it_gives_back() -> None:
    """It ramps in a straight line, which a tanh is not: what is given is off by a third."""
    system, plain = fitted(1), fitted(1, 2)
    values = system.fit.values
    assert values["dead_time.loss_v"] == pytest.approx(LOST_V - GIVEN_V, abs=0.02)
    assert values["dead_time.given_v"] == pytest.approx(GIVEN_V, rel=0.5)
    assert values["dead_time.ramp_a"] == pytest.approx(RAMP_A / 1.4, rel=0.2)
    after, before = (float(one.reduced_chi2(one.residual).max()) for one in (system, plain))
    assert after < 0.1 * before


def test_a_compensation_is_found_over_a_wider_current_than_it_was_first_tried_at() -> None:
    """At the width of the dead time itself, where it is tried first, it is the same thing."""
    ramp = next(p for p in LIBRARY["dead_time"].parameters if p.name == "ramp_a")
    first_a, later_a = (share * machine().scale(ramp) for share in ramp.scan)
    plain = fitted(1, 2, log=compensated(width_a=first_a, ramp_a=later_a))
    system = reshaped(plain)
    assert system.fit.effect("dead_time").left_out == (1,)
    assert system.fit.values["dead_time.ramp_a"] > 2.0 * system.fit.values["dead_time.width_a"]
    after, before = (float(one.reduced_chi2(one.residual).max()) for one in (system, plain))
    assert after < 0.1 * before


@pytest.mark.slow
def test_a_term_that_is_not_worth_its_parameters_does_not_come_back() -> None:
    """Of a dead time of its own form, with a little of another effect left over."""
    plain = log(noise=1.0)
    again = log(noise=1.0, seed=6)
    bent = 0.05 * again.recorded["iq_a"] * np.abs(again.recorded["iq_a"])
    volts = {"vq_v": again.recorded["vq_v"] + bent}
    segments = [plain, replace(again, capture="again", recorded={**again.recorded, **volts})]
    effect = replace(LIBRARY["dead_time"], left_out=(1, 2))
    system = fit_of(segments, Model(machine(), (effect,))).system
    assert significant_groups(system).any()
    assert reshaped(system).fit.effect("dead_time").left_out == (1, 2)


@pytest.mark.slow
def test_what_a_compensation_leaves_is_a_dead_time() -> None:
    """By the simulator, which ramps in a straight line: it was `unknown` without a name, 48 floors
    off.
    """
    rated = MOTOR.current_rated_a
    lost_v, given = 0.02 * MOTOR.vdc_v, 0.95
    dead = {"size": lost_v, "knee_a": 0.01 * rated, "compensated": given, "ramp_a": 0.1 * rated}
    motor = MOTOR.having(dead_time=dead)
    found = diagnose(campaign_of(campaign(motor, Bench(), 4, PLAN)), ModelSpec(), Constants())
    assert (found.verdict, found.missing) == ("missing", ("dead_time",))
    before, after = (step.held_out for step in found.ladder)
    assert after < 0.1 * before
    loss_v = found.ladder[-1].parameters["dead_time.loss_v"].value
    assert loss_v == pytest.approx((1.0 - given) * lost_v, abs=0.1 * lost_v)
