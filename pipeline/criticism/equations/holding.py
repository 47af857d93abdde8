"""A rotor held at many angles, reached from both sides: the current that holds it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.holding_cells import holding_cells
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces, evaluate
from pipeline.criticism.operating import Array, Operating, Recorded, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.shaft import net_torque
from pipeline.criticism.signals.true_current import true_current
from pipeline.criticism.signals.true_state import Motion, operating
from pipeline.records.capture import Capture

_CRAWL = 1e-9
"""Speed [rad/s] of a held rotor that creeps: it has a sense and nothing else."""
_ROUNDS = 2
"""Times that the holding current is worked out from drags that may depend on it."""


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

    Notes
    -----
    Friction of a rotor at rest is whatever holds it, up to stiction, and not that of one that
    turns. So the difference of the current between the senses is that of running friction to a
    share `rest_share` of itself.

    """
    cells = holding_cells(capture, machine.policy)
    if cells is None:
        return None
    half = machine.policy.tables.rest_share * float(np.mean(cells.sense * cells.iq_a))
    return segment_of(
        capture,
        "standing",
        "drive",
        1.0,
        {"theta_mech_rad": cells.theta_mech_rad, "iq_a": cells.iq_a, "sense": cells.sense},
        Sensors({"iq_a": cells.noise_a}),
        channels=("iq_a",),
        blocks=cells.sector,
        offsets=(cells.sense * half)[None],
    )


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """State of a held rotor, which creeps in the sense of its arrival.

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
        The state [n], at a speed that has a sign and no other effect, and with the current that
        holds the rotor by the model. By the recorded one, a friction that grows with the torque
        would take its share of the residual, noise and all.

    """
    theta, omega = signals["theta_mech_rad"], _CRAWL * signals["sense"]
    pairs = model.machine.pole_pairs
    motion = Motion(theta, omega, np.abs(omega) * pairs / (2 * math.pi))
    none = np.zeros(theta.size, dtype=complex)
    x = operating(segment, signals, model, values, none, motion)
    for _ in range(_ROUNDS):
        pieces = evaluate(model, x, values, frozenset({"flux", "torque"}))
        x = replace(x, iq_a=_holding(x, pieces, values))
    return x


def _holding(x: Operating, pieces: Pieces, values: Values) -> Array:
    """The q current [n, A] that balances the drags, which are those at the current of `x`."""
    lacking = net_torque(x, pieces, values) / (1.5 * x.machine.pole_pairs * values["psi_wb"])
    current: Array = x.i_a.imag - lacking
    return current


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
    pairs = model.machine.pole_pairs
    eps, omega = pairs * signals["theta_mech_rad"], pairs * _CRAWL * signals["sense"]
    zero = values["zero_alpha_a"] + 1j * values["zero_beta_a"]
    current = 1j * signals["iq_a"] - zero * np.exp(-1j * eps)
    # of a drive: the sensors of its phases turn against the rotor that it holds
    read = Recorded(
        current, np.zeros(eps.size), eps, omega, segment.ts_s, True, segment.instrument.name
    )
    true = true_current(read, segment.instrument.ammeter, model, values)
    return (true.imag / _current_slope(segment, model, values))[None]


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """The q current that holds the rotor against its drags [1, n], in amperes of the sensor.

    Parameters
    ----------
    segment
        The cells.
    x
        State [n].
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
    return (_holding(x, pieces, values) / _current_slope(segment, model, values))[None]


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
        ("psi_wb", "zero_alpha_a", "zero_beta_a"),
        hooks=frozenset({"flux", "torque"}),
        sensors=frozenset({"current"}),
        form="affine",
    ),
    use=Use(turns=True),
)
