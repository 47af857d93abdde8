"""The motor on a converter: phase equations, current and speed control, compiled.

Each switching period applies one constant phase voltage vector; the phase equations
v_x - v_n = R_x i_x + drop(i_x) + dpsi_x/dt are integrated by RK4 between the samplings.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit

from pipeline.simulator.field import SQRT3, Array, current, magnet, torque_of
from pipeline.simulator.motion import (
    Mechanics,
    Pair,
    bristle_after,
    coupling,
    dragged,
    extra,
    heat,
    passive,
)
from pipeline.simulator.plant import Plant

HISTORY = 256
COLUMNS = (
    "i_alpha", "i_beta", "v_alpha", "v_beta", "theta_seen", "omega_seen", "torque_shaft",
    "temp_winding", "temp_magnet", "theta", "omega", "i_alpha_true", "i_beta_true", "psi_alpha",
    "psi_beta", "torque_em", "work_in", "work_copper", "work_switches",
)  # fmt: skip
Field = tuple[float, float, float, float, float, float, float, float, float]


class Control(NamedTuple):
    """Controller, inverter and the sensors that are inside the loop."""

    pole_pairs: float
    period_s: float
    substeps: int
    substeps_before: int
    v_limit: float
    l_d: float
    l_q: float
    psi: float
    kp_d: float
    kp_q: float
    ki: float
    speed_loop: bool
    kp_speed: float
    ki_speed: float
    i_limit: float
    held_speed: bool
    dyno_nms: float
    dyno_nm: float
    in_coupling: bool
    at_stator: bool
    gain_a: float
    gain_b: float
    gain_c: float
    offset_a: float
    offset_b: float
    offset_c: float
    lsb_current: float
    delay_s: float
    angle_offset: float
    angle_wobble: float
    angle_wobble_phase: float
    angle_play: float
    angle_late_s: float
    lsb_angle: float
    speed_lag_s: float
    ambient: float
    temp_winding: float
    temp_magnet: float
    theta: float
    omega: float


@njit(cache=True)
def phase_drop(i: float, p: Plant) -> float:
    """Voltage that dead time and switches take from one phase, less what a compensation gives back.

    Parameters
    ----------
    i
        Phase current [A].
    p
        The plant.

    Returns
    -------
    float
        V_d i/√(i² + i_knee²) − V_c clip(i/i_ramp, ±1) [V].

    References
    ----------
    Jeong and Park, IEEE Trans. Ind. Electron. 38(2), 1991, 108 (dead-time effect),
    doi:10.1109/41.88903.

    """
    given_v = p.given_v * min(max(i / p.given_ramp_a, -1.0), 1.0)
    return float(p.dead_v * i / math.sqrt(i * i + p.dead_knee_a * p.dead_knee_a) - given_v)


@njit(cache=True)
def resistance_rise(omega: float, degc: float, p: Plant) -> float:
    """Factor on the phase resistances from temperature and skin effect.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    degc
        Temperature of the winding [degC].
    p
        The plant.

    Returns
    -------
    float
        (1 + α (T − 25)) (1 + s u²/(1 + (u/u_knee)²)) [1], u the speed over the rated one.

    """
    factor = 1.0 + p.alpha_copper * (degc - 25.0)
    if p.skin != 0.0:
        u = p.pole_pairs * omega / p.omega_elec_rated
        factor *= 1.0 + p.skin * u * u / (1.0 + (u / p.skin_knee) ** 2)
    return float(factor)


@njit(cache=True)
def windings(flux: Pair, mechanics: Mechanics, volt: Pair, warm: Pair, p: Plant) -> Field:
    """Phase equations of the motor at a state.

    Parameters
    ----------
    flux
        Stator-frame flux linkages, alpha and beta [Wb].
    mechanics
        Angle and speed of the rotor, then of the far mass [rad, rad/s].
    volt
        Applied voltage, alpha and beta [V].
    warm
        Temperatures of winding and magnets [degC].
    p
        The plant.

    Returns
    -------
    tuple
        Flux rates, alpha and beta [V]; electromagnetic torque [N·m]; powers in, in copper and in
        switches [W]; i_d and i_q [A]; flux over the magnets' at 25 degC [1].

    Notes
    -----
    v_x − v_n = R_x i_x + drop(i_x) + dψ_x/dt for the phases a, b, c. The star point v_n takes the
    mean of the three, which alpha and beta do not see.

    """
    theta, omega = mechanics[0], mechanics[1]
    eps = p.pole_pairs * theta
    c, s = math.cos(eps), math.sin(eps)
    psi_d, psi_q = c * flux[0] + s * flux[1], c * flux[1] - s * flux[0]
    i_d, i_q, w_eps = current(psi_d, psi_q, eps, warm[1], p)
    i_alpha, i_beta = c * i_d - s * i_q, s * i_d + c * i_q
    i_a = i_alpha
    i_b = -0.5 * i_alpha + 0.5 * SQRT3 * i_beta
    i_c = -0.5 * i_alpha - 0.5 * SQRT3 * i_beta
    rise = resistance_rise(omega, warm[0], p)
    u_a, u_b, u_c = rise * p.r_a_ohm * i_a, rise * p.r_b_ohm * i_b, rise * p.r_c_ohm * i_c
    copper, switches = u_a * i_a + u_b * i_b + u_c * i_c, 0.0
    if p.dead_v != 0.0:
        e_a, e_b, e_c = phase_drop(i_a, p), phase_drop(i_b, p), phase_drop(i_c, p)
        switches = e_a * i_a + e_b * i_b + e_c * i_c
        u_a, u_b, u_c = u_a + e_a, u_b + e_b, u_c + e_c
    # The star point takes the mean of the three, which alpha and beta do not see.
    d_alpha = volt[0] - (2.0 * u_a - u_b - u_c) / 3.0
    d_beta = volt[1] - (u_b - u_c) / SQRT3
    if p.extras > 0:
        u_d = extra(1, (theta, omega), (i_d, i_q), warm, p)
        u_q = extra(2, (theta, omega), (i_d, i_q), warm, p)
        d_alpha -= c * u_d - s * u_q
        d_beta -= s * u_d + c * u_q
    torque = torque_of(psi_d, psi_q, i_d, i_q, w_eps, p)
    ratio = math.sqrt(psi_d * psi_d + psi_q * psi_q) / p.psi_wb if p.psi_wb > 0.0 else 0.0
    power = 1.5 * (volt[0] * i_alpha + volt[1] * i_beta)
    return d_alpha, d_beta, torque, power, copper, switches, i_d, i_q, ratio


@njit(cache=True)
def net_torque(mechanics: Mechanics, bristle: float, field: Field, warm: Pair, p: Plant) -> float:
    """Torque on the rotor, the coupling's and the load's not in, from what `windings` gave.

    Parameters
    ----------
    mechanics
        Angle and speed of rotor and far mass [rad, rad/s].
    bristle
        Deflection of the friction's bristle [rad].
    field
        Currents and field energy of the state.
    warm
        Temperatures of winding and magnets [degC].
    p
        The motor in numbers.

    """
    theta, omega = mechanics[0], mechanics[1]
    net = field[2] + passive(theta, omega, bristle, field[2], field[8], p)
    if p.extras > 0:
        net += extra(0, (theta, omega), (field[6], field[7]), warm, p)
    return float(net)


@njit(cache=True)
def accelerations(mechanics: Mechanics, net: float, load: float, held: bool, p: Plant) -> Pair:
    """Accelerations of the rotor and of the far mass.

    Parameters
    ----------
    mechanics
        Angle and speed of the rotor, then of the far mass [rad, rad/s].
    net
        Torque on the rotor [N·m].
    load
        Torque of the load [N·m].
    held
        Whether a dynamometer holds the far end at its speed.
    p
        The plant.

    Returns
    -------
    near, far
        [rad/s²]; of a stiff motor the first alone, 0 where it is held.

    """
    if p.two_mass:
        through = coupling(mechanics[0] - mechanics[2], mechanics[1] - mechanics[3], p)
        far = 0.0 if held else (through - load) / p.j_load
        return (net - through) / p.j_rotor, far
    if held:
        return 0.0, 0.0
    return (net - load) / p.j_rotor, 0.0


@njit(cache=True)
def advance(
    y: Array, work: Array, volt: Pair, load: float, warm: Pair, h: float, held: bool, p: Plant
) -> None:
    """One Runge-Kutta step of order four, in place.

    Parameters
    ----------
    y
        State [8]: ψ_alpha, ψ_beta [Wb], θ, ω, far θ, far ω [rad, rad/s], bristle [rad], angle by
        which the far end is ahead of the dynamometer's set speed [rad].
    work
        Energy in, in copper and in switches so far [3, J]; grows by that of the step.
    volt
        Applied voltage, alpha and beta [V].
    load
        Torque of the load [N·m].
    warm
        Temperatures of winding and magnets [degC].
    h
        Step [s].
    held
        Whether a dynamometer holds the far end at its speed.
    p
        The plant.

    """
    weights = (1.0, 2.0, 2.0, 1.0)
    parts = (0.0, 0.5, 0.5, 1.0)
    total = np.zeros(9)
    now = np.zeros(6)
    for stage in range(4):
        part = parts[stage] * h
        flux = (y[0] + part * now[0], y[1] + part * now[1])
        mechanics = (
            y[2] + part * now[2],
            y[3] + part * now[3],
            y[4] + part * now[4],
            y[5] + part * now[5],
        )
        field = windings(flux, mechanics, volt, warm, p)
        net = net_torque(mechanics, y[6], field, warm, p)
        near, far = accelerations(mechanics, net, load, held, p)
        now[0], now[1], now[2], now[3] = field[0], field[1], mechanics[1], near
        now[4], now[5] = mechanics[3], far
        share = weights[stage] * h / 6.0
        for n in range(6):
            total[n] += share * now[n]
        for n in range(3):
            work[n] += share * field[3 + n]
    for n in range(6):
        y[n] += total[n]
    y[6] = bristle_after(y[6], total[2], p)


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
def stator_current(y: Array, t_m: float, p: Plant) -> Pair:
    """Currents in alpha and beta that belong to a state [A].

    Parameters
    ----------
    y
        State of the integration.
    t_m
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    eps = p.pole_pairs * y[2]
    c, s = math.cos(eps), math.sin(eps)
    i_d, i_q, _ = current(c * y[0] + s * y[1], c * y[1] - s * y[0], eps, t_m, p)
    return c * i_d - s * i_q, s * i_d + c * i_q


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
    wobble = c.angle_wobble * math.sin(theta + c.angle_wobble_phase)
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


