"""Free-running simulation: currents and speed that the model makes of recorded voltages and load.

Every window starts from the measured state and is then left to the model's own equations,

    dψ/dt = v − R i − drops − jω_e ψ,      J dω/dt = T(ψ, i) − drags − T_load,

with every effect and sensor of the model in place. The trajectory is found for all windows at
once by Newton's method on whole waveforms: the residual of the equations along the trajectory at
hand, and a correction that obeys the equations linearised around it, stepped by the trapezoidal
rule (flux) and by leapfrog (angle).

References: [1] Lelarasmee, Ruehli & Sangiovanni-Vincentelli, IEEE Trans. CAD 1 (1982), waveform
relaxation; [2] Hairer, Lubich & Wanner, Geometric Numerical Integration (2006), ch. I (leapfrog).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.effect import Array, Complex, Values
from pipeline.criticism.linearise import reading_error
from pipeline.criticism.maps import disjoint
from pipeline.criticism.model import Model, air_gap_torque, evaluate
from pipeline.criticism.residuals import measured, operate, predicted
from pipeline.criticism.segments import Segment
from pipeline.numerics.projection import bump

ELECTRICAL = ("torque_map", "drive")
MECHANICAL = ("spin_down",)
SPEED = "omega_mech_rad_s"
_STATE = ("id_a", "iq_a", "theta_mech_rad")
_PAD = 23
_START_S = 0.002
_SHORTEST = 32
_ROUNDS = 15
_SETTLED = 1e-4
_LOST = 30.0
_REPLICATES, _POOLED = 3, 96
_OFFSET = 0.5
_OFFSETS = ("vd_v", "vq_v", "id_a", "iq_a", "torque_shaft_nm")
_SEED = 20261121
_PROBE = 1e-3


@dataclass(frozen=True, slots=True)
class Run:
    """Simulated beside recorded signals [W, N] of one capture's windows, on `t_s` [W, N].

    `signals` are `id_a` and `iq_a` of a capture under current and, where load and angle are
    recorded or the shaft coasts, `omega_mech_rad_s`. `floor` is the noise floor of each one's
    window means, `drift` [K, W] how they move with each sensor's offset, of its prior size.
    """

    capture: str
    t_s: Array
    recorded: Mapping[str, Array]
    simulated: Mapping[str, Array]
    floor: Mapping[str, float]
    drift: Mapping[str, Array]

    @property
    def signals(self) -> tuple[str, ...]:
        """What was simulated."""
        return tuple(self.simulated)

    def errors(self, signal: str) -> Array:
        """Recorded less simulated as means [W] under a smooth window.

        Offsets of the capture's sensors are taken out as far as their priors allow: the means are
        whitened by 1 + Σ d dᵀ over the drifts d, as the equations' residuals are.
        """
        floor = max(self.floor[signal], 1e-300)
        error = _means(self.recorded[signal] - self.simulated[signal]) / floor
        if not self.drift[signal].size:
            return error * floor
        axes, size, _ = np.linalg.svd((self.drift[signal] / floor).T, full_matrices=False)
        taken = axes @ ((1.0 - 1.0 / np.sqrt(1.0 + size**2)) * (axes.T @ error))
        left: Array = (error - taken) * floor
        return left


@dataclass(frozen=True, slots=True)
class _Batch:
    """Windows cut out of a segment, with their surroundings: [W] stretches of `pad + N + pad`.

    Where stretches meet the angle jumps; `pad` is wider than what smooths the speed. `allowed`
    [C, W] is what each channel's equation may miss by in a window, in its unit.
    """

    segment: Segment
    windows: int
    length: int
    pad: int
    shaft: bool
    allowed: Array

    @property
    def currents(self) -> bool:
        """Whether the capture is under current, so that there is a flux to integrate."""
        return self.segment.kind == "dq"

    def folded(self, column: Any) -> Any:
        """A column [n], real or complex, by window [W, n / W]."""
        return column.reshape(self.windows, -1)

    def inside(self, column: Array) -> Array:
        """A column's part [W, N] inside the windows."""
        block: Array = self.folded(column)[:, self.pad : self.pad + self.length]
        return block


