"""The motor on a converter under field-oriented control, compiled.

Each switching period applies one constant phase voltage vector (`control.command`); between the
samplings the motor moves by `advance`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.simulator.circuit import Field, stator_current, windings
from pipeline.simulator.control import Control, command
from pipeline.simulator.field import SQRT3, Array, Pair, magnet
from pipeline.simulator.followers import dragged
from pipeline.simulator.friction import bristle_after
from pipeline.simulator.heat import heat
from pipeline.simulator.motion import Mechanics, coupling, extra, passive
from pipeline.simulator.plant import Plant

COLUMNS = (
    "i_alpha", "i_beta", "v_alpha", "v_beta", "theta_seen", "omega_seen", "torque_shaft",
    "temp_winding", "temp_magnet", "theta", "omega", "i_alpha_true", "i_beta_true", "psi_alpha",
    "psi_beta", "torque_em", "work_in", "work_copper", "work_switches",
)  # fmt: skip
HISTORY = 256
"""Integration steps that the ring buffer of currents holds."""


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
def drive(
    reference: Array, friction: Array, noise: Array, c: Control, p: Plant, later: Plant, change: int
) -> Array:
    """Field-oriented control over some periods.

    Parameters
    ----------
    reference
        d current [A], q current [A] or speed [rad/s], load torque [N·m], speed that the dynamometer
        holds [rad/s], a row a period [n, 4].
    friction
        Share of the stated friction in each period [n, 1].
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
        p.friction = friction[k]
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
