"""Orders a turn that a fit leaves in logs under load, whether its equations look at them or not.

The weak form looks at the orders that a machine's design gives: what turns with any other averages
out of every window, and would be left over unseen.

What the machine itself does comes back after a turn, so that its orders are whole; a bearing, a
gear or a belt has others.

Reference: Lomb, Astrophys. Space Sci. 39 (1976), the spectrum of samples that are not even, here
even in time and not in angle; Högbom, Astron. Astrophys. Suppl. 15 (1974), the strongest line taken
out before the next is looked for; Randall & Antoni, Mech. Syst. Signal Process. 25 (2011), orders
of bearings.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby, pairwise

import numpy as np
from scipy.ndimage import median_filter

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.operating import Array, Complex, Indices
from pipeline.criticism.policy.selection import OrderScan
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.goodness import material_size
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.parallel import on_each
from pipeline.criticism.residuals.residual import residual
from pipeline.numerics.projection import Projection, bump
from pipeline.physics.units import TURN_RAD


def orders_left(system: LinearSystem) -> tuple[float, ...]:
    """Orders that a fit leaves in logs under load, and that no equation looks at.

    Parameters
    ----------
    system
        Around a fit.

    Returns
    -------
    tuple of float
        [1/turn]; one that is no whole number as close as the logs' angles show it.

    Notes
    -----
    An order counts that two captures have over what is beside it and in a size that matters, or
    both halves of the only log. What the machine itself does comes back after a turn, so that its
    orders are whole; a bearing, a gear or a belt has others.

    References
    ----------
    Lomb, Astrophys. Space Sci. 39(2), 1976, 447 (samples that are not even),
    doi:10.1007/BF00648343.
    Randall and Antoni, Mech. Syst. Signal Process. 25(2), 2011, 485 (orders of bearings),
    doi:10.1016/j.ymssp.2010.07.017.

    """
    policy = system.policy.order_scan
    arguments = [(system.fit.alone,)] * len(system.segments)
    lines = [line for lines in on_each(_lines_in, system.segments, arguments) for line in lines]
    lines.sort(key=lambda line: line[0])
    only = len({s.capture for s in system.segments if _has_waves(s)}) < policy.captures
    orders = []
    for cluster in _clustered(lines, policy):
        logs = [log for _, log in cluster]
        seen = {log.capture for log in logs}
        if len(seen) >= policy.captures or (only and _in_all_parts(cluster, policy)):
            found = [order for order, _ in cluster]
            order = float(np.median(found))
            # one that all logs have at a whole number, stronger lines taken out of each, is that
            if not order.is_integer() or len(set(found)) > 1:
                order = _common(order, logs, policy)
            orders.append(int(order) if order.is_integer() else order)
    return tuple(dict.fromkeys(orders))


@dataclass(frozen=True, slots=True)
class Part:
    """Part of a log, over which waves of the angle are sought.

    Attributes
    ----------
    residual
        Residual of a signal [n, its unit].
    theta_rad
        Angle of the shaft [n].
    weight
        Weight of each sample [n].
    current
        Current that waves may grow with [n, A].

    """

    residual: Array
    theta_rad: Array
    weight: Array
    current: Array

    @property
    def carriers(self) -> tuple[Array, Array]:
        """What is looked at for waves [n]: the plain weight, and the weight times the current."""
        return self.weight, self.weight * self.current

    @property
    def scales(self) -> Array:
        """What the square of a sum over one carrier is in mean squares of the signal [2]."""
        power = np.array([self.weight.sum(), (self.weight * self.current) @ self.current])
        return 2.0 / np.maximum(power * self.weight.sum(), 1e-300)

    def power(self, orders: Array) -> Array:
        """Mean square of waves of some orders with each carrier.

        Parameters
        ----------
        orders
            Waves a turn [K].

        Returns
        -------
        array [2, K]
            In squared units of the signal; carriers are the weight, and the weight times the
            current.

        """
        return self.scales[:, None] * np.abs(self.waves(orders)) ** 2

    def waves(self, orders: Array) -> Complex:
        """Sums of the residual times a wave of the angle and a carrier.

        Parameters
        ----------
        orders
            Waves a turn [K].

        Returns
        -------
        array [2, K], complex
            One row a carrier.

        """
        carried = np.stack(self.carriers) * self.residual
        sums = [carried @ np.exp(-1j * order * self.theta_rad) for order in orders.tolist()]
        return np.array(sums).T

    def spectrum(self, count: int, step: float) -> Array:
        """Mean square of waves of every order of a grid, as `power`.

        Parameters
        ----------
        count
            Number K of orders.
        step
            Distance between them, and the first order.

        Returns
        -------
        array [2, K]
            In squared units of the signal.

        """
        turn = np.exp(-1j * step * self.theta_rad)
        carried = np.stack(self.carriers) * self.residual + 0j
        sums = np.empty((2, count), dtype=np.complex128)
        for place in range(count):
            carried *= turn
            sums[:, place] = carried.sum(axis=1)
        return self.scales[:, None] * np.abs(sums) ** 2

    def without(self, order: float) -> Part:
        """The part less its best waves of one order.

        Parameters
        ----------
        order
            Waves a turn.

        Returns
        -------
        Part
            Less waves of constant size, in proportion to the current, and to its magnitude.

        """
        turn = np.exp(1j * order * self.theta_rad)
        sizes = np.stack([np.ones(turn.size), self.current, np.abs(self.current)])
        waves = np.concatenate([sizes * turn.real, sizes * turn.imag])
        weighted = self.weight * waves
        best = np.linalg.lstsq(weighted @ waves.T, weighted @ self.residual, rcond=1e-9)[0]
        return replace(self, residual=self.residual - best @ waves)


@dataclass(frozen=True, slots=True)
class Log:
    """The residual of one signal of a capture, in which orders are sought.

    Attributes
    ----------
    capture, channel
        The capture and the signal.
    whole, parts
        The log, and parts of a few turns each.
    least
        Rms that matters [unit of the signal].
    looked_at
        Orders that the equations of the signal observe.

    """

    capture: str
    channel: str
    whole: Part
    parts: tuple[Part, ...]
    least: float
    looked_at: frozenset[float]

    def divided(self, count: int) -> list[Log]:
        """The log in some parts of its time, as if each were a capture.

        Parameters
        ----------
        count
            How many.

        Returns
        -------
        list of Log
            None where there are fewer parts of a few turns than that.

        """
        edges = np.linspace(0.0, len(self.parts), count + 1).round().astype(int)
        if len(self.parts) < count:
            return []
        return [replace(self, parts=self.parts[a:b]) for a, b in pairwise(edges.tolist())]


Line = tuple[float, Log]
"""An order that stands out of a log."""


def _in_all_parts(cluster: Sequence[Line], policy: OrderScan) -> bool:
    """Whether each part of the time of the only log has the order of a cluster."""
    for order, log in cluster:
        lines = [_lines(part, policy) for part in log.divided(policy.captures)]
        near = [any(abs(order - other) <= policy.apart for other in part) for part in lines]
        if near and all(near):
            return True
    return False


def _lines_in(segment: Segment, fit: Fit) -> list[Line]:
    """The orders that stand out of a segment's logs, and that its equation does not look at."""
    return [
        (order, log)
        for log in _logs(segment, fit)
        for order in _lines(log, fit.policy.order_scan)
        if order not in log.looked_at
    ]


