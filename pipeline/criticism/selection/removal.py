"""Effects of a fit that later ones have made superfluous, or whose size may be zero."""

from __future__ import annotations

import math
from collections.abc import Iterable

import numpy as np

from pipeline.criticism.operating import Indices
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.left_out import loss_at
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import NormalEquations
from pipeline.criticism.selection.acceptance import sure_amplitudes
from pipeline.criticism.selection.improvement import clears
from pipeline.criticism.selection.sizes import material


def unsure_effect(wide: LinearSystem, base: int) -> tuple[str, LinearSystem] | None:
    """An added effect whose size may be zero, fitted with all others.

    Parameters
    ----------
    wide
        The fit.
    base
        Number of effects of the model that were not added.

    Returns
    -------
    tuple of str and LinearSystem, or None
        Its name, and the fit without it; of several the one that explains least.

    Notes
    -----
    One may be unsure as long as another stands for it as well, so they go one at a time. One that
    takes most of an error is there, however badly its size is known.

    """
    added = wide.fit.model.effects[base:]
    if not added:
        return None
    system = wide.only(np.arange(wide.model_column_count))
    held_out = leave_out(system)
    unsure = [e.name for e in added if not sure_amplitudes(system, held_out, e)]
    for name in sorted(unsure, key=lambda name: loss_without(system, (name,))):
        without = gauss_newton(system.fit.without(name), before=system)
        chi2 = [fitted.reduced_chi2(fitted.residual) for fitted in (without, system)]
        if not clears(system, significant_groups(without), *chi2):
            return name, without
    return None


def without_superfluous(system: LinearSystem, base: int) -> LinearSystem:
    """A fit without the added effects that later ones have made superfluous.

    Parameters
    ----------
    system
        The fit; its last effect stays.
    base
        Number of effects of the model that were not added.

    """
    factor = system.policy.selection.most_penalties
    for effect in system.fit.model.effects[base:-1]:
        penalty = effect.dof(system.fit.machine) * math.log(system.size)
        if material(system.fit, effect) and loss_without(system, (effect.name,)) > factor * penalty:
            continue
        tried = gauss_newton(system.fit.without(effect.name), before=system)
        if tried.deviance - system.deviance < penalty:
            system = tried
    return system


def loss_without(
    system: LinearSystem,
    names: Iterable[str],
    instead: Indices | None = None,
    normal_equations: NormalEquations | None = None,
) -> float:
    """Rise of the deviance when effects go to zero amplitude and the rest is refitted.

    Parameters
    ----------
    system
        The fit.
    names
        The effects.
    instead
        Places of columns that are fitted in their stead.
    normal_equations
        Those of all columns, where they were computed before.

    Returns
    -------
    float
        To first order around the model without them.

    """
    stems = tuple(f"{name}." for name in names)
    fit, model_columns = system.fit, system.model_columns
    left_out = np.array(
        [n for n in model_columns if system.columns[n].name.startswith(stems)], dtype=int
    )
    known = fit.model.parameters()
    names_out = [system.columns[n].name for n in left_out]
    move = np.array([-fit.values[n] if known[n][1].amplitude else 0.0 for n in names_out])
    equations = system.normal_equations() if normal_equations is None else normal_equations
    places = () if instead is None else instead
    return loss_at(system, equations, left_out, move, places, *fit.policy.selection.thorough)
