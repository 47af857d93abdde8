"""Drag that changes with time within captures: cold grease, a seal that runs in, a rub that starts.

While a shaft coasts, its speed and the time since it was let go are one to one, so a drag that
changes with time can pass for one of another form over speed. Captures that have different speeds
at the same time part the two: coasts from other speeds, repeated coasts, drives. A law of time is
fitted beside the best law of speed that all captures have in common, and beside one that has a
part of its own in either sense. Where time explains more, start and end of the captures are two
readings of the drag, and what they differ by belongs to its uncertainty.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import minimize_scalar

from pipeline.estimation.mechanical.drag_forms import CURVE
from pipeline.estimation.mechanical.shaft_rows import COAST, ShaftRows
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import (
    Array,
    LinearFit,
    autocorrelation_time,
    fit_by_groups,
)
from pipeline.numerics.shaft_log import motion_column
from pipeline.records.uncertainty import BETWEEN, Contribution

RELAXES, STEPS = "relaxes", "steps"
REPEAT = (
    "let it run warm, then record several coasts from different speeds in each sense, one after "
    "the other"
)


@dataclass(frozen=True, slots=True)
class DragOverTime:
    """How Coulomb and viscous drag over inertia change with the time since a capture's start.

    Attributes
    ----------
    kind
        `RELAXES` by exp(−t/τ), or `STEPS` at a time.
    time_s
        τ, or the time of the step [s].
    span_s
        Earliest and latest time of the rows [s].
    first, last, final
        T_c/J [rad/s²] and B/J [1/s] at the earliest and latest time, and what they approach.
    by_sense
        Whether a part of the drag with a value of its own in each sense explains the rows as well.

    """

    kind: str
    time_s: float
    span_s: tuple[float, float]
    first: Array
    last: Array
    final: Array
    by_sense: bool

    def part(self, place: int, value: float, scale: float, source: str) -> Contribution:
        """What the readings differ by, for the budget of a constant.

        Parameters
        ----------
        place
            0 for Coulomb, 1 for viscous drag.
        value
            The constant that is published [its unit].
        scale
            Of the constant over drag over inertia.
        source
            Name of the contribution.

        Returns
        -------
        Contribution
            Standard deviation of the two readings that are farthest apart, with one degree of
            freedom.

        """
        readings = [value, *(scale * float(r[place]) for r in (self.first, self.last, self.final))]
        apart = max(readings) - min(readings)
        return Contribution(f"{BETWEEN}{source}", apart / math.sqrt(2.0), "A", 1.0)

    def is_open(self, place: int) -> bool:
        """Whether a drag had more of its change before it when the captures ended than behind it:
        what it comes to is then not in them.

        Parameters
        ----------
        place
            0 for Coulomb, 1 for viscous drag.

        """
        first, last, final = (float(r[place]) for r in (self.first, self.last, self.final))
        return abs(final - last) > abs(last - first)

    @property
    def words(self) -> str:
        """What changed, by how much, when, and what would look the same."""
        begin, end = (f"{one:.3g} s" for one in self.span_s)
        names = ("Coulomb", "viscous")
        changes = [
            f"{name} friction is {100.0 * (a / b - 1.0):+.3g} % {begin} after the start of the "
            f"captures, of what it is after {end}"
            for name, a, b in zip(names, self.first, self.last, strict=True)
            if a != b and b > 0.0
        ]
        how = "steps after" if self.kind == STEPS else "relaxes with a time constant of"
        words = [*changes, f"it {how} {self.time_s:.3g} s"]
        if self.is_open(0) or self.is_open(1):
            words.append("most of the change was still to come when they ended")
        if self.by_sense:
            words.append("a drag of its own in each sense would look the same")
        return f"friction changes with time within the captures ({'; '.join(words)}); {REPEAT}"


def drag_over_time(
    rows: ShaftRows, law: Array, nuisances: Array, speed_laws: Sequence[Array], level: float
) -> DragOverTime | None:
    """Whether drag changes with time within the captures, where they tell that from speed.

    Parameters
    ----------
    rows
        Windows of coasts and drives.
    law
        Columns [w, k], T_c/J and B/J last, what drives the shaft first.
    nuisances
        Further columns that are in every fit [w, m].
    speed_laws
        Designs [w, ...] of the laws of speed that were fitted to all captures alike.
    level
        Chance of a change that is none [1].

    Returns
    -------
    DragOverTime or None
        None where a law of speed explains the rows as well, or two numbers do.

    Notes
    -----
    Laws are compared by Schwarz's criterion with one variance a kind of capture; windows that
    overlap count by what they do not share, and for their correlation. A law of time pays for its
    scale, and for how many were tried.

    References
    ----------
    Schwarz, Annals of Statistics 6(2), 1978, 461, doi:10.1214/aos/1176344136.

    """
    y, age = rows.acceleration_rad_s2, _ages(rows)
    if len(rows.captures) < policy().drag_over_time.captures or float(np.ptp(age)) <= 0.0:
        return None
    base = np.column_stack([law, nuisances])
    curve = np.column_stack([law[:, :-2], *(-rows.columns[n] for n in CURVE), nuisances])
    coasting = (rows.kind == COAST).astype(float)
    senses = np.column_stack([curve, coasting, np.abs(rows.speed_rad_s)])
    richest = _Ranked.of(rows, senses, y)
    time = _best_of_time(rows, base, age, law.shape[1], richest.sigma)
    count = rows.count * (1.0 - policy().shaft_rows.overlap)
    common = min((_Ranked.of(rows, d, y) for d in (base, curve, *speed_laws)), key=_cost(count))
    beside, margin = time.ranked, -2.0 * math.log(max(level, 1e-300))
    # what a poor law leaves is correlated because it is poor
    memory = max(1.0, min(one.memory() for one in (beside, richest, common)))
    cost = _cost(count / memory)
    own = cost(beside) + 2.0 * math.log(time.tried) + math.log(max(count / memory, 2.0))
    if own > cost(common) - margin or own > cost(richest) + margin:
        return None
    return time.found(age, law.shape[1], own > cost(richest) - margin)


def _ages(rows: ShaftRows) -> Array:
    """Time of every row since the first sample of its capture [w, s]."""
    clocks = (c.arrays("t_s", motion_column(c))["t_s"] for c in rows.captures)
    starts = np.array([float(np.nanmin(clock)) for clock in clocks])
    return rows.time_s - starts[rows.capture]


@dataclass(frozen=True, slots=True)
class _Ranked:
    """A law's fit with one standard deviation a kind of capture [w], and its −2 log L."""

    fit: LinearFit
    sigma: Array
    deviance: float
    size: int

    @classmethod
    def of(cls, rows: ShaftRows, design: Array, y: Array) -> _Ranked:
        fit, sigma = fit_by_groups(design, y, rows.kinds(), 4)
        return cls(fit, sigma, float(2.0 * np.sum(np.log(sigma))), design.shape[1])

    def memory(self) -> float:
        """How many windows that share no sample count as one."""
        tau = autocorrelation_time(self.fit.residuals / self.sigma, policy().evidence.memory_rows)
        return tau * (1.0 - policy().shaft_rows.overlap)


