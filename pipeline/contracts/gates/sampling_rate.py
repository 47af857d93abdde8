"""A rate too low for what the test is to show."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES, PHASE_VOLTAGES
from pipeline.contracts.rotation import turning
from pipeline.contracts.waveform import noise_of, samples_per_time_constant
from pipeline.physics.mechanics import cogging_order
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "sampling_rate"
REMEDY = "record again at a higher rate"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Samples per time constant, electrical period or cogging period, whichever the test has.

    Notes
    -----
    Options end in `_refuse` and `_warn`: the least, and what would be good [samples]. Current step:
    in one electrical time constant (`samples_per_time_constant`), where the trapezoid on an
    exponential is off by (Δt/τ)²/12. Open circuit: in the shortest electrical period, from the
    back-EMF and from nameplate and speed. Cogging: in a period of LCM(slots, 2p) a turn. Torque map
    and drive warn alone.

    """
    return LOOKS[capture.meta.test](capture, options)


def _judge(capture: Capture, samples: float, refuse: float, warn: float, per: str) -> Passed:
    words = f"{samples:.3g} samples {per}"
    if samples < refuse:
        raise CaptureError(CODE, f"{words}, where {refuse:g} is the least", REMEDY)
    if samples < warn:
        too_few = f"{words}, where {warn:g} would be good"
        return Passed(findings=(warning(capture, CODE, too_few, REMEDY),))
    return Passed()


def _step(capture: Capture, options: Mapping[str, float]) -> Passed:
    samples = math.inf
    for name in (n for n in LINE_CURRENTS if capture.has(n)):
        current = capture.finite(name)[name]
        if current.size and np.ptp(current) > 20.0 * noise_of(current):
            samples = min(samples, samples_per_time_constant(current))
    least, good = options["step_refuse"], options["step_warn"]
    if samples == 0.0:
        words = "no sample falls on the way of the current from one level to the next, where"
        raise CaptureError(
            CODE, f"{words} {least:g} in an electrical time constant are the least", REMEDY
        )
    return _judge(capture, samples, least, good, "in an electrical time constant")


def _spin(capture: Capture, options: Mapping[str, float]) -> Passed:
    turned, usual_s, stated = turning(capture), _interval_s(capture), capture.meta.pole_pairs
    top_hz = 0.0 if turned is None else turned.top_hz
    if stated is not None:
        top_hz = max(top_hz, stated * _top_speed_rad_s(capture) / TURN_RAD)
    if top_hz == 0.0:
        return Passed()
    samples = 1.0 / (top_hz * usual_s)
    least, good = options["period_refuse"], options["period_warn"]
    return _judge(capture, samples, least, good, "in the shortest electrical period")


def _rotor_frame(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Of readings of an instant: means in the rotor's frame alias nothing, however long."""
    stated, top = capture.meta.pole_pairs, _top_speed_rad_s(capture)
    instant = capture.meta.voltage_timing == "instant"
    if stated is None or top == 0.0 or not capture.has("vq_v") or not instant:
        return Passed()
    samples = TURN_RAD / (stated * top * _interval_s(capture))
    return _judge(capture, samples, 0.0, options["frame_warn"], "in the shortest electrical period")


def _slow_turn(capture: Capture, options: Mapping[str, float]) -> Passed:
    pole_pairs, slots = capture.meta.pole_pairs, capture.meta.slots
    angle = capture.finite("theta_mech_rad")["theta_mech_rad"]
    travel = float(np.abs(np.diff(angle)).sum())
    if pole_pairs is None or slots is None or travel == 0.0:
        return Passed()
    order = cogging_order(slots, pole_pairs)
    samples = angle.size * TURN_RAD / (np.ptp(angle) * order) if np.ptp(angle) else math.inf
    least, good = options["cogging_refuse"], options["cogging_warn"]
    return _judge(capture, samples, least, good, f"in a cogging period (order {order})")


def _interval_s(capture: Capture) -> float:
    return max(
        float(np.median(np.diff(table["t_s"].to_numpy())))
        for table in capture.tables
        if {*LINE_VOLTAGES, *PHASE_VOLTAGES, "vq_v"} & set(table.columns) and table.height > 1
    )


def _top_speed_rad_s(capture: Capture) -> float:
    for table in capture.tables:
        if "omega_mech_rad_s" in table.columns:
            speed = np.abs(table["omega_mech_rad_s"].to_numpy())
            return float(np.nanpercentile(speed, 99.0)) if np.isfinite(speed).any() else 0.0
    return 0.0


LOOKS: dict[str, Callable[[Capture, Mapping[str, float]], Passed]] = {
    "current_step": _step,
    "open_circuit": _spin,
    "torque_map": _rotor_frame,
    "drive": _rotor_frame,
    "cogging": _slow_turn,
}

GATE = Gate(
    CODE,
    tuple(LOOKS),
    check,
    {
        # The trapezoid rule on an exponential is off by (dt/tau)²/12: 2 % at 2, 0.1 % at 10.
        "step_refuse": 2.0,
        "step_warn": 10.0,
        # Nyquist asks for more than 2; from 5 on the fundamental and its double stand apart.
        "period_refuse": 2.5,
        "period_warn": 5.0,
        # Below two, what depends on the electrical angle is aliased.
        "frame_warn": 2.0,
        # Nyquist again; 8 leaves the amplitude of the leading order to within its noise.
        "cogging_refuse": 2.5,
        "cogging_warn": 8.0,
    },
)
