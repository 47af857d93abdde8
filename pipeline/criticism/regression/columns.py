"""Directions of the parameter space that a residual is differentiated along."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model, base_of
from pipeline.criticism.parameter import Machine

ColumnKey = tuple[str, tuple[tuple[str, float], ...]]
"""What separates columns: name, and the shapes that they are at."""


@dataclass(frozen=True, slots=True)
class Column:
    """One direction of the parameter space.

    Attributes
    ----------
    name
        A base constant, or `effect.parameter`.
    step
        Of its finite difference [unit of the parameter].
    effect
        The effect; None for a base constant.
    at
        Values of the effect's shape parameters while its amplitudes are zero.

    """

    name: str
    step: float
    effect: Effect | None = None
    at: tuple[tuple[str, float], ...] = ()

    @property
    def key(self) -> ColumnKey:
        """What separates columns."""
        return self.name, self.at


def base_columns(machine: Machine, scales: Mapping[str, float]) -> list[Column]:
    """One column a base constant, with the step of its finite difference.

    Parameters
    ----------
    machine
        The machine.
    scales
        Orders of magnitude by name.

    """
    columns = []
    for constant in base_of(machine):
        size = scales.get(constant.name, machine.scales.get(constant.scale, 1.0))
        # a nuisance may be usual at far less than a thousandth of its scale
        usual = constant.u(machine.policy.priors) or math.inf
        columns.append(Column(constant.name, min(1e-3, usual) * size))
    return columns


def effect_columns(
    effect: Effect, model: Model, at: tuple[tuple[str, float], ...] = ()
) -> list[Column]:
    """One column a parameter of an effect.

    Parameters
    ----------
    effect
        The effect.
    model
        The model, with the effect or without.
    at
        Values of shape parameters while the amplitudes are zero.

    Returns
    -------
    list of Column
        Amplitudes; shapes too once the effect is in the model.

    """
    inside = effect in model.effects
    columns = []
    for name, p in effect.named(model.machine).items():
        if p.amplitude or (inside and not p.choice):
            step = max(p.negligible, 1e-2 * p.typical) * model.machine.scale(p)
            columns.append(Column(name, step, effect, at))
    return columns
