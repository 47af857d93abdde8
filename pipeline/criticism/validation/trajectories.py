"""Trajectories that obey a model's equations: all windows of a capture at once, by Newton's method.

The residual of the equations along the trajectory at hand is taken back by a correction that obeys
the equations linearised around it, stepped by the trapezoidal rule (flux) and by leapfrog (angle).

References: [1] Lelarasmee, Ruehli & Sangiovanni-Vincentelli, IEEE Trans. CAD 1 (1982), waveform
relaxation; [2] Hairer, Lubich & Wanner, Geometric Numerical Integration (2006), ch. I (leapfrog).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.coenergy import air_gap_torque
from pipeline.criticism.machine.model import Model, evaluate
from pipeline.criticism.operating import Array, Complex, Flags, Operating, Signals, Values
from pipeline.criticism.regression.noise_floors import reading_error
from pipeline.criticism.residuals.residual import measured, operate, predicted
from pipeline.criticism.validation.error_maps import disjoint

_STATE = ("id_a", "iq_a", "theta_mech_rad")
_PAD = 23
"""Samples kept around a window: one less than a thinned log has there (`traces.PAD`)."""
_START_S = 0.002
"""Length [s] of the straight line that gives the first speed, as of `true_state._SPEED_S`."""
_PROBE = 1e-3
"""Step of the finite differences, as a share of the machine's scale [A, rad/s], and in electrical
radians: small against what bends the equations, large against rounding."""


@dataclass(frozen=True, slots=True)
class Batch:
    """Windows cut out of a segment with their surroundings, and the model that they are simulated
    with.

    Attributes
    ----------
    segment
        Stretches of `pad + N + pad` samples; the angle jumps where they meet.
    model, values
        Whose trajectories are sought.
    windows, length, pad
        Windows W, samples N of each, and samples on either side.
    shaft
        Whether the motion is simulated.
    allowed
        What the equation of each channel may miss by in a window [C, W, its unit].

    """

    segment: Segment
    model: Model
    values: Values
    windows: int
    length: int
    pad: int
    shaft: bool
    allowed: Array

    @property
    def currents(self) -> bool:
        """Whether the capture is under current, so that there is a flux to integrate."""
        return bool(equation_of(self.segment).use.currents)

    def folded(self, column: Any) -> Any:
        """A column [n], real or complex, by window [W, n / W].

        Parameters
        ----------
        column
            [n], real or complex.

        Returns
        -------
        array [W, n / W]
            A view.

        """
        return column.reshape(self.windows, -1)

    def inside(self, column: Array) -> Array:
        """The part of a column inside the windows.

        Parameters
        ----------
        column
            [n].

        Returns
        -------
        array [W, N]
            Without the surroundings.

        """
        return self.folded(column)[:, self.pad : self.pad + self.length]


def batch_of(segment: Segment, model: Model, values: Values) -> Batch | None:
    """The windows of a segment that have their surroundings and share no samples.

    Parameters
    ----------
    segment
        The segment.
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    Batch or None
        None for a table, and where no window is left or windows are too short.

    """
    weak = segment.weak
    if weak is None:
        return None
    inside = (weak.starts >= _PAD) & (weak.starts + weak.length + _PAD <= segment.size)
    starts = disjoint(weak.starts[inside], weak.length)
    pad = max(_PAD, round(_START_S / segment.ts_s / 2) + 3)
    length = weak.length + 2 * (_PAD - pad)
    if starts.size == 0 or length < model.policy.validation.shortest:
        return None
    rows = (starts[:, None] + np.arange(-_PAD, weak.length + _PAD)[None, :]).ravel()
    cut = {name: column[rows] for name, column in segment.recorded.items()}
    gain = float(weak.functions[0, 0].sum())
    chosen = np.searchsorted(weak.starts, starts)
    allowed = reading_error(segment, model, values)[:, chosen, 0] / gain
    currents = equation_of(segment).use.currents
    load = "torque_shaft_nm" in segment.channels and not segment.instrument.stator
    shaft = load or not currents
    # integrated from sample to sample
    instrument = replace(segment.instrument, points=1)
    short = replace(segment, recorded=cut, weak=None, instrument=instrument)
    return Batch(short, model, values, starts.size, length, pad, shaft, allowed)


@dataclass(frozen=True, slots=True)
class Jacobian:
    """The equations linearised along a trajectory, time first: [..., n, W] each.

    Attributes
    ----------
    ahead, behind
        One trapezoidal step of the current, rows and columns d and q [2, 2].
    emf
        Voltage a rad/s, complex.
    pull
        Torque an ampere of d and q current [2].
    damping, spring
        Drag a rad/s and a rad.

    """

    ahead: Array
    behind: Array
    emf: Complex
    pull: Array
    damping: Array
    spring: Array


def jacobian_of(batch: Batch) -> Jacobian:
    """Linearises the equations along the recorded trajectory, by finite differences.

    Parameters
    ----------
    batch
        The windows.

    """
    model, values = batch.model, batch.values
    x = operate(batch.segment, batch.segment.recorded, model, values)
    shape = (batch.segment.size // batch.windows, batch.windows)
    if not batch.currents:
        none = np.zeros((2, 2, *shape))
        drag = np.full(shape, values["b_nm_s_rad"])
        return Jacobian(none, none, none[0, 0] + 0j, none[0], drag, none[0, 0])
    scales, p = model.machine.scales, model.machine.pole_pairs

    def probed(step: float, move: Callable[[float], Operating]) -> tuple[Complex, Complex, Array]:
        (up_psi, up_drop, up), (psi, drop, down) = (
            _flux_drop_torque(model, move(sign), values) for sign in (step, -step)
        )
        each = (up_psi - psi, up_drop - drop, up - down)
        flux, loss, torque = ((one / (2 * step)).reshape(shape[::-1]).T for one in each)
        return flux, loss, torque

    current = _PROBE * scales["current_a"]
    by_d = probed(current, lambda h: replace(x, id_a=x.id_a + h))
    by_q = probed(current, lambda h: replace(x, iq_a=x.iq_a + h))
    by_speed = probed(
        _PROBE * scales["speed_rad_s"], lambda h: replace(x, omega_rad_s=x.omega_rad_s + h)
    )
    by_angle = probed(
        _PROBE / p, lambda h: replace(x, theta_rad=x.theta_rad + h, eps_rad=x.eps_rad + p * h)
    )
    flux, drop = (
        np.array([[by_d[n].real, by_q[n].real], [by_d[n].imag, by_q[n].imag]]) for n in (0, 1)
    )
    omega_e = (p * x.omega_rad_s).reshape(shape[::-1]).T
    ahead, behind = _steps(flux, drop, omega_e, batch.segment.ts_s)
    return Jacobian(
        ahead,
        behind,
        (1j * p * _flux_drop_torque(model, x, values)[0]).reshape(shape[::-1]).T,
        np.array([by_d[2], by_q[2]]),
        np.maximum(-by_speed[2], 0.0),
        -by_angle[2],
    )


def _flux_drop_torque(model: Model, x: Operating, values: Values) -> tuple[Complex, Complex, Array]:
    """Flux, voltage drop and torque less drags [n]."""
    pieces = evaluate(model, x, values)
    torque: Array = air_gap_torque(x, pieces.psi_wb, pieces.slope_wb) - pieces.drag_nm
    return pieces.psi_wb, pieces.drop_v, torque


def _steps(flux: Array, drop: Array, omega_e: Array, period: float) -> tuple[Array, Array]:
    """The trapezoidal rule of the step from each sample [2, 2, n, W]: inverse of its left side,
    and its right side.

    Left: ∂ψ/∂i/T + half of ∂drop/∂i + jω_e ∂ψ/∂i, where j exchanges the rows d and q.
    """
    half = 0.5 * (drop + omega_e * np.stack([-flux[1], flux[0]]))
    slope = flux / period
    after = slope + half
    after = np.concatenate([after[:, :, 1:], after[:, :, -1:]], axis=2)
    det = after[0, 0] * after[1, 1] - after[0, 1] * after[1, 0]
    inverse: Array = np.array([[after[1, 1], -after[0, 1]], [-after[1, 0], after[0, 0]]]) / det
    return inverse, slope - half


def _defects(batch: Batch, signals: Signals) -> tuple[Complex, Array]:
    """What the equations miss by along a trajectory: voltage over the step from each sample [W, n]
    [V], and torque at each sample [W, n] [N·m].

    The residual has the central difference of the flux, under which samples of even and odd number
    would drift apart. It is exchanged for the difference over the step.
    """
    model, values = batch.model, batch.values
    segment, period = batch.segment, batch.segment.ts_s
    x = operate(segment, signals, model, values)
    pieces = evaluate(model, x, values)
    recorded = measured(segment, signals, model, values)
    defects = recorded - predicted(segment, x, pieces, model, values)
    if not batch.currents:
        torque = -values["j_kgm2"] * batch.folded(defects[0])
        return np.zeros(torque.shape, dtype=complex), torque
    voltage = batch.folded(defects[0] + 1j * defects[1])
    torque = -batch.folded(defects[2]) if batch.shaft else np.zeros(voltage.shape)
    if segment.instrument.timing == "held":
        return voltage, torque
    psi = batch.folded(pieces.psi_wb)
    central = np.zeros_like(psi)
    # as the residual differences it, over the ends of the stretches too
    flat = pieces.psi_wb
    central.ravel()[1:-1] = (flat[2:] - flat[:-2]) / (2 * period)
    voltages = voltage + central
    step = np.zeros_like(psi)
    step[:, :-1] = 0.5 * (voltages[:, :-1] + voltages[:, 1:]) - np.diff(psi, axis=1) / period
    return step, torque


def settle(
    batch: Batch,
    jacobian: Jacobian,
    start: Signals,
    given: Signals,
    rounds: int,
    extra: tuple[Complex, Array] | None = None,
) -> tuple[dict[str, Array], Flags]:
    """Trajectories that obey the equations, by Newton's method.

    Parameters
    ----------
    batch
        The windows.
    jacobian
        The equations linearised.
    start
        Signals where the iteration begins [n].
    given
        Signals with the voltage and load that are obeyed, and the state at the start of each window
        [n].
    rounds
        Most iterations.
    extra
        Voltage [W] and torque [W] that are added in each window.

    Returns
    -------
    tuple of dict and array [W]
        Signals [n], and which windows settled: their last correction was below what drives are
        modelled to.

    """
    model, policy = batch.model, batch.model.policy
    names = [name for name in _STATE if name in given]
    now = dict(given)
    for name in names:
        column = batch.folded(given[name]).copy()
        column[:, batch.pad + 1 :] = batch.folded(start[name])[:, batch.pad + 1 :]
        now[name] = column.ravel()
    begin = _first_speed(batch, given["theta_mech_rad"])
    limits = (model.machine.scales["current_a"], 2 * math.pi / model.machine.pole_pairs)
    sound = np.ones(batch.windows, dtype=bool)
    for _ in range(rounds):
        voltage, torque = _defects(batch, now)
        if extra is not None:
            voltage, torque = voltage + extra[0][:, None], torque + extra[1][:, None]
        speed = begin - _central_speed(batch, now["theta_mech_rad"])
        current, angle = _corrected(batch, jacobian, voltage, torque, speed)
        size = np.maximum(np.abs(current) / limits[0], np.abs(angle) / limits[1]).max(axis=1)
        sound &= size < policy.validation.lost
        current[~sound], angle[~sound] = 0.0, 0.0
        for name, change in zip(_STATE, (current.real, current.imag, angle), strict=True):
            if name in names:
                now[name] = now[name] + change.ravel()
        if not (size[sound] > policy.noise_floors.model_drive).any():
            break
    return now, sound & (
        (size < policy.noise_floors.model_drive) | (rounds < policy.validation.most_rounds)
    )


def _first_speed(batch: Batch, theta: Array) -> Array:
    """Speed [W] at the windows' first samples, from the angle around them."""
    width = max(2 * round(_START_S / batch.segment.ts_s / 2) + 1, 5)
    half = width // 2
    folded = batch.folded(theta)
    # the slope of a straight line through the samples around
    offset = np.arange(-half, half + 1)
    around = folded[:, batch.pad - half : batch.pad + half + 1]
    return around @ offset / float(offset @ offset) / batch.segment.ts_s


