"""Which of many candidate columns a least-squares fit really needs."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from pipeline.numerics.least_squares import linear_fit

Array = NDArray[np.float64]


def needed_columns(
    base: Array,
    candidates: Mapping[str, Array],
    y: Array,
    sigma: Array,
    level: float = 0.01,
    most: int | None = None,
    dependence: float = 1.0,
) -> list[str]:
    """Names of the candidate columns [n each] that y [n] demands beside `base` [n, k].

    Forward selection: the column with the largest fall of the weighted sum of squares joins while
    its F(1, n-k-1) is significant at `level` over the candidates left. At least half as many
    degrees of freedom as rows stay free. Reference: Draper and Smith, Applied Regression
    Analysis, 3rd ed., 15.3.
    """
    from scipy.special import fdtrc

    chosen: list[str] = []
    most = max(0, y.size // 2 - base.shape[1]) if most is None else most
    design = base
    rest = _cost(design, y, sigma)
    while len(chosen) < most:
        left = [name for name in candidates if name not in chosen]
        costs = [_cost(np.column_stack([design, candidates[n]]), y, sigma) for n in left]
        free = y.size - design.shape[1] - 1
        if not left or free < 1:
            break
        best = int(np.argmin(costs))
        if costs[best] <= 0.0:
            statistic = np.inf if rest > 0.0 else 0.0
        else:
            statistic = (rest - costs[best]) / (costs[best] / free) / dependence
        if fdtrc(1.0, max(free / dependence, 1.0), max(statistic, 0.0)) * len(left) > level:
            break
        chosen.append(left[best])
        design = np.column_stack([design, candidates[left[best]]])
        rest = costs[best]
    return chosen


def _cost(design: Array, y: Array, sigma: Array) -> float:
    residual = linear_fit(design, y, sigma).residuals / sigma
    return float(residual @ residual)
