"""What captures do not support is left out: terms inside an effect, and effects as a whole.

Terms come back where others do not explain the captures without them; of effects those go that
later ones have made superfluous, or whose size may be zero.

Reference: Schwarz, Ann. Stat. 6 (1978), the penalty of a parameter.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import zero
from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.normal_equations import NormalEquations
from pipeline.criticism.regression.reported import reported_parameters
from pipeline.criticism.residuals.channels import of_acceleration
from pipeline.criticism.selection.acceptance import sure_amplitudes
from pipeline.criticism.selection.choices import better_of
from pipeline.criticism.selection.improvement import clears
from pipeline.criticism.selection.sizes import material


def trimmed(system: LinearSystem, names: Sequence[str]) -> LinearSystem:
    """The fit without optional terms of some effects that are not worth their parameters.

    Parameters
    ----------
    system
        The fit.
    names
        The effects.

    Returns
    -------
    LinearSystem
        Refitted; one amplitude of each effect stays.

    Notes
    -----
    A term is worth its parameters when −2 log L falls by more than ln n a parameter, n the rows of
    the captures that show the effect. All terms that to first order are not are left out in one
    refit. Where that loses too much, they are tried one by one, and with them the terms that to
    first order are worth less than `tangent_penalties`.

    """
    for name in names:
        effect = system.fit.effect(name)
        own = system.place(effect.named(system.fit.machine))
        penalty = math.log(system.informed(own))
        spare = _spare(system, effect, penalty)
        if not spare:
            continue
        reduced = _unless_worth(system, name, spare, penalty)
        if reduced is not None:
            system = reduced
            continue
        one_by_one = spare if len(spare) > 1 else ()
        for term in (*one_by_one, *_doubtful(system, effect, spare, penalty)):
            system = _unless_worth(system, name, (term,), penalty) or system
    return system


def with_all_terms(fit: Fit) -> Fit:
    """Where a fit begins in which the machine's own effects have all their terms again.

    Parameters
    ----------
    fit
        The fit.

    Returns
    -------
    Fit
        Terms that were left out are in at zero: a term that was not worth its parameters while
        another effect was missing may be now.

    """
    model = fit.model
    complete = [e if e.hook == "sensor" else replace(e, left_out=()) for e in model.effects]
    full = replace(model, effects=tuple(complete))
    values = dict(fit.values)
    for effect in complete:
        values = {**zero(effect, full), **values}
    return replace(fit, model=full, values=values)


def reshaped(system: LinearSystem) -> LinearSystem:
    """The fit with optional terms begun from the other trial values of their shapes, left out or
    not, where that explains more.

    Parameters
    ----------
    system
        The fit.

    Returns
    -------
    LinearSystem
        The same where nothing is over the floor. A term that was left out must be worth its
        parameters, one that was not `policy.selection.tie`.

    Notes
    -----
    What a compensation gives back over as little current as a dead time loses it is that dead time,
    less of it; only over a wider one is it a term of its own, and no tangent leads there.

    """
    penalty, tie = math.log(max(system.size, 2)), system.policy.selection.tie
    for effect in system.fit.model.effects:
        for start, count in _other_shapes(system.fit, effect):
            if not significant_groups(system).any():
                return system
            system = better_of(system, start, max(penalty * count, tie))
    return system


def _other_shapes(fit: Fit, effect: Effect) -> Iterator[tuple[Fit, int]]:
    """Where fits begin with one of the optional terms of an effect at another trial value of a
    shape, and how many parameters that adds; a term that was left out begins at zero.
    """
    machine, left_out = fit.machine, effect.left_out
    whole = replace(effect, left_out=()).parameters_of(machine)
    for term in sorted({p.optional for p in whole} - {0}):
        having = replace(effect, left_out=tuple(t for t in left_out if t != term))
        parameters = [p for p in whole if p.optional == term]
        others = (having if e.name == effect.name else e for e in fit.model.effects)
        model = replace(fit.model, effects=tuple(others))
        for shape in parameters:
            for value in shape.scan if len(shape.scan) > 1 else ():
                at = {f"{effect.name}.{shape.name}": value * machine.scale(shape)}
                start = replace(
                    fit, model=model, values={**zero(having, model), **fit.values, **at}
                )
                yield start, len(parameters) if term in left_out else 0


def _unless_worth(
    system: LinearSystem, name: str, terms: tuple[int, ...], penalty: float
) -> LinearSystem | None:
    """The refit without some terms of an effect; None where these were worth their penalty, or no
    amplitude would stay.
    """
    fit, effect = system.fit, system.fit.effect(name)
    parameters = effect.parameters_of(fit.machine)
    if not any(p.amplitude and p.optional not in terms for p in parameters):
        return None
    tried = _without(system, effect, terms)
    worth = penalty * len(_parameters(fit, effect, terms))
    return tried if tried.deviance - system.deviance < worth else None


def _parameters(fit: Fit, effect: Effect, terms: Sequence[int]) -> tuple[str, ...]:
    """Full names of the parameters of some terms."""
    named = effect.named(fit.model.machine)
    return tuple(name for name, p in named.items() if p.optional in terms)


def _spare(system: LinearSystem, effect: Effect, penalty: float) -> tuple[int, ...]:
    """The optional terms that are not worth their penalty to first order, the worst first."""
    parameters = effect.parameters_of(system.fit.machine)
    removable = sorted({p.optional for p in parameters} - {0})
    known = system.normal_equations()
    dropped: list[int] = []
    while True:
        costs = []
        for term in removable:
            if any(p.amplitude and p.optional not in (*dropped, term) for p in parameters):
                names = _parameters(system.fit, effect, (*dropped, term))
                saved = len(names) * penalty
                costs.append((_loss(system, known, names) - saved, term))
        cheapest = min(costs, default=(0.0, 0))
        if cheapest[0] >= 0.0:
            return tuple(dropped)
        dropped.append(cheapest[1])
        removable.remove(cheapest[1])


def _loss(system: LinearSystem, known: NormalEquations, names: Sequence[str]) -> float:
    """Rise of deviance, to first order, when these parameters go to zero and the rest refits."""
    model_columns = system.model_columns
    left_out = np.array([n for n in model_columns if system.columns[n].name in names], dtype=int)
    move = np.array([-system.fit.values[system.columns[n].name] for n in left_out])
    return loss_at(system, known, left_out, move)


def _doubtful(
    system: LinearSystem, effect: Effect, spare: Sequence[int], penalty: float
) -> tuple[int, ...]:
    """The optional terms that are not `spare` and that the tangent may be wrong about."""
    fit, known = system.fit, system.normal_equations()
    terms = {p.optional for p in effect.parameters_of(fit.model.machine)} - {0, *spare}
    return tuple(
        term
        for term in sorted(terms)
        if _loss(system, known, names := _parameters(fit, effect, (term,)))
        < fit.policy.selection.tangent_penalties * penalty * len(names)
    )


def _without(system: LinearSystem, effect: Effect, terms: Sequence[int]) -> LinearSystem:
    """The refit without some terms; columns of all else are taken over."""
    fit = system.fit
    dropped = _parameters(fit, effect, terms)
    reduced = replace(effect, left_out=tuple(sorted({*effect.left_out, *terms})))
    effects = tuple(reduced if e.name == effect.name else e for e in fit.model.effects)
    values = {name: v for name, v in fit.values.items() if name not in dropped}
    start = replace(fit, model=replace(fit.model, effects=effects), values=values)
    prefix = f"{effect.name}."
    named = [
        replace(c, name=f"-{c.name}") if c.name.startswith(prefix) else c for c in system.columns
    ]
    return gauss_newton(start, before=replace(system, columns=tuple(named)))


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
    takes most of an error is there, however badly its size is known. An error of a sensor is a size
    and nothing else: one that would be reported without any is not there.

    """
    added = wide.fit.model.effects[base:]
    if not added:
        return None
    system = wide.only(np.arange(wide.model_column_count))
    held_out, machine = leave_out(system), wide.fit.model.machine
    reported = reported_parameters(system, held_out)
    unsure = [
        e.name
        for e in added
        if not sure_amplitudes(system, held_out, e)
        or (e.hook == "sensor" and not any(reported[name].known for name in e.named(machine)))
    ]
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
        own = system.place(effect.named(system.fit.machine))
        penalty = effect.dof(system.fit.machine) * math.log(system.informed(own))
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


