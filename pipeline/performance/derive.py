"""The numbers of a motor datasheet at stated conditions: what a maker's sheet has, with intervals.

Intervals are 95 %, by Monte Carlo over the constants' joint covariance (JCGM 101:2008). Torque is
air-gap torque less drag, a mean over a turn.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.performance.blanks import NO_CONDITIONS, losses_not_known
from pipeline.performance.draws import interval, uniform_draws
from pipeline.performance.efficiency import efficiency_map
from pipeline.performance.envelope import Point, most_torque, regime_of, shaft_torque_nm
from pipeline.performance.heat import Heat, continuous_current_a, time_to_limit_s
from pipeline.performance.machine import Machine, drag_nm, voltage_v
from pipeline.performance.sources import (
    COPPER,
    ELECTRICAL,
    MECHANICAL,
    Sources,
    heat_of,
    machine_at,
    missing,
    sources_of,
)
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Array
from pipeline.records.consistent_constants import combined
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.performance import Blank, Curve, Derived, Operation, Performance

SPEEDS, CURRENTS = 33, 21
FASTEST = 4.0
"""The curve ends at this many corner speeds where field weakening has no end of its own."""
S1, S2 = "IEC 60034-1, 4.2.1 (duty S1)", "IEC 60034-1, 4.2.2 (duty S2, from ambient)"


@dataclass(frozen=True, slots=True)
class _Case:
    """A motor and its conditions; `machine` is at the temperatures of the peak curve."""

    sources: Sources
    operation: Operation
    machine: Machine

    @property
    def limit_a(self) -> Array:
        """Current limit [n, A]."""
        return np.full(self.sources.size, self.operation.current_a)

    @property
    def limit_v(self) -> float:
        """Phase voltage, peak, that the link gives [V]."""
        return self.operation.voltage_share * self.operation.vdc_v / math.sqrt(3.0)


def performance_of(sheet: Datasheet, operation: Operation | None) -> Performance:
    """The numbers of a datasheet at some conditions, blank where they cannot be known.

    Parameters
    ----------
    sheet : Datasheet
        Constants with their budgets.
    operation : Operation or None
        The conditions.

    Returns
    -------
    Performance
        Numbers and curves with 95 % intervals; nothing but the reasons where r_phase_ohm, ld_h,
        lq_h, psi_pm_wb or pole_pairs is not known.

    """
    return with_model(of_constants(sheet, operation), sheet)


def with_model(performance: Performance, sheet: Datasheet) -> Performance:
    """The numbers of a datasheet with its version and what the verdict on its model says of them.

    Parameters
    ----------
    performance
        The numbers of the constants alone, by `of_constants`.
    sheet
        Version, and the verdict on the model.

    """
    notes = (*performance.notes, *_note_of_model(sheet.model)) if performance.numbers else ()
    return replace(performance, version=sheet.version, notes=notes)


def of_constants(sheet: Datasheet, operation: Operation | None) -> Performance:
    """The numbers of a datasheet's constants, whatever the verdict on its model.

    Parameters
    ----------
    sheet
        Constants with their budgets.
    operation
        The conditions; None where there are none.

    """
    bare = Performance(sheet.motor_id, sheet.version, operation)
    if operation is None:
        return replace(bare, blanks=(NO_CONDITIONS,))
    sources = sources_of(_with_all_drag(sheet))
    if (blank := missing(sources, ELECTRICAL, "torque_speed", "torque against speed")) is not None:
        return replace(bare, blanks=(blank,))
    winding, magnet = np.array(operation.temp_winding_degc), np.array(operation.temp_magnet_degc)
    case = _Case(sources, operation, machine_at(sources, winding, magnet))
    stall = most_torque(case.machine, case.limit_a, case.limit_v, 0.0)
    if not np.isfinite(stall.torque_nm[0]):
        return replace(bare, blanks=(replace(NO_CONDITIONS, why="the link is below the drag"),))
    corner = _corner(case)
    speeds = np.linspace(0.0, _fastest(case, corner[0]), SPEEDS)
    peak = [most_torque(case.machine, case.limit_a, case.limit_v, w) for w in speeds]
    thermal, curves_s1, blanks = _thermal(case, speeds, corner[0], stall)
    drag = missing(sources, MECHANICAL, "no_load_speed_rad_s", "no-load speed and shaft torque")
    lacking = [] if drag is None else [drag]
    return replace(
        bare,
        numbers=(*_numbers(case, stall, corner), *thermal),
        curves=(*_curves(case, speeds, peak), *curves_s1, _torque_per_ampere(case)),
        cells=efficiency_map(
            case.machine,
            operation,
            case.limit_v,
            float(speeds[-1]),
            float(shaft_torque_nm(case.machine, stall, 0.0)[0]),
        ),
        regimes=tuple(
            regime_of(case.machine, p, operation.current_a, case.limit_v, float(w))
            for p, w in zip(peak, speeds, strict=True)
        ),
        blanks=(*lacking, *blanks, *losses_not_known(operation)),
        notes=_notes(sheet.constants, sources, operation, speeds),
    )


def _corner(case: _Case) -> Array:
    """The speed [n, rad/s] up to which the stall current fits the voltage: a root by bisection."""
    point = most_torque(case.machine, case.limit_a, math.inf, 0.0)
    return _speed_at(case, point.id_a, point.iq_a)


def _speed_at(case: _Case, id_a: Array, iq_a: Array) -> Array:
    """The speed [n, rad/s] at which currents [n, A] take the whole voltage; 0 where none does."""
    low, high = np.zeros(case.sources.size), np.full(case.sources.size, 1e6)
    for _ in range(70):
        middle = 0.5 * (low + high)
        volts = voltage_v(case.machine, id_a, iq_a, middle)
        low, high = (
            np.where(volts < case.limit_v, middle, low),
            np.where(volts < case.limit_v, high, middle),
        )
    return low


def _fastest(case: _Case, corner: float) -> float:
    """The speed [rad/s] at which the shaft torque ends, `FASTEST` corner speeds at most."""
    one = case.machine.one(0)
    limit = case.limit_a[:1]
    low, high = corner, FASTEST * max(corner, 1e-3)
    if shaft_torque_nm(one, most_torque(one, limit, case.limit_v, high), high)[0] > 0.0:
        return high
    for _ in range(30):
        middle = 0.5 * (low + high)
        left = shaft_torque_nm(one, most_torque(one, limit, case.limit_v, middle), middle)[0]
        low, high = (middle, high) if left > 0.0 else (low, middle)
    return low


def _no_load(case: _Case) -> tuple[Array, Array]:
    """Speed [n, rad/s] and q current [n, A] without load, at i_d = 0 and the whole voltage."""
    machine = case.machine
    current = np.zeros(case.sources.size)
    speed = _speed_at(case, current, current)
    for _ in range(4):
        drag = machine.coulomb_nm + machine.viscous_nm_s_rad * speed
        current = drag / (1.5 * machine.pole_pairs * machine.psi_wb)
        speed = _speed_at(case, np.zeros_like(current), current)
    return speed, current


def _derived(
    name: str, words: str, unit: str, draws: Array, formula: str, convention: str = ""
) -> Derived:
    return Derived(name, words, unit, *interval(draws), formula, convention)


def _numbers(case: _Case, stall: Point, corner: Array) -> list[Derived]:
    """The numbers that need no thermal model."""
    machine = case.machine
    torque = shaft_torque_nm(machine, stall, 0.0)
    at = most_torque(machine, case.limit_a, case.limit_v, float(corner[0]))
    corner_torque = shaft_torque_nm(machine, at, float(corner[0]))
    numbers = [
        _derived(
            "torque_peak_nm", "peak torque, at standstill", "N·m", torque,
            "1.5 p (ψ i_q + (L_d − L_q) i_d i_q) − T_c at MTPA and the current limit",
        ),
        _derived(
            "current_stall_a", "stall current, phase peak", "A",
            np.hypot(stall.id_a, stall.iq_a), "the current limit, or V/R where that is less",
        ),
        _derived(
            "omega_corner_rad_s", "corner speed: peak torque ends", "rad/s", corner,
            "|v(i_MTPA, ω)| = share · V_dc/√3",
        ),
        _derived(
            "power_corner_w", "shaft power at the corner speed", "W",
            corner_torque * float(corner[0]), "T ω",
        ),
    ]  # fmt: skip
    return numbers + (_without_load(case) if case.sources.has(*MECHANICAL) else [])


def _without_load(case: _Case) -> list[Derived]:
    """Speed, current and loss of a motor that drives nothing."""
    machine, (speed, current) = case.machine, _no_load(case)
    words = "IEEE Std 1812-2014, no-load test"
    return [
        _derived(
            "omega_no_load_rad_s", "no-load speed without field weakening", "rad/s", speed,
            "|v(0, i_q, ω)| = share · V_dc/√3 with 1.5 p ψ i_q = T_c + B ω", words,
        ),
        _derived(
            "current_no_load_a", "no-load current, phase peak", "A", current,
            "(T_c + B ω)/(1.5 p ψ)", words,
        ),
        _derived(
            "loss_no_load_w", "no-load loss: friction, windage and iron", "W",
            (machine.coulomb_nm + machine.viscous_nm_s_rad * speed) * speed,
            "(T_c + B ω) ω at no-load speed", "IEC 60034-2-1, no-load and retardation tests",
        ),
    ]  # fmt: skip


def _thermal(
    case: _Case, speeds: Array, corner: float, stall: Point
) -> tuple[list[Derived], list[Curve], list[Blank]]:
    """Continuous torque over speed, and how long the peak may last."""
    heat = heat_of(case.sources)
    blank = missing(
        case.sources,
        ("rth_winding_k_w",),
        "torque_continuous_nm",
        "continuous torque, and how long peak torque may last",
    )
    if heat is None or blank is not None:
        return [], [], [] if blank is None else [blank]
    op = case.operation
    magnet = uniform_draws("magnet", op.temp_ambient_degc, op.temp_limit_degc)
    machine = machine_at(case.sources, np.array(op.temp_limit_degc), magnet)
    share = uniform_draws("drag heat", 0.0, 1.0)

    def torque(omega: float) -> Array:
        other = share * drag_nm(machine, np.array(omega)) * omega
        rise = op.temp_limit_degc - op.temp_ambient_degc
        limit = continuous_current_a(heat.rth_k_w, machine.r_ohm, rise, other)
        point = most_torque(machine, np.minimum(limit, op.current_a), case.limit_v, omega)
        return shaft_torque_nm(machine, point, omega)

    conditions = "at the winding's limit; the magnet between ambient and that"
    numbers = [
        _derived(
            "torque_continuous_stall_nm", "continuous stall torque", "N·m", torque(0.0),
            "MTPA at I = √(ΔT/(1.5 R R_th))", f"{S1}, {conditions}",
        ),
        _derived(
            "torque_continuous_nm", "continuous torque at the corner speed", "N·m", torque(corner),
            "MTPA at I = √((ΔT/R_th − s P_drag)/(1.5 R)), s from 0 to 1", f"{S1}, {conditions}",
        ),
    ]  # fmt: skip
    lasting, blanks = _times(case, heat, stall)
    curve = _curve(
        "torque_continuous", "continuous torque (S1)", speeds, [torque(w) for w in speeds]
    )
    return [*numbers, *lasting], [curve], blanks


def _times(case: _Case, heat: Heat, stall: Point) -> tuple[list[Derived], list[Blank]]:
    """Thermal time constants, and the time that the winding takes to its limit at peak torque."""
    op, d = case.operation, case.sources.draws
    ambient = op.temp_ambient_degc - REFERENCE_DEGC
    r_ohm = d["r_phase_ohm"] * (1.0 + d[COPPER] * ambient)
    loss = 1.5 * r_ohm * (stall.id_a**2 + stall.iq_a**2)
    growth = d[COPPER] / (1.0 + d[COPPER] * ambient)
    time = time_to_limit_s(heat, loss, growth, op.temp_limit_degc - op.temp_ambient_degc)
    numbers = [
        _derived(
            name, words, "s", d[name], "from the heat run's network of two nodes"
        )
        for name, words in (
            ("tau_thermal_winding_s", "thermal time constant of the winding"),
            ("tau_thermal_body_s", "thermal time constant of the body"),
        )
        if name in d
    ]  # fmt: skip
    if np.isfinite(time[0]) and np.all(np.isfinite(np.percentile(time[1:], [2.5, 97.5]))):
        numbers.append(
            _derived(
                "time_peak_s", "time at peak torque until the limit", "s", time,
                "step response of the network with R(T)", S2,
            )
        )  # fmt: skip
        return numbers, []
    why = "the current limit never heats the winding to its limit: peak torque is continuous"
    return numbers, [Blank("time_peak_s", "time at peak torque", why, "operate.current_a= higher")]


def _curve(
    name: str, words: str, speeds: Array, draws: Sequence[Array], unit: str = "N·m"
) -> Curve:
    value, low, high = zip(*(interval(one) for one in draws), strict=True)
    x = tuple(float(w) for w in speeds)
    return Curve(name, words, unit, "omega_mech_rad_s", x, value, low, high)


def _curves(case: _Case, speeds: Array, peak: Sequence[Point]) -> list[Curve]:
    """Peak torque, shaft power, current and efficiency over speed."""
    machine = case.machine
    shaft = [shaft_torque_nm(machine, p, w) for p, w in zip(peak, speeds, strict=True)]
    power = [t * w for t, w in zip(shaft, speeds, strict=True)]
    current = [np.nan_to_num(np.hypot(p.id_a, p.iq_a)) for p in peak]
    return [
        _curve("torque_peak", "peak torque", speeds, shaft),
        _curve("power_peak", "shaft power at peak torque", speeds, power, "W"),
        _curve("current_peak", "phase current at peak torque", speeds, current, "A"),
    ]


def _torque_per_ampere(case: _Case) -> Curve:
    """Torque per phase ampere, peak, at the best angle, over the current."""
    currents = np.linspace(0.0, case.operation.current_a, CURRENTS)[1:]
    per_ampere = []
    for limit in currents:
        limits = np.full(case.sources.size, limit)
        per_ampere.append(most_torque(case.machine, limits, math.inf, 0.0).torque_nm / limit)
    value, low, high = zip(*(interval(one) for one in per_ampere), strict=True)
    return Curve(
        "kt_peak", "air-gap torque per phase ampere, peak, at MTPA", "N·m/A", "i_a",
        tuple(float(i) for i in currents), value, low, high,
    )  # fmt: skip


def _notes(
    constants: Mapping[str, Estimate], sources: Sources, operation: Operation, speeds: Array
) -> tuple[str, ...]:
    """What the numbers rest on beyond the constants."""
    notes = [f"{text[0].upper()}{text[1:]}" for text in sources.assumed]
    fastest = _at(sources.known, MECHANICAL[0], "omega_mech_rad_s")
    if fastest is not None and speeds[-1] > 1.02 * fastest:
        notes.append(f"Drag was measured up to {fastest:.4g} rad/s and is extrapolated beyond")
    tested = _at(constants, "kt_peak_nm_a", "iq_a")
    if tested is not None and operation.current_a > 1.1 * tested:
        notes.append(f"Torque was measured up to {tested:.3g} A and is extrapolated beyond")
    return tuple(notes)


def _note_of_model(model: ModelVerdict | None) -> tuple[str, ...]:
    """What the verdict on the model says of the numbers."""
    lacking = [] if model is None else [n for n in model.missing if n not in model.in_friction]
    if lacking:
        names = " and ".join(name.replace("_", " ") for name in lacking)
        return (f"The model lacks {names}, which is not in these numbers",)
    if model is None or not model.passed:
        return ("The model was not shown to explain the captures: the intervals hold if it does",)
    return ()


def _with_all_drag(sheet: Datasheet) -> Mapping[str, Estimate]:
    """The constants, with iron loss that is known in friction again: all of it brakes."""
    return sheet.constants if sheet.model is None else combined(sheet.constants, sheet.model)


def _at(constants: Mapping[str, Estimate], name: str, condition: str) -> float | None:
    """A condition that a constant was measured at."""
    one = constants.get(name)
    value = None if one is None else one.at.get(condition)
    return abs(float(value)) if isinstance(value, (int, float)) else None
