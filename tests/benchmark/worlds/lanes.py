"""A converter's control loop around somebody else's plant, many runs at once.

A lane is one run of one motor. All lanes of a batch advance together, one array element each, so
that a plant written for single numbers costs what numpy costs. The loop sees what its sensors see.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from pipeline.simulator.design import Motor
from pipeline.simulator.sensors import Session

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

CURRENT_LOOP_HZ = 250.0
SPEED_LOOP_HZ = 8.0
SPEED_LAG_S = 1e-3
"""Width of the loops, and the lag of the speed that the drive estimates from its encoder."""


@dataclass(frozen=True, slots=True)
class Lane:
    """One run: references by PWM period, and the shaft's other end.

    `i_dq` [n, A] is the reference of the current; where `speed` [n, rad/s] is given, it replaces
    the q part. `load` [n, N·m] is what the shaft delivers. `held` is a dynamometer that keeps
    `omega` [rad/s]; else the shaft starts there and is free. Where `ahead`, the firmware logs its
    voltage behind the turn to the period in which it acts, so that it is in the frame of the
    sampling instant; else before that turn, in the frame of the middle of that period.
    """

    session: Session
    i_dq: Complex
    load: Array
    omega: float
    held: bool
    theta: float
    speed: Array | None = None
    ahead: bool = False


class Stepper(Protocol):
    """A plant: its state by lane, advanced by one period under a held stationary voltage.

    `axes` is `dq`, or `q` of one winding: its drive has no voltage along d.
    """

    axes: str

    def current(self) -> Complex:
        """Stator current, stationary frame, amplitude-invariant [A]."""

    def angle(self) -> Array:
        """Mechanical angle, in any turn [rad]."""

    def speed(self) -> Array:
        """Mechanical speed [rad/s]."""

    def shaft_torque(self) -> Array:
        """What the shaft delivers to a dynamometer that holds its speed [N·m]."""

    def temperatures(self) -> tuple[Array, Array]:
        """Winding and magnet [degC]."""

    def advance(self, voltage: Complex, load: Array, period_s: float) -> None:
        """On by a period under a mean voltage [V] and a load [N·m]."""


@dataclass(slots=True)
class _Sensors:
    """Sensors in the loop: phase gains, offsets, noise, resolution, encoder faults, by lane."""

    gain: Array
    offset: Array
    noise: Array
    step_a: Array
    zero: Array
    wobble: Array
    wobble_phase: Array
    lsb: float

    def current(self, true: Complex, k: int) -> Complex:
        """The space vector of three measured phases."""
        turn = np.exp(-2j * math.pi * np.arange(3) / 3.0)
        phases = np.real(true[:, None] * turn)
        seen = self.gain * phases + self.offset + self.noise[k]
        seen = np.round(seen / self.step_a[:, None]) * self.step_a[:, None]
        vector: Complex = (2.0 / 3.0) * (seen @ np.conj(turn))
        return vector

    def angle(self, true: Array) -> Array:
        seen = true + self.zero + self.wobble * np.sin(true + self.wobble_phase)
        rounded: Array = np.round(seen / self.lsb) * self.lsb
        return rounded


def _sensors(lanes: Sequence[Lane], n: int) -> _Sensors:
    def each(values: Sequence[float]) -> Array:
        return np.array(values, dtype=np.float64)

    sessions = [lane.session for lane in lanes]
    noise = np.zeros((n, len(lanes), 3))
    for k, s in enumerate(sessions):
        noise[:, k] = s.current_sigma_a * s.rng.standard_normal((n, 3))
    return _Sensors(
        gain=np.array([[s.phase_gain(x) for x in range(3)] for s in sessions]),
        offset=np.array([[s.phase_offset_a(x) for x in range(3)] for s in sessions]),
        noise=noise,
        step_a=each([s.current_step_a for s in sessions]),
        zero=each([s.fault("angle_offset") / s.motor.pole_pairs for s in sessions]),
        wobble=each([s.fault("angle_eccentricity") for s in sessions]),
        wobble_phase=each([s.fault("angle_eccentricity", "phase_rad") for s in sessions]),
        lsb=2.0 * math.pi / 2.0 ** sessions[0].bench.encoder_bits,
    )


class Loop:
    """Current control with decoupling, speed control outside it, one period of delay.

    Tuned on the nameplates `motors`, one a lane.
    """

    def __init__(
        self, motors: Sequence[Motor], period_s: float, speed: Array, axes: str = "dq"
    ) -> None:
        def each(name: str) -> Array:
            return np.array([getattr(m, name) for m in motors], dtype=np.float64)

        self.period_s, self.axes = period_s, axes
        self.poles = each("pole_pairs")
        self.ld, self.lq, self.psi = each("ld_h"), each("lq_h"), each("psi_pm_wb")
        self.ohm, self.limit_v = each("r_phase_ohm"), each("vdc_v") / math.sqrt(3.0)
        self.limit_a = 1.3 * each("current_rated_a")
        width = 2.0 * math.pi * SPEED_LOOP_HZ
        self.kp = width * each("j_rotor_kgm2") / (1.5 * self.poles * self.psi)
        self.ki = 0.25 * width * self.kp
        self.integral = np.zeros(len(motors), dtype=np.complex128)
        self.speed_integral = np.zeros(len(motors))
        self.omega = speed.copy()
        self.last: Array | None = None

    def command(
        self, current: Complex, theta: Array, wanted: Complex, speed: Array
    ) -> tuple[Complex, Complex]:
        """Voltage for the period after next, of the rotor in its middle and stationary.

        `speed` is NaN where a current is wanted.
        """
        if self.last is not None:
            blend = -math.expm1(-self.period_s / SPEED_LAG_S)
            step = np.angle(np.exp(1j * (theta - self.last))) / self.period_s
            self.omega += blend * (step - self.omega)
        self.last = theta
        regulated = np.isfinite(speed)
        error = np.where(regulated, speed - self.omega, 0.0)
        free = self.kp * error + self.speed_integral
        torque_a = np.clip(free, -self.limit_a, self.limit_a)
        self.speed_integral += np.where(free == torque_a, self.ki * error * self.period_s, 0.0)
        i_ref = wanted.real + 1j * np.where(regulated, torque_a, wanted.imag)
        i_dq = current * np.exp(-1j * self.poles * theta)
        off = i_ref - i_dq
        width = 2.0 * math.pi * CURRENT_LOOP_HZ
        self.integral += width * self.ohm * off * self.period_s
        omega_e = self.poles * self.omega
        volts = width * (self.ld * off.real + 1j * self.lq * off.imag) + self.integral
        volts += 1j * omega_e * (self.ld * i_dq.real + self.psi + 1j * self.lq * i_dq.imag)
        volts = volts if self.axes == "dq" else 1j * volts.imag
        size = np.abs(volts)
        volts *= np.minimum(1.0, self.limit_v / np.maximum(size, 1e-9))
        ahead = self.poles * (theta + 1.5 * self.omega * self.period_s)
        return volts, volts * np.exp(1j * ahead)


def run(stepper: Stepper, lanes: Sequence[Lane], period_s: float) -> list[Array]:
    """Rows of `pipeline.simulator.driven.log`, one array [n, 11] a lane.

    The firmware logs the voltage that it asked for, in the frame that its lane says.
    """
    n = max(lane.load.size for lane in lanes)
    load = np.stack([_padded(lane.load, n) for lane in lanes], axis=1)
    wanted = np.stack([_padded(lane.i_dq, n) for lane in lanes], axis=1)
    none = np.full(1, np.nan)
    speed = np.stack([_padded(none if x.speed is None else x.speed, n) for x in lanes], axis=1)
    motors = [lane.session.motor for lane in lanes]
    loop = Loop(motors, period_s, np.array([lane.omega for lane in lanes]), stepper.axes)
    sensors = _sensors(lanes, n)
    rows = np.zeros((n, len(lanes), 11))
    theta_0 = np.array([lane.theta for lane in lanes])
    v_dq = 1j * loop.poles * loop.omega * loop.psi
    volts = v_dq * np.exp(1j * loop.poles * (theta_0 + 0.5 * loop.omega * period_s))
    held, theta = np.array([lane.held for lane in lanes]), theta_0
    turned = np.array([lane.ahead for lane in lanes])
    for k in range(n):
        theta = theta + np.angle(np.exp(1j * (stepper.angle() - theta)))
        current, seen = sensors.current(stepper.current(), k), sensors.angle(theta)
        after = loop.command(current, seen, wanted[k], speed[k])
        winding, magnet = stepper.temperatures()
        logged = np.where(turned, volts, v_dq * np.exp(1j * loop.poles * seen))
        torque = np.where(held, stepper.shaft_torque(), load[k])
        row = (current.real, current.imag, logged.real, logged.imag, seen, loop.omega)
        rows[k] = np.stack((*row, torque, winding, magnet, theta, stepper.speed()), axis=1)
        stepper.advance(volts, 0.5 * (load[k] + load[min(k + 1, n - 1)]), period_s)
        v_dq, volts = after
    return [rows[: lane.load.size, k] for k, lane in enumerate(lanes)]


def _padded(values: NDArray[np.generic], n: int) -> NDArray[np.generic]:
    return np.concatenate([values, np.full(n - values.size, values[-1])])
