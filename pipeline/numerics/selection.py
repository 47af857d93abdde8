"""Which of many candidate columns a least-squares fit really needs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from scipy.special import fdtrc

from pipeline.records.capture import Array

COLLINEAR = 1e-8


def needed_columns(
    base: Array,
    candidates: Mapping[str, Array],
    y: Array,
    sigma: Array,
    level: float = 0.01,
    most: int | None = None,
    dependence: float = 1.0,
) -> list[str]:
    """Which of many candidate columns a weighted least-squares fit needs beside its base.

    Parameters
    ----------
    base
        Columns that are in the fit whatever comes [n, k].
    candidates
        Further columns [n] by name.
    y
        Observations [n].
    sigma
        Their standard deviations [n, unit of y]; only their ratios count.
    level
        Chance that a column joins that explains nothing [1].
    most
        Most columns that may join.
    dependence
        How many rows count as one, where they are correlated [1].

    Returns
    -------
    list of str
        Names in the order in which they joined.

    Notes
    -----
    Forward selection: the column with the largest fall of the weighted sum of squares joins while
    its F(1, n − k − 1) is significant at `level` over the candidates left (Bonferroni), n being
    divided by `dependence`. With the base there are never more columns than half of the rows that
    count. Candidates are kept orthogonal to what is in, so that a step costs one product.

    References
    ----------
    Draper and Smith, Applied Regression Analysis, 3rd ed., Wiley, 1998, 15.3.
    Chen, Billings and Luo, Int. J. Control 50(5), 1989, 1873, doi:10.1080/00207178908953472.

    """
    names = list(candidates)
    most_columns = max(0, int(y.size / (2.0 * dependence)) - base.shape[1])
    most = most_columns if most is None else min(most, most_columns)
    if not names or most < 1:
        return []
    basis = _basis(base / sigma[:, None])
    pool = np.column_stack([candidates[name] for name in names]) / sigma[:, None]
    length = np.sum(pool**2, axis=0)
    pool = _without(pool, basis)
    residual = _without(y / sigma, basis)
    chosen: list[int] = []
    while len(chosen) < min(most, len(names)):
        free = y.size - basis.shape[1] - len(chosen) - 1
        power = np.sum(pool**2, axis=0)
        usable = (power > COLLINEAR * length) & ~np.isin(np.arange(len(names)), chosen)
        if free < 1 or not usable.any():
            break
        falls = np.where(usable, (pool.T @ residual) ** 2 / np.where(usable, power, 1.0), 0.0)
        best = int(np.argmax(falls))
        remaining = float(residual @ residual) - float(falls[best])
        if remaining > 0.0:
            statistic = float(falls[best]) / (remaining / free) / dependence
        else:
            statistic = np.inf if falls[best] > 0.0 else 0.0
        tests = len(names) - len(chosen)
        if fdtrc(1.0, max(free / dependence, 1.0), max(statistic, 0.0)) * tests > level:
            break
        chosen.append(best)
        unit = (pool[:, best] / np.linalg.norm(pool[:, best]))[:, None]
        pool, residual = _without(pool, unit), _without(residual, unit)
    return [names[k] for k in chosen]


def _basis(design: Array) -> Array:
    """Orthonormal columns that span the design's."""
    norm = np.linalg.norm(design, axis=0)
    left, singular, _ = np.linalg.svd(design / np.where(norm > 0, norm, 1.0), full_matrices=False)
    return left[:, singular > 1e-10 * singular.max(initial=0.0)]


def _without(values: Array, basis: Array) -> Array:
    """Values [n] or [n, m] less their part along the basis, twice for accuracy."""
    for _ in range(2):
        values = values - basis @ (basis.T @ values)
    return values
