"""Free-running simulation: currents and speed that the model makes of recorded voltages and load.

Every window starts from the measured state and is then left to the model's own equations,

    dψ/dt = v − R i − drops − jω_e ψ,      J dω/dt = T(ψ, i) − drags − T_load,

with every effect and sensor of the model in place.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Complex, Flags, Signals, Values
from pipeline.criticism.validation.trajectories import (
    Batch,
    Jacobian,
    batch_of,
    jacobian_of,
    settle,
)
from pipeline.numerics.projection import bump

SPEED = "omega_mech_rad_s"
_OFFSETS = ("vd_v", "vq_v", "id_a", "iq_a", "torque_shaft_nm")
"""Signals whose sensors may have an offset."""
_SEED = 20261121


@dataclass(frozen=True, slots=True)
class Run:
    """Simulated beside recorded signals of the windows of one capture.

    Attributes
    ----------
    capture
        The capture.
    t_s
        Instants [W, N].
    recorded, simulated
        `id_a` and `iq_a` of a capture under current; `omega_mech_rad_s` where load and angle are
        recorded or the shaft coasts [W, N].
    floor
        Noise floor of the window means of each signal.
    drift
        How they move with the offset of each sensor, of its prior size [K, W].

    """

    capture: str
    t_s: Array
    recorded: Signals
    simulated: Signals
    floor: Mapping[str, float]
    drift: Signals

    @property
    def signals(self) -> tuple[str, ...]:
        """What was simulated."""
        return tuple(self.simulated)

    def errors(self, signal: str) -> Array:
        """Recorded less simulated as means under a smooth window.

        Parameters
        ----------
        signal
            One of `signals`.

        Returns
        -------
        array [W]
            Unit of the signal.

        Notes
        -----
        Offsets of the capture's sensors are taken out as far as their priors allow: the means are
        whitened by 1 + Σ d d' over the drifts d, as the equations' residuals are.

        """
        floor = max(self.floor[signal], 1e-300)
        error = _means(self.recorded[signal] - self.simulated[signal]) / floor
        if not self.drift[signal].size:
            return error * floor
        axes, size, _ = np.linalg.svd((self.drift[signal] / floor).T, full_matrices=False)
        absorbed = axes @ ((1.0 - 1.0 / np.sqrt(1.0 + size**2)) * (axes.T @ error))
        return (error - absorbed) * floor


def free_run(segment: Segment, model: Model, values: Values) -> Run | None:
    """The model on its own over the windows of one capture.

    Parameters
    ----------
    segment
        Of the capture.
    model, values
        With every effect and sensor in place.

    Returns
    -------
    Run or None
        None if the equation has no free run of the test (`equation.Use`), if the sample period is
        longer than the electrical time constant, or if fewer than half of the trajectories settle.

    Notes
    -----
    Every window starts from the measured state: dψ/dt = v − R i − drops − j ω_e ψ and
    J dω/dt = T(ψ, i) − drags − T_load.

    """
    moved = _response(segment, model, values)
    if moved is None:
        return None
    measured = moved.inside(moved.batch.segment.recorded)
    floor, drift = _floor(moved), _drift(moved)
    return Run(segment.capture, moved.time(), measured, moved.inside(moved.path), floor, drift)


def beside(run: Run, segment: Segment, model: Model, values: Values) -> dict[str, Array]:
    """What another model makes of the windows of a free run.

    Parameters
    ----------
    run
        The free run of one model.
    segment
        Of its capture.
    model, values
        The other model.

    Returns
    -------
    dict of str to array [W, N]
        Like `run.simulated`; NaN in windows in which the other model does not settle. Empty where
        it has no free run of these windows.

    """
    moved = _response(segment, model, values)
    if moved is None or moved.time().shape[1] != run.t_s.shape[1]:
        return {}
    windows = {float(time[0]): number for number, time in enumerate(moved.time())}
    known = [windows.get(float(time[0])) for time in run.t_s]
    rows = np.array([-1 if number is None else number for number in known])
    simulated = moved.inside(moved.path)
    return {
        name: np.where(rows[:, None] < 0, np.nan, simulated[name][rows])
        for name in run.signals
        if name in simulated
    }


def _response(segment: Segment, model: Model, values: Values) -> _Response | None:
    """The trajectories of a model over the windows of a capture; None as `free_run` says."""
    use = equation_of(segment).use
    if segment.test not in use.free_runs:
        return None
    quasi_static = segment.ts_s * values["r_ohm"] > min(values["ld_h"], values["lq_h"])
    batch = None if quasi_static and use.currents else batch_of(segment, model, values)
    if batch is None:
        return None
    recorded = batch.segment.recorded
    jacobian = jacobian_of(batch)
    most = model.policy.validation.most_rounds
    path, settled = settle(batch, jacobian, recorded, recorded, most)
    if 2 * settled.sum() < batch.windows:
        return None
    names = ("id_a", "iq_a") * batch.currents + (SPEED,) * batch.shaft
    return _Response(batch, path, jacobian, settled, names)


def _signal(batch: Batch, signals: Signals, name: str) -> Array:
    """A signal inside the windows [W, N]; the speed from the angle."""
    if name != SPEED:
        return batch.inside(signals[name])
    theta = batch.folded(signals["theta_mech_rad"])
    slope = np.gradient(theta, batch.segment.ts_s, axis=1)
    return batch.inside(slope.ravel())


def _means(error: Array) -> Array:
    window = bump(error.shape[1])
    return error @ window / window.sum()


@dataclass(frozen=True, slots=True)
class _Response:
    """How window means of recorded less simulated move with the recording, to first order."""

    batch: Batch
    path: Signals
    jacobian: Jacobian
    settled: Flags
    names: tuple[str, ...]

    def inside(self, signals: Mapping[str, Array]) -> dict[str, Array]:
        """The simulated signals inside the windows that settled [W, N]."""
        return {name: _signal(self.batch, signals, name)[self.settled] for name in self.names}

    def time(self) -> Array:
        """The instants inside those windows [W, N, s]."""
        segment = self.batch.segment
        even = segment.ts_s * np.arange(segment.size, dtype=np.float64)
        return self.batch.inside(segment.recorded.get("t_s", even))[self.settled]

    def to(
        self, added: Mapping[str, Any], extra: tuple[Complex, Array] | None = None
    ) -> dict[str, Array]:
        """Changes [W] by what is added to recorded signals, and to each window's equations."""
        batch, recorded = self.batch, self.batch.segment.recorded
        other = {name: column + added.get(name, 0.0) for name, column in recorded.items()}
        moved, _ = settle(batch, self.jacobian, self.path, other, 1, extra)
        changes = {}
        for name in self.names:
            after = _signal(batch, other, name) - _signal(batch, moved, name)
            before = _signal(batch, recorded, name) - _signal(batch, self.path, name)
            changes[name] = _means((after - before)[self.settled])
        return changes


