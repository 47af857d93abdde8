"""Tests with a turning rotor and open terminals: open circuit, hand turn, cogging, spin-down."""

from __future__ import annotations

import math

import numpy as np

from pipeline.simulator import protocols
from pipeline.simulator.design import Recording
from pipeline.simulator.effects import cogging_order
from pipeline.simulator.sensors import Array, Session
from pipeline.simulator.standing import nice_rate


def _terminal_voltages(
    session: Session, theta: Array, omega: Array, degc: float, t_s: Array, timing: str
) -> Array:
    """Open-terminal phase voltages [n, 3]: the derivative of the magnet's flux linkage.

    `centred` is the mean over half a period either side, a difference of flux. A voltage from
    outside the library is added as it is at the instant.
    """
    from pipeline.simulator.field import open_emf, open_flux
    from pipeline.simulator.motion import extra_volts

    p = session.motor.pole_pairs
    magnet = np.full(theta.size, degc)
    if timing == "centred":
        half = 0.5 * (t_s[1] - t_s[0])
        after = open_flux(p * (theta + omega * half), magnet, session.plant)
        before = open_flux(p * (theta - omega * half), magnet, session.plant)
        emf: Array = (after - before) / (2.0 * half)
    else:
        emf = open_emf(p * theta, p * omega, magnet, session.plant)
    if session.plant.extras > 0:
        none = np.zeros(theta.size)
        more = extra_volts((theta, omega), (none, none), (magnet, magnet), session.plant)
        vector = (more[:, 0] + 1j * more[:, 1]) * np.exp(1j * p * theta)
        emf += np.real(vector[:, None] * np.exp(-2j * math.pi * np.arange(3) / 3.0)[None, :])
    return emf


def _voltage_columns(session: Session, v: Array, t_s: Array, phases: bool) -> dict[str, Array]:
    if phases:
        return {f"v{x}_v": session.voltage(v[:, k], t_s) for k, x in enumerate("abc")}
    pairs = (("ab", 0, 1), ("bc", 1, 2), ("ca", 2, 0))
    return {f"v{x}_v": session.voltage(v[:, i] - v[:, j], t_s) for x, i, j in pairs}


def _plateaus(levels: Array, each: int, ramp: int, rate_hz: float) -> tuple[Array, Array]:
    """Angle and speed [n each] of plateaus joined by raised-cosine ramps inside each dwell."""
    omega = np.repeat(levels, each)
    for k in range(1, len(levels)):
        share = 0.5 - 0.5 * np.cos(np.pi * (np.arange(ramp) + 0.5) / ramp)
        rows = slice(k * each, k * each + ramp)
        omega[rows] = levels[k - 1] + (levels[k] - levels[k - 1]) * share
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]))]) / rate_hz
    return theta, omega


