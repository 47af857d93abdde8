"""The fit of a model that a user asks for, effects with shapes and choices included."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import first_fit, gauss_newton, rough_fit
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.mains_hum import Hum, hum_of, with_hum
from pipeline.criticism.selection.choices import reconsidered
from pipeline.criticism.selection.discrimination import renamed
from pipeline.criticism.selection.score_test import candidates, score_all, widened
from pipeline.criticism.selection.stepwise import begin_from
from pipeline.criticism.selection.transducer_place import at_better_place

_FRAME = (
    "held voltages of {} captures are taken in the rotor frame of the sampling instant, which "
    "explains them better than that of the middle of their period"
)


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


def in_better_frame(system: LinearSystem, rough: Fit) -> LinearSystem:
    """The fit by the rotor frame that explains held voltages better.

    Parameters
    ----------
    system
        Fitted with vectors in the frame of the middle of their hold.
    rough
        Where that fit began.

    Returns
    -------
    LinearSystem
        Of less deviance: that one, or one with vectors in the frame of the sampling instant, from
        which on they are held.

    Notes
    -----
    A control loop computes a voltage in the frame of its sampled angle and turns it ahead. Firmware
    logs it from before or behind that, and no capture states which.

    """
    if not any(_has_held_vectors(segment) for segment in system.segments):
        return system
    turned = tuple(_at_start(s) if _has_held_vectors(s) else s for s in system.segments)
    other = first_fit(replace(rough, segments=turned))
    return other if other.deviance < system.deviance else system


def frame_notes(segments: Sequence[Segment]) -> tuple[str, ...]:
    """A note on voltages that are in the frame of the sampling instant.

    Parameters
    ----------
    segments
        The segments of a fit.

    Returns
    -------
    tuple of str
        Empty where there are none.

    """
    captures = dict.fromkeys(segment.capture for segment in segments if segment.instrument.frame)
    return (_FRAME.format(len(captures)),) if captures else ()


def _has_held_vectors(segment: Segment) -> bool:
    """Whether a segment has voltage vectors that are held from their sample on."""
    return segment.instrument.timing == "held" and "vd_v" in segment.channels


def _at_start(segment: Segment) -> Segment:
    """The segment with its vectors in the frame of the start of their hold, half a hold before its
    middle.
    """
    return replace(segment, instrument=replace(segment.instrument, frame=0.5))


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
    Effects with a shape or a choice are added one by one, the most helpful first, each at the best
    of its trial values: from another one, a bump of friction may move its speed the wrong way.

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
    system = at_better_place(in_better_frame(first_fit(rough), rough))
    if not shaped:
        return BaseFit(system, hum)
    while shaped:
        offered = candidates(shaped, system.fit.model)
        wide = widened(system.fit, offered, system)
        scores = score_all(wide, offered)
        if not scores:
            break
        del shaped[scores[0].candidate.effect.name]
        system = gauss_newton(begin_from(system.fit, scores[0]), before=wide)
    for effect in system.fit.model.effects:
        system = renamed(system, effect.name, {effect.name: effect})
    fit = system.fit
    settled = {effect.name: effect for effect in fit.model.effects}
    model = replace(model, effects=tuple(settled.get(e.name, e) for e in model.effects))
    unheard = {k: v for effect in shaped.values() for k, v in zero(effect, model).items()}
    full = replace(fit, model=model, values={**fit.values, **unheard})
    return BaseFit(reconsidered(gauss_newton(full)), hum)
