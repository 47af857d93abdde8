"""The motor on a converter under field-oriented control, compiled.

Each switching period applies one constant phase voltage vector (`control.command`); between the
samplings the motor moves by `dynamics.advance`.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from pipeline.simulator.circuit import stator_current, windings
from pipeline.simulator.control import Control, command
from pipeline.simulator.dynamics import advance, net_torque
from pipeline.simulator.field import Array, Pair, magnet
from pipeline.simulator.followers import dragged
from pipeline.simulator.heat import heat
from pipeline.simulator.loop_sensors import HISTORY, remembered, sensed_angle, sensed_current
from pipeline.simulator.motion import coupling
from pipeline.simulator.plant import Plant

COLUMNS = (
    "i_alpha", "i_beta", "v_alpha", "v_beta", "theta_seen", "omega_seen", "torque_shaft",
    "temp_winding", "temp_magnet", "theta", "omega", "i_alpha_true", "i_beta_true", "psi_alpha",
    "psi_beta", "torque_em", "work_in", "work_copper", "work_switches",
)  # fmt: skip


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
