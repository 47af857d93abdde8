"""A step of the ladder as a record: its errors, its parameters, and where the error lives."""

from __future__ import annotations

from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.goodness import signal_errors
from pipeline.criticism.regression.reported import reported_parameters
from pipeline.criticism.selection.stepwise import LadderStep
from pipeline.criticism.validation.error_maps import (
    angle_maps,
    histograms,
    speed_current_map,
    window_errors,
)
from pipeline.physics.glossary import unit_of
from pipeline.records.diagnosis import ReportedParameter, StepError, StepRecord


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
