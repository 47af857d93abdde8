"""The current that holds a rotor at many angles, averaged in cells of angle and sense."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.data.sensor_noise import sensor_noise
from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.captures import Tables
from pipeline.criticism.policy.policy import Policy
from pipeline.numerics.turns import passes
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Capture


@dataclass(frozen=True, slots=True)
class Cells:
    """Mean angle [n, rad], current [n, A] and sense of arrival [n] of every cell, with the sector
    of the turn [n]; `noise_a` is the standard deviation of a cell's mean.

    Attributes
    ----------
    theta_mech_rad, iq_a
        Mean angle and current of each cell [n].
    sense
        Sense of arrival, +1 or −1 [n].
    sector
        Sector of the turn [n].
    noise_a
        Standard deviation of a cell's mean [A].

    """

    theta_mech_rad: Array
    iq_a: Array
    sense: Array
    sector: Indices
    noise_a: float


def holding_cells(capture: Capture, policy: Policy) -> Cells | None:
    """A holding current averaged in cells of angle and sense.

    Parameters
    ----------
    capture
        With shaft angle and q current.
    policy
        Constants of judgement.

    Returns
    -------
    Cells or None
        None where there are fewer cells than `policy.tables.sectors`.

    Notes
    -----
    The noise of a cell's mean comes from the scatter within cells about a straight line, with its
    correlation from sample to sample; a loop that holds does not repeat better than that. Where few
    cells have rows enough it comes from the differences between neighbours.

    """
    if not capture.has("theta_mech_rad", "iq_a"):
        return None
    columns = capture.arrays("theta_mech_rad", "iq_a")
    finite = np.isfinite(columns["theta_mech_rad"]) & np.isfinite(columns["iq_a"])
    theta, current = columns["theta_mech_rad"][finite], columns["iq_a"][finite]
    rows, spread = [], []
    for part, sense in passes(theta):
        cells, residuals = _cells(theta[part], current[part], policy.tables)
        rows.append(np.column_stack([cells, np.full(cells.shape[0], float(sense))]))
        spread += residuals
    if not rows or sum(len(r) for r in rows) < policy.tables.sectors:
        return None
    table = np.concatenate(rows)
    noise = _noise(spread, [cells[:, 1] for cells in rows], policy)
    sector = _sectors_of(table[:, 0], policy.tables.sectors)
    return Cells(table[:, 0], table[:, 1], table[:, 2], sector, noise)


def _cells(theta: Array, current: Array, policy: Tables) -> tuple[Array, list[Array]]:
    """Mean angle and current [K, 2] of the cells of one pass, and the scatter in each."""
    number = np.floor(theta / TURN_RAD * policy.cells).astype(np.int64)
    order = np.argsort(number, kind="stable")
    edges = np.flatnonzero(np.diff(number[order])) + 1
    means, residuals = [], []
    for rows in np.split(order, edges):
        means.append((theta[rows].mean(), current[rows].mean()))
        if rows.size >= policy.cell_rows:
            residuals.append(_about_a_line(theta[rows], current[rows]))
    return np.array(means), residuals


def _about_a_line(theta: Array, current: Array) -> Array:
    at = theta - theta.mean()
    power = float(at @ at)
    slope = float(at @ current) / power if power > 0 else 0.0
    return current - current.mean() - slope * at


def _noise(spread: list[Array], means: list[Array], policy: Policy) -> float:
    """Standard deviation [A] of a cell's mean, of cells' `means` pass by pass and of their rows'
    scatter; never below a ten-thousandth of the largest.
    """
    least = max(policy.tables.reading * max(float(np.abs(one).max()) for one in means), 1e-12)
    if len(spread) < policy.tables.cell_share * sum(one.size for one in means):
        return max(*(sensor_noise(one, policy.sensor_noise) for one in means), least)
    power = sum(float(s @ s) for s in spread)
    n = sum(s.size for s in spread)
    after = sum(float(s[1:] @ s[:-1]) for s in spread)
    alike = min(max(after / power, 0.0), 0.99) if power > 0 else 0.0
    a_cell = n / len(spread)
    free = max(a_cell * (1.0 - alike) / (1.0 + alike), 1.0)
    scatter = math.sqrt(power / max(n - 2 * len(spread), 1))
    return max(scatter / math.sqrt(free), least)


def _sectors_of(theta: Array, sectors: int) -> Indices:
    """Number of the sector of the turn that each angle [n] is in."""
    turn = np.mod(theta, TURN_RAD) / TURN_RAD
    return np.minimum((turn * sectors).astype(np.int64), sectors - 1)
