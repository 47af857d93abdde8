"""World `mujoco`: its `dcmotor` actuator on a hinge, with what MuJoCo's joints and bodies can have.

MuJoCo (Google DeepMind, Apache-2.0) models a motor of one winding, v = R i + L di/dt + K ω and
T = K i, cogging, LuGre friction, dry and viscous friction of a joint, drag of a fluid, gravity on
an eccentric mass, further bodies on springs. Power is v i there and 1.5 v_q i_q in
the contract's frame, so that the winding is a q axis with v_q = v, i_q = 2/3 i: R and L are 1.5
times as large, K = p ψ stays, T = 1.5 p ψ i_q.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, ClassVar

import mujoco
import numpy as np

from pipeline.simulator.design import Motor
from pipeline.simulator.effects import cogging_order
from tests.benchmark.worlds.lanes import Array, Complex, Lane
from tests.benchmark.worlds.programmes import Hidden, Supply

STEP_S = 1e-5
HELD_KGM2 = 1e5
"""Step of the integrator, and a rotor's inertia that no torque here can move."""

GRAVITY = 9.81
RIGID = "0 0 0 0 0"
"""LuGre friction of an actuator that has none."""

SENSOR_EFFECTS = ("angle_eccentricity",)
PLANT_EFFECTS = (
    "cogging",
    "unbalance",
    "stribeck",
    "presliding",
    "windage",
    "constant_load",
    "compliance",
)
OUTSIDE = ("wound_cable", "loose_mass")
EFFECTS: Mapping[str, tuple[str, ...]] = {
    "laboratory": (*PLANT_EFFECTS, *SENSOR_EFFECTS),
    "telemetry": ("cogging", "unbalance", "windage", "constant_load"),
}
PAIRS = (("cogging", "windage"), ("unbalance", "presliding"), ("stribeck", "constant_load"))
TYPICAL: Mapping[str, Callable[[Motor], float]] = MappingProxyType(
    {
        "cogging": lambda m: 0.015 * m.torque_rated_nm,
        "unbalance": lambda m: 0.01 * m.torque_rated_nm,
        "stribeck": lambda m: 0.008 * m.torque_rated_nm,
        "presliding": lambda m: 0.05 * 2.0 * math.pi / cogging_order(m),
        "windage": lambda m: 0.012 * m.torque_rated_nm,
        "constant_load": lambda m: 0.01 * m.torque_rated_nm,
        "compliance": lambda _: 0.02,
        "wound_cable": lambda m: 0.03 * m.torque_rated_nm / 100.0,
        "loose_mass": lambda m: 0.01 * m.torque_rated_nm,
    }
)
"""N·m; rad of travel before friction is whole; N·m at rated speed for windage; rad of twist at
rated torque; N·m/rad of a cable that winds up; N·m of weight of a mass that swings in the rotor."""


def motor(seed: int) -> Motor:
    """A gimbal motor of 12 slots and 14 poles, its constants drawn by a fifth."""
    draw = np.exp(np.random.default_rng([seed, 23]).uniform(-0.2, 0.2, 6)).tolist()
    inductance = 1.5e-3 * draw[1]
    return Motor(
        motor_type="unit",
        pole_pairs=7,
        slots=12,
        r_phase_ohm=0.75 * draw[0],
        ld_h=inductance,
        lq_h=inductance,
        psi_pm_wb=0.0072 * draw[2],
        j_rotor_kgm2=1.2e-4 * draw[3],
        b_visc_nm_s_rad=2e-5 * draw[4],
        torque_coulomb_nm=6e-3 * draw[5],
        current_rated_a=8.0,
        speed_rated_rad_s=200.0,
        vdc_v=36.0,
        rth_wa_k_w=1.0,
        rth_wm_k_w=1.0,
        rth_ma_k_w=1.0,
        cth_winding_j_k=1e3,
        cth_magnet_j_k=1e3,
    )


def _friction(m: Motor, h: Hidden) -> tuple[float, str]:
    """Dry friction of the joint, or LuGre friction of the actuator in its place."""
    if h["stribeck"] == h["presliding"] == 0.0:
        return m.torque_coulomb_nm, RIGID
    static = m.torque_coulomb_nm + h["stribeck"]
    # bristles under Stribeck friction alone are as stiff as the step allows
    travel = h["presliding"] or 2e-4
    stiff = m.torque_coulomb_nm / travel
    damping = 0.2 * math.sqrt(stiff * m.j_rotor_kgm2)
    slow = 0.03 * m.speed_rated_rad_s
    return 0.0, f"{stiff!r} {damping!r} {m.torque_coulomb_nm!r} {static!r} {slow!r}"


