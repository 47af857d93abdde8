"""Drags that remember the shaft's past, and a shaft in two parts, against integration of their
own differential equations.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.hysteresis import reversals, travel
from pipeline.criticism.data.shaft_angle import smooth_angle
from pipeline.criticism.data.traces import PAD
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine import two_masses
from pipeline.criticism.operating import ShaftState
from pipeline.criticism.policy.policy import DEFAULT
from tests.unit.criticism.machines import BASE, operating

LIBRARY = effects()
TS = 5e-5


def shaft(theta: np.ndarray):
    """An operating point that follows an angle [n], at rest in every other respect."""
    n = theta.size
    since, run, runs = travel(theta, 1e-9)
    return replace(
        operating(n),
        id_a=np.zeros(n),
        theta_rad=theta,
        eps_rad=7 * theta,
        omega_rad_s=np.gradient(theta, TS),
        travel_rad=since,
        shaft=ShaftState(run=run.astype(np.int64), runs_rad=runs),
        ts_s=TS,
    )


@pytest.mark.parametrize("damping_nm", [0.0, 0.05])
def test_friction_of_bristles_in_loops_within_loops(damping_nm):
    """σ0 z + σ1 dz/dt of dz/dθ = 1 − z sgn ω/θ_s, by small Euler steps, over strokes of 0.2 to 5
    times θ_s: Dahl's without a damping, LuGre's with one that is as large at full speed.
    """
    t = np.arange(12000) * TS
    theta = 0.02 * np.sin(20 * t) + 0.004 * np.sin(131 * t) + 0.001 * np.sin(640 * t)
    q = {"torque_nm": 0.01, "damping_nm": damping_nm, "travel_rad": 0.004}
    x = shaft(theta)
    assert x.shaft.runs_rad.size > 25
    z, found = 1.0, []
    for step in np.diff(theta):
        for _ in range(10):
            z += (step - abs(step) * z) / 10 / q["travel_rad"]
        found.append(z)
    told = LIBRARY["presliding"].torque(x, q) + q["torque_nm"] * np.sign(x.omega_rad_s)
    bristle, omega = np.array(found), x.omega_rad_s[1:]
    bending = (omega - np.abs(omega) * bristle) / x.machine.scales["speed_rad_s"]
    assert told[1:] == pytest.approx(0.01 * bristle + damping_nm * bending, abs=2e-4)


def test_noise_of_an_encoder_makes_no_reversal():
    rng = np.random.default_rng(2)
    t = np.linspace(0.0, 1.0, 20001)
    theta = np.sin(2 * np.pi * t) + 1e-4 * rng.standard_normal(t.size)
    found = t[reversals(theta, 6e-4)]
    assert found == pytest.approx([0.25, 0.75], abs=0.01)
    assert reversals(theta[:4000], 6e-4).size == 0
    assert reversals(theta, 1e-5).size > 100, "the noise is there"
    assert reversals(np.zeros(9), 0.0).size == 0


def simulated_shaft(share: float, softness: float):
    """Motor and far inertia under a wandering torque and load: angle, torques, coupling [n]."""
    near, far = (1 - share) * BASE["j_kgm2"], share * BASE["j_kgm2"]
    fine = 40
    t = np.arange(8000 * fine) * TS / fine
    torque = 0.3 * np.sin(290 * t) + 0.2 * np.sin(617 * t)
    load = 0.2 * np.sin(160 * t + 1) + 0.1
    damping = 0.2 * np.sqrt(far / softness)
    angle, other, speed, far_speed = 0.0, 0.0, 0.0, 0.0
    kept = np.zeros((t.size, 2))
    for k in range(t.size):
        through = (angle - other) / softness + damping * (speed - far_speed)
        kept[k] = angle, through
        speed += TS / fine * (torque[k] - through) / near
        far_speed += TS / fine * (through - load[k]) / far
        angle += TS / fine * speed
        other += TS / fine * far_speed
    return kept[::fine, 0], torque[::fine], load[::fine], kept[::fine, 1]


@pytest.mark.parametrize("between", [0.0, pytest.param(1.0, marks=pytest.mark.slow)])
def test_a_compliant_shaft_is_two_masses_and_a_spring(between: float):
    """Load, or the coupling's torque, from the motor's angle and torque to a tenth of what a
    rigid shaft misses by.
    """
    share, softness = 0.33, 0.002
    theta, torque, load, through = simulated_shaft(share, softness)
    x = replace(shaft(theta), torque_em_nm=torque, inverter=True)
    twist_rad = softness * x.machine.scales["torque_nm"]
    q = {"share": share, "twist_rad": twist_rad, "damping_s": 0.0, "between": between}
    q |= {"far_friction": 0.0}
    drag = LIBRARY["compliance"].torque(x, q)
    rigid = torque.copy()
    rigid[1:-1] -= BASE["j_kgm2"] * np.diff(theta, 2) / TS**2
    told = through if between else load
    inner = slice(2000, -100)
    missed = (rigid - told)[inner]
    assert np.std((rigid - drag - told)[inner]) < 0.1 * np.std(missed)


def test_a_twist_smoothed_twice_stays_within_the_samples_around_a_window():
    """Where cut windows meet the angle jumps; nothing of that may reach into a window."""
    x = operating(400)
    theta = np.where(np.arange(400) < 200, 0.0, 3.0)
    x = replace(x, theta_rad=theta, torque_em_nm=np.zeros(400), inverter=True)
    drag = two_masses.far_drag(x, 0.3, False, lambda: two_masses.passed_on(x, 0.3, 0.0))
    drag = np.abs(drag[60:-60])
    touched = np.flatnonzero(drag > 1e-6 * drag.max()) + 60
    assert touched.size and touched.min() >= 200 - PAD and touched.max() < 200 + PAD


STEP_RAD = 2 * np.pi / 2**17


def smoothed(true):
    """What is taken for an angle that an encoder of 17 bits rounds, and its noise [rad]."""
    found = {"theta_mech_rad": np.round(true / STEP_RAD) * STEP_RAD}
    noise = {"theta_mech_rad": STEP_RAD / 12**0.5}
    smooth_angle(found, noise, 400, DEFAULT.cutting)
    return found["theta_mech_rad"], noise["theta_mech_rad"]


def test_an_angle_held_even_loses_its_rounding():
    """60 rad/s on 17 bits: the second difference of rounding alone would be 10⁴ rad/s²."""
    true = 60.0 * np.arange(8000) * TS
    found, noise = smoothed(true)
    assert np.std(found - true) < 2.0 * noise < 0.2 * STEP_RAD
    assert np.abs(np.diff(found, 2)).max() < 0.01 * STEP_RAD


@pytest.mark.parametrize("steps", [0.0, 4.0, 40.0])
def test_a_real_ripple_of_the_angle_stays(steps: float):
    """300 Hz, 4 or 40 steps of the encoder high: all but 2 % of it, whatever is smoothed."""
    t = np.arange(8000) * TS
    wave = np.sin(2 * np.pi * 300.0 * t)
    found, _ = smoothed(60.0 * t + steps * STEP_RAD * wave)
    size = 2.0 * np.mean((found - 60.0 * t) * wave) / STEP_RAD
    assert size == pytest.approx(steps, abs=0.02 * steps + 0.02)


def test_a_speed_that_gives_way_for_a_moment_stays():
    """A step of the load slows an even shaft down by 0.1 rad/s within 2 ms of 0.4 s.

    Expected: the angle around it within what the encoder rounds. A parabola as long as a window is
    off there by three times as much, which is little beside the noise of the whole capture.
    """
    t = np.arange(8000) * TS
    slower = -0.1 * np.clip((t - t[4000]) / (40 * TS), 0.0, 1.0)
    true = 60.0 * t + np.cumsum(slower) * TS
    found, _ = smoothed(true)
    near = slice(3900, 4140)
    assert np.std((found - true)[near]) < STEP_RAD / 12**0.5
    assert np.abs(np.diff(found, 2)).max() < 0.1 * STEP_RAD, "and it is smoothed all the same"
