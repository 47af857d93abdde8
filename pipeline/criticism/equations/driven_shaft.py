"""A shaft that a recorded voltage drives, without a current on record: SysId logs of robots."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.criticism.data.drive_log import drive_log, in_time
from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.data.segment import Segment, segment_of
from pipeline.criticism.data.settling import unexplained_voltage
from pipeline.criticism.data.traces import smoothed, window_between_gaps
from pipeline.criticism.equation import Channel, Equation, NamedCombination, Observes, Sensing, Use
from pipeline.criticism.machine.model import (
    ELECTRICAL,
    LATE_VOLTAGE,
    STATE,
    Model,
    Pieces,
    evaluate,
    lead_ohm,
)
from pipeline.criticism.operating import Array, Operating, Signals, Values, between
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import second_difference
from pipeline.criticism.signals.true_state import at_true_angle, motion_of, operating
from pipeline.criticism.signals.voltage import recorded_voltage
from pipeline.numerics.projection import projection, window_starts
from pipeline.records.capture import Capture

VOLTAGE, RECORDER = "vq_v", "log"


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Voltage and angle where the shaft certainly turns, and its voltage is on record.

    Parameters
    ----------
    capture
        A drive log without current and without a transducer.
    machine
        Policy.

    Returns
    -------
    Segment or None
        None where another equation takes the log, where the shaft does not turn, and where a
        torque that nothing recorded turns it.

    Notes
    -----
    A shaft that rests is held by any part of its friction. The voltage of each sample is the one of
    as many samples before as the motion follows late (`data.settling`); where that one is not on
    record, as behind a pause, the sample is left out.

    """
    if any(capture.has(name) for name in ("iq_a", "id_a", "torque_shaft_nm")):
        return None
    unexplained, log = unexplained_voltage(capture, machine.policy), drive_log(capture, machine)
    if log is None or (
        unexplained is not None and unexplained >= machine.policy.cutting.unexplained_share
    ):
        return None
    policy, columns = machine.policy, log.columns
    speed = np.gradient(columns["theta_mech_rad"], log.period_s)
    slowest = policy.cutting.slowest_share
    turns = np.abs(smoothed(speed, 5)) > slowest * machine.scales["speed_rad_s"]
    # a voltage that is taken as it was recorded some samples before
    shift = round(machine.scales.get("late_s", 0.0) / log.period_s)
    at = np.arange(log.keep.size) - shift
    columns[VOLTAGE] = columns[VOLTAGE][np.maximum(at, 0)]
    keep = log.keep & turns & (at >= 0) & log.keep[np.maximum(at, 0)]
    window = window_between_gaps(log.period_s, keep, policy.cutting)
    weak = projection(columns["theta_mech_rad"], window_starts(keep, window), window, ())
    return segment_of(
        capture,
        "driven",
        "drive",
        log.period_s,
        columns,
        log.sensors,
        channels=(VOLTAGE,),
        weak=weak,
        blocks=in_time(weak.starts + window // 2, keep.size),
        fixed={LATE_VOLTAGE: 1.0, ELECTRICAL: 1.0},
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """Angle and speed [n] of the shaft; its current follows from them (`predicted`)."""
    motion = motion_of(segment, signals, model.machine)
    none = np.zeros(motion.theta_rad.size, dtype=complex)
    x = operating(segment, signals, model, values, none, motion)
    return at_true_angle(segment, x.fed(q_alone=True, hold_s=0.0), model, values)


def measured(segment: Segment, signals: Signals, _: Model, values: Values) -> Array:
    """The voltage that drives each sample's motion [1, n], with what the delay is longer."""
    volts = signals[VOLTAGE]
    late = values[LATE_VOLTAGE] / segment.ts_s
    return between(volts, np.arange(volts.size, dtype=np.float64) - late)[None]


def predicted(segment: Segment, x: Operating, _: Pieces, model: Model, values: Values) -> Array:
    """The q voltage that the motion takes.

    Parameters
    ----------
    segment
        The log, on its true clock.
    x
        True state [n], without current.
    _
        Not needed.
    model, values
        Flux, drops and drags.

    Returns
    -------
    array [1, n]
        In V.

    Notes
    -----
    v_q = Im(R i + L di/dt + drops) + ω_e ψ_d with i_q = (J d²θ/dt² + drags)/(1.5 p ψ_d). Drops and
    drags are those of a current by the smoothed speed, for the second difference of an angle is
    mostly noise; R times the difference of both is linear and stays.

    """
    bend = second_difference(x.theta_rad, segment.ts_s)
    smooth = np.gradient(x.omega_rad_s, segment.ts_s)
    driven, pieces = x, evaluate(model, x, values)
    for _round in range(2):
        kt = 1.5 * x.machine.pole_pairs * pieces.psi_wb.real
        current = (values["j_kgm2"] * smooth + pieces.drag_nm) / kt
        driven = replace(x, iq_a=current, cache={})
        pieces = evaluate(model, driven, values)
    rough = (values["r_ohm"] + lead_ohm(x, values)) * values["j_kgm2"] / kt
    volts = pieces.drop_v + 1j * x.machine.pole_pairs * x.omega_rad_s * pieces.psi_wb.real
    volts = volts + 1j * (rough * (bend - smooth) + _across_l(segment, bend, model, values))
    return recorded_voltage(volts, segment, driven, model, values, in_frame=True).imag[None]


def _across_l(segment: Segment, bend: Array, model: Model, values: Values) -> Array:
    """Voltage of the inductance [n] as the acceleration changes, L J d³θ/dt³/(1.5 p ψ).

    With another delay and inertia it is nearly the same voltage, so L/R is a nuisance. R J/ψ is
    that of the machine's scales: so the term is linear, and what it goes with stays apart from it.
    """
    scales = base_scales(model.machine)
    kt = 1.5 * model.machine.pole_pairs * scales["psi_wb"]
    per_jerk = values[ELECTRICAL] * scales["r_ohm"] * scales["j_kgm2"] / kt
    return per_jerk * np.gradient(bend, segment.ts_s)


def _winding(segment: Segment, model: Model, values: Values) -> tuple[float, float]:
    """Resistance [ohm] and Ke [V·s/rad] as they were in a log.

    At 25 °C where the log has the temperatures, at those of the log where it has not.
    """
    warming = tuple(e for e in model.effects if any(n.startswith("temp_") for n in e.signals))
    x = state(segment, segment.recorded, model, values).one_sample()
    cold = np.zeros(1)
    winding_k = cold if "temp_winding_degc" in segment.recorded else x.winding_k
    magnet_k = cold if "temp_magnet_degc" in segment.recorded else x.magnet_k
    x = replace(x, iq_a=np.ones(1), winding_k=winding_k, magnet_k=magnet_k, cache={})
    pieces = evaluate(replace(model, effects=warming), x, values)
    r_ohm, psi_wb = float(pieces.drop_v.imag[0]), float(pieces.psi_wb.real[0])
    return r_ohm, model.machine.pole_pairs * psi_wb


def _ks(segment: Segment, model: Model, values: Values) -> float:
    r_ohm, ke = _winding(segment, model, values)
    return r_ohm * values.get("coulomb_friction.torque_nm", 0.0) / (1.5 * ke)


def _kv(segment: Segment, model: Model, values: Values) -> float:
    r_ohm, ke = _winding(segment, model, values)
    return ke + r_ohm * values["b_nm_s_rad"] / (1.5 * ke)


def _ka(segment: Segment, model: Model, values: Values) -> float:
    r_ohm, ke = _winding(segment, model, values)
    return r_ohm * values["j_kgm2"] / (1.5 * ke)


_DETERMINES = ("r_ohm", "lead_ohm", "psi_wb", "j_kgm2", "b_nm_s_rad")
_KT = "(1.5*pole_pairs*psi_wb)"
_OF = ("r_ohm", "psi_wb")
COMBINATIONS = (
    NamedCombination(
        f"ks_v = r_ohm*coulomb_friction.torque_nm/{_KT}",
        "V",
        (*_OF, "coulomb_friction.torque_nm"),
        _ks,
    ),
    NamedCombination(
        f"kv_v_s_rad = pole_pairs*psi_wb + r_ohm*b_nm_s_rad/{_KT}",
        "V·s/rad",
        (*_OF, "b_nm_s_rad"),
        _kv,
    ),
    NamedCombination(f"ka_v_s2_rad = r_ohm*j_kgm2/{_KT}", "V·s²/rad", (*_OF, "j_kgm2"), _ka),
)

EQUATION = Equation(
    name="driven",
    words="v_q = Im(R i + L di/dt + drops) + ω_e ψ_d, i_q = (J dω/dt + drags)/(1.5 p ψ_d)",
    tests=("drive",),
    columns=("t_s", VOLTAGE),
    channels=(Channel(VOLTAGE, "voltage_v"),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        (*_DETERMINES, LATE_VOLTAGE, ELECTRICAL, *STATE),
        hooks=frozenset({"flux", "drop", "torque"}),
        sensors=frozenset({"angle", "voltage", "clock"}),
        form="neither",
    ),
    recorder=RECORDER,
    sensing=Sensing(errors=frozenset({"voltage_jumps"})),
    use=Use(
        turns=True,
        warms=frozenset({"drop", "flux"}),
        combinations=COMBINATIONS,
    ),
)
