"""A step of the ladder as a record: its errors, its parameters, and where the error lives."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.regression.goodness import HeldOut, signal_errors
from pipeline.criticism.regression.identifiability import parameters_told
from pipeline.criticism.selection.stepwise import Rung
from pipeline.criticism.validation.error_maps import (
    angle_maps,
    histograms,
    speed_current_map,
    unit_of,
    window_errors,
)
from pipeline.records.diagnosis import LadderRung, RungError, ToldParameter


def rung_record(rung: Rung, held: HeldOut) -> LadderRung:
    """One step for people: held-out errors and maps; angle maps are those of the fit."""
    residual = held.or_fit(rung.system)
    policy = rung.fit.policy.validation
    errors = window_errors(rung.system, residual)
    flat = (speed_current_map(one, policy) for one in errors)
    return LadderRung(
        rung.added,
        held.total,
        signal_errors(rung.system, residual),
        {
            one.signal: RungError(_rms(one.error), _rms(one.sigma), unit_of(one.signal))
            for one in errors
        },
        parameters_of(rung, held),
        (*(one for one in flat if one is not None), *angle_maps(rung.fit)),
        histograms(errors, policy),
    )


def parameters_of(rung: Rung, held: HeldOut) -> dict[str, ToldParameter]:
    """Value, standard uncertainty and unit of every effect's parameters on a step."""
    told = parameters_told(rung.system, held)
    own = rung.fit.model.parameters()
    return {name: (told[name].value, told[name].u, told[name].unit) for name in own}


def _rms(values: np.ndarray) -> float:
    return math.sqrt(float((values**2).mean()))
