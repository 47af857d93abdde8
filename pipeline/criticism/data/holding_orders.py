"""Orders a turn of a holding current that hold on in parts of the turn they were not fitted to."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pipeline.criticism.data.holding_cells import holding_cells
from pipeline.criticism.operating import Array, Indices
from pipeline.criticism.policy.policy import Policy
from pipeline.records.capture import Capture


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
