"""Which effects the captures ask for: forward steps with refits, backward checks."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence, Set
from dataclasses import dataclass, replace

from pipeline.criticism.effect import Effect
from pipeline.criticism.regression.fit import Fit, tolerances
from pipeline.criticism.regression.gauss_newton import (
    gauss_newton,
)
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.best_candidate import best_candidate
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.choices import reconsidered
from pipeline.criticism.selection.discrimination import renamed
from pipeline.criticism.selection.far_starts import with_far_starts
from pipeline.criticism.selection.free_shares import with_changing_friction, with_free_shares
from pipeline.criticism.selection.improvement import deviance_with_full_logs
from pipeline.criticism.selection.other_readings import by_best_readings, with_usual_readings
from pipeline.criticism.selection.pairs import best_pair
from pipeline.criticism.selection.pruning import reshaped, unsure_effect, without_superfluous
from pipeline.criticism.selection.refit import begin_from, floored_anew
from pipeline.criticism.selection.score_test import Score, score_all
from pipeline.criticism.selection.sizes import is_rare
from pipeline.criticism.selection.starts import (
    with_linear_start,
    with_log_start,
    with_nuisances,
    with_round_rotor_start,
)


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
    it looks as friction that changes with speed, which is commoner. Choices inside effects are made
    again then: they may have been right by the former reading alone. One that explains as much by
    itself is taken instead. With an effect in, a reading goes back to what is usual where that
    explains as much.

    An effect of the last step whose size may be zero, now that all others are in, goes with every
    step that has it, unless it takes most of an error; the search goes on without it.

    """
    base = len(fit.model.effects)
    steps = _steps_from(fit, base, library)
    unsure: frozenset[str] = frozenset()
    while (found := unsure_effect(steps[-1].system, base)) is not None:
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
        chosen = best_candidate(wide, scores, base, unsure)
        lower = _lower_without(chosen, wide)
        instead = lower or _instead_of_effect(chosen, wide, library, base, unsure)
        if instead is not None:
            fit = reconsidered(instead).fit
            del steps[-1]
            continue
        chosen = chosen or _with_pair(steps, library, base, unsure)
        if chosen is None:
            break
        chosen = renamed(chosen, chosen.fit.model.effects[-1].name, library)
        if chosen.fit.model.effects[-1].name in unsure:
            break
        chosen = with_usual_readings(reconsidered(without_superfluous(chosen, base)))
        fit = _refloored(reshaped(chosen), base)
        if tuple(e.name for e in fit.model.effects[base:]) in {r.added for r in steps}:
            break
    return steps


def _lower_without(chosen: LinearSystem | None, wide: LinearSystem) -> LinearSystem | None:
    """The fit without the `chosen` effect, begun from all else of the fit with it, where it is
    better than the one that the effect joined; None where it is not.

    The former was then at a minimum of its own, and the effect is credited with a way out of it.
    """
    if chosen is None:
        return None
    ends = chosen.fit.values
    begun = wide.fit.at({name: ends[name] for name in wide.fit.values if name in ends})
    again = gauss_newton(begun, before=wide)
    return again if again.deviance < wide.deviance - wide.policy.selection.tie else None


def _instead_of_effect(
    chosen: LinearSystem | None,
    wide: LinearSystem,
    library: Mapping[str, Effect],
    base: int,
    unsure: Set[str],
) -> LinearSystem | None:
    """The fit with what is no effect and is taken instead of the `chosen` one (`search`); None
    where there is nothing of that kind.
    """
    tie = wide.policy.selection.tie
    least = math.inf if chosen is None else deviance_with_full_logs(chosen)
    reread, rechosen = by_best_readings(wide), reconsidered(wide, at_floor=True)
    freed = with_free_shares(wide, least + tie)
    unnamed = [freed, *(end for end in (reread, rechosen) if end is not wide)]
    instead = min(filter(None, unnamed), key=lambda end: end.deviance, default=None)
    changing = with_changing_friction(wide, least - tie)
    if instead is not None and instead.deviance >= least + tie:
        instead = None
    if changing is not None and changing.deviance < least - tie:
        better = instead is None or changing.deviance < instead.deviance - tie
        instead = changing if better else instead
    if instead is None:
        is_reading = _is_reading(chosen, wide, reread, library, base, unsure)
        return reread if is_reading else None
    return instead if rechosen is wide or rechosen.deviance > instead.deviance + tie else rechosen


