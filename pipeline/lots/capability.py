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
    """Cp = (U − L)/6s, Cpk = min(U − mean, mean − L)/3s of values [n].

    Cpk ± z √(1/(9n) + Cpk²/(2(n − 1))) [1]. One limit may be infinite; then there is no Cp. All
    are None for fewer than three motors, no scatter or no limit.
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
