"""Recorded less predicted signals of one segment, sample by sample, in the sensors' own units."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import Model, Pieces, evaluate
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.residuals.observability import hooks_in
from pipeline.criticism.signals.true_state import on_true_clock
from pipeline.numerics.projection import Projection


def residual(
    segment: Segment,
    model: Model,
    values: Values,
    recorded: Signals | None = None,
    beside: Operating | None = None,
) -> Array:
    """Recorded less predicted signals of a segment, sample by sample.

    Parameters
    ----------
    segment
        The segment.
    model
        The model.
    values
        Parameters by full name.
    recorded
        Other recorded columns in place of the segment's, such as noisy ones.
    beside
        State of the segment at near values: what both have in common is not made again.

    Returns
    -------
    array [C, n]
        In the units of the channels.

    """
    signals = segment.recorded if recorded is None else recorded
    x = operate(segment, signals, model, values)
    x = x if beside is None else x.beside(beside)
    pieces = evaluate(model, x, values, hooks_in(segment))
    recorded_rows = measured(segment, signals, model, values)
    return recorded_rows - predicted(segment, x, pieces, model, values)


def operate(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True currents, angle and speed of a segment, the errors of its sensors taken out.

    Parameters
    ----------
    segment
        The segment.
    signals
        Recorded columns [n].
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        The state [n].

    """
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    return equation.state(segment, signals, model, values)


def measured(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    """Recorded signals of the channels, in the units of the prediction.

    Parameters
    ----------
    segment
        The segment.
    signals
        Recorded columns [n].
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        One row a channel.

    """
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    return equation.measured(segment, signals, model, values)


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Predicted signals of the channels.

    Parameters
    ----------
    segment
        The segment.
    x
        True state [n].
    pieces
        What the hooks gave there.
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        One row a channel.

    """
    equation = equation_of(segment)
    segment = on_true_clock(segment, equation.recorder, model, values)
    return equation.predicted(segment, x, pieces, model, values)


def disturbed(
    segment: Segment, weak: Projection, model: Model, values: Values, name: str, waves: Array
) -> Array:
    """What additions to one sensor do to the weak samples.

    Parameters
    ----------
    segment
        The segment.
    weak
        Its windows.
    model
        The model.
    values
        Parameters by full name.
    name
        The recorded signal.
    waves
        Additions [K, n] in its unit.

    Returns
    -------
    array [K, C, W, M]
        Change of the weak residual.

    """
    before, column = residual(segment, model, values), segment.recorded[name]
    moved = ({**segment.recorded, name: column + wave} for wave in waves)
    after = [residual(segment, model, values, recorded) for recorded in moved]
    return np.stack([weak.project(one - before) for one in after])
