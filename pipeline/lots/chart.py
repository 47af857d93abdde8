"""The chart over lot means: exponentially weighted moving average.

With λ 0.2 and L 2.86 it alarms on a steady process once in some 365 lots, and on a shift of one
standard deviation after some 9, where Shewhart's chart needs 44. Reference: S. W. Roberts,
Technometrics 1 (1959) 239; J. M. Lucas, M. S. Saccucci, Technometrics 32 (1990) 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
WEIGHT = 0.2
WIDTH = 2.86


class Chart(NamedTuple):
    """The average after each lot with its limits [unit], and where it is outside, each [..., n]."""

    ewma: Array
    low: Array
    high: Array
    signal: NDArray[np.bool_]


def ewma_chart(
    means: ArrayLike, centre: ArrayLike, sd: ArrayLike, weight: float = WEIGHT, width: float = WIDTH
) -> Chart:
    """Exponentially weighted moving average of lot means, with its control limits.

    Parameters
    ----------
    means
        Lot means in order of time [..., n, unit].
    centre
        Mean of the process [..., unit].
    sd
        Standard deviation of a lot mean [..., unit].
    weight
        λ, of the newest lot [1].
    width
        L, of the limits [standard deviations of the average].

    Returns
    -------
    Chart
        The average after each lot, its limits, and where it is outside.

    Notes
    -----
    z_i = λ x_i + (1 − λ) z_{i−1} from the centre;
    limits: centre ± L sd √(λ/(2 − λ) (1 − (1 − λ)^{2i})).

    References
    ----------
    S. W. Roberts, Technometrics 1(3), 1959, 239, doi:10.1080/00401706.1959.10489860.
    Lucas and Saccucci, Technometrics 32(1), 1990, 1, doi:10.1080/00401706.1990.10484583.

    Examples
    --------
    >>> chart = ewma_chart([1.0, 1.0], 0.0, 1.0)
    >>> np.round(chart.ewma, 6).tolist(), round(float(chart.high[0]), 6)
    ([0.2, 0.36], 0.572)

    """
    x = np.asarray(means, float)
    middle = np.asarray(centre, float)
    spread = np.asarray(sd, float)
    z = np.empty_like(x)
    last = np.broadcast_to(middle, x.shape[:-1]).astype(float)
    for i in range(x.shape[-1]):
        last = weight * x[..., i] + (1.0 - weight) * last
        z[..., i] = last
    count = np.arange(1, x.shape[-1] + 1)
    grown = np.sqrt(weight / (2.0 - weight) * (1.0 - (1.0 - weight) ** (2 * count)))
    half = width * spread[..., None] * grown
    low, high = middle[..., None] - half, middle[..., None] + half
    return Chart(z, low, high, (z < low) | (z > high))
