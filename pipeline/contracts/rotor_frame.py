"""Phase currents and voltages, as a scope records them, turned into the rotor's frame."""

from __future__ import annotations

from collections.abc import Set
from dataclasses import replace

import numpy as np
import polars as pl

from pipeline.contracts.protocol import warning
from pipeline.contracts.requirements import LINE_CURRENTS, LINE_VOLTAGES, PHASE_VOLTAGES
from pipeline.physics.frames import Array, Complex, space_vector, vector_of_lines
from pipeline.records.capture import Capture
from pipeline.records.finding import Finding

TESTS = ("drive", "torque_map")
ANGLE = "theta_elec_rad"
_CURRENTS, _VOLTAGES = ("id_a", "iq_a"), ("vd_v", "vq_v")


def in_rotor_frame(capture: Capture) -> tuple[Capture, list[Finding]]:
    """The capture with dq currents and voltages that its electrical angle makes of its phases'.

    Parameters
    ----------
    capture
        As recorded.

    Returns
    -------
    capture
        With `id_a`, `iq_a` in every table of two line currents and `theta_elec_rad`, and `vd_v`,
        `vq_v` where two voltages of phases or lines are there too and none of the drive's own; as
        it was where some table has dq currents, or in tests that are not of a turning machine.
    findings
        One that says so.

    Notes
    -----
    x_dq = x_αβ e^{−jε}, ε = 0 where d is on phase a. A third quantity that is not there is minus
    the sum of the others.

    References
    ----------
    R. H. Park, AIEE Trans. 48(3), 1929, 716, doi:10.1109/T-AIEE.1929.5055275.

    """
    if capture.meta.test not in TESTS or capture.columns & {*_CURRENTS}:
        return capture, []
    wanted = {*_CURRENTS, *(() if capture.columns & {*_VOLTAGES} else _VOLTAGES)}
    tables = tuple(_turned(table, wanted) for table in capture.tables)
    added = sorted({n for t in tables for n in t.columns} - capture.columns)
    if not added:
        return capture, []
    words = f"{', '.join(added)} are made of the phases by {ANGLE}, whose zero counts as exact"
    remedy = "log dq currents of the drive, or see that the angle is 0 with the magnet on phase a"
    return replace(capture, tables=tables), [warning(capture, "rotor_frame", words, remedy)]


def _turned(table: pl.DataFrame, wanted: Set[str]) -> pl.DataFrame:
    """The table with what its angle makes of its phases, of the columns that are `wanted`."""
    current = _vector(table, LINE_CURRENTS)
    if current is None or ANGLE not in table.columns:
        return table
    back = np.exp(-1j * table[ANGLE].to_numpy())
    volts = _vector(table, PHASE_VOLTAGES)
    if volts is None:
        lines = {n: table[n].to_numpy() for n in LINE_VOLTAGES if n in table.columns}
        volts = vector_of_lines(lines) if len(lines) > 1 else None
    turned = {} if volts is None else dict(zip(_VOLTAGES, _axes(volts * back), strict=True))
    turned |= zip(_CURRENTS, _axes(current * back), strict=True)
    return table.with_columns(**{n: pl.Series(x) for n, x in turned.items() if n in wanted})


def _axes(vector: Complex) -> tuple[Array, Array]:
    return vector.real, vector.imag


def _vector(table: pl.DataFrame, names: tuple[str, ...]) -> Complex | None:
    """Space vector [n] of three quantities of the phases; None with fewer than two."""
    columns = {n: table[n].to_numpy() for n in names if n in table.columns}
    if len(columns) < 2:
        return None
    absent = -sum(columns.values(), np.zeros(table.height))
    a, b, c = (columns.get(name, absent) for name in names)
    return space_vector(a, b, c)
