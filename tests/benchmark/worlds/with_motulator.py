"""World `motulator`: its synchronous machine, mechanics and inverter, whose legs switch.

motulator (Aalto University, MIT) integrates flux linkage in rotor coordinates; its saturation is a
map from flux to current, its friction a function of speed, its load one of time. Here its models
hold one array element a lane and are integrated by Runge-Kutta between the edges of the PWM.
Currents, voltages and fluxes are peak-valued space vectors, d on the magnet: the contract's own.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from types import MappingProxyType
from typing import Any, ClassVar

import numpy as np
from motulator.drive.model import (
    Drive,
    StiffMechanicalSystem,
    SynchronousMachine,
    TwoMassMechanicalSystem,
    VoltageSourceConverter,
)
from motulator.drive.utils import SynchronousMachinePars, TwoMassMechanicalSystemPars
from scipy.integrate import solve_ivp

from pipeline.simulator.design import Motor
from pipeline.simulator.effects import cogging_order
from tests.benchmark.worlds.lanes import Array, Complex, Lane
from tests.benchmark.worlds.programmes import Hidden, Supply

DYNAMOMETER, DYNAMOMETER_HZ = 20.0, 6.0
"""Inertia of a dynamometer's rotor, in that of the motor, and the width of its speed control."""

EPS_RAD_S = 0.02
"""Speed over which Coulomb friction turns its sign."""

SENSOR_EFFECTS = (
    "current_gain",
    "current_offset",
    "angle_offset",
    "angle_eccentricity",
    "torque_lag",
    "torque_offset",
    "sample_delay",
)
PLANT_EFFECTS = (
    "saturation",
    "cross_saturation",
    "dead_time",
    "cogging",
    "unbalance",
    "stribeck",
    "windage",
    "compliance",
)
OUTSIDE = ("pulsation", "belt")
EFFECTS: Mapping[str, tuple[str, ...]] = {
    "laboratory": (*PLANT_EFFECTS, *SENSOR_EFFECTS),
    "telemetry": ("saturation", "dead_time", "cogging", "windage", "compliance", "current_gain"),
    "end of line": ("saturation", "windage", "stribeck"),
}
"""What this plant can have, by programme: what at least one of its captures excites."""

PAIRS = (("cogging", "windage"), ("saturation", "stribeck"), ("dead_time", "compliance"))
"""What is hidden together, the second at half its typical size."""

TYPICAL: Mapping[str, Callable[[Motor], float]] = MappingProxyType(
    {
        "saturation": lambda _: 0.18,
        "cross_saturation": lambda _: 0.10,
        "dead_time": lambda _: 2e-6,
        "cogging": lambda m: 0.015 * m.torque_rated_nm,
        "unbalance": lambda m: 0.01 * m.torque_rated_nm,
        "stribeck": lambda m: 0.008 * m.torque_rated_nm,
        "windage": lambda m: 0.012 * m.torque_rated_nm,
        "compliance": lambda _: 0.01,
        "pulsation": lambda m: 0.02 * m.torque_rated_nm,
        "belt": lambda m: 0.012 * m.torque_rated_nm,
    }
)
"""Sizes: share by which current exceeds the linear one at rated flux, s of both switches off, N·m,
at rated speed for windage, rad of twist at rated torque."""


def motor(seed: int) -> Motor:
    """A 2.2 kW servo of motulator's examples, its constants drawn by a fifth."""
    draw = np.exp(np.random.default_rng([seed, 11]).uniform(-0.2, 0.2, 8)).tolist()
    return Motor(
        motor_type="unit",
        pole_pairs=3,
        slots=36,
        r_phase_ohm=3.6 * draw[0],
        ld_h=0.036 * draw[1],
        lq_h=0.051 * draw[2],
        psi_pm_wb=0.545 * draw[3],
        j_rotor_kgm2=0.015 * draw[4],
        b_visc_nm_s_rad=2e-3 * draw[5],
        torque_coulomb_nm=0.12 * draw[6],
        current_rated_a=6.1,
        speed_rated_rad_s=157.0,
        vdc_v=540.0,
        rth_wa_k_w=1.0,
        rth_wm_k_w=1.0,
        rth_ma_k_w=1.0,
        cth_winding_j_k=1e3,
        cth_magnet_j_k=1e3,
    )