def loss_at(
    system: LinearSystem,
    known: NormalEquations,
    left_out: Indices,
    move: Array,
    instead: Sequence[int] | Indices = (),
    starts: Sequence[float] = (1.0, 0.5, 0.0),
    rounds: int | None = None,
) -> float:
    """Rise of the deviance when some parameters move and the others of the model are refitted.

    Parameters
    ----------
    system
        The fit.
    known
        Normal equations of all its columns.
    left_out
        Places of the parameters' columns [k].
    move
        Change of each [k].
    instead
        Places of columns that are fitted in their stead.
    starts
        As `NormalEquations.best` has them.
    rounds
        Likewise.

    Returns
    -------
    float
        To first order around where the parameters have moved to.

    Notes
    -----
    A free shaft knows torques over its inertia alone, α = −T/J. So its column of J is T/J², and T
    is that without what has gone: as J changes, what is not there cannot. By the column of before,
    all torques and J would go to zero together at no cost, and with them any that is asked after.

    """
    stay = np.setdiff1d(system.model_columns, left_out)
    kept = np.concatenate([stay, np.asarray(instead, dtype=int)])
    every = np.concatenate([kept, left_out])
    ends = np.arange(kept.size, every.size)
    there = known.only(every).moved(ends, move)
    (inertia,) = np.flatnonzero(np.isin(every, system.place(("j_kgm2",))))
    by = np.outer(_free(system), -move * _drags(system, left_out) / system.fit.values["j_kgm2"])
    if np.any(by):
        there = there.sheared(int(inertia), ends, by)
    return there.only(np.arange(kept.size)).best(starts, rounds).deviance - known.deviance()


def _free(system: LinearSystem) -> Array:
    """1 for the groups [G] that are accelerations of a free shaft, else 0."""
    free = [of_acceleration(system.segments[n], channel) for n, channel, _ in system.labels]
    return np.array(free, dtype=float)


def _drags(system: LinearSystem, places: Indices) -> Array:
    """1 for columns [k] of effects that drag at the shaft, else 0."""
    effects = [system.columns[n].effect for n in places.tolist()]
    return np.array([e is not None and e.hook == "torque" for e in effects], dtype=float)