def _floor(response: _Response) -> dict[str, float]:
    """Noise of the window means that the sensors alone make.

    Noise of each sensor's level is added to the recording, and the reading error that equations are
    allowed is added to the equations.
    """
    batch = response.batch
    noise = batch.segment.sensors.noise
    policy = response.batch.model.policy.validation
    total: dict[str, list[Array]] = {name: [] for name in response.names}
    for replicate in range(
        max(policy.run_replicates, -(-policy.run_pooled // int(response.settled.sum())))
    ):
        rng = np.random.default_rng([_SEED, replicate])
        added = {
            name: rng.normal(0.0, sigma, batch.segment.size)
            for name, sigma in sorted(noise.items())
            if sigma > 0.0 and name in batch.segment.recorded
        }
        for name, change in response.to(added, _missed(batch, rng)).items():
            total[name].append(change**2)
    return {name: math.sqrt(float(np.mean(squares))) for name, squares in total.items()}


def _drift(response: _Response) -> dict[str, Array]:
    """Moves [K, W] of the window means with an offset of each sensor, of its prior size."""
    noise = response.batch.segment.sensors.noise
    prior = response.batch.model.policy.noise_floors.offset
    offsets = [name for name in _OFFSETS if noise.get(name, 0.0) > 0.0]
    moves = [response.to({name: prior * noise[name]}) for name in offsets]
    return {name: np.array([move[name] for move in moves]) for name in response.names}


def _missed(batch: Batch, rng: np.random.Generator) -> tuple[Complex, Array]:
    """A draw of what the equations may miss by in each window [W]: voltage [V], torque [N·m]."""
    drawn = batch.allowed * rng.normal(size=batch.allowed.shape)
    if not batch.currents:
        return np.zeros(batch.windows, dtype=complex), batch.values["j_kgm2"] * drawn[0]
    torque = drawn[2] if batch.shaft else np.zeros(batch.windows)
    return drawn[0] + 1j * drawn[1], torque