def _each(values: Sequence[float]) -> Array:
    return np.array(values, dtype=np.float64)


class Shaft:
    """Friction and torques by angle of some motors, in the forms that motulator takes."""

    def __init__(self, motors: Sequence[Motor], hidden: Sequence[Hidden]) -> None:
        self.b = _each([m.b_visc_nm_s_rad for m in motors])
        self.coulomb = _each([m.torque_coulomb_nm for m in motors])
        self.rated = _each([m.speed_rated_rad_s for m in motors])
        self.order = _each([float(cogging_order(m)) for m in motors])
        for name in ("stribeck", "windage", "cogging", "unbalance", "pulsation", "belt"):
            setattr(self, name, _each([h[name] for h in hidden]))
        self.external = np.zeros(len(motors))
        self.dynamometer: Callable[[Any], Any] = lambda _: 0.0
        self.angle: Callable[[], Array] = lambda: np.zeros(len(motors))

    def friction(self, speed: Array) -> Array:
        """Friction coefficient at an absolute speed, motulator's `B_L` [N·m·s/rad]."""
        slow = np.maximum(speed, 1e-9)
        bump = self.stribeck * np.exp(-(np.sqrt(speed / (0.03 * self.rated)) ** 3))
        sliding = (self.coulomb + bump) * np.tanh(slow / EPS_RAD_S) / slow
        return self.b + sliding + self.windage * speed / self.rated**2

    def load(self, t: float | Array) -> Array:
        """Torques that do not depend on speed, motulator's `tau_L` [N·m]."""
        theta = self.angle()
        total = (
            self.external + self.dynamometer(t) + self.cogging * np.sin(self.order * theta + 0.7)
        )
        total = total + self.unbalance * np.sin(theta + 1.1)
        total = total + self.belt * np.sin(2.37 * theta)
        return total + self.pulsation * np.sin(2.0 * math.pi * 17.3 * np.asarray(t))


def _flux_to_current(motors: Sequence[Motor], hidden: Sequence[Hidden]) -> Callable[[Complex], Any]:
    """The algebraic saturation model that motulator's authors publish.

    i_q = ψ_q (1/L_q + a_qq |ψ_q|^T + a_dq/(U+2) |x|^(U+2)), i_d likewise over x = ψ_d − ψ_f, T = 2,
    U = V = 0: the cross terms derive from one energy, so that the map is reciprocal (Qu,
    Hinkkanen and Repo, IEEE Trans. Ind. Appl. 2014).
    """
    ld, lq = _each([m.ld_h for m in motors]), _each([m.lq_h for m in motors])
    psi = _each([m.psi_pm_wb for m in motors])
    rated = _each([m.current_rated_a for m in motors])
    own = _each([h["saturation"] for h in hidden])
    cross = _each([h["cross_saturation"] for h in hidden])
    full_q, full_d = lq * rated, ld * rated
    a_qq, a_dd = own / lq / full_q**2, 0.4 * own / ld / full_d**2
    a_dq = 2.0 * cross / lq / full_d**2

    def current(flux: Complex) -> Any:
        x, y = flux.real - psi, flux.imag
        i_d = x * (1.0 / ld + a_dd * x * x + 0.5 * a_dq * y * y)
        i_q = y * (1.0 / lq + a_qq * y * y + 0.5 * a_dq * x * x)
        return i_d + 1j * i_q

    return current


