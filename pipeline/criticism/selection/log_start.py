"""An effect tried from what full logs show of it, where windows hardly show it at all.

A transducer in a coupling reads what the motor's side passes on, and no twist is in that: to the
windows the shaft is rigid there. A shaft that coasts carries the far part as well, so that its
inertia contradicts that of the logs, and no linear step shows why. Of the logs as a whole the angle
against the torque in the coupling gives the far inertia, the spring and the gap without a fit. Any
effect with `shown` is tried from these.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import zero
from pipeline.criticism.operating import Flags, Values
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.candidates import Candidate, first_of_each
from pipeline.criticism.selection.discrimination import full_logs, settled
from pipeline.criticism.selection.linear_start import scored, with_better
from pipeline.criticism.selection.score_test import Score


def with_log_start(
    wide: LinearSystem,
    offered: Sequence[Candidate],
    scores: Sequence[Score],
    significant: Flags,
) -> tuple[Score, ...]:
    """Scores, those of effects that full logs show from there where no tangent is far better.

    A tangent promises, while this start is fitted; and it leaves a twist or a gap open that full
    logs know.

    Parameters
    ----------
    wide
        The fit with the columns of all candidates.
    offered
        The candidates.
    scores
        Scores by the tangent.
    significant
        Groups [G] over their floor; without any, nothing is tried.

    Returns
    -------
    tuple of Score
        The largest fall first.

    """
    so_far = list(scores)
    by_name = first_of_each(offered)
    hooks = {c.effect.shown: c for c in by_name.values() if c.effect.shown is not None}
    for hook in hooks if significant.any() else ():
        shown = hook(full_logs(wide.fit, wide.fit.model))
        if shown is None or shown.discrimination.name not in by_name:
            continue
        candidate = by_name[shown.discrimination.name]
        effect = settled(candidate.effect, shown.discrimination)
        shown_values = {name: value for name, (value, _) in shown.discrimination.values.items()}
        begun = _fit_at(wide.fit, effect, {**shown_values, **shown.start}, shown.base)
        started = scored(wide, candidate, begun)
        alike = [s for s in so_far if s.candidate.effect.shown is hook]
        best = max((s.fall for s in alike), default=0.0)
        if started.fall > started.policy.close_share * best:
            so_far = with_better([s for s in so_far if s not in alike], started, offered)
    return tuple(so_far)


def _fit_at(fit: Fit, effect: Effect, values: Values, base: Values) -> Fit:
    """The fit with an effect at such values, by their short names, and such constants."""
    model = fit.model.with_effects(effect)
    starts = {f"{effect.name}.{name}": value for name, value in values.items()}
    return replace(fit, model=model).at({**zero(effect, model), **base, **starts})
