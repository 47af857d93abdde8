"""The units and reaches in which a ladder's errors are drawn, the same on all steps."""

from __future__ import annotations

from pipeline.physics.notation import Scale, scale_for
from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import SPEED, angle_of, reaches

TIMELINE = "step"


def map_reach(result: Diagnosis, signal: str) -> float:
    """Full colour of the maps of a signal over speed and current, the same on all steps.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    Returns
    -------
    float
        In the unit of the signal.

    """
    return reaches(result.ladder).get((signal, SPEED), 0.0)


def error_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which the errors of a signal are drawn on all steps: mV where volts would be
    small.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    """
    errors = [step.errors[signal] for step in result.ladder]
    return scale_for(max(e.rmse for e in errors), errors[0].unit)


def angle_reach(result: Diagnosis, signal: str) -> float:
    """The largest mean error over the angle on any step.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    Returns
    -------
    float
        In the unit of the signal.

    """
    return reaches(result.ladder).get((signal, angle_of(signal)), 0.0)


def angle_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which the error of a signal is drawn over the angle on all steps.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    """
    return scale_for(angle_reach(result, signal), result.ladder[0].errors[signal].unit)