def _machine(motors: Sequence[Motor], hidden: Sequence[Hidden]) -> SynchronousMachine:
    par = SynchronousMachinePars(
        n_p=_each([float(m.pole_pairs) for m in motors]),
        R_s=_each([m.r_phase_ohm for m in motors]),
        L_d=_each([m.ld_h for m in motors]),
        L_q=_each([m.lq_h for m in motors]),
        psi_f=_each([m.psi_pm_wb for m in motors]),
    )
    found = SynchronousMachine(par, i_s=_flux_to_current(motors, hidden), psi_s0=0.0)
    found.state.psi_s = par.psi_f.astype(np.complex128)
    return found


def _mechanics(motors: Sequence[Motor], hidden: Sequence[Hidden], held: Array) -> Any:
    """One mass, or two and a spring under compliance; a dynamometer's rotor is on the shaft."""
    shaft = Shaft(motors, hidden)
    j = _each([m.j_rotor_kgm2 for m in motors])
    twist = _each([h["compliance"] for h in hidden])
    brake = np.where(held, DYNAMOMETER * j, 0.0)
    if np.any(twist > 0.0):
        stiff = _each([m.torque_rated_nm for m in motors]) / np.maximum(twist, 1e-12)
        damping = 2.0 * 0.03 * np.sqrt(stiff * j * 0.25)
        par = TwoMassMechanicalSystemPars(J_M=0.5 * j, J_L=0.5 * j + brake, K_S=stiff, C_S=damping)
        par.B_L = shaft.friction
        found = TwoMassMechanicalSystem(par, tau_L=shaft.load)
        found.state.w_L = found.state.theta_ML = np.zeros(j.size)
    else:
        found = StiffMechanicalSystem(j + brake, shaft.friction, shaft.load)
    found.shaft, found.brake = shaft, brake
    return found


