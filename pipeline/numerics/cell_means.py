"""Means of an error over cells, with p-values that autocorrelation does not fool.

The independent units are visits: stretches of a record that stay in one cell. How far apart visits
of the same cell lie shows what chance does to a cell's mean, whatever the correlation inside a
visit is.

References: [1] Cameron, Gelbach & Miller, Rev. Econ. Stat. 90 (2008), inference by clusters; [2]
Student, Biometrika 6 (1908).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import betainc

from pipeline.physics.glossary import unit_of
from pipeline.records.error_map import Bins, ErrorMap

Array = NDArray[np.float64]
Indices = NDArray[np.int64]
FEWEST_VISITS = 8


@dataclass(frozen=True, slots=True)
class CellMeans:
    """Means [C, unit of the error], counts [C] and p-values [C] of cells; NaN where unknown.

    `p_value` is that of a mean this far from zero, `p_all` that of means this far from each other;
    `explained` is the share of the error's variance that lies between the cells.
    """

    mean: Array
    count: Indices
    p_value: Array
    explained: float
    p_all: float


def visits_of(cell: Indices, record: Indices) -> Indices:
    """Number of the visit that each row belongs to: a new one where the cell or the record changes.

    Parameters
    ----------
    cell
        Number of the cell of each row [n].
    record
        Number of the record of each row [n].

    Returns
    -------
    array [n]
        0, 1, 2, ... in order of rows.

    Examples
    --------
    >>> visits_of(np.array([4, 4, 7, 7, 4]), np.array([0, 0, 0, 1, 1])).tolist()
    [0, 0, 1, 2, 3]

    """
    changed = (np.diff(cell) != 0) | (np.diff(record) != 0)
    numbers: Indices = np.concatenate([[0], np.cumsum(changed)])
    return numbers[: cell.size]


def cell_means(error: Array, sigma: Array, cell: Indices, visit: Indices, cells: int) -> CellMeans:
    """Weighted means of an error over cells; the p-values allow for correlation within a visit.

    Parameters
    ----------
    error
        Residuals [n, any unit].
    sigma
        Their noise [n, same unit], above zero.
    cell
        Cell of each row [n], 0 to `cells` - 1.
    visit
        Visit of each row [n], see `visits_of`; all rows of a visit are in one cell.
    cells
        How many cells there are.

    Returns
    -------
    CellMeans
        NaN where a cell has no row. The p-values are NaN where the visits are less than
        `FEWEST_VISITS` more than the cells seen, and where visits do not scatter at all.

    Notes
    -----
    With visit means m, weights W = Σ 1/σ² and cell means M,

    s² = Σ W (m − M)²/(visits − cells),

    M √ΣW/s follows Student's t, and Σ W (M − mean)²/((cells − 1) s²) Fisher's F, with visits −
    cells degrees of freedom, where visits are independent.

    References
    ----------
    Cameron, Gelbach and Miller, Rev. Econ. Stat. 90(3), 2008, 414, doi:10.1162/rest.90.3.414.
    Student, Biometrika 6(1), 1908, 1, doi:10.1093/biomet/6.1.1.

    """
    weight = sigma**-2
    count = np.bincount(cell, minlength=cells)
    nonempty = count > 0
    _, visit = np.unique(visit, return_inverse=True)
    by_visit = np.bincount(visit, weight)
    of_visit = np.bincount(visit, weight * error) / by_visit
    home = np.zeros(by_visit.size, dtype=np.int64)
    home[visit] = cell
    by_cell = np.bincount(cell, weight, cells)
    mean = np.full(cells, np.nan)
    mean[nonempty] = np.bincount(cell, weight * error, cells)[nonempty] / by_cell[nonempty]
    common = float((weight * error).sum() / weight.sum())
    power = float((weight * (error - common) ** 2).sum())
    between = float((by_cell[nonempty] * (mean[nonempty] - common) ** 2).sum())
    explained = min(between / power, 1.0) if power > 0 else 0.0
    cells_seen = int(nonempty.sum())
    dof = by_visit.size - cells_seen
    p_value, p_all = np.full(cells, np.nan), float("nan")
    within = float((by_visit * (of_visit - mean[home]) ** 2).sum()) / max(dof, 1)
    if dof < FEWEST_VISITS or within <= 0.0:
        return CellMeans(mean, count, p_value, explained, p_all)
    t2 = mean[nonempty] ** 2 * by_cell[nonempty] / within
    # the tails of Student's t and of F as incomplete beta functions
    p_value[nonempty] = betainc(dof / 2.0, 0.5, dof / (dof + t2))
    if cells_seen > 1:
        p_all = float(betainc(dof / 2.0, (cells_seen - 1) / 2.0, dof / (dof + between / within)))
    return CellMeans(mean, count, p_value, explained, p_all)


def mean_map(
    signal: str,
    errors: tuple[Array, Array],
    cell: Indices,
    visit: Indices,
    x: Bins,
    y: Bins | None,
) -> ErrorMap:
    """Weighted means of a signal's error over cells of one variable, or of two.

    Parameters
    ----------
    signal
        Glossary name.
    errors
        Residuals and their noise [n, unit of the signal].
    cell
        Cell of each row [n], counted along `x` first.
    visit
        Visit of each row [n].
    x, y
        Cells of the variables.

    Returns
    -------
    ErrorMap
        See `cell_means`.

    """
    shape = (x.count,) if y is None else (y.count, x.count)
    cells = cell_means(*errors, cell, visit, math.prod(shape))
    return ErrorMap(
        signal,
        unit_of(signal),
        x,
        y,
        cells.count.reshape(shape),
        cells.mean.reshape(shape),
        cells.p_value.reshape(shape),
        cells.explained,
        cells.p_all,
    )
