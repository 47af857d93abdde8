"""The best of the candidates that pass: a few are refitted, and must hold as fits."""

from __future__ import annotations

import math
from collections.abc import Sequence, Set

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.operating import Flags
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.acceptance import Baseline, acts_in, is_determined, matters
from pipeline.criticism.selection.improvement import deviance_with_full_logs
from pipeline.criticism.selection.pruning import reshaped, trimmed, with_all_terms
from pipeline.criticism.selection.refit import refitted, reweighted
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.sizes import is_rare


def best_candidate(
    wide: LinearSystem, scores: Sequence[Score], base: int, unsure: Set[str]
) -> LinearSystem | None:
    """The fit with the candidate that is best by its score, its penalty paid, and may join.

    Parameters
    ----------
    wide
        The fit without it, with the columns of all candidates.
    scores
        Every candidate's score on it.
    base
        Number of effects of the model that were not added.
    unsure
        Effects whose size may be zero beside all others; none of them is taken.

    Returns
    -------
    LinearSystem or None
        None where no candidate holds.

    """
    effects, couplings = wide.fit.model.effects, bool(significant_groups(wide).any())
    inside = {e.discriminator for e in effects} - {None}
    joining = [s for s in scores if _may_join(s, inside, couplings)]
    joining.sort(key=lambda s: s.penalty - s.fall)
    passing, hidden = [s for s in joining if s.passes], [s for s in joining if s.may_be_hidden]
    added = effects[base:]
    return _chosen(wide, passing, added, unsure) or _chosen(wide, hidden, added, unsure)


def _may_join(score: Score, inside: Set[object], couplings: bool) -> bool:
    """Whether an effect may join those `inside`, of whose discriminators there is one each.

    Couplings need a remainder that is reported: noise of an angle's sensor runs through a drive's
    speed loop into the current, and so looks like a soft shaft in every capture.
    """
    effect = score.candidate.effect
    return effect.discriminator is None or (couplings and effect.discriminator not in inside)


def _chosen(
    wide: LinearSystem,
    passing: Sequence[Score],
    added: Sequence[Effect],
    unsure: Set[str],
) -> LinearSystem | None:
    """The fit with the best candidate of the first few; of the next few, if none of these passes
    as a refit and differs significantly from zero; an effect that is `unsure` does not.

    That fit is finished with columns of its own, and without terms that are not worth their
    penalty. Where one that explains more by over a `tie` is not sure of its size, no other that
    acts there is named in its place.
    """
    policy = wide.policy.selection
    doubtful: list[tuple[float, Flags]] = []
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
    """Refits candidates that may be the best one by a refit, which may fall by 1/`close_share` of a
    score, their penalty paid; the best one that passes. Where none does, the best of the others
    may, if something is over its floor or they act where none of the former does.
    """
    usual, left = Baseline.of(wide, added), list(passing)
    best: LinearSystem | None = None
    failed = np.zeros(len(wide.labels), dtype=bool)
    while left and best is None:
        most = max(s.fall - s.penalty for s in left)
        share = wide.policy.selection.close_share
        close = [s for s in left if s.fall / share - s.penalty >= most]
        best = _best_that_passes(usual, close)
        for score in close:
            failed |= acts_in(wide, score.candidate.columns)
        left = [
            s
            for s in left
            if s not in close
            and (usual.significant.any() or not np.any(failed & acts_in(wide, s.candidate.columns)))
        ]
    return best


def _best_that_passes(usual: Baseline, close: Sequence[Score]) -> LinearSystem | None:
    """The best refit of those that pass.

    Each must pass all of:

    1. it matters at its refitted size, and as a friction drives the shaft in neither sense;
    2. the deviance falls by more than its penalty;
    3. predicted from all other captures, it falls by `held_out_penalties`, even if the forms of
       effects added before with the same hook are a little wrong (`form_error`);
    4. evidence below the floor does so even if any form found is wrong, and beside an effect of the
       same hook by `same_hook_penalties`, since what a form leaves there is of that size;
    5. so predicted, what it mends is more than what it spoils where it acts.

    The best is that of the least deviance, its penalty paid; what full logs show of a coupling
    counts for it.
    """
    wide, added = usual.wide, usual.added
    tests = {segment.test for segment in wide.segments}
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
        unsought = wide.policy.selection.tie if far else 0.0
        unpaid = score.penalty + unsought - base.deviance
        cost = deviance_with_full_logs(tried) + unpaid
        if (
            matters(tried, base, baseline.significant)
            and tried.deviance + unpaid < 0.0
            and cost < least
            and baseline.is_improved_by(tried, score)
        ):
            best, least = tried, cost
    return best