def _logs(segment: Segment, fit: Fit) -> Iterator[Log]:
    weak, theta = segment.weak, segment.recorded.get("theta_mech_rad")
    if weak is None or theta is None or not _has_waves(segment):
        return
    weight = _weight(weak, segment.size)
    rows = list(_parts(theta, weight, fit.policy.order_scan))
    if not rows:
        return
    current = segment.recorded["iq_a"]
    residuals = residual(segment, fit.model, fit.values)
    looked_at = frozenset(weak.orders.tolist())
    for channel, one in zip(segment.channels, residuals, strict=True):
        parts = tuple(Part(one[r], theta[r], weight[r], current[r]) for r in rows)
        whole = Part(one, theta, weight, current)
        least = material_size(segment, channel, fit)
        yield Log(segment.capture, channel, whole, parts, least, looked_at)


def _has_waves(segment: Segment) -> bool:
    """Whether a segment is a log of a current and of an angle that a sensor recorded."""
    logged = {"theta_mech_rad", "iq_a"} <= set(segment.recorded)
    return segment.weak is not None and segment.sensors.speed is None and logged


def _weight(weak: Projection, size: int) -> Array:
    """Weight [n] of the samples: the sum of the windows they are in, nothing beside a gap."""
    weight = np.zeros(size)
    shape = bump(weak.length)
    for start in weak.starts.tolist():
        weight[start : start + weak.length] += shape
    return weight


