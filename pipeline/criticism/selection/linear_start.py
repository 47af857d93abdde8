"""An effect tried from its linear form, where the base fit is too far off for a tangent.

With most of the inertia behind a soft shaft the base fit ends with an inertia and a friction that
are a tenth of the true ones, and no tangent leads from there to two masses. In the load that a
transducer beyond the far part reads,

    T_load = T − drags − J θ″ + (f J/k) [T″ − (1 − f) J θ⁗] − (f J/k) (c/k) [T″ − (1 − f) J θ⁗]′,

all is linear in J, the drags and four further parameters, but for the drags in the torque that is
passed on. So a fit gives the share f, the stiffness k and the damping c, wherever the base fit
ended, and the coupling is fitted from these.
Any effect with a `LinearForm` is tried so.

Reference: Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from pipeline.criticism.data.segment import rows_where
from pipeline.criticism.effect import Effect, LinearForm
from pipeline.criticism.machine.model import zero
from pipeline.criticism.operating import Flags
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton, summed_error
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.candidates import Candidate, first_of_each, searched
from pipeline.criticism.selection.improvement import FitQuality, clears, fall_below_floor, share_of
from pipeline.criticism.selection.score_test import Score, paid_for, ranked
from pipeline.criticism.selection.sizes import size_of


def with_linear_start(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: Flags,
) -> tuple[Score, ...]:
    """Scores, those of effects with a linear form from that form where it beats the tangent.

    Parameters
    ----------
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    scores
        Scores by the tangent.
    significant
        Groups [G] over their floor; a form is tried where its signal is among them and misses by
        `policy.selection.coupling_floors`.

    Returns
    -------
    tuple of Score
        The largest fall first.

    """
    so_far = list(scores)
    for candidate in first_of_each(offered).values():
        form = candidate.effect.linear
        if form is None or not _exceeds_floor(wide, significant, form.channel):
            continue
        ends: list[LinearSystem] = []
        for start in map(_floored, _fits_from_form(wide.fit, candidate.effect, form)):
            # the noise is the same whatever is chosen
            ends += map(gauss_newton, _by_choices(start))
        if ends:
            nearest = sorted(ends, key=summed_error)[: wide.policy.selection.refits]
            end = min((_reweighted(one.fit, one.fit) for one in nearest), key=summed_error)
            so_far = with_better(so_far, _score_of(wide, candidate, end), offered)
    return tuple(so_far)


def _by_choices(begun: Fit) -> list[Fit]:
    """A start with every value of its last effect's choices: a linear form is of one of them."""
    effect = begun.model.effects[-1]
    choices = {name: p.scan for name, p in effect.named(begun.machine).items() if p.choice}
    values = product(*choices.values())
    return [begun.at(dict(zip(choices, one, strict=True))) for one in values]


def with_better(
    scores: Sequence[Score], started: Score, offered: Sequence[Candidate]
) -> list[Score]:
    """Scores with another one of an effect in the place of its own, where that is of more fall.

    Parameters
    ----------
    scores
        One an effect.
    started
        The other one, without what the search costs.
    offered
        The candidates.

    Returns
    -------
    list of Score
        The largest fall first.

    """
    effect = started.candidate.effect
    name = effect.name
    started = replace(started, penalty=started.penalty + searched(offered, effect))
    others = [score for score in scores if score.candidate.effect.name != name]
    known = [score for score in scores if score.candidate.effect.name == name]
    best = max([started, *known], key=lambda score: score.fall)
    return list(ranked([*others, best]))


def _exceeds_floor(wide: LinearSystem, significant: Flags, channel: str) -> bool:
    """Whether some plain signal misses its floor by so much that the base may be wrong."""
    least = wide.policy.selection.coupling_floors**2
    q = wide.reduced_chi2(wide.residual)
    groups = zip(wide.labels, q, significant, strict=True)
    return any(
        over and q > least for (_, name, order), q, over in groups if (name, order) == (channel, 0)
    )


def scored(wide: LinearSystem, candidate: Candidate, begun: Fit) -> Score:
    """The score of an effect fitted from a start of its own.

    Parameters
    ----------
    wide
        The fit without it.
    candidate
        The effect.
    begun
        Where the fit with it begins; the last effect of its model is the candidate's.

    Returns
    -------
    Score
        Without what the search over candidates costs.

    Notes
    -----
    A twist derived from an angle amplifies its noise. Both fits use the noise floors of the fit
    with the effect.

    """
    return _score_of(wide, candidate, _fitted(begun))


