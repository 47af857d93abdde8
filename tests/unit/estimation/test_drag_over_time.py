"""Friction that changes with time within captures is not published with a small uncertainty."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.mechanical.drag_forms import DRAG_FORMS
from pipeline.estimation.mechanical.drag_over_time import DragOverTime, drag_over_time
from pipeline.estimation.mechanical.shaft_rows import shaft_rows
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.design import Bench, Extra, Motor
from pipeline.simulator.truth import truth
from tests.simulated import campaign_of, design

COASTS = ("open_circuit_forward", "spin_down_forward", "spin_down_backward")
DRIVES = (*COASTS, "drive_0")
Course = tuple[tuple[float, float], ...]
STEADY: Course = ((0.0, 1.0),)


def relaxing(first: float, tau_s: float, last: float = 1.0) -> Course:
    """Share of friction over time, from `first` to `last`."""
    t_s = np.linspace(0.0, 8.0 * tau_s, 200)
    return tuple(
        zip(t_s.tolist(), (last + (first - last) * np.exp(-t_s / tau_s)).tolist(), strict=True)
    )


def recorded(motor: Motor, stems: tuple[str, ...], course: Course = STEADY) -> Campaign:
    moving = {"friction_over_time": course}
    plan = tuple(
        (stem, test, {**how, **(moving if test in ("spin_down", "drive") else {})})
        for stem, test, how in CAMPAIGN
        if stem in stems
    )
    return campaign_of(campaign(motor, Bench(), 3, plan))


def plain(name: str) -> Motor:
    return replace(design(name), effects={})


def of_coasts(found: Campaign) -> DragOverTime | None:
    rows = shaft_rows(found.of("spin_down"), DRAG_FORMS)
    assert rows is not None
    law = np.column_stack([-rows.sense, -rows.speed_rad_s])
    windage = np.column_stack([law, -rows.columns["windage"]])
    return drag_over_time(rows, law, np.empty((rows.count, 0)), (windage,), 1e-3)


def true_constants(motor: Motor) -> Mapping[str, float]:
    true = dict(truth(motor)["constants"])
    true["coast_coulomb_rad_s2"] = true["torque_coulomb_nm"] / true["j_rotor_kgm2"]
    true["coast_viscous_1_s"] = true["b_visc_nm_s_rad"] / true["j_rotor_kgm2"]
    return true


@pytest.mark.parametrize(
    ("course", "stems"),
    [
        (relaxing(1.8, 0.4), COASTS),
        pytest.param(relaxing(1.3, 1.0), COASTS, marks=pytest.mark.slow),
        (relaxing(1.8, 30.0), COASTS),
        pytest.param(relaxing(1.0, 0.5, last=1.3), COASTS, marks=pytest.mark.slow),
        pytest.param(
            ((0.0, 1.0), (0.6, 1.0), (0.601, 1.3), (9.0, 1.3)), COASTS, marks=pytest.mark.slow
        ),
        (relaxing(1.8, 3.0), DRIVES),
        pytest.param(relaxing(1.8, 30.0), DRIVES, marks=pytest.mark.slow),
    ],
)
def test_friction_of_captures_in_which_it_changes_is_not_published_as_sure(course, stems):
    """T_c was 80 % too large with z of 100 and more, B twice what it is."""
    motor = plain("gimbal-5208")
    true = true_constants(motor)
    names = ("torque_coulomb_nm", "b_visc_nm_s_rad", "coast_coulomb_rad_s2", "coast_viscous_1_s")
    known, _, _ = fit_all(recorded(motor, stems, course), {}, only=frozenset(names))
    estimates = [one for name in names for one in known.all_of(name)]
    told = False
    for one in estimates:
        told |= "changes with time" in one.note
        if one.known and one.method in ("inertia", "spin_down"):
            end = course[-1][1] * true[one.name]
            off = min(abs(one.number - true[one.name]), abs(one.number - end))
            assert off < 3.0 * one.u, one
    assert told


def test_the_time_constant_and_both_changes_are_found() -> None:
    """1 + 0.8 exp(−t/1 s) of both, at the first window and when the coasts end."""
    found = of_coasts(recorded(plain("servo-15kw"), COASTS, relaxing(1.8, 1.0)))
    assert found is not None
    assert found.time_s == pytest.approx(1.0, rel=0.03)
    shares = [1.0 + 0.8 * np.exp(-t) for t in found.span_s]
    assert found.first / found.last == pytest.approx([shares[0] / shares[1]] * 2, rel=0.03)
    assert not found.is_open(0)


def test_what_is_still_to_come_leaves_friction_open() -> None:
    found = of_coasts(recorded(plain("servo-15kw"), COASTS, relaxing(1.8, 30.0)))
    assert found is not None
    assert found.is_open(0)
    assert "still to come" in found.words


@pytest.mark.parametrize(
    "effects",
    ["", "windage", "stribeck", "iron_eddy", "iron_hysteresis", "windage stribeck iron_eddy"],
)
def test_friction_of_any_form_over_speed_does_not_change_with_time(effects):
    motor = plain("gimbal-5208")
    motor = with_effects(motor, effects.replace(" ", ",")) if effects else motor
    assert of_coasts(recorded(motor, COASTS)) is None


def test_a_drag_of_its_own_in_each_sense_does_not_change_with_time() -> None:
    motor = plain("gimbal-5208")
    top, more = 2.0 * motor.speed_rated_rad_s, 0.2 * motor.torque_coulomb_nm
    forward = Extra("torque", "omega_mech_rad_s", (-top, 0.0, 0.01, top), (0.0, 0.0, -more, -more))
    assert of_coasts(recorded(replace(motor, extras=(forward,)), COASTS)) is None


def test_one_coast_does_not_tell_time_from_speed() -> None:
    found = recorded(plain("gimbal-5208"), COASTS[:2], relaxing(1.8, 0.4))
    assert of_coasts(found) is None
