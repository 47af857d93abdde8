"""Where a shaft was: the angle of a log, or the integral of its speed."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Array, Capture

ANGLE, SPEED = "theta_mech_rad", "omega_mech_rad_s"


@dataclass(frozen=True, slots=True)
class ShaftLog:
    """Columns of a log in the rows in which all are finite.

    Attributes
    ----------
    data
        Every column [n], by name.
    motion
        Which of angle and speed was logged.
    theta_rad
        Shaft angle [n, rad].

    """

    data: dict[str, Array]
    motion: str
    theta_rad: Array

    @property
    def t_s(self) -> Array:
        """The clock [n, s]."""
        return self.data["t_s"]

    @property
    def period_s(self) -> float:
        """Usual time from row to row [s]."""
        return float(np.median(np.diff(self.t_s)))


def motion_column(capture: Capture) -> str:
    """The column that says where the shaft is: its angle, else its speed.

    Parameters
    ----------
    capture
        The capture, which need not hold either.

    """
    return ANGLE if capture.has(ANGLE) else SPEED


def shaft_log(capture: Capture, *names: str, optional: tuple[str, ...] = ()) -> ShaftLog | None:
    """The motion of a log with further columns beside it.

    Parameters
    ----------
    capture
        The log.
    optional
        Columns that it may hold.
    *names
        Columns that it must hold.

    Returns
    -------
    ShaftLog or None
        None without a clock, an angle or speed, or one of the columns.

    """
    motion = motion_column(capture)
    if not capture.has("t_s", motion, *names):
        return None
    columns = capture.finite("t_s", motion, *names, *(n for n in optional if capture.has(n)))
    theta = columns[motion] if motion == ANGLE else trapezoid(columns["t_s"], columns[motion])
    return ShaftLog(columns, motion, theta)
