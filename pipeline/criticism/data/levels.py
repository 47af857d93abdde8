"""Levels that a table's current was set to, noise and all."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.captures import Tables


def set_levels(current: Array, policy: Tables) -> Indices:
    """The level that was set for each current, noise and all.

    Parameters
    ----------
    current
        [n, A]
    policy
        Constants of judgement.

    Returns
    -------
    array [n]
        Number of the level, from the lowest; all 0 where there are no levels.

    Notes
    -----
    The rows are split as finely as leaves three rows a level on average, and levels further from
    each other than twice the width of the widest.

    """
    gaps = np.diff(np.sort(current))
    gaps = gaps[gaps > _least_gap(current, 0.0)]
    for least in np.unique(np.append(gaps, 0.0)):
        levels = levels_of(current, float(least))
        count = int(levels.max(initial=0)) + 1
        if current.size < policy.level_rows * count:
            continue
        widest = max(float(np.ptp(current[levels == k])) for k in range(count))
        if gaps[gaps > least].min(initial=math.inf) > policy.level_widths * widest:
            return levels
    return np.zeros(current.size, dtype=np.int64)


def parts_of(current: Array, policy: Tables) -> Indices | None:
    """Parts of a table that are held out one by one.

    Parameters
    ----------
    current
        [n, A]
    policy
        Constants of judgement.

    Returns
    -------
    array [n] or None
        Number of the level, of a sweep without levels that of its part; None of too few levels.

    """
    levels = levels_of(current)
    if levels.max(initial=0) + 1 >= policy.levels:
        return levels
    reach = float(np.ptp(current)) if current.size else 0.0
    if levels.max(initial=0) > 0 or reach == 0.0:
        return None
    place = (current - current.min()) / reach * policy.parts
    return np.minimum(place.astype(np.int64), policy.parts - 1)


def levels_of(current: Array, least: float = 0.0) -> Indices:
    """The level that each current is at; levels are separated by a gap between them.

    Parameters
    ----------
    current
        [n, A]
    least
        Gap that does not part levels [A].

    Returns
    -------
    array [n]
        Number of the level, from the lowest.

    Notes
    -----
    A gap is a step of the sorted currents over a hundredth of their range, and over `least`.

    Examples
    --------
    >>> levels_of(np.array([0.0, 5.0, 0.001, 5.001])).tolist()
    [0, 1, 0, 1]

    """
    order = np.argsort(current, kind="stable")
    jumps = np.diff(current[order]) > _least_gap(current, least)
    number = np.concatenate([[0], np.cumsum(jumps)])
    levels = np.empty(current.size, dtype=np.int64)
    levels[order] = number
    return levels


def _least_gap(current: Array, least: float) -> float:
    return max(1e-2 * float(np.ptp(current)), least)
