"""Weak residuals and their columns: one model against all segments, whitened by sensor noise.

Each segment is projected once for all parameters together; what remains of it is its normal matrix
a group of (channel, order), so that any subset of effects or captures is then small algebra.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import Segment, projected, row_index
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import (
    CURVED,
    LATE_TORQUE,
    OF_SIGNALS,
    STATE,
    Model,
    Pieces,
    clock_gain,
    effect_flux,
    evaluate,
    flux_of,
    mean_current,
    values_of,
    zero,
)
from pipeline.criticism.operating import Array, Complex, Noted, Values
from pipeline.criticism.policy.regression import NoiseFloors
from pipeline.criticism.regression.columns import Column, ColumnKey
from pipeline.criticism.regression.noise_floors import Floor, offsets, reading_error, window_gain
from pipeline.criticism.residuals.channels import of_acceleration, reported_unit
from pipeline.criticism.residuals.observability import constants_in, hooks_in, observes
from pipeline.criticism.residuals.residual import measured, operate, predicted, residual
from pipeline.criticism.signals.shaft import TORQUE_RIPPLES
from pipeline.criticism.signals.voltage import RIPPLES

_CHUNK = 8
"""Columns that are projected at a time: more leave the processor's cache (of 32 a linearisation
takes an eighth longer), fewer are more calls."""
_NOTHING = 1e-40
"""What complex steps leave of a term that is zero."""


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
    group: NDArray[np.int64]
    window: NDArray[np.int64]
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
    sampler = _sampler(segment, model, values)
    reading = _reading_error(segment, model, floor.near)[valid]
    noise, scale = floor.noise_and_scale(group[valid], reading)
    row_weight = 1.0 / scale
    weak_columns = _weak_columns(segment, sampler, columns, valid)
    rows = (
        np.column_stack([projected(segment, sampler.base_residual)[valid], *weak_columns])
        * row_weight[:, None]
    )
    absorb(rows, offsets(segment, valid, row_weight, model.policy.noise_floors))
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
    sampler = _sampler(segment, model, values)
    sampled = (
        sampler.residual_with(effect, model.with_effects(effect), {**sampler.values, **moved})
        for effect, moved in trials
    )
    rows = np.stack([projected(segment, one)[valid] for one in sampled], axis=1)
    rows *= row_weight[:, None]
    absorb(rows, offsets(segment, valid, row_weight, model.policy.noise_floors))
    return list(rows.T)


def _weak_columns(
    segment: Segment, sampler: _Sampler, columns: Sequence[Column], valid: NDArray[np.bool_]
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
    segment: Segment, rows: Array, before: Array, after: Array, policy: NoiseFloors
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
    policy
        Prior sizes of offsets.

    Returns
    -------
    array [R, P]
        A new array.

    """
    _, _, valid, _ = row_index(segment)
    unabsorbed = rows.copy()
    _restore(unabsorbed, offsets(segment, valid, before, policy))
    unabsorbed *= (after / before)[:, None]
    absorb(unabsorbed, offsets(segment, valid, after, policy))
    return unabsorbed


def _restore(rows: Array, unknown: Sequence[Array]) -> None:
    """Undoes `absorb` in place."""
    if unknown:
        axes, sizes, _ = np.linalg.svd(np.column_stack(list(unknown)), full_matrices=False)
        rows += (axes * (np.sqrt(1.0 + sizes**2) - 1.0)) @ (axes.T @ rows)


_FINE = 1e-3
"""Share of J that its finite difference steps by at the most: 1/J is then straight to 1e-3."""
_BETWEEN = ("j_kgm2", *RIPPLES, "ripple_torque", "ripple_held")
"""Constants that change no flux, drop or drag."""

_OF_SENSORS = ("bench_angle_rad", *STATE)
"""Constants by which the machine's true state is another."""


