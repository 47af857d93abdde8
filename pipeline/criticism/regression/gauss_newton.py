"""Fits by Gauss-Newton: from orders of magnitude, and from a fit that is near.

References: [1] Marquardt, SIAM J. Appl. Math. 11 (1963), a ridge for steps that reach too far; [2]
Ortega & Rheinboldt, Iterative Solution of Nonlinear Equations (1970), ch. 7, the chord method; [3]
Chamberlain, Powell, Lemarechal & Pedersen, Math. Program. Stud. 16 (1982), the watchdog technique:
a step that does harm may be followed by one that more than mends it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.machine_scale import base_scales
from pipeline.criticism.data.segment import Segment, rows_where
from pipeline.criticism.data.traces import pad_of
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import PHYSICAL, Model, base_of, zero
from pipeline.criticism.operating import Array, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.regression.bounds import Best, bounded_step
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.fit import Fit, floors, floors_grown, rough_floors
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.residuals.segments import sparse
from pipeline.criticism.signals.angle_sensor import both_axes

_SIDES = (
    ("vd_v", "vq_v", "v_pair_v", "lab_h", "rab_ohm"),
    ("torque_shaft_nm", "omega_mech_rad_s", "iq_a"),
)
"""Signals of the winding, and of the shaft."""


def start_values(model: Model, machine: Machine) -> dict[str, float]:
    """Where Gauss-Newton begins: orders of magnitude, absent effects, and stated constants.

    Parameters
    ----------
    model
        The model.
    machine
        Its scales.

    Returns
    -------
    dict of float
        By full name, in their units.

    """
    scales = base_scales(machine)
    values = {c.name: scales.get(c.name, c.center) for c in base_of(machine)}
    for effect in model.effects:
        values.update(zero(effect, model))
    return values | {name: value for name, (value, _) in model.stated().items()}


def gauss_newton(
    fit: Fit,
    before: LinearSystem | None = None,
    most: float = np.inf,
    within_reach: float = np.inf,
) -> LinearSystem:
    """Fits a model's own parameters.

    Parameters
    ----------
    fit
        Where to begin, with the noise floors that the rows are weighed by.
    before
        A system around a near fit, with whose columns it begins.
    most
        Deviance from which on it is not begun: the system around `fit` is returned as it is.
    within_reach
        Deviance that must come within reach: a fit ends where twice the fall that new columns
        predict would not do (`policy.selection.choice_falls`).

    Returns
    -------
    LinearSystem
        Around the fit, which it holds.

    Notes
    -----
    A step that makes the deviance worse is shortened. Columns stay as they are while steps do about
    what they predict (chord method); a fit has converged where new columns predict no fall, or a
    step along them wins none. Two whole steps are tried where one falls short by a tie.

    References
    ----------
    Marquardt, J. SIAM 11(2), 1963, 431, doi:10.1137/0111030.
    Ortega and Rheinboldt, Iterative Solution of Nonlinear Equations, Academic Press, 1970, ch. 7.

    """
    policy, times = fit.policy.fit, fit.policy.selection.choice_falls
    fresh = before is None
    system = linear_system(fit, before=before, chord=not fresh)
    if system.deviance >= most:
        return system
    for _ in range(policy.iterations):
        fit = system.fit
        step = bounded_step(_damped(system), system.columns, fit.model, fit.values)
        if fresh and (farther := _after_far_step(system, step)) is not None:
            system = farther
            continue
        promised = system.deviance - system.predicted_deviance(step)
        if fresh and system.deviance - times * promised > within_reach:
            break
        if promised >= policy.converged:
            halvings = policy.halvings if fresh else 1
            tried, predicted_fall = _tried(system, step, halvings)
            gain = system.deviance - tried.deviance
            kept = gain >= policy.kept_share * predicted_fall
            if fresh and not kept and predicted_fall - gain >= fit.policy.selection.tie:
                tried = _two_whole_steps(system, step, _over_inertia(system, step, tried))
                gain = system.deviance - tried.deviance
            if gain > 0:
                system = tried
            fresh = fresh and gain < policy.converged
            if kept and not fresh:
                continue
        if fresh:
            break
        system, fresh = linear_system(system.fit, before=system), True
    return system if fresh else linear_system(system.fit, before=system)


def _after_far_step(system: LinearSystem, damped: Array) -> LinearSystem | None:
    """The system after a step of a hundred times the reach, where the `damped` one wins less and it
    does what it predicts; else None.

    A coast knows friction over inertia, and one torque beside it their sizes: along that line no
    capture's prediction bends, and ten times the inertia is a step as good as any.
    """
    policy, fit = system.policy.fit, system.fit
    far = _damped(system, policy.far_reach)
    farther = bounded_step(far, system.columns, fit.model, fit.values)
    falls = [system.deviance - system.predicted_deviance(step) for step in (damped, farther)]
    if max(falls[0], policy.converged) >= policy.kept_share * falls[1]:
        return None
    tried = linear_system(fit.moved(system.columns, farther), before=system)
    return tried if system.deviance - tried.deviance >= policy.kept_share * falls[1] else None


def _tried(system: LinearSystem, step: Array, halvings: int) -> tuple[LinearSystem, float]:
    """The system after a step, shortened until it does no harm, with the columns of the start; and
    the fall of deviance that these columns predicted.
    """
    policy = system.policy.fit
    for _ in range(halvings):
        moved = system.fit.moved(system.columns, step)
        tried = linear_system(moved, before=system, chord=True)
        predicted_fall = system.deviance - system.predicted_deviance(step)
        if tried.deviance < system.deviance + policy.converged:
            break
        step = policy.shortening * step
    return tried, predicted_fall


def _over_inertia(system: LinearSystem, step: Array, shortened: LinearSystem) -> LinearSystem:
    """The system after a step in 1/J, if that is better than the shortened one: from an inertia
    that is many times too large no short step in J leads back.
    """
    names = (column.name for column in system.columns)
    moved = system.fit.moved_over_inertia(dict(zip(names, step.tolist(), strict=True)))
    if moved is None:
        return shortened
    return min(shortened, linear_system(moved, before=system), key=lambda one: one.deviance)


def _two_whole_steps(system: LinearSystem, step: Array, shortened: LinearSystem) -> LinearSystem:
    """The system after the whole of a step and another from there, if that is better than the
    shortened one [3].

    A product of two parameters that a capture knows well, such as a coast's friction and its share,
    is a narrow curve: short steps creep along it, and two whole ones are next to its end.
    """
    beyond = linear_system(system.fit.moved(system.columns, step), before=system)
    further = bounded_step(_damped(beyond), beyond.columns, beyond.fit.model, beyond.fit.values)
    end, _ = _tried(beyond, further, 1)
    return min(shortened, end, key=lambda one: one.deviance)


def _damped(system: LinearSystem, reach: float = 1.0) -> Best:
    """The best step along some of the columns, none of them much farther than its `reach`."""
    ridge = _ridge(system.fit, system.columns) / reach**2
    normal_equations = replace(
        system, prior_precision=system.prior_precision + ridge
    ).normal_equations()
    return lambda live: normal_equations.only(live).best()


def _ridge(fit: Fit, columns: Sequence[Column]) -> Array:
    """Inverse variance [P] of one step (a prior would be one of where it ends).

    So a parameter that the captures hardly know does not leave the range in which the equations are
    near their tangent [1]. A constant next to zero still has some reach: a missing effect may have
    brought it there, as an encoder off its centre does J.
    """
    machine, policy = fit.model.machine, fit.policy.fit
    scales = base_scales(machine)
    reach = {
        name: max(abs(fit.values[name]), policy.least_reach * scales[name]) for name in PHYSICAL
    }
    for name, (_, p) in fit.model.parameters().items():
        share = policy.effect_reach if p.amplitude else policy.shape_reach
        reach[name] = share * max(abs(fit.values[name]), p.typical * machine.scale(p))
    spans = np.array([reach.get(column.name, np.inf) for column in columns])
    return np.maximum(spans, 1e-30) ** -2


def rough_fit(segments: Sequence[Segment], model: Model, known: Values | None = None) -> Fit:
    """Fits a model to a few windows of each segment, every equation by the machine's own scale.

    Parameters
    ----------
    segments
        All segments.
    model
        Machine and effects.
    known
        Values to begin with; where not given, what signals show at once, else orders of magnitude.

    Returns
    -------
    Fit
        Of all segments, with the scales for noise floors.

    Notes
    -----
    By its noise floor alone, an equation that is far off would be given up before the constants are
    near.

    """
    values = start_values(model, model.machine)
    for segment in segments:
        if (begins := equation_of(segment).begins) is not None:
            values |= begins(segment, model.machine)
    values |= known or {}
    cutting = model.policy.cutting
    thinned = tuple(sparse(s, cutting.rough_windows, pad_of(s.ts_s, cutting)) for s in segments)
    rough = rough_floors(thinned, model, values)
    fitted = gauss_newton(Fit(thinned, _pinned(model), values, rough, values)).fit
    return replace(fitted, model=model, segments=tuple(segments))


def _pinned(model: Model) -> Model:
    """The model with stated constants and the lag of a drive's frame all but fixed, until the
    others are near.

    From orders of magnitude a step moves an inertia that nothing but its prior determines, and the
    way back is a narrow curve of friction over inertia. On a free shaft a lag by acceleration is
    next to an inductance, which it would drive to its bound.
    """
    share, priors = model.policy.fit.pinned, model.policy.priors
    stated = {n: (value, share * u) for n, (value, u) in model.machine.stated.items()}
    priors = replace(priors, bend_angle_s2=share * priors.bend_angle_s2)
    policy = replace(model.policy, priors=priors)
    return replace(model, machine=replace(model.machine, stated=stated, policy=policy))


def first_fit(rough: Fit) -> LinearSystem:
    """Fits a model from a rough fit, every equation weighted by its noise floor.

    Parameters
    ----------
    rough
        The rough fit.

    Returns
    -------
    LinearSystem
        Of a short programme of captures, the best of three starts: all equations together, those of
        the winding first, and those of the shaft first.

    Notes
    -----
    A few windows by the machine's own scale tell a small inertia badly, and the noise of an
    acceleration is that of a current over the inertia. So a fit that ends far from the rough one
    has floors of its own.

    """
    floor = floors(rough.segments, rough.model, rough.values)
    begun = replace(rough, model=_pinned(rough.model), sigma=floor, near=rough.values)
    ends = [gauss_newton(begun)]
    if len(rough.segments) <= rough.policy.fit.short_programme:
        ends += [_one_side_first(begun, side) for side in _SIDES]
    end = min(ends, key=summed_error)
    if rough.model.stated() or any(both_axes(segment) for segment in rough.segments):
        end = gauss_newton(replace(end.fit, model=rough.model))
    if not floors_changed(end.fit):
        return end
    own = floors(end.fit.segments, end.fit.model, end.fit.values)
    return gauss_newton(replace(end.fit, sigma=own, near=end.fit.values), before=end)


def summed_error(system: LinearSystem) -> float:
    """How far the equations are missed, each counted once.

    Parameters
    ----------
    system
        A fit.

    Returns
    -------
    float
        Sum of log(1 + χ²/n) over the groups of rows.

    Notes
    -----
    What a model lacks is one error in all windows of a signal. By their numbers, a drag that it
    lacks, in hundreds of windows, would be worth a winding of the wrong size in a few tens.

    """
    return float(np.log1p(system.reduced_chi2(system.residual)).sum())


def floors_changed(fit: Fit) -> bool:
    """Whether some noise floor is another one at the values of a fit than the fit was made with.

    Parameters
    ----------
    fit
        The fit.

    """
    grown = np.concatenate(floors_grown(fit))
    return bool(np.abs(np.log(grown)).max() >= math.log(fit.policy.selection.floor_ratio))


def rough_anew(fit: Fit) -> Fit:
    """A rough fit begun once more from orders of magnitude, shapes of effects as they are.

    Parameters
    ----------
    fit
        The fit whose model is meant.

    Returns
    -------
    Fit
        With the tolerance of the former one.

    Notes
    -----
    Before an effect was added, its absence may have moved constants, and the floors made by them,
    to where no step leads back from: an encoder off its centre shakes a light rotor less.

    """
    model = fit.model
    shapes = [name for name, (_, p) in model.parameters().items() if not p.amplitude]
    refitted = rough_fit(fit.segments, model, {name: fit.values[name] for name in shapes})
    return replace(refitted, tolerance=fit.tolerance)


def _one_side_first(rough: Fit, side: tuple[str, ...]) -> LinearSystem:
    """A fit that begins with the equations of some signals alone.

    In a short programme few captures hold the equations together. Where these contradict each
    other, which of them is given up must not depend on where the fit began.
    """
    silent = rough.policy.fit.silent
    sigma_of_side = tuple(
        np.where(rows_where(segment, lambda channel, _: channel in side), sigma, silent * sigma)
        for segment, sigma in zip(rough.segments, rough.sigma, strict=True)
    )
    begun = gauss_newton(replace(rough, sigma=sigma_of_side)).fit
    return gauss_newton(replace(begun, sigma=rough.sigma))
