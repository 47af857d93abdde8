"""A table of flux linkages over currents, without a clock."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.data.levels import levels_of
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes, Use
from pipeline.criticism.machine.model import Model, Pieces
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.policy.captures import Tables
from pipeline.criticism.signals.true_current import table_current
from pipeline.criticism.signals.true_state import at_rest, operating
from pipeline.criticism.signals.voltage import recorded_voltage
from pipeline.records.capture import Capture

LINKAGES = ("psi_d_wb", "psi_q_wb")


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """Flux linkages of both axes, or of a sweep along one axis.

    Parameters
    ----------
    capture
        A flux map.
    machine
        Policy of tables.

    Returns
    -------
    Segment or None
        None where neither current, or neither linkage, varies. Rows of one d current are held out
        together, since a map is often its own mirror image in i_q.

    """
    names = ("id_a", "iq_a", *LINKAGES)
    columns = capture.finite(*names)
    policy = machine.policy.tables
    noise = _axes_noise(columns, names[:2], policy) | _axes_noise(columns, names[2:], policy)
    if not all(noise.values()):
        return None
    levels = levels_of(columns["id_a"])
    # rows of one d current are held out together: a map is often its own mirror image in i_q
    blocks = levels if levels.max(initial=0) + 1 >= policy.levels else None
    return segment_of(
        capture, "flux_map", "drive", 1.0, columns, Sensors(noise), channels=LINKAGES, blocks=blocks
    )


def _axes_noise(columns: Signals, names: tuple[str, ...], policy: Tables) -> dict[str, float]:
    """A share of an axis's range, or a tenth of the other's at least: one instrument reads both."""
    ranges = {name: float(np.ptp(columns[name])) for name in names}
    least = policy.other_axis * max(ranges.values())
    return {name: policy.flux_share * max(span, least) for name, span in ranges.items()}


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """True currents of the rows of a table.

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
        The state [n] of a rotor at rest.

    """
    current = signals["id_a"] + 1j * signals["iq_a"]
    motion = at_rest(current.size)
    current = table_current(segment, current, motion.theta_rad, motion.omega_rad_s, model, values)
    return operating(segment, signals, model, values, current, motion)


def measured(_: Segment, signals: Signals, __: Model, ___: Values) -> Array:
    """Both flux linkages [2, n, Wb]."""
    return np.stack([signals[name] for name in LINKAGES])


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Both flux linkages [2, n, Wb].

    Notes
    -----
    ψ = ∂W/∂i. They are integrals of a voltage, so that the voltmeter's gain is in them.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines).

    """
    psi = recorded_voltage(pieces.psi_wb, segment, x, model, values)
    return np.stack([psi.real, psi.imag])


EQUATION = Equation(
    name="flux_map",
    words="ψ = ∂W/∂i",
    tests=("flux_map",),
    columns=("id_a", "iq_a", "psi_d_wb", "psi_q_wb"),
    channels=(Channel("psi_d_wb", beside=LINKAGES), Channel("psi_q_wb", beside=LINKAGES)),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(
        ("ld_h", "lq_h", "psi_wb"),
        hooks=frozenset({"flux"}),
        sensors=frozenset({"current", "voltage"}),
    ),
    # where there are logs to predict it from, a table is held out as a whole
    use=Use(turns=True, whole_beside=("dq",)),
)
