"""Windings and shaft together, compiled: accelerations and a Runge-Kutta step of all states."""

from __future__ import annotations

import numpy as np
from numba import njit

from pipeline.simulator.circuit import Field, windings
from pipeline.simulator.extra_terms import extra
from pipeline.simulator.field import Array, Pair
from pipeline.simulator.friction import bristle_after
from pipeline.simulator.motion import Mechanics, coupling, passive
from pipeline.simulator.plant import Plant


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
