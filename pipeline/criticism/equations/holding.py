"""A rotor held at many angles, reached from both sides: the current that holds it."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.data.holding_cells import holding_cells
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Recorded, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import net_torque
from pipeline.criticism.signals.true_state import Motion, operating, table_current, true_current
from pipeline.records.capture import Capture

_CRAWL = 1e-9
"""Speed [rad/s] of a held rotor that creeps: it has a sense and nothing else."""


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Mean angle, current and sense of arrival of every cell of the turn.

    Parameters
    ----------
    capture
        A holding current.
    machine
        Policy.

    Returns
    -------
    Segment or None
        None with too few cells; sectors of the turn are held out one by one.

    """
    cells = holding_cells(capture, machine.policy)
    if cells is None:
        return None
    return segment_of(
        capture,
        "standing",
        "drive",
        1.0,
        {"theta_mech_rad": cells.theta_mech_rad, "iq_a": cells.iq_a, "sense": cells.sense},
        Sensors({"iq_a": cells.noise_a}),
        channels=("iq_a",),
        blocks=cells.sector,
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True current of a held rotor, which creeps in the sense of its arrival.

    Parameters
    ----------
    segment
        The cells.
    signals
        Their columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    Operating
        The state [n], at a speed that has a sign and no other effect.

    """
    theta, omega = signals["theta_mech_rad"], _CRAWL * signals["sense"]
    pole_pairs = model.machine.pole_pairs
    current = np.zeros(theta.size) + 1j * signals["iq_a"]
    current = table_current(segment, current, pole_pairs * theta, pole_pairs * omega, model, values)
    motion = Motion(theta, omega, np.abs(omega) * pole_pairs / (2 * math.pi))
    return operating(segment, signals, model, values, current, motion)


def measured(segment: Segment, signals: Signals, model: Model, values: Values) -> Array:
    """The true q current, in amperes of the sensor.

    Parameters
    ----------
    segment
        The cells.
    signals
        Their columns [n].
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In A.

    """
    true = state(segment, signals, model, values).i_a.imag
    return (true / _current_slope(segment, model, values))[None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The q current that holds the rotor against its drags [1, n], in amperes of the sensor.

    Parameters
    ----------
    segment
        The cells.
    x
        True state [n].
    pieces
        Flux and drags of the model there.
    model
        Effects of its sensors.
    values
        Parameters by full name.

    Returns
    -------
    array [1, n]
        In A.

    Notes
    -----
    i_q − (T − drags)/(1.5 p ψ): what it lacks in torque is made up by more of it.

    """
    lacking = net_torque(x, pieces) / (1.5 * x.machine.pole_pairs * values["psi_wb"])
    current: Array = (x.i_a.imag - lacking) / _current_slope(segment, model, values)
    return current[None]


def _current_slope(segment: Segment, model: Model, values: Values) -> float:
    """True q ampere a recorded one.

    By it residuals of a current are reported in the sensor's own units; else a gain could win by
    shrinking the residual that it is blamed for.
    """
    zero = np.zeros(4)
    nothing, ampere = (
        Recorded(current, zero, zero, zero, segment.ts_s, False, segment.instrument.name)
        for current in (zero.astype(np.complex128), np.full(4, 1j))
    )
    meter = segment.instrument.ammeter
    base, moved = (true_current(recorded, meter, model, values) for recorded in (nothing, ampere))
    return float((moved - base)[0].imag)


EQUATION = Equation(
    name="standing",
    words="1.5 p [Im(ψ* i) + ∂W/∂ε] = drags",
    tests=("holding_current",),
    columns=("theta_mech_rad", "iq_a"),
    channels=(Channel("iq_a"),),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("psi_wb",),
        hooks=frozenset({"flux", "torque"}),
        sensors=frozenset({"current"}),
        form="affine",
    ),
    use=Use(shows=frozenset({"current", "turning"})),
)
