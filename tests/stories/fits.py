"""Models fitted to the shared real recordings, with their errors on what was held out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pipeline.criticism.data.machine_scale import machine_of
from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.named_models import model_of
from pipeline.criticism.machine.model import LATE_SPEED, Model
from pipeline.criticism.regression.cross_validation import leave_out
from pipeline.criticism.regression.goodness import signal_errors
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.residuals.residual import measured, residual
from pipeline.criticism.residuals.segments import segments
from pipeline.criticism.selection.pruning import trimmed
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.execution.tasks.start import start_constants
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.stages.steps.campaigns import campaigns

REAL = Path(__file__).parents[3] / "shared" / "data" / "real"


@dataclass(frozen=True)
class Fit:
    """One model of one motor: its segments, values, and rms of each signal held out."""

    system: LinearSystem
    held_out: Mapping[str, float]

    @property
    def segments(self) -> tuple[Segment, ...]:
        return self.system.segments

    @property
    def model(self) -> Model:
        return self.system.fit.model

    @property
    def values(self) -> Mapping[str, float]:
        return self.system.fit.values

    def segment(self, kind: str) -> Segment:
        return next(s for s in self.segments if s.kind == kind)

    def curves(self, kind: str) -> tuple[np.ndarray, np.ndarray]:
        """Measured and modelled signals [C, n] of a segment."""
        segment = self.segment(kind)
        seen = measured(segment, segment.recorded, self.model, self.values)
        return seen, seen - residual(segment, self.model, self.values)


def campaign(folder: str, motor: str | None = None) -> Campaign:
    return campaigns(str(REAL / folder), motor=motor)[0][0]


def without(found: Campaign, column: str) -> Campaign:
    """The recordings without one of their columns."""
    captures = (
        replace(one, tables=tuple(t.drop(column, strict=False) for t in one.tables))
        for one in found.captures
    )
    return replace(found, captures=tuple(captures))


def fit(
    found: Campaign,
    *effects: str,
    kinds: tuple[str, ...] = (),
    offsets: bool = True,
    on_time: bool = False,
) -> Fit:
    """The ideal model with effects, optional terms left out where they do not pay.

    `on_time`: a drive's own speed is taken as it stands where no angle is beside it.
    """
    start = start_constants(found)
    machine = machine_of(found, start)
    parts = tuple(s for s in segments(found, machine) if not kinds or s.kind in kinds)
    if on_time:
        fixed = [{k: v for k, v in s.fixed.items() if k != LATE_SPEED} for s in parts]
        parts = tuple(replace(s, fixed=kept) for s, kept in zip(parts, fixed, strict=True))
    if not offsets:
        parts = tuple(replace(s, disturbances=replace(s.disturbances, offsets=None)) for s in parts)
    model = model_of(ModelSpec("ideal", effects), machine)
    begun = fit_of(parts, model)
    system = trimmed(begun.system, effects)
    return Fit(system, signal_errors(system, leave_out(system).or_fit(system)))
