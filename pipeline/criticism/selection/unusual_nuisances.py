"""Effects that are a nuisance of unusual size: they begin where the fit has that nuisance.

No tangent leads there. A lag of the torque is undone before an effect's own is tried, so that a
second one beside it is a filter of second order.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.candidates import Candidate, first_of_each, searched
from pipeline.criticism.selection.score_test import Score, paid_for, ranked


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
