"""A model fitted to segments, and the noise floors that it is held against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Array, Effect, Machine, Parameter, Values
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.regression.bounds import limits_of
from pipeline.criticism.regression.linearise import Column
from pipeline.criticism.regression.noise_floors import Floor, form_tolerance, noise_floor
from pipeline.criticism.regression.parallel import on_each

_SEED = 20260302
_CURRENTS = frozenset({"id_a", "iq_a", "i_pair_a"})
"""Signals whose noise is in the equations times a constant of the fit."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Segments, a model of them, and the values that fit best.

    `sigma` is each segment's noise floor by group, computed at the values `near`. Reading errors
    are computed there too: those of a coasting shaft go with 1/J, and a fit could win by making J
    small. `tolerance` is what the forms of effects found may be wrong by; empty: nothing.
    """

    segments: tuple[Segment, ...]
    model: Model
    values: dict[str, float]
    sigma: tuple[Array, ...]
    near: Values
    tolerance: tuple[Array, ...] = ()

    @property
    def policy(self) -> Policy:
        """What the fit goes by."""
        return self.model.policy

    @property
    def machine(self) -> Machine:
        """The machine of the model."""
        return self.model.machine

    def effect(self, name: str) -> Effect:
        """An effect of the model by its name."""
        return next(effect for effect in self.model.effects if effect.name == name)

    def size(self, effect: Effect, parameter: Parameter) -> float:
        """Magnitude [unit of the parameter] of one parameter of an effect."""
        return abs(self.values[f"{effect.name}.{parameter.name}"])

    def without(self, *names: str) -> Fit:
        """The model less some effects; every other value stays."""
        gone = tuple(f"{name}." for name in names)
        values = {name: v for name, v in self.values.items() if not name.startswith(gone)}
        return replace(self, model=self.model.without(*names), values=values)

    def at(self, values: Values) -> Fit:
        """The same with other values where they are given, moved inside their bounds."""
        inside = {**self.values, **values}
        for name, (low, high) in limits_of(self.model).items():
            inside[name] = min(max(inside[name], low), high)
        return replace(self, values=inside)

    def moved(self, columns: Sequence[Column], step: Array) -> Fit:
        """The same after a step along columns, each as far as its bounds."""
        moves = zip(columns, step.tolist(), strict=True)
        return self.at({c.name: self.values[c.name] + change for c, change in moves})

    @property
    def floors(self) -> tuple[Floor, ...]:
        """What the rows of every segment are held against."""
        both = zip(self.sigma, self.tolerance or [None] * len(self.sigma), strict=True)
        return tuple(Floor(sigma, self.near, tolerance) for sigma, tolerance in both)


def floors(segments: Sequence[Segment], model: Model, values: Values) -> tuple[Array, ...]:
    """Noise floor of every segment."""
    seeds = range(_SEED, _SEED + len(segments))
    return on_each(noise_floor, segments, [(model, values, seed) for seed in seeds])


def floors_grown(fit: Fit) -> tuple[Array, ...]:
    """Noise floor of every segment at a fit's values, over the one that the fit was made with; the
    same noise is added in both.
    """
    what = fit.model, fit.values
    each = [(*what, sigma, _SEED + n) for n, sigma in enumerate(fit.sigma)]
    return on_each(_floor_grown, fit.segments, each)


def _floor_grown(segment: Segment, model: Model, values: Values, sigma: Array, seed: int) -> Array:
    """One but where there are currents, whose noise is in the equations times what is fitted."""
    if _CURRENTS.isdisjoint(segment.recorded):
        return np.ones(sigma.size)
    return noise_floor(segment, model, values, seed) / sigma


def tolerances(fit: Fit, added: Sequence[Effect]) -> tuple[Array, ...]:
    """What the forms of the effects found may be wrong by, of every segment."""
    what = fit.model, fit.values, tuple(added)
    return on_each(form_tolerance, fit.segments, [what] * len(fit.segments))