def _fitted(begun: Fit) -> LinearSystem:
    """A fit from a start, by the noise floors of its end."""
    refitted = gauss_newton(_floored(begun))
    return _reweighted(refitted.fit, refitted.fit)


def _floored(begun: Fit) -> Fit:
    """A start with the noise floors that the segments have there."""
    return replace(begun, sigma=floors(begun.segments, begun.model, begun.values))


def _score_of(wide: LinearSystem, candidate: Candidate, end: LinearSystem) -> Score:
    """The score of an effect at its fit, over one without it by the same noise floors; its moves
    are from the fit that there is.
    """
    score = score_between(_reweighted(wide.fit, end.fit), end, candidate)
    return replace(score, moves=_moves(wide.fit, end.fit))


def _moves(fit: Fit, end: Fit) -> dict[str, float]:
    """How far the parameters of a fit are from those of another one."""
    return {name: end.values[name] - value for name, value in fit.values.items()}


def score_between(base: LinearSystem, end: LinearSystem, candidate: Candidate) -> Score:
    """The score of an effect by fits without it and with it.

    Parameters
    ----------
    base, end
        The fits, by the same noise floors; the last effect of the second one is the candidate's.
    candidate
        The effect.

    Returns
    -------
    Score
        Without what the search over candidates costs.

    """
    before, after = _quality(base), _quality(end)
    effect, machine = end.fit.model.effects[-1], base.fit.machine
    parameters = effect.named(machine)
    values = {name: end.fit.values[name] for name in parameters}
    score = Score(
        replace(candidate, effect=effect, values=values),
        before.deviance - after.deviance,
        0.0,
        {name: values[name] for name, p in parameters.items() if p.amplitude},
        _moves(base.fit, end.fit),
        share_of(base, effect, before, after),
        size_of(end.fit, effect, parameters.values()),
        fall_below_floor(base, before.reduced_chi2, after.reduced_chi2),
        policy=base.policy.selection,
    )
    dof = paid_for(effect, machine, score)
    return replace(score, penalty=dof * math.log(base.size))


def _reweighted(fit: Fit, other: Fit) -> LinearSystem:
    """A fit again, by the noise floors that the segments have at the values of another one."""
    sigma = floors(other.segments, other.model, other.values)
    return gauss_newton(replace(fit, sigma=sigma, near=other.values))


def _quality(system: LinearSystem) -> FitQuality:
    chi2 = system.reduced_chi2(system.residual)
    return FitQuality(system.deviance, chi2, float(system.prior_costs().sum()))


def _fits_from_form(fit: Fit, effect: Effect, form: LinearForm) -> list[Fit]:
    """Where fits with the effect begin: at the values that its linear form gives, by its choices.

    At an order of the angle the torque's fourth derivative of an angle is noise. These rows are
    left out. There is no start where the linear form does not take most of the signal's power over
    the floor: what makes it miss is something else.
    """
    silent, machine = fit.policy.fit.silent, fit.machine
    sigmas = tuple(
        np.where(
            rows_where(segment, lambda channel, order: channel == form.channel and order != 0),
            silent * sigma,
            sigma,
        )
        for segment, sigma in zip(fit.segments, fit.sigma, strict=True)
    )
    rigid = gauss_newton(replace(fit, sigma=sigmas))
    acting = np.array([channel == form.channel for _, channel, _ in rigid.labels])
    model = fit.model.with_effects(form.effect)
    begun = replace(
        fit, model=model, values={**fit.values, **zero(form.effect, model)}, sigma=sigmas
    )
    starts = []
    for end in map(gauss_newton, _by_choices(begun)):
        moved = dict(end.fit.values)
        linear = {p.name: moved.pop(f"{form.effect.name}.{p.name}") for p in form.effect.parameters}
        values = form.values(linear, moved, machine)
        chi2 = [one.reduced_chi2(one.residual) for one in (rigid, end)]
        if values is not None and clears(end, acting, *chi2):
            start = {f"{effect.name}.{name}": value for name, value in values.items()}
            starts.append(replace(fit, model=fit.model.with_effects(effect)).at({**moved, **start}))
    return starts
