"""All segments as one linear system around a fit, and Gauss-Newton on it."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Array, Effect, Machine, Values
from pipeline.criticism.linearise import (
    Column,
    Rows,
    base_columns,
    effect_columns,
    linearise,
    noise_floor,
    zero,
)
from pipeline.criticism.model import BASE, Model
from pipeline.criticism.segments import Segment
from pipeline.criticism.size import base_scales

_TIE = 1e-11
_ITERATIONS = 8
_SEED = 20260302
_THREADS = 2
_CONVERGED = 1.0
_HALVINGS = 3


@dataclass(frozen=True, slots=True)
class Fitted:
    """A model with the values that fit best; `sigma` is each segment's noise floor by group."""

    model: Model
    values: dict[str, float]
    sigma: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class System:
    """Gram matrices [S, P, P] and right sides [S, P] of each segment around a fit.

    Rows of a group that misses its noise floor χ²/n = q > 1 count 1/q: the likelihood of a group
    whose scatter is at least the floor but otherwise unknown. An equation with an effect missing
    so keeps no hold on constants that sound equations know. `penalty` [P] is the inverse prior
    variance of nuisances, `pull` [P] the penalty's slope; `misfit` is −2 log likelihood,
    Σ n log max(1, q) + max(0, n(min(1, q) − 1)) without constants, plus the priors' cost.
    """

    columns: tuple[Column, ...]
    rows: tuple[Rows, ...]
    gram: Array
    slope: Array
    misfit: float
    penalty: Array
    pull: Array

    @property
    def count(self) -> int:
        """Weak samples of all segments."""
        return sum(rows.residual.size for rows in self.rows)

    @property
    def chi2(self) -> float:
        """Sum of squares of all weak residuals over their noise floor."""
        return float(sum(rows.residual @ rows.residual for rows in self.rows))

    def place(self, names: Iterable[str]) -> NDArray[np.int64]:
        """Indices of columns by name."""
        wanted = set(names)
        return np.array([n for n, c in enumerate(self.columns) if c.name in wanted], dtype=int)

    def solve(
        self, places: NDArray[np.int64], use: NDArray[np.bool_] | None = None
    ) -> tuple[Array, float, Array]:
        """Step [k], fall of χ² and covariance [k, k] when the columns at `places` are fitted.

        `use` [S] leaves segments out. Directions without information are not moved.
        """
        gram = self.gram if use is None else self.gram[use]
        slope = self.slope if use is None else self.slope[use]
        cross = np.ix_(places, places)
        normal = gram.sum(axis=0)[cross] + np.diag(self.penalty[places])
        right = slope.sum(axis=0)[places] + self.pull[places]
        size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
        scaled = normal / np.outer(size, size)
        power, axes = np.linalg.eigh(scaled)
        good = power > _TIE * max(float(power[-1]), 1.0)
        inverse = (axes[:, good] / power[good]) @ axes[:, good].T
        covariance = inverse / np.outer(size, size)
        step = -covariance @ right
        return step, float(right @ covariance @ right), covariance

    def after(self, places: NDArray[np.int64], step: Array) -> list[Array]:
        """Weak residuals of every segment after a step along columns."""
        return [rows.residual + rows.columns[:, places] @ step for rows in self.rows]

    def groups_after(self, places: NDArray[np.int64], step: Array) -> list[Array]:
        """χ²/n of every group of every segment after a step along columns."""
        left = self.after(places, step)
        return [spread(rows, r)[0] for rows, r in zip(self.rows, left, strict=True)]


def spread(rows: Rows, residual: Array) -> tuple[Array, Array]:
    """χ²/n [groups] (1 where empty) and n [groups] of weak residuals by group."""
    count = np.bincount(rows.group, minlength=len(rows.groups)).astype(float)
    total = np.bincount(rows.group, residual**2, minlength=len(rows.groups))
    return np.where(count > 0, total / np.maximum(count, 1.0), 1.0), count


def misfit_of(rows: Sequence[Rows], spreads: Sequence[Array]) -> float:
    """Σ n log max(1, q) + n (min(1, q) − 1): −2 log likelihood over groups, less constants."""
    total = 0.0
    for one, q in zip(rows, spreads, strict=True):
        n = np.bincount(one.group, minlength=len(one.groups))
        total += float((n * (np.log(np.maximum(q, 1.0)) + np.minimum(q, 1.0) - 1.0)).sum())
    return total


def start_values(model: Model, machine: Machine) -> dict[str, float]:
    """Where Gauss-Newton begins: orders of magnitude; the base is linear in its constants."""
    scales = base_scales(machine)
    values = {c.name: scales.get(c.name, c.center) for c in BASE}
    for effect in model.effects:
        values.update(initial(effect, model))
    return values