def _cost(count: float) -> Callable[[_Ranked], float]:
    """Schwarz's criterion of laws by so many windows as count, of their rows."""

    def cost(one: _Ranked) -> float:
        share = count / one.sigma.size
        return share * one.deviance + one.size * math.log(max(count, 2.0))

    return cost


@dataclass(frozen=True, slots=True)
class _OfTime:
    """The law of time that explains most: `course` [w] multiplies the drags at `moving`."""

    kind: str
    time_s: float
    moving: tuple[int, ...]
    ranked: _Ranked
    tried: int

    def found(self, age: Array, drags: int, by_sense: bool) -> DragOverTime:
        """Its readings of the drag; `drags` is the place behind the two drags."""
        span = float(age.min()), float(age.max())
        values = self.ranked.fit.coefficients
        steady = values[drags - 2 : drags]
        change = np.zeros(2)
        change[list(self.moving)] = values[-len(self.moving) :]
        first, last = (steady + change * float(_course(self.kind, self.time_s, t)) for t in span)
        final = last if self.kind == STEPS else np.maximum(steady, 0.0)
        return DragOverTime(self.kind, self.time_s, span, first, last, final, by_sense)


def _course(kind: str, time_s: float, age: Array | float) -> Array:
    """What a change is of its full size at times since the start [w, s]."""
    if kind == STEPS:
        return np.asarray(np.asarray(age) > time_s, dtype=np.float64)
    return np.asarray(np.exp(-np.asarray(age) / time_s))


