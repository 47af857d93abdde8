"""World `gym`: the synchronous motor, half bridges, supplies and loads of gym-electric-motor.

gym-electric-motor (Paderborn University, MIT) integrates currents and the electrical angle in rotor
coordinates; its half bridge has an interlocking time, its supply may have an inner resistance, its
load is a polynomial of speed, and others are made by deriving from it. Its own loop holds the
voltage in rotor coordinates over a step; here the same equations are integrated by Runge-Kutta
between the edges of the PWM under a vector that stands still, one array element a lane.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from gym_electric_motor.physical_systems.converters import FiniteTwoQuadrantConverter
from gym_electric_motor.physical_systems.electric_motors import (
    ExternallyExcitedSynchronousMotor,
    PermanentMagnetSynchronousMotor,
)
from gym_electric_motor.physical_systems.mechanical_loads import PolynomialStaticLoad
from gym_electric_motor.physical_systems.voltage_supplies import (
    IdealVoltageSupply,
    RCVoltageSupply,
)
from scipy.integrate import solve_ivp

from pipeline.simulator.design import Motor
from pipeline.simulator.effects import cogging_order
from tests.benchmark.worlds.lanes import Array, Complex, Lane
from tests.benchmark.worlds.programmes import Hidden, Supply

LOWER, UPPER = 2, 1
"""States of a half bridge of gym-electric-motor."""

FIELD_S, FIELD_A = 0.05, 100.0
"""Time constant and excitation of a winding on the rotor's d axis, where there is one."""

LINK_S = 1e-3
"""Time constant of a link with an inner resistance."""

SENSOR_EFFECTS = (
    "current_gain",
    "current_offset",
    "angle_offset",
    "angle_eccentricity",
    "torque_lag",
    "torque_offset",
    "sample_delay",
)
PLANT_EFFECTS = ("dead_time", "cogging", "unbalance", "stribeck", "windage", "constant_load")
OUTSIDE = ("field_winding", "sagging_link")
EFFECTS: Mapping[str, tuple[str, ...]] = {
    "laboratory": (*PLANT_EFFECTS, *SENSOR_EFFECTS),
    "telemetry": ("dead_time", "cogging", "windage", "constant_load", "current_gain"),
    "end of line": ("windage", "stribeck"),
}
"""What this plant can have, by programme: what at least one of its captures excites."""

PAIRS = (("dead_time", "windage"), ("cogging", "stribeck"), ("unbalance", "constant_load"))
"""What is hidden together, the second at half its typical size."""

TYPICAL: Mapping[str, Callable[[Motor], float]] = MappingProxyType(
    {
        "dead_time": lambda _: 2e-6,
        "cogging": lambda m: 0.015 * m.torque_rated_nm,
        "unbalance": lambda m: 0.01 * m.torque_rated_nm,
        "stribeck": lambda m: 0.008 * m.torque_rated_nm,
        "windage": lambda m: 0.012 * m.torque_rated_nm,
        "constant_load": lambda m: 0.01 * m.torque_rated_nm,
        "field_winding": lambda _: 0.1,
        "sagging_link": lambda _: 0.03,
    }
)
"""Sizes: s of both switches off, N·m, at rated speed for windage, share of the d inductance that a
field winding cancels at once, share of the link's voltage that is lost at rated power."""


def motor(seed: int) -> Motor:
    """The traction motor of gym-electric-motor's defaults, its constants drawn by a fifth."""
    draw = np.exp(np.random.default_rng([seed, 37]).uniform(-0.2, 0.2, 8)).tolist()
    return Motor(
        motor_type="unit",
        pole_pairs=3,
        slots=54,
        r_phase_ohm=0.018 * draw[0],
        ld_h=0.37e-3 * draw[1],
        lq_h=1.2e-3 * draw[2],
        psi_pm_wb=0.066 * draw[3],
        j_rotor_kgm2=0.03883 * draw[4],
        b_visc_nm_s_rad=1.5e-3 * draw[5],
        torque_coulomb_nm=0.35 * draw[6],
        current_rated_a=100.0,
        speed_rated_rad_s=300.0,
        vdc_v=300.0,
        rth_wa_k_w=1.0,
        rth_wm_k_w=1.0,
        rth_ma_k_w=1.0,
        cth_winding_j_k=1e3,
        cth_magnet_j_k=1e3,
    )


