"""The refit of one candidate: where it begins, by which noise floors, and from which starts."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import (
    first_fit,
    floors_changed,
    gauss_newton,
    rough_anew,
    summed_error,
)
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.choices import other_choices
from pipeline.criticism.selection.score_test import Score


def begin_from(fit: Fit, score: Score) -> Fit:
    """Where a refit with a candidate begins: what its score predicts.

    Parameters
    ----------
    fit
        The fit without it.
    score
        The score of the candidate.

    """
    effect = score.candidate.effect
    none = dict.fromkeys(score.step, 0.0)
    start = {**fit.values, **none, **score.candidate.values}
    own = {name: value - start[name] for name, value in score.step.items()}
    moves, model = {**score.moves, **own}, fit.model.with_effects(effect)
    before = replace(fit, model=model, values=start)
    begun = before.moved_over_inertia(moves)
    if begun is None:
        begun = before.at({name: start[name] + change for name, change in moves.items()})
    return begun if effect.in_place_of is None else begun.at({effect.in_place_of[0]: 0.0})


def reweighted(wide: LinearSystem, score: Score) -> LinearSystem:
    """The fit by the noise floors that a candidate begins with, if it is a coupling.

    Parameters
    ----------
    wide
        The fit without it.
    score
        The score of the candidate.

    Notes
    -----
    A twist derived from an angle amplifies its noise, at orders of the angle by hundreds. By the
    floors of a rigid shaft this noise would count as deviance.

    """
    if score.candidate.effect.discriminator is None:
        return wide
    begun = begin_from(wide.fit, score)
    grown = floors(begun.segments, begun.model, begun.values)
    ratio = np.concatenate(grown) / np.concatenate(wide.fit.sigma)
    if np.abs(np.log(ratio)).max() < math.log(wide.policy.selection.floor_ratio):
        return wide
    return linear_system(replace(wide.fit, sigma=grown, near=begun.values))


def refitted(wide: LinearSystem, score: Score) -> LinearSystem:
    """The fit with a candidate, started from the step that its score predicts.

    If that fit is no better than the one without it, a second one begins with all other parameters
    where they are: the linear step overshoots where parameters are strongly correlated. If it falls
    far short of the score, further ones begin by the other choices inside the effect, whose
    tangents may be one: a late stamp is a lag of first order where both are small.

    Parameters
    ----------
    wide
        The fit without it.
    score
        The score of the candidate.

    """
    tried = _along_the_step(wide, score)
    if wide.deviance - tried.deviance < wide.policy.selection.close_share * score.fall:
        ends = [_along_the_step(wide, other) for other in _with_other_choices(wide, score)]
        tried = min([tried, *ends], key=lambda end: end.deviance)
    if tried.deviance + score.penalty < wide.deviance:
        return tried
    # where one scale is free, all that is begun elsewhere is far away, and may yet come back
    for moves in ({}, score.moves):
        again = gauss_newton(begin_from(wide.fit, replace(score, moves=moves)), before=wide)
        tried = min(tried, again, key=lambda end: end.deviance)
        if tried.deviance < wide.deviance + score.fall:
            break
    return tried


def _along_the_step(wide: LinearSystem, score: Score) -> LinearSystem:
    """The fit begun from the step that a score predicts; from a part of it where the whole makes
    the captures worse by more than it promised, since the tangent does not reach that far.
    """
    most = wide.deviance + score.fall
    for share in wide.policy.selection.shorter_steps:
        moves = {name: share * move for name, move in score.moves.items()}
        step = {
            name: share * value + (1.0 - share) * score.candidate.values.get(name, 0.0)
            for name, value in score.step.items()
        }
        begun = begin_from(wide.fit, replace(score, moves=moves, step=step))
        tried = gauss_newton(begun, before=wide, most=most)
        if tried.deviance < most:
            break
    return tried


def _with_other_choices(wide: LinearSystem, score: Score) -> Iterator[Score]:
    """The score of a candidate by every other choice inside its effect."""
    candidate = score.candidate
    if candidate.effect.discriminator is None:
        begun = begin_from(wide.fit, score)
        for other in other_choices(candidate.effect, begun):
            yield replace(score, candidate=replace(candidate, values={**candidate.values, **other}))


def floored_anew(fit: Fit, before: LinearSystem | None = None) -> Fit:
    """The fit by noise floors made anew, now that another effect is in.

    Parameters
    ----------
    fit
        The fit by the former floors.
    before
        A system around it, whose columns may serve.

    Notes
    -----
    The tolerance for its form is new, so it is refitted in any case: the next effect is judged
    against this deviance. If some floor changes by half, or something is left over them, and a
    rough fit finds another inertia, a fit is begun there as well, and the one that misses less
    stays, every equation counted once. Their floors differ, so their deviances do not compare.
    Undoing a sensor's lag adds noise, so does a twist derived from an angle, and so do the edges of
    a dead time. An encoder off its centre drives J to next to nothing, an unbalance to six times
    what it is, and the floors were made with that J.

    """
    changed = floors_changed(fit)
    if changed:
        floor = floors(fit.segments, fit.model, fit.values)
        fit = replace(fit, sigma=floor, near=fit.values)
    anew = gauss_newton(fit, before=before)
    if not changed and not significant_groups(anew).any():
        return anew.fit
    rough = rough_anew(fit)
    if not _other_inertia(rough, fit):
        return anew.fit
    return min(anew, first_fit(rough), key=summed_error).fit


def _other_inertia(rough: Fit, fit: Fit) -> bool:
    """Whether a rough fit finds an inertia far from that of a fit."""
    lighter, heavier = sorted(one.values["j_kgm2"] for one in (rough, fit))
    return heavier >= fit.policy.selection.inertia_ratio * lighter
