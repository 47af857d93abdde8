"""Too little of the speed range: a coast that does not coast, a map at standstill."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, warning
from pipeline.contracts.rotation import TURN_RAD, turned_rad
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError

CODE = "speed_coverage"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Whether the speeds of the test were there.

    Notes
    -----
    Spin-down: the median speed of the fastest tenth of the record over that of the last tenth;
    below `fall` [1] refuses, for Coulomb and viscous friction cannot be separated then. Torque map
    and drive: less than `turns` [1] of travel warns.

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
    speed = np.abs(capture.arrays("omega_mech_rad_s")["omega_mech_rad_s"])
    speed = speed[np.isfinite(speed)]
    tenth = max(1, speed.size // 10)
    top = max(float(np.median(part)) for part in np.array_split(speed, min(10, speed.size)))
    end = float(np.median(speed[-tenth:]))
    if end * options["fall"] <= top and top > 0.0:
        return Passed()
    raise CaptureError(
        CODE,
        f"the speed goes from {top:.3g} to {end:.3g} rad/s: too little of a coast to part "
        "Coulomb from viscous friction",
        f"let it coast with open terminals to below 1/{options['fall']:g} of its speed",
    )


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