@njit(cache=True)
def command(loop: Array, seen: Pair, eps: float, omega: float, want: Array, c: Control) -> Pair:
    """Voltage vector for the next period, by field-oriented control.

    Parameters
    ----------
    loop
        Integrators of d [V], q [V] and speed [A], changed in place; they stop at the limits.
    seen
        Currents as the sensors report them, alpha and beta [A].
    eps
        Electrical angle as seen [rad].
    omega
        Shaft speed as seen [rad/s].
    want
        d current [A], q current [A] or speed [rad/s], and more that is not used here.
    c
        The controller.

    Returns
    -------
    v_alpha, v_beta
        [V], turned ahead to the middle of the period in which it acts.

    Notes
    -----
    v_d = K_d e_d + ∫k_i e_d − ω L_q i_q and v_q = K_q e_q + ∫k_i e_q + ω (ψ + L_d i_d), cut in
    length at the limit.

    """
    ce, se = math.cos(eps), math.sin(eps)
    i_d, i_q = ce * seen[0] + se * seen[1], ce * seen[1] - se * seen[0]
    want_q = want[1]
    if c.speed_loop:
        slip = want[1] - omega
        want_q = c.kp_speed * slip + loop[2]
        if abs(want_q) < c.i_limit or want_q * slip < 0.0:
            loop[2] += c.ki_speed * slip * c.period_s
        want_q = min(max(want_q, -c.i_limit), c.i_limit)
    error_d, error_q = want[0] - i_d, want_q - i_q
    omega_e = c.pole_pairs * omega
    v_d = c.kp_d * error_d + loop[0] - omega_e * c.l_q * i_q
    v_q = c.kp_q * error_q + loop[1] + omega_e * (c.psi + c.l_d * i_d)
    size = math.sqrt(v_d * v_d + v_q * v_q)
    if size > c.v_limit:
        v_d, v_q = v_d * c.v_limit / size, v_q * c.v_limit / size
    else:
        loop[0] += c.ki * error_d * c.period_s
        loop[1] += c.ki * error_q * c.period_s
    lead = eps + omega_e * c.period_s * (1.5 - c.substeps_before / c.substeps)
    cl, sl = math.cos(lead), math.sin(lead)
    return cl * v_d - sl * v_q, sl * v_d + cl * v_q


