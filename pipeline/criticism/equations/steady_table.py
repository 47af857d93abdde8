"""A table of steady q voltages at levels of d current, each at several speeds, without a clock."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.data.levels import set_levels
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.true_current import table_current
from pipeline.criticism.signals.true_state import Motion, operating
from pipeline.criticism.signals.voltage import recorded_voltage
from pipeline.records.capture import Capture


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Steady q voltages at levels of d current, each at several speeds.

    Parameters
    ----------
    capture
        A table without a clock.
    machine
        Policy of tables.

    Returns
    -------
    Segment or None
        None where `flux_map` takes it, and with too few rows a level.

    Notes
    -----
    Each level has a free offset, since what the inverter drops along q depends on the current. The
    noise is the scatter of a level's voltages about a straight line over speed.

    """
    if capture.has("id_a", "iq_a", "psi_d_wb", "psi_q_wb"):
        return None
    columns = capture.finite("id_a", "omega_mech_rad_s", "vq_v")
    levels = set_levels(columns["id_a"], machine.policy.tables)
    count = int(levels.max(initial=0)) + 1
    freedom = columns["vq_v"].size - 2 * count
    if freedom < count:
        return None
    volts = columns["vq_v"]
    power = sum(
        _scatter(columns["omega_mech_rad_s"][levels == k], volts[levels == k]) for k in range(count)
    )
    least = machine.policy.tables.steady_reading * float(np.abs(volts).max())
    noise = {"vq_v": max(math.sqrt(power / freedom), least)}
    offsets = np.abs(volts).max() * (levels[None, :] == np.arange(count)[:, None])
    return segment_of(
        capture,
        "steady",
        "drive",
        1.0,
        columns,
        Sensors(noise),
        channels=("vq_v",),
        blocks=levels,
        offsets=offsets.astype(float),
    )


def _scatter(speed: Array, volts: Array) -> float:
    """Sum of squares of one level's voltages about a straight line over speed."""
    design = np.column_stack([np.ones(speed.size), speed])
    residual = volts - design @ np.linalg.lstsq(design, volts, rcond=None)[0]
    return float(residual @ residual)


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True currents and speed [n] of a table's rows."""
    omega = signals["omega_mech_rad_s"]
    zero = np.zeros(omega.size)
    electrical = model.machine.pole_pairs * omega
    electrical_zero = model.machine.pole_pairs * zero
    current = signals["id_a"] + 1j * zero
    current = table_current(segment, current, electrical_zero, electrical, model, values)
    freq = np.abs(omega) * model.machine.pole_pairs / (2 * math.pi)
    return operating(segment, signals, model, values, current, Motion(zero, omega, freq))


def measured(_: Segment, signals: Signals, __: Model, ___: Values) -> Array:
    """The q voltage [1, n, V]."""
    return signals["vq_v"][None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The q voltage [1, n, V].

    Parameters
    ----------
    segment
        The table.
    x
        True state [n].
    pieces
        Flux and drops of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In V.

    Notes
    -----
    v_q = Im(R i + drops + j ω_e ψ), with dψ/dt = 0; ω_e L_d i_d is the part that levels of d
    current show.

    """
    steady = pieces.drop_v + 1j * x.machine.pole_pairs * x.omega_rad_s * pieces.psi_wb
    return recorded_voltage(steady, segment, x, model, values).imag[None]


EQUATION = Equation(
    name="steady",
    words="v_q = Im(R i + drops + j ω_e ψ)",
    tests=("flux_map",),
    columns=("id_a", "omega_mech_rad_s", "vq_v"),
    channels=(Channel("vq_v", "voltage_v"),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("r_ohm", "ld_h", "psi_wb"),
        hooks=frozenset({"flux", "drop"}),
        sensors=frozenset({"current", "voltage"}),
    ),
    use=Use(turns=True),
)
