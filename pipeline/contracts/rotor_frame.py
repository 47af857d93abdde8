"""Phase currents and voltages, as a scope records them, turned into the rotor's frame."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import polars as pl

from pipeline.contracts.protocol import warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES, PHASE_VOLTAGES
from pipeline.numerics.turning_voltage import magnet_angle, speed_of, turning_voltage
from pipeline.physics.frames import Array, Complex, vector_of_lines, vector_of_phases
from pipeline.records.capture import U_ZERO, Capture
from pipeline.records.finding import Finding

TESTS = ("drive", "torque_map")
ANGLE, SHAFT = "theta_elec_rad", "theta_mech_rad"
MOST_U_RAD = 0.02
"""Largest standard uncertainty of an angle's zero that the voltages give: that of a careful
alignment by hand. It puts a fiftieth of i_q into i_d, and takes 2e-4 of i_q.
"""
LEAST_ROWS = 100
"""Fewer rows determine no angle beside currents, a delay and dead time."""
_CURRENTS, _VOLTAGES = ("id_a", "iq_a"), ("vd_v", "vq_v")


class Frame(NamedTuple):
    """The electrical angle of a table's rows [rad], None where there is none; on what it rests, or
    why there is none; and the standard uncertainty of its zero [rad].
    """

    angle_rad: Array | None
    words: str
    u_rad: float = 0.0


def in_rotor_frame(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture with dq currents and voltages that its electrical angle makes of its phases'.

    Parameters
    ----------
    capture
        As recorded.

    Returns
    -------
    capture
        With `id_a`, `iq_a` in every table of two line currents and an electrical angle, and `vd_v`,
        `vq_v` where two voltages of phases or lines are there too and none of the drive's own; as
        it was where some table has dq currents, or in tests that are not of a turning machine. The
        standard uncertainty of a zero that the back-EMF shows is in its metadata (`U_ZERO`).
    findings
        One that says so.

    Notes
    -----
    x_dq = x_αβ e^{−jε}, ε = 0 where d is on phase a. A third quantity that is not there is minus
    the sum of the others. The angle is `theta_elec_rad`, else pole pairs times `theta_mech_rad`
    with the zero that the back-EMF shows (`numerics.turning_voltage`).

    References
    ----------
    R. H. Park, AIEE Trans. 48(3), 1929, 716, doi:10.1109/T-AIEE.1929.5055275.

    """
    if capture.meta.test not in TESTS or capture.columns & {*_CURRENTS}:
        return capture, []
    wanted = {*_CURRENTS, *(() if capture.columns & {*_VOLTAGES} else _VOLTAGES)}
    frames = [rotor_frame(table, capture.meta.pole_pairs) for table in capture.tables]
    turned = zip(capture.tables, frames, strict=True)
    tables = tuple(_turned(table, frame.angle_rad, wanted) for table, frame in turned)
    added = sorted({n for t in tables for n in t.columns} - capture.columns)
    if not added:
        return capture, []
    basis = next(frame.words for frame in frames if frame.angle_rad is not None)
    words = f"{', '.join(added)} are made of the phases by {basis}"
    remedy = "log dq currents of the drive, or see that the angle is 0 with the magnet on phase a"
    u_rad = max(frame.u_rad for frame in frames)
    extra = {**capture.meta.extra, **({U_ZERO: repr(u_rad)} if u_rad else {})}
    capture = replace(capture, tables=tables, meta=replace(capture.meta, extra=extra))
    return capture, [warning(capture, "rotor_frame", words, remedy)]


