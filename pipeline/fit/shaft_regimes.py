"""Regimes of a shaft's equation of motion: do they have one inertia, one Coulomb, one viscous drag.

Reference: Ljung, System Identification, 2nd ed., 16.6 (validation by parts of the data).
"""

from __future__ import annotations

import numpy as np

from pipeline.fit.drag import DragFit
from pipeline.fit.regimes import Disagreement, Partition, Regression, disagreement, halves, signs
from pipeline.fit.shaft_rows import DRIVE, ShaftRows


def shaft_partitions(rows: ShaftRows, driving_only: bool) -> dict[str, Partition]:
    """Regimes of the rows by speed, sense, acceleration, current, time and capture.

    `driving_only` leaves the coast-downs out, which tell nothing of the inertia.
    """
    speed, pull = rows.speed_rad_s, rows.acceleration_rad_s2 * np.sign(rows.speed_rad_s)
    among = rows.kind == DRIVE if driving_only else np.ones(rows.count, dtype=bool)
    drives = rows.kind == DRIVE
    late = np.zeros(rows.count)
    for k in range(len(rows.captures)):
        own = rows.capture == k
        if own.any():
            late[own] = rows.time_s[own] - np.median(rows.time_s[own])
    files = tuple(f"in {capture.path}" for capture in rows.captures)
    current = np.abs(rows.q_current_a)
    return {
        "speed": halves("speed", np.abs(speed), "slow", "fast", among),
        "sense": signs("sense of rotation", speed, "backward", "forward", among),
        "gain": signs("acceleration", pull, "braking", "accelerating", drives),
        "torque": signs("sense of torque", rows.q_current_a, "negative", "positive", drives),
        "current": halves("current", current, "small", "large", drives),
        "time": signs("time", late, "in first halves", "in second halves", among),
        "capture": Partition("capture", np.where(among, rows.capture, -1), files),
    }


def drag_disagreements(
    rows: ShaftRows, found: DragFit, level: float
) -> tuple[Disagreement | None, Disagreement | None, Disagreement | None]:
    """What regimes scatter in the inertia, and in Coulomb and viscous drag over it, each or None.

    With the drag curve left free only the inertia is one number.
    """
    regression = Regression(found.design, found.target, found.sigma, rows.cluster)
    inertia = disagreement(regression, 0, shaft_partitions(rows, True), level)
    if found.free:
        return inertia, None, None
    every = shaft_partitions(rows, False)
    coulomb = disagreement(regression, found.names.index("coulomb"), every, level)
    viscous = disagreement(regression, found.names.index("viscous"), every, level)
    return inertia, coulomb, viscous