def free_run(segment: Segment, model: Model, values: Values) -> Run | None:
    """The model on its own over the windows of one capture.

    None where the test is none of `ELECTRICAL` and `MECHANICAL`, where the sample period is longer
    than the electrical time constant, or where few trajectories settle.
    """
    if segment.test not in (ELECTRICAL if segment.kind == "dq" else MECHANICAL):
        return None
    still = segment.ts_s * values["r_ohm"] > min(values["ld_h"], values["lq_h"])
    batch = None if still and segment.kind == "dq" else _batch(segment, model, values)
    if batch is None:
        return None
    recorded = batch.segment.recorded
    jacobian = _jacobian(batch, model, values)
    found, settled = _settle(batch, recorded, recorded, model, values, jacobian, _ROUNDS)
    if 2 * settled.sum() < batch.windows:
        return None
    names = ("id_a", "iq_a") * batch.currents + (SPEED,) * batch.shaft
    told = {name: _signal(batch, recorded, name)[settled] for name in names}
    made = {name: _signal(batch, found, name)[settled] for name in names}
    moved = _Response(batch, found, model, values, jacobian, settled, names)
    time = recorded.get("t_s", segment.ts_s * np.arange(batch.segment.size, dtype=np.float64))
    floor, drift = _floor(moved), _drift(moved)
    return Run(segment.capture, batch.inside(time)[settled], told, made, floor, drift)


def _batch(segment: Segment, model: Model, values: Values) -> _Batch | None:
    weak = segment.weak
    if weak is None:
        return None
    inside = (weak.starts >= _PAD) & (weak.starts + weak.length + _PAD <= segment.size)
    starts = disjoint(weak.starts[inside], weak.length)
    pad = max(_PAD, round(_START_S / segment.ts_s / 2) + 3)
    length = weak.length + 2 * (_PAD - pad)
    if starts.size == 0 or length < _SHORTEST:
        return None
    rows = (starts[:, None] + np.arange(-_PAD, weak.length + _PAD)[None, :]).ravel()
    cut = {name: column[rows] for name, column in segment.recorded.items()}
    gain = float(weak.functions[0, 0].sum())
    chosen = np.searchsorted(weak.starts, starts)
    allowed = reading_error(segment, model, values)[:, chosen, 0] / gain
    shaft = segment.kind == "shaft" or "torque_shaft_nm" in segment.channels
    short = replace(segment, recorded=cut, weak=None)
    return _Batch(short, starts.size, length, pad, shaft, allowed)


def _signal(batch: _Batch, signals: Mapping[str, Array], name: str) -> Array:
    """A signal inside the windows [W, N]; the speed from the angle."""
    if name != SPEED:
        return batch.inside(signals[name])
    theta = batch.folded(signals["theta_mech_rad"])
    slope = np.gradient(theta, batch.segment.ts_s, axis=1)
    return batch.inside(slope.ravel())


def _means(error: Array) -> Array:
    window = bump(error.shape[1])
    mean: Array = error @ window / window.sum()
    return mean


@dataclass(frozen=True, slots=True)
class _Jacobian:
    """The equations linearised along the measured trajectory, time first: [..., n, W] each.

    `ahead` and `behind` [2, 2]: one trapezoidal step of current, rows d and q; `emf` (complex):
    voltage a rad/s; `pull` [2]: torque an ampere; `damping` and `spring`: drag a rad/s and a rad.
    """

    ahead: Array
    behind: Array
    emf: Complex
    pull: Array
    damping: Array
    spring: Array


