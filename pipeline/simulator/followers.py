"""Signals that follow another, compiled: through a play, or with a lag."""

from __future__ import annotations

import numpy as np
from numba import njit

from pipeline.simulator.field import Array


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