class Shaft(PolynomialStaticLoad):
    """A load of gym-electric-motor with torques by angle and a Stribeck bump besides."""

    def __init__(self, m: Motor, hidden: Hidden) -> None:
        # J is the rotor's alone; the constant's smooth turn of sign hangs on it
        parameter = {
            "a": m.torque_coulomb_nm,
            "b": m.b_visc_nm_s_rad,
            "c": hidden["windage"] / m.speed_rated_rad_s**2,
            "j_load": m.j_rotor_kgm2,
        }
        super().__init__(parameter)
        self.order, self.slow = cogging_order(m), 0.03 * m.speed_rated_rad_s
        self.hidden = hidden

    def torque(self, theta: float, omega: float) -> float:
        """What brakes the rotor at an angle and a speed [N·m]."""
        h, total = self.hidden, self._static_load(omega)
        total += h["constant_load"]
        if h["stribeck"]:
            bump = h["stribeck"] * math.exp(-((abs(omega) / self.slow) ** 1.5))
            total += bump * min(1.0, max(-1.0, omega / self._omega_lim))
        if h["cogging"]:
            total += h["cogging"] * math.sin(self.order * theta + 0.7)
        if h["unbalance"]:
            total += h["unbalance"] * math.sin(theta + 1.1)
        return float(total)


class Machine:
    """gym-electric-motor's machine: three states, or four with a field winding."""

    def __init__(self, m: Motor, hidden: Hidden) -> None:
        shared = {
            "p": m.pole_pairs,
            "r_s": m.r_phase_ohm,
            "l_d": m.ld_h,
            "l_q": m.lq_h,
            "j_rotor": m.j_rotor_kgm2,
        }
        coupling = hidden["field_winding"]
        self.field_v: tuple[float, ...] = ()
        if coupling:
            l_m = m.psi_pm_wb / FIELD_A
            l_e = 1.5 * l_m**2 / (coupling * m.ld_h)
            r_e = l_e / FIELD_S
            own = {"l_m": l_m, "l_e": l_e, "r_e": r_e, "k": 1.0}
            self.model: Any = ExternallyExcitedSynchronousMotor({**shared, **own})
            self.field_v = (r_e * FIELD_A,)
        else:
            self.model = PermanentMagnetSynchronousMotor({**shared, "psi_p": m.psi_pm_wb})

    def at_rest(self, theta: Array) -> Array:
        """States [k, n] without stator current at mechanical angles."""
        field = [np.full(theta.size, FIELD_A)] if self.field_v else []
        poles = self.model.motor_parameter["p"]
        return np.stack([np.zeros(theta.size), np.zeros(theta.size), *field, poles * theta])

    def rates(self, state: Array, u_dq: Complex, omega: Array) -> Array:
        """Rates of the states [k, n] under a voltage of the rotor's frame."""
        field = [np.full(omega.size, v) for v in self.field_v]
        found: Array = self.model.electrical_ode(state, [u_dq.real, u_dq.imag, *field], omega)
        return found


