"""Amplitudes that are tried far from zero: a delay of many samples is no tangent's matter.

The deviance at a trial delay, all else refitted to first order, is a cross-correlation of what is
recorded with what the model predicts, over all signals, captures and orders at once, each by its
noise. Reference: Knapp & Carter, IEEE Trans. ASSP 24 (1976), the maximum-likelihood delay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Flags, Values
from pipeline.criticism.parameter import Machine, Parameter
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.linearise import trial_residuals
from pipeline.criticism.regression.normal_equations import Descent
from pipeline.criticism.regression.parallel import on_each
from pipeline.criticism.residuals.observability import observes
from pipeline.criticism.selection.candidates import Candidate, searched
from pipeline.criticism.selection.improvement import FitQuality, clears, fall_below_floor, share_of
from pipeline.criticism.selection.score_test import Score, paid_for, ranked


@dataclass(frozen=True, slots=True)
class _Trial:
    """A candidate, one of its amplitudes at a `start` in multiples of the parameter's scale."""

    candidate: Candidate
    parameter: Parameter
    start: float

    @property
    def name(self) -> str:
        """Full name of the amplitude."""
        return f"{self.candidate.effect.name}.{self.parameter.name}"

    def values(self, machine: Machine) -> dict[str, float]:
        """The effect's parameters, in their units."""
        return {**self.candidate.values, self.name: self.start * machine.scale(self.parameter)}


@dataclass(frozen=True, slots=True)
class _End:
    """A trial, the system with its residual there, and how well all else is refitted to it."""

    trial: _Trial
    system: LinearSystem
    descent: Descent


def with_far_starts(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: Flags,
) -> tuple[Score, ...]:
    """Scores, those of effects with `starts` from the best of them where that beats the tangent.

    Parameters
    ----------
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    scores
        Scores by the tangent.
    significant
        Groups [G] over their floor; without any, nothing is tried, since a delay of many samples
        shows.

    Returns
    -------
    tuple of Score
        The largest fall first.

    """
    if not significant.any():
        return tuple(scores)
    best = {score.candidate.effect.name: score for score in scores}
    thorough = wide.policy.selection.thorough
    base = wide.only(wide.model_columns)
    before = FitQuality.of(
        base, np.arange(len(base.columns)), base.normal_equations().best(*thorough)
    )
    for end in _best_ends(base, offered, before.deviance):
        effect, score = end.trial.candidate.effect, _score(base, end, before, significant)
        known = best.get(effect.name)
        if known is None or score.fall > known.fall:
            penalty = score.penalty + searched(offered, effect)
            best[effect.name] = replace(score, penalty=penalty)
    return ranked(best.values())


def _best_ends(base: LinearSystem, offered: Sequence[Candidate], without: float) -> list[_End]:
    """The best trial of every parameter with starts: of these, then of finer ones beside it. None
    where no start has less than the deviance `without` the effect.
    """
    machine, finer = base.fit.machine, base.policy.selection.finer_starts
    tried = [
        (c, p)
        for c in offered
        if any(observes(segment, c.effect) for segment in base.segments)
        for p in c.effect.parameters_of(machine)
        if p.starts
    ]
    starts = [[_Trial(*one, start) for start in one[1].starts] for one in tried]
    nearest = [
        end
        for end in map(_best_end, _refitted_ends(base, starts))
        if end.descent.deviance < without
    ]
    beside = _refitted_ends(
        base,
        [[replace(e.trial, start=factor * e.trial.start) for factor in finer] for e in nearest],
    )
    return [
        _best_end([first, *finer_ends]) for first, finer_ends in zip(nearest, beside, strict=True)
    ]


def _best_end(ends: Sequence[_End]) -> _End:
    return min(ends, key=lambda end: (end.descent.deviance, end.trial.start))


def _refitted_ends(base: LinearSystem, trials: Sequence[Sequence[_Trial]]) -> list[list[_End]]:
    """Where all else, refitted to first order, leaves every trial.

    The columns stay those of where no candidate is, and so does what rows are divided by.
    """
    fit = base.fit
    flat = [trial for group in trials for trial in group]
    effects_at = tuple((t.candidate.effect, t.values(fit.machine)) for t in flat)
    weights = [base.row_weight[base.segment == n] for n in range(len(base.segments))]
    arguments = [(fit.model, fit.values, effects_at, weight) for weight in weights]
    parts = on_each(_trial_residuals, base.segments, arguments)
    residuals = np.tile(base.residual, (len(flat), 1))
    for number, part in enumerate(parts):
        rows = np.flatnonzero(base.segment == number)
        for place, residual in part.items():
            residuals[place, rows] = residual
    thorough = base.policy.selection.thorough
    ends = iter(
        [
            _End(trial, replace(base, residual=residual), known.best(*thorough))
            for trial, residual, known in zip(
                flat, residuals, base.normal_equations_of(residuals), strict=True
            )
        ]
    )
    return [[next(ends) for _ in group] for group in trials]


def _score(base: LinearSystem, end: _End, before: FitQuality, significant: Flags) -> Score:
    """The score of a trial, without what the search over candidates costs."""
    trial, machine, policy = end.trial, base.fit.machine, base.policy.selection
    effect, parameter = trial.candidate.effect, trial.parameter
    after = FitQuality.of(end.system, np.arange(len(base.columns)), end.descent)
    score = Score(
        trial.candidate,
        before.deviance - after.deviance,
        0.0,
        {trial.name: trial.start * machine.scale(parameter)},
        dict(zip((c.name for c in base.columns), end.descent.step.tolist(), strict=True)),
        share_of(base, effect, before, after),
        abs(trial.start) / parameter.negligible,
        fall_below_floor(base, before.reduced_chi2, after.reduced_chi2),
        clears(base, significant, before.reduced_chi2, after.reduced_chi2),
        policy=policy,
    )
    dof = paid_for(effect, machine, score)
    search = 2.0 * math.log(len(parameter.starts) + len(policy.finer_starts))
    return replace(score, penalty=dof * math.log(base.size) + search)


def _trial_residuals(
    segment: Segment,
    model: Model,
    values: Values,
    trials: Sequence[tuple[Effect, Values]],
    row_weight: Array,
) -> dict[int, Array]:
    """Residuals [R] of the trials that a segment observes, by their places."""
    observed = [n for n, (effect, _) in enumerate(trials) if observes(segment, effect)]
    if not observed:
        return {}
    residuals = trial_residuals(segment, model, values, [trials[n] for n in observed], row_weight)
    return dict(zip(observed, residuals, strict=True))