def initial(effect: Effect, model: Model) -> dict[str, float]:
    """An effect at zero amplitude, in its own units."""
    return zero(effect, model)


def floors(segments: Sequence[Segment], model: Model, values: Values) -> tuple[Array, ...]:
    """Noise floor of every segment."""
    seeds = range(_SEED, _SEED + len(segments))
    return _each(lambda s, seed: noise_floor(s, model, values, seed), segments, seeds)


def _each(
    work: Callable[[Segment, Any], Any], segments: Sequence[Segment], along: Iterable[Any]
) -> tuple[Any, ...]:
    """`work` on every segment, on two threads (numpy leaves the interpreter), in order."""
    with ThreadPoolExecutor(max_workers=_THREADS) as pool:
        return tuple(pool.map(work, segments, along))


def system(
    segments: Sequence[Segment], fitted: Fitted, candidates: Sequence[Column] = ()
) -> System:
    """Linearises every segment around a fit, along its own columns and those of candidates."""
    model, values = fitted.model, fitted.values
    columns = [*own_columns(model), *candidates]
    rows = _each(
        lambda s, sigma: linearise(s, model, values, columns, sigma), segments, fitted.sigma
    )
    penalty, pull, cost = _priors(columns, values)
    spreads = [spread(r, r.residual)[0] for r in rows]
    weights = [1.0 / np.maximum(q, 1.0)[r.group] for r, q in zip(rows, spreads, strict=True)]
    return System(
        columns=tuple(columns),
        rows=rows,
        gram=np.stack(
            [(r.columns * w[:, None]).T @ r.columns for r, w in zip(rows, weights, strict=True)]
        ),
        slope=np.stack(
            [r.columns.T @ (r.residual * w) for r, w in zip(rows, weights, strict=True)]
        ),
        misfit=misfit_of(rows, spreads) + cost,
        penalty=penalty,
        pull=pull,
    )


def _priors(columns: Sequence[Column], values: Values) -> tuple[Array, Array, float]:
    penalty, pull, cost = np.zeros(len(columns)), np.zeros(len(columns)), 0.0
    priors = {c.name: c for c in BASE if np.isfinite(c.prior)}
    for place, column in enumerate(columns):
        constant = priors.get(column.name)
        if constant is not None:
            penalty[place] = constant.prior**-2
            pull[place] = (values[column.name] - constant.center) * constant.prior**-2
            cost += pull[place] ** 2 / penalty[place]
    return penalty, pull, cost


def own_columns(model: Model) -> list[Column]:
    """The columns of a model's own parameters, base first."""
    columns = base_columns(base_scales(model.machine))
    for effect in model.effects:
        columns += effect_columns(effect, model)
    return columns


def clipped(model: Model, values: dict[str, float]) -> dict[str, float]:
    """Values moved inside their bounds."""
    inside = dict(values)
    for name, (_, p) in model.parameters().items():
        scale = model.machine.scale(p)
        inside[name] = min(max(values[name], p.low * scale), p.high * scale)
    return inside


def gauss_newton(
    segments: Sequence[Segment], fitted: Fitted, renew: bool = False, iterations: int = _ITERATIONS
) -> tuple[Fitted, System]:
    """Fits a model's own parameters; returns the fit and the system around it.

    A step that makes χ² worse is halved. With `renew` the noise floor is computed again on the
    way, which a start far from the truth needs.
    """
    around = system(segments, fitted)
    for _ in range(iterations):
        step, _, _ = around.solve(np.arange(len(around.columns)))
        for _ in range(_HALVINGS):
            moved = _moved(fitted, around.columns, step)
            if renew:
                moved = replace(moved, sigma=floors(segments, moved.model, moved.values))
            tried = system(segments, moved)
            if renew or tried.misfit < around.misfit + _CONVERGED:
                break
            step = 0.3 * step
        else:
            break
        gain = around.misfit - tried.misfit
        if renew or gain > 0:
            fitted, around = moved, tried
        if not renew and gain < _CONVERGED:
            break
    return fitted, around


def _moved(fitted: Fitted, columns: Sequence[Column], step: Array) -> Fitted:
    values = dict(fitted.values)
    for column, change in zip(columns, step, strict=True):
        values[column.name] += float(change)
    return replace(fitted, values=clipped(fitted.model, values))


def first_fit(segments: Sequence[Segment], model: Model) -> tuple[Fitted, System]:
    """Fits a model from orders of magnitude: three steps that renew the noise floor, then more."""
    values = start_values(model, model.machine)
    fitted = Fitted(model, values, floors(segments, model, values))
    fitted, _ = gauss_newton(segments, fitted, renew=True, iterations=3)
    return gauss_newton(segments, fitted)