def _jacobian(batch: _Batch, model: Model, values: Values) -> _Jacobian:
    period = batch.segment.ts_s
    x = operate(batch.segment, batch.segment.recorded, model, values)
    shape = (batch.segment.size // batch.windows, batch.windows)
    if not batch.currents:
        none = np.zeros((2, 2, *shape))
        drag = np.full(shape, values["b_nm_s_rad"])
        return _Jacobian(none, none, none[0, 0] + 0j, none[0], drag, none[0, 0])

    def probed(step: float, **moved: Callable[[float], Any]) -> tuple[Complex, Complex, Array]:
        sides = []
        for sign in (step, -step):
            at = replace(x, **{name: move(sign) for name, move in moved.items()})
            pieces = evaluate(model, at, values)
            torque = air_gap_torque(at, pieces.psi_wb, pieces.slope_wb) - pieces.drag_nm
            sides.append((pieces.psi_wb, pieces.drop_v, torque))
        flux, drop, torque = (
            ((up - down) / (2 * step)).reshape(shape[::-1]).T
            for up, down in zip(*sides, strict=True)
        )
        return flux, drop, torque

    scales, p = model.machine.scales, model.machine.pole_pairs
    by_d = probed(_PROBE * scales["current_a"], id_a=lambda h: x.id_a + h)
    by_q = probed(_PROBE * scales["current_a"], iq_a=lambda h: x.iq_a + h)
    by_speed = probed(_PROBE * scales["speed_rad_s"], omega_rad_s=lambda h: x.omega_rad_s + h)
    by_angle = probed(
        _PROBE / p, theta_rad=lambda h: x.theta_rad + h, eps_rad=lambda h: x.eps_rad + p * h
    )
    pieces = evaluate(model, x, values)
    flux, drop = (
        np.array([[by_d[n].real, by_q[n].real], [by_d[n].imag, by_q[n].imag]]) for n in (0, 1)
    )
    omega_e = (p * x.omega_rad_s).reshape(shape[::-1]).T
    ahead, behind = _steps(flux, drop, omega_e, period)
    return _Jacobian(
        ahead,
        behind,
        (1j * p * pieces.psi_wb).reshape(shape[::-1]).T,
        np.array([by_d[2], by_q[2]]),
        np.maximum(-by_speed[2], 0.0),
        -by_angle[2],
    )


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


def _defects(
    batch: _Batch, signals: Mapping[str, Array], model: Model, values: Values
) -> tuple[Complex, Array]:
    """What the equations miss by along a trajectory: voltage over the step from each sample [W, n]
    [V], and torque at each sample [W, n] [N·m].

    The residual's central difference of the flux, which would let samples of even and odd number
    drift apart, is exchanged for the step's own difference.
    """
    segment, period = batch.segment, batch.segment.ts_s
    x = operate(segment, signals, model, values)
    pieces = evaluate(model, x, values)
    told = measured(segment, signals, model, values)
    left = told - predicted(segment, x, pieces, model, values)
    if not batch.currents:
        torque = -values["j_kgm2"] * batch.folded(left[0])
        return np.zeros(torque.shape, dtype=complex), torque
    voltage = batch.folded(left[0] + 1j * left[1])
    torque = -batch.folded(left[2]) if batch.shaft else np.zeros(voltage.shape)
    if segment.timing == "held":
        return voltage, torque
    psi = batch.folded(pieces.psi_wb)
    central = np.zeros_like(psi)
    # as the residual differences it, over the ends of the stretches too
    flat = pieces.psi_wb
    central.ravel()[1:-1] = (flat[2:] - flat[:-2]) / (2 * period)
    plain = voltage + central
    step = np.zeros_like(psi)
    step[:, :-1] = 0.5 * (plain[:, :-1] + plain[:, 1:]) - np.diff(psi, axis=1) / period
    return step, torque


def _settle(
    batch: _Batch,
    start: Mapping[str, Array],
    given: Mapping[str, Array],
    model: Model,
    values: Values,
    jacobian: _Jacobian,
    rounds: int,
    extra: tuple[Complex, Array] | None = None,
) -> tuple[dict[str, Array], NDArray[np.bool_]]:
    """Signals [n] whose currents and angle obey the equations under `given` voltage and load.

    `extra` adds to each window's voltage [W] and torque [W]. Also tells which windows [W] settled:
    their last correction was below a ten-thousandth of the machine's current.
    """
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
        voltage, torque = _defects(batch, now, model, values)
        if extra is not None:
            voltage, torque = voltage + extra[0][:, None], torque + extra[1][:, None]
        speed = begin - _central_speed(batch, now["theta_mech_rad"])
        current, angle = _corrected(batch, jacobian, voltage, torque, values["j_kgm2"], speed)
        size = np.maximum(np.abs(current) / limits[0], np.abs(angle) / limits[1]).max(axis=1)
        sound &= size < _LOST
        current[~sound], angle[~sound] = 0.0, 0.0
        for name, change in zip(_STATE, (current.real, current.imag, angle), strict=True):
            if name in names:
                now[name] = now[name] + change.ravel()
        if not (size[sound] > _SETTLED).any():
            break
    return now, sound & ((size < _SETTLED) | (rounds < _ROUNDS))


def _first_speed(batch: _Batch, theta: Array) -> Array:
    """Speed [W] at the windows' first samples, from the angle around them."""
    width = max(2 * round(_START_S / batch.segment.ts_s / 2) + 1, 5)
    half = width // 2
    folded = batch.folded(theta)
    # the slope of a straight line through the samples around
    offset = np.arange(-half, half + 1)
    around = folded[:, batch.pad - half : batch.pad + half + 1]
    slope: Array = around @ offset / float(offset @ offset) / batch.segment.ts_s
    return slope


def _central_speed(batch: _Batch, theta: Array) -> Array:
    folded = batch.folded(theta)
    slope: Array = (folded[:, batch.pad + 1] - folded[:, batch.pad - 1]) / (2 * batch.segment.ts_s)
    return slope


def _corrected(
    batch: _Batch,
    jacobian: _Jacobian,
    voltage: Complex,
    torque: Array,
    inertia: float,
    speed: Array,
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
    kick = period / inertia
    calm = 1.0 / (1.0 + kick * jacobian.damping)
    d, q = np.zeros(batch.windows), np.zeros(batch.windows)
    turn = np.zeros(batch.windows)
    with np.errstate(over="ignore", invalid="ignore"):
        for n in range(batch.pad, stop):
            if batch.shaft:
                push = jacobian.pull[0, n] * d + jacobian.pull[1, n] * q - jacobian.spring[n] * turn
                share = 0.5 if n == batch.pad else 1.0
                speed = (speed + share * kick * (torque[n] + push)) * calm[n]
                turn = turn + period * speed
                angle[n + 1] = turn
            if batch.currents:
                right = voltage[n] - jacobian.emf[n] * speed if batch.shaft else voltage[n]
                back, on = jacobian.behind[:, :, n], jacobian.ahead[:, :, n]
                rd = back[0, 0] * d + back[0, 1] * q + right.real
                rq = back[1, 0] * d + back[1, 1] * q + right.imag
                d, q = on[0, 0] * rd + on[0, 1] * rq, on[1, 0] * rd + on[1, 1] * rq
                current[n + 1] = d + 1j * q
    current[stop + 1 :], angle[stop + 1 :] = current[stop], angle[stop]
    return np.nan_to_num(current.T, nan=np.inf), np.nan_to_num(angle.T, nan=np.inf)


@dataclass(frozen=True, slots=True)
class _Response:
    """How window means of recorded less simulated move with the recording, to first order."""

    batch: _Batch
    found: Mapping[str, Array]
    model: Model
    values: Values
    jacobian: _Jacobian
    settled: NDArray[np.bool_]
    names: tuple[str, ...]

    def to(
        self, added: Mapping[str, Any], extra: tuple[Complex, Array] | None = None
    ) -> dict[str, Array]:
        """Changes [W] by what is added to recorded signals, and to each window's equations."""
        batch, recorded = self.batch, self.batch.segment.recorded
        other = {name: column + added.get(name, 0.0) for name, column in recorded.items()}
        moved, _ = _settle(
            batch, self.found, other, self.model, self.values, self.jacobian, 1, extra
        )
        changes = {}
        for name in self.names:
            after = _signal(batch, other, name) - _signal(batch, moved, name)
            before = _signal(batch, recorded, name) - _signal(batch, self.found, name)
            changes[name] = _means((after - before)[self.settled])
        return changes


def _floor(response: _Response) -> dict[str, float]:
    """Noise of the window means that the sensors alone make.

    Noise of each sensor's level is added to the recording, and to the equations the reading error
    that they are allowed.
    """
    batch = response.batch
    noise = batch.segment.noise
    total: dict[str, list[Array]] = {name: [] for name in response.names}
    for replicate in range(max(_REPLICATES, -(-_POOLED // int(response.settled.sum())))):
        rng = np.random.default_rng([_SEED, replicate])
        added = {
            name: rng.normal(0.0, sigma, batch.segment.size)
            for name, sigma in sorted(noise.items())
            if sigma > 0.0 and name in batch.segment.recorded
        }
        for name, change in response.to(added, _missed(batch, rng, response.values)).items():
            total[name].append(change**2)
    return {name: math.sqrt(float(np.mean(squares))) for name, squares in total.items()}


def _drift(response: _Response) -> dict[str, Array]:
    """Moves [K, W] of the window means with an offset of each sensor, of half its noise."""
    noise = response.batch.segment.noise
    offsets = [name for name in _OFFSETS if noise.get(name, 0.0) > 0.0]
    moves = [response.to({name: _OFFSET * noise[name]}) for name in offsets]
    return {name: np.array([move[name] for move in moves]) for name in response.names}


def _missed(batch: _Batch, rng: np.random.Generator, values: Values) -> tuple[Complex, Array]:
    """A draw of what the equations may miss by in each window [W]: voltage [V], torque [N·m]."""
    drawn = batch.allowed * rng.normal(size=batch.allowed.shape)
    if not batch.currents:
        return np.zeros(batch.windows, dtype=complex), values["j_kgm2"] * drawn[0]
    torque = drawn[2] if batch.shaft else np.zeros(batch.windows)
    return drawn[0] + 1j * drawn[1], torque
