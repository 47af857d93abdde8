"""A rung of the ladder as a record: its errors, its parameters, and where the error lives."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from pipeline.criticism.judge import HeldOut, signal_errors, uncertainties
from pipeline.criticism.maps import (
    angle_maps,
    histograms,
    speed_current_map,
    unit_of,
    window_errors,
)
from pipeline.criticism.segment import Segment
from pipeline.criticism.selection import Rung
from pipeline.criticism.system import own_columns
from pipeline.records.diagnosis import LadderRung, RungError


def rung_record(found: Sequence[Segment], rung: Rung, held: HeldOut) -> LadderRung:
    """One rung for people: held-out errors and maps; angle maps are those of the fit."""
    residual = np.where(np.isfinite(held.residual), held.residual, rung.around.residual)
    errors = window_errors(found, rung.around, residual)
    flat = (speed_current_map(one) for one in errors)
    return LadderRung(
        rung.added,
        held.total,
        signal_errors(found, rung.around, residual),
        {
            one.signal: RungError(_rms(one.error), _rms(one.sigma), unit_of(one.signal))
            for one in errors
        },
        parameters_of(rung, held),
        (*(one for one in flat if one is not None), *angle_maps(found, rung.fitted)),
        histograms(errors),
    )


def parameters_of(rung: Rung, held: HeldOut) -> dict[str, tuple[float, float, str]]:
    """Value, standard uncertainty and unit of every effect's parameters on a rung."""
    own = own_columns(rung.fitted.model)
    spread = uncertainties(rung.around, held, len(own)).tolist()
    u = {column.name: one for column, one in zip(own, spread, strict=True)}
    return {
        name: (float(rung.fitted.values[name]), u.get(name, p.u), p.unit)
        for name, (_, p) in rung.fitted.model.parameters().items()
    }


def _rms(values: np.ndarray) -> float:
    return math.sqrt(float((values**2).mean()))
