"""The rotor frame that held voltages were logged in, which no metadata state.

A control loop computes a voltage in the frame of its sampled angle and turns it ahead. Firmware
logs it from before or behind that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem

_HALF_HOLD = 0.5
"""Of the start of a hold, before its middle."""
_FRAME = (
    "held voltages of {} captures are taken in the rotor frame of the sampling instant, which "
    "explains them better than that of the middle of their period"
)


def in_better_frame(system: LinearSystem) -> LinearSystem:
    """The fit by the rotor frame that explains held voltages better.

    Parameters
    ----------
    system
        Fitted with vectors in the frame of the middle of their hold, or in that of the sampling
        instant, from which on they are held.

    Returns
    -------
    LinearSystem
        That one or the other, whichever has less deviance.

    Notes
    -----
    It is asked again whenever an effect joins: an effect of the voltage that was missing, such as
    dead time, may have spoken for the wrong frame.

    """
    if not any(_has_held_vectors(segment) for segment in system.segments):
        return system
    turned = tuple(_in_other_frame(s) if _has_held_vectors(s) else s for s in system.segments)
    other = gauss_newton(replace(system.fit, segments=turned))
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


def _in_other_frame(segment: Segment) -> Segment:
    instrument = segment.instrument
    return replace(segment, instrument=replace(instrument, frame=_HALF_HOLD - instrument.frame))
