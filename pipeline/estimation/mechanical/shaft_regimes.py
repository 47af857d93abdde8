"""Regimes of a shaft's equation of motion: do they have one inertia, one Coulomb, one viscous drag.

Reference: Ljung, System Identification, 2nd ed., 16.6 (validation by parts of the data).
"""

from __future__ import annotations

from functools import partial

import numpy as np

from pipeline.estimation.mechanical.drag_fit import DragFit
from pipeline.estimation.mechanical.shaft_rows import DRIVE, ShaftRows
from pipeline.estimation.uncertainty.regimes import (
    Disagreement,
    Partition,
    Regression,
    disagreement,
    halves,
    signs,
)
from pipeline.records.capture import Array


def shaft_partitions(rows: ShaftRows, information: Array) -> list[Partition]:
    """Regimes of the rows by speed, sense, acceleration, current, time and capture.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    information
        Of each row on the coefficient in question [w].

    Returns
    -------
    list of Partition
        Those by current of the drives alone.

    """
    speed = rows.speed_rad_s
    gaining, current = rows.acceleration_rad_s2 * np.sign(speed), np.abs(rows.q_current_a)
    every, drives = np.ones(rows.count, dtype=bool), rows.kind == DRIVE
    late = np.zeros(rows.count)
    for k in range(len(rows.captures)):
        in_capture = rows.capture == k
        if in_capture.any():
            late[in_capture] = rows.time_s[in_capture] - np.median(rows.time_s[in_capture])
    files = tuple(f"in {capture.path}" for capture in rows.captures)
    return [
        halves("speed", np.abs(speed), "slow", "fast", information, every),
        signs("sense of rotation", speed, "backward", "forward", every),
        signs("acceleration", gaining, "braking", "accelerating", every),
        signs("sense of torque", rows.q_current_a, "negative", "positive", drives),
        halves("current", current, "small", "large", information, drives),
        signs("time", late, "in first halves", "in second halves", every),
        Partition("capture", rows.capture, files),
    ]


def drag_disagreements(
    rows: ShaftRows, fit: DragFit, level: float
) -> tuple[Disagreement | None, Disagreement | None, Disagreement | None]:
    """What regimes scatter in the inertia, and in Coulomb and viscous drag over it, each or None.

    With the drag curve left free only the inertia is one number.

    Parameters
    ----------
    rows
        Windows of drives and coast-downs.
    fit
        Their fit.
    level
        Chance of any partition to be named where the law is whole [1].

    """
    regression = Regression(fit.design, fit.target, fit.sigma, rows.cluster)
    names = ("torque",) if fit.free else ("torque", "coulomb", "viscous")
    split = partial(shaft_partitions, rows)
    disagreements = [
        disagreement(regression, fit.names.index(name), split, level) for name in names
    ]
    inertia, coulomb, viscous, *_ = (*disagreements, None, None)
    return inertia, coulomb, viscous
