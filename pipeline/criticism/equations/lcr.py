"""An LCR meter across a pair of terminals, over the rotor's angle."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from pipeline.criticism.data.rounding import resolution
from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.equation import Channel, Equation, Observes
from pipeline.criticism.machine.model import PHASE_LCR, Model, Pieces, evaluate
from pipeline.criticism.operating import Array, Operating, Signals, Values
from pipeline.criticism.parameter import Machine
from pipeline.criticism.signals.true_state import Motion, operating
from pipeline.records.capture import Capture

_PROBE = 1e-3
"""Current of the meter, as a share of the machine's: small against what saturates."""


def cut(capture: Capture, machine: Machine) -> Segment | None:
    """A table over the angle.

    Parameters
    ----------
    capture
        An LCR table of pair ab.
    machine
        Policy.

    Returns
    -------
    Segment or None
        None with fewer than six angles.

    Notes
    -----
    Its noise is the scatter about a mean and two waves a turn, but never less than the rounding of
    its last digit, or a ten-thousandth of the largest reading.

    """
    names = ["theta_elec_deg", "lab_h"] + [n for n in ("rab_ohm", "freq_hz") if capture.has(n)]
    columns = capture.finite(*names)
    angle = 2 * np.radians(columns["theta_elec_deg"])
    basis = np.stack([np.ones(angle.size), np.cos(angle), np.sin(angle)], axis=1)
    if angle.size < 6:
        return None
    noise, policy = {}, machine.policy
    for name in names[1:]:
        fit = basis @ np.linalg.lstsq(basis, columns[name], rcond=None)[0]
        scatter = math.sqrt(float(((columns[name] - fit) ** 2).sum()) / (angle.size - 3))
        least = policy.tables.reading * float(np.abs(columns[name]).max())
        noise[name] = max(
            scatter, resolution(columns[name], machine.policy.sensor_noise) / math.sqrt(12), least
        )
    channels = tuple(n for n in ("lab_h", "rab_ohm") if n in columns)
    return segment_of(capture, "lcr", "lcr", 1.0, columns, Sensors(noise), channels=channels)


def begins(segment: Segment, machine: Machine) -> dict[str, float]:
    """The winding that the meter shows, where no other test may say how large it is.

    Parameters
    ----------
    segment
        The table.
    machine
        Not used.

    Returns
    -------
    dict of float
        Half the mean line values, for both axes [H], and with its channel the resistance [ohm].

    """
    del machine
    half = {name: 0.5 * float(np.mean(segment.recorded[name])) for name in segment.channels}
    known = {"ld_h": half["lab_h"], "lq_h": half["lab_h"]}
    return known | ({"r_ohm": half["rab_ohm"]} if "rab_ohm" in half else {})


def state(segment: Segment, signals: Signals, model: Model, values: Values) -> Operating:
    """A rotor at rest at each angle [n], without current, at the meter's frequency."""
    eps = np.radians(signals["theta_elec_deg"])
    zero = np.zeros(eps.size)
    motion = Motion(zero, zero, signals.get("freq_hz", zero))
    x = operating(segment, signals, model, values, zero.astype(np.complex128), motion)
    return replace(x, eps_rad=eps)


def measured(segment: Segment, signals: Signals, _: Model, __: Values) -> Array:
    """What the meter shows [C, n, H and ohm]."""
    return np.stack([signals[channel] for channel in segment.channels])


def predicted(
    segment: Segment, x: Operating, pieces: Pieces, model: Model, values: Values
) -> Array:
    """Incremental line inductance and resistance [C, n] at zero current, pair ab.

    Parameters
    ----------
    segment
        The table.
    x
        State at rest at each angle [n].
    pieces
        Not used: flux and drop are evaluated at two small currents.
    model
        The model.
    values
        Parameters by full name.

    Returns
    -------
    array [C, n]
        Line inductance [H], and with its channel the line resistance [ohm].

    Notes
    -----
    A unit of current through ab is i = (2/√3) e^{−j(30° + ε)} in the rotor frame, and the line
    voltage is √3 Re[v e^{j(30° + ε)}]. The meter shows an impedance of a gain and a phase of its
    own: an error δ of the phase is one of −δ ω L in the resistance, Q times as large a share of it.

    References
    ----------
    Keysight Technologies, Impedance Measurement Handbook, 6th ed. (accuracy of R_s at a Q).

    """
    del pieces
    probe = _PROBE * x.machine.scales["current_a"]
    direction = 2 / math.sqrt(3) * np.exp(-1j * (math.pi / 6 + x.eps_rad))
    sides = []
    for sign in (1.0, -1.0):
        at = replace(x, id_a=sign * probe * direction.real, iq_a=sign * probe * direction.imag)
        sides.append(evaluate(model, at, values))
    back = math.sqrt(3) * np.exp(1j * (math.pi / 6 + x.eps_rad))
    rows = {
        "lab_h": ((sides[0].psi_wb - sides[1].psi_wb) / (2 * probe) * back).real,
        "rab_ohm": ((sides[0].drop_v - sides[1].drop_v) / (2 * probe) * back).real,
    }
    hz = np.where(x.freq_hz > 0.0, x.freq_hz, model.policy.tables.lcr_hz)
    reactance, late = 2.0 * math.pi * hz, values[PHASE_LCR]
    shown = {
        "lab_h": rows["lab_h"] + late * rows["rab_ohm"] / reactance,
        "rab_ohm": rows["rab_ohm"] - late * reactance * rows["lab_h"],
    }
    return (1.0 + values["gain_lcr"]) * np.stack([shown[c] for c in segment.channels])


EQUATION = Equation(
    name="lcr",
    words="L_ab, R_ab: slopes of flux and drop over a small current through ab",
    tests=("lcr",),
    columns=("theta_elec_deg", "lab_h"),
    channels=(Channel("lab_h"), Channel("rab_ohm")),
    cut=cut,
    state=state,
    measured=measured,
    predicted=predicted,
    observes=Observes(("r_ohm", "ld_h", "lq_h"), sensors=frozenset({"lcr"}), form="neither"),
    begins=begins,
)
