"""Mechanics and heat of the motor, compiled: friction, coupling, coasting, thermal network."""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.simulator.field import Array, cogging
from pipeline.simulator.plant import Plant

TURN = 2.0 * math.pi
Pair = tuple[float, float]
Arrays = tuple[Array, Array]
Mechanics = tuple[float, float, float, float]
"""Angle and speed of the rotor, then of the far mass [rad, rad/s]."""


@njit(cache=True)
def grip(omega: float, torque: float, flux_ratio: float, p: Plant) -> float:
    """Size of the friction that opposes the direction of motion, whatever the speed.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    torque
        Electromagnetic torque, which loads the bearings [N·m].
    flux_ratio
        Flux over the magnets' at 25 degC [1].
    p
        The plant.

    Returns
    -------
    float
        [N·m], not negative.

    Notes
    -----
    T_c + μ |T| + T_s/(1 + (ω/ω_s)²) + T_h (ψ/ψ_pm)^1.6: Coulomb, load-dependent, Stribeck and
    magnetic hysteresis, the last by Steinmetz's exponent.

    References
    ----------
    Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, 1083 (friction),
    doi:10.1016/0005-1098(94)90209-7.

    """
    size = p.coulomb + p.load_friction * abs(torque)
    if p.stribeck != 0.0:
        size += p.stribeck / (1.0 + (omega / p.stribeck_w) ** 2)
    if p.hysteresis != 0.0:
        size += p.hysteresis * flux_ratio**1.6
    return float(size)


@njit(cache=True)
def fluid(omega: float, flux_ratio: float, p: Plant) -> float:
    """Friction that grows with speed.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    flux_ratio
        Flux over the magnets' at 25 degC [1].
    p
        The plant.

    Returns
    -------
    float
        [N·m], of the sign of the speed.

    Notes
    -----
    B ω + T_w |ω/ω_rated|ⁿ sign ω + k ω (ψ/ψ_pm)²/(1 + (ω/ω_k)²): viscous, windage, and eddy
    currents that their own field keeps out at high speed.

    """
    drag = p.b_visc * omega
    if p.windage != 0.0:
        u = abs(omega) / p.omega_rated
        drag += math.copysign(p.windage * u**p.windage_exponent, omega)
    if p.eddy != 0.0:
        drag += p.eddy * omega * flux_ratio * flux_ratio / (1.0 + (omega / p.eddy_knee) ** 2)
    return float(drag)


@njit(cache=True)
def direction(omega: float, bristle: float, p: Plant) -> float:
    """Sense of the friction, -1 to 1.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    bristle
        Deflection [rad].
    p
        The plant.

    Returns
    -------
    float
        z/z₀ of the bristle where there is one, else tanh(ω/ω_ε), a sign without a jump.

    """
    if p.bristle > 0.0:
        return float(bristle / p.bristle)
    return math.tanh(omega / p.omega_eps)


