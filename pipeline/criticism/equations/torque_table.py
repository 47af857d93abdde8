"""A table of torque against current of a clamped shaft: no time, no voltage."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.levels import levels_of, parts_of
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import as_sensed, net_torque
from pipeline.criticism.signals.true_current import table_current
from pipeline.criticism.signals.true_state import Motion, operating
from pipeline.records.capture import Capture

TORQUE = "torque_shaft_nm"
_BESIDE = ("id_a", "theta_mech_rad", "temp_magnet_degc")
"""Columns that are used where they are there."""


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Rows of a table of torque against current.

    Parameters
    ----------
    capture
        A table without a clock.
    machine
        Policy of tables.

    Returns
    -------
    Segment or None
        None with too few levels of current or too few rows, and of a shaft that turns
        (`steady_points`); levels, or parts of a sweep, are held out one by one.

    Notes
    -----
    The noise is the scatter about T0 + k i_q + s i_q³, and with d currents (r + t i_d) i_d i_q,
    with a curve for every rotor angle: friction that holds torque back on the way up and down is in
    it. The zero of the transducer, and the
    weight of an arm, is an offset that the table may have.

    """
    names = ("iq_a", TORQUE, *(name for name in _BESIDE if capture.has(name)))
    columns = capture.finite(*names)
    policy = machine.policy.tables
    if capture.turning:
        return None
    torque, parts = columns[TORQUE], parts_of(columns["iq_a"], policy)
    noise = None if parts is None else _noise(columns, policy.reading)
    if noise is None:
        return None
    segment = segment_of(
        capture,
        "torque_table",
        "drive",
        1.0,
        columns,
        Sensors({TORQUE: noise}),
        channels=(TORQUE,),
        blocks=parts,
        offsets=np.full((1, torque.size), float(np.abs(torque).max())),
    )
    # angles that were set stand apart by more than the encoder's step
    return replace(segment, sensors=replace(segment.sensors, angle_step_rad=0.0))


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True currents [n] of a shaft that is clamped at the rows' angles."""
    zero = np.zeros(signals["iq_a"].size)
    theta = signals.get("theta_mech_rad", zero)
    current = signals.get("id_a", zero) + 1j * signals["iq_a"]
    eps = model.machine.pole_pairs * theta
    current = table_current(segment, current, eps, zero, model, values)
    return operating(segment, signals, model, values, current, Motion(theta, zero, zero))


def measured(_: Segment, signals: Signals, __: Model, ___: Values) -> Array:
    """The torque [1, n, N·m]; without time its transducer has no dynamics."""
    return signals[TORQUE][None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The torque that the transducer shows [1, n, N·m].

    Notes
    -----
    1.5 p [Im(ψ* i) + ∂W/∂ε] − drags, which is Kt i_q with Kt = 1.5 p ψ_m at small current.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines: torque of a blocked rotor).

    """
    return as_sensed(segment, net_torque(x, pieces, values), model, values)[None]


def _noise(columns: Signals, reading: float) -> float | None:
    """Standard deviation [N·m] of the torques about their curves; None with too few rows."""
    torque, curve = columns[TORQUE], _curve(columns)
    angles = columns.get("theta_mech_rad")
    place = np.zeros(torque.size, dtype=np.int64) if angles is None else levels_of(angles)
    terms = curve.shape[1]
    if torque.size < 2 * terms * (int(place.max()) + 1):
        place = np.zeros(torque.size, dtype=np.int64)
    free = torque.size - terms * (int(place.max()) + 1)
    if free < 1:
        return None
    power = sum(_about(curve[place == k], torque[place == k]) for k in np.unique(place))
    least = max(reading * float(np.abs(torque).max()), 1e-12)
    return max(math.sqrt(power / free), least)


def _curve(columns: Signals) -> Array:
    """Terms [n, k] of the torque over the currents: offset, slope and sag; with d currents those of
    a reluctance that saturates.
    """
    q = _of_range(columns["iq_a"])
    terms = [np.ones(q.size), q, q**3]
    d = _of_range(columns.get("id_a", np.zeros(q.size)))
    return np.column_stack([*terms, d * q, d**2 * q] if np.ptp(d) > 0.0 else terms)


def _of_range(current: Array) -> Array:
    """A current [n] over the largest of its size."""
    return current / max(float(np.abs(current).max()), 1e-300)


def _about(curve: Array, torque: Array) -> float:
    """Sum of squares [N²·m²] of what a curve [n, k] leaves of torques [n]."""
    residual = torque - curve @ np.linalg.lstsq(curve, torque, rcond=None)[0]
    return float(residual @ residual)


EQUATION = Equation(
    name="torque_table",
    words="T = 1.5 p [Im(ψ* i) + ∂W/∂ε] − drags of a clamped shaft",
    tests=("torque_table",),
    columns=("iq_a", TORQUE),
    channels=(Channel(TORQUE, "torque_nm"),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("ld_h", "lq_h", "psi_wb"),
        hooks=frozenset({"flux", "torque"}),
        sensors=frozenset({"current", "load"}),
        torque_in=TORQUE,
    ),
    use=Use(whole_beside=("dq",)),
)