def _with_pair(
    steps: list[LadderStep], library: Mapping[str, Effect], base: int, unsure: Set[str]
) -> LinearSystem | None:
    """The fit with two effects that hold together where none joins the last step alone; the `steps`
    get one with the first of them.

    They may be two behind an earlier step, if that explains more than the last one: beside an
    effect that took a part of another one's, neither shows. Where the last step is at its floors,
    one of the two has to be an effect that would have done nearly as much as the one that was
    taken there, and both have to pay for their parameters.
    """
    last = steps[-1].system
    over = bool(significant_groups(last).any())
    for place in range(len(steps) - 1 if over else len(steps) - 2, -1, -1):
        step = steps[place]
        among = None if over else _nearly_as_good(steps, place)
        if among is not None and not among:
            continue
        model, policy = step.fit.model, step.fit.policy.selection
        scores = [s for s in step.scores if s.candidate.effect.name not in unsure]
        most = last.deviance - policy.tie if place < len(steps) - 1 else math.inf
        offered, added = candidates(library, model), model.effects[base:]
        both = best_pair(step.system, offered, scores, added, most, among)
        if both is None or place + 2 >= policy.most_steps:
            continue
        if not over and _cost(both) > _cost(last) - policy.tie:
            continue
        first, second = (effect.name for effect in both.fit.model.effects[-2:])
        without = {
            name: gauss_newton(both.fit.without(name), before=both) for name in (first, second)
        }
        for alone in without.values():
            # a choice that was made before both stands for one of them
            rechosen = reconsidered(alone, at_floor=True)
            if rechosen.deviance < both.deviance + policy.tie:
                return rechosen
        begun = _refloored(without[second], base)
        steps[place + 1 :] = [
            LadderStep((*step.added, first), *scored(begun, library, step.system))
        ]
        return both
    return None


def _nearly_as_good(steps: Sequence[LadderStep], place: int) -> frozenset[str]:
    """Effects that would have done most of what the one did that was taken at a step, to first
    order, but were not.
    """
    before, after = steps[place].system, steps[place + 1].system
    least = before.policy.selection.close_share * (before.deviance - after.deviance)
    return frozenset(
        score.candidate.effect.name
        for score in steps[place].scores
        if score.fall >= least and score.candidate.effect.name not in steps[place + 1].added
    )


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
    scores = with_far_starts(wide, offered, scores, significant)
    scores = with_linear_start(wide, offered, scores, significant)
    scores = with_round_rotor_start(wide, offered, scores, significant)
    return wide, with_log_start(wide, offered, scores, significant)


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
    both = gauss_newton(replace(chosen.fit, segments=reread.segments), before=chosen)
    beside, alone = chosen.deviance - both.deviance, wide.deviance - reread.deviance
    if beside >= wide.policy.selection.unexplained_share * alone:
        return False
    rest, scores = scored(reread.fit, library, wide)
    limit, tie = _cost(chosen), wide.policy.selection.tie
    other = best_candidate(rest, scores, base, unsure)
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
    return deviance_with_full_logs(system) + math.log(system.size) * system.model_columns.size


def _refloored(system: LinearSystem, base: int) -> Fit:
    """The fit of a system by tolerances and noise floors of the effects beyond its first `base`."""
    fit, effects = system.fit, system.fit.model.effects[base:]
    fit = replace(fit, tolerance=tolerances(fit, effects))
    return floored_anew(fit, system) if effects else fit
