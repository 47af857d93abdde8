"""An error of the angle tried from a rotor that is round, where the inductances fit that error.

In slow logs that hardly move i_d, an encoder off its centre leaves an L_d of many times the true
one. An error of the angle turns the current as well, and at such an L_d what that does to the
voltage hides it: the tangent does not show the error. The flux of a round rotor, L_d = L_q, turns
with its current, so from there the error is fitted whatever the base fit made of both.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import compress

import numpy as np

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import zero
from pipeline.criticism.operating import Flags
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.observability import observes
from pipeline.criticism.selection.candidates import Candidate, first_of_each
from pipeline.criticism.selection.linear_start import score_between, with_better
from pipeline.criticism.selection.score_test import Score

_INDUCTANCES = ("ld_h", "lq_h")


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

    """
    so_far = list(scores)
    passing = {score.candidate.effect.name for score in scores if score.passes}
    for name, candidate in first_of_each(offered).items():
        effect = candidate.effect
        if effect.angle is None or name in passing or not _may_bend(wide, effect, significant):
            continue
        end = gauss_newton(_round_rotor(wide.fit, candidate))
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
    model = fit.model.with_effects(candidate.effect)
    nothing = {**zero(candidate.effect, model), **candidate.values}
    smaller = min(fit.values[name] for name in _INDUCTANCES)
    return replace(fit, model=model).at({**nothing, **dict.fromkeys(_INDUCTANCES, smaller)})
