"""Amplitudes that are tried far from zero: a delay of many samples is no tangent's matter.

The deviance at a trial delay, all else refitted to first order, is a cross-correlation of what is
recorded with what the model predicts, over all signals, captures and orders at once, each by its
noise. Reference: Knapp & Carter, IEEE Trans. ASSP 24 (1976), the maximum-likelihood delay.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Array, Parameter, Values
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.linearise import linearise
from pipeline.criticism.regression.noise_floors import Floor
from pipeline.criticism.regression.normal_equations import Descent
from pipeline.criticism.regression.parallel import on_each
from pipeline.criticism.residuals.observability import observes
from pipeline.criticism.selection.score_test import (
    Candidate,
    Score,
    Standing,
    clears,
    paid_for,
    quiet_fall,
    searched,
    share_of,
)


def with_starts(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: NDArray[np.bool_],
) -> tuple[Score, ...]:
    """The scores, those of effects with `starts` from the best of them if that beats the tangent.

    Nothing is tried where nothing is `significant` [G] as a remainder: a delay of many samples
    shows.
    """
    if not significant.any():
        return tuple(scores)
    best = {score.candidate.effect.name: score for score in scores}
    thorough = wide.policy.selection.thorough
    own = wide.along(wide.own)
    before = Standing.of(own, np.arange(len(own.columns)), own.normal_equations().best(*thorough))
    penalty = searched(offered)
    for candidate in offered:
        for parameter in candidate.effect.parameters_of(wide.fit.machine):
            for score in _tried(own, candidate, parameter, before, significant):
                known = best.get(candidate.effect.name)
                if known is None or score.fall > known.fall:
                    best[candidate.effect.name] = replace(score, penalty=score.penalty + penalty)
    return tuple(sorted(best.values(), key=lambda s: (-s.fall, s.candidate.effect.name)))


def _tried(
    own: LinearSystem,
    candidate: Candidate,
    parameter: Parameter,
    before: Standing,
    significant: NDArray[np.bool_],
) -> tuple[Score, ...]:
    """The score of the best start of a parameter, none where it has no starts."""
    if not parameter.starts:
        return ()
    name = f"{candidate.effect.name}.{parameter.name}"
    scale, policy = own.fit.machine.scale(parameter), own.policy.selection

    def at(start: float) -> tuple[float, float, LinearSystem, Descent]:
        moved = _moved(own, candidate, {name: start * scale})
        end = moved.normal_equations().best(*policy.thorough)
        return end.deviance, start, moved, end

    nearest = min((at(start) for start in parameter.starts), key=lambda one: one[:2])
    beside = [at(factor * nearest[1]) for factor in policy.finer_starts]
    _, start, moved, end = min([nearest, *beside], key=lambda one: one[:2])
    places = np.arange(len(own.columns))
    after = Standing.of(moved, places, end)
    found = Score(
        candidate,
        before.deviance - after.deviance,
        0.0,
        {name: start * scale},
        dict(zip((c.name for c in own.columns), end.step.tolist(), strict=True)),
        share_of(own, candidate.effect, before, after),
        abs(start) / parameter.negligible,
        quiet_fall(own, before.reduced_chi2, after.reduced_chi2),
        clears(own, significant, before.reduced_chi2, after.reduced_chi2),
        policy=policy,
    )
    dof = paid_for(candidate.effect, own.fit.machine, found)
    search = 2.0 * math.log(len(parameter.starts) + len(policy.finer_starts))
    return (replace(found, penalty=dof * math.log(own.size) + search),)


def _moved(own: LinearSystem, candidate: Candidate, start: Values) -> LinearSystem:
    """The system with its residual where the candidate's amplitude is at a start, and the columns
    of where it is not.
    """
    fit, effect = own.fit, candidate.effect
    model = fit.model.with_effects(effect)
    values = {**fit.values, **candidate.values, **start}
    segments, floors = fit.segments, fit.floors
    observed = [number for number, segment in enumerate(segments) if observes(segment, effect)]
    each = [(model, values, floors[number]) for number in observed]
    rows = on_each(_residual, [segments[number] for number in observed], each)
    residual = own.residual.copy()
    for number, row in zip(observed, rows, strict=True):
        residual[own.segment == number] = row
    return replace(own, residual=residual)


def _residual(segment: Segment, model: Model, values: Values, floor: Floor) -> Array:
    return linearise(segment, model, values, (), floor).residual
