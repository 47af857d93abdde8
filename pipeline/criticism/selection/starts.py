"""Effects fitted from starts of their own, to which no tangent at the base fit leads.

The start is the linear form of an effect, a rotor that is round, what full logs show, or a nuisance
that is an effect of unusual size. `selection.far_starts` tries amplitudes far from zero.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from itertools import compress, product

import numpy as np

from pipeline.criticism.data.segment import rows_where
from pipeline.criticism.effect import Effect, LinearForm
from pipeline.criticism.machine.model import zero
from pipeline.criticism.operating import Flags, Values
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton, summed_error
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.observability import observes
from pipeline.criticism.selection.candidates import Candidate, first_of_each, searched
from pipeline.criticism.selection.discrimination import full_logs, settled
from pipeline.criticism.selection.improvement import FitQuality, clears, fall_below_floor, share_of
from pipeline.criticism.selection.score_test import Score, paid_for, ranked
from pipeline.criticism.selection.sizes import size_of

_INDUCTANCES = ("ld_h", "lq_h")


def with_nuisances(
    wide: LinearSystem, offered: Sequence[Candidate], scores: Sequence[Score]
) -> tuple[Score, ...]:
    """Scores, those of effects `in_place_of` a nuisance from its value where that is as good.

    Parameters
    ----------
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    scores
        Scores by the tangent.

    Returns
    -------
    tuple of Score
        The largest fall first.

    Notes
    -----
    No tangent leads to a nuisance of unusual size. A lag of the torque is undone before an effect's
    own is tried, so that a second one beside it is a filter of second order.

    """
    best = {score.candidate.effect.name: score for score in scores}
    for name, candidate in first_of_each(offered).items():
        if candidate.effect.in_place_of is None:
            continue
        score, known = _taken_over(wide, offered, candidate), best.get(name)
        if known is None or score.fall > known.fall - wide.policy.selection.tie:
            best[name] = score
    return ranked(best.values())


def _taken_over(wide: LinearSystem, offered: Sequence[Candidate], candidate: Candidate) -> Score:
    """The score of an effect that takes over a nuisance's value, and so saves its prior's cost."""
    effect, fit, policy = candidate.effect, wide.fit, wide.policy.selection
    nuisance, parameter = effect.in_place_of or ("", "")
    (known,) = (p for p in effect.parameters_of(fit.machine) if p.name == parameter)
    scale, value = fit.machine.scale(known), fit.values[nuisance]
    costs = wide.prior_costs()
    own = [n for n, column in enumerate(wide.columns) if column.name == nuisance]
    saved = float(costs[own].sum()) if value > known.low * scale else 0.0
    total = float(costs.sum())
    score = Score(
        candidate,
        saved,
        0.0,
        {f"{effect.name}.{parameter}": value},
        {},
        saved / total if total > policy.excess else 0.0,
        abs(value) / (known.negligible * scale),
        policy=policy,
    )
    dof = paid_for(effect, fit.machine, score)
    return replace(score, penalty=dof * math.log(wide.size) + searched(offered, effect))


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
        Groups [G] over their floor; a form is tried where its signal is among them.

    Returns
    -------
    tuple of Score
        The largest fall first.

    Notes
    -----
    With most of the inertia behind a soft shaft the base fit ends with an inertia and a friction
    that are a tenth of the true ones, and no tangent leads from there to two masses. In the load
    that a transducer beyond the far part reads,

        T_load = T − drags − J θ″ + (f J/k) {[T″ − (1 − f) J θ⁗] − (c/k) [T″ − (1 − f) J θ⁗]′},

    all is linear in J, the drags and four further parameters, but for the drags in the torque that
    is passed on. So a fit gives the share f, the stiffness k and the damping c, wherever the base
    fit ended, and the coupling is fitted from these.

    References
    ----------
    Ellis & Lorenz, IEEE Ind. Appl. Conf. (2000), resonant load control.

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
    """Whether a plain signal is over its floor."""
    return any(group[1:] == (channel, 0) for group in compress(wide.labels, significant))


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
    for end in (gauss_newton(start, before=rigid) for start in _by_choices(begun)):
        moved = dict(end.fit.values)
        linear = {p.name: moved.pop(f"{form.effect.name}.{p.name}") for p in form.effect.parameters}
        values = form.values(linear, moved, machine)
        chi2 = [one.reduced_chi2(one.residual) for one in (rigid, end)]
        if values is not None and clears(end, acting, *chi2):
            start = {f"{effect.name}.{name}": value for name, value in values.items()}
            starts.append(replace(fit, model=fit.model.with_effects(effect)).at({**moved, **start}))
    return starts


def with_round_rotor_start(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: Flags,
) -> tuple[Score, ...]:
    """Scores, those of errors of the angle from a round rotor where that beats the tangent.

    Parameters
    ----------
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    scores
        Scores by the tangent.
    significant
        Groups [G] over their floor. Without any, and where captures at a standstill tell both
        inductances, tangents are believed; so is one that passes.

    Returns
    -------
    tuple of Score
        The largest fall first.

    Notes
    -----
    In slow logs that hardly move i_d, an encoder off its centre leaves an L_d of many times the
    true one. An error of the angle turns the current as well, and at such an L_d what that does to
    the voltage hides it: the tangent does not show the error. The flux of a round rotor, L_d = L_q,
    turns with its current, so from there the error is fitted whatever the base fit made of both.

    """
    so_far = list(scores)
    passing = {score.candidate.effect.name for score in scores if score.passes}
    close = wide.policy.selection.close_share * max((s.fall for s in scores), default=0.0)
    for name, candidate in first_of_each(offered).items():
        effect = candidate.effect
        if effect.angle is None or name in passing or not _may_bend(wide, effect, significant):
            continue
        begun = _round_rotor(wide.fit, candidate)
        end = gauss_newton(begun, within_reach=wide.deviance - close)
        so_far = with_better(so_far, score_between(wide, end, candidate), offered)
    return tuple(so_far)


def _may_bend(wide: LinearSystem, effect: Effect, significant: Flags) -> bool:
    """Whether captures in which an effect acts have groups [G] that are not explained, and no other
    captures tell the inductances.
    """
    acts = np.array([observes(segment, effect) for segment in wide.segments])
    if not any(acts[number] for number, _, _ in compress(wide.labels, significant)):
        return False
    elsewhere = wide.matrix[~acts[wide.segment]][:, wide.place(_INDUCTANCES)]
    values = np.array([wide.fit.values[name] for name in _INDUCTANCES])
    # value over its standard uncertainty by the other captures
    sure = values * np.sqrt((elsewhere**2).sum(axis=0))
    return bool(np.any(sure < wide.policy.selection.least_u))


def _round_rotor(fit: Fit, candidate: Candidate) -> Fit:
    """Where a fit with an error of the angle begins: at none, with the smaller inductance twice."""
    smaller = min(fit.values[name] for name in _INDUCTANCES)
    values = {**candidate.values, **dict.fromkeys(_INDUCTANCES, smaller)}
    return _with_effect(fit, candidate.effect, values)


def with_log_start(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: Flags,
) -> tuple[Score, ...]:
    """Scores, those of effects that full logs show from there where no tangent is far better.

    Parameters
    ----------
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    scores
        Scores by the tangent.
    significant
        Groups [G] over their floor; without any, nothing is tried.

    Returns
    -------
    tuple of Score
        The largest fall first.

    Notes
    -----
    A transducer in a coupling reads what the motor's side passes on, and no twist is in that: to
    the windows the shaft is rigid there. A shaft that coasts carries the far part as well, so that
    its inertia contradicts that of the logs, and no linear step shows why. Of the logs as a whole
    the angle against the torque in the coupling gives the far inertia, the spring and the gap
    without a fit. A tangent promises, while this start is fitted; and it leaves a twist or a gap
    open that full logs know.

    """
    so_far = list(scores)
    by_name = first_of_each(offered)
    hooks = {c.effect.shown: c for c in by_name.values() if c.effect.shown is not None}
    for hook in hooks if significant.any() else ():
        shown = hook(full_logs(wide.fit, wide.fit.model))
        if shown is None or shown.discrimination.name not in by_name:
            continue
        candidate = by_name[shown.discrimination.name]
        effect = settled(candidate.effect, shown.discrimination)
        known = {name: value for name, (value, _) in shown.discrimination.values.items()}
        start = {f"{effect.name}.{name}": value for name, value in {**known, **shown.start}.items()}
        started = scored(wide, candidate, _with_effect(wide.fit, effect, {**shown.base, **start}))
        alike = [s for s in so_far if s.candidate.effect.shown is hook]
        best = max((s.fall for s in alike), default=0.0)
        if started.fall > started.policy.close_share * best:
            so_far = with_better([s for s in so_far if s not in alike], started, offered)
    return tuple(so_far)


def _with_effect(fit: Fit, effect: Effect, values: Values) -> Fit:
    """The fit with an effect, at such values of its parameters and of constants by full name."""
    model = fit.model.with_effects(effect)
    return replace(fit, model=model).at({**zero(effect, model), **values})
