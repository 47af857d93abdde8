"""Choices inside an effect, such as whose sensor has a gain: made again when others are there."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from itertools import product

from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Values
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system


def reconsidered(system: LinearSystem, at_floor: bool = False) -> LinearSystem:
    """The fit with other choices inside its effects, where these are better.

    Parameters
    ----------
    system
        The fit.
    at_floor
        Whether to look for a better choice although nothing is over the floor.

    Returns
    -------
    LinearSystem
        The same where nothing is over the floor, or no choice lowers the deviance by
        `policy.selection.tie`. One that would not by `choice_falls` times what it falls to first
        order is not fitted.

    Notes
    -----
    A choice may have been right only while another effect was missing: a lagging transducer does
    not pass on the ripple of the torque, which so seemed not to reach the shaft.

    """
    for effect in system.fit.model.effects:
        if not at_floor and not significant_groups(system).any():
            break
        if effect.discriminator is not None:
            continue
        for other in other_choices(effect, system.fit):
            fit = system.fit
            start = replace(fit, values={**fit.values, **other})
            system = better_of(system, start, fit.policy.selection.tie)
    return system


def better_of(system: LinearSystem, start: Fit, least: float) -> LinearSystem:
    """A fit, or the one from another start where that is better.

    Parameters
    ----------
    system
        The fit.
    start
        Where the other one begins. It is not fitted where `policy.selection.choice_falls` times its
        fall to first order would not do.
    least
        By what the deviance has to fall.

    """
    limit = system.deviance - least
    begun = linear_system(start, before=system, chord=True)
    end = begun.normal_equations(begun.model_columns).best().deviance
    fall = start.policy.selection.choice_falls * (begun.deviance - end)
    if begun.deviance - fall >= limit:
        return system
    tried = gauss_newton(start, before=system)
    return tried if tried.deviance < limit else system


def other_choices(effect: Effect, fit: Fit) -> Iterator[Values]:
    """Every choice inside an effect but that of a fit.

    Parameters
    ----------
    effect
        The effect.
    fit
        A fit with it.

    Yields
    ------
    Values
        By full names.

    """
    machine = fit.model.machine
    chosen = [p for p in effect.parameters_of(machine) if p.choice and len(p.scan) > 1]
    grids = [[(f"{effect.name}.{p.name}", v * machine.scale(p)) for v in p.scan] for p in chosen]
    for one in product(*grids):
        values = dict(one)
        if any(fit.values[name] != value for name, value in values.items()):
            yield values
