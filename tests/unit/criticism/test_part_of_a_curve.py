"""A library effect that is only a part of what no effect explains is not named."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import pipeline
from pipeline.criticism.discovery.unknown_structure import is_part_of_a_curve
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import zero
from pipeline.criticism.operating import Array
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.simulator.bench import campaign
from pipeline.simulator.design import EXACT, Bench, Extra
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import fitted, with_drag


def uneven(omega: Array, _: Array) -> Array:
    """A drag [N·m] that rises, falls and rises again with the speed, forwards more than
    backwards.
    """
    u = omega / 70.0
    return 0.06 * u / (1.0 + u**2) + 0.02 * np.exp(-(((omega - 150.0) / 40.0) ** 2))


def shaken(omega: Array, theta: Array) -> Array:
    """The same drag with an unbalance [N·m], which is the smaller part."""
    return uneven(omega, theta) + 0.004 * np.sin(theta + 0.4)


@pytest.mark.parametrize(
    ("drag", "name", "part"),
    [(uneven, "direction_friction", True), (shaken, "unbalance", False)],
)
def test_an_effect_is_part_of_a_curve_where_the_curve_alone_explains_more(drag, name, part) -> None:
    """A friction of one direction takes a part of it; waves of the angle are no curve of speed."""
    fit = fitted([with_drag(drag, seed) for seed in (5, 6)])
    effect = effects()[name]
    model = fit.model.with_effects(effect)
    begun = replace(fit, model=model, values={**zero(effect, model), **fit.values})
    with_effect = gauss_newton(begun)
    assert with_effect.deviance < linear_system(fit).deviance - 100.0
    assert is_part_of_a_curve(with_effect, ["torque_shaft_nm"], name) == part


@pytest.mark.parametrize(
    ("name", "size", "fastest_rad_s", "seed"),
    [
        ("joint-11p", 0.02, 120.0, 1),
        pytest.param("gimbal-5208", 0.04, 40.0, 2, marks=pytest.mark.slow),
    ],
)
def test_a_brake_that_fades_with_speed_is_no_effect_of_the_library(
    name: str, size: float, fastest_rad_s: float, seed: int
) -> None:
    """A drag of eddies was named of the one, 45 floors off; an eccentric disc and a friction of low
    speeds of the other.
    """
    motor, speed = design(name), np.linspace(-400.0, 400.0, 121)
    u = speed / fastest_rad_s
    brake_nm = -size * motor.torque_rated_nm * u / (1.0 + u**2)
    curve = Extra("torque", "omega_mech_rad_s", tuple(speed), tuple(brake_nm))
    motor = replace(motor, effects={}, extras=(curve,))
    plan = (("spin_down", "spin_down", {}),)
    one = campaign_of(campaign(motor, Bench(instruments=EXACT), seed, plan))
    result = pipeline.diagnose(pipeline.Recordings({one.motor_id: one}))[one.motor_id]
    assert (result.verdict, result.missing) == ("unknown", ())
    assert result.unknown is not None
    assert "omega_mech_rad_s" in result.unknown.variables
