"""A speed that is not the angle's derivative: wrong units, a gear, or electrical for mechanical."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.waveform import Array, noise_of
from pipeline.numerics.integrals import longest_step_s, trapezoid
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "speed_against_angle"
BLOCKS = 20
REST_SHARE = 0.25
"""Least share of a resting speed's power that is white noise; the rest is an offset."""
SUSPECTS = {
    9.5493: "the speed is in rpm",
    0.10472: "the angle is in rpm·s, or the speed was converted twice",
    57.296: "the speed is in degrees a second",
    0.017453: "the angle is in degrees",
    TURN_RAD: "the angle is in turns",
    1.0 / TURN_RAD: "the speed is in turns a second",
    1000.0: "the clock t_s is in ms, or the speed in mrad/s",
    1e6: "the clock t_s is in µs",
    -1.0: "one of them has its sign turned",
}


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Warns of a speed some percent off the angle's rate; refuses one that is another quantity.

    Notes
    -----
    The ratio of `speed_over_angle` off 1 by more than `warn` [1] and twice its standard uncertainty
    warns, by more than `refuse` [1] refuses, with the unit or count that it lands on within 2 %.

    """
    ratio_and_u = speed_over_angle(capture, options["turns"])
    if ratio_and_u is None:
        return Passed()
    ratio, u = ratio_and_u
    off = abs(ratio - 1.0)
    if off <= options["refuse"] and off - 2.0 * u <= options["warn"]:
        return Passed()
    if ratio == 0.0 or math.isinf(ratio):
        raise CaptureError(CODE, *_standing(ratio))
    words = f"omega_mech_rad_s is {ratio:.4g} times the rate of theta_mech_rad"
    suspect = _suspect(ratio, capture.meta.pole_pairs)
    words += f": {suspect}" if suspect else ""
    remedy = "map the unit or sign in conf/source"
    if off > options["refuse"]:
        raise CaptureError(CODE, words, remedy)
    return Passed(findings=(warning(capture, CODE, words, "the angle is used; " + remedy),))


def _standing(ratio: float) -> tuple[str, str]:
    """What is wrong and what to do where one of the two stands still."""
    still, moving = ("omega_mech_rad_s", "theta_mech_rad")
    if ratio != 0.0:
        still, moving = moving, still
    words = f"{still} says that the shaft stands while {moving} says that it turns"
    return words, "check the sensor that stands still and its lead, and record again"


def speed_over_angle(capture: Capture, turns: float) -> tuple[float, float] | None:
    """Integrated speed over angle, from block increments, and its standard uncertainty.

    Parameters
    ----------
    capture
        With time, angle and speed.
    turns
        Least travel, forth and back added up, by angle or by integrated speed [turns].

    Returns
    -------
    tuple of float or None
        [1, 1]; 0 where the speed stands still while the angle moves, infinite where the angle does.
        None where a column is missing or the shaft hardly turns.

    Notes
    -----
    r = Σ Δθ Δ∫ω dt/Σ Δθ² over `BLOCKS` blocks, and its uncertainty is that of a slope: a shaft that
    swings as fast as blocks follow each other scatters about it where its speed is filtered. A
    shaft rests where its angle passes less than `turns` and its speed is noise: integrated, the
    noise makes turns that are no sign of a wrong sign.

    """
    for table in capture.tables:
        if not {"t_s", "theta_mech_rad", "omega_mech_rad_s"} <= set(table.columns):
            continue
        rows = table.select("t_s", "theta_mech_rad", "omega_mech_rad_s").to_numpy()
        rows = rows[np.isfinite(rows).all(axis=1)]
        if rows.shape[0] < 2 * BLOCKS:
            continue
        edges = np.linspace(0, rows.shape[0] - 1, BLOCKS + 1).astype(int)
        t_s, theta = _without_pauses(rows[:, 0], rows[:, 1], capture.meta.pause_s)
        by_angle = np.diff(theta[edges])
        by_speed = np.diff(trapezoid(t_s, rows[:, 2])[edges])
        if max(np.abs(by_angle).sum(), np.abs(by_speed).sum()) < turns * TURN_RAD:
            continue
        if np.abs(by_angle).sum() < turns * TURN_RAD and is_noise(rows[:, 2]):
            continue
        if not np.any(by_angle):
            return math.inf, 0.0
        power = by_angle @ by_angle
        ratio = float(by_angle @ by_speed / power)
        residuals = by_speed - ratio * by_angle
        return ratio, math.sqrt(float(residuals @ residuals / (BLOCKS - 1) / power))
    return None


def _without_pauses(t_s: Array, theta: Array, pause_s: float | None) -> tuple[Array, Array]:
    """Time and angle [n] that stand still while the recorder paused."""
    on = np.diff(t_s) <= longest_step_s(t_s, pause_s)
    steps = (np.concatenate([[0.0], np.cumsum(np.diff(one) * on)]) for one in (t_s, theta))
    closed_s, closed = steps
    return closed_s, closed


def is_noise(speed_rad_s: Array) -> bool:
    """Whether a speed [n] is that of a shaft at rest: white noise, with no motion in it."""
    power = float(np.mean(speed_rad_s**2))
    return noise_of(speed_rad_s) ** 2 > REST_SHARE * power


def _suspect(ratio: float, pole_pairs: int | None) -> str:
    known = dict(SUSPECTS)
    if pole_pairs and pole_pairs > 1:
        known[float(pole_pairs)] = "the speed is electrical"
        known[1.0 / pole_pairs] = "the angle is electrical"
    matching = (words for number, words in known.items() if abs(ratio / number - 1.0) < 0.02)
    return next(matching, "")


GATE = Gate(
    CODE,
    ("open_circuit", "hand_turn", "cogging", "torque_map", "spin_down", "heat_run", "drive"),
    check,
    {
        # Below a turn, eccentricity of the angle sensor is a large part of the angle.
        "turns": 1.0,
        # Lag and smoothing of a speed average out over blocks; a scale error does not.
        "warn": 0.03,
        # Nearer to 1 than this lies no unit, gear or pole count.
        "refuse": 0.2,
    },
    follows=("clock_jump", "stuck_channel", "wrapped_angle"),
)