def _bodies(m: Motor, h: Hidden, armature: float) -> str:
    """The rotor, and what hangs on it."""
    twist, j = h["compliance"], m.j_rotor_kgm2
    own = 0.5 * j if twist > 0.0 else j
    mass, arm = 0.05, h["unbalance"] / (0.05 * GRAVITY)
    axial = own - mass * arm**2
    flat = 0.6 * axial
    dry, _ = _friction(m, h)
    inner = ""
    if twist > 0.0:
        stiff = m.torque_rated_nm / twist
        loss = 2.0 * 0.03 * math.sqrt(stiff * j * 0.25)
        inner = f"""<body><joint name="far" type="hinge" axis="0 0 1" stiffness="{stiff!r}"
          damping="{loss!r}"/><inertial pos="0 0 0" mass="0.01"
          diaginertia="{0.6 * own!r} {0.6 * own!r} {own!r}"/></body>"""
    if h["loose_mass"] > 0.0:
        swing = 0.01
        weight = h["loose_mass"] / GRAVITY / swing
        inner += f"""<body pos="{swing} 0 0"><joint name="loose" type="hinge" axis="0 0 1"
          damping="{0.02 * h["loose_mass"]!r}"/><inertial pos="{swing} 0 0" mass="{weight!r}"
          diaginertia="1e-7 1e-7 1e-7"/></body>"""
    return f"""<body name="rotor"><joint name="shaft" type="hinge" axis="0 0 1"
      damping="{m.b_visc_nm_s_rad!r}" frictionloss="{dry!r}" armature="{armature!r}"
      solreffriction="{2.0 * STEP_S!r} 1" solimpfriction="0.9999 0.9999 0.001 0.5 2"
      stiffness="{h["wound_cable"]!r}"/>
      <inertial pos="{arm!r} 0 0" mass="{mass}" diaginertia="{flat!r} {flat!r} {axial!r}"/>
      {inner}</body>"""


def _model(m: Motor, h: Hidden, *, held: bool = False, powered: bool = True) -> Any:
    """MuJoCo's model; `held` has a flywheel that keeps its speed, not `powered` open terminals."""
    _, lugre = _friction(m, h)
    constant = m.pole_pairs * m.psi_pm_wb
    motor_words = f'motorconst="{constant!r} {constant!r}" inductance="{m.lq_h / 1.5!r} 0"'
    if not powered:
        motor_words = 'motorconst="0 0" input="none"'

    def compiled(density: float) -> Any:
        return mujoco.MjModel.from_xml_string(f"""<mujoco>
          <option timestep="{STEP_S}" integrator="implicitfast" gravity="0 -{GRAVITY} 0"
            density="{density!r}"/>
          <worldbody>{_bodies(m, h, HELD_KGM2 if held else 0.0)}</worldbody>
          <actuator><dcmotor joint="shaft" resistance="{m.r_phase_ohm / 1.5!r}" {motor_words}
            cogging="{h["cogging"]!r} {cogging_order(m)} 0.7" lugre="{lugre}"/></actuator>
        </mujoco>""")

    if h["windage"] == 0.0:
        return compiled(0.0)
    drag = [_drag(compiled(density), m.speed_rated_rad_s) for density in (0.0, 1.0)]
    return compiled(h["windage"] / (drag[1] - drag[0]))


def _drag(model: Any, omega: float) -> float:
    """Passive torque against a speed [N·m]."""
    data = mujoco.MjData(model)
    data.qvel[0] = omega
    mujoco.mj_forward(model, data)
    return -float(data.qfrc_passive[0])


class _Rotor:
    """One motor in MuJoCo with its state; `held` turns at a speed whatever acts on it."""

    def __init__(self, m: Motor, h: Hidden, theta: float, omega: float, **kind: bool) -> None:
        self.model = _model(m, h, **kind)
        self.data = mujoco.MjData(self.model)
        self.data.qpos[0], self.data.qvel[0] = theta, omega
        self.data.qfrc_applied[0] = -h["constant_load"]
        # LuGre's bristle is the first activation where it has one, the winding's current the last
        self.winding = kind.get("powered", True)
        self.theta, self.omega = theta, omega

    def on(self, volts: float, steps: int) -> None:
        """On by steps, after which angle and speed are those that go with the current.

        MuJoCo moves the shaft by the current that the same step ends with: it is a step ahead.
        """
        if self.winding:
            self.data.ctrl[0] = volts
        mujoco.mj_step(self.model, self.data, steps - 1)
        self.theta, self.omega = float(self.data.qpos[0]), float(self.data.qvel[0])
        mujoco.mj_step(self.model, self.data)

    @property
    def amps(self) -> float:
        """The q current [A]."""
        return float(self.data.act[-1]) / 1.5 if self.winding else 0.0

    def shaft_torque(self) -> float:
        """All torques but the flywheel's [N·m]."""
        d = self.data
        mujoco.mj_forward(self.model, d)
        total = d.qfrc_passive[0] + d.qfrc_actuator[0] + d.qfrc_constraint[0]
        return float(total - d.qfrc_bias[0] + d.qfrc_applied[0])


