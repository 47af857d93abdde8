"""Too little of the speed range: a coast that does not coast, a map at standstill."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.rotation import turned_rad
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Capture
from pipeline.records.errors import CaptureError

CODE = "speed_coverage"
_PARTS = 100
"""Of a record, each with a speed: a coast is at least a few hundredths of what was recorded."""


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Whether the speeds of the test were there.

    Notes
    -----
    Spin-down: the median speed of the fastest hundredth of the record over that of the last one (by
    the travel of an angle where no speed is there); below `fall` [1] refuses, for Coulomb and
    viscous friction cannot be separated then. A coast may be a small part of its record.
    Torque map and drive: less than `turns` [1] of travel warns.

    """
    if capture.meta.test == "spin_down":
        return _coast(capture, options)
    turned = turned_rad(capture)
    if turned is None or turned >= options["turns"] * TURN_RAD:
        return Passed()
    words = f"the shaft passes only {turned / TURN_RAD:.2f} of a turn: nothing is seen of speed"
    remedy = {
        "torque_map": "let the dynamometer hold a speed",
        "drive": "add a log in which the motor runs at several speeds",
    }[capture.meta.test]
    return Passed(findings=(warning(capture, CODE, words, remedy),))


def _coast(capture: Capture, options: Mapping[str, float]) -> Passed:
    speeds = _speeds_of_parts(capture)
    top, end = float(np.max(speeds)), float(speeds[-1])
    if end * options["fall"] <= top and top > 0.0:
        return Passed()
    raise CaptureError(
        CODE,
        f"the speed goes from {top:.3g} to {end:.3g} rad/s: too little of a coast to part "
        "Coulomb from viscous friction",
        f"let it coast with open terminals to below 1/{options['fall']:g} of its speed",
    )


def _speeds_of_parts(capture: Capture) -> Array:
    """Speed [100 or fewer, rad/s] of each hundredth of a record: its median, or the angle's travel.

    Fewer than a hundred rows are a part each.
    """
    column = "omega_mech_rad_s" if capture.has("omega_mech_rad_s") else "theta_mech_rad"
    t_s, motion = capture.finite("t_s", column).values()
    if column == "theta_mech_rad":
        ends = np.linspace(0, max(t_s.size - 1, 0), min(_PARTS + 1, t_s.size)).round().astype(int)
        travel, took = np.diff(motion[ends]), np.diff(t_s[ends])
        return np.abs(travel / took) if ends.size > 1 else np.zeros(1)
    parts = np.array_split(np.abs(motion), min(_PARTS, max(motion.size, 1)))
    return np.array([float(np.median(part)) if part.size else 0.0 for part in parts])


GATE = Gate(
    CODE,
    ("spin_down", "torque_map", "drive"),
    check,
    {
        # Constant and proportional drag differ by a quarter of the drag over this range.
        "fall": 1.5,
        # Below a turn the mean speed says nothing.
        "turns": 1.0,
    },
)
