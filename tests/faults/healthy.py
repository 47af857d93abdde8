"""Healthy captures of a made-up motor, of any size: what the faults are injected into.

Written from the textbook equations here, without the project's models or simulator. `size`
scales torque and inertia as a larger or smaller motor of one family would.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from pipeline.records.capture import Capture, CaptureMeta

ENCODER_RAD = 2.0 * np.pi / 2**17


@dataclass(frozen=True)
class Motor:
    """A salient wye motor: phase values, SI."""

    r_ohm: float = 0.3
    ld_h: float = 2.0e-4
    lq_h: float = 3.0e-4
    psi_wb: float = 0.009
    pole_pairs: int = 7
    slots: int = 12
    rated_a: float = 16.0
    top_rad_s: float = 240.0
    j_kgm2: float = 4e-5

    def scaled(self, size: float) -> Motor:
        """The same motor `size` times larger: more flux and current, less resistance, slower."""
        return replace(
            self,
            r_ohm=self.r_ohm / size,
            ld_h=self.ld_h / size,
            lq_h=self.lq_h / size,
            psi_wb=self.psi_wb * size,
            rated_a=self.rated_a * size,
            top_rad_s=self.top_rad_s / size,
            j_kgm2=self.j_kgm2 * size**3,
        )


def _noisy(rng: np.random.Generator, values: np.ndarray, full_scale: float) -> np.ndarray:
    """A 16-bit converter with white noise of a few codes."""
    code = 2.0 * full_scale / 2**16
    noisy = values + rng.normal(0.0, 3.0 * code, values.shape)
    return np.round(noisy / code) * code


def capture_of(test: str, columns: dict[str, np.ndarray], motor: Motor, **meta: object) -> Capture:
    """One table, one capture, with a complete nameplate."""
    plate = CaptureMeta(
        motor_id="made-up-1",
        test=test,
        motor_type="made-up",
        station="bench",
        winding="wye",
        pole_pairs=motor.pole_pairs,
        slots=motor.slots,
        u_rel_current=0.002,
        u_rel_voltage=0.001,
        u_rel_torque=0.002,
        u_temp_degc=0.5,
    )
    table = pl.DataFrame({name: np.asarray(values, float) for name, values in columns.items()})
    return Capture(f"{test}.csv", "0" * 64, "verified", replace(plate, **meta), (table,))


def resistance(motor: Motor, rng: np.random.Generator) -> Capture:
    t = np.arange(3000) * 1e-3
    levels = 0.2 * motor.rated_a * np.array([-1.0, -0.5, 0.5, 1.0])
    current = np.repeat(levels, 750)
    voltage = 2.0 * motor.r_ohm * current
    full = 0.4 * motor.rated_a
    return capture_of(
        "resistance",
        {
            "t_s": t,
            "vab_v": _noisy(rng, voltage, 2.0 * motor.r_ohm * full),
            "ia_a": _noisy(rng, current, full),
            "temp_winding_degc": 25.0 + rng.normal(0.0, 0.05, t.size),
        },
        motor,
        pair="ab",
    )


def current_step(motor: Motor, rng: np.random.Generator) -> Capture:
    resistance_ohm, inductance_h = 2.0 * motor.r_ohm, 2.0 * motor.ld_h
    tau = inductance_h / resistance_ohm
    t = np.arange(3000) * tau / 150.0
    on = t >= t[300]
    voltage = np.where(on, resistance_ohm * motor.rated_a, 0.0)
    current = np.where(on, motor.rated_a * -np.expm1(-(t - t[300]) / tau), 0.0)
    return capture_of(
        "current_step",
        {
            "t_s": t,
            "vab_v": _noisy(rng, voltage, 2.0 * resistance_ohm * motor.rated_a),
            "ia_a": _noisy(rng, current, 2.0 * motor.rated_a),
        },
        motor,
        pair="ab",
        theta_elec_deg=330.0,
    )


def lcr(motor: Motor, rng: np.random.Generator) -> Capture:
    angle = np.arange(0.0, 360.0, 15.0)
    swing = (motor.ld_h - motor.lq_h) * np.cos(np.radians(2.0 * angle + 60.0))
    inductance = motor.ld_h + motor.lq_h + swing
    scatter = 1.0 + 1e-3 * rng.standard_normal(angle.size)
    return capture_of("lcr", {"theta_elec_deg": angle, "lab_h": inductance * scatter}, motor)


def _line_voltages(motor: Motor, theta: np.ndarray, omega: np.ndarray) -> list[np.ndarray]:
    """Back-EMF line to line of v_a = -p omega psi sin(p theta), b and c a third of a turn later."""
    peak = motor.pole_pairs * omega * motor.psi_wb
    phases = [-peak * np.sin(motor.pole_pairs * theta - k * 2.0 * np.pi / 3.0) for k in range(3)]
    return [phases[0] - phases[1], phases[1] - phases[2], phases[2] - phases[0]]


def open_circuit(motor: Motor, rng: np.random.Generator, sense: float = 1.0) -> Capture:
    dt = 2.0 * np.pi / (motor.pole_pairs * motor.top_rad_s * 40.0)
    t = np.arange(24000) * dt
    omega = sense * motor.top_rad_s * np.interp(t, [0.0, t[-1]], [0.3, 1.0])
    theta = 0.4 + np.concatenate(([0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]) * dt)))
    full = 2.0 * motor.pole_pairs * motor.top_rad_s * motor.psi_wb * np.sqrt(3.0)
    ab, bc, ca = (_noisy(rng, v, full) for v in _line_voltages(motor, theta, omega))
    angle = np.round(theta / ENCODER_RAD) * ENCODER_RAD
    columns = {"t_s": t, "vab_v": ab, "vbc_v": bc, "vca_v": ca, "theta_mech_rad": angle}
    return capture_of("open_circuit", columns | {"omega_mech_rad_s": omega}, motor)


def hand_turn(motor: Motor, rng: np.random.Generator) -> Capture:
    t = np.arange(4000) * 1e-3
    theta = 2.0 * np.pi * (t / t[-1] - np.sin(2.0 * np.pi * t / t[-1]) / 7.0)
    omega = np.gradient(theta, t)
    ab, bc, _ = (_noisy(rng, v, 10.0 * motor.psi_wb) for v in _line_voltages(motor, theta, omega))
    return capture_of(
        "hand_turn", {"t_s": t, "vab_v": ab, "vbc_v": bc, "theta_mech_rad": theta}, motor
    )


def cogging(motor: Motor, rng: np.random.Generator, sense: float = 1.0) -> Capture:
    t = np.arange(26000) * 1e-3
    theta = sense * 0.25 * t
    friction = 1e-3 * motor.rated_a * motor.psi_wb * 10.0
    torque = -sense * friction + 0.5 * friction * np.sin(84.0 * theta)
    columns = {
        "t_s": t,
        "theta_mech_rad": theta,
        "omega_mech_rad_s": np.full(t.size, sense * 0.25),
        "torque_shaft_nm": _noisy(rng, torque, 100.0 * friction),
    }
    return capture_of("cogging", columns, motor)


def torque_map(motor: Motor, rng: np.random.Generator) -> Capture:
    t = np.arange(16000) * 5e-5
    speed = 0.4 * motor.top_rad_s
    iq = np.repeat(motor.rated_a * np.array([-1.0, -0.5, 0.5, 1.0]), 4000)
    id_ = np.tile(np.repeat([0.0, -0.3 * motor.rated_a], 2000), 4)
    return capture_of("torque_map", dq_columns(motor, rng, t, speed, id_, iq), motor)


def dq_columns(
    motor: Motor,
    rng: np.random.Generator,
    t: np.ndarray,
    speed: float | np.ndarray,
    id_: np.ndarray,
    iq: np.ndarray,
) -> dict[str, np.ndarray]:
    """Columns of a capture under dq currents at a speed: steady-state voltages and torque."""
    omega = np.broadcast_to(np.asarray(speed, float), t.shape)
    theta = np.concatenate(([0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]) * np.diff(t))))
    electrical = motor.pole_pairs * omega
    vd = motor.r_ohm * id_ - electrical * motor.lq_h * iq
    vq = motor.r_ohm * iq + electrical * (motor.ld_h * id_ + motor.psi_wb)
    reluctance = (motor.ld_h - motor.lq_h) * id_ * iq
    torque = 1.5 * motor.pole_pairs * (motor.psi_wb * iq + reluctance)
    top = 2.0 * motor.rated_a
    return {
        "t_s": t,
        "id_a": _noisy(rng, id_, top),
        "iq_a": _noisy(rng, iq, top),
        "vd_v": _noisy(rng, vd, 40.0),
        "vq_v": _noisy(rng, vq, 40.0),
        "theta_mech_rad": theta,
        "omega_mech_rad_s": omega,
        "torque_shaft_nm": _noisy(rng, torque, 3.0 * motor.pole_pairs * motor.psi_wb * top),
        "temp_winding_degc": 25.0 + rng.normal(0.0, 0.05, t.size),
    }


def spin_down(motor: Motor, rng: np.random.Generator) -> Capture:
    t = np.arange(2000) * 1e-3
    omega = motor.top_rad_s * (1.2 * np.exp(-t / 1.2) - 0.2)
    theta = np.concatenate(([0.0], np.cumsum(0.5 * (omega[1:] + omega[:-1]) * 1e-3)))
    noisy = _noisy(rng, omega, 2.0 * motor.top_rad_s)
    return capture_of(
        "spin_down", {"t_s": t, "theta_mech_rad": theta, "omega_mech_rad_s": noisy}, motor
    )


def heat_run(motor: Motor, rng: np.random.Generator) -> Capture:
    t = np.arange(9000) * 1e-2
    rise = 50.0 * -np.expm1(-t / 30.0)
    current = np.full(t.size, 0.4 * motor.rated_a)
    voltage = motor.r_ohm * (1.0 + 0.003854 * rise) * current
    zero = np.zeros(t.size)
    columns = {
        "t_s": t,
        "id_a": _noisy(rng, current, 2.0 * motor.rated_a),
        "iq_a": _noisy(rng, zero, 2.0 * motor.rated_a),
        "vd_v": _noisy(rng, voltage, 40.0),
        "vq_v": _noisy(rng, zero, 40.0),
        "temp_winding_degc": 25.0 + rise + rng.normal(0.0, 0.05, t.size),
    }
    return capture_of("heat_run", columns, motor)


def holding_current(motor: Motor, rng: np.random.Generator) -> Capture:
    there = np.linspace(0.0, 2.0 * np.pi, 3000)
    theta = np.concatenate((there, there[::-1]))
    sense = np.repeat([1.0, -1.0], 3000)
    level = 0.02 * motor.rated_a
    current = level * (sense + np.sin(84.0 * theta)) + rng.normal(0.0, 0.1 * level, 6000)
    t = np.cumsum(rng.uniform(0.01, 0.8, 6000))
    return capture_of(
        "holding_current", {"t_s": t, "theta_mech_rad": theta, "iq_a": current}, motor
    )


def flux_map(motor: Motor, rng: np.random.Generator) -> Capture:
    id_, iq = (g.ravel() for g in np.meshgrid(*2 * [np.linspace(-motor.rated_a, motor.rated_a, 9)]))
    scatter = 1.0 + 1e-3 * rng.standard_normal((2, id_.size))
    psi_d = (motor.psi_wb + motor.ld_h * id_) * scatter[0]
    columns = {"id_a": id_, "iq_a": iq, "psi_d_wb": psi_d, "psi_q_wb": motor.lq_h * iq * scatter[1]}
    return capture_of("flux_map", columns, motor)


def torque_table(motor: Motor, rng: np.random.Generator) -> Capture:
    iq = np.tile(np.linspace(-motor.rated_a, motor.rated_a, 9), 4)
    torque = 1.5 * motor.pole_pairs * motor.psi_wb * iq
    scatter = 1e-3 * np.abs(torque).max() * rng.standard_normal(iq.size)
    return capture_of("torque_table", {"iq_a": iq, "torque_shaft_nm": torque + scatter}, motor)


def drive(motor: Motor, rng: np.random.Generator) -> Capture:
    t = np.arange(40000) * 1e-4
    omega = 0.8 * motor.top_rad_s * np.sin(2.0 * np.pi * t / 2.0)
    iq = 0.2 * motor.rated_a * np.cos(2.0 * np.pi * t / 2.0) + 0.1 * motor.rated_a * np.sign(omega)
    columns = dq_columns(motor, rng, t, omega, np.zeros(t.size), iq)
    # a transducer has the shaft's friction and inertia before it
    rated_nm = 1.5 * motor.pole_pairs * motor.psi_wb * motor.rated_a
    columns["torque_shaft_nm"] = columns["torque_shaft_nm"] - 0.05 * rated_nm * np.sign(omega)
    return capture_of("drive", columns, motor, voltage_kind="commanded", vdc_v=36.0)


TESTS = {
    maker.__name__: maker
    for maker in (
        resistance,
        current_step,
        lcr,
        open_circuit,
        hand_turn,
        cogging,
        torque_map,
        spin_down,
        heat_run,
        holding_current,
        flux_map,
        drive,
        torque_table,
    )
}


def with_column(capture: Capture, name: str, values: np.ndarray) -> Capture:
    """The capture with one column of its first table replaced."""
    table = capture.tables[0].with_columns(pl.Series(name, np.asarray(values, float)))
    return replace(capture, tables=(table, *capture.tables[1:]))


def column(capture: Capture, name: str) -> np.ndarray:
    """A writable copy of a column of the first table."""
    return capture.tables[0][name].to_numpy().copy()


def with_rows(capture: Capture, keep: np.ndarray) -> Capture:
    """The capture with only some rows of its first table."""
    return replace(capture, tables=(capture.tables[0].filter(pl.Series(keep)), *capture.tables[1:]))