class Converted:
    """Some lanes in MuJoCo, one model each."""

    axes: ClassVar[str] = "q"

    def __init__(self, lanes: Sequence[Lane], hidden: Sequence[Hidden]) -> None:
        self.rotors = [
            _Rotor(lane.session.motor, h, lane.theta, lane.omega)
            for lane, h in zip(lanes, hidden, strict=True)
        ]
        self.poles = np.array([lane.session.motor.pole_pairs for lane in lanes], dtype=np.float64)
        self.ambient = np.array([lane.session.motor.ambient_degc for lane in lanes])

    def current(self) -> Complex:
        amps = np.array([r.amps for r in self.rotors])
        found: Complex = 1j * amps * np.exp(1j * self.poles * self.angle())
        return found

    def angle(self) -> Array:
        return np.array([r.theta for r in self.rotors])

    def speed(self) -> Array:
        return np.array([r.omega for r in self.rotors])

    def shaft_torque(self) -> Array:
        """Of no dynamometer: every lane is free."""
        return np.zeros(len(self.rotors))

    def temperatures(self) -> tuple[Array, Array]:
        return self.ambient, self.ambient

    def advance(self, voltage: Complex, load: Array, period_s: float) -> None:
        """The commutator's voltage is the q part in the middle of the period."""
        del load
        middle = self.angle() + 0.5 * period_s * self.speed()
        volts = np.imag(voltage * np.exp(-1j * self.poles * middle))
        steps = round(period_s / STEP_S)
        for rotor, v in zip(self.rotors, volts, strict=True):
            rotor.on(float(v), steps)


@dataclass(frozen=True)
class Plant:
    """One motor of this world where no converter drives it."""

    motor: Motor
    hidden: Hidden
    axes: ClassVar[str] = "q"

    def locked(self, supply: Supply, breaks: Sequence[float], t_s: Array, eps: float) -> Array:
        """Current along a voltage vector on the q axis, the rotor at rest."""
        del breaks
        sense = math.sin(eps)
        rotor = _Rotor(self.motor, Hidden({}), 0.0, 0.0, held=True)
        steps = max(1, round((t_s[1] - t_s[0]) / STEP_S))
        rotor.model.opt.timestep = (t_s[1] - t_s[0]) / steps
        found = np.empty(t_s.size)
        for k, t in enumerate(t_s):
            found[k] = sense * rotor.amps
            for i in range(steps):
                middle = t + (i + 0.5) * rotor.model.opt.timestep
                rotor.on(sense * float(supply(middle)), 1)
        return found

    def coast(self, theta: float, omega: float, rate_hz: float, n: int) -> Array:
        """A coast of the joint with the actuator's winding left out."""
        rotor = _Rotor(self.motor, self.hidden, theta, omega, powered=False)
        steps = round(1.0 / rate_hz / STEP_S)
        found = np.empty((n, 2))
        for k in range(n):
            found[k] = rotor.data.qpos[0], rotor.data.qvel[0]
            rotor.on(0.0, steps)
        return found

    def turned(self, theta: Array, omega: Array) -> Array:
        """The torque on a flywheel that turns as it will, from a turn before on."""
        period = float(theta[1] - theta[0]) / float(omega[0])
        # bristles alone have a state that moves while the flywheel hardly does
        _, lugre = _friction(self.motor, self.hidden)
        longest = 20.0 * STEP_S if lugre == RIGID else 2.0 * STEP_S
        steps = max(1, math.ceil(period / longest))
        start = float(theta[0]) - 200 * period * float(omega[0])
        rotor = _Rotor(self.motor, self.hidden, start, float(omega[0]), held=True, powered=False)
        rotor.model.opt.timestep = period / steps
        rotor.on(0.0, 200 * steps)
        found = np.empty(theta.size)
        for k in range(theta.size):
            found[k] = rotor.shaft_torque()
            rotor.on(0.0, steps)
        return found


def kind(_: Plant) -> bool:
    """Every lane has a model of its own."""
    return True
