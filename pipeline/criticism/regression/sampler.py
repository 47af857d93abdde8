"""Change of a segment's sampled residual along parameters of a model."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.coenergy import effect_flux, flux_of, unsampled_voltage
from pipeline.criticism.machine.model import (
    CURVED,
    LATE_TORQUE,
    OF_SIGNALS,
    STATE,
    Model,
    Pieces,
    clock_gain,
    evaluate,
    passed_on_drag,
    values_of,
    zero,
)
from pipeline.criticism.machine.sample_period import mean_current
from pipeline.criticism.operating import Array, Complex, Noted, Values
from pipeline.criticism.regression.columns import Column, ColumnKey
from pipeline.criticism.residuals.channels import of_acceleration
from pipeline.criticism.residuals.observability import constants_in, hooks_in, observes
from pipeline.criticism.residuals.residual import measured, operate, predicted, residual
from pipeline.criticism.signals.shaft import TORQUE_RIPPLES, drag_course
from pipeline.criticism.signals.voltage import RIPPLES

_NOTHING = 1e-40
"""What complex steps leave of a term that is zero."""
_FINE = 1e-3
"""Share of J that its finite difference steps by at the most: 1/J is then straight to 1e-3."""
_BETWEEN = ("j_kgm2", *RIPPLES, "ripple_torque", "ripple_held", "ripple_sampled")
"""Constants that change no flux, drop or drag."""
_OF_SENSORS = ("bench_angle_rad", "command_lead", *STATE)
"""Constants by which the machine's true state is another."""


def sampler_of(segment: Segment, model: Model, values: Values) -> Sampler:
    """The sampler of a segment at a point.

    The last one is kept: a fit comes back to where it ended for columns anew, for those of
    candidates, for other floors.

    Parameters
    ----------
    segment
        The segment.
    model
        The model.
    values
        Parameters by full name.

    """
    known: Sampler | None = segment.cache.get("sampler")
    if known is not None and known.at(segment, model, values):
        return known
    sampler = segment.cache["sampler"] = Sampler(segment, model, dict(values))
    return sampler


class Sampler:
    """Sampled change of a segment's residual along columns; hooks are linear, sensors are not.

    Attributes
    ----------
    segment, model, values
        Where the residual is linearised.
    weak
        Weak samples [R] of columns that were requested, by their keys.
    read
        By the name of a parameter, its columns in a model without the effect, and which values each
        read.
    equation, recorder, constants, hooks
        What the segment's equation observes, and whose clock it goes by.
    effects
        Whether the segment observes an effect, by its name.
    x, pieces
        True state of the machine [n], and flux, drops and drags there.
    start
        Predicted signals [C, n].
    base_residual
        Recorded less predicted signals [C, n].
    mean
        The state by the mean current of each sample period.
    quiet
        The values without the small terms between samples.
    by_hook
        What the hooks of an effect of the model give at the values, and which of these they read.
    paced
        Change of the residual along the gain of the clock [C, n], by its step.
    of_nothing
        Signals [C, n] that an affine equation predicts of no flux, drop and drag; None until it is
        needed.

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
        none = ("j_kgm2", "b_nm_s_rad", *RIPPLES, *TORQUE_RIPPLES)
        self.quiet = {**values, **dict.fromkeys(none, 0.0)}

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
            drag = passed_on_drag(self.model, self.x, self.values, step * x.omega_rad_s)
            pieces = replace(pieces, drag_nm=pieces.drag_nm + drag)
        elif column.name == "lead_ohm":
            lead = step * self.mean.i_a * float(x.inverter and not x.supply.measured)
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
        if not effect.coupling:
            passed = passed_on_drag(self.model, self.x, self.values, change.drag_nm)
            change = replace(change, drag_nm=passed)
        parts = (change.psi_wb, change.slope_wb, change.drop_v, change.drag_nm)
        if not any(part.any() for part in parts):
            return None
        only_drag = effect.hook == "torque" and effect.parallel is None
        if only_drag and self.equation.torque_in and self.x.shaft.finer == 1:
            # a drag is in the torque alone: no voltage needs to be predicted for it
            drag = np.zeros_like(self.start)
            place = self.segment.channels.index(self.equation.torque_in)
            dry, _ = drag_course(self.x, self.values)
            gain = 1.0 + self.values[self.segment.instrument.transducer]
            drag[place] = dry * change.drag_nm * gain / column.step
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
            if "drop" in self.hooks and x.supply.hold_ends is not None:
                yield (
                    "unsampled",
                    lambda q: unsampled_voltage(lambda at: effect_flux(effect, at, q)[0], x),
                )
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
        drop = results.get("drop", still) + results.get("unsampled", still)
        return Pieces(flux, slope, drop, results.get("drag", nothing))


def _difference(after: Pieces, before: Pieces) -> Pieces:
    return Pieces(
        after.psi_wb - before.psi_wb,
        after.slope_wb - before.slope_wb,
        after.drop_v - before.drop_v,
        after.drag_nm - before.drag_nm,
    )
