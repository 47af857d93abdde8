"""What the sensors inside the control loop report, compiled."""

from __future__ import annotations

import math

from numba import njit

from pipeline.simulator.control import Control
from pipeline.simulator.field import SQRT3, Array, Pair

HISTORY = 256
"""Integration steps that the ring buffer of currents holds."""


@njit(cache=True)
def rounded(value: float, lsb: float) -> float:
    """Nearest multiple of lsb, or the value itself where lsb is 0.

    Parameters
    ----------
    value
        The value.
    lsb
        Resolution [unit of the value].

    """
    return float(math.floor(value / lsb + 0.5) * lsb) if lsb > 0.0 else value


@njit(cache=True)
def sensed_current(true: Pair, noise: Array, c: Control) -> Pair:
    """What three phase-current sensors report, as alpha and beta [A].

    Parameters
    ----------
    true
        True currents in alpha and beta [A].
    noise
        Noise of each sensor [A].
    c
        The drive and its sensors.

    """
    i_a = c.gain_a * true[0] + c.offset_a + noise[0]
    i_b = c.gain_b * (-0.5 * true[0] + 0.5 * SQRT3 * true[1]) + c.offset_b + noise[1]
    i_c = c.gain_c * (-0.5 * true[0] - 0.5 * SQRT3 * true[1]) + c.offset_c + noise[2]
    i_a, i_b, i_c = (
        rounded(i_a, c.lsb_current),
        rounded(i_b, c.lsb_current),
        rounded(i_c, c.lsb_current),
    )
    return (2.0 * i_a - i_b - i_c) / 3.0, (i_b - i_c) / SQRT3


@njit(cache=True)
def sensed_angle(theta: float, noise: float, c: Control) -> float:
    """What the encoder reports: offset, eccentricity, noise, resolution [rad].

    Parameters
    ----------
    theta
        Mechanical angle [rad].
    noise
        Noise of the encoder [rad].
    c
        The drive and its sensors.

    """
    wobble = c.angle_wobble * math.sin(c.angle_wobble_order * theta + c.angle_wobble_phase)
    return rounded(theta + c.angle_offset + wobble + noise, c.lsb_angle)


@njit(cache=True)
def remembered(history: Array, newest: int, back: float) -> Pair:
    """Currents `back` integration steps ago, linear between steps, from a ring buffer.

    Parameters
    ----------
    history
        Ring buffer of currents in alpha and beta [k, 2, A].
    newest
        Place of the newest currents in `history`.
    back
        Integration steps back.

    """
    whole = int(back)
    part = back - whole
    one, two = (newest - whole) % HISTORY, (newest - whole - 1) % HISTORY
    return (
        (1.0 - part) * history[one, 0] + part * history[two, 0],
        (1.0 - part) * history[one, 1] + part * history[two, 1],
    )
