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
    """One lot, or the mean of several, against the scatter of others.

    Parameters
    ----------
    base_means
        Means of the L baseline lots [..., L, unit].
    new_mean
        Mean of the new lots' means [..., unit].
    u_more
        Further standard uncertainty of the difference [..., unit], of infinite degrees of freedom:
        the link of stations, or a new lot of fewer motors.
    new_lots
        M, how many lots are new.

    Returns
    -------
    Tested
        t statistic, degrees of freedom and two-sided p value.

    Raises
    ------
    ValueError
        There are fewer than two baseline lots.

    Notes
    -----
    t = (m_new − mean)/√(s² (1/M + 1/L) + u_more²), s over the L means: the prediction of a new
    draw. L − 1 degrees of freedom, by Welch-Satterthwaite more where `u_more` counts.

    References
    ----------
    D. C. Montgomery, Design and Analysis of Experiments, 8th ed., Wiley, 2013, 13.2 (random
    effects).

    Examples
    --------
    Lots at 9, 10, 11 (s = 1) and a new one at 14: t = 4/√(1 + 1/3), with 2 degrees of freedom.

    >>> tested = lot_test([9.0, 10.0, 11.0], 14.0)
    >>> round(float(tested.t), 4), float(tested.dof), round(float(tested.p_value), 3)
    (3.4641, 2.0, 0.074)

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
    """P values adjusted for their number, step down; compare them with alpha.

    Parameters
    ----------
    p_values
        [..., k].

    Returns
    -------
    array [..., k]
        In the same order, at most 1.

    References
    ----------
    S. Holm, Scand. J. Statist. 6(2), 1979, 65.

    Examples
    --------
    >>> holm([0.01, 0.04, 0.03]).tolist()
    [0.03, 0.06, 0.06]

    """
    p = np.asarray(p_values, float)
    count = p.shape[-1]
    order = np.argsort(p, axis=-1, kind="stable")
    steps = np.take_along_axis(p, order, -1) * np.arange(count, 0, -1)
    rising = np.minimum(np.maximum.accumulate(steps, axis=-1), 1.0)
    adjusted = np.empty_like(p)
    np.put_along_axis(adjusted, order, rising, -1)
    return adjusted


def power(shift: float, se: float, dof: float, alpha: float) -> float:
    """Probability that a two-sided t test sees a shift.

    Parameters
    ----------
    shift
        True shift [unit].
    se
        Standard error of its estimate [unit].
    dof
        Degrees of freedom of `se`.
    alpha
        Level of the test [1].

    Returns
    -------
    float
        [1]; without a standard error 1 for any shift, and alpha for none.

    Notes
    -----
    P(T > c) + P(T < −c) of the noncentral t distribution.

    """
    from scipy.stats import nct

    if se <= 0.0:
        return 1.0 if shift else alpha
    critical = float(stdtrit(dof, 1.0 - alpha / 2.0))
    away = abs(shift) / se
    return float(nct.sf(critical, dof, away) + nct.sf(critical, dof, -away))


def detectable(se: float, dof: float, alpha: float, wanted: float = 0.95) -> float:
    """The shift that a two-sided t test sees with a given probability.

    Parameters
    ----------
    se
        Standard error of the shift's estimate [unit].
    dof
        Degrees of freedom of `se`.
    alpha
        Level of the test [1].
    wanted
        Probability [1].

    Returns
    -------
    float
        [unit], by bisection; 0 without a standard error.

    """
    if se <= 0.0:
        return 0.0
    low, high = 0.0, 2.0 * se
    while power(high, se, dof, alpha) < wanted:
        high *= 2.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (low, middle) if power(middle, se, dof, alpha) >= wanted else (middle, high)
    return high
