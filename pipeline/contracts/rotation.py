"""How far and which way a shaft and its back-EMF turn: the common ground of several gates."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES
from pipeline.numerics.integrals import trapezoid
from pipeline.physics.frames import space_vector
from pipeline.physics.units import TURN_RAD
from pipeline.records.capture import Array, Capture

BLOCKS = 200
VectorOf = Callable[[Capture], tuple[Array, NDArray[np.complex128]] | None]


@dataclass(frozen=True, slots=True)
class Turning:
    """How far back-EMF or currents turn for a turn of the shaft.

    Attributes
    ----------
    cycles_per_turn
        Electrical cycles a mechanical turn; negative where the two oppose.
    u
        Its standard uncertainty, from the scatter over blocks.
    cycles
        Electrical cycles in either direction.
    top_hz
        Electrical frequency that 99 % of the rows stay below.

    """

    cycles_per_turn: float
    u: float
    cycles: float
    top_hz: float


def shaft_angle(capture: Capture, t_s: Array) -> Array | None:
    """Angle of the shaft on another clock.

    Parameters
    ----------
    capture
        Holds an angle or a speed, in any of its tables.
    t_s
        Instants wanted [n].

    Returns
    -------
    array [n] or None
        In rad, the speed integrated where there is no angle; NaN outside the span of the column,
        None without either.

    """
    for name in ("theta_mech_rad", "omega_mech_rad_s"):
        for table in capture.tables:
            if name not in table.columns or "t_s" not in table.columns:
                continue
            clock, values = table["t_s"].to_numpy(), table[name].to_numpy()
            finite = np.isfinite(values)
            if np.count_nonzero(finite) < 2:
                continue
            clock, values = clock[finite], values[finite]
            angle = values if name == "theta_mech_rad" else trapezoid(clock, values)
            return np.interp(t_s, clock, angle, left=np.nan, right=np.nan)
    return None


def line_voltage_vector(capture: Capture) -> tuple[Array, NDArray[np.complex128]] | None:
    """Space vector of the line voltages.

    Parameters
    ----------
    capture
        With two or three line voltages on one clock.

    Returns
    -------
    (t_s, vector) or None
        [n, s] and complex [n, V]; None with fewer than two.

    Notes
    -----
    x = (2/3)(ab + bc e^{j2π/3} + ca e^{−j2π/3}) turns forward where a leads b leads c; a third
    voltage that is not there is minus the sum of the others.

    """
    return _vector_of(capture, LINE_VOLTAGES)


def line_current_vector(capture: Capture) -> tuple[Array, NDArray[np.complex128]] | None:
    """Space vector of the line currents.

    Parameters
    ----------
    capture
        Any capture.

    Returns
    -------
    tuple of array or None
        Instants [n, s] and complex vector [n, A]; None with fewer than two currents.

    """
    return _vector_of(capture, LINE_CURRENTS)


def _vector_of(
    capture: Capture, names: tuple[str, ...]
) -> tuple[Array, NDArray[np.complex128]] | None:
    for table in capture.tables:
        columns = {n: table[n].to_numpy() for n in names if n in table.columns}
        columns = {n: v for n, v in columns.items() if np.isfinite(v).any()}
        if len(columns) < 2 or "t_s" not in table.columns:
            continue
        if len(columns) == 2:
            absent = next(name for name in names if name not in columns)
            columns[absent] = -sum(columns.values(), np.zeros(table.height))
        a, b, c = (columns[name] for name in names)
        return table["t_s"].to_numpy(), space_vector(a, b, c)
    return None


def turning(capture: Capture, vector_of: VectorOf = line_voltage_vector) -> Turning | None:
    """Electrical cycles a mechanical turn, signed, from a space vector and the angle or speed.

    Parameters
    ----------
    capture
        With both; they may be on different clocks.
    vector_of
        Gives the space vector: line voltages by default.

    Returns
    -------
    Turning or None
        None where one is missing or there is too little of it.

    Notes
    -----
    Increments of the vector's angle over `BLOCKS` blocks are regressed through zero on the shaft's,
    over the blocks in which the vector stands clear of noise: above a tenth of its 95th percentile.

    """
    vector = vector_of(capture)
    if vector is None:
        return None
    t_s, x = vector
    angle = shaft_angle(capture, t_s)
    if angle is None:
        return None
    finite = np.isfinite(x) & np.isfinite(angle)
    if np.count_nonzero(finite) < 16:
        return None
    t_s, x, angle = t_s[finite], x[finite], angle[finite]
    size = np.abs(x)
    clear = size > 0.1 * np.percentile(size, 95.0)
    phase = np.unwrap(np.angle(x))
    edges = np.unique(np.linspace(0, x.size - 1, min(BLOCKS, x.size // 8) + 1).astype(int))
    unbroken = np.array([clear[a : b + 1].all() for a, b in pairwise(edges)])
    electrical, mechanical = np.diff(phase[edges])[unbroken], np.diff(angle[edges])[unbroken]
    if electrical.size < 2 or not np.any(mechanical):
        return None
    rates = np.abs(np.diff(phase)[clear[1:]] / np.diff(t_s)[clear[1:]])
    top_hz = float(np.percentile(rates, 99.0)) / TURN_RAD
    slope = float(mechanical @ electrical / (mechanical @ mechanical))
    residuals = electrical - slope * mechanical
    u = float(np.sqrt(residuals @ residuals / (residuals.size - 1) / (mechanical @ mechanical)))
    return Turning(slope, u, float(np.abs(electrical).sum()) / TURN_RAD, top_hz)


def turned_rad(capture: Capture) -> float | None:
    """Range of shaft angle that was passed.

    Parameters
    ----------
    capture
        With angle or speed.

    Returns
    -------
    float or None
        Largest less smallest angle [rad]; None without angle or speed.

    """
    for table in capture.tables:
        if {"theta_mech_rad", "omega_mech_rad_s"} & set(table.columns) and "t_s" in table.columns:
            angle = shaft_angle(capture, table["t_s"].to_numpy())
            if angle is not None:
                return float(np.nanmax(angle) - np.nanmin(angle))
    return None
