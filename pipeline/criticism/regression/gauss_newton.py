"""Fits by Gauss-Newton: from orders of magnitude, and from a fit that is near.

References: [1] Marquardt, SIAM J. Appl. Math. 11 (1963), a ridge for steps that reach too far; [2]
Ortega & Rheinboldt, Iterative Solution of Nonlinear Equations (1970), ch. 7, the chord method.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.data.segment import Segment, row_index
from pipeline.criticism.effect import Array, Machine, Values
from pipeline.criticism.machine.model import PHYSICAL, Model, base_of, zero
from pipeline.criticism.regression.bounds import Best, bounded_step, limits_of
from pipeline.criticism.regression.linear_system import Fitted, System, floors, system
from pipeline.criticism.regression.linearise import Column
from pipeline.criticism.regression.noise_floors import rough_floor
from pipeline.criticism.residuals.segments import sparse

_SIDES = (
    ("vd_v", "vq_v", "v_pair_v", "lab_h", "rab_ohm"),
    ("torque_shaft_nm", "omega_mech_rad_s", "iq_a"),
)
"""Signals of the winding, and of the shaft."""


def start_values(model: Model, machine: Machine) -> dict[str, float]:
    """Where Gauss-Newton begins: orders of magnitude; the base is linear in its constants."""
    scales = base_scales(machine)
    values = {c.name: scales.get(c.name, c.center) for c in base_of(machine)}
    for effect in model.effects:
        values.update(zero(effect, model))
    return values


def clipped(model: Model, values: dict[str, float]) -> dict[str, float]:
    """Values moved inside their bounds."""
    inside = dict(values)
    for name, (low, high) in limits_of(model).items():
        inside[name] = min(max(values[name], low), high)
    return inside


def gauss_newton(
    segments: Sequence[Segment],
    fitted: Fitted,
    before: System | None = None,
) -> tuple[Fitted, System]:
    """Fits a model's own parameters; returns the fit and the system around it.

    A step that makes the deviance worse is shortened. Columns stay as they are while steps do about
    what they promise [2]; a fit is at its end where columns made anew promise nothing.
    """
    policy = fitted.policy.fit
    around, fresh = system(segments, fitted, before=before), True
    for _ in range(policy.iterations):
        step = bounded_step(_damped(fitted, around), around.columns, fitted.model, fitted.values)
        if around.misfit - around.foreseen(step) >= policy.converged:
            halvings = policy.halvings if fresh else 1
            moved, tried, promised = _tried(segments, fitted, around, step, halvings)
            gain = around.misfit - tried.misfit
            if gain > 0:
                fitted, around = moved, tried
            fresh = fresh and gain <= 0
            if gain >= max(policy.kept_share * promised, policy.converged):
                continue
        if fresh:
            break
        around, fresh = system(segments, fitted, before=around), True
    return fitted, around if fresh else system(segments, fitted, before=around)


def _tried(
    segments: Sequence[Segment], fitted: Fitted, around: System, step: Array, halvings: int
) -> tuple[Fitted, System, float]:
    """The fit after a step, shortened until it does no harm; the system there, with the columns of
    the start; and the fall of deviance that these columns promised.
    """
    policy = fitted.policy.fit
    for _ in range(halvings):
        moved = _moved(fitted, around.columns, step)
        tried = system(segments, moved, before=around, chord=True)
        promised = around.misfit - around.foreseen(step)
        if tried.misfit < around.misfit + policy.converged:
            break
        step = policy.shortening * step
    return moved, tried, promised


def _damped(fitted: Fitted, around: System) -> Best:
    """The best step along some of the columns, none of them far."""
    ridge = _ridge(fitted, around.columns)
    grams = replace(around, penalty=around.penalty + ridge).grams()
    return lambda live: grams.along(live).best()


def _ridge(fitted: Fitted, columns: Sequence[Column]) -> Array:
    """Inverse variance [P] of one step (a prior would be one of where it ends).

    So a parameter that the captures hardly know does not leave the range in which the equations are
    near their tangent [1]. A constant next to zero still has some reach: a missing effect may have
    brought it there, as an encoder off its centre does J.
    """
    machine, policy = fitted.model.machine, fitted.policy.fit
    scales = base_scales(machine)
    reach = {
        name: max(abs(fitted.values[name]), policy.least_reach * scales[name]) for name in PHYSICAL
    }
    for name, (_, p) in fitted.model.parameters().items():
        if p.amplitude:
            reach[name] = policy.effect_reach * max(
                abs(fitted.values[name]), p.typical * machine.scale(p)
            )
    spans = np.array([reach.get(column.name, np.inf) for column in columns])
    ridge: Array = np.maximum(spans, 1e-30) ** -2
    return ridge


def _moved(fitted: Fitted, columns: Sequence[Column], step: Array) -> Fitted:
    values = dict(fitted.values)
    for column, change in zip(columns, step, strict=True):
        values[column.name] += float(change)
    return replace(fitted, values=clipped(fitted.model, values))


def rough_fit(segments: Sequence[Segment], model: Model, known: Values | None = None) -> Fitted:
    """Fits a model from orders of magnitude, or from the values that are `known`.

    Every equation counts by the machine's own scale. By its noise floor, one that is far off would
    be given up before the constants are near. A few windows of each segment are enough.
    """
    values = {**start_values(model, model.machine), **(known or {})}
    few = [sparse(segment) for segment in segments]
    rough = tuple(rough_floor(segment, model, values) for segment in few)
    near, _ = gauss_newton(few, Fitted(model, values, rough, values))
    return near


def first_fit(segments: Sequence[Segment], near: Fitted) -> tuple[Fitted, System]:
    """Fits a model from a rough fit, every equation by its noise floor."""
    floor = floors(segments, near.model, near.values)
    begun = replace(near, sigma=floor, near=near.values)
    ends = [gauss_newton(segments, begun)]
    if len(segments) <= near.policy.fit.short_programme:
        ends += [_one_side_first(segments, begun, side) for side in _SIDES]
    return min(ends, key=lambda end: end[1].misfit)


def rough_anew(segments: Sequence[Segment], fitted: Fitted) -> Fitted:
    """A rough fit begun once more from orders of magnitude, shapes of effects as they are.

    Before an effect came in, its absence may have moved constants, and the floors made by them, to
    where no step leads back from: an encoder off its centre shakes a light rotor less.
    """
    model = fitted.model
    shapes = [name for name, (_, p) in model.parameters().items() if not p.amplitude]
    near = rough_fit(segments, model, {name: fitted.values[name] for name in shapes})
    return replace(near, tolerance=fitted.tolerance)


def _one_side_first(
    segments: Sequence[Segment], near: Fitted, side: tuple[str, ...]
) -> tuple[Fitted, System]:
    """A fit that begins with the equations of some signals alone.

    In a short programme few captures hold the equations together. Where these contradict each
    other, which of them is given up must not depend on where the fit began.
    """
    silent = near.policy.fit.silent
    alone = tuple(
        np.where([channel in side for channel, _ in row_index(segment)[3]], sigma, silent * sigma)
        for segment, sigma in zip(segments, near.sigma, strict=True)
    )
    begun, _ = gauss_newton(segments, replace(near, sigma=alone))
    return gauss_newton(segments, replace(begun, sigma=near.sigma))