class Converted:
    """Some lanes on motulator's drive, all with compliance or none."""

    axes: ClassVar[str] = "dq"

    def __init__(self, lanes: Sequence[Lane], hidden: Sequence[Hidden]) -> None:
        motors = [lane.session.motor for lane in lanes]
        self.held = np.array([lane.held for lane in lanes])
        machine, mechanics = _machine(motors, hidden), _mechanics(motors, hidden, self.held)
        self.vdc = _each([m.vdc_v for m in motors])
        self.model = Drive(VoltageSourceConverter(self.vdc), machine, mechanics)
        self.dead_s = _each([h["dead_time"] for h in hidden])
        self.ambient = _each([m.ambient_degc for m in motors])
        self.shaft: Shaft = mechanics.shaft
        theta, omega = _each([x.theta for x in lanes]), _each([x.omega for x in lanes])
        mechanics.state.exp_j_theta_M = np.exp(1j * theta)
        mechanics.state.w_M = omega
        self.two = isinstance(mechanics, TwoMassMechanicalSystem)
        if self.two:
            mechanics.state.w_L = omega
        machine.state.exp_j_theta_m = np.exp(1j * machine.par.n_p * theta)
        # orders of the rotor's angle that are no whole numbers need its turns
        self.turns, self.start, self.wanted = theta, theta, omega
        self.shaft.angle, self.shaft.dynamometer = self._angle, self._dynamometer
        self.t_s = 0.0
        self._settle()

    def _angle(self) -> Array:
        raw = np.angle(self.model.mechanics.state.exp_j_theta_M)
        near: Array = self.turns + np.angle(np.exp(1j * (raw - self.turns)))
        return near

    def _settle(self) -> None:
        self.model.converter.inp.q_cs = np.zeros(self.vdc.size, dtype=np.complex128)
        self.model.rhs(self.t_s, self.model.get_initial_values())

    def current(self) -> Complex:
        found: Complex = self.model.machine.out.i_ss
        return found

    def angle(self) -> Array:
        return self.turns

    def speed(self) -> Array:
        found: Array = self.model.mechanics.out.w_M.real
        return found

    def shaft_torque(self) -> Array:
        """What is left behind friction and the motor's own inertia."""
        mechanics = self.model.mechanics
        passed = mechanics.out.tau_S if self.two else self.model.machine.out.tau_M
        last = mechanics.par.J_L if self.two else mechanics.par.J
        net = passed - mechanics.out.tau_L_tot
        delivered: Array = self._dynamometer(self.t_s) + net * mechanics.brake / last
        return delivered

    def _dynamometer(self, t: Any) -> Array:
        """Torque [N·m] of a dynamometer that holds its speed as well as it can."""
        mechanics, width = self.model.mechanics, 2.0 * math.pi * DYNAMOMETER_HZ
        turns = np.real(mechanics.state.w_L if self.two else mechanics.state.w_M)
        lag = self._angle() - self.start - self.wanted * t
        torque: Array = width * mechanics.brake * (turns - self.wanted + 0.25 * width * lag)
        return torque

    def temperatures(self) -> tuple[Array, Array]:
        return self.ambient, self.ambient

    def advance(self, voltage: Complex, load: Array, period_s: float) -> None:
        """One carrier period: each leg on once, around the middle; both switches off at edges."""
        self.shaft.external = load
        share = np.stack([np.real(voltage * np.exp(-2j * math.pi * k / 3.0)) for k in range(3)])
        share = share / self.vdc
        share = 0.5 + share - 0.5 * (share.max(axis=0) + share.min(axis=0))
        on = 0.5 * (1.0 - share) * period_s
        off = period_s - on
        edges = [on, off]
        if np.any(self.dead_s > 0.0):
            edges += [on + self.dead_s, off + self.dead_s]
        times = np.sort(np.concatenate([*edges, np.full((1, on.shape[1]), period_s)]), axis=0)
        times = np.minimum(times, period_s)
        before = np.zeros(on.shape[1])
        for after in times:
            self._under(before, after, on, off)
            before = after
        self.t_s += period_s
        self.turns = self._angle()
        self._settle()

    def _under(self, before: Array, after: Array, on: Array, off: Array) -> None:
        """On between two edges [s] under the legs' state; a dead leg follows its current."""
        middle, i_ss = 0.5 * (before + after), self.model.machine.out.i_ss
        legs = np.zeros(middle.size, dtype=np.complex128)
        for k in range(3):
            turn = np.exp(2j * math.pi * k / 3.0)
            high = (on[k] + self.dead_s < middle) & (middle < off[k])
            dead = ((on[k] <= middle) & (middle <= on[k] + self.dead_s)) | (
                (off[k] <= middle) & (middle <= off[k] + self.dead_s)
            )
            leg = np.where(dead & (self.dead_s > 0.0), np.real(i_ss / turn) < 0.0, high)
            legs = legs + (2.0 / 3.0) * turn * leg
        self.model.converter.inp.q_cs = legs
        _runge_kutta(self.model, self.t_s + before, after - before)


def _runge_kutta(model: Any, t: Any, h: Any) -> None:
    """One step of fourth order, in place."""
    rhs, y = model.rhs, model.get_initial_values()
    k1 = rhs(t, y)
    k2 = rhs(t + 0.5 * h, [a + 0.5 * h * k for a, k in zip(y, k1, strict=True)])
    k3 = rhs(t + 0.5 * h, [a + 0.5 * h * k for a, k in zip(y, k2, strict=True)])
    k4 = rhs(t + h, [a + h * k for a, k in zip(y, k3, strict=True)])
    new = [
        a + h / 6.0 * (p + 2.0 * q + 2.0 * r + s)
        for a, p, q, r, s in zip(y, k1, k2, k3, k4, strict=True)
    ]
    model.set_states(new)
    model.set_outputs(t + h)


