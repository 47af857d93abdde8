"""Torque against speed, efficiency and voltage against a simulated motor that is driven there.

The simulator shares no code with what is tested. Its constants are drawn for each motor, a campaign
is recorded with instruments whose gains are drawn from what they state, and the published numbers
are held against the same motor on a perfect bench.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

from pipeline.estimation.registry import fit_all
from pipeline.performance.derive import performance_of
from pipeline.records.performance import Operation, Performance
from pipeline.simulator.bench import record
from pipeline.simulator.catalogue import motor_from
from pipeline.simulator.design import Motor
from tests.recovery.simulated import BENCH, MOTOR, recorded
from tests.simulated import QUIET
from tests.unit.performance.sheets import sheet_of

FEW, MOTORS, CURVE_POINTS, MAP_POINTS = 1, 8, 3, 2
PLAN = (
    *((f"resistance_{pair}", "resistance", {"pair": pair}) for pair in ("ab", "bc", "ca")),
    ("step_d", "current_step", {"theta_elec_deg": -30.0}),
    ("step_q", "current_step", {"theta_elec_deg": 60.0}),
    ("open_forward", "open_circuit", {}),
    ("open_backward", "open_circuit", {"levels": (-0.25, -0.5, -0.8), "temp_magnet_degc": 58.0}),
    ("map", "torque_map", {"speed": 0.3}),
    ("down_forward", "spin_down", {}),
    ("down_backward", "spin_down", {"direction": -1}),
    ("drive", "drive", {}),
    ("heat", "heat_run", {"duration_tau": 6.0}),
)
OPERATION = Operation(
    vdc_v=14.0,
    current_a=11.0,
    temp_winding_degc=60.0,
    temp_magnet_degc=45.0,
    temp_ambient_degc=25.0,
    temp_limit_degc=110.0,
)
DESIGNS = Path(__file__).parents[3] / "conf" / "motor"
RECOVERY = "recovery"
"""The motor of the recovery tests; other names are designs of conf/motor/."""


def design_of(name: str) -> Motor:
    """A design without effects."""
    if name == RECOVERY:
        return MOTOR
    document = yaml.safe_load((DESIGNS / f"{name}.yaml").read_text())
    return replace(motor_from(document), effects={})


def operation_of(name: str) -> Operation:
    """Limits under which the motor of a name reaches field weakening below its rated speed."""
    if name == RECOVERY:
        return OPERATION
    motor = design_of(name)
    return replace(OPERATION, vdc_v=0.6 * motor.vdc_v, current_a=0.9 * motor.current_rated_a)


def limit_v(operation: Operation) -> float:
    """The largest phase voltage, peak [V]."""
    return float(operation.vdc_v or 0.0) / math.sqrt(3.0)


@dataclass(frozen=True)
class Held:
    """A published number with its interval, and what the simulator does."""

    name: str
    value: float
    low: float
    high: float
    truth: float

    @property
    def inside(self) -> bool:
        return self.low <= self.truth <= self.high

    @property
    def off(self) -> float:
        """The error in standard uncertainties."""
        return (self.value - self.truth) / ((self.high - self.low) / 3.92)


def motor_of(seed: int, saturation: float = 0.0, design: str = RECOVERY) -> Motor:
    """A design with its constants within a tenth of what they are, and with
    iron by which L_q falls by a share at rated current.
    """
    rng = np.random.default_rng(seed)
    names = ("r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "b_visc_nm_s_rad", "torque_coulomb_nm")
    base = design_of(design)
    drawn = {name: getattr(base, name) * rng.uniform(0.9, 1.1) for name in names}
    effects = dict(base.effects) | ({"saturation": saturation} if saturation else {})
    return replace(base, effects=effects, **drawn)


@cache
def published(seed: int, saturation: float = 0.0, design: str = RECOVERY) -> Performance:
    campaign, _ = recorded(PLAN, seed, motor_of(seed, saturation, design), BENCH)
    return performance_of(sheet_of(fit_all(campaign, {})[0].chosen()), operation_of(design))


def driven(motor: Motor, omega: float, id_a: np.ndarray, iq_a: np.ndarray) -> np.ndarray:
    """Shaft torque [N·m], phase voltage [V] and terminal power [W] on a grid of currents [a, b, 3]:
    a dynamometer holds the speed of a motor on a perfect bench.
    """
    fast = replace(QUIET, pwm_hz=4e4)
    rated = motor.current_rated_a
    settled_s = 16.0 * motor.lq_h / motor.r_phase_ohm
    dwell = max(0.03, settled_s, 4.0 * math.pi / (motor.pole_pairs * omega))
    levels = {"id_levels": tuple(id_a / rated), "iq_levels": tuple(iq_a / rated)}
    warm = {
        "temp_winding_degc": OPERATION.temp_winding_degc,
        "temp_magnet_degc": OPERATION.temp_magnet_degc,
    }
    ample = replace(motor, vdc_v=6.0 * motor.vdc_v)
    rng = np.random.default_rng(0)
    speed = omega / motor.speed_rated_rad_s
    (table,) = record(
        "torque_map", ample, fast, rng, speed=speed, dwell_s=dwell, **levels, **warm
    ).tables
    count = id_a.size * iq_a.size
    names = ("torque_shaft_nm", "vd_v", "vq_v", "id_a", "iq_a")
    rows = {n: table[n].reshape(count, -1) for n in names}
    settled = {n: v[:, v.shape[1] // 2 :].mean(axis=1) for n, v in rows.items()}
    volts = np.hypot(settled["vd_v"], settled["vq_v"])
    power = 1.5 * (settled["vd_v"] * settled["id_a"] + settled["vq_v"] * settled["iq_a"])
    found = np.stack([settled["torque_shaft_nm"], volts, power], axis=1)
    return found.reshape(id_a.size, iq_a.size, 3)


def most_torque(
    motor: Motor, omega: float, near: tuple[float, float], operation: Operation
) -> float:
    """The most shaft torque [N·m] that a simulated motor gives within both limits.

    Torque and voltage are parabolas through nine driven points about a guess of the currents.
    """
    steps = np.array([-1.0, 0.0, 1.0])
    size = 0.04 * operation.current_a
    grid = driven(motor, omega, near[0] + size * steps, near[1] + size * steps)
    powers = np.array([[i, j] for i in range(3) for j in range(3)])
    places = np.array([[d, q] for d in steps for q in steps])
    design = np.prod(places[:, None, :] ** powers[None], axis=2)
    parabolas = np.linalg.solve(design, grid.reshape(9, 3))
    beta = math.atan2(-near[0], near[1]) + np.radians(np.linspace(-2.0, 2.0, 4001))
    circle = operation.current_a * np.stack([-np.sin(beta), np.cos(beta)], axis=1)
    at = (circle - np.array(near)) / size
    torque, volts, _ = (np.prod(at[:, None, :] ** powers[None], axis=2) @ parabolas).T
    return float(torque[volts <= limit_v(operation)].max())


@cache
def held(seed: int, saturation: float, design: str) -> tuple[Held, ...]:
    return tuple(points(seed, saturation, design))


def points(seed: int, saturation: float, design: str) -> Iterator[Held]:
    """Points of the torque curve, in both regimes, and of the efficiency map of one motor."""
    motor, told = motor_of(seed, saturation, design), published(seed, saturation, design)
    operation = operation_of(design)
    torque = told.curve("torque_peak")
    assert torque is not None
    rng = np.random.default_rng(seed)
    weak = [k for k, regime in enumerate(told.regimes) if regime == "field weakening"]
    strong = [k for k, regime in enumerate(told.regimes) if regime == "MTPA" and k > 0]
    # near its end the curve falls to nothing: there the angle is far from any guess
    chosen = [strong[len(strong) // 2], *rng.choice(weak[: 2 * len(weak) // 3], 2, replace=False)]
    for k in chosen[:CURVE_POINTS]:
        near = currents_near(motor, torque.x[k], operation)
        truth = most_torque(motor, torque.x[k], near, operation)
        yield Held("torque", torque.value[k], torque.low[k], torque.high[k], truth)
    for k in rng.choice(len(told.cells), MAP_POINTS, replace=False):
        cell = told.cells[k]
        at = np.array([cell.id_a]), np.array([cell.iq_a])
        shaft, _, power = driven(motor, cell.omega_mech_rad_s, *at)[0, 0]
        truth = shaft * cell.omega_mech_rad_s / power
        yield Held("efficiency", cell.efficiency, cell.low, cell.high, truth)


def currents_near(motor: Motor, omega: float, operation: Operation) -> tuple[float, float]:
    """A guess of the best currents [A]: the first angle from q at which textbook voltage fits."""
    r = motor.r_phase_ohm * (1.0 + 0.003854 * (OPERATION.temp_winding_degc - 25.0))
    psi = motor.psi_pm_wb * (1.0 - 0.0011 * (OPERATION.temp_magnet_degc - 25.0))
    beta = np.radians(np.linspace(0.0, 89.0, 2000))
    d, q = -operation.current_a * np.sin(beta), operation.current_a * np.cos(beta)
    w = motor.pole_pairs * omega
    volts = np.hypot(r * d - w * motor.lq_h * q, r * q + w * (motor.ld_h * d + psi))
    torque = np.where(
        volts <= limit_v(operation), psi * q + (motor.ld_h - motor.lq_h) * d * q, -np.inf
    )
    at = int(np.argmax(torque))
    return float(d[at]), float(q[at])


def all_held(
    saturation: float = 0.0, design: str = RECOVERY, motors: int = MOTORS
) -> tuple[Held, ...]:
    return tuple(one for seed in range(1, motors + 1) for one in held(seed, saturation, design))


@pytest.mark.parametrize("motors", [FEW, pytest.param(MOTORS, marks=pytest.mark.slow)])
def test_operating_points_lie_within_their_intervals(motors: int) -> None:
    """95 % of 40, five of each of eight motors, each with gains of its own; of one motor all."""
    found = all_held(motors=motors)
    assert len(found) == 5 * motors
    assert sum(one.inside for one in found) >= 0.95 * len(found), [
        one for one in found if not one.inside
    ]


@pytest.mark.slow
def test_so_they_do_where_the_iron_saturates() -> None:
    """L_q falls by 12 % at rated current, in a form that the datasheet's is not."""
    found = all_held(0.12)
    assert len(found) == 40
    assert sum(one.inside for one in found) >= 38, [one for one in found if not one.inside]


@pytest.mark.slow
@pytest.mark.parametrize("design", ["joint-11p", "servo-ipm"])
def test_so_they_do_for_other_designs(design: str) -> None:
    """A large slow motor, and one with magnets inside: no number here was chosen with them."""
    found = all_held(design=design)
    assert len(found) == 40
    assert sum(one.inside for one in found) >= 38, [one for one in found if not one.inside]


@pytest.mark.slow
@pytest.mark.parametrize("name", ["torque", "efficiency"])
def test_the_intervals_are_no_wider_than_the_errors_ask_for(name: str) -> None:
    """Errors of eight stations over u have a size of 1, as chi-square of eight has it to 99 %."""
    offs = np.array([one.off for one in all_held() if one.name == name])
    size = math.sqrt(float(np.mean(offs**2)))
    assert 0.4 < size < 1.6, offs


def test_an_error_of_two_percent_would_show() -> None:
    """Power of the first test: under field weakening the voltage's gain alone makes one percent."""
    torques = [one for one in all_held(motors=FEW) if one.name == "torque"]
    outside = [one for one in torques if not one.low <= one.truth / 1.02 <= one.high]
    assert len(outside) > 0.9 * len(torques)
