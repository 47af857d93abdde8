"""Recorded less predicted signals of one segment, sample by sample, in the sensors' own units."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Array, Operating, Values
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import Model, Pieces, evaluate
from pipeline.criticism.signals.true_state import on_true_clock
from pipeline.numerics.projection import Projection


def residual(
    segment: Segment, model: Model, values: Values, recorded: Mapping[str, Array] | None = None
) -> Array:
    """Recorded less predicted [C, n] of every channel of a segment."""
    signals = segment.recorded if recorded is None else recorded
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    x = equation.state(segment, signals, model, values)
    pieces = evaluate(model, x, values)
    seen = equation.measured(segment, signals, model, values)
    return seen - equation.predicted(segment, x, pieces, model, values)


def operate(
    segment: Segment, signals: Mapping[str, Array], model: Model, values: Values
) -> Operating:
    """True currents, angle and speed [n] of a segment, the sensor effects taken out."""
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    return equation.state(segment, signals, model, values)


def measured(segment: Segment, signals: Mapping[str, Array], model: Model, values: Values) -> Array:
    """Recorded signals [C, n] of the channels, in the units of the prediction."""
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    return equation.measured(segment, signals, model, values)


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Predicted signals [C, n] of the channels from the pieces the hooks gave."""
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    return equation.predicted(segment, x, pieces, model, values)


def disturbed(
    segment: Segment, weak: Projection, model: Model, values: Values, name: str, waves: Array
) -> Array:
    """What additions to one sensor, waves [K, n] in its unit, do to the weak samples
    [K, C, W, M].
    """
    here, column = residual(segment, model, values), segment.recorded[name]
    moved = ({**segment.recorded, name: column + wave} for wave in waves)
    there = [residual(segment, model, values, recorded) for recorded in moved]
    return np.stack([weak.project(one - here) for one in there])
