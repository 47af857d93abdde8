"""What is reported of a fit: the parameters and combinations of them that captures determine."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import BASE, PHYSICAL, STATE, Model, base_of
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.regression import GaussNewton
from pipeline.criticism.regression.bounds import limits_of
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.goodness import form_error_factor
from pipeline.criticism.regression.identifiability import POSITIVE, Known, at_bound, known
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.numerics.identifiability import (
    REACH,
    Combination,
    known_combinations,
    new_direction,
    walked,
    within,
)
from pipeline.records.comparison import KnownCombination, ModelParameter

OF_PAIRS = ("psi_wb", "ld_h", "lq_h")
"""Parameters that are seen in multiples of the pole pairs."""


def _reported(system: LinearSystem, held_out: HeldOut) -> Known:
    """What the captures determine, less sure by what errors of the model's form may do."""
    return replace(known(system, held_out), form_error_factor=form_error_factor(system))


def reported_parameters(system: LinearSystem, held_out: HeldOut) -> dict[str, ModelParameter]:
    """Every physical parameter of a fit; without a value where it is not determined.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual.

    Returns
    -------
    dict of ModelParameter
        By name.

    Notes
    -----
    A parameter is determined where it is known better than to its own size. A constant that no
    motor is without must have an interval without zero, and stand at no bound; the interval of
    another parameter must be narrower than sizes that are seen on real benches. A number that was
    chosen of a few, or given by a discriminator, is determined where an amplitude of its effect is.

    """
    fit, model, columns = system.fit, system.fit.model, system.columns[: system.model_columns.size]
    sure_of = _reported(system, held_out)
    u = dict(zip((c.name for c in columns), sure_of.u.tolist(), strict=True))
    beyond = _beyond(sure_of.u, _of_handbooks(system), fit.policy.fit)
    determined = within(beyond, sure_of.identified.sizes)
    sized = dict(zip(u, determined.tolist(), strict=True))
    limits, stated = limits_of(model), model.stated()
    reported = {}
    for c in BASE:
        if c.name in PHYSICAL:
            value = fit.values[c.name]
            if c.name in OF_PAIRS and not model.machine.pairs_known:
                reported[c.name] = _parameter(value, u[c.name], c.unit, False, False)
                continue
            bound = at_bound(value, limits.get(c.name))
            sure = c.name not in POSITIVE or (REACH * u[c.name] < value and not bound)
            reported[c.name] = _parameter(value, u[c.name], c.unit, sized[c.name] and sure, bound)
            reported[c.name] = _or_stated(reported[c.name], stated.get(c.name))
    for name, (effect, p) in model.parameters().items():
        value = fit.values[name]
        beside = effect.named(model.machine)
        sure = sized[name] if name in u else any(sized.get(one, False) for one in beside)
        bound = not p.choice and at_bound(value, limits[name])
        reported[name] = _parameter(value, u.get(name, p.u), p.unit, sure, bound)
        reported[name] = _or_stated(reported[name], stated.get(name))
    return reported


def _or_stated(parameter: ModelParameter, stated: tuple[float, float] | None) -> ModelParameter:
    """The parameter, or what is stated of it where nothing else determines it."""
    if parameter.known or stated is None:
        return parameter
    return replace(parameter, value=stated[0], u=stated[1], stated=True)


