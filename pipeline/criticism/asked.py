"""The fit of a model that a user asks for, effects with shapes and choices included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.criticism.descent import first_fit, gauss_newton, initial
from pipeline.criticism.model import Model
from pipeline.criticism.segment import Segment
from pipeline.criticism.selection import begun, candidates, score_all, widened
from pipeline.criticism.system import Fitted, System


def fit_of(segments: Sequence[Segment], model: Model) -> tuple[Fitted, System]:
    """Fits a model from orders of magnitude.

    Effects that have a shape or a choice come in one by one, the most helpful first, each from the
    best of its trial values: from any other, a bump of friction would look for its speed on the
    wrong side.
    """
    shaped = {
        effect.name: effect
        for effect in model.effects
        if not all(p.amplitude for p in effect.parameters_of(model.machine))
    }
    fitted, around = first_fit(segments, model.without(*shaped))
    if not shaped:
        return fitted, around
    while shaped:
        offered = candidates(shaped, fitted)
        wide = widened(segments, fitted, offered, around)
        scores = score_all(wide, fitted, offered)
        if not scores:
            break
        del shaped[scores[0].candidate.effect.name]
        fitted, around = gauss_newton(segments, begun(fitted, scores[0]), before=wide)
    unheard = {k: v for effect in shaped.values() for k, v in initial(effect, model).items()}
    return gauss_newton(segments, replace(fitted, model=model, values={**fitted.values, **unheard}))
