"""What a machine was doing, stretch by stretch, from speed and current."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

BLOCKS = 2000
SHORTEST_BLOCKS = 3
SPEED_SHARE, CURRENT_SHARE = 0.01, 0.03
REST, LOCKED, MOTORING, GENERATING, UNPOWERED = (
    "at rest",
    "current at rest",
    "motoring",
    "generating",
    "no current",
)


@dataclass(frozen=True, slots=True)
class Stretch:
    """Rows from `start` on, up to the next stretch, in one state."""

    start: int
    state: str


def regimes(speed_rad_s: Array, current_a: Array) -> tuple[Stretch, ...]:
    """What a machine was doing, stretch by stretch: at rest, motoring, generating, ...

    Parameters
    ----------
    speed_rad_s
        Shaft speed [n, rad/s].
    current_a
        q current [n, A]; positive makes torque in the sense of positive speed.

    Returns
    -------
    tuple of Stretch
        In order of rows, from row 0 on; empty for an empty record.

    Notes
    -----
    At rest is a speed of at most `SPEED_SHARE` of the largest, no current at most `CURRENT_SHARE`
    of the largest; motoring is current in the sense of the speed. Means over at most `BLOCKS`
    blocks are judged, and stretches of fewer than `SHORTEST_BLOCKS` blocks join the one before, so
    that noise about a threshold makes none. A value that is not finite counts as 0.

    """
    if speed_rad_s.size == 0:
        return ()
    block = -(-speed_rad_s.size // BLOCKS)
    starts = np.arange(0, speed_rad_s.size, block)
    speed = _means(np.where(np.isfinite(speed_rad_s), speed_rad_s, 0.0), starts)
    current = _means(np.where(np.isfinite(current_a), current_a, 0.0), starts)
    moving = np.abs(speed) > SPEED_SHARE * np.abs(speed).max(initial=0.0)
    powered = np.abs(current) > CURRENT_SHARE * np.abs(current).max(initial=0.0)
    states = np.where(
        moving,
        np.where(powered, np.where(speed * current > 0, MOTORING, GENERATING), UNPOWERED),
        np.where(powered, LOCKED, REST),
    )
    return stretches(states, starts, SHORTEST_BLOCKS if starts.size > 10 else 1)


def stretches(
    states: NDArray[np.str_], starts: NDArray[np.int64], shortest: int = 1
) -> tuple[Stretch, ...]:
    """Equal states in a row as one stretch.

    Parameters
    ----------
    states
        State of each block [b].
    starts
        First row of each block [b].
    shortest
        Fewest blocks; a run of fewer joins the stretch before it.

    Returns
    -------
    tuple of Stretch
        In order of rows.

    """
    cuts = np.flatnonzero(np.concatenate([[True], states[1:] != states[:-1]]))
    lengths = np.diff(np.append(cuts, states.size))
    stretches: list[Stretch] = []
    for cut, length in zip(cuts, lengths, strict=True):
        state = str(states[cut])
        if stretches and (length < shortest or state == stretches[-1].state):
            continue
        stretches.append(Stretch(int(starts[cut]), state))
    return tuple(stretches)


def _means(values: Array, starts: NDArray[np.int64]) -> Array:
    lengths = np.diff(np.append(starts, values.size))
    return np.add.reduceat(values, starts) / lengths
