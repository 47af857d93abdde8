"""The test whose unit is the lot, families of tests, and what a test can see.

A motor-level test takes the motors of one lot for independent draws of the process; they share
their lot's magnets, wire and shift, and such a test cries wolf on every second healthy lot. Here
the baseline's lot means show how far lots are apart, and one new lot is judged by that.

References: [1] D. C. Montgomery, Design and Analysis of Experiments, 8th ed., 13.2 (random
effects). [2] S. Holm, Scand. J. Statist. 6 (1979) 65.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtr, stdtrit

Array = NDArray[np.float64]


class Tested(NamedTuple):
    """t statistic, its degrees of freedom and two-sided p value, each [...]."""

    t: Array
    dof: Array
    p_value: Array


def lot_test(
    base_means: ArrayLike, new_mean: ArrayLike, u_more: ArrayLike = 0.0, new_lots: int = 1
) -> Tested:
    """One lot, or the mean of M, against the scatter of L others: means [..., L], mean [...].

    t = (m_new − mean)/√(s²(1/M + 1/L) + u_more²) with s over the L means; L − 1 degrees of
    freedom, by Welch-Satterthwaite more where `u_more` [..., infinite dof] counts: the link of
    stations, or a new lot of fewer motors. Prediction of a new draw [1]. Raises ValueError for
    fewer than two lots.
    """
    means, new = np.asarray(base_means, float), np.asarray(new_mean, float)
    lots = means.shape[-1]
    if lots < 2:
        raise ValueError("the scatter of lots needs two of them")
    scatter = np.var(means, axis=-1, ddof=1) * (1.0 / new_lots + 1.0 / lots)
    total = scatter + np.asarray(u_more, float) ** 2
    gap = new - means.mean(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        t = np.where(total > 0.0, gap / np.sqrt(total), np.where(gap == 0.0, 0.0, np.inf * gap))
        dof = np.where(scatter > 0.0, (lots - 1) * (total / scatter) ** 2, lots - 1.0)
    dof = np.minimum(dof, 1e9)
    return Tested(t, dof, 2.0 * stdtr(dof, -np.abs(t)))


def holm(p_values: ArrayLike) -> Array:
    """P values [..., k] adjusted for their number, step down [2]; compare them with alpha."""
    p = np.asarray(p_values, float)
    count = p.shape[-1]
    order = np.argsort(p, axis=-1, kind="stable")
    steps = np.take_along_axis(p, order, -1) * np.arange(count, 0, -1)
    rising = np.minimum(np.maximum.accumulate(steps, axis=-1), 1.0)
    adjusted = np.empty_like(p)
    np.put_along_axis(adjusted, order, rising, -1)
    return adjusted


def power(shift: float, se: float, dof: float, alpha: float) -> float:
    """Probability that a two-sided t test at `alpha` sees a shift whose estimate has `se`.

    P(T > c) + P(T < −c) of the noncentral t law, both as upper tails: `scipy.special.nctdtr` is
    NaN far below the mean.
    """
    from scipy.stats import nct

    if se <= 0.0:
        return 1.0 if shift else alpha
    critical = float(stdtrit(dof, 1.0 - alpha / 2.0))
    away = abs(shift) / se
    return float(nct.sf(critical, dof, away) + nct.sf(critical, dof, -away))


def detectable(se: float, dof: float, alpha: float, wanted: float = 0.95) -> float:
    """The shift that such a test sees with probability `wanted`, by bisection; 0 for se 0."""
    if se <= 0.0:
        return 0.0
    low, high = 0.0, 2.0 * se
    while power(high, se, dof, alpha) < wanted:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if power(middle, se, dof, alpha) >= wanted else (middle, high)
    return high