@njit(cache=True)
def beginning(c: Control, p: Plant) -> Array:
    """State at the start: no current, the magnet's flux, friction already bent.

    Parameters
    ----------
    c
        The drive and its sensors.
    p
        The motor in numbers.

    """
    y = np.zeros(8)
    y[2], y[3], y[4], y[5] = c.theta, c.omega, c.theta, c.omega
    y[6] = math.copysign(p.bristle, c.omega) if c.omega != 0.0 else 0.0
    eps = p.pole_pairs * c.theta
    md, mq, _, _ = magnet(eps, c.temp_magnet, p)
    y[0] = math.cos(eps) * md - math.sin(eps) * mq
    y[1] = math.sin(eps) * md + math.cos(eps) * mq
    return y


@njit(cache=True)
def load_torque(y: Array, want: Array, c: Control, p: Plant) -> float:
    """Torque of the load [N·m]: the one wanted, or that of a dynamometer's speed loop.

    Parameters
    ----------
    y
        State of the integration.
    want
        d current [A], q current [A] or speed [rad/s], load torque [N·m], dynamometer's speed
        [rad/s].
    c
        The drive and its sensors.
    p
        The motor in numbers.

    """
    if c.dyno_nms == 0.0:
        return float(want[2])
    ahead = y[5 if p.two_mass else 3] - want[3]
    return float(c.dyno_nms * ahead + c.dyno_nm * y[7])