def against_stated(system: LinearSystem, held_out: HeldOut) -> tuple[str, ...]:
    """Notes of the stated constants, and the usual sizes of an instrument's state, that captures
    contradict when they are fitted without them.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual.

    Returns
    -------
    tuple of str
        One sentence a constant.

    Notes
    -----
    A fit θ ± u of data and prior s ± u_s is that of the data alone by 1/u² − 1/u_s² and
    θ/u² − s/u_s², and data and prior agree within √(u_data² + u_s²).

    """
    stated, priors = system.fit.model.stated(), system.fit.model.priors()
    usual = {c.name: c for c in BASE if c.name in STATE}
    sure_of, notes, policy = _reported(system, held_out), [], system.policy.fit
    for place, column in enumerate(system.columns[: system.model_columns.size]):
        if column.name not in {*stated, *usual}:
            continue
        (stated_value, u_stated), u = priors[column.name], float(sure_of.u[place])
        u_alone = _beyond(np.array([u]), np.array([u_stated**-2.0]), policy)[0]
        if not math.isfinite(u_alone):
            continue
        value = u_alone**2 * (system.fit.values[column.name] / u**2 - stated_value / u_stated**2)
        if abs(value - stated_value) > policy.contradicted * math.hypot(u_alone, u_stated):
            instrument, result = usual.get(column.name), f"{value:.4g} ± {u_alone:.2g}"
            prior = f"is stated as {stated_value:.4g} ± {u_stated:.2g}, and without that"
            if instrument is not None:
                prior = (
                    f"({instrument.words}) is usually within {u_stated:.2g} {instrument.unit}, and"
                )
                result = f"{result} {instrument.unit}"
            notes.append(f"{column.name} {prior} these captures say {result}")
    return tuple(notes)


def _of_handbooks(system: LinearSystem) -> Array:
    """Prior precision [own] of the parameters, without what full logs of these captures give."""
    known = system.fit.model.parameters()
    logged = {name for name, (_, p) in known.items() if p.amplitude and p.u > 0.0}
    columns = system.columns[: system.model_columns.size]
    elsewhere = np.array([column.name not in logged for column in columns])
    return np.where(elsewhere, system.prior_precision[: len(columns)], 0.0)


def _beyond(u: Array, prior_precision: Array, policy: GaussNewton) -> Array:
    """Standard uncertainties [P] without the priors of inverse variance `prior_precision` [P];
    infinite where there is nothing else, since what handbooks say is not measured.
    """
    information = np.maximum(u, 1e-300) ** -2.0 - prior_precision
    informed = information > policy.least_information * prior_precision
    return np.where(informed, np.maximum(information, 1e-300) ** -0.5, math.inf)


def _parameter(value: float, u: float, unit: str, known: bool, bound: bool) -> ModelParameter:
    return ModelParameter(value if known else None, u if known else None, unit, bound and known)


def reported_combinations(system: LinearSystem, held_out: HeldOut) -> tuple[KnownCombination, ...]:
    """Combinations that the captures determine of parameters that they do not determine one by one.

    Parameters
    ----------
    system
        The fit.
    held_out
        Its held-out residual.

    Returns
    -------
    tuple of KnownCombination
        Ratios, products and sums.

    Notes
    -----
    A matrix describes where the fit stands. So the directions without information are followed to
    either end: what is reported must be all that there is to know far from the fit as well.

    """
    fit, policy = system.fit, system.policy.fit
    names = [c.name for c in system.columns[: system.model_columns.size]]
    sure_of = _reported(system, held_out)
    identified = sure_of.identified
    values = np.array([fit.values[name] for name in names])
    physical = {**dict.fromkeys(PHYSICAL), **fit.model.parameters()}
    observed = np.any(system.matrix[:, : len(names)] != 0.0, axis=0)
    open_ = np.isinf(identified.u) | ~identified.determined
    places = [n for n, name in enumerate(names) if name in physical and observed[n] and open_[n]]
    positive = [names.index(name) for name in POSITIVE if fit.values[name] > 0.0]
    joint = known_combinations(identified, values, places, positive)
    moving = np.zeros(len(names), dtype=bool)
    for moved, walked_to in (
        walked(identified, values, joint, math.log(policy.walk_factor)) if joint else ()
    ):
        at = replace(fit, values=fit.values | dict(zip(names, walked_to.tolist(), strict=True)))
        deviance = linear_system(at, before=system, chord=True).deviance
        if not abs(deviance - system.deviance) < policy.walk_rise:
            moving |= moved
    named = _named(system, sure_of)
    wide = [(one, sure_of.u_of(one.gradient, bent=one.product)) for one in joint]
    wide = [
        (one, u)
        for one, u in wide
        if new_direction([*named.values(), one.gradient * identified.sizes])
    ]
    combined = [
        _combined(one, u, names, fit.model)
        for one, u in wide
        if not moving[[place for place, _ in one.weights]].any()
        if within(np.array(u), np.array(one.size))
    ]
    if fit.model.machine.pairs_known:
        return (*named, *combined)
    place = names.index("psi_wb")
    if not open_[place] and observed[place] and REACH * sure_of.u[place] < values[place]:
        u = float(sure_of.u[place])
        combined.insert(0, KnownCombination("psi_wb", float(values[place]), u, "Wb", ("psi_wb",)))
    return (*named, *(c for one in combined if (c := _of_pairs(one))))


