"""A drive's log on an even clock: current, motion, and what else there is but the d voltage."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.criticism.data.segment import Sensors
from pipeline.criticism.data.sensors import TEMPERATURES, prepared, with_slow_columns
from pipeline.criticism.data.shaft_angle import shaft_angle
from pipeline.criticism.data.traces import even_clock
from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.parameter import Machine
from pipeline.records.capture import Capture

_BLOCKS = 12
"""Parts that a log is held out in: by judgement. Fewer leave little to fit, more
are like their neighbours."""
_STALE, _LATE = 12, 1.5
"""Samples given up before a reading that came late, and twice as many from it on; periods from
which on it did. By judgement: what a host reads after a hold-up is of before."""
_ELECTRICAL = ("vq_v", "id_a", "iq_a", *TEMPERATURES)
_MOTION = ("theta_mech_rad", "omega_mech_rad_s", "theta_elec_rad")


@dataclass(frozen=True, slots=True)
class DriveLog:
    """Columns [n] on an even clock, samples to keep [n], and what the recording says of its
    sensors; `speed` and `angle`: whether the log holds the drive's own speed, and an angle.

    Attributes
    ----------
    period_s
        Sample period.
    columns
        Signals by name [n].
    keep
        Samples to use [n].
    sensors
        Noise and steps of the columns.
    speed, angle
        Whether it holds the drive's own speed, and an angle.

    """

    period_s: float
    columns: dict[str, Array]
    keep: Flags
    sensors: Sensors
    speed: bool
    angle: bool


def drive_log(capture: Capture, machine: Machine) -> DriveLog | None:
    """The log of a drive on an even clock.

    Parameters
    ----------
    capture
        A drive log or a heat run.
    machine
        Pole pairs and policy.

    Returns
    -------
    DriveLog or None
        None without a record of the motion, except for a heat run, which is at rest.

    """
    moving = [name for name in _MOTION if capture.has(name)]
    if not moving and capture.meta.test != "heat_run":
        return None
    electrical = tuple(name for name in _ELECTRICAL if capture.has(name))
    period, columns, keep = even_clock(capture, (*electrical, *moving), machine.policy.cutting)
    keep &= _on_time(capture, period, keep.size)
    speed = columns.get("omega_mech_rad_s")
    sensor = shaft_angle(columns, period, machine)
    if speed is not None:
        columns["omega_mech_rad_s"] = speed
    sensors = prepared(columns, period, machine.policy, sensor, machine.ripple_orders)
    sensors, _ = with_slow_columns(capture, columns, sensors, period, machine.policy)
    angle = any("theta" in name for name in moving)
    return DriveLog(period, columns, keep, sensors, speed is not None, angle)


def _on_time(capture: Capture, period: float, size: int) -> Flags:
    """Samples [size] of the even clock that are not near a reading that came late.

    A host that was held up reads again at once, and then gets old values. After samples that were
    lost the next comes a period later, and is as good as any.
    """
    time = capture.arrays("t_s", masked=False)["t_s"]
    gaps = np.diff(time)
    late = (gaps > _LATE * period) & (np.append(gaps[1:], period) < period / _LATE)
    odd = np.flatnonzero(late | (gaps < period / _LATE / 2))
    on_time = np.ones(size, dtype=bool)
    for at in np.round((time[odd] - time[0]) / period).astype(np.int64).tolist():
        on_time[max(at - _STALE, 0) : at + 2 * _STALE] = False
    return on_time


def in_time(middle: Array | Indices, size: int) -> Indices:
    """Which twelfth of a capture each window lies in.

    Parameters
    ----------
    middle
        Middle row of each window [W].
    size
        Rows of the capture.

    Returns
    -------
    array [W] of int
        From 0.

    """
    return np.minimum((middle * _BLOCKS // size).astype(np.int64), _BLOCKS - 1)