def _sampler(segment: Segment, model: Model, values: Values) -> _Sampler:
    """The sampler of a segment at a point. The last one is kept: a fit comes back to where it ended
    for columns anew, for those of candidates, for other floors.
    """
    known: _Sampler | None = segment.cache.get("sampler")
    if known is not None and known.at(segment, model, values):
        return known
    sampler = segment.cache["sampler"] = _Sampler(segment, model, dict(values))
    return sampler


def _reading_error(segment: Segment, model: Model, near: Values) -> Array:
    """Error [C, W, M] that any model is allowed near some values. The last one is kept: all steps
    of a fit have the same.
    """
    known = segment.cache.get("reading")
    if known is None or known[0] is not segment or known[1:3] != (model, near):
        error = reading_error(segment, model, near)
        known = segment.cache["reading"] = segment, model, dict(near), error
    return known[3]


class _Sampler:
    """Sampled change of a segment's residual along columns; hooks are linear, sensors are not.

    `weak`: the weak samples [R] of columns that were asked for, by their keys. `read`: by the name
    of a parameter, its columns in a model without the effect, and which values each read.
    """

    def __init__(self, segment: Segment, model: Model, values: dict[str, float]) -> None:
        self.segment, self.model, self.values = segment, model, values
        self.weak: dict[ColumnKey, tuple[Column, Array]] = {}
        self.read: dict[str, list[tuple[Column, set[str]]]] = {}
        self.equation = equation_of(segment).observes
        self.constants = constants_in(segment, model.machine)
        self.effects: dict[str, bool] = {}
        self.recorder = equation_of(segment).recorder
        self.x = operate(segment, segment.recorded, model, values)
        self.hooks = hooks_in(segment)
        pieces = self.pieces = evaluate(model, self.x, values, self.hooks)
        self.by_hook: dict[str, dict[str, tuple[Any, set[str]]]] = {}
        self.paced: dict[float, Array] = {}
        self.of_nothing: Array | None = None
        self.mean = mean_current(self.x, values)
        self.start = predicted(segment, self.x, pieces, model, values)
        self.base_residual = measured(segment, segment.recorded, model, values) - self.start
        # a hook's own column does without the small terms between samples
        self.quiet = {**values, "j_kgm2": 0.0, **dict.fromkeys(RIPPLES + TORQUE_RIPPLES, 0.0)}

    def at(self, segment: Segment, model: Model, values: Values) -> bool:
        """Whether this is the sampler of a segment at a point."""
        return segment is self.segment and values == self.values and model == self.model

    def twin(self, column: Column) -> ColumnKey | None:
        """Key of a column that was computed at other shapes, and read none of those that differ."""
        stem = column.name.partition(".")[0]
        for other, read in self.read.get(column.name, ()):
            differ = {f"{stem}.{name}" for name, _ in {*column.at} ^ {*other.at}}
            same = (other.effect, other.step) == (column.effect, column.step)
            if same and differ.isdisjoint(read):
                return other.key
        return None

    def observes(self, column: Column) -> bool:
        """Whether what a column is of is in the equation of the segment."""
        effect = column.effect
        if effect is None:
            return column.name in self.constants
        if effect.name not in self.effects:
            of_all = self.equation.form == "neither"
            self.effects[effect.name] = of_all or observes(self.segment, effect)
        return self.effects[effect.name]

    def change(self, column: Column) -> Array | None:
        """d(residual)/d(parameter) [C, n]; None where it is zero throughout."""
        if not self.observes(column):
            return None
        if column.effect is None:
            return self._base(column)
        if self.equation.form == "neither":
            return self._by_residual(column, column.effect)
        if column.effect.hook == "sensor":
            return self._by_residual(column, column.effect)
        return self._hook(column, column.effect)

    def _residual(self, model: Model, values: Values) -> Array:
        """The residual [C, n] with another model or other values."""
        return residual(self.segment, model, values, beside=self.x)

    def _base(self, column: Column) -> Array:
        if column.name in OF_SIGNALS or column.name not in self.equation.constants:
            return self._gain(column)
        step = column.step
        if column.name == "j_kgm2":
            # a coasting shaft goes by 1 / J: a step must be small against what J has come to
            step = min(step, _FINE * self.values[column.name])
        moved = {**self.values, column.name: self.values[column.name] + step}
        if column.name in _OF_SENSORS:
            return (self._residual(self.model, moved) - self.base_residual) / step
        x = replace(self.x, base=moved)
        pieces = self.pieces
        if column.name == "b_nm_s_rad":
            pieces = replace(pieces, drag_nm=pieces.drag_nm + step * x.omega_rad_s)
        elif column.name == "lead_share":
            lead = step * self.values["r_ohm"] * self.mean.i_a * float(x.inverter)
            pieces = replace(pieces, drop_v=pieces.drop_v + lead)
        elif column.name not in _BETWEEN:
            pieces = evaluate(self.model, x, moved, self.hooks)
        after = predicted(self.segment, x, pieces, self.model, moved)
        if column.name == "j_kgm2" and of_acceleration(self.segment, self.segment.channels[-1]):
            # the slope of 1/J, not of its chord: friction over inertia is known better than 1e-3
            step *= self.values[column.name] / moved[column.name]
        return -(after - self.start) / step

    def _gain(self, column: Column) -> Array:
        """Along a gain of the station: of the prediction, or what it does to current and heat."""
        if column.name == "gain_clock":
            return self._along_time(column.step)
        moved = {**self.values, column.name: self.values[column.name] + column.step}
        if column.name == LATE_TORQUE:
            signals = measured(self.segment, self.segment.recorded, self.model, moved)
            return (signals - self.start - self.base_residual) / column.step
        if column.name == self.segment.instrument.ammeter or column.name.startswith(CURVED):
            return (self._residual(self.model, moved) - self.base_residual) / column.step
        after = predicted(self.segment, self.x, self.pieces, self.model, moved)
        return -(after - self.start) / column.step

    def _by_residual(self, column: Column, effect: Effect) -> Array | None:
        inside = effect in self.model.effects
        model = self.model if inside else self.model.with_effects(effect)
        start = self._start(column, effect)
        moved = self._moved(column, start)
        if effect.clock is not None:
            gains = [clock_gain(self.recorder, model, values) for values in (start, moved)]
            return self._along_time(column.step) * (gains[1] - gains[0]) / column.step
        change: Array = (
            self.residual_with(effect, model, moved) - self.base_residual
        ) / column.step
        return change if np.any(change) else None

    def _along_time(self, step: float) -> Array:
        """d(residual)/d(gain of the clock) [C, n], once for all candidates that turn on it."""
        if step not in self.paced:
            moved = {**self.values, "gain_clock": self.values["gain_clock"] + step}
            self.paced[step] = (self._residual(self.model, moved) - self.base_residual) / step
        return self.paced[step]

    def residual_with(self, effect: Effect, model: Model, moved: Values) -> Array:
        """The residual where an effect has moved. An error of a voltage or a torque leaves the
        machine's state, and what its hooks gave, as they are.
        """
        if effect.hook != "sensor":
            return self._residual(model, moved)
        x, pieces, after = self.x, self.pieces, self.start
        if effect.angle is not None or effect.current is not None:
            x = operate(self.segment, self.segment.recorded, model, moved).beside(self.x)
            if not x.like(self.x):
                pieces = evaluate(model, x, moved, self.hooks)
        if pieces is not self.pieces or any(
            hook is not None for hook in (effect.angle, effect.voltage, effect.shaft, effect.speed)
        ):
            after = predicted(self.segment, x, pieces, model, moved)
        return measured(self.segment, self.segment.recorded, model, moved) - after

    def _start(self, column: Column, effect: Effect) -> dict[str, float]:
        """The values that a column departs from; an effect not in the model is not there."""
        if effect in self.model.effects:
            return self.values
        return {**self.values, **zero(effect, self.model, column.at)}

    def _moved(self, column: Column, start: Mapping[str, float]) -> Values:
        """The values after a column's step; at trial shapes, they note which of them are read."""
        moved = {**start, column.name: start[column.name] + column.step}
        if not column.at:
            return moved
        read: set[str] = set()
        self.read.setdefault(column.name, []).append((column, read))
        return Noted(moved, read)

    def _hook(self, column: Column, effect: Effect) -> Array | None:
        start = self._start(column, effect)
        q = values_of(effect, self.model.machine, self._moved(column, start))
        if effect in self.model.effects:
            before = self._at_start(effect)
            change = _difference(
                self._pieces(
                    {
                        name: before[name][0] if column.name not in before[name][1] else hook(q)
                        for name, hook in self._hooks_of(effect)
                    }
                ),
                self._pieces({name: result for name, (result, _) in before.items()}),
            )
        else:
            change = self._pieces({name: hook(q) for name, hook in self._hooks_of(effect)})
        parts = (change.psi_wb, change.slope_wb, change.drop_v, change.drag_nm)
        if not any(part.any() for part in parts):
            return None
        only_drag = effect.hook == "torque" and effect.parallel is None
        if only_drag and self.equation.torque_in:
            # a drag is in the torque alone: no voltage needs to be predicted for it
            drag = np.zeros_like(self.start)
            place = self.segment.channels.index(self.equation.torque_in)
            drag[place] = change.drag_nm * (1.0 + self.values["gain_torque"]) / column.step
            return drag if np.any(drag) else None
        model = self.model.without(*(e.name for e in self.model.effects if e.shaft is not None))
        if self.equation.form == "affine":
            if self.of_nothing is None:
                zero_pieces = self._pieces({})
                self.of_nothing = predicted(self.segment, self.x, zero_pieces, model, self.values)
            after = predicted(self.segment, self.x, change, model, self.values) - self.of_nothing
        else:
            after = predicted(self.segment, self.x, change, model, self.quiet)
        return -after / column.step if np.any(np.abs(after) > _NOTHING) else None

    def _at_start(self, effect: Effect) -> dict[str, tuple[Any, set[str]]]:
        """What each hook of an effect of the model gives, and the parameters that it read: along
        another one it stays as it is.
        """
        if effect.name not in self.by_hook:
            results = {}
            for name, hook in self._hooks_of(effect):
                read: set[str] = set()
                q = values_of(effect, self.model.machine, Noted(self.values, read))
                results[name] = hook(q), read
            self.by_hook[effect.name] = results
        return self.by_hook[effect.name]

    def _hooks_of(self, effect: Effect) -> Iterator[tuple[str, Callable[[Values], Any]]]:
        """The hooks of an effect that the segment observes, as functions of its parameters."""
        x, drop, torque, parallel = self.x, effect.drop, effect.torque, effect.parallel
        if effect.coenergy is not None:
            yield "flux", lambda q: effect_flux(effect, x, q)
        if drop is not None and "drop" in self.hooks:
            yield "drop", lambda q: drop(self.mean, q)
        if torque is not None:
            yield "drag", lambda q: torque(x, q)
        if parallel is not None:
            yield "beside", lambda q: flux_of(parallel(x, q), self.values)

    def _pieces(self, results: Mapping[str, Any]) -> Pieces:
        """Flux, drops and drags of what hooks gave; zero where there is none."""
        nothing = np.zeros(self.x.omega_rad_s.shape)
        still: Complex = nothing.astype(np.complex128)
        flux, slope = results.get("flux", (still, nothing))
        if "beside" in results:
            flux = flux - results["beside"]
        return Pieces(flux, slope, results.get("drop", still), results.get("drag", nothing))


def _difference(after: Pieces, before: Pieces) -> Pieces:
    return Pieces(
        after.psi_wb - before.psi_wb,
        after.slope_wb - before.slope_wb,
        after.drop_v - before.drop_v,
        after.drag_nm - before.drag_nm,
    )