class Converted:
    """Some lanes of one motor."""

    axes: ClassVar[str] = "dq"

    def __init__(self, lanes: Sequence[Lane], hidden: Sequence[Hidden]) -> None:
        motors = [lane.session.motor for lane in lanes]
        n = len(lanes)
        self.machine = Machine(motors[0], hidden[0])
        self.shafts = [Shaft(m, h) for m, h in zip(motors, hidden, strict=True)]
        self.free = [k for k, lane in enumerate(lanes) if not lane.held]
        self.j, self.poles = motors[0].j_rotor_kgm2, motors[0].pole_pairs
        self.vdc, self.ambient = motors[0].vdc_v, np.full(n, motors[0].ambient_degc)
        theta, omega = np.array([x.theta for x in lanes]), np.array([x.omega for x in lanes])
        self.y = np.vstack([omega, self.machine.at_rest(theta)])
        self.dead_s = np.array([h["dead_time"] for h in hidden])
        # a step of its own is the tolerance at which a leg of gym-electric-motor switches
        self.legs = [
            [FiniteTwoQuadrantConverter(tau=1e-6, interlocking_time=s) for _ in range(3)]
            for s in self.dead_s
        ]
        for leg in (leg for three in self.legs for leg in three):
            leg.set_action(LOWER, 0.0)
        self.links = [_link(m, h) for m, h in zip(motors, hidden, strict=True)]
        self.t_s, self.drawn = 0.0, np.zeros(n)

    def current(self) -> Complex:
        found: Complex = (self.y[1] + 1j * self.y[2]) * np.exp(1j * self.y[-1])
        return found

    def angle(self) -> Array:
        found: Array = self.y[-1] / self.poles
        return found

    def speed(self) -> Array:
        found: Array = self.y[0]
        return found

    def _brake(self, y: Array, lanes: Sequence[int]) -> Array:
        """Load [N·m] of some lanes."""
        theta, omega = (y[-1] / self.poles).tolist(), y[0].tolist()
        return np.array([self.shafts[k].torque(theta[k], omega[k]) for k in lanes])

    def shaft_torque(self) -> Array:
        """What a dynamometer that holds the speed takes."""
        found: Array = self.machine.model.torque(self.y[1:])
        found -= self._brake(self.y, range(found.size))
        return found

    def temperatures(self) -> tuple[Array, Array]:
        return self.ambient, self.ambient

    def advance(self, voltage: Complex, load: Array, period_s: float) -> None:
        """One carrier period: each leg on once, around the middle."""
        turns = np.exp(2j * math.pi * np.arange(3) / 3.0)
        share = np.real(voltage * np.conj(turns)[:, None]) / self.vdc
        share = 0.5 + share - 0.5 * (share.max(axis=0) + share.min(axis=0))
        on = 0.5 * (1.0 - share) * period_s
        off = period_s - on
        edges = np.concatenate([on, off])
        if np.any(self.dead_s > 0.0):
            edges = np.concatenate([edges, np.minimum(edges + self.dead_s, period_s)])
        ends = np.vstack([np.sort(edges, axis=0), np.full(on.shape[1], period_s)])
        before = np.zeros(on.shape[1])
        for after in ends:
            legs = self._legs(before, after, on, off)
            self._on(turns @ legs * (2.0 / 3.0), load, after - before)
            before = after
        self.t_s += period_s

    def _legs(self, before: Array, after: Array, on: Array, off: Array) -> Array:
        """Voltage [3, n] of every leg between two edges [s]."""
        amps = np.real(self.current() * np.exp(-2j * math.pi * np.arange(3) / 3.0)[:, None])
        middle, start = 0.5 * (before + after), self.t_s + before
        legs = np.where((on <= middle) & (middle < off), 1.0, 0.0)
        for k in np.flatnonzero(self.dead_s > 0.0).tolist():
            for x, leg in enumerate(self.legs[k]):
                if before[k] in (on[x, k], off[x, k]):
                    leg.set_action(UPPER if before[k] == on[x, k] else LOWER, float(start[k]))
                legs[x, k] = leg.convert([amps[x, k]], self.t_s + float(middle[k]))[0]
        link = np.empty(before.size)
        for k, supply in enumerate(self.links):
            link[k] = supply.get_voltage(float(start[k]), float(self.drawn[k]))[0]
        self.drawn = (legs * amps).sum(axis=0)
        found: Array = legs * link
        return found

    def _on(self, volts: Complex, load: Array, h: Array) -> None:
        """One step of Runge-Kutta of fourth order under a stationary vector [V]."""

        def rates(y: Array) -> Array:
            found = np.zeros_like(y)
            found[1:] = self.machine.rates(y[1:], volts * np.exp(-1j * y[-1]), y[0])
            if self.free:
                made = self.machine.model.torque(y[1:])[self.free] - load[self.free]
                found[0, self.free] = (made - self._brake(y, self.free)) / self.j
            return found

        k1 = rates(self.y)
        k2 = rates(self.y + 0.5 * h * k1)
        k3 = rates(self.y + 0.5 * h * k2)
        k4 = rates(self.y + h * k3)
        self.y = self.y + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