def _central_speed(batch: Batch, theta: Array) -> Array:
    folded = batch.folded(theta)
    return (folded[:, batch.pad + 1] - folded[:, batch.pad - 1]) / (2 * batch.segment.ts_s)


def _corrected(
    batch: Batch, jacobian: Jacobian, voltage: Complex, torque: Array, speed: Array
) -> tuple[Complex, Array]:
    """Corrections of current [W, n] [A] and angle [W, n] [rad], zero up to the windows' start.

    `speed` [W] is the correction of the speed at the windows' start, where half a kick is due.
    """
    period, n_all, stop = batch.segment.ts_s, voltage.shape[1], batch.pad + batch.length
    voltage, torque = np.ascontiguousarray(voltage.T), np.ascontiguousarray(torque.T)
    current, angle = (
        np.zeros((n_all, batch.windows), dtype=complex),
        np.zeros((n_all, batch.windows)),
    )
    kick = period / batch.values["j_kgm2"]
    damped = 1.0 / (1.0 + kick * jacobian.damping)
    d, q = np.zeros(batch.windows), np.zeros(batch.windows)
    turn = np.zeros(batch.windows)
    with np.errstate(over="ignore", invalid="ignore"):
        for n in range(batch.pad, stop):
            if batch.shaft:
                push = jacobian.pull[0, n] * d + jacobian.pull[1, n] * q - jacobian.spring[n] * turn
                share = 0.5 if n == batch.pad else 1.0
                speed = (speed + share * kick * (torque[n] + push)) * damped[n]
                turn = turn + period * speed
                angle[n + 1] = turn
            if batch.currents:
                defect = voltage[n] - jacobian.emf[n] * speed if batch.shaft else voltage[n]
                back, on = jacobian.behind[:, :, n], jacobian.ahead[:, :, n]
                rd = back[0, 0] * d + back[0, 1] * q + defect.real
                rq = back[1, 0] * d + back[1, 1] * q + defect.imag
                d, q = on[0, 0] * rd + on[0, 1] * rq, on[1, 0] * rd + on[1, 1] * rq
                current[n + 1] = d + 1j * q
    current[stop + 1 :], angle[stop + 1 :] = current[stop], angle[stop]
    return np.nan_to_num(current.T, nan=np.inf), np.nan_to_num(angle.T, nan=np.inf)
