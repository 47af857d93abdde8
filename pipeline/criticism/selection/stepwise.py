"""Which effects the captures ask for: forward steps with refits, backward checks."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Effect
from pipeline.criticism.regression.fit import Fit, floors, tolerances
from pipeline.criticism.regression.gauss_newton import (
    first_fit,
    floors_changed,
    gauss_newton,
    rough_anew,
)
from pipeline.criticism.regression.goodness import leave_out, significant_groups
from pipeline.criticism.regression.left_out import loss_at
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.regression.normal_equations import NormalEquations
from pipeline.criticism.selection.acceptance import (
    Baseline,
    acts_in,
    is_determined,
    matters,
    sure_amplitudes,
)
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.changed_between import with_free_shares
from pipeline.criticism.selection.changed_over_time import with_changing_friction
from pipeline.criticism.selection.choices import other_choices, reconsidered
from pipeline.criticism.selection.discrimination import renamed
from pipeline.criticism.selection.far_starts import with_starts
from pipeline.criticism.selection.improvement import clears
from pipeline.criticism.selection.linear_start import with_linear_start
from pipeline.criticism.selection.log_start import with_log_start
from pipeline.criticism.selection.other_readings import by_best_readings
from pipeline.criticism.selection.pairs import best_pair
from pipeline.criticism.selection.pruning import reshaped, trimmed, with_all_terms
from pipeline.criticism.selection.round_rotor_start import with_round_rotor_start
from pipeline.criticism.selection.score_test import Score, score_all
from pipeline.criticism.selection.sizes import is_rare, material
from pipeline.criticism.selection.unusual_nuisances import with_nuisances


@dataclass(frozen=True, slots=True)
class LadderStep:
    """One step of the search.

    Attributes
    ----------
    added
        Effects that were added so far.
    system
        The fit with them, and the columns of all candidates.
    scores
        Every candidate's score on it.

    """

    added: tuple[str, ...]
    system: LinearSystem
    scores: tuple[Score, ...]

    @property
    def fit(self) -> Fit:
        """The fit that the system is around."""
        return self.system.fit


def search(fit: Fit, library: Mapping[str, Effect]) -> tuple[LadderStep, ...]:
    """Adds the best effect, refits and checks backwards, until nothing passes.

    Parameters
    ----------
    fit
        The fit of the requested model.
    library
        Effects that may be added.

    Returns
    -------
    tuple of LadderStep
        The first without any addition; `policy.selection.most_steps` at most.

    Notes
    -----
    Where none passes and something is left, two that hold together may join (`pairs`).

    Shares of friction or magnet left free, or another reading of a column, that explain as much as
    the best effect, within a `tie`, are taken instead; what full logs show of that effect counts
    for it. Friction that changes with time is taken where it explains more by a `tie`: in one coast
    it looks as friction that changes with speed, which is commoner.

    An effect of the last step whose size may be zero, now that all others are in, goes with every
    step that has it, unless it takes most of an error; the search goes on without it.

    """
    base = len(fit.model.effects)
    steps = _steps_from(fit, base, library)
    unsure: frozenset[str] = frozenset()
    while (found := _unsure(steps[-1].system, base)) is not None:
        name, without = found
        unsure |= {name}
        kept = [step for step in steps if name not in step.added]
        fit = _refloored(without, base)
        if tuple(e.name for e in fit.model.effects[base:]) == kept[-1].added:
            fit = kept.pop().fit
        steps = _steps_from(fit, base, library, kept, unsure)
    return tuple(steps)


def _steps_from(
    fit: Fit,
    base: int,
    library: Mapping[str, Effect],
    before: Sequence[LadderStep] = (),
    unsure: Set[str] = frozenset(),
) -> list[LadderStep]:
    """The steps `before`, one of a fit, and those that follow from it without effects that are
    `unsure`; `base` effects of the model were not added.
    """
    steps, policy = list(before), fit.policy.selection
    for _ in range(policy.most_steps):
        wide, scores = scored(fit, library, steps[-1].system if steps else None)
        added = tuple(e.name for e in fit.model.effects[base:])
        steps.append(LadderStep(added, wide, scores))
        if len(steps) == policy.most_steps:
            break
        chosen = _best(wide, scores, base, unsure)
        reread = by_best_readings(wide)
        unnamed = [with_free_shares(wide), None if reread is wide else reread]
        alternative = min(filter(None, unnamed), key=lambda end: end.deviance, default=None)
        changing = with_changing_friction(wide)
        least = math.inf if chosen is None else _with_full_logs(chosen)
        if alternative is not None and alternative.deviance >= least + policy.tie:
            alternative = None
        if changing is not None and changing.deviance < least - policy.tie:
            better = alternative is None or changing.deviance < alternative.deviance - policy.tie
            alternative = changing if better else alternative
        if alternative is None and _is_reading(chosen, wide, reread, library, base, unsure):
            alternative = reread
        if alternative is not None:
            fit = alternative.fit
            del steps[-1]
            continue
        chosen = chosen or _with_pair(steps, library, base, unsure)
        if chosen is None:
            break
        chosen = renamed(chosen, chosen.fit.model.effects[-1].name, library)
        if chosen.fit.model.effects[-1].name in unsure:
            break
        fit = _refloored(reshaped(reconsidered(_backward(chosen, base))), base)
        if tuple(e.name for e in fit.model.effects[base:]) in {r.added for r in steps}:
            break
    return steps


def _with_pair(
    steps: list[LadderStep], library: Mapping[str, Effect], base: int, unsure: Set[str]
) -> LinearSystem | None:
    """The fit with two effects that hold together where none joins the last step alone, and that
    step is over its floors; the `steps` get one with the first of them.

    They may be two behind an earlier step, if that explains more than the last one: beside an
    effect that took a part of another one's, neither shows.
    """
    last = steps[-1].system
    if not significant_groups(last).any():
        return None
    for place in range(len(steps) - 1, -1, -1):
        step = steps[place]
        model, policy = step.fit.model, step.fit.policy.selection
        scores = [s for s in step.scores if s.candidate.effect.name not in unsure]
        most = last.deviance - policy.tie if place < len(steps) - 1 else math.inf
        offered, added = candidates(library, model), model.effects[base:]
        both = best_pair(step.system, offered, scores, added, most)
        if both is None or place + 2 >= policy.most_steps:
            continue
        first, second = (effect.name for effect in both.fit.model.effects[-2:])
        alone = _refloored(gauss_newton(both.fit.without(second), before=both), base)
        steps[place + 1 :] = [
            LadderStep((*step.added, first), *scored(alone, library, step.system))
        ]
        return both
    return None


def scored(
    fit: Fit, library: Mapping[str, Effect], before: LinearSystem | None
) -> tuple[LinearSystem, tuple[Score, ...]]:
    """A fit with the columns of all candidates, and every candidate's score on it.

    Parameters
    ----------
    fit
        The fit.
    library
        Effects that may be added.
    before
        A system around a near fit, whose columns may serve.

    """
    offered = candidates(library, fit.model)
    wide = widened(fit, offered, before)
    significant = significant_groups(wide)
    scores = score_all(wide, offered, significant)
    scores = with_nuisances(wide, offered, scores)
    scores = with_starts(wide, offered, scores, significant)
    scores = with_linear_start(wide, offered, scores, significant)
    scores = with_round_rotor_start(wide, offered, scores, significant)
    return wide, with_log_start(wide, offered, scores, significant)


def _best(
    wide: LinearSystem, scores: Sequence[Score], base: int, unsure: Set[str]
) -> LinearSystem | None:
    """The fit with the candidate that is best by its score, its penalty paid, and may join; None
    without one.
    """
    effects, couplings = wide.fit.model.effects, bool(significant_groups(wide).any())
    inside = {e.discriminator for e in effects} - {None}
    passing = [s for s in scores if s.passes and _may_join(s, inside, couplings)]
    passing.sort(key=lambda s: s.penalty - s.fall)
    return _chosen(wide, passing, effects[base:], unsure)


def _is_reading(
    chosen: LinearSystem | None,
    wide: LinearSystem,
    reread: LinearSystem,
    library: Mapping[str, Effect],
    base: int,
    unsure: Set[str],
) -> bool:
    """Whether an effect is `chosen` for what another reading of a column is, as far as captures
    tell; a reading costs no parameter, and leaves an effect less to explain.

    The effect takes most of what the reading takes. And by that reading one effect explains as
    much, or one that captures do not show well enough to name it, or none. Of two that tie, a rare
    one is not taken instead.
    """
    if chosen is None or reread is wide:
        return False
    both = gauss_newton(replace(chosen.fit, segments=reread.segments))
    beside, alone = chosen.deviance - both.deviance, wide.deviance - reread.deviance
    if beside >= wide.policy.selection.unexplained_share * alone:
        return False
    rest, scores = scored(reread.fit, library, wide)
    limit, tie = _cost(chosen), wide.policy.selection.tie
    other = _best(rest, scores, base, unsure)
    if other is None:
        least = rest.deviance + math.log(rest.size) * rest.model_columns.size
        small = (s.penalty - s.fall for s in scores if _may_be_there(rest, s))
        return least + min(0.0, *small) < limit + tie
    rare, was_rare = (is_rare(s.fit.model.effects[-1], s.fit) for s in (other, chosen))
    return _cost(other) < limit + (-tie if rare and not was_rare else tie)


def _may_be_there(wide: LinearSystem, score: Score) -> bool:
    """Whether an effect that is not named may well be there: it is too small, or is not rare."""
    effect = score.candidate.effect
    usual = not is_rare(effect, begin_from(wide.fit, score))
    return effect.discriminator is None and (usual or not score.matters)


def _cost(system: LinearSystem) -> float:
    """The deviance of a fit with the penalty of its parameters."""
    return _with_full_logs(system) + math.log(system.size) * system.model_columns.size


def _refloored(system: LinearSystem, base: int) -> Fit:
    """The fit of a system by tolerances and noise floors of the effects beyond its first `base`."""
    fit, effects = system.fit, system.fit.model.effects[base:]
    fit = replace(fit, tolerance=tolerances(fit, effects))
    return floored_anew(fit, system) if effects else fit


def _with_full_logs(system: LinearSystem) -> float:
    """The deviance of a fit, less what full logs say of its newest effect, which is in no row: the
    square of a twist or gap over its uncertainty.
    """
    effect = system.fit.model.effects[-1]
    shapes = [p for p in effect.parameters_of(system.fit.machine) if p.u > 0.0 and not p.amplitude]
    significance = [(system.fit.size(effect, p) / p.u) ** 2 for p in shapes]
    return system.deviance - max(significance, default=0.0)


def _may_join(score: Score, inside: Set[object], couplings: bool) -> bool:
    """Whether an effect may join those `inside`, of whose discriminators there is one each.

    Couplings need a remainder that is reported: noise of an angle's sensor runs through a drive's
    speed loop into the current, and so looks like a soft shaft in every capture.
    """
    effect = score.candidate.effect
    return effect.discriminator is None or (couplings and effect.discriminator not in inside)


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
    rough fit finds another inertia, a fit is begun there as well and the better one stays. Undoing
    a sensor's lag adds noise, so does a twist derived from an angle, and so do the edges of a dead
    time. An encoder off its centre drives J to next to nothing, an unbalance to six times what it
    is, and the floors were made with that J.

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
    return min(anew, first_fit(rough), key=lambda end: end.deviance).fit


def _chosen(
    wide: LinearSystem,
    passing: Sequence[Score],
    added: Sequence[Effect],
    unsure: Set[str],
) -> LinearSystem | None:
    """The fit with the best candidate of the first few; of the next few, if none of these keeps its
    predicted fall and differs significantly from zero; an effect that is `unsure` does not.

    That fit is finished with columns of its own, and without terms that are not worth their
    penalty. Where one that explains more by over a `tie` is not sure of its size, no other that
    acts there is named in its place.
    """
    policy = wide.policy.selection
    doubtful: list[tuple[float, NDArray[np.bool_]]] = []
    for first in range(0, min(len(passing), policy.refit_rounds * policy.refits), policy.refits):
        batch = list(passing[first : first + policy.refits])
        while (best := _refit_best(wide, batch, added)) is not None:
            named = [effect.name for effect in best.fit.model.effects]
            finished = gauss_newton(with_all_terms(best.fit), before=best)
            finished = reshaped(trimmed(finished, named))
            cost = finished.deviance + math.log(wide.size) * finished.model_columns.size
            acts = acts_in(finished)
            if any(cost > least + policy.tie and np.any(acts & where) for least, where in doubtful):
                return None
            at_end = linear_system(finished.fit)
            if named[-1] not in unsure and is_determined(at_end, wide):
                return at_end
            doubtful.append((cost, acts))
            batch = [s for s in batch if s.candidate.effect.name != named[-1]]
    return None


def _refit_best(
    wide: LinearSystem, passing: Sequence[Score], added: Sequence[Effect]
) -> LinearSystem | None:
    """Refits candidates that are close to the best fall of deviance; the best one that passes.

    Each must pass all of:

    1. it matters at its refitted size, and as a friction drives the shaft in neither sense;
    2. the deviance falls by more than its penalty;
    3. predicted from all other captures, it falls by `held_out_penalties`, even if the forms of
       effects `added` with the same hook are a little wrong (`form_error`);
    4. evidence below the floor does so even if any form found is wrong, and beside an effect of the
       same hook by `same_hook_penalties`, since what a form leaves there is of that size;
    5. so predicted, what it mends is more than what it spoils where it acts.
    """
    policy = wide.policy.selection
    usual = Baseline.of(wide, added)
    tests = {segment.test for segment in wide.segments}
    most = max((s.fall for s in passing), default=0.0)
    close = [s for s in passing if s.fall >= policy.close_share * most]
    best: LinearSystem | None = None
    least = 0.0
    for score in close:
        effect = score.candidate.effect
        begun = reweighted(wide, score)
        tried = refitted(begun, score)
        baseline = usual if begun is wide else Baseline.of(gauss_newton(begun.fit, begun), added)
        base = baseline.wide
        # of two that tie, the one that benches have and that some capture here was made to show
        far = is_rare(effect, tried.fit) or set(effect.tests).isdisjoint(tests)
        unsought = policy.tie if far else 0.0
        cost = tried.deviance - base.deviance + score.penalty + unsought
        if (
            matters(tried, base, baseline.significant)
            and cost < least
            and baseline.is_improved_by(tried, score)
        ):
            best, least = tried, cost
    return best


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
    tried = gauss_newton(begin_from(wide.fit, score), before=wide)
    if wide.deviance - tried.deviance < wide.policy.selection.close_share * score.fall:
        starts = (begin_from(wide.fit, other) for other in _with_other_choices(wide, score))
        ends = [gauss_newton(start, before=wide) for start in starts]
        tried = min([tried, *ends], key=lambda end: end.deviance)
    if tried.deviance + score.penalty < wide.deviance:
        return tried
    again = gauss_newton(begin_from(wide.fit, replace(score, moves={})), before=wide)
    return min(tried, again, key=lambda end: end.deviance)


def _with_other_choices(wide: LinearSystem, score: Score) -> Iterator[Score]:
    """The score of a candidate by every other choice inside its effect."""
    candidate = score.candidate
    if candidate.effect.discriminator is None:
        begun = begin_from(wide.fit, score)
        for other in other_choices(candidate.effect, begun):
            yield replace(score, candidate=replace(candidate, values={**candidate.values, **other}))


def _other_inertia(rough: Fit, fit: Fit) -> bool:
    """Whether a rough fit finds an inertia far from that of a fit."""
    lighter, heavier = sorted(one.values["j_kgm2"] for one in (rough, fit))
    return heavier >= fit.policy.selection.inertia_ratio * lighter


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


def _unsure(wide: LinearSystem, base: int) -> tuple[str, LinearSystem] | None:
    """An effect that was added to the first `base` and whose size may be zero, fitted with all
    others, and the fit without it; of several the one that explains least.

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


def _backward(system: LinearSystem, base: int) -> LinearSystem:
    """Takes out effects that later ones have made superfluous."""
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
    instead: NDArray[np.int64] | None = None,
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
    machine = fit.machine
    amplitude = {
        f"{e.name}.{p.name}": p.amplitude
        for e in fit.model.effects
        for p in e.parameters_of(machine)
    }
    names_out = [system.columns[n].name for n in left_out]
    move = np.array([-fit.values[n] if amplitude[n] else 0.0 for n in names_out])
    equations = system.normal_equations() if normal_equations is None else normal_equations
    places = () if instead is None else instead
    return loss_at(system, equations, left_out, move, places, *fit.policy.selection.thorough)
