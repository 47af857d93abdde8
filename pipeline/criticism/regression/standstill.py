"""What friction may do where a log does not show how the shaft moves: at rest, and turning back."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model, evaluate
from pipeline.criticism.operating import Array, Flags, Operating, Values
from pipeline.numerics.plateaus import true_runs


def at_rest(segment: Segment, model: Model, values: Values, x: Operating) -> Array:
    """Error of torque that friction may make where the shaft rests or creeps.

    Parameters
    ----------
    segment
        A log, whole.
    model, values
        What friction there is.
    x
        State of the machine.

    Returns
    -------
    array [W]
        [N·m], as weak samples.

    Notes
    -----
    Whatever the log says of its speed, a shaft that sticks is held by anything between plus and
    minus its friction: T/√3, a rectangle's standard deviation. A bearing that sticks still yields:
    so does a shaft that is slow and goes nowhere before it turns again.

    References
    ----------
    Armstrong-Hélouvry, Control of Machines with Friction (1991), ch. 4.

    """
    weak = segment.windows
    policy, floors = model.policy.cutting, model.policy.noise_floors
    slow = policy.slowest_share * model.machine.scales["speed_rad_s"]
    finer = x.theta_rad.size // segment.size
    least = max(round(floors.rest_s / x.ts_s), 1)
    speed, most = x.omega_rad_s[::finer], policy.turning_rad / x.ts_s
    rests = _rests(speed, slow, least, most, floors.rest_passes)
    creeping = np.flatnonzero(_with_neighbours(rests))
    if creeping.size < 2:
        return np.zeros(weak.starts.size)
    resting = x.at(finer * creeping)
    drag = frozenset({"torque"})
    onward, back = (
        evaluate(model, replace(resting, omega_rad_s=pace), values, drag).drag_nm
        for pace in (np.full(creeping.size, speed) for speed in (slow, -slow))
    )
    grip = np.zeros(segment.size)
    grip[creeping] = 0.5 * np.abs(onward - back) / math.sqrt(3.0)
    return np.abs(weak.project(grip[None])[0, :, 0])


def at_reversals(segment: Segment, model: Model, values: Values, x: Operating) -> Array:
    """Error of torque that reversals make: a log does not say when between two samples the shaft
    turned back, and friction with it.

    Parameters
    ----------
    segment
        A log, whole.
    model, values
        What friction there is.
    x
        State of the machine.

    Returns
    -------
    array [W]
        [N·m], as weak samples.

    """
    weak = segment.windows
    finer = x.theta_rad.size // segment.size
    pace = x.omega_rad_s[::finer]
    back = np.flatnonzero(pace[1:] * pace[:-1] < 0.0)
    change = np.zeros(segment.size)
    if back.size:
        beside = x.at(finer * np.concatenate([back, back + 1]))
        drag_nm = evaluate(model, beside, values, frozenset({"torque"})).drag_nm
        change[back] = drag_nm[back.size :] - drag_nm[: back.size]
    rows = weak.starts[:, None] + np.arange(weak.length)[None, :]
    share = model.policy.noise_floors.reversal_periods
    return share * np.sqrt((change[rows] ** 2) @ (weak.functions[0, 0] ** 2))


def _with_neighbours(which: Flags) -> Flags:
    """Some samples [n] and those beside them, whose speed is a difference across a rest's edge."""
    beside = which.copy()
    beside[1:] |= which[:-1]
    beside[:-1] |= which[1:]
    return beside


def _rests(speed: Array, slow: float, least: int, most: float, times: float) -> Flags:
    """The samples [n] of runs in which a shaft is slower than `slow` and goes nowhere.

    A run has `least` samples, and the sum of its speeds is below `most`: a slow turn is no rest. A
    reversal on the way is none either: the shaft stays for so many `times` what the speed takes to
    pass from `slow` to zero as it changes before, and on from zero as it changes after. One that
    comes to rest slowly may leave at once.
    """
    rests = np.zeros(speed.size, dtype=bool)
    for first, end in true_runs(np.abs(speed) < slow):
        beside = speed[max(first - least, 0) : first + 1], speed[end - 1 : end + least]
        changes = [np.ptp(one) / (one.size - 1) for one in beside if one.size > 1]
        passes = (
            2.0 * slow * np.mean([1.0 / c for c in changes]) if changes and all(changes) else 0.0
        )
        size, travel = end - first, np.abs(speed[first:end]).sum()
        rests[first:end] = size >= max(least, times * passes) and travel < most
    return rests