def _named(system: LinearSystem, sure_of: Known) -> dict[KnownCombination, Array]:
    """Combinations that the equations of the segments name, where the captures determine them.

    Parameters
    ----------
    system
        The fit.
    sure_of
        What it determines.

    Returns
    -------
    dict of array [own]
        Gradient in sizes of the parameters, by combination; without those of which every parameter
        is determined alone.

    """
    fit, identified = system.fit, sure_of.identified
    names = [c.name for c in system.columns[: system.model_columns.size]]
    # central differences in sizes of the parameters: their own error is the square of that share
    steps = dict(zip(names, (1e-4 * identified.sizes).tolist(), strict=True))
    open_ = dict(
        zip(names, (np.isinf(identified.u) | ~identified.determined).tolist(), strict=True)
    )
    first = {segment.kind: segment for segment in reversed(system.segments)}
    offered = [(s, one) for s in first.values() for one in equation_of(s).use.combinations]
    named: dict[KnownCombination, Array] = {}
    for segment, one in offered:
        if not any(open_.get(name, True) for name in one.of):
            continue
        value = one.value(segment, fit.model, fit.values)
        gradient = np.zeros(len(names))
        for place, (name, step) in enumerate(steps.items()):
            ahead, back = (
                one.value(segment, fit.model, {**fit.values, name: fit.values[name] + way})
                for way in (step, -step)
            )
            gradient[place] = (ahead - back) / (2.0 * step)
        u = sure_of.u_of(gradient, bent=True)
        sized = gradient * identified.sizes
        if within(np.array(u), np.array(max(abs(value), float(np.abs(sized).max())))):
            named[KnownCombination(one.expression, value, u, one.unit, one.of)] = sized
    return named


def _of_pairs(combination: KnownCombination) -> KnownCombination | None:
    """A combination of a machine whose pole pairs, unknown, were taken as one."""
    if {"ld_h", "lq_h"}.intersection(combination.of):
        return None
    flux_alone = combination.expression == "psi_wb"
    named = "pole_pairs*psi_wb" if flux_alone else "(pole_pairs*psi_wb)"
    return replace(combination, expression=combination.expression.replace("psi_wb", named))


def _combined(
    combination: Combination, u: float, names: Sequence[str], model: Model
) -> KnownCombination:
    """A combination as it is reported."""
    base = base_of(model.machine)
    units = {c.name: c.unit for c in base} | {n: p.unit for n, (_, p) in model.parameters().items()}
    weights = {names[place]: weight for place, weight in combination.weights}
    if combination.product:
        return KnownCombination(
            _fraction(list(weights), weights, "*"),
            combination.value,
            u,
            _fraction([units[name] for name in weights], weights, "·"),
            tuple(weights),
        )
    (first, _), (second, factor) = weights.items()
    expression = f"{first} {'+' if factor > 0.0 else '-'} {abs(factor):.9g}*{second}"
    return KnownCombination(expression, combination.value, u, units[first], tuple(weights))


def _fraction(factors: Sequence[str], weights: Mapping[str, float], times: str) -> str:
    """Names or units of powers of ±1 as one fraction."""
    powers = list(weights.values())
    above = [one for one, power in zip(factors, powers, strict=True) if power > 0]
    below = [one for one, power in zip(factors, powers, strict=True) if power < 0]
    bottom = times.join(below)
    if len(below) > 1 or "·" in bottom or "/" in bottom:
        bottom = f"({bottom})"
    top = times.join(f"({one})" if "/" in one else one for one in above) or "1"
    return f"{top}/{bottom}" if below else top
