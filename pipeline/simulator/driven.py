"""Tests on the converter: torque map on a dynamometer, everyday drive log."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from pipeline.simulator import protocols
from pipeline.simulator.design import Recording
from pipeline.simulator.sensors import Array, Session, grid, late, to_grid

if TYPE_CHECKING:
    from pipeline.simulator.control import Control

TIMINGS = ("centred", "held", "instant")


def usable_speed_rad_s(session: Session) -> float:
    """Rated speed, or where rated q current takes 90 % of the voltage, whichever is lower.

    Parameters
    ----------
    session
        With the motor and its link.

    Returns
    -------
    float
        Shaft speed [rad/s].

    Raises
    ------
    ValueError
        The link cannot drive rated current at standstill.

    Notes
    -----
    (R I + ω_e ψ)² + (ω_e L_q I)² = (0.9 V_dc/√3)², solved for ω_e.

    """
    m = session.motor
    limit = 0.9 * m.vdc_v / math.sqrt(3.0)
    i, flux = m.current_rated_a, math.hypot(m.psi_pm_wb, m.lq_h * m.current_rated_a)
    a, b = flux * flux, m.r_phase_ohm * i * m.psi_pm_wb
    c = (m.r_phase_ohm * i) ** 2 - limit * limit
    if c >= 0.0:
        raise ValueError(f"{m.motor_type}: the link cannot drive rated current at standstill")
    free = (-b + math.sqrt(b * b - a * c)) / a
    return min(m.speed_rated_rad_s, free / m.pole_pairs)


def substeps(session: Session, period_s: float, omega: float) -> int:
    """Even number of integration steps a period that resolves the fastest thing in the motor.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    period_s
        Control period [s].
    omega
        Mechanical speed [rad/s].

    """
    p = session.plant
    j_least = min(p.j_rotor, p.j_load)
    electrical = 2.0 * (p.r_a_ohm + p.dead_v / p.dead_knee_a) / min(p.ld_h, p.lq_h)
    friction = (p.coulomb + p.stribeck + p.hysteresis) / (j_least * p.omega_eps)
    spring = math.sqrt(p.stiffness / j_least)
    harmonics = 13.0 if p.h5 != 0.0 or p.nu_q != 0.0 else 1.0
    turning = 3.0 * harmonics * p.pole_pairs * omega
    if p.lines > 0:
        turning = max(turning, float(np.max(p.cog_order)) * omega)
    fastest: float = max(electrical, friction, spring, turning)
    return 2 * min(64, max(1, math.ceil(fastest * period_s / 1.0)))


def control(
    session: Session,
    period_s: float,
    timing: str,
    omega: float,
    warm: tuple[float, float],
    **change: float | bool,
) -> Control:
    """Controller tuned on the motor's nameplate, with the sensors that sit in its loop.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    period_s
        Control period [s].
    timing
        When the drive samples and switches.
    omega
        Mechanical speed [rad/s].
    warm
        Temperatures of winding and magnets [degC].
    **change
        Fields of `Control` that differ from those of the nameplate.

    """
    from pipeline.simulator.control import Control

    m = session.motor
    steps = substeps(session, period_s, max(abs(omega), m.speed_rated_rad_s))
    width = 2.0 * math.pi / (25.0 * period_s)
    values: dict[str, float | int | bool] = {
        "pole_pairs": float(m.pole_pairs),
        "period_s": period_s,
        "substeps": steps,
        "substeps_before": steps // 2 if timing == "centred" else 0,
        "v_limit": m.vdc_v / math.sqrt(3.0),
        "l_d": m.ld_h,
        "l_q": m.lq_h,
        "psi": m.psi_pm_wb,
        "kp_d": width * m.ld_h,
        "kp_q": width * m.lq_h,
        "ki": width * m.r_phase_ohm,
        "speed_loop": False,
        "i_limit": 1.2 * m.current_rated_a,
        "held_speed": True,
        **dict.fromkeys(("kp_speed", "ki_speed", "dyno_nms", "dyno_nm"), 0.0),
        "in_coupling": session.bench.torque_in_coupling,
        "at_stator": session.bench.torque_at_stator,
        "ambient": m.ambient_degc,
        "temp_winding": warm[0],
        "temp_magnet": warm[1],
        "theta": float(session.rng.uniform(0.0, 2.0 * math.pi)),
        "omega": omega,
        **_in_the_loop(session),
    }
    values.update(change)
    return Control(**values)  # type: ignore[arg-type]


def _in_the_loop(session: Session) -> dict[str, float]:
    """Current sensors and encoder as the controller reads them, with their faults."""
    values = {
        "lsb_current": session.current_step_a,
        "delay_s": session.fault("current_delay"),
        "angle_offset": session.fault("angle_offset") / session.motor.pole_pairs,
        "angle_wobble": session.fault("angle_eccentricity"),
        "angle_wobble_phase": session.fault("angle_eccentricity", "phase_rad"),
        "angle_wobble_order": session.fault("angle_eccentricity", "order"),
        "angle_play": session.bench.encoder_play_rad,
        "angle_late_s": session.bench.late_angle_s,
        "lsb_angle": 2.0 * math.pi / 2.0**session.bench.encoder_bits,
        "speed_lag_s": session.bench.speed_lag_s,
    }
    for k, phase in enumerate("abc"):
        values[f"gain_{phase}"] = session.phase_gain(k)
        values[f"offset_{phase}"] = session.phase_offset_a(k)
    return values


def loop_noise(session: Session, n: int, period_s: float) -> Array:
    """Noise [n, 4] of three phase-current sensors [A] and of the encoder [rad].

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    n
        Number of periods of the capture.
    period_s
        Control period [s].

    """
    t_s: Array = np.arange(n, dtype=np.float64) * period_s
    errors = np.zeros((n, 4))
    for k in range(3):
        errors[:, k] = session.noise(n, session.current_sigma_a, t_s)
    if session.bench.encoder_noise_rad > 0.0:
        errors[:, 3] = session.noise(n, session.bench.encoder_noise_rad)
    return errors


def log(session: Session, rows: Array, period_s: float) -> dict[str, Array]:
    """Columns of a drive's own log from the rows of `converter.drive`.

    The voltage of a row is the vector that the inverter holds over the row's period, in the rotor
    frame at the sampling instant.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    rows
        Rows of `converter.drive` [n, columns].
    period_s
        Control period [s].

    """
    m = session.motor
    n = rows.shape[0]
    t_s, stamps = session.clock(n, 1.0 / period_s)
    theta, omega = rows[:, 9], rows[:, 10]
    turn = np.exp(-1j * m.pole_pairs * rows[:, 4])
    i_dq = (rows[:, 0] + 1j * rows[:, 1]) * turn
    gain = session.instruments.voltage_commanded * (1.0 + session.fault("voltage_scale"))
    v_dq = gain * (rows[:, 2] + 1j * rows[:, 3]) * turn
    delay = session.fault("sample_delay")
    if delay != 0.0:
        ends = theta[[0, -1]] + np.array([-1.0, 1.0]) * period_s * omega[[0, -1]]
        times = np.concatenate([[-period_s], t_s, [t_s[-1] + period_s]])
        path = np.concatenate([ends[:1], theta, ends[1:]])
        v_dq = v_dq * np.exp(1j * m.pole_pairs * (np.interp(t_s + delay, times, path) - theta))
    step_a, step_v = session.current_step_a / 2.0, session.voltage_step_v
    return {
        "t_s": stamps,
        "id_a": to_grid(late(i_dq.real, t_s, session.bench.late_current_s), step_a),
        "iq_a": to_grid(late(i_dq.imag, t_s, session.bench.late_current_s), step_a),
        "vd_v": to_grid(v_dq.real, step_v),
        "vq_v": to_grid(v_dq.imag, step_v),
        "theta_mech_rad": rows[:, 4],
        "omega_mech_rad_s": to_grid(rows[:, 5], grid(m.speed_rated_rad_s, 17)),
        "torque_shaft_nm": session.torque(rows[:, 6], t_s),
        "temp_winding_degc": session.winding(rows[:, 7], rows[:, 8]),
        "temp_magnet_degc": session.temperature(rows[:, 8]),
    }


def _warm(session: Session, winding: float | None, magnet: float | None) -> tuple[float, float]:
    ambient = session.motor.ambient_degc
    return ambient if winding is None else winding, ambient if magnet is None else magnet


def _meta(session: Session, test: str, timing: str, pwm_hz: float) -> Mapping[str, str]:
    if timing not in TIMINGS:
        raise ValueError(f"voltage_timing is {', '.join(TIMINGS)}, not {timing}")
    return session.meta(test, voltage_kind="commanded", voltage_timing=timing, pwm_hz=f"{pwm_hz:g}")


def torque_map(session: Session, how: protocols.TorqueMap) -> Recording:
    """Steps of d and q current while a dynamometer holds the speed.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The levels and their times.

    """
    from pipeline.simulator.converter import drive

    m = session.motor
    pwm_hz = how.pwm_hz or session.bench.pwm_hz
    omega = how.speed * usable_speed_rad_s(session)
    cycle = 2.0 * math.pi / (m.pole_pairs * abs(omega)) if omega != 0.0 else 0.02
    dwell = how.dwell_s or max(0.02, 1.5 * cycle, 8.0 * m.tau_elec_s)
    each = max(4, round(dwell * pwm_hz))
    i_d, i_q = (
        np.repeat(level.ravel(), each) * m.current_rated_a
        for level in np.meshgrid(how.id_levels, how.iq_levels, indexing="ij")
    )
    reference = np.stack([i_d, i_q, np.zeros(i_d.size), np.full(i_d.size, omega)], axis=1)
    warm = _warm(session, how.temp_winding_degc, how.temp_magnet_degc)
    width = 2.0 * math.pi * session.bench.dyno_hz
    stiff = width * m.j_rotor_kgm2
    dyno = {"dyno_nms": stiff, "dyno_nm": 0.25 * width * stiff}
    loop = control(session, 1.0 / pwm_hz, how.voltage_timing, omega, warm, **dyno)
    noise = loop_noise(session, i_d.size, 1.0 / pwm_hz)
    friction = session.friction(np.arange(i_d.size) / pwm_hz)
    then = session.then(i_d.size)
    rows = drive(reference, friction, noise, loop, session.plant, *then)
    meta = _meta(session, "torque_map", how.voltage_timing, pwm_hz)
    return Recording("torque_map", meta, (log(session, rows, 1.0 / pwm_hz),))


def _drive_reference(session: Session, how: protocols.Drive, segment: int, dt: float) -> Array:
    """References [n, 4] of a drive log: each segment new speed, load and d current.

    Speeds alternate in sign at every other segment, so that reversals are certain.
    """
    m, rng = session.motor, session.rng
    top = how.speed * usable_speed_rad_s(session)
    sense = np.where(np.arange(how.segments) // 2 % 2 == 0, 1.0, -1.0)
    speeds = sense * top * rng.uniform(0.1, 1.0, how.segments)
    loads = how.load * m.torque_rated_nm * rng.uniform(-1.0, 1.0, how.segments)
    flux = how.id_level * m.current_rated_a * rng.uniform(-1.0, 0.5, how.segments)
    n = how.segments * segment
    late = segment // 2
    speed = np.repeat(speeds, segment)
    pace = 0.4 * m.torque_rated_nm / m.j_rotor_kgm2 * dt
    slewed = np.empty(n)
    now = 0.0
    for k in range(n):
        now += min(max(speed[k] - now, -pace), pace)
        slewed[k] = now
    load = np.concatenate([np.zeros(late), np.repeat(loads, segment)])[:n]
    return np.stack([np.repeat(flux, segment), slewed, load, np.zeros(n)], axis=1)


def drive(session: Session, how: protocols.Drive) -> Recording:
    """Speed control with reversals, load steps and d-current steps, from rest.

    Parameters
    ----------
    session
        Motor, bench and the state of both in this capture.
    how
        The programme of speeds and loads.

    """
    from pipeline.simulator import converter

    m = session.motor
    pwm_hz = how.pwm_hz or session.bench.pwm_hz
    run_up = m.j_rotor_kgm2 * usable_speed_rad_s(session) / m.torque_rated_nm
    segment_s = how.segment_s or max(0.1, 4.0 * run_up)
    reference = _drive_reference(session, how, round(segment_s * pwm_hz), 1.0 / pwm_hz)
    width = 2.0 * math.pi * 12.0
    kp = width * m.j_rotor_kgm2 / (1.5 * m.pole_pairs * max(m.psi_pm_wb, 1e-9))
    loop = control(
        session,
        1.0 / pwm_hz,
        how.voltage_timing,
        0.0,
        _warm(session, how.temp_winding_degc, how.temp_magnet_degc),
        held_speed=False,
        speed_loop=True,
        kp_speed=kp,
        ki_speed=0.25 * width * kp,
    )
    noise = loop_noise(session, reference.shape[0], 1.0 / pwm_hz)
    friction = session.friction(np.arange(len(reference)) / pwm_hz)
    then = session.then(len(reference))
    rows = converter.drive(reference, friction, noise, loop, session.plant, *then)
    meta = _meta(session, "drive", how.voltage_timing, pwm_hz)
    return Recording("drive", meta, (log(session, rows, 1.0 / pwm_hz),))
