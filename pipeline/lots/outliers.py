"""Motors apart from their lot.

Reference: F. R. Hampel et al., Robust Statistics, 1986, 2.3 (median absolute deviation).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from statistics import median

import numpy as np
from scipy.special import stdtrit

MAD_TO_SD = 1.4826
# The median absolute deviation knows as much of a spread as this share of Gaussian motors.
EFFICIENCY = 0.37
LEVEL = 0.01


def robust_z(lots: Mapping[str, Sequence[float]]) -> dict[str, list[float]]:
    """Distance of each motor from its lot's median, in robust standard deviations.

    Parameters
    ----------
    lots
        Values by lot [unit].

    Returns
    -------
    dict
        Scores [1] by lot, in the same order; zero throughout where half of the motors equal their
        median.

    Notes
    -----
    s = 1.4826 median |x − median| over the motors of all lots of two or more, times √(n/(n −
    lots)), for a median takes a degree of freedom from each lot.

    References
    ----------
    Hampel, Ronchetti, Rousseeuw and Stahel, Robust Statistics, Wiley, 1986, 2.3.

    """
    centre = {lot: median(values) for lot, values in lots.items()}
    left = [abs(v - centre[lot]) for lot, values in lots.items() for v in values if len(values) > 1]
    lost = sum(1 for values in lots.values() if len(values) > 1)
    # A median takes a degree of freedom from each lot, which narrows what is left.
    grown = np.sqrt(len(left) / max(len(left) - lost, 1)) if left else 1.0
    sd = MAD_TO_SD * float(np.median(left)) * float(grown) if left else 0.0
    return {
        lot: [(v - centre[lot]) / sd if sd > 0.0 else 0.0 for v in values]
        for lot, values in lots.items()
    }


def critical_z(motors: int, lots: int, level: float = LEVEL) -> float:
    """What |z| a healthy set of motors exceeds anywhere with a given probability at most.

    Parameters
    ----------
    motors, lots
        How many there are.
    level
        Probability that any motor exceeds it [1].

    Returns
    -------
    float
        [standard deviations], the quantile of Student's t at level/2 over the motors (Bonferroni).

    Notes
    -----
    Degrees of freedom: `EFFICIENCY` (motors − lots), for the median absolute deviation knows as
    much of a spread as that share of Gaussian motors.

    """
    dof = max(EFFICIENCY * (motors - lots), 1.0)
    return float(stdtrit(dof, 1.0 - level / (2.0 * max(motors, 1))))
