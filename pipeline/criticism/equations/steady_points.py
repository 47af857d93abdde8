"""A table of settled points of a turning shaft: voltages and torque, each a mean over turns."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import combinations_with_replacement

import numpy as np

from pipeline.criticism.data.levels import parts_of
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import as_sensed, net_torque
from pipeline.criticism.signals.true_current import table_current
from pipeline.criticism.signals.true_state import Motion, operating
from pipeline.criticism.signals.voltage import recorded_voltage
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Capture

SPEED = "omega_mech_rad_s"
VOLTAGES, TORQUE = ("vd_v", "vq_v"), "torque_shaft_nm"
_BESIDE = ("temp_winding_degc", "temp_magnet_degc")


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Rows of a table with a speed that is not zero.

    Parameters
    ----------
    capture
        A table without a clock.
    machine
        Policy of tables.

    Returns
    -------
    Segment or None
        None of a clamped shaft, and with too few rows for their scatter; levels of q current, or
        parts of its sweep, are held out one by one.

    Notes
    -----
    The noise of a signal is its scatter about a polynomial of both currents and the speed, of the
    third order where there are rows enough for it, else of the second.

    """
    channels = tuple(n for n in (*VOLTAGES, TORQUE) if capture.has(n))
    channels = channels if capture.has(*VOLTAGES, "id_a") else (TORQUE,)
    beside = (name for name in ("id_a", *_BESIDE) if capture.has(name))
    needed = ("iq_a", SPEED, *channels)
    columns = capture.finite(*needed, *beside, needed=needed)
    policy = machine.policy.tables
    parts = parts_of(columns["iq_a"], policy)
    if parts is None or not capture.turning:
        return None
    surface = _surface(columns)
    if surface is None:
        return None
    noise = {
        name: max(_scatter(surface, columns[name]), policy.reading * _size(columns[name]))
        for name in channels
    }
    currents = policy.reading * max(_size(columns[n]) for n in ("id_a", "iq_a") if n in columns)
    noise |= {name: currents for name in ("id_a", "iq_a") if name in columns}
    segment = segment_of(
        capture,
        "points",
        "drive",
        1.0,
        columns,
        Sensors(noise),
        channels=channels,
        blocks=parts,
    )
    return replace(segment, sensors=replace(segment.sensors, angle_step_rad=0.0))


def _size(column: Array) -> float:
    return max(float(np.abs(column).max(initial=0.0)), 1e-300)


def _surface(columns: Signals) -> Array | None:
    """Terms [n, k] of a polynomial of currents and speed; None with fewer than two rows a term."""
    names = ("iq_a", SPEED, *(["id_a"] if "id_a" in columns else []))
    axes = [columns[name] / _size(columns[name]) for name in names]
    ones = np.ones(axes[0].size)
    for order in (3, 2):
        terms: list[Array] = [ones, np.sign(columns[SPEED])]
        for count in range(1, order + 1):
            for some in combinations_with_replacement(axes, count):
                term = ones
                for axis in some:
                    term = term * axis
                terms.append(term)
        design: Array = np.column_stack(terms)
        if ones.size >= 2 * int(np.linalg.matrix_rank(design)):
            return design
    return None


def _scatter(surface: Array, column: Array) -> float:
    """Standard deviation of a column [n] about its polynomial."""
    fitted, _, rank, _ = np.linalg.lstsq(surface, column, rcond=1e-9)
    left = column - surface @ fitted
    return float(np.sqrt(left @ left / max(column.size - int(rank), 1)))


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True currents and motion at points of a turn of every row [n m].

    Parameters
    ----------
    segment
        The table.
    signals
        Recorded columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        At `mean_points` angles a row.

    """
    count, size = model.policy.tables.turn_points, signals["iq_a"].size
    # angles that are apart by the golden section are spread evenly, whatever their number
    theta = TURN_RAD * np.mod((math.sqrt(5.0) - 1.0) / 2.0 * np.arange(size * count), 1.0)
    omega = np.repeat(signals[SPEED], count)
    current = np.repeat(signals.get("id_a", np.zeros(size)) + 1j * signals["iq_a"], count)
    pairs = model.machine.pole_pairs
    current = table_current(segment, current, pairs * theta, pairs * omega, model, values)
    motion = Motion(theta, omega, np.abs(omega) * pairs / TURN_RAD)
    return operating(segment, signals, model, values, current, motion)


def measured(segment: Segment, signals: Signals, _: Model, __: Values) -> Array:
    """Voltages and torque [C, n; V, N·m]."""
    return np.stack([signals[name] for name in segment.channels])


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Voltages and torque [C, n], means over the angles of each row.

    Parameters
    ----------
    segment
        The table.
    x
        True state [n m].
    pieces
        Flux, drops and drags of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        In V and N·m.

    Notes
    -----
    v = R i + drops + j ω_e ψ, T = 1.5 p Im(ψ* i) − drags: what changes with the angle has no mean.

    """
    steady = pieces.drop_v + 1j * x.machine.pole_pairs * x.omega_rad_s * pieces.psi_wb
    volts = recorded_voltage(steady, segment, x, model, values)
    signals = {"vd_v": volts.real, "vq_v": volts.imag}
    if TORQUE in segment.channels:
        signals[TORQUE] = as_sensed(segment, net_torque(x, pieces, values), model, values)
    rows = (signals[name].reshape(segment.size, -1) for name in segment.channels)
    return np.stack([row.mean(axis=1) for row in rows])


EQUATION = Equation(
    name="points",
    words="v = R i + drops + j ω_e ψ, T = 1.5 p Im(ψ* i) − drags",
    tests=("torque_table",),
    columns=("iq_a", SPEED, TORQUE),
    channels=(
        Channel("vd_v", "voltage_v", offset="voltmeter"),
        Channel("vq_v", "voltage_v", offset="voltmeter"),
        Channel(TORQUE, "torque_nm", offset="transducer"),
    ),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("r_ohm", "ld_h", "lq_h", "psi_wb", "b_nm_s_rad"),
        hooks=frozenset({"flux", "drop", "torque"}),
        sensors=frozenset({"current", "voltage", "load"}),
        torque_in=TORQUE,
        form="neither",
    ),
    use=Use(turns=True),
)
