"""What the numbers of a table say: which column is a clock, what wraps, what integrates to what."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_MOST_COLUMNS = 60
_LEAST_ROWS = 20
_FILLED = 0.9
_ROUNDED = 1e-3
"""What the digits of a file may add to the range of its readings, over that range."""
_ALIKE = 0.999
"""Least correlation of a signal with another's integral, both without their straight line."""
_SAME = 0.99999
_KNOWN_SPANS = (1.0, 2.0 * math.pi, 360.0, *(2.0**n for n in range(3, 33)))


@dataclass(frozen=True, slots=True)
class Clock:
    """A field that only goes up: its median `step`, `jitter` and the longest `gap` in steps."""

    field: str
    step: float
    jitter: float
    gap: float


@dataclass(frozen=True, slots=True)
class Relation:
    """`field` = factor * (integral of `other` over the clock, or `other` itself)."""

    field: str
    other: str
    factor: float
    integral: bool


@dataclass(frozen=True, slots=True)
class Evidence:
    """What is found in one table; `wraps` is the span of fields that start again, by name."""

    clocks: tuple[Clock, ...] = ()
    wraps: tuple[tuple[str, float], ...] = ()
    relations: tuple[Relation, ...] = ()


def gather(fields: Mapping[str, NDArray[Any]], clock: str | None = None) -> Evidence:
    """The evidence in the numbers of a table: clocks, fields that wrap, integrals and multiples.

    Parameters
    ----------
    fields
        Columns by name [rows].
    clock
        The field that is the time, if it is known.

    Returns
    -------
    Evidence
        An angle is compared with the integral of a speed, which noise hardly touches, not a speed
        with the differences of an angle.

    """
    numbers = _whole_rows(fields)
    wraps = {name: span for name, values in numbers.items() if (span := span_of(values))}
    unwrapped = {n: np.unwrap(v, period=wraps[n]) if n in wraps else v for n, v in numbers.items()}
    clocks = tuple(c for name, values in unwrapped.items() if (c := _clock(name, values)))
    best = clock if clock in unwrapped else None
    if best is None and clocks:
        best = min(clocks, key=lambda c: c.jitter).field
    relations = _integrals(unwrapped, best) if best else ()
    return Evidence(clocks, tuple(wraps.items()), (*relations, *_multiples(unwrapped)))


def _whole_rows(fields: Mapping[str, NDArray[Any]]) -> dict[str, Array]:
    """The fields that nearly every row has, in the rows that have them all."""
    numbers = {n: v.astype(np.float64) for n, v in list(fields.items())[:_MOST_COLUMNS]}
    full = {n: v for n, v in numbers.items() if np.isfinite(v).mean() > _FILLED} if numbers else {}
    if not full:
        return {}
    rows = np.all([np.isfinite(values) for values in full.values()], axis=0)
    return {n: v[rows] for n, v in full.items()} if rows.sum() >= _LEAST_ROWS else {}


def span_of(values: Array) -> float | None:
    """The span after which a counter or an angle starts again.

    Parameters
    ----------
    values
        Readings [rows].

    Returns
    -------
    float or None
        In the unit of the values; None where it does not start again.

    Notes
    -----
    Nearly the whole range is passed in one row, downwards or (turning back) upwards, at least once,
    and no other step is longer than a third of it. A span that is a power of two, a turn or a round
    number and fits within one usual step is taken for it; what goes to and fro wraps at a turn or a
    power of two alone.

    """
    steps = np.diff(values)
    reach = float(np.ptp(values))
    falls = np.abs(steps) > 0.7 * reach
    if not reach or not falls.any() or falls.all():
        return None
    usual = steps[~falls]
    if np.abs(usual).max() > reach / 3.0 or not np.count_nonzero(usual) > usual.size / 2:
        return None
    onward = float(np.median(usual)) or float(np.mean(usual))
    span = float(np.median(np.abs(steps[falls]) + abs(onward)))
    slack = max(float(np.abs(usual).max()), 1e-3 * span)
    # as it is written, a turn from -3.142 to 3.142 is longer than a turn
    low, high = max(span - slack, (1.0 - _ROUNDED) * reach), span + slack
    known = next((one for one in _KNOWN_SPANS if low <= one <= high), None)
    if known is not None or not (np.sign(steps[falls]) == -np.sign(onward)).all():
        return known
    return _roundest(low, high, span)


def _roundest(low: float, high: float, span: float) -> float:
    """The number of fewest digits between two bounds, or `span`."""
    digits = 10.0 ** math.floor(math.log10(high))
    while digits > 1e-3 * span:
        rounded = math.floor(high / digits) * digits
        if rounded >= low:
            return rounded
        digits /= 10.0
    return span


def _clock(name: str, values: Array) -> Clock | None:
    steps = np.diff(values)
    if steps.size == 0 or not (steps > 0).all():
        return None
    median = float(np.median(steps))
    return Clock(name, median, float(np.std(steps)) / median, float(steps.max()) / median)


def _without_line(values: Array, along: Array) -> Array:
    slope, start = np.polyfit(along - along[0], values, 1)
    return values - start - slope * (along - along[0])


def _integrals(numbers: Mapping[str, Array], clock: str) -> tuple[Relation, ...]:
    """Which field is the integral of which; a straight line is no evidence."""
    time = numbers[clock]
    halves = np.diff(time) / 2.0
    pairs = []
    flat = {n: _without_line(v, time) for n, v in numbers.items() if n != clock and np.ptp(v)}
    sums = {
        name: np.concatenate([[0.0], np.cumsum(halves * (values[1:] + values[:-1]))])
        for name, values in numbers.items()
        if name in flat
    }
    for other, total in sums.items():
        one = _without_line(total, time)
        for name, values in flat.items():
            if name != other and _correlation(values, one) > _ALIKE:
                factor = float(values @ one / (one @ one))
                pairs.append(Relation(name, other, factor, integral=True))
    return tuple(pairs)


def _multiples(numbers: Mapping[str, Array]) -> Iterator[Relation]:
    """Which field is a multiple of which, through zero."""
    names = [name for name, values in numbers.items() if np.ptp(values)]
    for place, name in enumerate(names):
        for other in names[:place]:
            one, two = numbers[name], numbers[other]
            factor = float(one @ two / (two @ two))
            error = one - factor * two
            if np.ptp(one) and float(error @ error) < (1.0 - _SAME) * float(np.var(one)) * one.size:
                yield Relation(name, other, factor, integral=False)


def _correlation(one: Array, two: Array) -> float:
    size = math.sqrt(float(one @ one) * float(two @ two))
    return abs(float(one @ two)) / size if size > 0.0 else 0.0
