"""The current that holds a rotor at many angles: in cells of angle and sense, and its orders."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from pipeline.criticism.data.sensors import sensor_noise
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
    """A holding current averaged in cells of angle and sense, but for those where it turns back.

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
    Where a rotor turns back, friction is of neither sense until it has moved. The noise of a cell's
    mean comes from the scatter within cells about a straight line, with its correlation from sample
    to sample; a loop that holds does not repeat better than that. Where few cells have rows enough
    it comes from the differences between neighbours. What all rows of a cell have in common, as the
    rounding of a phase current that stays, shows between passes.

    """
    if not capture.has("theta_mech_rad", "iq_a"):
        return None
    home = capture.table_of("iq_a")
    if "t_s" in capture.tables[home].columns:
        # of a current that a bus holds, rows between its own are of no angle
        capture = capture.on_rows_of(home)
    columns = capture.arrays("theta_mech_rad", "iq_a")
    finite = np.isfinite(columns["theta_mech_rad"]) & np.isfinite(columns["iq_a"])
    theta, current = columns["theta_mech_rad"][finite], columns["iq_a"][finite]
    rows, spread = [], []
    number = np.floor(theta / TURN_RAD * policy.tables.cells).astype(np.int64)
    for part, sense in passes(theta):
        ends = (part.start, part.stop - 1)
        turned = [number[end] for end in ends if 0 < end < theta.size - 1]
        inside = part.start + np.flatnonzero(~np.isin(number[part], turned))
        if not inside.size:
            continue
        cells, residuals = _cells(theta[inside], current[inside], number[inside], policy.tables)
        rows.append(np.column_stack([cells, np.full(cells.shape[0], float(sense))]))
        spread += residuals
    if not rows or sum(len(r) for r in rows) < policy.tables.sectors:
        return None
    table = np.concatenate(rows)
    noise = _noise(spread, rows, policy)
    sector = _sectors_of(table[:, 0], policy.tables.sectors)
    return Cells(table[:, 0], table[:, 1], table[:, 2], sector, noise)


def _cells(
    theta: Array, current: Array, number: Indices, policy: Tables
) -> tuple[Array, list[Array]]:
    """Mean angle and current [K, 2] of the cells of one pass by number, and the scatter in each."""
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


def _noise(spread: list[Array], passed: list[Array], policy: Policy) -> float:
    """Standard deviation [A] of a cell's mean, of the cells [K, 3] pass by pass and of their rows'
    scatter; never below a ten-thousandth of the largest, nor what two passes differ by.
    """
    means = [cells[:, 1] for cells in passed]
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
    return max(scatter / math.sqrt(free), _between_passes(passed, policy), least)


def _between_passes(passed: list[Array], policy: Policy) -> float:
    """Standard deviation [A] of a cell's mean by the differences of passes of both senses, in which
    all that repeats with the angle is gone; 0 without any.
    """
    found = [0.0]
    for one, other in pairwise(passed):
        first, second = (np.floor(c[:, 0] / TURN_RAD * policy.tables.cells) for c in (one, other))
        _, there, back = np.intersect1d(first, second, return_indices=True)
        apart = one[there, 1] - other[back, 1]
        if apart.size >= policy.tables.sectors:
            found.append(sensor_noise(apart, policy.sensor_noise) / math.sqrt(2.0))
    return max(found)


def _sectors_of(theta: Array, sectors: int) -> Indices:
    """Number of the sector of the turn that each angle [n] is in."""
    turn = np.mod(theta, TURN_RAD) / TURN_RAD
    return np.minimum((turn * sectors).astype(np.int64), sectors - 1)


def holding_orders(
    captures: Iterable[Capture], bases: tuple[int, ...], policy: Policy, highest: int
) -> tuple[int, ...]:
    """Orders that a holding current repeats in parts of the turn they were not fitted to.

    Parameters
    ----------
    captures
        Holding currents of one motor.
    bases
        Pole pairs and slots; only multiples of these are looked for.
    policy
        Constants of judgement.
    highest
        Highest order [1/turn].

    Returns
    -------
    tuple of int
        Orders [1/turn], rising; empty where fewer than six sectors were passed.

    Notes
    -----
    Forward selection: the order that takes most of the square of what is left joins, as long as the
    sectors of the turn, each predicted from all others, gain on average by more than
    `policy.tables.order_u` standard errors. An order too many makes held-out sectors worse at once,
    however well the rest is fitted.

    References
    ----------
    Chen, Billings and Luo, Int. J. Control 50(5), 1989, 1873, doi:10.1080/00207178908953472.
    Hastie, Tibshirani and Friedman, The Elements of Statistical Learning, 2nd ed., Springer, 2009,
    7.10, doi:10.1007/978-0-387-84858-7.

    """
    joined = _joined(captures, policy)
    if joined is None or not bases:
        return ()
    theta, current, design, sector = joined
    if np.unique(sector).size < policy.tables.order_sectors:
        return ()
    cells = 2.0 * math.pi / float(np.median(np.abs(np.diff(np.unique(np.mod(theta, 2 * math.pi))))))
    top = min(highest, int(cells / 8))
    offered = [k for k in range(1, top + 1) if any(k % base == 0 for base in bases)]
    chosen: list[int] = []
    error = _held_out(design, current, sector)
    while offered and len(chosen) < policy.tables.orders:
        best = _strongest(design, current, theta, offered)
        offered.remove(best)
        tried = np.column_stack([design, np.cos(best * theta), np.sin(best * theta)])
        now = _held_out(tried, current, sector)
        gain = error - now
        if gain.mean() <= policy.tables.order_u * float(gain.std(ddof=1)) / math.sqrt(gain.size):
            break
        design, error = tried, now
        chosen.append(best)
    return tuple(sorted(chosen))


def _strongest(design: Array, current: Array, theta: Array, offered: Sequence[int]) -> int:
    """The order that takes most of the square of what the design leaves."""
    residual = current - design @ np.linalg.lstsq(design, current, rcond=None)[0]
    power = [abs(residual @ np.exp(1j * k * theta)) for k in offered]
    return offered[int(np.argmax(power))]


def _joined(
    captures: Iterable[Capture], policy: Policy
) -> tuple[Array, Array, Array, Indices] | None:
    """Angle, current, an offset a capture and sense, and the sector, of all cells."""
    by_capture = (holding_cells(capture, policy) for capture in captures)
    tables = [cells for cells in by_capture if cells is not None]
    if not tables:
        return None
    theta = np.concatenate([t.theta_mech_rad for t in tables])
    current = np.concatenate([t.iq_a for t in tables])
    label = np.concatenate([2 * n + (t.sense > 0) for n, t in enumerate(tables)])
    side = (label[:, None] == np.unique(label)[None, :]).astype(float)
    sector = np.concatenate([t.sector for t in tables])
    return theta, current, side, sector


def _held_out(design: Array, current: Array, sector: Indices) -> Array:
    """Mean square [sectors] of the current in each sector as predicted from the others."""
    normal, slope = design.T @ design, design.T @ current
    errors = []
    for number in np.unique(sector):
        in_sector = sector == number
        inside, measured = design[in_sector], current[in_sector]
        inverse = np.linalg.pinv(normal - inside.T @ inside, rcond=1e-9, hermitian=True)
        residual = measured - inside @ (inverse @ (slope - inside.T @ measured))
        errors.append(float(residual @ residual) / measured.size)
    return np.array(errors)
