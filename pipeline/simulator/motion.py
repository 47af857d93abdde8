"""Motion of the motor, compiled: torque on the rotor, coupling, coasting and slow turns.

Terms outside the library of effects, in torque or voltage, are tables over a variable (`extra`).
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.simulator.field import Array, Pair, cogging
from pipeline.simulator.friction import bristle_after, direction, fluid, grip
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


Mechanics = tuple[float, float, float, float]
"""Angle and speed of the rotor, then of the far mass [rad, rad/s]."""


@njit(cache=True)
def coupling(twist: float, rate: float, p: Plant) -> float:
    """Torque through an elastic coupling with a gap.

    Parameters
    ----------
    twist
        Angle of the rotor less that of the far mass [rad].
    rate
        Its derivative [rad/s].
    p
        The plant: stiffness, damping, half the gap.

    Returns
    -------
    float
        On the far mass [N·m]: zero inside the gap, and never so that it pulls the gap shut.

    Notes
    -----
    k (φ − φ_gap) + d dφ/dt beyond the gap, cut at zero.

    References
    ----------
    Nordin and Gutman, Controlling mechanical systems with backlash: a survey, Automatica 38(10),
    2002,
    1633, doi:10.1016/S0005-1098(02)00047-X.

    """
    if twist > p.half_gap:
        return float(max(0.0, p.stiffness * (twist - p.half_gap) + p.damping * rate))
    if twist < -p.half_gap:
        return float(min(0.0, p.stiffness * (twist + p.half_gap) + p.damping * rate))
    return 0.0


@njit(cache=True)
def passive(
    theta: float, omega: float, bristle: float, torque: float, flux_ratio: float, p: Plant
) -> float:
    """Torque on the rotor from everything but the windings.

    Parameters
    ----------
    theta, omega
        Shaft angle [rad] and speed [rad/s].
    bristle
        Deflection [rad].
    torque
        Electromagnetic torque, which loads the bearings [N·m].
    flux_ratio
        Flux over the magnets' at 25 degC [1].
    p
        The plant.

    Returns
    -------
    float
        Cogging and weight less friction [N·m].

    """
    total = -fluid(omega, flux_ratio, p)
    total -= grip(omega, torque, flux_ratio, p) * direction(omega, bristle, p)
    if p.lines > 0:
        total += cogging(theta, p)
    if p.unbalance != 0.0:
        total += p.unbalance * math.sin(theta + p.unbalance_phase)
    return total


@njit(cache=True)
def free_torque(theta: float, omega: float, bristle: float, t_m: float, p: Plant) -> float:
    """Torque on an open-circuit rotor [N·m].

    Parameters
    ----------
    theta
        Mechanical angle [rad].
    omega
        Mechanical speed [rad/s].
    bristle
        Deflection of the friction's bristle [rad].
    t_m
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    ratio = 1.0 + p.alpha_magnet * (t_m - 25.0)
    total = passive(theta, omega, bristle, 0.0, ratio, p)
    if p.extras > 0:
        total += extra(0, (theta, omega), (0.0, 0.0), (t_m, t_m), p)
    return total


@njit(cache=True)
def free_rates(mechanics: Mechanics, bristle: float, t_m: float, p: Plant) -> Pair:
    """Accelerations of rotor and far mass of an open-circuit motor [rad/s²].

    Parameters
    ----------
    mechanics
        Angle and speed of the rotor, then of the far mass [rad, rad/s].
    bristle
        Deflection of the friction's bristle [rad].
    t_m
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    theta, omega, far, far_omega = mechanics
    torque = free_torque(theta, omega, bristle, t_m, p)
    if not p.two_mass:
        return torque / p.j_rotor, 0.0
    through = coupling(theta - far, omega - far_omega, p)
    return (torque - through) / p.j_rotor, through / p.j_load


@njit(cache=True)
def coast(
    start: Pair, step_s: float, substeps: int, friction: Array, t_m: float, p: Plant
) -> Array:
    """A rotor that coasts with open terminals.

    Parameters
    ----------
    start
        Shaft angle [rad] and speed [rad/s]; a far mass moves alike, the bristle is
        bent.
    step_s
        Time from one row to the next [s].
    substeps
        Integration steps a row.
    friction
        Share of the stated friction in each row [count, 1].
    t_m
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    array [count, 2]
        Angle [rad] and speed [rad/s] of the rotor, by the classical Runge-Kutta method of order
        four.

    """
    rows = np.empty((friction.size, 2))
    h = step_s / substeps
    theta, omega = start
    far, far_omega = start
    bristle = math.copysign(p.bristle, omega)
    for k in range(friction.size):
        p.friction = friction[k]
        rows[k, 0], rows[k, 1] = theta, omega
        for _ in range(substeps):
            a1, b1 = free_rates((theta, omega, far, far_omega), bristle, t_m, p)
            w2, f2 = omega + 0.5 * h * a1, far_omega + 0.5 * h * b1
            half = (theta + 0.5 * h * omega, w2, far + 0.5 * h * far_omega, f2)
            a2, b2 = free_rates(half, bristle, t_m, p)
            w3, f3 = omega + 0.5 * h * a2, far_omega + 0.5 * h * b2
            half = (theta + 0.5 * h * w2, w3, far + 0.5 * h * f2, f3)
            a3, b3 = free_rates(half, bristle, t_m, p)
            w4, f4 = omega + h * a3, far_omega + h * b3
            a4, b4 = free_rates((theta + h * w3, w4, far + h * f3, f4), bristle, t_m, p)
            travel = h * (omega + 2.0 * w2 + 2.0 * w3 + w4) / 6.0
            theta += travel
            far += h * (far_omega + 2.0 * f2 + 2.0 * f3 + f4) / 6.0
            omega += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
            far_omega += h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
            bristle = bristle_after(bristle, travel, p)
    return rows


@njit(cache=True)
def turned(theta: Array, omega: Array, t_m: float, p: Plant) -> Array:
    """Shaft torque of an open-circuit motor that a drive turns slowly and steadily.

    Parameters
    ----------
    theta, omega
        Shaft angle [n, rad] and speed [n, rad/s].
    t_m
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    array [n]
        [N·m]. The motor came from the other side: a bristle is still bent the other way at the
        start.

    """
    torque_nm = np.empty(theta.size)
    bristle = -math.copysign(p.bristle, omega[0])
    for k in range(theta.size):
        if k > 0:
            bristle = bristle_after(bristle, theta[k] - theta[k - 1], p)
        torque_nm[k] = free_torque(theta[k], omega[k], bristle, t_m, p)
    return torque_nm


@njit(cache=True)
def passives(theta: Array, omega: Array, torque: Array, i_q: Array, t_m: float, p: Plant) -> Array:
    """Torque [n] of everything but the windings in steady creep, bristle fully bent.

    Parameters
    ----------
    theta
        Mechanical angle [n, rad].
    omega
        Mechanical speed [n, rad/s].
    torque
        Electromagnetic torque [n, N·m].
    i_q
        Current along q [n, A].
    t_m
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    passive_nm = np.empty(theta.size)
    for k in range(theta.size):
        bristle = math.copysign(p.bristle, omega[k])
        passive_nm[k] = passive(theta[k], omega[k], bristle, torque[k], 1.0, p)
        if p.extras > 0:
            passive_nm[k] += extra(0, (theta[k], omega[k]), (0.0, i_q[k]), (t_m, t_m), p)
    return passive_nm
