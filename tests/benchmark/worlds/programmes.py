"""Test programmes that any plant can be put through, and what the instruments make of them.

`laboratory` has a dynamometer and a transducer, `telemetry` a multimeter, one scope trace and the
drive's own slow log, `end of line` ten seconds without a converter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Protocol

import numpy as np

from pipeline.simulator.design import Bench, Motor, Recording
from pipeline.simulator.driven import log
from pipeline.simulator.effects import cogging_order
from pipeline.simulator.sensors import Session, first_order_lag
from pipeline.simulator.standing import nice_rate
from tests.benchmark.worlds.lanes import Array, Lane

PWM_HZ = 5000.0
LOAD_RISE_S = 4e-3
LOG_EVERY = 5
"""PWM periods a row of telemetry, whose voltages are means in the rotor frame."""

BENCHES: Mapping[str, Bench] = {
    "laboratory": Bench(
        station="lab-2",
        pwm_hz=PWM_HZ,
        current_noise_rel=6e-4,
        voltage_noise_rel=3e-4,
        torque_noise_rel=1e-3,
        adc_bits=15,
        encoder_bits=16,
    ),
    "telemetry": Bench(
        station="bench-7",
        pwm_hz=PWM_HZ,
        current_noise_rel=1.5e-3,
        voltage_noise_rel=5e-4,
        adc_bits=13,
        encoder_bits=15,
        u_rel_current=8e-3,
        u_rel_voltage=4e-3,
        u_temp_degc=1.0,
    ),
    "end of line": Bench(station="line-3", pwm_hz=PWM_HZ, adc_bits=14, encoder_bits=14),
}
STEPS = tuple((axis, level) for axis in "dq" for level in (0.2, 0.5, 0.9))
ANGLE_DEG = {"d": -30.0, "q": 60.0}
"""Electrical angle at which pair ab lies along the axis: no current is driven into phase c."""

FLUX_STEPS = {"i_d": (-0.4, 0.0), "i_q": (-0.9, -0.45, 0.0, 0.45, 0.9)}
Supply = Callable[[float], float]
Step = tuple[str, str, Mapping[str, Any]]
RESISTANCE: tuple[Step, ...] = tuple(
    (f"resistance_{pair}", "resistance", {"pair": pair}) for pair in ("ab", "bc", "ca")
)
CURRENT_STEPS: tuple[Step, ...] = tuple(
    (f"current_step_{axis}_{k % 3}", "current_step", {"axis": axis, "level": level})
    for k, (axis, level) in enumerate(STEPS)
)
PROGRAMMES: Mapping[str, tuple[Step, ...]] = {
    "laboratory": (
        *RESISTANCE,
        *CURRENT_STEPS,
        ("open_circuit_0", "open_circuit", {"levels": (0.15, 0.35, 0.55, 0.75, 0.95)}),
        ("open_circuit_1", "open_circuit", {"levels": (-0.25, -0.5, -0.8)}),
        ("cogging_cw", "cogging", {"direction": 1}),
        ("cogging_ccw", "cogging", {"direction": -1}),
        ("torque_map_0", "torque_map", {"speed": 0.2, **FLUX_STEPS, "i_d": (-0.5, -0.2, 0.0, 0.2)}),
        ("torque_map_1", "torque_map", {"speed": 0.7, **FLUX_STEPS}),
        ("torque_map_2", "torque_map", {"speed": -0.45, **FLUX_STEPS}),
        ("spin_down_0", "spin_down", {"direction": 1, "level": 0.95}),
        ("spin_down_1", "spin_down", {"direction": -1, "level": 0.8}),
        ("drive_0", "drive", {"loaded": True}),
        ("drive_1", "drive", {"loaded": True}),
    ),
    "telemetry": (
        RESISTANCE[0],
        ("open_circuit_0", "open_circuit", {"levels": (0.3, 0.6, 0.9)}),
        ("spin_down_0", "spin_down", {"direction": 1, "level": 0.9}),
        *((f"drive_{k}", "drive", {"loaded": False}) for k in range(3)),
    ),
    "end of line": (
        *RESISTANCE,
        *(step for step in CURRENT_STEPS if step[0][-1] in "12"),
        ("open_circuit_0", "open_circuit", {"levels": (0.3, 0.6, 0.9)}),
        ("spin_down_0", "spin_down", {"direction": 1, "level": 0.8}),
        ("spin_down_1", "spin_down", {"direction": -1, "level": 0.8}),
    ),
}


@dataclass(frozen=True, slots=True)
class Hidden:
    """Sizes of what is in a plant, each 0 where absent; a world's `TYPICAL` has their units."""

    sizes: Mapping[str, float]

    def __getitem__(self, name: str) -> float:
        return self.sizes.get(name, 0.0)


