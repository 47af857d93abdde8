"""An angle that jumps by a whole turn: recorded modulo 2 pi where it must be unwrapped."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, span_of
from pipeline.physics.glossary import TESTS
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Capture
from pipeline.records.errors import CaptureError
from pipeline.records.naming import counted

ANGLES = ("theta_mech_rad", "theta_elec_rad")
GAP = 2.0
REMEDY = (
    "in the source map of a foreign file write what one turn of the field is, as `wraps: 360` of "
    "degrees; else count the turns on before the file is written, as numpy.unwrap does, or log the "
    "angle unwrapped; keep the column, for much follows from the angle alone"
)


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Refuses an angle that steps back by about a turn while it otherwise moves in small steps.

    Notes
    -----
    A step counts within `near_rad` [rad] of 2π, in a record whose median step is at most
    `usual_rad` [rad]. A step over missing rows says nothing: the shaft may have made the turn.

    """
    for name in ANGLES:
        if not capture.has(name):
            continue
        steps = _steps(capture, name)
        if steps.size < 3 or float(np.median(np.abs(steps))) > options["usual_rad"]:
            continue
        turns = np.abs(np.abs(steps) - TURN_RAD) < options["near_rad"]
        if np.any(turns):
            first, last = span_of(turns)
            raise CaptureError(
                "wrapped_angle",
                f"{name} jumps by a whole turn {counted(int(np.count_nonzero(turns)), 'time')}",
                REMEDY,
                rows=(first + 1, last + 1),
            )
    return Passed()


def _steps(capture: Capture, name: str) -> Array:
    """Steps [n-1, rad] between neighbouring rows; 0 over a gap in time or a missing value."""
    names = (name, "t_s") if capture.has("t_s") else (name,)
    columns = capture.arrays(*names, masked=False)
    steps: Array = np.diff(columns[name])
    usable = np.isfinite(steps)
    if "t_s" in columns and steps.size:
        taken_s = np.diff(columns["t_s"])
        usable &= taken_s < GAP * np.median(taken_s)
    return np.where(usable, steps, 0.0)


GATE = Gate(
    "wrapped_angle",
    tuple(TESTS),
    check,
    # A sample apart by a radian or more would leave the direction of rotation unknown anyway.
    {"usual_rad": 1.0, "near_rad": 1.5},
)
