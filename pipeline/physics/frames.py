"""Space vectors: phases, the stator frame and the rotor frame, amplitude-invariant.

Complex numbers carry two axes: α + jβ in the stator frame, d + jq in the rotor frame. References:
[1] E. Clarke, Circuit Analysis of A-C Power Systems, 1943. [2] R. H. Park, Two-reaction theory
of synchronous machines, AIEE Trans. 48, 1929.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]

_THIRD = complex(-0.5, math.sqrt(0.75))
_LINE_TO_PHASE = complex(0.5, -math.sqrt(1.0 / 12.0))


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


def space_vector_of_lines(ab: ArrayLike, bc: ArrayLike) -> Complex:
    """Stator-frame vector [n] of the phase voltages from two line voltages [n each].

    x = (2/3)(ab + bc e^{j2π/3} − (ab + bc) e^{-j2π/3}) e^{-j30°}/√3; the star point is not needed.
    """
    first, second = np.asarray(ab, dtype=np.float64), np.asarray(bc, dtype=np.float64)
    vector: Complex = space_vector(first, second, -(first + second)) * _LINE_TO_PHASE
    return vector


def phases(vector: ArrayLike) -> tuple[Array, Array, Array]:
    """Phase quantities a, b, c [n each] of a stator-frame vector [n], without common part."""
    x = np.asarray(vector, dtype=np.complex128)
    return x.real, (x * _THIRD.conjugate()).real, (x * _THIRD).real


def to_rotor(vector: ArrayLike, theta_elec_rad: ArrayLike) -> Complex:
    """Rotor-frame vector d + jq [n] of a stator-frame one at electrical angles [n, rad] [2]."""
    turned: Complex = np.asarray(vector, dtype=np.complex128) * np.exp(
        -1j * np.asarray(theta_elec_rad, dtype=np.float64)
    )
    return turned


def to_stator(vector: ArrayLike, theta_elec_rad: ArrayLike) -> Complex:
    """Stator-frame vector α + jβ [n] of a rotor-frame one at electrical angles [n, rad] [2]."""
    turned: Complex = np.asarray(vector, dtype=np.complex128) * np.exp(
        1j * np.asarray(theta_elec_rad, dtype=np.float64)
    )
    return turned
