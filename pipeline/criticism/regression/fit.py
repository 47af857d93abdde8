"""A model fitted to segments, and the noise floors that it is held against."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.data.segment import Segment, row_index
from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Values
from pipeline.criticism.parameter import Machine, Parameter
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.regression.bounds import limits_of
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.noise_floors import Floor, form_tolerance, rough_floor
from pipeline.criticism.regression.noise_propagation import noise_floor, noise_growth, quick_noise
from pipeline.criticism.regression.parallel import on_each

_SEED = 20260302
_CURRENTS = frozenset({"id_a", "iq_a", "i_pair_a"})
"""Signals whose noise is in the equations times a constant of the fit."""


@dataclass(frozen=True, slots=True)
class Fit:
    """Segments, a model of them, and the values that fit best.

    Attributes
    ----------
    segments, model
        What is fitted.
    values
        Parameters by full name, in their units.
    sigma
        Noise floor of each weak sample [R] of each segment, computed at the values `near`.
    near
        Values at which reading errors are computed: those of a coasting shaft go with 1/J, and a
        fit could win by making J small.
    tolerance
        What the forms of effects found may be wrong by; empty for nothing.

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
        """An effect of the model.

        Parameters
        ----------
        name
            Its name.

        """
        return next(effect for effect in self.model.effects if effect.name == name)

    def size(self, effect: Effect, parameter: Parameter) -> float:
        """Magnitude of one parameter of an effect.

        Parameters
        ----------
        effect
            An effect of the model.
        parameter
            One of its parameters.

        Returns
        -------
        float
            In the unit of the parameter.

        """
        return abs(self.values[f"{effect.name}.{parameter.name}"])

    def without(self, *names: str) -> Fit:
        """The fit less some effects; every other value stays.

        Parameters
        ----------
        *names
            Names of effects.

        """
        prefixes = tuple(f"{name}." for name in names)
        values = {name: v for name, v in self.values.items() if not name.startswith(prefixes)}
        return replace(self, model=self.model.without(*names), values=values)

    def at(self, values: Values) -> Fit:
        """The fit with other values.

        Parameters
        ----------
        values
            By full name; each is moved inside its bounds.

        """
        inside = {**self.values, **values}
        for name, (low, high) in limits_of(self.model).items():
            inside[name] = min(max(inside[name], low), high)
        return replace(self, values=inside)

    def moved(self, columns: Sequence[Column], step: Array) -> Fit:
        """The fit after a step.

        Parameters
        ----------
        columns
            Parameters that move.
        step
            Change of each [units of the parameters]; none goes beyond its bounds.

        """
        moves = zip(columns, step.tolist(), strict=True)
        return self.at({c.name: self.values[c.name] + change for c, change in moves})

    def moved_over_inertia(self, moves: Values) -> Fit | None:
        """The fit after a step that is taken in 1/J and in drags over J.

        Parameters
        ----------
        moves
            Change of each parameter that moves, by its full name.

        Returns
        -------
        Fit or None
            None of a step that takes no large share of J: both ways lead to the same.

        Notes
        -----
        A free shaft's acceleration is linear in these. From beyond twice the inertia that is sought
        the tangent in J leads below zero.

        """
        inertia = self.values["j_kgm2"]
        shrinks = -moves.get("j_kgm2", 0.0) / inertia
        if shrinks <= self.policy.fit.inertia_step:
            return None
        moved = {name: self.values[name] + change for name, change in moves.items()}
        of_drags = [name for name in moves if _is_drag(name, self.model)]
        moved |= {n: (moved[n] + shrinks * self.values[n]) / (1.0 + shrinks) for n in of_drags}
        return self.at({**moved, "j_kgm2": inertia / (1.0 + shrinks)})

    @property
    def alone(self) -> Fit:
        """The model and its values without segments and floors, as a segment's work takes it."""
        return replace(self, segments=(), sigma=(), tolerance=())

    @property
    def floors(self) -> tuple[Floor, ...]:
        """What the rows of every segment are held against."""
        pairs = zip(self.sigma, self.tolerance or [None] * len(self.sigma), strict=True)
        return tuple(Floor(sigma, self.near, tolerance) for sigma, tolerance in pairs)


def _is_drag(name: str, model: Model) -> bool:
    """Whether a parameter is in the shaft's equation over the inertia."""
    if name not in model.parameters():
        return name == "b_nm_s_rad"
    effect, parameter = model.parameters()[name]
    return effect.torque is not None and parameter.amplitude


def floors(segments: Sequence[Segment], model: Model, values: Values) -> tuple[Array, ...]:
    """Noise floor of every segment.

    Parameters
    ----------
    segments
        The segments.
    model
        The model at which noise is propagated.
    values
        Parameters by full name.

    Returns
    -------
    tuple of array [R]
        Seeds are fixed, so the same input gives the same floors.

    """
    return on_each(noise_floor, segments, _seeded(segments, model, values))


def rough_floors(segments: Sequence[Segment], model: Model, values: Values) -> tuple[Array, ...]:
    """What the rows of every segment may be off by in a rough fit.

    Parameters
    ----------
    segments
        The segments.
    model
        The model at which noise is propagated.
    values
        Orders of magnitude of the parameters.

    Returns
    -------
    tuple of array [R]
        A part of the machine's scale and the noise: by its scale alone, rows of a wave that hold
        little but the noise of an acceleration would take the inertia away.

    """
    return on_each(_rough_floor, segments, _seeded(segments, model, values))


def _seeded(
    segments: Sequence[Segment], model: Model, values: Values
) -> list[tuple[Model, Values, int]]:
    return [(model, values, _SEED + n) for n in range(len(segments))]


def _rough_floor(segment: Segment, model: Model, values: Values, seed: int) -> Array:
    noise = quick_noise(segment, model, values, seed)
    return np.hypot(rough_floor(segment, model, values), noise)


def floors_grown(fit: Fit) -> tuple[Array, ...]:
    """Noise floor of every segment at the values of a fit, over the one that the fit was made with.

    Parameters
    ----------
    fit
        The fit.

    Returns
    -------
    tuple of array [R]
        Ratios [1]; the same noise is added in both.

    """
    return on_each(noise_growth, fit.segments, _growth_arguments(fit))


def current_floors_grown(fit: Fit) -> tuple[Array, ...]:
    """As `floors_grown`, and 1 where there are no currents, whose noise is in the equations times
    what is fitted.

    Parameters
    ----------
    fit
        The fit.

    """
    return on_each(_current_floor_grown, fit.segments, _growth_arguments(fit))


def _growth_arguments(fit: Fit) -> list[tuple[Model, Values, Values, int]]:
    return [(fit.model, fit.values, fit.near, _SEED + n) for n in range(len(fit.segments))]


def _current_floor_grown(
    segment: Segment, model: Model, values: Values, near: Values, seed: int
) -> Array:
    if _CURRENTS.isdisjoint(segment.recorded):
        return np.ones(np.count_nonzero(row_index(segment)[2]))
    return noise_growth(segment, model, values, near, seed)


def tolerances(fit: Fit, added: Sequence[Effect]) -> tuple[Array, ...]:
    """What the forms of effects that were found may be wrong by.

    Parameters
    ----------
    fit
        The fit.
    added
        The effects that were found.

    Returns
    -------
    tuple of array [groups]
        One a segment, in the scale of `sigma`.

    """
    arguments = fit.model, fit.values, tuple(added)
    return on_each(form_tolerance, fit.segments, [arguments] * len(fit.segments))