@njit(cache=True)
def shaft_torque(y: Array, want: Array, volt: Pair, warm: Pair, c: Control, p: Plant) -> Pair:
    """Torque the transducer sees, and the electromagnetic torque [N·m].

    A dynamometer that holds the far end has it in the coupling; one whose speed gives way shows the
    reaction torque of its stator, which the inertia of its rotor is in. With `in_coupling` the
    transducer is between the two parts whatever the far end does; with `at_stator` it holds the
    motor's stator, and the inertia of no rotor is in it.

    Parameters
    ----------
    y
        State of the integration.
    want
        d current [A], q current [A] or speed [rad/s], load torque [N·m], dynamometer's speed
        [rad/s].
    volt
        Voltages in alpha and beta [V].
    warm
        Temperatures of winding and magnets [degC].
    c
        The drive and its sensors.
    p
        The motor in numbers.

    """
    mechanics = (y[2], y[3], y[4], y[5])
    field = windings((y[0], y[1]), mechanics, volt, warm, p)
    if c.at_stator:
        return net_torque(mechanics, y[6], field, warm, p), field[2]
    if c.in_coupling and p.two_mass:
        return coupling(y[2] - y[4], y[3] - y[5], p), field[2]
    if not c.held_speed or c.dyno_nms > 0.0:
        return load_torque(y, want, c, p), field[2]
    if p.two_mass:
        return coupling(y[2] - y[4], y[3] - y[5], p), field[2]
    return net_torque(mechanics, y[6], field, warm, p), field[2]


