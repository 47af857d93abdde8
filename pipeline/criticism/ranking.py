"""Steps of the ladder as records, and the evidence for each effect.

Found effects have it with their alternatives, the others by their score.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from scipy.special import gammaincc

from pipeline.criticism.design.experiments import separations
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.headline import headline
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import signal_errors
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.reported import reported_parameters
from pipeline.criticism.search import Ladder
from pipeline.criticism.selection.alternatives import alternatives_to, experiment_for, remedies
from pipeline.criticism.selection.candidates import Candidate
from pipeline.criticism.selection.pruning import loss_without
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.stepwise import LadderStep
from pipeline.criticism.validation.error_maps import (
    angle_maps,
    histograms,
    speed_current_map,
    window_errors,
)
from pipeline.physics.glossary import unit_of
from pipeline.records.diagnosis import RankedEffect, ReportedParameter, StepError, StepRecord

_AGAINST = "captures contradict it, or show that it is part of a curve: see the note"
_UNSUPPORTED = "takes some of what is left, but too little to be named beside what nothing explains"


def ranked(
    ladder: Ladder, offered: Sequence[Candidate], library: Mapping[str, Effect]
) -> tuple[RankedEffect, ...]:
    """The evidence for every effect.

    Parameters
    ----------
    ladder
        The search as far as it is supported.
    offered
        Candidates beside the last step.
    library
        All effects.

    Returns
    -------
    tuple of RankedEffect
        Found effects in the order found, then the others by their score on the last step.

    """
    last = ladder.steps[-1]
    added = [_ranked_added(ladder, last.fit.effect(name), offered, library) for name in last.added]
    others = [
        _ranked_candidate(s) for s in last.scores if s.candidate.effect.name not in last.added
    ]
    reasons = {name: _AGAINST if note else _UNSUPPORTED for name, note in ladder.cut.items()}
    others = [replace(r, shortfall=reasons.get(r.effect, r.shortfall)) for r in others]
    return tuple(added + sorted(others, key=lambda r: (-r.score, r.effect)))


def _ranked_added(
    ladder: Ladder, effect: Effect, offered: Sequence[Candidate], library: Mapping[str, Effect]
) -> RankedEffect:
    """An effect that the ladder found: its evidence, its alternatives and what would part them."""
    steps, wide = ladder.steps, ladder.steps[-1].system
    passed_over = _passed_over(steps, effect.name, steps[-1].added)
    alternatives = alternatives_to(effect.name, wide, offered, passed_over)
    dof = effect.dof(wide.fit.machine)
    cost = dof * math.log(wide.informed(wide.place(effect.named(wide.fit.machine))))
    loss = _loss(wide, effect, cost)
    parameters = _parameters(steps[-1], effect, ladder.held_out[-1])
    return RankedEffect(
        effect=effect.name,
        score=loss - cost,
        held_out_drop=_share_of_fall(steps, ladder.held_out, effect.name),
        p_value=_p_value(loss, dof),
        confused_with=alternatives,
        explanation=f"{effect.words}; {effect.signature}",
        experiment=experiment_for(effect, alternatives, library),
        parameters=parameters,
        separation=separations(effect, wide, offered, remedies(effect, alternatives, library)),
        headline=headline(effect, parameters),
    )


def _loss(last: LinearSystem, effect: Effect, cost: float) -> float:
    """Rise of deviance without a found effect: to first order, or of a refit where that says that
    the effect is not worth its parameters. The linear step says little where parameters are
    strongly correlated.
    """
    loss = loss_without(last, (effect.name,))
    if loss > cost:
        return loss
    return max(loss, gauss_newton(last.fit.without(effect.name)).deviance - last.deviance)


def _passed_over(
    steps: Sequence[LadderStep], name: str, added: Sequence[str]
) -> tuple[Candidate, ...]:
    """Candidates whose predicted gain was close to that of an effect on the step before it was
    added.
    """
    policy = steps[0].fit.policy.selection
    before = [step for step in steps if name not in step.added][-1]
    falls = {score.candidate.effect.name: score.fall for score in before.scores}
    short = max(policy.tie, policy.passed_over_share * falls.get(name, 0.0))
    least = falls[name] - short if name in falls else math.inf
    return tuple(
        score.candidate
        for score in before.scores
        if score.fall > least and score.passes and score.candidate.effect.name not in added
    )


def _share_of_fall(steps: Sequence[LadderStep], held_out: Sequence[HeldOut], name: str) -> float:
    """Share of the removable held-out error, from first to last step, that went where an effect
    was added; 0 where the error grew there.
    """
    totals = [math.log(max(errors.total, 1e-300)) for errors in held_out]
    number = next(n for n, step in enumerate(steps) if name in step.added)
    if number == 0 or totals[0] <= totals[-1]:
        return 0.0
    return max((totals[number - 1] - totals[number]) / (totals[0] - totals[-1]), 0.0)


def _ranked_candidate(score: Score) -> RankedEffect:
    effect = score.candidate.effect
    dof = max(len(score.step), 1)
    return RankedEffect(
        effect=effect.name,
        score=score.fall - score.penalty,
        held_out_drop=0.0,
        p_value=_p_value(score.fall, dof),
        confused_with=(),
        explanation=f"{effect.words}; {effect.signature}",
        experiment=effect.experiment,
        parameters={},
        size=score.size if math.isfinite(score.size) else None,
        shortfall=score.shortfall,
    )


def _p_value(fall: float, dof: int) -> float:
    return float(gammaincc(dof / 2.0, max(fall, 0.0) / 2.0))


def _parameters(
    step: LadderStep, effect: Effect, held_out: HeldOut
) -> dict[str, ReportedParameter]:
    reported, start = parameters_of(step, held_out), f"{effect.name}."
    return {name.removeprefix(start): p for name, p in reported.items() if name.startswith(start)}


def step_record(step: LadderStep, held_out: HeldOut) -> StepRecord:
    """One step of the search as a record for people.

    Parameters
    ----------
    step
        The step.
    held_out
        Its held-out residual; maps over an angle are those of the fit.

    """
    residual = held_out.or_fit(step.system)
    policy = step.fit.policy.validation
    errors = window_errors(step.system, residual)
    flat = (speed_current_map(one, policy) for one in errors)
    spreads = signal_errors(step.system, residual)
    floors = signal_errors(step.system, step.system.noise_ratio)
    return StepRecord(
        step.added,
        held_out.total,
        spreads,
        {name: StepError(rms, floors[name], unit_of(name)) for name, rms in spreads.items()},
        parameters_of(step, held_out),
        (*(one for one in flat if one is not None), *angle_maps(step.fit)),
        histograms(errors, policy),
    )


def parameters_of(step: LadderStep, held_out: HeldOut) -> dict[str, ReportedParameter]:
    """The parameters of every effect on a step.

    Parameters
    ----------
    step
        The step.
    held_out
        Its held-out residual.

    Returns
    -------
    dict of ReportedParameter
        By full name; without a value where not determined.

    """
    reported = reported_parameters(step.system, held_out)
    parameters = step.fit.model.parameters()
    selected = ((name, reported[name]) for name in parameters)
    return {name: ReportedParameter(p.value, p.u, p.unit) for name, p in selected}