def open_circuit(session: Session, how: protocols.OpenCircuit) -> Recording:
    """Back-EMF at several speeds; no current flows, so the voltages are exact.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The speeds and their times.

    """
    motor = session.motor
    levels = np.array(how.levels) * motor.speed_rated_rad_s
    fastest = motor.pole_pairs * float(np.max(np.abs(levels))) / (2.0 * math.pi)
    slowest = motor.pole_pairs * float(np.min(np.abs(levels[levels != 0.0]))) / (2.0 * math.pi)
    rate = how.rate_hz or nice_rate(40.0 * fastest)
    dwell = how.dwell_s or max(8.0 / slowest, 0.08)
    each = max(4, round(dwell * rate))
    theta, omega = _plateaus(levels, each, max(1, each // 12), rate)
    theta = theta + session.rng.uniform(0.0, 2.0 * math.pi)
    t_s, stamps = session.clock(theta.size, rate)
    degc = motor.ambient_degc if how.temp_magnet_degc is None else how.temp_magnet_degc
    v = _terminal_voltages(session, theta, omega, degc, t_s, how.voltage_timing)
    table = {
        "t_s": stamps,
        **_voltage_columns(session, v, t_s, how.phases),
        "theta_mech_rad": session.angle(theta),
        "omega_mech_rad_s": session.speed(omega, rate),
        "temp_magnet_degc": session.temperature(np.full(theta.size, degc)),
    }
    meta = session.meta("open_circuit", voltage_timing=how.voltage_timing)
    return Recording("open_circuit", meta, (table,))


def hand_turn(session: Session, how: protocols.HandTurn) -> Recording:
    """One turn by hand: uneven speed, exactly one turn from rest to rest.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The turn and its sampling.

    """
    n = round(how.duration_s * how.rate_hz)
    t_s, stamps = session.clock(n, how.rate_hz)
    u = np.arange(n) / (n - 1)
    depth = session.rng.uniform(-0.25, 0.25, 3)
    orders = 2.0 * math.pi * np.arange(1, 4)
    shape = 30.0 * u**2 * (1.0 - u) ** 2
    wave = np.sum(depth[:, None] * np.sin(np.outer(orders, u)) / np.arange(1, 4)[:, None], axis=0)
    pace = shape * (1.0 + wave)
    area = np.concatenate([[0.0], np.cumsum(0.5 * (pace[1:] + pace[:-1]))]) / (n - 1)
    turn = how.direction * 2.0 * math.pi
    theta = turn * area / area[-1] + session.rng.uniform(0.0, 2.0 * math.pi)
    omega = turn * pace / area[-1] / (u[1] * (n - 1) * (n - 1) / how.rate_hz)
    degc = session.motor.ambient_degc
    v = _terminal_voltages(session, theta, omega, degc, t_s, "instant")
    table = {"t_s": stamps, **_voltage_columns(session, v, t_s, phases=False)}
    if how.with_angle:
        table["theta_mech_rad"] = session.angle(theta)
    return Recording("hand_turn", session.meta("hand_turn"), (table,))


def cogging(session: Session, how: protocols.Cogging) -> Recording:
    """Slow steady turn at zero current: cogging, weight and friction on the transducer.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The speed and its sampling.

    """
    from pipeline.simulator.motion import turned

    motor = session.motor
    per_turn = how.samples_turn or max(3000, 48 * cogging_order(motor))
    speed = how.speed_rad_s or 2e-3 * motor.speed_rated_rad_s
    rate = per_turn * speed / (2.0 * math.pi)
    n = round(how.turns * per_turn)
    t_s, stamps = session.clock(n, rate)
    omega = np.full(n, how.direction * speed)
    theta = how.theta_rad + omega * t_s
    torque = turned(theta, omega, motor.ambient_degc, session.plant)
    table = {
        "t_s": stamps,
        "theta_mech_rad": session.angle(theta),
        "omega_mech_rad_s": session.speed(omega, rate),
        "torque_shaft_nm": session.torque(torque, t_s),
    }
    name = "cogging_cw" if how.direction > 0 else "cogging_ccw"
    return Recording(name, session.meta("cogging"), (table,))


def coast_time_s(session: Session, omega: float) -> float:
    """About how long the motor coasts from a speed [s].

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    omega
        Mechanical speed [rad/s].

    """
    p = session.plant
    j = session.motor.j_rotor_kgm2
    brake = p.coulomb + p.hysteresis
    slope = p.b_visc + p.eddy + p.windage * omega / p.omega_rated**2
    if slope <= 0.0:
        return float(j * omega / brake) if brake > 0.0 else 10.0
    if brake <= 0.0:
        return float(5.0 * j / slope)
    return float(j / slope * math.log1p(slope * omega / brake))


def spin_down(session: Session, how: protocols.SpinDown) -> Recording:
    """Coast to rest with open terminals: only friction, iron, cogging and inertia.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The speed at the start and the sampling.

    """
    from pipeline.simulator.motion import coast

    motor, plant = session.motor, session.plant
    omega_0 = how.level * motor.speed_rated_rad_s
    rate = how.rate_hz or nice_rate(how.samples / coast_time_s(session, omega_0) / 2.0)
    count = math.ceil(1.3 * coast_time_s(session, omega_0) * rate) + 10
    j_least = min(plant.j_rotor, plant.j_load)
    fastest = (plant.coulomb + plant.stribeck + plant.hysteresis) / (j_least * plant.omega_eps)
    fastest += math.sqrt(plant.stiffness / j_least)
    fastest += float(np.max(plant.cog_order)) * omega_0 if plant.lines > 0 else 0.0
    steps = min(400, max(2, math.ceil(fastest / rate / 0.5)))
    start = session.rng.uniform(0.0, 2.0 * math.pi)
    degc = motor.ambient_degc if how.temp_magnet_degc is None else how.temp_magnet_degc
    friction = session.friction(np.arange(count) / rate)
    true = coast((start, how.direction * omega_0), 1.0 / rate, steps, friction, degc, plant)
    still = np.flatnonzero(how.direction * true[:, 1] < how.end * omega_0)
    n = int(still[0]) if still.size else count
    theta, omega = true[:n, 0], true[:n, 1]
    _, stamps = session.clock(n, rate)
    table = {
        "t_s": stamps,
        "theta_mech_rad": session.angle(theta),
        "omega_mech_rad_s": session.speed(omega, rate),
    }
    return Recording("spin_down", session.meta("spin_down"), (table,))
