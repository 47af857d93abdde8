"""A torque map whose rows are settled points, each of its own: a table, which has no clock."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pipeline.contracts.gates.current_coverage import holds_levels
from pipeline.contracts.protocol import warning
from pipeline.contracts.waveform import Array
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.capture import Capture
from pipeline.records.finding import Finding

CODE = "settled_points"
CURRENT, TORQUE, SPEED, CLOCK = "iq_a", "torque_shaft_nm", "omega_mech_rad_s", "t_s"
FEWEST = 8
"""Rows that a line through them tells something of."""
SHARE = 0.5
"""Of the torque's power that current and speed explain where rows are points of a machine: of
random numbers eight rows explain so much in one of ten tables, forty never."""


def as_settled_points(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture as a `torque_table` where each of its rows is a settled point, with a warning.

    Parameters
    ----------
    capture
        As recorded.

    Returns
    -------
    capture
        The same, unless it is a torque map whose current changes from row to row while the torque
        follows it row by row, with a clock or without: a log holds a level for some rows, or passes
        from one to the next. Efficiency maps and tables of a dynamometer are such.
    findings
        The warning.

    """
    if capture.meta.test != "torque_map" or not {CURRENT, TORQUE, SPEED} <= capture.columns:
        return capture, []
    if len(capture.tables) > 1 or not _are_points(capture):
        return capture, []
    clock = "" if CLOCK in capture.columns else "there is no t_s, "
    words = (
        f"{clock}current changes from row to row, and torque follows it row by row: every row "
        "counts as a settled point, as in a torque_table"
    )
    remedy = "state test: torque_table; of a log, hold each level for longer or log faster"
    return (
        replace(capture, meta=replace(capture.meta, test="torque_table")),
        [warning(capture, CODE, words, remedy)],
    )


def _are_points(capture: Capture) -> bool:
    rows = capture.tables[0].select(CURRENT, TORQUE, SPEED).to_numpy()
    current, torque, speed = rows[np.isfinite(rows).all(axis=1)].T
    if current.size < FEWEST or holds_levels(current):
        return False
    design = np.column_stack([np.ones(speed.size), np.sign(speed), speed])
    by_speed = linear_fit(design, torque).residuals
    left = linear_fit(np.column_stack([design, current]), torque).residuals
    return _power(left) < (1.0 - SHARE) * _power(by_speed)


def _power(residuals: Array) -> float:
    return float(residuals @ residuals)