def _best_of_time(rows: ShaftRows, base: Array, age: Array, drags: int, sigma: Array) -> _OfTime:
    """The law of time that explains most, first with the noise that the richest law leaves."""
    span, limits = float(age.max()), policy().drag_over_time
    shortest, longest = limits.scales
    scales: dict[str, Array] = {
        RELAXES: span * np.geomspace(shortest, longest, limits.trials, dtype=np.float64),
        STEPS: span * np.linspace(0.0, 1.0, limits.trials + 2)[1:-1],
    }
    changing = ((0,), (1,), (0, 1))
    tried = len(changing) * sum(s.size for s in scales.values())
    y, drag, best = rows.acceleration_rad_s2, base[:, drags - 2 : drags], None
    count = rows.count * (1.0 - policy().shaft_rows.overlap)
    for _ in range(2):
        left = _Left.of(base, y, drag, sigma)
        ends = [
            (left.best(age, kind, of_kind, moving), kind, moving)
            for kind, of_kind in scales.items()
            for moving in changing
        ]
        # a drag that does not change has a column less
        (_, at), kind, moving = min(
            ends,
            key=lambda end: count * math.log(end[0][0]) + math.log(max(count, 2.0)) * len(end[2]),
        )
        moved = _course(kind, at, age)[:, None] * drag[:, list(moving)]
        ranked = _Ranked.of(rows, np.column_stack([base, moved]), y)
        best = _OfTime(kind, at, moving, ranked, tried)
        sigma = ranked.sigma
    assert best is not None
    return best


@dataclass(frozen=True, slots=True)
class _Left:
    """What a law without time leaves, over the noise [w], and the drags' columns [w, 2]."""

    basis: Array
    y: Array
    drags: Array

    @classmethod
    def of(cls, base: Array, y: Array, drags: Array, sigma: Array) -> _Left:
        scaled = base / sigma[:, None]
        norm = np.linalg.norm(scaled, axis=0)
        left, size, _ = np.linalg.svd(scaled[:, norm > 0.0] / norm[norm > 0.0], full_matrices=False)
        basis = left[:, size > 1e-8 * size[0]]
        whitened = y / sigma
        return cls(basis, whitened - basis @ (basis.T @ whitened), drags / sigma[:, None])

    def squares(self, course: Array, moving: tuple[int, ...]) -> float:
        """Weighted sum of squares with the drags at `moving` changing by `course` [w]."""
        columns = course[:, None] * self.drags[:, list(moving)]
        length = np.linalg.norm(columns, axis=0)
        columns = columns - self.basis @ (self.basis.T @ columns)
        kept = np.linalg.norm(columns, axis=0) > 1e-6 * length
        if not kept.any():
            return float(self.y @ self.y)
        step = np.linalg.lstsq(columns[:, kept], self.y, rcond=1e-10)[0]
        residual = self.y - columns[:, kept] @ step
        return float(residual @ residual)

    def best(
        self, age: Array, kind: str, scales: Array, moving: tuple[int, ...]
    ) -> tuple[float, float]:
        """Least weighted sum of squares, and the scale [s] at which it is."""

        def squares(log_s: float) -> float:
            return self.squares(_course(kind, math.exp(log_s), age), moving)

        tried = [(squares(math.log(s)), float(s)) for s in scales]
        least, at = min(tried)
        if kind == RELAXES:
            near = math.log(at) + np.array([-1.0, 1.0]) * math.log(scales[1] / scales[0])
            bounds = (float(near[0]), float(min(near[1], math.log(scales[-1]))))
            found = minimize_scalar(squares, bounds=bounds, method="bounded")
            least, at = min((least, at), (float(found.fun), math.exp(float(found.x))))
        return max(least, 1e-300), at
