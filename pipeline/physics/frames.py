"""Space vectors of three phases, amplitude-invariant: complex numbers α + jβ, α on phase a.

Reference: [1] E. Clarke, Circuit Analysis of A-C Power Systems, 1943.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Complex = NDArray[np.complex128]

_THIRD = complex(-0.5, math.sqrt(0.75))


def space_vector(a: ArrayLike, b: ArrayLike, c: ArrayLike) -> Complex:
    """Stator-frame vector [n] of three phase quantities [n each], any unit.

    x = (2/3)(a + b e^{j2π/3} + c e^{-j2π/3}) [1]; the common part drops out, and the length of a
    balanced system's vector is its phase amplitude.
    """
    vector: Complex = (2.0 / 3.0) * (
        np.asarray(a, dtype=np.float64)
        + np.asarray(b, dtype=np.float64) * _THIRD
        + np.asarray(c, dtype=np.float64) * _THIRD.conjugate()
    )
    return vector
