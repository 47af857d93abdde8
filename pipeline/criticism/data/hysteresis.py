"""Signals that depend on the past: travel since a reversal, and the lag of a play."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.captures import Cutting


def reversals(theta: Array, slack: float) -> Indices:
    """First samples of the runs after each reversal of an angle.

    Parameters
    ----------
    theta
        Unwrapped angle [n, rad].
    slack
        What its noise may do [rad].

    Returns
    -------
    array
        Extremes that the angle then leaves by more than `slack`.

    Examples
    --------
    >>> reversals(np.array([0.0, 1.0, 2.0, 1.9, 2.0, 1.0, 0.0]), 0.5).tolist()
    [4]

    """
    step = np.diff(theta)
    moving = np.flatnonzero(step)
    forward = step[moving] > 0
    turning_points = moving[1:][forward[1:] != forward[:-1]]
    rows = [0, *turning_points.tolist(), theta.size - 1]
    starts: list[int] = []
    direction, extreme = 0, 0
    lowest = highest = (float(theta[0]), 0)
    for row, value in zip(rows, theta[rows].tolist(), strict=True):
        lowest, highest = min(lowest, (value, row)), max(highest, (value, row))
        if direction <= 0 and value > lowest[0] + slack:
            extreme = lowest[1]
        elif direction >= 0 and value < highest[0] - slack:
            extreme = highest[1]
        else:
            continue
        if direction:
            starts.append(extreme)
        direction = 1 if value > theta[extreme] else -1
        lowest = highest = (value, row)
    return np.array(starts, dtype=np.int64)


def travel(theta: Array, slack: float) -> tuple[Array, Array, Array]:
    """Angle turned since the last reversal.

    Parameters
    ----------
    theta
        Unwrapped angle [n, rad].
    slack
        What its noise may do [rad].

    Returns
    -------
    since
        [n, rad], infinite before the first reversal.
    run
        Number of the run of each sample [n].
    turned
        Angle turned in each run [runs, rad], negative backwards; that of the first is infinite.

    """
    starts = np.concatenate([[0], reversals(theta, slack)])
    run = np.searchsorted(starts, np.arange(theta.size), side="right") - 1
    since = np.abs(theta - theta[starts[run]])
    since[run == 0] = np.inf
    ends = np.concatenate([starts[1:], [theta.size - 1]])
    turned = theta[ends] - theta[starts]
    turned[0] = math.copysign(math.inf, turned[0])
    return since, run.astype(float), turned


def with_travel(columns: dict[str, Array], noise: Mapping[str, float], policy: Cutting) -> Array:
    """Adds travel since the last reversal and number of the run to columns.

    Parameters
    ----------
    columns
        Columns [n]; `travel_rad` and `run` are put in.
    noise
        Standard deviation of `theta_mech_rad`.
    policy
        How far beyond the noise a reversal must go.

    Returns
    -------
    array [runs]
        Angle turned in each run [rad]; the first is infinite.

    """
    slack = policy.reversal_u * noise["theta_mech_rad"]
    columns["travel_rad"], columns["run"], runs = travel(columns["theta_mech_rad"], slack)
    return runs


def play_lag(signal: Array, share: float) -> Array:
    """How far a signal is ahead of one that follows it with a play: a measure of hysteresis.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    share
        Half of the play, of the largest size of the signal [1].

    Returns
    -------
    array [n]
        Same unit, at most half of the play; that where it rises, less that where it falls.

    References
    ----------
    Krasnosel'skii and Pokrovskii, Systems with Hysteresis, Springer, 1989 (play operator).

    """
    half = share * float(np.abs(signal).max(initial=0.0))
    lag, follower = [], float(signal[0]) if signal.size else 0.0
    for value in signal.tolist():
        # comparisons: min and max take three times as long
        if follower < value - half:
            follower = value - half
        elif follower > value + half:
            follower = value + half
        lag.append(value - follower)
    return np.array(lag, dtype=np.float64)