Q_ALONE = ("resistance_ab", "current_step_q", "cogging", "spin_down", "drive")
"""Captures of a machine with a single winding: what q current and a commutator tell."""


def steps_of(programme: str, axes: str) -> tuple[Step, ...]:
    """The captures of a programme that a machine of both axes, `dq`, or of `q` alone can give."""
    steps = PROGRAMMES[programme]
    return steps if axes == "dq" else tuple(step for step in steps if step[0].startswith(Q_ALONE))


class Plant(Protocol):
    """What a world's motor does where no converter drives it; `motor` is its nameplate.

    `axes` is `dq`, or `q` for a machine with one winding: its current is told as a q current.
    """

    motor: Motor
    axes: str

    def emf(self, theta: Array, omega: Array) -> Array:
        """Open terminals: phase voltages [n, 3, V] at angles and speeds [n each]."""

    def locked(self, supply: Supply, breaks: Sequence[float], t_s: Array, eps: float) -> Array:
        """Locked rotor: current [n] along a voltage vector at `eps` from the d axis.

        `supply` gives its length [V] by time, smooth but at `breaks` [s].
        """

    def coast(self, theta: float, omega: float, rate_hz: float, n: int) -> Array:
        """Angle and speed [n, 2] with open terminals."""

    def turned(self, theta: Array, omega: Array) -> Array:
        """Shaft torque [n, N·m] at zero current and a given, nearly constant speed."""


@dataclass(frozen=True, slots=True)
class Campaigner:
    """One motor of a world on the bench of a programme."""

    plant: Plant
    programme: str
    seed: int

    def sessions(self) -> dict[str, Session]:
        """One session a capture, with instruments drawn once and randomness of its own."""
        steps = steps_of(self.programme, self.plant.axes)
        first, *rest = np.random.SeedSequence(self.seed).spawn(1 + len(steps))
        bench = BENCHES[self.programme]
        fixed = replace(bench, instruments=bench.drawn(np.random.default_rng(first)))
        return {
            stem: Session(
                self.plant.motor,
                None,  # type: ignore[arg-type]  # its sensors do not ask the simulator's plant
                fixed,
                fixed.drawn(np.random.default_rng(first)),
                np.random.default_rng(child),
            )
            for (stem, _, _), child in zip(steps, rest, strict=True)
        }


def lanes_of(
    sessions: Mapping[str, Session], programme: str, axes: str, ahead: bool
) -> dict[str, Lane]:
    """The runs of a programme that a converter drives; a log of q alone has no transducer.

    `ahead` is the frame that the drive's firmware logs its voltages in (`Lane`).
    """
    found = {}
    for stem, test, how in steps_of(programme, axes):
        if test == "torque_map":
            found[stem] = _map_lane(sessions[stem], how)
        elif test == "drive":
            found[stem] = _drive_lane(sessions[stem], axes == "dq" and bool(how["loaded"]))
    return {stem: replace(lane, ahead=ahead) for stem, lane in found.items()}


def _map_lane(session: Session, how: Mapping[str, Any]) -> Lane:
    m = session.motor
    omega = how["speed"] * m.speed_rated_rad_s
    cycle = 2.0 * math.pi / (m.pole_pairs * abs(omega))
    each = round(max(0.04, 1.5 * cycle, 3.0 * m.tau_elec_s) * PWM_HZ)
    i_d, i_q = (x.ravel() for x in np.meshgrid(how["i_d"], how["i_q"], indexing="ij"))
    i_dq = np.repeat((i_d + 1j * i_q) * m.current_rated_a, each)
    theta = float(session.rng.uniform(0.0, 2.0 * math.pi))
    return Lane(session, i_dq, np.zeros(i_dq.size), omega, True, theta)


