"""A constant that changed within a capture: a magnet that lost flux in a log, and when.

No state of the machine predicts the time of such a change. Every time between two windows of a
capture is tried, to first order, with a value of the constant of its own in every other capture;
the others then have the value from before or from after it, whichever is nearer. A constant that
moves slowly is no such change: a ramp over the capture must do worse.

Reference: Quandt, J. Am. Stat. Assoc. 53 (1958) 873, doi:10.1080/01621459.1958.10501484, a linear
regression that obeys two regimes; the interval is that of times whose likelihood is near the best.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import clock
from pipeline.criticism.discovery.changed_constants import End, by_words, may_change, unit_of
from pipeline.criticism.operating import Array, Flags
from pipeline.criticism.regression.bounds import limits_of
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import pseudo_inverse
from pipeline.criticism.selection.improvement import clears


@dataclass(frozen=True, slots=True)
class ChangeWithin:
    """A constant with another value from some time in a capture on.

    Attributes
    ----------
    name, unit
        Of the constant.
    value
        In most of the campaign, before or after.
    difference, u
        What it is more afterwards, and its standard uncertainty [unit].
    capture
        In which it changed.
    at_s
        When, from the first sample of that capture: no earlier and no later than these.
    after
        Further captures that have the later value.
    gain
        Deviance that it takes, its penalty paid.

    """

    name: str
    unit: str
    value: float
    difference: float
    u: float
    capture: str
    at_s: tuple[float, float]
    after: tuple[str, ...]
    gain: float

    @property
    def words(self) -> str:
        """What changed, by how much, where and when, in a sentence."""
        further = f", as in {', '.join(self.after)}" if self.after else ""
        first, last = self.at_s
        return (
            f"{self.name} is {by_words(self.value, self.difference, self.u, self.unit)} in "
            f"{self.capture} from a time between {first:.4g} and {last:.4g} s on{further}: it "
            "changed within that capture, with no state of the machine"
        )


def changed_within(system: LinearSystem) -> ChangeWithin | None:
    """The constant whose change within a capture explains most of what is over the floor.

    Parameters
    ----------
    system
        Around a fit that leaves something over the floor.

    Returns
    -------
    ChangeWithin or None
        None where no change takes half of the power over the floor, is worth its penalty and does
        better than a ramp.

    """
    significant = significant_groups(system)
    captures = {
        system.segments[place].capture
        for (place, _, _), is_significant in zip(system.labels, significant, strict=True)
        if is_significant
    }
    places = [
        n for n in system.model_columns.tolist() if may_change(system, system.columns[n].name)
    ]
    rows = _Rows.of(system)
    tried = [
        change
        for capture in sorted(captures)
        for change in _changes(system, rows, capture, places, significant)
    ]
    return max(tried, key=lambda change: change.gain, default=None)


@dataclass(frozen=True, slots=True)
class _Rows:
    """Capture [R] and time [R, s] of every row; NaN in tables. `reach_s` [R]: half a window."""

    capture: NDArray[np.str_]
    time_s: Array
    reach_s: Array

    @classmethod
    def of(cls, system: LinearSystem) -> _Rows:
        times, reach = np.full((2, system.residual.size), np.nan)
        for number, segment in enumerate(system.segments):
            in_segment = system.segment == number
            if segment.weak is not None:
                middle = segment.weak.starts + segment.weak.length // 2
                times[in_segment] = clock(segment)[middle][system.window[in_segment]]
                reach[in_segment] = 0.5 * segment.weak.length * segment.ts_s
        names = np.array([segment.capture for segment in system.segments])[system.segment]
        return cls(names, times, reach)


@dataclass(frozen=True, slots=True)
class _Steps:
    """Changes of one constant within a capture, at any of its window times [T, s]; captures that
    are `away` [R] have the later value.
    """

    system: LinearSystem
    time_s: Array
    in_capture: Flags
    away: Flags
    column: Array
    times: Array

    def end(self, cut: int) -> End:
        """The best fit with another value behind a time."""
        later = self.away | (self.in_capture & (self.time_s > self.times[cut]))
        return End.of(self.system, np.where(later, self.column, 0.0)[:, None])

    def ramp(self) -> End:
        """The best fit with a value that moves evenly over the capture."""
        passed = (self.time_s - self.times[0]) / (self.times[-1] - self.times[0])
        share = np.where(self.in_capture, np.clip(np.nan_to_num(passed), 0.0, 1.0), self.away)
        return End.of(self.system, (share * self.column)[:, None])

    def interval(self, cut: int, deviance: float, least: int) -> tuple[int, int]:
        """First and last cut beside the best one that captures do not discriminate from it."""
        ends, tie = [cut, cut], self.system.policy.selection.tie
        for side, step in enumerate((-1, 1)):
            beside = cut + step
            while least - 1 <= beside < self.times.size - least:
                if self.end(beside).deviance > deviance + tie:
                    break
                ends[side] = beside
                beside += step
        return ends[0], ends[1]


def _changes(
    system: LinearSystem,
    rows: _Rows,
    capture: str,
    places: list[int],
    significant: Flags,
) -> Iterator[ChangeWithin]:
    """The best change of every constant within one capture that passes."""
    in_capture, tie = rows.capture == capture, system.policy.selection.tie
    least = system.policy.discovery.change_windows
    before = End.of(system, np.empty((system.size, 0)))
    for place in places:
        column, name = system.matrix[:, place], system.columns[place].name
        shows = in_capture & (column != 0.0) & np.isfinite(rows.time_s)
        times = np.unique(rows.time_s[shows])
        if times.size < 2 * least:
            continue
        scanned = _scanned(system, rows, shows, place, times, least)
        if scanned is None:
            continue
        cut, after = scanned
        steps = _Steps(system, rows.time_s, in_capture, np.isin(rows.capture, after), column, times)
        end = steps.end(cut)
        penalty = 2.0 * math.log(system.size) + 2.0 * math.log(times.size * len(places))
        gain = before.deviance - end.deviance - penalty
        most = clears(system, significant, before.reduced_chi2, end.reduced_chi2)
        if gain <= tie or not most or steps.ramp().deviance < end.deviance + tie:
            continue
        first, last = steps.interval(cut, end.deviance, least)
        reach = float(rows.reach_s[shows].max())
        at_s = float(times[first] - reach), float(times[last + 1] + reach)
        value = system.fit.values[name] + float(end.step[place])
        difference, unit = float(end.step[-1]), unit_of(system, name)
        low, high = limits_of(system.fit.model).get(name, (-math.inf, math.inf))
        if not low <= min(value, value + difference) <= max(value, value + difference) <= high:
            continue
        yield ChangeWithin(name, unit, value, difference, end.u, capture, at_s, tuple(after), gain)


def _scanned(
    system: LinearSystem,
    rows: _Rows,
    shows: Flags,
    place: int,
    times: Array,
    least: int,
) -> tuple[int, list[str]] | None:
    """Number of the last time before the best change, and the captures that have the later value.

    Every other capture that has the constant in it has a value of its own meanwhile. None where no
    time has enough windows that show the constant on either side: a breakaway in the one window in
    which a shaft accelerates is an event, and no other inertia from then on.
    """
    column = system.matrix[:, place]
    capture = rows.capture[shows][0]
    others = [n for n in np.unique(rows.capture[column != 0.0]).tolist() if n != capture]
    columns = [np.where(rows.capture == name, column, 0.0) for name in others]
    known = np.column_stack([system.matrix[:, system.model_columns], *columns])
    weight = system.weights(system.reduced_chi2(system.residual))
    weighted = known * weight[:, None]
    inverse, slope = _covariance_and_slope(system, known, weighted)
    bins = np.searchsorted(times, rows.time_s[shows])
    changing = column[shows]
    known_by = weight[shows] * changing**2
    cross = _later(weighted[shows] * changing[:, None], bins)
    residual = weight[shows] * changing * system.residual[shows]
    slopes = _later(residual, bins) - cross @ inverse @ slope
    free = _later(known_by, bins) - np.einsum("ti,ij,tj->t", cross, inverse, cross)
    gain = np.where(free > 0.0, slopes**2 / np.maximum(free, 1e-300), 0.0)
    inside = np.arange(gain.size)
    few = _windows(known_by, bins) < least
    gain[few | (inside < least - 1) | (inside >= times.size - least)] = -1.0
    cut = int(np.argmax(gain))
    if gain[cut] < 0.0:
        return None
    difference = -slopes[cut] / max(float(free[cut]), 1e-300)
    step = -inverse @ (slope + cross[cut] * difference)
    return cut, [
        n
        for n, own in zip(others, step[step.size - len(others) :].tolist(), strict=True)
        if abs(own - difference) < abs(own)
    ]


def _covariance_and_slope(
    system: LinearSystem, known: Array, weighted: Array
) -> tuple[Array, Array]:
    """Of the model's own columns and further ones, `known` [R, k], which no prior restricts."""
    precision, gradient = (
        np.pad(of[system.model_columns], (0, known.shape[1] - system.model_columns.size))
        for of in (system.prior_precision, system.prior_gradient)
    )
    inverse = pseudo_inverse(weighted.T @ known + np.diag(precision))
    return inverse, weighted.T @ system.residual + gradient


def _later(parts: Array, bins: NDArray[np.intp]) -> Array:
    """Sums [T - 1] over what is later than each time but the last; `bins` number the times."""
    summed = np.zeros((int(bins.max()) + 1, *parts.shape[1:]))
    np.add.at(summed, bins, parts)
    return np.cumsum(summed[::-1], axis=0)[::-1][1:]


def _windows(known_by: Array, bins: NDArray[np.intp]) -> Array:
    """Effective number of windows [T - 1] that share what is known: (Σ k)²/Σ k² (Kish, 1965), on
    the side of each time that has fewer. Either side is summed from its own end: a difference of
    two sums rounds to nothing.
    """
    sides = [
        (_later(known_by, bins), _later(known_by**2, bins)),
        (_earlier(known_by, bins), _earlier(known_by**2, bins)),
    ]
    later, earlier = (total**2 / np.maximum(squares, 1e-300) for total, squares in sides)
    return np.minimum(later, earlier)


def _earlier(parts: Array, bins: NDArray[np.intp]) -> Array:
    """Sums [T - 1] over what is no later than each time but the last."""
    return np.cumsum(np.bincount(bins, parts), dtype=np.float64)[:-1]
