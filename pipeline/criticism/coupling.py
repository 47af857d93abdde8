"""A shaft in two parts: motor and far inertia, with a twist between them.

The coupling passes S = T − drags − (1 − f) J θ″ on to the far part, f its share of the inertia.
The far angle is θ less the twist, so that with a load at the far end

    T_load = S − f J (θ″ − twist″) = [T − drags − J θ″] + f J twist″,

while a dynamometer that holds the far end reads S itself, [T − drags − J θ″] + f J θ″. Motor angle
and load are recorded; the twist is a function of S. A coasting shaft passes on next to nothing.

References: [1] Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000); [2] Nordin & Gutman, Automatica 38
(2002), backlash as a dead zone of the twist.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.criticism.effect import Array, Operating
from pipeline.criticism.traces import smoothed


def passed_on(x: Operating, share: float, smooth_s: float = 0.0) -> Array:
    """Torque S [n] that the motor's side passes on [N·m], drags left out, which change slowly.

    `share` of the inertia is at the far end; `smooth_s` averages what the encoder's rounding does.
    """
    near = (1.0 - share) * x.base["j_kgm2"]
    torque: Array = x.torque_nm - near * bend(x.theta_rad, x.ts_s)
    if smooth_s > 0.0:
        return smoothed(torque, 2 * round(smooth_s / x.ts_s / 2) + 1)
    return torque


def far_drag(x: Operating, share: float, twist_rad: Callable[[], Array]) -> Array:
    """What a far inertia takes from the shaft torque [n] beyond a rigid shaft's [N·m]."""
    if not x.inverter:
        return np.zeros(np.shape(x.omega_rad_s))
    moved = x.theta_rad if x.held else twist_rad()
    drag: Array = -share * x.base["j_kgm2"] * bend(moved, x.ts_s)
    return drag


def bend(signal: Array, period_s: float) -> Array:
    """Second difference [n] over the period's square, zero at the ends."""
    found = np.zeros(np.shape(signal))
    found[1:-1] = np.diff(signal, 2) / period_s**2
    return found
