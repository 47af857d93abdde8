"""Pole pairs of a log: turns of its electrical angle, or voltage, for a turn of the shaft."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.turning_voltage import Complex, speed_of, turning_voltage
from pipeline.physics.frames import vector_of_lines, vector_of_phases
from pipeline.physics.pole_pairs import POLE_PAIRS_TOLERANCE, pole_pairs_from
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants

METHOD = Method("electrical_turns")
SHAFT, ANGLE = "theta_mech_rad", "theta_elec_rad"
PHASES, LINES = ("va_v", "vb_v", "vc_v"), ("vab_v", "vbc_v", "vca_v")
LEAST_ROWS = 100
EXPERIMENT = (
    "record a drive with theta_mech_rad and theta_elec_rad, or with theta_mech_rad and voltages of "
    "two phases, over some turns of the shaft"
)


class Turns(NamedTuple):
    """Turns for a turn of the shaft in a capture; what is not there is None.

    Attributes
    ----------
    capture
        Where they are from.
    slope, u_slope
        Of the electrical angle over the shaft's, and its standard uncertainty [1].
    apart_rad
        What the angles are apart beside the slope, rms.
    voltage
        Of the voltage.

    """

    capture: Capture
    slope: float | None
    u_slope: float
    apart_rad: float
    voltage: int | None


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """The number that every capture with both angles, or an angle and a stator's voltage, counts.

    Notes
    -----
    θ_e = p θ_m + θ_0, by least squares with the correlation of what is left; the slope has to be a
    whole number within `POLE_PAIRS_TOLERANCE`, known to that, over a turn at least. A drive may
    have computed θ_e from θ_m, or θ_m from θ_e, with the number it was set to. The voltage is the
    motor's: v = jω p ψ e^{jpθ_m} turns p times a turn of a shaft that has a sensor of its own.

    """
    looked = [turns_of(c) for c in campaign.of(*ESTIMATOR.tests) if c.has("t_s", SHAFT)]
    seen = [t for t in looked if t is not None and (t.slope is not None or t.voltage is not None)]
    if not seen:
        return METHOD.nothing(("pole_pairs",), EXPERIMENT)
    doubt = next((words for t in seen if (words := _doubt(t))), "")
    counts = {n for t in seen for n in _counts(t)}
    if doubt or len(counts) != 1:
        listed = ", ".join(str(n) for n in sorted(counts))
        return METHOD.nothing(
            ("pole_pairs",), doubt or f"captures count {listed} a turn of {SHAFT}"
        )
    paths = [t.capture.path for t in seen]
    number = counts.pop()
    return Fit((METHOD.measured("pole_pairs", number, captures=paths, notes=_words(seen)),))


def turns_of(capture: Capture) -> Turns | None:
    """How often a capture's electrical angle and voltage turn for a turn of its shaft.

    Parameters
    ----------
    capture
        With the shaft's angle.

    Returns
    -------
    Turns or None
        None where the shaft does not pass a turn.

    """
    columns = [c for c in (*PHASES, *LINES, "vd_v", "vq_v", ANGLE) if capture.has(c)]
    data = capture.finite("t_s", SHAFT, *columns)
    theta = data[SHAFT]
    if theta.size < LEAST_ROWS or np.ptp(theta) < TURN_RAD:
        return None
    slope, u_slope, apart = _slope(data) if ANGLE in data else (None, math.inf, math.inf)
    volts, voltage = _stator_voltage(data), None
    if volts is not None:
        voltage = turning_voltage(volts, theta, speed_of(data["t_s"], theta))
    return Turns(capture, slope, u_slope, apart, voltage)


def _slope(data: Mapping[str, Array]) -> tuple[float, float, float]:
    """Slope of the electrical angle on the shaft's, its standard uncertainty, and what is left."""
    theta = data[SHAFT]
    line = linear_fit(np.column_stack([theta, np.ones(theta.size)]), data[ANGLE])
    alike = autocorrelation_time(line.residuals)
    left = float(np.sqrt(np.mean(line.residuals**2)))
    return float(line.coefficients[0]), line.u(0) * math.sqrt(alike), left


def _stator_voltage(data: Mapping[str, Array]) -> Complex | None:
    """Voltage in the stator's frame: of phases, of lines, or of the rotor's frame turned back."""
    for names, vector_of in ((PHASES, vector_of_phases), (LINES, vector_of_lines)):
        columns = {name: data[name] for name in names if name in data}
        if len(columns) > 1:
            return vector_of(columns)
    if {"vd_v", "vq_v", ANGLE} <= set(data):
        return (data["vd_v"] + 1j * data["vq_v"]) * np.exp(1j * data[ANGLE])
    return None


def _counts(turns: Turns) -> set[int]:
    """The whole numbers that a capture counts; none where a slope is not whole."""
    by_angle = None if turns.slope is None else pole_pairs_from(turns.slope, 1.0).number
    return {n for n in (by_angle, turns.voltage) if n is not None}


def _doubt(turns: Turns) -> str:
    """Why a capture's count is not to be relied on; empty where it is."""
    path, slope, u = turns.capture.path, turns.slope, turns.u_slope
    if turns.voltage is not None and turns.voltage < 0:
        return f"{path}: the voltage turns against {SHAFT}: exchange two phases, or its sign"
    if slope is None:
        return ""
    words = f"{path}: {ANGLE} turns {slope:.4f} ± {u:.1g} times a turn of {SHAFT}"
    number = pole_pairs_from(slope, 1.0).number
    may_be = slope > 0.0 and abs(slope - max(round(slope), 1)) <= POLE_PAIRS_TOLERANCE + 2.0 * u
    if may_be and (u > POLE_PAIRS_TOLERANCE or number is None):
        return f"{words}, too rough a count: record more turns, or look for slips of an angle"
    if not may_be:
        return f"{words}, no whole number above 0: look for a gear, a slip, a sign or a unit"
    if turns.voltage not in (None, number):
        return (
            f"{words}, and the voltage {turns.voltage} times: the drive reckons with another "
            "number than the motor's, or the angle is of another shaft"
        )
    return ""


def _words(seen: Sequence[Turns]) -> str:
    """On what a count rests."""
    words, angles = [], [t for t in seen if t.slope is not None]
    by_voltage = any(t.voltage is not None for t in seen)
    if angles:
        worst = max(angles, key=lambda t: t.u_slope)
        slope = f"{worst.slope:.5f} ± {worst.u_slope:.1g}"
        words.append(f"{ANGLE} turns {slope} times a turn of {SHAFT}")
    if by_voltage:
        alone = f"the voltage turns so often a turn of {SHAFT}"
        words.append("so does the voltage" if angles else alone)
    else:
        words.append(
            "no voltage in the stator's frame shows that the magnet does so too: of an angle that "
            "the drive computes, this is the number that it was set to"
        )
    if any(t.apart_rad < policy().pole_pairs.one_reading_rad for t in angles):
        words.append(
            f"the two angles are one reading: where {SHAFT} was made of the electrical one, the "
            "count is the number that the drive was set to"
        )
    return "; ".join(words)


ESTIMATOR = Estimator(
    METHOD.name,
    ("pole_pairs",),
    ("drive", "torque_map", "heat_run", "spin_down"),
    EXPERIMENT,
    fit,
    rank=2,
)
