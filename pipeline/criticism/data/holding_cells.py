"""The current that holds a rotor at many angles, averaged in cells of angle and sense."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.criticism.data.sensor_noise import sensor_noise
from pipeline.criticism.effect import Array
from pipeline.numerics.orders import TURN_RAD, passes
from pipeline.records.capture import Capture

_CELLS = 1024
"""Cells a turn: twelve a wave of the highest cogging orders of small machines (84), and still a few
rows each of a log of some thousand holds."""
_SECTORS = 24
"""Parts of a turn that are held out one by one, and the fewest cells that a table may have."""
_FEW = 4
"""Rows that a cell must have for their scatter about a line to be reported."""
_ENOUGH = 0.5
"""Share of the cells that must have them: the few where a pass turns round, and the rotor stays,
scatter otherwise than the rest."""


@dataclass(frozen=True, slots=True)
class Cells:
    """Mean angle [n, rad], current [n, A] and sense of arrival [n] of every cell, with the sector
    of the turn [n]; `noise_a` is the standard deviation of a cell's mean.
    """

    theta_mech_rad: Array
    iq_a: Array
    sense: Array
    sector: NDArray[np.int64]
    noise_a: float


def holding_cells(capture: Capture) -> Cells | None:
    """A holding current averaged in cells of angle and sense.

    Parameters
    ----------
    capture
        With shaft angle and q current.

    Returns
    -------
    Cells or None
        None where there are fewer cells than `_SECTORS`.

    Notes
    -----
    The noise of a cell's mean comes from the scatter within cells about a straight line, with its
    correlation from sample to sample; a loop that holds does not repeat better than that. Where few
    cells have rows enough it comes from the differences between neighbours.

    """
    if not capture.has("theta_mech_rad", "iq_a"):
        return None
    found = capture.arrays("theta_mech_rad", "iq_a")
    fine = np.isfinite(found["theta_mech_rad"]) & np.isfinite(found["iq_a"])
    theta, current = found["theta_mech_rad"][fine], found["iq_a"][fine]
    rows, spread = [], []
    for part, sense in passes(theta):
        cells, left = _cells(theta[part], current[part])
        rows.append(np.column_stack([cells, np.full(cells.shape[0], float(sense))]))
        spread += left
    if not rows or sum(len(r) for r in rows) < _SECTORS:
        return None
    table = np.concatenate(rows)
    noise = _noise(spread, [cells[:, 1] for cells in rows])
    return Cells(table[:, 0], table[:, 1], table[:, 2], sectors_of(table[:, 0]), noise)


def _cells(theta: Array, current: Array) -> tuple[Array, list[Array]]:
    """Mean angle and current [K, 2] of the cells of one pass, and the scatter in each."""
    number = np.floor(theta / TURN_RAD * _CELLS).astype(np.int64)
    order = np.argsort(number, kind="stable")
    edges = np.flatnonzero(np.diff(number[order])) + 1
    means, left = [], []
    for rows in np.split(order, edges):
        means.append((theta[rows].mean(), current[rows].mean()))
        if rows.size >= _FEW:
            left.append(_about_a_line(theta[rows], current[rows]))
    return np.array(means), left


def _about_a_line(theta: Array, current: Array) -> Array:
    at = theta - theta.mean()
    power = float(at @ at)
    slope = float(at @ current) / power if power > 0 else 0.0
    rest: Array = current - current.mean() - slope * at
    return rest


def _noise(spread: list[Array], means: list[Array]) -> float:
    """Standard deviation [A] of a cell's mean, of cells' `means` pass by pass and of their rows'
    scatter; never below a ten-thousandth of the largest.
    """
    least = max(1e-4 * max(float(np.abs(one).max()) for one in means), 1e-12)
    if len(spread) < _ENOUGH * sum(one.size for one in means):
        return max(*(sensor_noise(one) for one in means), least)
    power = sum(float(s @ s) for s in spread)
    n = sum(s.size for s in spread)
    after = sum(float(s[1:] @ s[:-1]) for s in spread)
    alike = min(max(after / power, 0.0), 0.99) if power > 0 else 0.0
    a_cell = n / len(spread)
    free = max(a_cell * (1.0 - alike) / (1.0 + alike), 1.0)
    scatter = math.sqrt(power / max(n - 2 * len(spread), 1))
    return max(scatter / math.sqrt(free), least)


def sectors_of(theta: Array) -> NDArray[np.int64]:
    """Number of the sector of the turn that each angle [n] is in."""
    turn = np.mod(theta, TURN_RAD) / TURN_RAD
    return np.minimum((turn * _SECTORS).astype(np.int64), _SECTORS - 1)
