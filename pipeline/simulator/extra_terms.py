"""Terms outside the library of effects, in torque or voltage: tables over a variable, compiled."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.simulator.field import Array, Pair
from pipeline.simulator.plant import Plant

TURN = 2.0 * math.pi
Arrays = tuple[Array, Array]


@njit(cache=True)
def lookup(x: float, xs: Array, ys: Array, n: int) -> float:
    """A table read along straight lines, constant outside.

    Parameters
    ----------
    x
        Where.
    xs, ys
        The table, `xs` rising; longer than `n` perhaps.
    n
        How many of its points count.

    Returns
    -------
    float
        In the unit of `ys`.

    """
    if x <= xs[0]:
        return float(ys[0])
    if x >= xs[n - 1]:
        return float(ys[n - 1])
    low, high = 0, n - 1
    while high - low > 1:
        middle = (low + high) // 2
        if xs[middle] <= x:
            low = middle
        else:
            high = middle
    share = (x - xs[low]) / (xs[high] - xs[low])
    return float(ys[low] + share * (ys[high] - ys[low]))


@njit(cache=True)
def variable(code: int, motion: Pair, amps: Pair, warm: Pair, p: Plant) -> float:
    """The value of one of `design.EXTRA_VARIABLES`.

    Parameters
    ----------
    code
        Number of the variable.
    motion
        Mechanical angle [rad] and speed [rad/s].
    amps
        Current along d and q [A].
    warm
        Temperatures of winding and magnets [degC].
    p
        The motor in numbers.

    """
    values = (
        1.0,
        motion[1],
        motion[0] % TURN,
        (p.pole_pairs * motion[0]) % TURN,
        amps[0],
        amps[1],
        math.hypot(amps[0], amps[1]),
        warm[0],
        warm[1],
    )
    return float(values[code])


@njit(cache=True)
def extra(signal: int, motion: Pair, amps: Pair, warm: Pair, p: Plant) -> float:
    """Sum of the extra terms that enter one signal.

    Parameters
    ----------
    signal
        Number of the signal.
    motion
        Mechanical angle [rad] and speed [rad/s].
    amps
        Current along d and q [A].
    warm
        Temperatures of winding and magnets [degC].
    p
        The motor in numbers.

    """
    total = 0.0
    for k in range(p.extras):
        if p.extra_signal[k] == signal:
            x = variable(p.extra_variable[k], motion, amps, warm, p)
            times = variable(p.extra_times[k], motion, amps, warm, p)
            total += times * lookup(x, p.extra_x[k], p.extra_y[k], p.extra_points[k])
    return total


@njit(cache=True)
def extra_volts(motion: Arrays, amps: Arrays, warm: Arrays, p: Plant) -> Array:
    """Extra voltages along d and q [n, 2] that the terminals see on top.

    Parameters
    ----------
    motion
        Mechanical angle [n, rad] and speed [n, rad/s].
    amps
        Current along d and q, each [n, A].
    warm
        Temperatures of winding and magnets, each [n, degC].
    p
        The motor in numbers.

    """
    volts = np.empty((motion[0].size, 2))
    for k in range(volts.shape[0]):
        for axis in range(2):
            moved, flows = (motion[0][k], motion[1][k]), (amps[0][k], amps[1][k])
            volts[k, axis] = extra(1 + axis, moved, flows, (warm[0][k], warm[1][k]), p)
    return volts
