"""The fit of a model that a user asks for, effects with shapes and choices included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.gauss_newton import first_fit, gauss_newton, rough_fit
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.mains_hum import Hum, hum_of, with_hum
from pipeline.criticism.selection.choices import reconsidered
from pipeline.criticism.selection.discrimination import renamed
from pipeline.criticism.selection.refit import floored_anew, refitted, reweighted
from pipeline.criticism.selection.stepwise import scored


@dataclass(frozen=True, slots=True)
class BaseFit:
    """The system around a model fitted to segments, which know the mains lines in them.

    Attributes
    ----------
    system
        The fit, linearised; its segments know the mains lines in them.
    hum
        Mains lines that were found.

    """

    system: LinearSystem
    hum: tuple[Hum, ...]


def fit_of(segments: Sequence[Segment], model: Model) -> BaseFit:
    """Fits a requested model from orders of magnitude.

    Parameters
    ----------
    segments
        The segments.
    model
        The model.

    Returns
    -------
    BaseFit
        Effects that nothing observes stay at zero.

    Notes
    -----
    Effects with a shape or a choice are added one by one, the most helpful first, as a search for
    what is missing adds them: from another start, a bump of friction may move its speed the wrong
    way, and most of the inertia stays on the wrong side of a soft coupling.

    """
    shaped = {
        effect.name: effect
        for effect in model.effects
        if not all(p.amplitude for p in effect.parameters_of(model.machine))
    }
    rough = rough_fit(segments, model.without(*shaped))
    hum = hum_of(segments, rough.model, rough.values)
    humming = with_hum(segments, hum, rough.model, rough.values)
    rough = replace(rough, segments=humming)
    system = first_fit(rough)
    if not shaped:
        return BaseFit(system, hum)
    while shaped:
        wide, scores = scored(system.fit, shaped, system)
        if not scores:
            break
        best = min(scores, key=lambda score: score.penalty - score.fall)
        del shaped[best.candidate.effect.name]
        system = refitted(reweighted(wide, best), best)
    for effect in system.fit.model.effects:
        system = renamed(system, effect.name, {effect.name: effect})
    fit = floored_anew(system.fit, system)
    settled = {effect.name: effect for effect in fit.model.effects}
    model = replace(model, effects=tuple(settled.get(e.name, e) for e in model.effects))
    unobserved = {k: v for effect in shaped.values() for k, v in zero(effect, model).items()}
    full = replace(fit, model=model, values={**fit.values, **unobserved})
    return BaseFit(reconsidered(gauss_newton(full)), hum)
