"""What an effect shows: a signal's error over the variable that orders it best, without and with.

A Stribeck bump is an error of torque over speed, an encoder off its centre one of voltage over the
angle of the shaft. Which signal and which variable the effect does not state: the pair is drawn in
which the change of the error is largest beside what is left of it.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.validation.error_maps import Errors, angle_maps, window_errors
from pipeline.physics.glossary import unit_of
from pipeline.physics.units import TURN_RAD
from pipeline.records.diagnosis import Signature
from pipeline.records.error_map import ErrorMap

_CELLS, _FEWEST = 48, 6
"""Cells of a curve, and the fewest that make one. By judgement, for people to look at."""
_MANY_WAVES, _FINE, _FEWEST_PHASES = 6, 72, 12
"""Waves a turn from which on they are laid over each other, cells of one wave, and the fewest in
which its shape is seen."""
_VARIABLES = (
    "omega_mech_rad_s",
    "iq_a",
    "id_a",
    "i_pair_a",
    "temp_winding_degc",
    "temp_magnet_degc",
)
_ACCELERATION, _TORQUE = "alpha_mech_rad_s2", "torque_nm"


@dataclass(frozen=True, slots=True)
class _Curve:
    """Mean errors over cells without and with the effect, and the noise of such a mean [C]."""

    signal: str
    variable: str
    capture: str | None
    at: Array
    before: Array
    after: Array
    count: Array
    noise: Array
    order: int = 1

    @property
    def contrast(self) -> float:
        """Rms change of the error over what is left and what noise makes of the means.

        Changes of neighbouring cells are multiplied with each other: over the variable that the
        effect depends on they are alike, over any other one that few windows fill they are not.
        """
        change = self.before - self.after
        alike = float(np.minimum(self.count[1:], self.count[:-1]) @ (change[1:] * change[:-1]))
        variance = self.count @ (self.after**2 + self.noise**2)
        return math.sqrt(max(alike, 0.0) / max(float(variance), 1e-300))


def signature(
    full: LinearSystem, added: Sequence[str], maps: Sequence[ErrorMap]
) -> Signature | None:
    """The curve in which effects show most clearly; None where none has cells.

    Parameters
    ----------
    full : LinearSystem
        The fit with the effects.
    added : sequence of str
        Names of the effects.
    maps : sequence of ErrorMap
        Its errors over the angle of a turn.

    Returns
    -------
    Signature
        An error of acceleration is reported as torque, by the inertia that was fitted.

    Notes
    -----
    Without the effects, every other parameter stays as it is. Fitted anew, the others would bend
    towards what is missing, and its shape would be lost.

    References
    ----------
    Component-plus-residual plots: F. S. Wood, Technometrics 15 (1973) 677-695.

    """
    without = linear_system(full.fit.without(*added), before=full, chord=True)
    curves = [*_window_curves(without, full), *_turn_curves(angle_maps(without.fit), maps)]
    if not curves:
        return None
    best = max(curves, key=lambda one: one.contrast)
    scale, signal = 1.0, best.signal
    if signal == _ACCELERATION:
        scale, signal = full.fit.values["j_kgm2"], _TORQUE
    return Signature(
        signal,
        unit_of(signal),
        best.variable,
        best.capture,
        tuple(best.at.tolist()),
        tuple((scale * best.before).tolist()),
        tuple((scale * best.after).tolist()),
        best.order,
    )


def _window_curves(without: LinearSystem, full: LinearSystem) -> Iterator[_Curve]:
    """Window errors of every signal of every capture over every variable that was recorded."""
    with_it = {one.signal: one for one in window_errors(full, full.residual)}
    for before in window_errors(without, without.residual):
        after = with_it.get(before.signal)
        if after is None or after.error.size != before.error.size:
            continue
        for number in np.unique(before.segment).tolist():
            in_segment = before.segment == number
            yield from _of_capture(without.segments[number], before, after, in_segment)


def _of_capture(
    segment: Segment, before: Errors, after: Errors, in_capture: Flags
) -> Iterator[_Curve]:
    sigma = before.sigma[in_capture]
    for variable, value in _values(segment, before, in_capture).items():
        cell, at = _cells(variable, value)
        inside = cell >= 0
        count = np.bincount(cell[inside], minlength=at.size).astype(float)
        nonempty = count > 0
        if nonempty.sum() < _FEWEST:
            continue

        def mean(
            error: Array,
            cell: Indices = cell[inside],
            inside: Flags = inside,
            count: Array = count,
            nonempty: Flags = nonempty,
        ) -> Array:
            return np.bincount(cell, error[inside], count.size)[nonempty] / count[nonempty]

        yield _Curve(
            before.signal,
            variable,
            segment.capture,
            at[nonempty],
            mean(before.error[in_capture]),
            mean(after.error[in_capture]),
            count[nonempty],
            np.sqrt(mean(sigma**2) / count[nonempty]),
        )


def _values(segment: Segment, errors: Errors, in_capture: Flags) -> Mapping[str, Array]:
    """What a window's error may depend on [n]: means, and the angles at the window's middle."""
    values = {name: errors.at[name][in_capture] for name in _VARIABLES if name in errors.at}
    theta = segment.recorded.get("theta_mech_rad")
    if theta is not None and segment.weak is not None and float(np.ptp(theta)) > TURN_RAD:
        middle = segment.weak.starts + segment.weak.length // 2
        values["theta_mech_rad"] = np.mod(theta[middle][errors.window[in_capture]], TURN_RAD)
    return values


def _cells(variable: str, value: Array) -> tuple[Indices, Array]:
    """Cell of each value [n], -1 where there is none, and the middle of each cell [C].

    Cells of an angle are equally wide. Edges of others lie halfway between those of equal widths
    and those of equal shares of the values: a test that dwells somewhere shows the rest as well.
    """
    finite = np.isfinite(value)
    if variable == "theta_mech_rad":
        edges = np.linspace(0.0, TURN_RAD, _CELLS + 1)
    elif finite.sum() < _FEWEST:
        return np.full(value.size, -1), np.empty(0)
    else:
        shares = np.linspace(0.0, 1.0, _CELLS + 1)
        low, high = float(value[finite].min()), float(value[finite].max())
        even = low + (high - low) * shares
        edges = np.unique((np.quantile(value[finite], shares) + even) / 2.0)
    if edges.size < 2:
        return np.full(value.size, -1), np.empty(0)
    cell = np.searchsorted(edges[1:-1], np.where(finite, value, edges[0]), side="right")
    return np.where(finite, cell, -1).astype(np.int64), (edges[1:] + edges[:-1]) / 2.0


def _turn_curves(without: Sequence[ErrorMap], with_it: Sequence[ErrorMap]) -> Iterator[_Curve]:
    """The maps over the angle of a turn, sample by sample, of all captures together."""
    after = {_key(one): one for one in with_it if one.y is None}
    for one in without:
        other = after.get(_key(one))
        if other is None or one.x != other.x:
            continue
        finite = np.isfinite(one.mean) & np.isfinite(other.mean)
        if finite.sum() < _FEWEST:
            continue
        edges = np.array(one.x.edges)
        curve = _Curve(
            one.signal,
            one.x.variable,
            None,
            ((edges[1:] + edges[:-1]) / 2.0)[finite],
            one.mean[finite],
            other.mean[finite],
            one.count[finite].astype(float),
            np.zeros(int(finite.sum())),
        )
        if (folded := _folded(curve, one.x.count)) is not None:
            yield folded


def _folded(curve: _Curve, cells: int) -> _Curve | None:
    """A curve over a turn with its waves laid over each other, where there are many; None where the
    cells are too few to see the shape of a wave.
    """
    change = np.zeros(cells)
    change[np.floor(curve.at / TURN_RAD * cells).astype(np.int64) % cells] = (
        curve.before - curve.after
    )
    order = 1 + int(np.argmax(np.abs(np.fft.rfft(change))[1:]))
    if order < _MANY_WAVES:
        return curve
    phase = np.mod(order * curve.at, TURN_RAD)
    _, cell = np.unique(np.round(phase / TURN_RAD * _FINE) % _FINE, return_inverse=True)
    count: Array = np.bincount(cell, curve.count).astype(np.float64)
    if np.count_nonzero(count) < _FEWEST_PHASES:
        return None

    def mean(values: Array) -> Array:
        return np.bincount(cell, curve.count * values) / count

    # an angle on a circle has no mean of its own where the first and the last cell meet
    at = mean(np.where(phase > TURN_RAD * (1.0 - 0.5 / _FINE), phase - TURN_RAD, phase))
    before, after = mean(curve.before), mean(curve.after)
    noise = np.zeros(at.size)
    return _Curve(curve.signal, curve.variable, None, at, before, after, count, noise, order)


def _key(error_map: ErrorMap) -> tuple[str, str]:
    return error_map.signal, error_map.x.variable