@njit(cache=True)
def run_on(
    y: Array,
    work: Array,
    volt: Pair,
    want: Array,
    warm: Pair,
    steps: int,
    history: Array,
    newest: int,
    c: Control,
    p: Plant,
) -> int:
    """Integrate some steps with one voltage vector.

    Parameters
    ----------
    y
        State of the integration.
    work
        Energy in, in copper and in switches so far [3, J]; changed in place.
    volt
        Voltages in alpha and beta [V].
    want
        d current [A], q current [A] or speed [rad/s], load torque [N·m], dynamometer's speed
        [rad/s].
    warm
        Temperatures of winding and magnets [degC].
    steps
        Number of integration steps.
    history
        Ring buffer of currents in alpha and beta [k, 2, A].
    newest
        Place of the newest currents in `history`.
    c
        The drive and its sensors.
    p
        The motor in numbers.

    Returns
    -------
    int
        The newest place in the history.

    """
    h = c.period_s / c.substeps
    far = 5 if p.two_mass else 3
    held = c.held_speed and c.dyno_nms == 0.0
    for _ in range(steps):
        if held:
            y[far] = want[3]
        load = load_torque(y, want, c, p)
        y[7] += h * (y[far] - want[3])
        advance(y, work, volt, load, warm, h, held, p)
        if c.delay_s > 0.0:
            newest += 1
            i_alpha, i_beta = stator_current(y, warm[1], p)
            history[newest % HISTORY, 0], history[newest % HISTORY, 1] = i_alpha, i_beta
    return newest


@njit(cache=True)
def drive(reference: Array, noise: Array, c: Control, p: Plant, later: Plant, change: int) -> Array:
    """Field-oriented control over some periods.

    Parameters
    ----------
    reference
        d current [A], q current [A] or speed [rad/s], load torque [N·m], speed that the dynamometer
        holds [rad/s], a row a period [n, 4].
    noise
        Of the three phase currents [A] and of the angle [rad], [n, 4].
    c
        Controller, inverter and sensors.
    p
        The plant.
    later, change
        The plant from that period on; `p` again where nothing changes.

    Returns
    -------
    array [n, 19]
        `COLUMNS` at the sampling instants, SI units.

    """
    rows = np.empty((reference.shape[0], len(COLUMNS)))
    y, work, loop = beginning(c, p), np.zeros(3), np.zeros(3)
    warm = (c.temp_winding, c.temp_magnet)
    history, newest = np.zeros((HISTORY, 2)), 0
    delay = c.delay_s * c.substeps / c.period_s
    blend = 1.0 - math.exp(-c.period_s / c.speed_lag_s) if c.speed_lag_s > 0.0 else 1.0
    start = sensed_angle(c.theta - c.angle_late_s * c.omega, 0.0, c)
    volt = command(loop, (0.0, 0.0), c.pole_pairs * start, c.omega, np.zeros(4), c)
    loop[:] = 0.0
    omega, before, carried = c.omega, start, c.theta
    for k in range(reference.shape[0]):
        if k == change:
            p = later
        want, copper = reference[k], work[1]
        newest = run_on(y, work, volt, want, warm, c.substeps_before, history, newest, c, p)
        true = stator_current(y, warm[1], p)
        late = true
        if c.delay_s > 0.0:
            late = remembered(history, newest, min(delay, max(0.0, newest - 1.001)))
        seen = sensed_current(late, noise[k], c)
        carried = dragged(carried, y[2], 0.5 * c.angle_play)
        angle = sensed_angle(carried - c.angle_late_s * y[3], noise[k, 3], c)
        if k > 0:
            omega += blend * ((angle - before) / c.period_s - omega)
        before = angle
        shaft, torque = shaft_torque(y, want, volt, warm, c, p)
        rows[k, 0:9] = (seen[0], seen[1], volt[0], volt[1], angle, omega, shaft, warm[0], warm[1])
        rows[k, 9:16] = (y[2], y[3], true[0], true[1], y[0], y[1], torque)
        rows[k, 16:19] = work
        ahead = command(loop, seen, c.pole_pairs * angle, omega, want, c)
        rest = c.substeps - c.substeps_before
        newest = run_on(y, work, volt, want, warm, rest, history, newest, c, p)
        volt = ahead
        warm = heat(warm[0], warm[1], (work[1] - copper) / c.period_s, c.ambient, c.period_s, p)
    return rows
