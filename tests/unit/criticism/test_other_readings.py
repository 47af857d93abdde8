"""Where a transducer of torque sits is told by the captures: no metadata state it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.selection.other_readings import TORQUE, by_best_readings
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import fitted, log

DRIVEN = ("torque_map_slow", "drive_0")
TESTS = ("resistance_ab", *DRIVEN, "spin_down_forward")
PLACES = {
    "in the shaft": Bench(dyno_hz=12.0, encoder_bits=14),
    "at the stator": Bench(dyno_hz=12.0, encoder_bits=14, torque_at_stator=True),
}


@pytest.mark.parametrize(
    "place", [pytest.param("in the shaft", marks=pytest.mark.slow), "at the stator"]
)
@pytest.mark.parametrize(
    ("hidden", "tests"),
    [
        ((), DRIVEN),
        pytest.param((), TESTS, marks=pytest.mark.slow),
        pytest.param(("stribeck",), TESTS, marks=pytest.mark.slow),
    ],
)
def test_the_place_of_a_transducer_is_told_and_is_no_effect(place, hidden, tests):
    """Expected: the same name and the floor at either place, and a note at the stator alone."""
    motor = replace(design("gimbal-5208"), effects={}).having(**dict.fromkeys(hidden))
    plan = tuple(step for step in CAMPAIGN if step[0] in tests)
    recorded = campaign_of(campaign(motor, PLACES[place], 5, plan))
    result = diagnose(recorded, ModelSpec(), Constants())
    assert result.missing == hidden
    assert result.ladder[-1].held_out < 1.0
    notes = [note for note in result.notes if "read at the stator" in note]
    told = ["torque_shaft_nm of 2 captures"] if place == "at the stator" else []
    assert [note[: len(told[0])] for note in notes] == told


def test_what_neither_place_explains_does_not_hide_the_place():
    """An unbalance of more torque than friction and inertia: J at its bound, and `unknown`."""
    motor = replace(design("servo-ipm"), effects={})
    heavy = motor.having(unbalance=2.0 * motor.torque_coulomb_nm)
    plan = tuple(step for step in CAMPAIGN if step[0] in TESTS)
    recorded = campaign_of(campaign(heavy, PLACES["at the stator"], 5, plan))
    result = diagnose(recorded, ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("missing", ("unbalance",))
    assert result.constants["j_rotor_kgm2"].value == pytest.approx(motor.j_rotor_kgm2, rel=0.1)
    assert any("read at the stator" in note for note in result.notes)


@pytest.mark.slow
def test_an_encoder_off_its_centre_is_not_taken_for_torque_read_at_the_stator():
    """J θ″ of 0.1 mrad of run-out misses by more than a torque without any inertia does."""
    light = design("servo-ipm")
    heavy = replace(light, effects={}, j_rotor_kgm2=8.0 * light.j_rotor_kgm2)
    tests = (*TESTS, "torque_map_fast", "open_circuit_forward")
    plan = tuple(step for step in CAMPAIGN if step[0] in tests)
    bench = Bench(encoder_bits=16)
    recorded = campaign_of(campaign(heavy.having(angle_eccentricity=1e-4), bench, 5, plan))
    result = diagnose(recorded, ModelSpec(), Constants())
    assert result.missing == ("angle_eccentricity",)
    assert not [note for note in result.notes if "read at the stator" in note]


@pytest.mark.parametrize(("left", "moves"), [(0.9, False), (0.1, True)])
def test_a_place_that_leaves_most_of_the_torque_open_is_not_taken(monkeypatch, left, moves):
    """An effect that neither place explains, such as backlash, speaks a little for the stator."""
    system = linear_system(fitted((log(noise=1.0), log(noise=1.0, seed=6))))
    torque = np.array([channel == TORQUE for _, channel, _ in system.labels])[system.group]

    def missing(times):
        return replace(system, residual=np.where(torque, times, 1.0) * system.residual)

    elsewhere = missing(40.0 * left**0.5)
    monkeypatch.setattr(f"{by_best_readings.__module__}.gauss_newton", lambda *_, **__: elsewhere)
    here = missing(40.0)
    assert elsewhere.deviance < here.deviance - here.policy.selection.tie
    assert (by_best_readings(here) is elsewhere) == moves


@pytest.mark.parametrize(("spoilt", "moves"), [(1.0, True), (60.0, False)])
def test_a_place_that_spoils_other_captures_is_not_taken(monkeypatch, spoilt, moves):
    """The deviance is logarithmic: a wave of one capture counts as much as a drive that is lost."""
    system = linear_system(fitted((log(noise=1.0), log(noise=1.0, seed=6))))
    torque = np.array([channel == TORQUE for _, channel, _ in system.labels])[system.group]
    first = torque & (system.segment == 0)

    def missing(one, other, volts):
        times = np.where(first, one, np.where(torque, other, volts))
        return replace(system, residual=times * system.residual)

    here, elsewhere = missing(40.0, 1.0, 6.0), missing(0.1, spoilt, 1.0)
    monkeypatch.setattr(f"{by_best_readings.__module__}.gauss_newton", lambda *_, **__: elsewhere)
    assert elsewhere.deviance < here.deviance - here.policy.selection.tie
    assert (by_best_readings(here) is elsewhere) == moves


@pytest.mark.parametrize("rippling", [True, False])
def test_straight_lines_between_rows_are_tried_where_rows_show_waves(monkeypatch, rippling):
    """And taken, as here, where they explain more."""
    system, tried = linear_system(fitted((log(noise=1.0), log(noise=1.0, seed=6)))), []

    def better(fit, **_):
        tried.append([segment.instrument.waves for segment in fit.segments])
        return replace(system, residual=0.1 * system.residual)

    monkeypatch.setattr(f"{by_best_readings.__module__}.gauss_newton", better)
    monkeypatch.setattr(f"{by_best_readings.__module__}.ripples", lambda _: rippling)
    assert (by_best_readings(system) is not system) == rippling
    assert tried[:1] == ([[False, False]] if rippling else [])


def test_readings_compete_with_effects_together(monkeypatch):
    """Half a PWM period of delay beats the frame alone, and not the frame with straight lines."""
    system = linear_system(fitted((log(noise=1.0), log(noise=1.0, seed=6))))
    usual, turned, both = (
        replace(system, residual=times * system.residual) for times in (40.0, 20.0, 10.0)
    )
    others = {id(usual): (turned,), id(turned): (usual, both), id(both): (usual, turned)}
    monkeypatch.setattr(f"{by_best_readings.__module__}._refits", lambda one: others[id(one)])
    assert by_best_readings(usual) is both
    assert by_best_readings(both) is both
