"""Weak residuals and their columns: one model against all segments, whitened by sensor noise.

Each segment is projected once for all parameters together; what remains of it is its normal matrix
a group of (channel, order), so that any subset of effects or captures is then small algebra.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.data.segment import Segment, projected, row_index
from pipeline.criticism.effect import Effect
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Flags, Indices, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.regression.columns import Column, ColumnKey
from pipeline.criticism.regression.noise_floors import Floor, offsets, reading_error, window_gain
from pipeline.criticism.regression.sampler import Sampler, sampler_of
from pipeline.criticism.residuals.channels import reported_unit

_CHUNK = 8
"""Columns that are projected at a time: more leave the processor's cache (of 32 a linearisation
takes an eighth longer), fewer are more calls."""


@dataclass(frozen=True, slots=True)
class Rows:
    """Weak samples of one segment, over the noise.

    Attributes
    ----------
    residual, columns
        [R] and [R, P].
    group, window
        Group and window of each row [R].
    unit
        A residual of one as a window's mean, in the unit of the signal [R].
    noise_ratio
        Noise floor over the scale that a row was divided by [R].
    row_weight
        What rows were multiplied by [R].
    groups
        Channel and order of each group.

    """

    residual: Array
    columns: Array
    group: Indices
    window: Indices
    unit: Array
    noise_ratio: Array
    row_weight: Array
    groups: tuple[tuple[str, int], ...]


def linearise(
    segment: Segment, model: Model, values: Values, columns: Sequence[Column], floor: Floor
) -> Rows:
    """Whitened residual and columns of one segment.

    Parameters
    ----------
    segment
        The segment.
    model
        The model.
    values
        Parameters by full name, where it is linearised.
    columns
        Directions wanted.
    floor
        What rows are divided by.

    Returns
    -------
    Rows
        Disturbances absorbed; a column that the segment does not observe is zero.

    """
    group, window, valid, groups = row_index(segment)
    sampler = sampler_of(segment, model, values)
    reading = _reading_error(segment, model, floor.near)[valid]
    noise, scale = floor.noise_and_scale(group[valid], reading)
    row_weight = 1.0 / scale
    weak_columns = _weak_columns(segment, sampler, columns, valid)
    rows = (
        np.column_stack([projected(segment, sampler.base_residual)[valid], *weak_columns])
        * row_weight[:, None]
    )
    absorb(rows, offsets(segment, valid, row_weight, model.machine))
    unit = reported_unit(segment, values) / (row_weight * window_gain(segment))
    noise_ratio = noise * row_weight
    return Rows(
        rows[:, 0], rows[:, 1:], group[valid], window[valid], unit, noise_ratio, row_weight, groups
    )


def trial_residuals(
    segment: Segment,
    model: Model,
    values: Values,
    trials: Sequence[tuple[Effect, Values]],
    row_weight: Array,
) -> list[Array]:
    """Whitened residuals of one segment where effects that are not in the model are.

    Parameters
    ----------
    segment
        With R valid weak samples.
    model, values
        What the effects are added to, one at a time.
    trials
        Each an effect of a sensor and its parameters by their full names, in their units.
    row_weight
        What rows are multiplied by [R], over their unit.

    Returns
    -------
    list of arrays [R]
        One a trial.

    """
    _, _, valid, _ = row_index(segment)
    sampler = sampler_of(segment, model, values)
    sampled = (
        sampler.residual_with(effect, model.with_effects(effect), {**sampler.values, **moved})
        for effect, moved in trials
    )
    rows = np.stack([projected(segment, one)[valid] for one in sampled], axis=1)
    rows *= row_weight[:, None]
    absorb(rows, offsets(segment, valid, row_weight, model.machine))
    return list(rows.T)


def _weak_columns(
    segment: Segment, sampler: Sampler, columns: Sequence[Column], valid: Flags
) -> list[Array]:
    """Weak samples [P][R] of every column, zero where the segment does not observe it."""
    known, nothing = sampler.weak, np.zeros(int(valid.sum()))
    observed_columns = {column.key: column for column in columns if sampler.observes(column)}
    new = [c for key, c in observed_columns.items() if known.get(key, (None, nothing))[0] != c]
    for first in range(0, len(new), _CHUNK):
        changes: dict[ColumnKey, Array | None] = {}
        for column in (part := new[first : first + _CHUNK]):
            if sampler.twin(column) is None:
                changes[column.key] = sampler.change(column)
        observed = {key: change for key, change in changes.items() if change is not None}
        computed = dict.fromkeys(changes, nothing)
        if observed:
            stacked = np.concatenate(list(observed.values()))
            moving = stacked.any(axis=1)
            weak = np.zeros((stacked.shape[0], *valid.shape[1:]))
            weak[moving] = projected(segment, stacked[moving])
            parts = weak.reshape(len(observed), *valid.shape)
            computed |= {key: one[valid] for key, one in zip(observed, parts, strict=True)}
        known.update({c.key: (c, computed[c.key]) for c in part if c.key in computed})
    for column in new:
        if (twin := sampler.twin(column)) is not None:
            known[column.key] = column, known[twin][1]
    return [known[c.key][1] if c.key in observed_columns else nothing for c in columns]


def absorb(rows: Array, unknown: Sequence[Array]) -> None:
    """Whitens rows in place for disturbances of unknown size.

    Parameters
    ----------
    rows
        [R, P].
    unknown
        Disturbances of their standard size [R each].

    Notes
    -----
    The factor is (1 + N Nᵀ)^(−1/2), N the disturbances: what is orthogonal to them stays as it is.

    """
    if unknown:
        axes, sizes, _ = np.linalg.svd(np.column_stack(list(unknown)), full_matrices=False)
        shrinkage = 1.0 - 1.0 / np.sqrt(1.0 + sizes**2)
        rows -= (axes * shrinkage) @ (axes.T @ rows)


def whitened_anew(
    segment: Segment, rows: Array, before: Array, after: Array, machine: Machine
) -> Array:
    """Rows of one segment, whitened by other weights.

    Parameters
    ----------
    segment
        Its disturbances, which are absorbed anew as well: beside a louder noise an offset is
        absorbed less.
    rows
        [R, P].
    before
        Weights that they have now [R].
    after
        Weights that they are to have [R].
    machine
        The machine, for the sizes of offsets.

    Returns
    -------
    array [R, P]
        A new array.

    """
    _, _, valid, _ = row_index(segment)
    unabsorbed = rows.copy()
    _restore(unabsorbed, offsets(segment, valid, before, machine))
    unabsorbed *= (after / before)[:, None]
    absorb(unabsorbed, offsets(segment, valid, after, machine))
    return unabsorbed


def _restore(rows: Array, unknown: Sequence[Array]) -> None:
    """Undoes `absorb` in place."""
    if unknown:
        axes, sizes, _ = np.linalg.svd(np.column_stack(list(unknown)), full_matrices=False)
        rows += (axes * (np.sqrt(1.0 + sizes**2) - 1.0)) @ (axes.T @ rows)


def _reading_error(segment: Segment, model: Model, near: Values) -> Array:
    """Error [C, W, M] that any model is allowed near some values. The last one is kept: all steps
    of a fit have the same.
    """
    known = segment.cache.get("reading")
    if known is None or known[0] is not segment or known[1:3] != (model, near):
        error = reading_error(segment, model, near)
        known = segment.cache["reading"] = segment, model, dict(near), error
    return known[3]