def _link(m: Motor, hidden: Hidden) -> Any:
    """The supply: ideal, or one whose voltage sags with the power drawn from it."""
    if not hidden["sagging_link"]:
        return IdealVoltageSupply(m.vdc_v)
    drawn = m.torque_rated_nm * m.speed_rated_rad_s / m.vdc_v
    ohm = hidden["sagging_link"] * m.vdc_v / drawn
    found = RCVoltageSupply(m.vdc_v, {"R": ohm, "C": LINK_S / ohm})
    found.reset()
    return found


@dataclass(frozen=True)
class Plant:
    """One motor of this world where no converter drives it."""

    motor: Motor
    hidden: Hidden
    axes: ClassVar[str] = "dq"

    def emf(self, theta: Array, omega: Array) -> Array:
        """The voltage under which no current begins."""
        machine, m = Machine(self.motor, self.hidden), self.motor
        state = machine.at_rest(theta)
        rate = machine.rates(state, np.zeros(theta.size, dtype=np.complex128), omega)
        u = -(m.ld_h * rate[0] + 1j * m.lq_h * rate[1]) * np.exp(1j * state[-1])
        phases: Array = np.real(u[:, None] * np.exp(-2j * math.pi * np.arange(3) / 3.0))
        return phases

    def locked(self, supply: Supply, breaks: Sequence[float], t_s: Array, eps: float) -> Array:
        """Current along a voltage vector, of the machine at standstill."""
        machine, still = Machine(self.motor, self.hidden), np.zeros(1)
        along = np.exp(1j * eps)

        def rates(t: float, y: Array) -> Array:
            u_dq = np.array([supply(t) * along])
            return machine.rates(y[:, None], u_dq, still)[:, 0]

        path = _solved(rates, machine.at_rest(still)[:, 0], breaks, t_s)
        found: Array = np.real((path[:, 0] + 1j * path[:, 1]) * np.conj(along))
        return found

    def coast(self, theta: float, omega: float, rate_hz: float, n: int) -> Array:
        """The load alone brakes the rotor."""
        shaft = Shaft(self.motor, self.hidden)

        def rates(_: float, y: Array) -> Array:
            return np.array([y[1], -shaft.torque(y[0], y[1]) / shaft.j_total])

        path: Array = _solved(rates, np.array([theta, omega]), (), np.arange(n) / rate_hz)
        return path

    def turned(self, theta: Array, omega: Array) -> Array:
        """What the load takes from a shaft that is turned."""
        shaft = Shaft(self.motor, self.hidden)
        each = zip(theta.tolist(), omega.tolist(), strict=True)
        return np.array([-shaft.torque(angle, speed) for angle, speed in each])


def _solved(rates: Any, start: Array, breaks: Sequence[float], t_s: Array) -> Array:
    """States [n, k] at instants, between breaks of the inputs."""
    found, y = [], start
    ends = [float(t_s[0]), *breaks, float(t_s[-1]) + 1e-9]
    for low, high in pairwise(ends):
        inside = t_s[(t_s >= low - 1e-12) & (t_s < high - 1e-12)]
        done = solve_ivp(
            rates, (low, high), y, t_eval=[*np.clip(inside, low, high), high], rtol=1e-8, atol=1e-10
        )
        found.append(done.y[:, :-1].T)
        y = done.y[:, -1]
    return np.concatenate(found)


def kind(plant: Plant) -> tuple[object, ...]:
    """Lanes of one set of constants run together, those with more edges or states apart."""
    constants = (plant.motor.r_phase_ohm, plant.motor.ld_h, plant.motor.psi_pm_wb)
    return (*constants, plant.hidden["field_winding"], plant.hidden["dead_time"] > 0.0)
