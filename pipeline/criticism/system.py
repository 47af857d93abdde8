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
_ROUNDS = 30
_SETTLED = 0.3


@dataclass(frozen=True, slots=True)
class Fitted:
    """A model with the values that fit best; `sigma` is each segment's noise floor by group."""

    model: Model
    values: dict[str, float]
    sigma: tuple[Array, ...]


@dataclass(frozen=True, slots=True)
class System:
    """Weak samples of all segments around a fit: residual [R] and columns [R, P], over the noise.

    `group` [R] numbers the groups of (segment, channel, order), `labels` names them; `unit` [R] is
    the size of one noise unit as a window's mean, in the signal's own unit. Rows of a
    group that misses its noise floor, χ²/n = q > 1, count 1/q: the likelihood of a group whose
    scatter is at least the floor but otherwise unknown. An equation with an effect missing so
    keeps no hold on constants that sound equations know. `penalty` [P] is the inverse prior
    variance of nuisances, `pull` [P] the penalty's slope.
    """

    columns: tuple[Column, ...]
    residual: Array
    matrix: Array
    group: NDArray[np.int64]
    window: NDArray[np.int64]
    unit: Array
    labels: tuple[tuple[int, str, int], ...]
    penalty: Array
    pull: Array

    @property
    def size(self) -> int:
        """Weak samples."""
        return int(self.residual.size)

    @property
    def counts(self) -> Array:
        """Weak samples [G] of each group."""
        return np.bincount(self.group, minlength=len(self.labels)).astype(float)

    @property
    def chi2(self) -> float:
        """Sum of squares of all weak residuals over their noise floor."""
        return float(self.residual @ self.residual)

    @property
    def misfit(self) -> float:
        """−2 log likelihood, less constants, and the cost of the priors."""
        live = self.penalty > 0
        cost = float((self.pull[live] ** 2 / self.penalty[live]).sum())
        return self.misfit_of(self.spreads(self.residual)) + cost

    def spreads(self, residual: Array) -> Array:
        """χ²/n [G] of each group, 1 where empty."""
        counts = self.counts
        total = np.bincount(self.group, residual**2, minlength=counts.size)
        return np.where(counts > 0, total / np.maximum(counts, 1.0), 1.0)

    def misfit_of(self, spreads: Array) -> float:
        """Σ n [log max(1, q) + min(1, q) − 1]: −2 log likelihood of groups with χ²/n = q."""
        each = np.log(np.maximum(spreads, 1.0)) + np.minimum(spreads, 1.0) - 1.0
        return float((self.counts * each).sum())

    def place(self, names: Iterable[str]) -> NDArray[np.int64]:
        """Indices of columns by name."""
        wanted = set(names)
        return np.array([n for n, c in enumerate(self.columns) if c.name in wanted], dtype=int)

    def best(
        self, places: NDArray[np.int64], rows: NDArray[np.bool_] | None = None
    ) -> tuple[Array, Array]:
        """Step [k] along columns at `places` of least misfit, and its residual [R].

        Weighted least squares, the weights renewed until the misfit stays. `rows` [R] leaves
        samples out of the fit.
        """
        matrix, right = self.matrix[:, places], self.residual
        chosen = np.ones(right.size) if rows is None else rows.astype(float)
        left, step = self.residual, np.zeros(places.size)
        before = np.inf
        for _ in range(_ROUNDS):
            weight = chosen / np.maximum(self.spreads(left), 1.0)[self.group]
            normal = (matrix * weight[:, None]).T @ matrix + np.diag(self.penalty[places])
            slope = matrix.T @ (weight * right) + self.pull[places]
            step = -_pseudo_inverse(normal) @ slope
            left = right + matrix @ step
            now = self.misfit_of(self.spreads(left))
            if abs(before - now) < _SETTLED:
                break
            before = now
        return step, left

    def covariance(self, places: NDArray[np.int64]) -> Array:
        """Covariance [k, k] of the parameters at `places` when they are fitted together."""
        weight = 1.0 / np.maximum(self.spreads(self.residual), 1.0)[self.group]
        matrix = self.matrix[:, places]
        normal = (matrix * weight[:, None]).T @ matrix + np.diag(self.penalty[places])
        return _pseudo_inverse(normal)


def _pseudo_inverse(normal: Array) -> Array:
    """Inverse of a normal matrix with directions that carry no information left at zero."""
    size = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    power, axes = np.linalg.eigh(normal / np.outer(size, size))
    good = power > _TIE * max(float(power[-1]), 1.0)
    inverse: Array = (axes[:, good] / power[good]) @ axes[:, good].T
    scaled: Array = inverse / np.outer(size, size)
    return scaled


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
    penalty, pull = _priors(columns, values)
    first, labels, groups = 0, [], []
    for number, one in enumerate(rows):
        labels += [(number, channel, order) for channel, order in one.groups]
        groups.append(one.group + first)
        first += len(one.groups)
    return System(
        columns=tuple(columns),
        residual=np.concatenate([r.residual for r in rows]),
        matrix=np.concatenate([r.columns for r in rows]),
        group=np.concatenate(groups),
        window=np.concatenate([r.window for r in rows]),
        unit=np.concatenate([r.unit for r in rows]),
        labels=tuple(labels),
        penalty=penalty,
        pull=pull,
    )


def _priors(columns: Sequence[Column], values: Values) -> tuple[Array, Array]:
    penalty, pull = np.zeros(len(columns)), np.zeros(len(columns))
    priors = {c.name: c for c in BASE if np.isfinite(c.prior)}
    for place, column in enumerate(columns):
        constant = priors.get(column.name)
        if constant is not None:
            penalty[place] = constant.prior**-2
            pull[place] = (values[column.name] - constant.center) * constant.prior**-2
    return penalty, pull


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
        step, _ = around.best(np.arange(len(around.columns)))
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
