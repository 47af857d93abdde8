"""Errors of the angle sensor: zero and lateness of a drive's encoder, and effects of a model."""

from __future__ import annotations

import numpy as np

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Complex, Operating, Values

_ERRORS = ("zero_angle_rad", "late_angle_s", "bend_angle_s2")


def zero_angle(segment: Segment, x: Operating, values: Values) -> Array | None:
    """Recorded less true electrical angle of a drive's encoder that has its zero elsewhere and is
    read later than the currents.

    Parameters
    ----------
    segment
        Any segment.
    x
        State with its speed [n].
    values
        Parameters by full name.

    Returns
    -------
    array [n] or None
        In rad; None unless it is a drive's log of both currents, and where all of it is zero.

    """
    zero_rad, late_s = values["zero_angle_rad"], values["late_angle_s"]
    if not (zero_rad or late_s) or not both_axes(segment):
        return None
    return zero_rad - late_s * (x.machine.pole_pairs * x.omega_rad_s)


def frame_angle(segment: Segment, x: Operating, values: Values) -> Array | None:
    """Angle of a drive's frame less the true electrical one: that of its encoder, which a loop
    follows.

    Parameters
    ----------
    segment
        Any segment.
    x
        State with its speed [n].
    values
        Parameters by full name.

    Returns
    -------
    array [n] or None
        In rad; None as for `zero_angle`.

    Notes
    -----
    A loop of second order is behind by the acceleration over the square of its bandwidth.

    """
    zero, bend_s2 = zero_angle(segment, x, values), values["bend_angle_s2"]
    if not bend_s2 or not both_axes(segment):
        return zero
    gathers = x.once(x.omega_rad_s, "gathers", lambda: np.gradient(x.omega_rad_s, x.point_s))
    behind = bend_s2 * x.machine.pole_pairs * gathers
    return -behind if zero is None else zero - behind


def frame_turn(segment: Segment, x: Operating, model: Model, values: Values) -> Complex | None:
    """What turns a vector from the frame of the recorded angle into that of the true one.

    Parameters
    ----------
    segment
        Any segment.
    x
        State at which the errors of the angle are evaluated [n].
    model
        Effects of the angle.
    values
        Parameters by full name.

    Returns
    -------
    array [n], complex, or None
        Unit vectors; None where the angle has no error.

    """

    def turn() -> Complex | None:
        frame = frame_angle(segment, x, values)
        return None if frame is None else np.exp(1j * frame)

    if not any(effect.angle is not None for effect in model.effects):
        name = "frame", *(values[name] for name in _ERRORS)
        return x.once(x.omega_rad_s, name, turn)
    frame, error = frame_angle(segment, x, values), angle_error(x, model, values)
    return np.exp(1j * (error if frame is None else frame + error))


def both_axes(segment: Segment) -> bool:
    """Whether this is a drive's log of both currents, in a frame that its own encoder turns."""
    return segment.instrument.name == "drive" and {"id_a", "theta_mech_rad"} <= set(
        segment.recorded
    )


def angle_error(x: Operating, model: Model, values: Values) -> Array:
    """Recorded less true electrical angle by the sensor effects of a model.

    Parameters
    ----------
    x
        State at which it is evaluated [n].
    model
        Effects of the angle; their errors add up.
    values
        Parameters by full name.

    Returns
    -------
    array [n]
        In rad.

    """
    total = np.zeros(x.omega_rad_s.shape)
    for angle, q in model.hooks("angle", values):
        total = total + angle(x, q)
    return total