@dataclass(frozen=True)
class Plant:
    """One motor of this world where no converter drives it."""

    motor: Motor
    hidden: Hidden
    axes: ClassVar[str] = "dq"

    def emf(self, theta: Array, omega: Array) -> Array:
        """The voltage under which the machine's flux stays what it is without current."""
        machine = _machine([self.motor], [self.hidden])
        p = self.motor.pole_pairs
        u = 1j * p * omega * machine.state.psi_s * np.exp(1j * p * theta)
        phases: Array = np.real(u[:, None] * np.exp(-2j * math.pi * np.arange(3) / 3.0))
        return phases

    def locked(self, supply: Supply, breaks: Sequence[float], t_s: Array, eps: float) -> Array:
        """Current along a voltage vector, of the machine at standstill."""
        machine = _machine([self.motor], [self.hidden])
        machine.inp.w_M = np.zeros(1)
        along = np.exp(1j * eps)

        def rates(t: float, y: Complex) -> Complex:
            machine.state.psi_s = y[:1]
            machine.inp.u_ss = supply(t) * along * machine.state.exp_j_theta_m
            machine.set_outputs(t)
            slope: Complex = machine.rhs()[0]
            return slope

        path = _solved(rates, machine.state.psi_s, breaks, t_s)
        return np.array([np.real(machine._i_s(flux)[0] * np.conj(along)) for flux in path])

    def coast(self, theta: float, omega: float, rate_hz: float, n: int) -> Array:
        """Mechanics of motulator without a machine's torque."""
        mechanics = _mechanics([self.motor], [self.hidden], np.array([False]))
        state = mechanics.state
        state.exp_j_theta_M, state.w_M = np.exp([1j * theta]), np.array([omega])
        if hasattr(state, "w_L"):
            state.w_L = np.array([omega])
        mechanics.inp.tau_M = np.zeros(1)
        turns = [theta]

        def angle() -> Array:
            raw: Array = np.angle(state.exp_j_theta_M * np.exp(-1j * turns[0]))
            return turns[0] + raw

        mechanics.shaft.angle = angle

        def rates(t: float, y: Complex) -> Complex:
            for name, value in zip(vars(state), y, strict=True):
                setattr(state, name, np.array([value]))
            turns[0] = float(angle()[0])
            mechanics.set_outputs(t)
            return np.concatenate(mechanics.rhs())

        start = np.concatenate(list(vars(state).values())).astype(np.complex128)
        t_s = np.arange(n) / rate_hz
        path = _solved(rates, start, (), t_s)
        names = list(vars(state))
        turned = np.unwrap(np.angle(path[:, names.index("exp_j_theta_M")]))
        speed = path[:, names.index("w_M")].real
        if np.max(np.abs(speed)) / rate_hz > math.pi:
            turned = (
                theta + np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) / rate_hz
            )
        return np.stack([turned, speed], axis=1)

    def turned(self, theta: Array, omega: Array) -> Array:
        """Less friction and load, by a shaft that holds the speed."""
        shaft = Shaft([self.motor], [self.hidden])
        shaft.angle = lambda: theta
        t_s = theta / omega[0]
        found: Array = -shaft.friction(np.abs(omega)) * omega - shaft.load(t_s)
        return found


def _solved(rates: Any, start: Any, breaks: Sequence[float], t_s: Array) -> Any:
    """States [n, k] at instants, between breaks of the inputs, by the solver of motulator."""
    found, y = [], np.asarray(start, dtype=np.complex128)
    ends = [float(t_s[0]), *breaks, float(t_s[-1]) + 1e-9]
    for low, high in pairwise(ends):
        inside = t_s[(t_s >= low - 1e-12) & (t_s < high - 1e-12)]
        done = solve_ivp(
            rates, (low, high), y, t_eval=[*np.clip(inside, low, high), high], rtol=1e-8, atol=1e-10
        )
        found.append(done.y[:, :-1].T)
        y = done.y[:, -1]
    return np.concatenate(found)


def kind(plant: Plant) -> bool:
    """Whether a motor needs the model of two masses."""
    return plant.hidden["compliance"] > 0.0
