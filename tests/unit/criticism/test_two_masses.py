"""A coupling's torque and twist from the motor's side, against two masses in steps of a µs."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.two_masses import passed_on
from tests.unit.criticism.machines import operating
from tests.unit.criticism.test_torsion import FAR, NEAR, SHARE, TS, J, driving, load, shaft

SOFTNESS = 0.05
"""Of the spring [rad/(N·m)]: a resonance at 240 Hz, under which the torque of a log still moves."""
RUB_S = 2.0 * 0.05 * math.sqrt(NEAR * FAR / J * SOFTNESS)
"""Damping over stiffness of `shaft` without a gap [s]."""


def carrying(torque_nm):
    """A shaft that stands while the motor pulls with a torque [n, N·m]."""
    x = operating(torque_nm.size)
    return replace(x, theta_rad=np.zeros(torque_nm.size), torque_em_nm=torque_nm)


def gain(frequency_hz: float) -> float:
    """What becomes of a sine of torque, as a share of it."""
    t = TS * np.arange(4000)
    wave = np.sin(2 * math.pi * frequency_hz * t)
    inside = slice(200, -200)
    passed = passed_on(carrying(wave), SHARE, 0.0)[inside]
    return float(passed @ wave[inside] / (wave[inside] @ wave[inside]))


@pytest.mark.parametrize("frequency_hz", [20.0, 150.0, 400.0])
def test_a_ringing_passes_as_it_is(frequency_hz: float):
    assert gain(frequency_hz) == pytest.approx(1.0, abs=0.01)


def test_what_rounding_of_the_angle_makes_does_not():
    assert max(abs(gain(frequency_hz)) for frequency_hz in range(2500, 9500, 250)) < 0.05


def load_error(damping_s: float) -> float:
    """Rms error [N·m] of the load that a soft coupling foresees, as means over a millisecond."""
    angle, _ = shaft(0.0, SOFTNESS)
    t = TS * np.arange(angle.size)
    x = replace(operating(t.size), theta_rad=angle, torque_em_nm=driving(t))
    torque = x.machine.scales["torque_nm"]
    values = {"share": SHARE, "twist_rad": SOFTNESS * torque, "between": 0.0, "far_friction": 0.0}
    drag = effects()["compliance"].torque(x, values | {"damping_s": damping_s})
    bend = np.zeros(t.size)
    bend[1:-1] = np.diff(angle, 2) / TS**2
    error = driving(t) - drag - J * bend - load(t)
    means = np.convolve(error, np.full(20, 0.05), mode="valid")[100:-100]
    # a step of the load that nobody can foresee within the kernel is left out
    return float(np.sqrt(np.mean(np.sort(means**2)[: round(0.95 * means.size)])))


def test_a_spring_with_its_damper_foresees_the_load():
    assert load_error(RUB_S) < 2e-3
    assert load_error(0.0) > 5.0 * load_error(RUB_S)
    assert load_error(2.0 * RUB_S) > 5.0 * load_error(RUB_S)