def _drive_lane(session: Session, loaded: bool) -> Lane:
    """Speeds of both senses, each with a d current of its own, and load steps between."""
    m, rng, parts = session.motor, session.rng, 8
    each = round(0.2 * PWM_HZ)
    sense = np.where(np.arange(parts) // 2 % 2 == 0, 1.0, -1.0)
    goals = np.repeat(sense * 0.8 * m.speed_rated_rad_s * rng.uniform(0.1, 1.0, parts), each)
    pace = 0.4 * m.torque_rated_nm / m.j_rotor_kgm2 / PWM_HZ
    speed, now = np.empty(goals.size), 0.0
    for k, goal in enumerate(goals):
        now += min(max(goal - now, -pace), pace)
        speed[k] = now
    flux = 0.4 * m.current_rated_a * rng.uniform(-1.0, 0.5, parts)
    load = np.repeat(0.6 * m.torque_rated_nm * rng.uniform(-1.0, 1.0, parts), each)
    load = np.concatenate([np.zeros(each // 2), load])[: goals.size] * float(loaded)
    load = first_order_lag(load, 1.0 / (PWM_HZ * LOAD_RISE_S))
    theta = float(rng.uniform(0.0, 2.0 * math.pi))
    return Lane(session, np.repeat(flux, each) + 0j, load, 0.0, False, theta, speed)


def recordings(
    plant: Plant, programme: str, sessions: Mapping[str, Session], rows: Mapping[str, Array]
) -> list[Recording]:
    """Every capture of a programme; `rows` are those of its lanes."""
    made = []
    for stem, test, how in steps_of(programme, plant.axes):
        session = sessions[stem]
        if stem in rows and plant.axes == "q":
            table, meta = _logged_q(session, rows[stem], programme), {"voltage_timing": "centred"}
        elif stem in rows:
            table, meta = _logged(session, rows[stem], programme), {"voltage_timing": "held"}
        else:
            table, meta = TESTS[test](plant, session, **how)
        if stem in rows:
            meta["voltage_kind"] = "commanded"
        made.append(Recording(stem, session.meta(test, **meta), (table,)))
    return made


Table = dict[str, Array]
Made = tuple[Table, dict[str, str]]


def _logged(session: Session, rows: Array, programme: str) -> Table:
    """A drive's log: every period, or one row of `LOG_EVERY` with the voltages' means."""
    table = log(session, rows, 1.0 / PWM_HZ)
    if programme == "laboratory":
        return table
    n = rows.shape[0] // LOG_EVERY
    slow = {name: column[::LOG_EVERY][:n] for name, column in table.items()}
    for name in ("vd_v", "vq_v"):
        slow[name] = table[name][: n * LOG_EVERY].reshape(n, LOG_EVERY).mean(axis=1)
    del slow["torque_shaft_nm"], slow["temp_magnet_degc"]
    return slow


def _logged_q(session: Session, rows: Array, programme: str) -> Table:
    """The q axis alone, its voltage a mean over half a row either side.

    In a laboratory every period; telemetry is slow and has the drive's late speed too.
    """
    table = log(session, rows, 1.0 / PWM_HZ)
    every = 1 if programme == "laboratory" else LOG_EVERY
    half = every // 2 + 1
    # a period's voltage is held after its sample: so many before a row as from it on, ends by half
    weights = np.full(2 * half, 1.0 / every)
    weights[[0, -1]] = 0.5 * (1.0 - (2 * half - 2) / every)
    mean = np.convolve(table["vq_v"], weights[::-1], mode="valid")
    at = np.arange(half, mean.size + half, every)
    names = ("t_s", "iq_a", "theta_mech_rad", "temp_winding_degc")
    names += () if programme == "laboratory" else ("omega_mech_rad_s",)
    slow = {name: table[name][at] for name in names}
    return {**slow, "vq_v": mean[at - half]}


def _resistance(plant: Plant, session: Session, pair: str) -> Made:
    """DC plateaus, each after a rise of 2 ms, on a rotor that has an axis along the pair."""
    m, rate, dwell = session.motor, 1000.0, 0.25
    levels = 2.0 * m.r_phase_ohm * m.current_rated_a
    levels = levels * np.array([0.0, 0.15, 0.3, 0.08, -0.08, -0.3, -0.15])
    before = np.concatenate([[0.0], levels[:-1]])

    def volts(t: Any) -> Any:
        k = np.minimum((np.asarray(t) / dwell + 1e-9).astype(int), levels.size - 1)
        return levels[k] + (before[k] - levels[k]) * np.exp(-(t - k * dwell) / 2e-3)

    t_s, stamps = session.clock(round(levels.size * dwell * rate), rate)
    # along the pair's axis a vector of v/√3 is v between its terminals, i·2/√3 is i in its line
    breaks = [k * dwell for k in range(1, levels.size)]
    eps = 0.0 if plant.axes == "dq" else -0.5 * math.pi
    amps = plant.locked(lambda t: volts(t) / math.sqrt(3.0), breaks, t_s, eps)
    line = amps * math.sqrt(3.0) / 2.0
    first = "abc".index(pair[0])
    table = {
        "t_s": stamps,
        f"v{pair}_v": session.voltage(volts(t_s), t_s),
        f"i{pair[0]}_a": session.line_current(line, first, t_s),
        "temp_winding_degc": session.temperature(np.full(t_s.size, m.ambient_degc)),
    }
    return table, {"pair": pair}


def _current_step(plant: Plant, session: Session, axis: str, level: float) -> Made:
    """A step on pair ab, the rotor locked with an axis along it."""
    m = session.motor
    tau, degrees = m.tau_elec_s, ANGLE_DEG[axis]
    rate = nice_rate(140.0 / tau)
    before, on, off = (round(share * tau * rate) for share in (0.5, 9.0, 5.0))
    t_s, stamps = session.clock(before + on + off, rate)
    breaks = (before / rate, (before + on) / rate)
    height = level * m.current_rated_a * 2.0 * m.r_phase_ohm

    def volts(t: Any) -> Any:
        return height * ((t >= breaks[0] - 1e-12) & (t < breaks[1] - 1e-12))

    eps = math.radians(-30.0 - degrees)
    amps = plant.locked(lambda t: volts(t) / math.sqrt(3.0), breaks, t_s, eps)
    table = {
        "t_s": stamps,
        "vab_v": session.voltage(volts(t_s), t_s),
        "ia_a": session.line_current(amps * math.sqrt(3.0) / 2.0, 0, t_s),
    }
    return table, {
        "pair": "ab",
        "theta_elec_deg": f"{degrees % 360.0:.2f}",
        "voltage_timing": "held",
    }


def _open_circuit(plant: Plant, session: Session, levels: Sequence[float]) -> Made:
    """Plateaus of speed, joined by raised-cosine ramps."""
    m = session.motor
    omega = np.array(levels) * m.speed_rated_rad_s
    hz = m.pole_pairs * np.abs(omega) / (2.0 * math.pi)
    rate = nice_rate(40.0 * float(hz.max()))
    each = round(max(8.0 / float(hz.min()), 0.1) * rate)
    speed = np.repeat(omega, each)
    share = 0.5 - 0.5 * np.cos(np.pi * (np.arange(each // 12) + 0.5) / (each // 12))
    for k in range(1, omega.size):
        speed[k * each : k * each + share.size] = omega[k - 1] + (omega[k] - omega[k - 1]) * share
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1]))]) / rate
    theta = theta + session.rng.uniform(0.0, 2.0 * math.pi)
    v = plant.emf(theta, speed)
    t_s, stamps = session.clock(theta.size, rate)
    pairs = (("ab", 0, 1), ("bc", 1, 2), ("ca", 2, 0))
    table = {
        "t_s": stamps,
        **{f"v{x}_v": session.voltage(v[:, i] - v[:, j], t_s) for x, i, j in pairs},
        "theta_mech_rad": session.angle(theta),
        "omega_mech_rad_s": session.speed(speed, rate),
        "temp_magnet_degc": session.temperature(np.full(theta.size, m.ambient_degc)),
    }
    return table, {}


def _cogging(plant: Plant, session: Session, direction: int) -> Made:
    """A slow turn and a quarter at zero current."""
    m = session.motor
    per_turn, omega = max(3000, 48 * cogging_order(m)), direction * 2e-3 * m.speed_rated_rad_s
    rate = per_turn * abs(omega) / (2.0 * math.pi)
    n = round(1.25 * per_turn)
    t_s, stamps = session.clock(n, rate)
    theta = 0.2 + omega * t_s
    speed = np.full(n, omega)
    table = {
        "t_s": stamps,
        "theta_mech_rad": session.angle(theta),
        "omega_mech_rad_s": session.speed(speed, rate),
        "torque_shaft_nm": session.torque(plant.turned(theta, speed), t_s),
    }
    return table, {}


def _spin_down(plant: Plant, session: Session, direction: int, level: float) -> Made:
    """A coast to 1 % of rated speed."""
    m = session.motor
    omega = level * m.speed_rated_rad_s
    drag = m.torque_coulomb_nm + 0.5 * m.b_visc_nm_s_rad * omega
    coast_s = m.j_rotor_kgm2 * omega / drag
    rate = nice_rate(900.0 / coast_s)
    theta = float(session.rng.uniform(0.0, 2.0 * math.pi))
    true = plant.coast(theta, direction * omega, rate, math.ceil(1.5 * coast_s * rate))
    still = np.flatnonzero(direction * true[:, 1] < 0.01 * omega)
    true = true[: still[0]] if still.size else true
    _, stamps = session.clock(true.shape[0], rate)
    table = {
        "t_s": stamps,
        "theta_mech_rad": session.angle(true[:, 0]),
        "omega_mech_rad_s": session.speed(true[:, 1], rate),
    }
    return table, {}


TESTS: Mapping[str, Any] = {
    "resistance": _resistance,
    "current_step": _current_step,
    "open_circuit": _open_circuit,
    "cogging": _cogging,
    "spin_down": _spin_down,
}