def rotor_frame(table: pl.DataFrame, pole_pairs: int | None) -> Frame:
    """The electrical angle of a table of line currents, as logged or as the back-EMF shows it.

    Parameters
    ----------
    table
        Of one clock.
    pole_pairs
        As stated; None where the voltages alone count them.

    """
    current = _vector(table, LINE_CURRENTS)
    if current is None:
        return Frame(None, "two line currents are not in one table")
    if ANGLE in table.columns:
        return Frame(table[ANGLE].to_numpy(), f"{ANGLE}, whose zero counts as exact")
    volts = stator_voltage(table)
    if volts is None or not {"t_s", SHAFT} <= {*table.columns}:
        return Frame(None, f"the back-EMF shows the angle where two voltages and {SHAFT} are there")
    theta, t_s = table[SHAFT].to_numpy(), table["t_s"].to_numpy()
    rows = np.isfinite(volts) & np.isfinite(current) & np.isfinite(theta)
    rows &= np.diff(t_s, prepend=-np.inf) > 0.0
    t_s = t_s[rows]
    if t_s.size < LEAST_ROWS or not np.all(np.diff(t_s) > 0.0):
        return Frame(None, f"fewer than {LEAST_ROWS} rows hold voltages, currents and {SHAFT}")
    return _by_back_emf(theta, rows, t_s, (volts[rows], current[rows]), pole_pairs)


def _by_back_emf(
    theta_rad: Array,
    rows: np.ndarray,
    t_s: Array,
    vectors: tuple[Complex, Complex],
    pole_pairs: int | None,
) -> Frame:
    """Pole pairs times the shaft's angle, with the zero that the back-EMF shows in some `rows`."""
    speed = speed_of(t_s, theta_rad[rows])
    pairs = turning_voltage(vectors[0], theta_rad[rows], speed)
    if pairs is None:
        return Frame(None, f"no count of turns of the voltage a turn of {SHAFT} stands out")
    if pairs < 0 or (pole_pairs is not None and pairs != pole_pairs):
        against = "against it; exchange two phases, or the angle's sign" if pairs < 0 else ""
        stated = against or f"where pole_pairs states {pole_pairs}"
        return Frame(None, f"the voltages turn {abs(pairs)} times a turn of {SHAFT}, {stated}")
    zero = magnet_angle(*vectors, theta_rad[rows], speed, pairs)
    if not zero.u_rad <= MOST_U_RAD:
        words = (
            f"the back-EMF shows the angle's zero to {zero.u_rad:.2g} rad alone, where "
            f"{MOST_U_RAD:g} are needed: turn in both senses, at changing speed"
        )
        return Frame(None, words)
    angle = pairs * theta_rad + zero.offset_rad
    basis = f"{pairs} {SHAFT} {zero.offset_rad:+.4f} ± {zero.u_rad:.1g} rad"
    return Frame(angle, f"{basis}, by the back-EMF in their voltages", float(zero.u_rad))


def stator_voltage(table: pl.DataFrame) -> Complex | None:
    """Space vector [n, V] of the voltages of phases, else of lines; None with fewer than two.

    Parameters
    ----------
    table
        Of any columns.

    """
    volts = _vector(table, PHASE_VOLTAGES)
    if volts is None:
        lines = {n: table[n].to_numpy() for n in LINE_VOLTAGES if n in table.columns}
        volts = vector_of_lines(lines) if len(lines) > 1 else None
    return volts


def _turned(table: pl.DataFrame, angle_rad: Array | None, wanted: Set[str]) -> pl.DataFrame:
    """The table with what an angle [n] makes of its phases, of the columns that are `wanted`."""
    current = _vector(table, LINE_CURRENTS)
    if current is None or angle_rad is None:
        return table
    back = np.exp(-1j * angle_rad)
    volts = stator_voltage(table)
    turned = {} if volts is None else dict(zip(_VOLTAGES, _axes(volts * back), strict=True))
    turned |= zip(_CURRENTS, _axes(current * back), strict=True)
    return table.with_columns(**{n: pl.Series(x) for n, x in turned.items() if n in wanted})


def _axes(vector: Complex) -> tuple[Array, Array]:
    return vector.real, vector.imag


def _vector(table: pl.DataFrame, names: tuple[str, ...]) -> Complex | None:
    """Space vector [n] of three quantities of the phases; None with fewer than two."""
    columns = {n: table[n].to_numpy() for n in names if n in table.columns}
    return None if len(columns) < 2 else vector_of_phases(columns)
