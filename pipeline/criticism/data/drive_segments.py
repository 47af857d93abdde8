"""A drive's log of the q axis alone: its voltage, and the motion of a shaft that runs free."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.segment import Segment, Sensors, segment_of
from pipeline.criticism.data.traces import even_clock, prepared, shaft_angle, thinned, window_of
from pipeline.criticism.effect import Array, Machine
from pipeline.numerics.projection import projection, window_starts
from pipeline.records.capture import Capture

_BLOCKS = 12
"""Parts that a log is held out in: by judgement. Fewer leave little to fit, more
are like their neighbours."""
_STALE, _LATE = 12, 1.5
"""Samples given up before a reading that came late, and twice as many from it on; periods from
which on it did. By judgement: what a host reads after a hold-up is of before."""
_MOTION_WINDOWS, _PAD = 160, 8
"""Windows of the motion at the most, and samples kept at either side. By judgement: cost goes with
both, and the angle's second difference needs a few beyond a window."""


def q_log(capture: Capture, machine: Machine) -> tuple[Segment, ...] | None:
    """Segments of the q voltage and of the motion; None without q voltage, current and motion.

    The d current is taken as held at zero, which is what a drive that logs the q axis alone does.
    If the log holds the drive's own speed, the voltage is predicted from it, since both share one
    clock, and the speed itself is compared with the angle; `sample_delay` says how late it is. The
    motion is that of the angle. Without a torque sensor the shaft is free.
    """
    moving = [n for n in ("theta_mech_rad", "omega_mech_rad_s", "theta_elec_rad") if capture.has(n)]
    if not capture.has("t_s", "vq_v", "iq_a") or not moving:
        return None
    period, found, keep = even_clock(capture, ("vq_v", "iq_a", *moving))
    keep &= _on_time(capture, period, keep.size)
    speed = found.get("omega_mech_rad_s")
    angle = any("theta" in name for name in moving)
    shaft_angle(found, period, machine)
    if speed is not None:
        found["omega_mech_rad_s"] = speed
    window = window_of(period, keep.size)
    told = prepared(found, period)
    starts = window_starts(keep, window)
    weak = projection(found["theta_mech_rad"], starts, window, ())
    blocks = _in_time(weak.starts + window // 2, keep.size)
    channels = ("vq_v", "omega_mech_rad_s") if speed is not None and angle else ("vq_v",)
    made = [
        segment_of(
            capture,
            "q",
            "drive",
            period,
            found=found,
            sensors=told,
            channels=channels,
            weak=weak,
            blocks=blocks,
        )
    ]
    if angle and not capture.has("torque_shaft_nm"):
        made.append(_motion(capture, period, found, told, keep))
    return tuple(made)


def _motion(
    capture: Capture,
    period: float,
    found: dict[str, Array],
    told: Sensors,
    keep: NDArray[np.bool_],
) -> Segment:
    """The shaft's motion, in a selection of the windows: waves of the angle are dear at speed."""
    names = ("theta_mech_rad", "iq_a", "travel_rad", "run")
    shaft = {n: found[n] for n in names}
    shaft["row"] = np.arange(keep.size, dtype=float)
    window = window_of(period, keep.size)
    shaft, starts = thinned(shaft, keep, window, _MOTION_WINDOWS, _PAD)
    weak = projection(shaft["theta_mech_rad"], starts, window, ())
    blocks = _in_time(shaft.pop("row")[starts + window // 2], keep.size)
    return segment_of(
        capture,
        "motion",
        "drive",
        period,
        found=shaft,
        sensors=told,
        channels=("torque_shaft_nm",),
        weak=weak,
        blocks=blocks,
    )


def _on_time(capture: Capture, period: float, size: int) -> NDArray[np.bool_]:
    """Samples [size] of the even clock that are not near a reading that came late.

    A host that was held up reads again at once, and then gets old values.
    """
    time = capture.arrays("t_s", masked=False)["t_s"]
    gaps = np.diff(time)
    odd = np.flatnonzero((gaps > _LATE * period) | (gaps < period / _LATE / 2))
    on_time = np.ones(size, dtype=bool)
    for at in np.round((time[odd] - time[0]) / period).astype(np.int64).tolist():
        on_time[max(at - _STALE, 0) : at + 2 * _STALE] = False
    return on_time


def _in_time(middle: Array | NDArray[np.int64], size: int) -> NDArray[np.int64]:
    """Number of the twelfth of the capture's rows that each window's middle [W] is in."""
    return np.minimum((middle * _BLOCKS // size).astype(np.int64), _BLOCKS - 1)
