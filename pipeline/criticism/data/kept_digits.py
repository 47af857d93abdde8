"""Columns of a log that a file keeps a number of digits of, at one step."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from pipeline.criticism.operating import Array

if TYPE_CHECKING:
    import polars as pl

_MOST = 7
"""Digits beyond which the steps of the largest values are below any sensor's noise."""
_LOOKED_AT = 200
"""Values that are looked at first: most columns keep more digits, which one of these shows."""
_DISTINCT = 16
"""Values of a decade from which on their digits are a file's: a few are what was asked for."""
_FLOATING = 1e-9
"""Share of a value that is rounding of floating-point numbers."""


def at_largest_step(table: pl.DataFrame) -> pl.DataFrame:
    """The table of a log with each column in steps of its largest values.

    Parameters
    ----------
    table
        Columns of one clock; others than those of a log are as they were written.

    Returns
    -------
    polars.DataFrame
        The same table where no column is coarser at its largest values than at others.

    Notes
    -----
    A number that is written with six digits, as C and C++ write one if nothing else is said, is in
    steps of 1e-5 at an angle of 5 rad and in steps of 0.01 at 5000 rad. Taken for what the steps of
    most values are, the others are noise that nothing explains.

    """
    import polars as pl

    if "t_s" not in table.columns:
        return table
    changed = []
    for name in set(table.columns) - {"t_s"}:
        column = table[name].to_numpy().astype(np.float64)
        step = largest_step(column)
        if step:
            even = step * np.round(column / step)
            if np.nanmax(np.abs(even - column)) > _FLOATING * np.nanmax(np.abs(column)):
                changed.append(pl.Series(name, even))
    return table.with_columns(changed) if changed else table


def largest_step(column: Array) -> float:
    """The step of the largest values of a column that keeps a number of digits.

    Parameters
    ----------
    column
        Values [n, any unit], NaN where there is none.

    Returns
    -------
    float
        [same unit]; 0 where its values have more than seven digits, or are too few to show it. The
        largest are those of the last decade that has enough.

    Examples
    --------
    >>> largest_step(np.array([float(f"{x:.6g}") for x in np.geomspace(1.0, 5000.0, 101)]))
    0.01

    """
    values = np.abs(column[np.isfinite(column) & (column != 0.0)])
    few = values[:: max(values.size // _LOOKED_AT, 1)]
    counts = range(1, _MOST + 1)
    digits = next((n for n in counts if _has(few, n) and _has(values, n)), 0)
    if not digits:
        return 0.0
    distinct = np.unique(values)
    decades, numbers = np.unique(_decade(distinct), return_counts=True)
    known = decades[numbers >= _DISTINCT]
    return float(10.0 ** (known[-1] - digits + 1)) if known.size else 0.0


def _has(values: Array, digits: int) -> bool:
    """Whether positive values [n] have no more digits than that."""
    steps = 10.0 ** (_decade(values) - digits + 1)
    return bool(np.all(np.abs(values - steps * np.round(values / steps)) <= _FLOATING * values))


def _decade(values: Array) -> Array:
    decade: Array = np.floor(np.log10(values) + _FLOATING)
    return decade
