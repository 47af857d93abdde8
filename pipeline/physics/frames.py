"""Space vectors of three phases, amplitude-invariant: complex numbers α + jβ, α on phase a.

Reference: [1] E. Clarke, Circuit Analysis of A-C Power Systems, 1943.
"""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
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


def vector_of_lines(lines: Mapping[str, Array]) -> Complex:
    """Stator-frame vector [n, V] of two or three line voltages [n each, V] by their column names.

    a = (2 ab + bc)/3 and b − c = bc where a + b + c = 0; what all three have in common is no line
    voltage and is taken out. Raises KeyError for fewer than two.
    """
    if len(lines) == 3:
        mean = sum(lines.values()) / 3.0
        lines = {name: line - mean for name, line in lines.items()}
    ab = lines["vab_v"] if "vab_v" in lines else -lines["vbc_v"] - lines["vca_v"]
    bc = lines["vbc_v"] if "vbc_v" in lines else -lines["vab_v"] - lines["vca_v"]
    vector: Complex = (2 * ab + bc) / 3.0 + 1j * bc / math.sqrt(3)
    return vector
