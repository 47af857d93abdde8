"""Two effects that hold together where neither does alone.

Beside an effect that is missing, another one that the captures show may fit at a wrong size or
shape, and then predicts nothing that was held out. So where no single effect joins a fit that still
misses, two at a time are tried.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.acceptance import Baseline, is_determined, matters
from pipeline.criticism.selection.candidates import Candidate, placed
from pipeline.criticism.selection.pruning import reshaped, trimmed, with_all_terms
from pipeline.criticism.selection.score_test import Score


@dataclass(frozen=True, slots=True)
class Pair:
    """Two candidates, and what both would do for a fit, to first order.

    Attributes
    ----------
    scores
        Of each alone, the larger fall first.
    fall
        Fall of the deviance with both.
    step
        Parameters of both and changes of the model's own, by full name.

    """

    scores: tuple[Score, Score]
    fall: float
    step: Mapping[str, float]

    @property
    def names(self) -> frozenset[str]:
        """Names of both effects."""
        return frozenset(score.candidate.effect.name for score in self.scores)

    @property
    def penalty(self) -> float:
        """What the parameters of both and the search for them cost."""
        return sum(score.penalty for score in self.scores)

    @property
    def both_needed(self) -> bool:
        """Whether either is worth its penalty beside the other."""
        first, second = self.scores
        return self.fall - first.fall > second.penalty and self.fall - second.fall > first.penalty


def best_pair(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    added: Sequence[Effect],
    most_deviance: float = math.inf,
    among: Set[str] | None = None,
) -> LinearSystem | None:
    """The fit with two further effects that hold only together.

    Parameters
    ----------
    wide
        A fit that misses something, with the columns of all candidates.
    offered
        The candidates, as `wide` has them.
    scores
        Their scores, one an effect.
    added
        Effects that the search added to it.
    most_deviance
        Deviance that the fit must not exceed. A pair is not fitted where
        `policy.selection.choice_falls` times its fall to first order would not do, nor where its
        step ends farther above the fit than it promised to end below.
    among
        Effects of which a pair has one; None for any pair.

    Returns
    -------
    LinearSystem or None
        The newest effect is the one that explains less alone. None where no pair predicts captures
        that are held out to the floor, and is sure of both sizes.

    """
    policy = wide.policy.selection
    best_first: dict[frozenset[str], Pair] = {}
    pairs = pairs_of(wide, offered, scores, among)
    for pair in sorted(pairs, key=lambda pair: pair.penalty - pair.fall):
        if wide.deviance - policy.choice_falls * pair.fall <= most_deviance:
            best_first.setdefault(pair.names, pair)
    if not best_first:
        return None
    baseline = Baseline.of(wide, added)
    for pair in list(best_first.values())[: policy.refits]:
        tried = gauss_newton(_begun(wide.fit, pair), before=wide, most=wide.deviance + pair.fall)
        if wide.deviance - tried.deviance < pair.penalty:
            continue
        tried = gauss_newton(with_all_terms(tried.fit), before=tried)
        if tried.deviance > most_deviance:  # with fewer terms it is no smaller
            continue
        tried = reshaped(trimmed(tried, [e.name for e in tried.fit.model.effects]))
        if tried.deviance <= most_deviance and _holds(baseline, tried, pair):
            return linear_system(tried.fit)
    return None


def _holds(baseline: Baseline, tried: LinearSystem, pair: Pair) -> bool:
    """Whether both effects matter, are needed and sure, and predict captures that are held out to
    the floor. Of two that leave something, neither may be what it looks like.
    """
    if leave_out(tried).total ** 2 - 1.0 > tried.policy.goodness.over:
        return False
    for effect, score in zip(tried.fit.model.effects[-2:], pair.scores, strict=True):
        without = gauss_newton(tried.fit.without(effect.name), before=tried)
        if (
            without.deviance - tried.deviance < score.penalty
            or not matters(tried, without, significant_groups(without), effect)
            or not is_determined(tried, without, effect)
        ):
            return False
    return baseline.is_improved_by(tried, replace(pair.scores[1], penalty=pair.penalty))


def _begun(fit: Fit, pair: Pair) -> Fit:
    """Where a fit with both begins."""
    candidates = [score.candidate for score in pair.scores]
    model = fit.model.with_effects(*(candidate.effect for candidate in candidates))
    start: dict[str, float] = {}
    for candidate in candidates:
        start |= candidate.values
        if candidate.effect.in_place_of is not None:
            start[candidate.effect.in_place_of[0]] = 0.0
    moved = {
        name: fit.values[name] + change if name in fit.values else change
        for name, change in pair.step.items()
    }
    return replace(fit, model=model).at({**start, **moved})


def pairs_of(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    among: Set[str] | None = None,
) -> Iterator[Pair]:
    """Pairs of which both are needed, to first order.

    Parameters
    ----------
    wide
        A fit with the columns of all candidates.
    offered
        The candidates, as `wide` has them.
    scores
        Their scores, one an effect.
    among
        Effects of which a pair has one; None for any pair.

    Yields
    ------
    Pair
        One of each is worth its penalty by itself, at some of its trial shapes. Couplings are left
        out: their rows go with the noise of an angle.

    """
    equations, model, policy = wide.normal_equations(), wide.model_columns, wide.policy.selection
    alone = equations.only(model).best().deviance
    known = {score.candidate.effect.name: score for score in scores}
    usable = [
        (replace(known[c.effect.name], candidate=c), at)
        for c, at in placed(wide, offered)
        if c.effect.name in known and c.effect.discriminator is None
    ]
    for (one, at), (other, at_other) in combinations(usable, 2):
        names_of = {one.candidate.effect.name, other.candidate.effect.name}
        if len(names_of) == 1 or (among is not None and among.isdisjoint(names_of)):
            continue
        if one.fall <= one.penalty and other.fall <= other.penalty:
            continue
        live = np.concatenate([model, at, at_other])
        end = equations.only(live).best(*policy.quick)
        names = [wide.columns[n].name for n in live]
        step = dict(zip(names, end.step.tolist(), strict=True))
        first, second = sorted((one, other), key=lambda score: -score.fall)
        found = Pair((first, second), alone - end.deviance, step)
        if found.both_needed:
            yield found
