"""Cp and Cpk of a lot's motors against their tolerance, with an interval.

References: [1] A. F. Bissell, Applied Statistics 39 (1990) 331. [2] S. Kotz, N. L. Johnson,
Process Capability Indices, 1993, 2.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import ndtri

from pipeline.records.lot_constant import Capability

LEVEL = 0.95
NONE = Capability(None, None, None, None, LEVEL)


def capability(values: ArrayLike, lower: float, upper: float, level: float = LEVEL) -> Capability:
    """Process capability of a lot's motors against their tolerance, with an interval.

    Parameters
    ----------
    values
        One a motor [n, unit].
    lower, upper
        Limits of the tolerance [unit]; one may be infinite, then there is no Cp.
    level
        Coverage of the interval of Cpk [1].

    Returns
    -------
    Capability
        All None for fewer than three motors, no scatter or no limit.

    Notes
    -----
    Cp = (U − L)/6s and Cpk = min(U − mean, mean − L)/3s.

    Cpk ± z √(1/(9n) + Cpk²/(2(n − 1))), for Gaussian motors.

    References
    ----------
    A. F. Bissell, Applied Statistics 39(3), 1990, 331, doi:10.2307/2347383.

    Examples
    --------
    >>> found = capability([9.0, 10.0, 11.0], 4.0, 13.0)
    >>> found.cp, found.cpk
    (1.5, 1.0)

    """
    x = np.asarray(values, float)
    if x.size < 3 or not (math.isfinite(lower) or math.isfinite(upper)):
        return NONE
    mean, sd = float(x.mean()), float(x.std(ddof=1))
    if sd == 0.0:
        return NONE
    cpk = min(upper - mean, mean - lower) / (3.0 * sd)
    both = math.isfinite(lower) and math.isfinite(upper)
    cp = (upper - lower) / (6.0 * sd) if both else None
    half = float(ndtri(0.5 + level / 2.0)) * math.sqrt(
        1.0 / (9.0 * x.size) + cpk**2 / (2.0 * (x.size - 1))
    )
    return Capability(cp, cpk, cpk - half, cpk + half, level)