@njit(cache=True)
def bristle_after(bristle: float, travel: float, p: Plant) -> float:
    """Deflection of the bristle after a travel (Dahl's model).

    Parameters
    ----------
    bristle
        Deflection before [rad].
    travel
        Of the shaft, in one sense [rad].
    p
        The plant; `bristle` there is the largest deflection z₀.

    Returns
    -------
    float
        Deflection after [rad].

    Notes
    -----
    dz = dx (1 − sign(dx) z/z₀), solved exactly: z → ±z₀ with exp(−|Δx|/z₀).

    References
    ----------
    P. R. Dahl, Solid friction damping of mechanical vibrations, AIAA Journal 14(12), 1976, 1675,
    doi:10.2514/3.61511.

    """
    if p.bristle <= 0.0 or travel == 0.0:
        return bristle
    end = math.copysign(p.bristle, travel)
    return end + (bristle - end) * math.exp(-abs(travel) / p.bristle)


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
def coast(start: Pair, step_s: float, substeps: int, count: int, t_m: float, p: Plant) -> Array:
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
    count
        Rows.
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
    rows = np.empty((count, 2))
    h = step_s / substeps
    theta, omega = start
    far, far_omega = start
    bristle = math.copysign(p.bristle, omega)
    for k in range(count):
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
def heat(
    t_w: float, t_m: float, watt: float, ambient: float, h: float, p: Plant
) -> tuple[float, float]:
    """Temperatures of winding and magnets a moment later.

    Parameters
    ----------
    t_w, t_m
        Of winding and magnets now [degC].
    watt
        Heat into the winding [W].
    ambient
        [degC]
    h
        Time [s].
    p
        The plant.

    Returns
    -------
    t_w, t_m
        After h [degC], by the midpoint rule.

    Notes
    -----
    C_w dT_w/dt = P − (T_w − T_m)/R_wm − (T_w − T_a)/R_wa

    C_m dT_m/dt = (T_w − T_m)/R_wm − (T_m − T_a)/R_ma

    """
    across = (t_w - t_m) / p.rth_wm
    rate_w = (watt - across - (t_w - ambient) / p.rth_wa) / p.cth_w
    rate_m = (across - (t_m - ambient) / p.rth_ma) / p.cth_m
    mid_w, mid_m = t_w + 0.5 * h * rate_w, t_m + 0.5 * h * rate_m
    across = (mid_w - mid_m) / p.rth_wm
    t_w += h * (watt - across - (mid_w - ambient) / p.rth_wa) / p.cth_w
    t_m += h * (across - (mid_m - ambient) / p.rth_ma) / p.cth_m
    return t_w, t_m


@njit(cache=True)
def warmed(watt_25: Array, start: tuple[float, float], ambient: float, h: float, p: Plant) -> Array:
    """Temperatures under copper losses, which grow with the temperature of the winding.

    Parameters
    ----------
    watt_25
        Copper losses as they would be at 25 degC [n, W].
    start
        Temperatures of winding and magnets at the first row [degC].
    ambient
        [degC]
    h
        Time between rows [s].
    p
        The plant.

    Returns
    -------
    array [n, 2]
        Of winding and magnets [degC].

    """
    temperatures_k = np.empty((watt_25.size, 2))
    t_w, t_m = start
    for k in range(watt_25.size):
        temperatures_k[k, 0], temperatures_k[k, 1] = t_w, t_m
        watt = watt_25[k] * (1.0 + p.alpha_copper * (t_w - 25.0))
        t_w, t_m = heat(t_w, t_m, watt, ambient, h, p)
    return temperatures_k


@njit(cache=True)
def dragged(carried: float, theta: float, half_gap: float) -> float:
    """Angle [rad] of what a shaft drags along by a pin in a slot.

    Parameters
    ----------
    carried
        Its angle so far [rad].
    theta
        Angle of the shaft [rad].
    half_gap
        Play to either side [rad].

    Returns
    -------
    float
        The nearest angle to `carried` within the slot.

    References
    ----------
    Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer, 1989 (play operator).

    """
    return min(max(carried, theta - half_gap), theta + half_gap)


@njit(cache=True)
def played(x: Array, half_gap: float) -> Array:
    """What a signal [n] drags along by a slot of `half_gap` to either side, from its middle on.

    Parameters
    ----------
    x
        The signal [n].
    half_gap
        Half of the slot [unit of x].

    """
    follower = np.empty(x.size)
    carried = x[0]
    for n in range(x.size):
        carried = dragged(carried, x[n], half_gap)
        follower[n] = carried
    return follower


@njit(cache=True)
def lagged(x: Array, blend: float) -> Array:
    """First-order lag [n] that starts settled: y += blend (x - y).

    Parameters
    ----------
    x
        The signal [n].
    blend
        Share of the difference that one sample takes [1].

    """
    late = np.empty(x.size)
    y = x[0] if x.size else 0.0
    for k in range(x.size):
        y += blend * (x[k] - y)
        late[k] = y
    return late


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
