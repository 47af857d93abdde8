"""Structure that no known effect explains: on what it depends, and what it looks like."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.discovery.description import describe
from pipeline.criticism.discovery.matching_pursuit import Pursuit, expression
from pipeline.criticism.discovery.residual_inputs import Port, ports, refined
from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.regression.columns import Column, effect_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.pruning import loss_without
from pipeline.criticism.selection.truncation import SHAFT
from pipeline.records.diagnosis import UnknownStructure


@dataclass(frozen=True, slots=True)
class RankedInput:
    """A port with the deviance it removes less its penalty, in sample and held out.

    `residual` [R] is the residual after it, `step` [k] the model's constants and its coefficients,
    `place` where it stands in the list of ports.

    Attributes
    ----------
    port
        The input.
    gain
        Fall of the deviance less its penalty.
    held_out_gain
        The same, held out.
    residual
        Residual after it [R].
    step
        The model's constants and its coefficients [k].
    place
        Its place in the list of inputs.

    """

    port: Port
    gain: float
    held_out_gain: float
    residual: Array
    step: Array
    place: int


def unknown_structure(
    system: LinearSystem, signals: Sequence[str], name: str = "unknown", in_parts: bool = False
) -> tuple[UnknownStructure | None, float]:
    """What the structure that no effect explains depends on, as curve, expression and effect file.

    Parameters
    ----------
    system
        The last fit.
    signals
        Recorded signals that miss, the worst first.
    name
        Name of the effect that describes it.
    in_parts
        Whether captures that miss the floor are held out a twelfth at a time, for a heat run that
        has no second one. A drift of an instrument would then pass for a state of the machine.

    Returns
    -------
    tuple of UnknownStructure or None and float
        None where the best input removes too little of what is over the floor: instruments that
        drift follow no state of the machine. The number is the fall of the deviance.

    Notes
    -----
    Inputs are compared by the deviance that they remove from whole captures that they were not
    fitted to. Of those that do as well, the one of fewest variables is reported, and the others are
    named beside it.

    """
    fit = system.fit
    candidates, wide = _ranked(system, _hooks(signals), in_parts)
    if not candidates:
        return None, 0.0
    policy = fit.policy.discovery
    best = _simplest(candidates, fit.policy)
    others = tuple(
        (one.port.columns, one.held_out_gain / best.held_out_gain)
        for one in candidates
        if one is not best and one.held_out_gain > (1.0 - policy.near_share) * best.held_out_gain
    )
    port = refined(best.port, fit.model.machine, policy)
    model_size = wide.model_columns.size
    # a drag over an inertia is a product: the expression is sought around the inertia found
    moved = fit.moved(wide.columns[:model_size], best.step[:model_size])
    finer = linear_system(moved, effect_columns(port.effect, moved.model), wide)
    weight = finer.weights(finer.reduced_chi2(best.residual))
    pursuit = Pursuit(finer, model_size, port, weight)
    sketch = describe(pursuit, expression(pursuit), best.port, others, signals, name)
    return sketch, best.gain


def _hooks(signals: Sequence[str]) -> tuple[str, ...]:
    """Hooks that can reach the first of the signals that miss, and others with it: a shaft's own
    torque is not in the voltage, a winding's drop not in the torque, flux and angle are in both.
    """
    if not signals:
        return ("torque", "drop", "flux", "angle")
    if signals[0] not in SHAFT:
        return ("drop", "flux", "angle")
    alone = all(signal in SHAFT for signal in signals)
    return ("torque",) if alone else ("torque", "flux", "angle")


def is_part_of_a_curve(system: LinearSystem, signals: Sequence[str], name: str) -> bool:
    """Whether a curve of some state of the machine explains the captures better without an effect
    than the effect does, with the best curve beside it.

    Parameters
    ----------
    system
        The last fit, with the effect.
    signals
        Recorded signals that miss, the worst first.
    name
        The effect.

    Returns
    -------
    bool
        By the deviance to first order, and a penalty of ln n a parameter.

    Notes
    -----
    A torque that grows with the square of the speed is in part a friction of one direction, since
    few captures run backwards. Beside the friction a curve of the speed is still needed; beside the
    curve the friction is not.

    References
    ----------
    Schwarz, Ann. Stat. 6(2), 1978, 461, doi:10.1214/aos/1176344136.

    """
    offered, wide = _with_ports(system, _hooks(signals))
    penalty, known = math.log(wide.size), wide.normal_equations()
    thorough, own = wide.policy.selection.thorough, wide.model_columns
    plain = known.only(own).best(*thorough).deviance
    beside, alone = [0.0], [math.inf]
    for _, curve in offered:
        paid = curve.size * penalty
        both = known.only(np.concatenate([own, curve])).best(*thorough).deviance
        beside.append(both - plain + paid)
        alone.append(loss_without(wide, (name,), curve, known) + paid)
    effect = system.fit.effect(name)
    return min(alone) < min(beside) + effect.dof(system.fit.machine) * penalty


def _with_ports(
    before: LinearSystem, hooks: Sequence[str]
) -> tuple[list[tuple[Port, Indices]], LinearSystem]:
    """The ports that some capture excites, each with the places of its columns [k], and the system
    that has them.
    """
    fit = before.fit
    offered = ports(fit.model.machine, fit.policy.discovery, hooks)
    columns = [effect_columns(port.effect, fit.model) for port in offered]
    wide = linear_system(fit, [c for of_port in columns for c in of_port], before)
    ends = wide.model_columns.size + np.cumsum([len(of_port) for of_port in columns])
    places = [np.arange(end - len(c), end) for end, c in zip(ends.tolist(), columns, strict=True)]
    live = [of_port[np.any(wide.matrix[:, of_port] != 0.0, axis=0)] for of_port in places]
    return [(port, at) for port, at in zip(offered, live, strict=True) if at.size], wide


def _ranked(
    before: LinearSystem, hooks: Sequence[str], in_parts: bool
) -> tuple[list[RankedInput], LinearSystem]:
    """Every port that is worth its penalty and helps where it was not fitted, the best first."""
    fit = before.fit
    offered, wide = _with_ports(before, hooks)
    model_columns = wide.model_columns
    baseline = wide.normal_equations(model_columns).best()
    residual, base = wide.after(model_columns, baseline.step), baseline.deviance
    missed = _segments_over_floor(wide) if in_parts else None
    units = _units(wide, model_columns, residual, missed)
    reference = _held_out(wide, model_columns, residual, np.zeros(model_columns.size), units)
    excess = float(wide.counts @ np.log(np.maximum(wide.reduced_chi2(residual), 1.0)))
    penalty = math.log(wide.size)
    least = max(fit.policy.selection.tie, fit.policy.selection.least_share * excess)
    ranked = []
    for place, (port, live) in enumerate(offered):
        chosen = np.concatenate([model_columns, live])
        end = wide.normal_equations(chosen).best(*fit.policy.selection.thorough)
        after = wide.after(chosen, end.step)
        gain = base - end.deviance - live.size * penalty
        if gain <= 0.0:
            continue
        ridge = np.concatenate([np.zeros(model_columns.size), _ridge(wide.columns, live, fit)])
        held_out = reference - _held_out(wide, chosen, after, ridge, units)
        if held_out > least:
            ranked.append(
                RankedInput(
                    port, gain, held_out, after, _ridge_step(wide, chosen, after, ridge), place
                )
            )
    return sorted(ranked, key=lambda f: (-f.held_out_gain, f.port.effect.name)), wide


def _ridge(columns: Sequence[Column], live: Indices, fit: Fit) -> Array:
    """Inverse prior variance [k] of a port's coefficients: the machine's own scale."""
    machine = fit.model.machine
    scales = []
    for n in live:
        effect = columns[n].effect
        parameter = None if effect is None else effect.parameters_of(machine)[0]
        scales.append(1.0 if parameter is None else machine.scale(parameter))
    return (fit.policy.discovery.prior_size * np.array(scales)) ** -2.0


def _simplest(candidates: Sequence[RankedInput], policy: Policy) -> RankedInput:
    """Of the ports that do about as well as the best, the one of fewest variables.

    Of several that the data do not discriminate it is the one listed first, the commonest in
    machines.
    """
    tie = policy.selection.tie
    enough = candidates[0].held_out_gain - max(
        tie, policy.discovery.near_share * candidates[0].held_out_gain
    )
    close = [one for one in candidates if one.held_out_gain >= enough]
    fewest = min(len(one.port.columns) for one in close)
    simple = [one for one in close if len(one.port.columns) == fewest]
    level = max(one.held_out_gain for one in simple) - tie
    return min((one for one in simple if one.held_out_gain >= level), key=lambda one: one.place)


def _segments_over_floor(system: LinearSystem) -> Indices:
    """Numbers of the segments in which a fit leaves something that is reported."""
    significant = np.flatnonzero(significant_groups(system))
    return np.unique([system.labels[place][0] for place in significant])


def _units(
    system: LinearSystem,
    model_columns: Indices,
    residual: Array,
    missed: Indices | None,
) -> Indices:
    """For every row [R] the number of what is held out together: a capture, or a part of one of the
    segments in `missed`; -1 for rows that are always in the fit.

    Always in the fit is what alone determines a constant. With parts it is also every other
    capture, which has nothing to predict, and the first and last part: no curve is known beyond its
    ends.
    """
    segment = system.segment
    units = segment.astype(np.int64)
    if missed is not None:
        last = np.zeros(len(system.segments), dtype=np.int64)
        np.maximum.at(last, segment, system.window)
        part = system.policy.discovery.parts * system.window // (last[segment] + 1)
        inner = np.isin(segment, missed) & (part > 0) & (part < system.policy.discovery.parts - 1)
        units = np.where(inner, system.policy.discovery.parts * segment + part, -1)
    sole_support = np.isin(units, _carrying(system, model_columns, residual, units))
    return np.where(sole_support, -1, units)


def _carrying(
    system: LinearSystem,
    model_columns: Indices,
    residual: Array,
    units: Indices,
) -> list[int]:
    """Units without which some constant of the model is lost."""
    policy = system.policy.goodness
    weight = system.weights(system.reduced_chi2(residual))
    live = model_columns[np.any(system.matrix[:, model_columns] != 0.0, axis=0)]
    matrix = system.matrix[:, live]
    normal = (matrix * weight[:, None]).T @ matrix + np.diag(system.prior_precision[live])
    scale = np.sqrt(np.diag(normal))
    spread = np.diag(np.linalg.pinv(normal / np.outer(scale, scale), hermitian=True))
    carrying = []
    for number in np.unique(units[units >= 0]).tolist():
        in_unit = units == number
        rows = matrix[in_unit]
        remaining = normal - (rows * weight[in_unit, None]).T @ rows
        inverse = np.linalg.pinv(remaining / np.outer(scale, scale), rcond=1e-12, hermitian=True)
        grown = np.diag(inverse) / np.maximum(spread, 1e-300)
        unsupported = np.diag(remaining) < policy.lost_share * np.diag(normal)
        if grown.max() > policy.carried_growth or unsupported.any():
            carrying.append(number)
    return carrying


def _ridge_step(system: LinearSystem, places: Indices, residual: Array, ridge: Array) -> Array:
    """Step [k] of least deviance; by `ridge`, curve and constant of one shape do not run away."""
    weight = system.weights(system.reduced_chi2(residual))
    matrix = system.matrix[:, places]
    weighted = matrix * weight[:, None]
    normal = weighted.T @ matrix + np.diag(system.prior_precision[places] + ridge)
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    slope = (weighted.T @ system.residual + system.prior_gradient[places]) / scale
    return -np.linalg.lstsq(normal / np.outer(scale, scale), slope, rcond=1e-12)[0] / scale


def _held_out(
    system: LinearSystem,
    places: Indices,
    residual: Array,
    ridge: Array,
    units: Indices,
) -> float:
    """Deviance of every unit as predicted without it, by the columns at `places`.

    `residual` [R] is that at their best fit, and gives the weights; rows of unit -1 keep it. A
    coefficient that no other unit shows stays at zero, by `ridge`.
    """
    weight = system.weights(system.reduced_chi2(residual))
    matrix = system.matrix[:, places]
    weighted = matrix * weight[:, None]
    prior_precision = np.diag(system.prior_precision[places] + ridge)
    normal = weighted.T @ matrix + prior_precision
    slope = weighted.T @ system.residual + system.prior_gradient[places]
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    predicted = residual.copy()
    for number in np.unique(units[units >= 0]).tolist():
        in_unit = units == number
        if not np.any(matrix[in_unit]):
            continue
        remaining = (normal - weighted[in_unit].T @ matrix[in_unit]) / np.outer(scale, scale)
        slope_remaining = (slope - weighted[in_unit].T @ system.residual[in_unit]) / scale
        step = -np.linalg.lstsq(remaining, slope_remaining, rcond=1e-12)[0] / scale
        predicted[in_unit] = system.residual[in_unit] + matrix[in_unit] @ step
    return system.deviance_of(system.reduced_chi2(predicted))