def _parts(theta: Array, weight: Array, policy: OrderScan) -> Iterator[Indices]:
    """Rows of each part of a log, of some four turns."""
    rows = np.flatnonzero(weight > 0.0)
    if not rows.size:
        return
    step = np.abs(np.diff(theta[rows], prepend=theta[rows[:1]]))
    # a gap between windows is no turn that anything was seen of
    turned = np.cumsum(np.where(np.diff(rows, prepend=rows[:1] - 1) == 1, step, 0.0))
    turns = float(turned[-1]) / TURN_RAD
    count = max(round(turns / policy.turns), int(turns >= policy.least_turns))
    edges = np.searchsorted(turned, np.linspace(0.0, turned[-1], count + 1)) if count else ()
    for first, last in pairwise(edges):
        # a shaft that turns far in a row may leave none to a part
        if last - first > 1:
            yield rows[first:last]


def _lines(log: Log, policy: OrderScan) -> list[float]:
    """Orders that stand out of the twelve steps at either side by 20 in power and have an rms that
    matters; the clearest is taken out before the next is looked for.

    What is beside a line is judged with the line taken out: a few turns with gaps between them
    spread a clear line over its neighbours.
    """
    parts = log.parts
    seen_to = (_seen_to(part.theta_rad, policy.samples) for part in parts)
    count = int(min(policy.highest, *seen_to) / policy.step)
    if count <= 2 * policy.beside:
        return []
    grid = policy.step * np.arange(1, count + 1)
    power, beside = _spectrum(parts, count, policy)
    lines: list[float] = []
    while len(lines) < policy.most:
        matters = (power > log.least**2) & (grid >= policy.lowest)
        best = int(np.argmax(np.where(matters, power / beside, 0.0).max(axis=0)))
        if not matters[:, best].any():
            break
        order = _peak(parts, float(grid[best]), policy)
        parts = tuple(part.without(order) for part in parts)
        remaining, beside = _spectrum(parts, count, policy)
        clear = np.where(matters[:, best], power[:, best] / beside[:, best], 0.0)
        if float(clear.max()) <= policy.stands_out:
            break
        lines.append(order)
        power = remaining
    return lines


def _spectrum(parts: Sequence[Part], count: int, policy: OrderScan) -> tuple[Array, Array]:
    """Mean power [2, K] of the parts at every order of the grid, and its median beside each."""
    power: Array = np.mean([part.spectrum(count, policy.step) for part in parts], axis=0)
    beside = median_filter(power, (1, 2 * policy.beside + 1), mode="nearest")
    return power, np.maximum(beside, 1e-300)


def _peak(parts: Sequence[Part], rough: float, policy: OrderScan) -> float:
    """The order within a step that has the most power; a whole one that has about as much."""
    whole = float(round(rough))
    tried = np.append(rough + policy.step * np.linspace(-1.0, 1.0, 2 * policy.finer + 1), whole)
    power = np.sum([part.power(tried) for part in parts], axis=0).max(axis=0)
    best = int(np.argmax(power))
    return whole if power[-1] >= policy.whole_share * power[best] else float(tried[best])


def _clustered(lines: Sequence[Line], policy: OrderScan) -> Iterator[list[Line]]:
    """Lines in order, cut where two that follow each other are apart."""
    number, before = 0, -math.inf
    numbers = []
    for order, _ in lines:
        number += order - before > policy.apart
        before = order
        numbers.append(number)
    for _, members in groupby(zip(numbers, lines, strict=True), key=lambda one: one[0]):
        yield [line for _, line in members]


def _common(rough: float, logs: Sequence[Log], policy: OrderScan) -> float:
    """The order that several logs have: whole, or where waves of one phase fit all of them best.

    Angles go on from turn to turn, so that a wave of any order is one function of them.
    """
    order = _peak([part for log in logs for part in log.parts], rough, policy)
    if order.is_integer():
        return order
    channels = dict.fromkeys(log.channel for log in logs)
    turned = np.ptp(np.concatenate([log.whole.theta_rad for log in logs])) / TURN_RAD
    count = int(policy.oversampled * policy.apart * turned) + 1
    tried = order + policy.apart * np.linspace(-1.0, 1.0, 2 * count + 1)
    power = [_in_phase([g.whole for g in logs if g.channel == name], tried) for name in channels]
    return round(float(tried[int(np.argmax(np.sum(power, axis=0).max(axis=0)))]), 4)


def _in_phase(logs: Sequence[Part], orders: Array) -> Array:
    """Power [2, K] of waves that have one size and phase in all logs, with each carrier."""
    total = np.sum([log.waves(orders) for log in logs], axis=0)
    weight = np.sum([[log.weight.sum(), log.carriers[1] @ log.current] for log in logs], axis=0)
    return np.abs(total) ** 2 / np.maximum(weight, 1e-300)[:, None]


def _seen_to(theta: Array, samples: float) -> float:
    """Highest order that has samples enough a cycle."""
    return TURN_RAD / (samples * float(np.median(np.abs(np.diff(theta)))) + 1e-12)
