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
    """Stator-frame vector of three phase quantities, amplitude-invariant.

    Parameters
    ----------
    a, b, c
        Phase quantities [n each, any unit].

    Returns
    -------
    array [n], complex
        α + jβ in the same unit, α on phase a.

    Notes
    -----
    x = (2/3)(a + b e^{j2π/3} + c e^{−j2π/3}). The common part drops out, and the length of a
    balanced system's vector is its phase amplitude.

    References
    ----------
    E. Clarke, Circuit Analysis of A-C Power Systems, Wiley, 1943.

    Examples
    --------
    >>> complex(np.round(space_vector(2.0, -1.0, -1.0), 9))
    (2+0j)

    """
    return (2.0 / 3.0) * (
        np.asarray(a, dtype=np.float64)
        + np.asarray(b, dtype=np.float64) * _THIRD
        + np.asarray(c, dtype=np.float64) * _THIRD.conjugate()
    )


def vector_of_phases(phases: Mapping[str, Array]) -> Complex:
    """Stator-frame vector of two or three phase quantities, amplitude-invariant.

    Parameters
    ----------
    phases
        Quantities [n each, any unit] whose names hold the phase as the second letter: ia_a, ib_a,
        ic_a, or va_v, vb_v, vc_v, or two of them.

    Returns
    -------
    array [n], complex
        α + jβ in the same unit, α on phase a. A third quantity that is not there is minus the sum
        of the others.

    Raises
    ------
    KeyError
        There are fewer than two.

    Examples
    --------
    >>> vector_of_phases({"ib_a": np.array([-1.0]), "ic_a": np.array([-1.0])}).round(9).tolist()
    [(2+0j)]

    """
    columns = {name[1]: values for name, values in phases.items()}
    if len(columns) < 2:
        raise KeyError("a vector needs two phases")
    absent = -sum(columns.values(), np.zeros(next(iter(columns.values())).shape))
    return space_vector(*(columns.get(letter, absent) for letter in "abc"))


def vector_of_lines(lines: Mapping[str, Array]) -> Complex:
    """Stator-frame vector of two or three line voltages, amplitude-invariant.

    Parameters
    ----------
    lines
        Line voltages [n each, V] by column name: vab_v, vbc_v, vca_v, or two of them.

    Returns
    -------
    array [n, V], complex
        α + jβ of the phase voltages, α on phase a.

    Raises
    ------
    KeyError
        There are fewer than two.

    Notes
    -----
    With a + b + c = 0, a = (2 v_ab + v_bc)/3 and b − c = v_bc, so α = a and β = v_bc/√3. Three line
    voltages sum to zero: what they have in common is an error of the instrument and is taken out.

    Examples
    --------
    Phases at 2, −1 and −1 V:

    >>> lines = {"vab_v": np.array([3.0]), "vbc_v": np.array([0.0])}
    >>> vector_of_lines(lines).tolist()
    [(2+0j)]

    """
    if len(lines) == 3:
        mean = sum(lines.values()) / 3.0
        lines = {name: line - mean for name, line in lines.items()}
    ab = lines["vab_v"] if "vab_v" in lines else -lines["vbc_v"] - lines["vca_v"]
    bc = lines["vbc_v"] if "vbc_v" in lines else -lines["vab_v"] - lines["vca_v"]
    return (2 * ab + bc) / 3.0 + 1j * bc / math.sqrt(3)
