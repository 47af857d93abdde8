"""Whole turns of a shaft in a record, and how densely they are sampled."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.numerics.least_squares import Array
from pipeline.physics.units import TURN_RAD

WHOLE_TURN = 0.98
"""Least part of a turn that counts as one at the end of a pass [1]."""


@dataclass(frozen=True, slots=True)
class Turn:
    """One turn of one pass: angle [n, rad], value [n], sense of rotation (+1 or -1)."""

    theta_rad: Array
    value: Array
    sense: int


def passes(theta_rad: Array, back_rad: float = 0.2) -> list[tuple[slice, int]]:
    """Stretches of a record in which the shaft keeps one sense of rotation.

    Parameters
    ----------
    theta_rad
        Unwrapped shaft angle [n, rad], finite.
    back_rad
        By how much the angle falls back from its extreme at a turning point [rad], so that noise
        and vibration make none.

    Returns
    -------
    list of (slice, sense)
        Rows, and +1 or -1, in order of time; empty where the angle never moves by `back_rad`.

    Notes
    -----
    Of a long record every k-th row is used, 20,000 to 40,000 of them.

    """
    stretches: list[tuple[slice, int]] = []
    start, extreme, sense = 0, 0, 0
    step = max(1, theta_rad.size // 20_000)
    for i in range(0, theta_rad.size, step):
        moved = theta_rad[i] - theta_rad[extreme]
        if sense == 0:
            if abs(theta_rad[i] - theta_rad[start]) > back_rad:
                sense = 1 if theta_rad[i] > theta_rad[start] else -1
                extreme = i
        elif moved * sense >= 0:
            extreme = i
        elif abs(moved) > back_rad:
            stretches.append((slice(start, extreme + 1), sense))
            start, extreme, sense = extreme + 1, i, -sense
    if sense != 0:
        stretches.append((slice(start, theta_rad.size), sense))
    return stretches


def whole_turns(theta_rad: Array, value: Array) -> list[Turn]:
    """The whole turns of every pass; what is left of a pass is left out.

    Parameters
    ----------
    theta_rad
        Unwrapped shaft angle [n, rad].
    value
        What is measured over the angle [n, any unit]; rows that are not finite are left out.

    Returns
    -------
    list of Turn
        In order of time. The last turn of a pass may lack up to 1 - `WHOLE_TURN` of a turn.

    """
    turns = []
    finite = np.isfinite(theta_rad) & np.isfinite(value)
    theta_rad, value = theta_rad[finite], value[finite]
    for rows, sense in passes(theta_rad):
        angle, y = theta_rad[rows], value[rows]
        if angle.size < 16:
            continue
        travelled = (angle - angle[0]) * sense / TURN_RAD
        count = int(np.floor(travelled.max() + 1.0 - WHOLE_TURN))
        for j in range(count):
            of_turn = (travelled >= j) & (travelled < j + 1)
            turns.append(Turn(angle[of_turn], y[of_turn], sense))
    return turns


def largest_order(turns: Sequence[Turn], ceiling: int) -> int:
    """The highest order that every turn samples with more than two positions a cycle.

    Parameters
    ----------
    turns
        Turns of the shaft.
    ceiling
        Highest order wanted [1/turn].

    Returns
    -------
    int
        Order [1/turn], at most `ceiling`; 0 without a turn.

    """
    counts = [np.unique(turn.theta_rad).size for turn in turns]
    return int(max(0, min(ceiling, (min(counts, default=0) - 1) // 2)))


def even_positions(turns: Sequence[Turn]) -> int | None:
    """How many evenly spaced positions every turn was sampled at.

    Parameters
    ----------
    turns
        Turns of the shaft, one or more.

    Returns
    -------
    int or None
        Positions a turn; None where they are uneven or differ from turn to turn.

    Notes
    -----
    On n even positions the orders k, n − k, n + k, ... are the same numbers and cannot be
    separated.

    """
    counts = set()
    for turn in turns:
        angle = np.unique(np.mod(turn.theta_rad, TURN_RAD))
        gaps = np.diff(np.append(angle, angle[0] + TURN_RAD))
        step = float(np.median(gaps[gaps > 0.3 * float(np.max(gaps))]))
        regular = np.abs(gaps - step) < 0.05 * step
        if np.count_nonzero(regular) < 0.95 * TURN_RAD / step:
            return None
        counts.add(round(TURN_RAD / step))
    return counts.pop() if len(counts) == 1 else None
