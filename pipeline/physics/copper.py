"""Resistance of copper over temperature.

Reference: IEEE Std 112-2017: in proportion to 234.5 + T (IEC 60034-1: 235 + T).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

COPPER_ZERO_K = 234.5
"""How far below 0 degC the resistance, extended linearly, is zero."""
COPPER_COEFFICIENT_25_1_K = 1.0 / (COPPER_ZERO_K + 25.0)
"""Temperature coefficient of the resistance at 25 degC."""


def copper_resistance_ohm(
    r_ohm: ArrayLike, temp_degc: ArrayLike, reference_degc: ArrayLike
) -> Array:
    """Resistance of copper at another temperature.

    Parameters
    ----------
    r_ohm
        Resistance at the reference [ohm]; the arguments broadcast.
    temp_degc
        Where the resistance is wanted [degC].
    reference_degc
        Where it is `r_ohm` [degC].

    Returns
    -------
    array [ohm]

    Notes
    -----
    R(T) = R₀ (234.5 + T)/(234.5 + T₀). To refer a reading back to 25 degC:
    `copper_resistance_ohm(reading, 25.0, reading_degc)`.

    References
    ----------
    IEEE Std 112-2017, 5.4 (IEC 60034-1 has 235 for 234.5).

    Examples
    --------
    A kelvin is 1/259.5 of the resistance at 25 degC:

    >>> float(copper_resistance_ohm(2.595, 35.0, 25.0))
    2.695

    """
    scale = (COPPER_ZERO_K + np.asarray(temp_degc, dtype=np.float64)) / (
        COPPER_ZERO_K + np.asarray(reference_degc, dtype=np.float64)
    )
    return np.asarray(r_ohm, dtype=np.float64) * scale


def copper_temperature_degc(r_ohm: float, r_reference_ohm: float, reference_degc: float) -> float:
    """Temperature of a copper winding from its resistance: the inverse of `copper_resistance_ohm`.

    Parameters
    ----------
    r_ohm
        Resistance now [ohm].
    r_reference_ohm
        Resistance at the reference [ohm].
    reference_degc
        Temperature of the reference [degC].

    Returns
    -------
    float
        [degC]

    Notes
    -----
    T = (234.5 + T₀) R/R₀ − 234.5

    References
    ----------
    IEEE Std 112-2017, 5.4.

    """
    return r_ohm / r_reference_ohm * (COPPER_ZERO_K + reference_degc) - COPPER_ZERO_K


def coefficient_at_1_k(alpha_1_k: float, from_degc: float, to_degc: float) -> float:
    """A linear temperature coefficient referred to another temperature.

    Parameters
    ----------
    alpha_1_k
        Coefficient [1/K] of the value at `from_degc`.
    from_degc
        Temperature to which it refers [degC].
    to_degc
        Temperature to which it shall refer [degC].

    Returns
    -------
    float
        [1/K]

    Notes
    -----
    α' = α/(1 + α (T' − T)): the slope in ohms is one, the resistance it is divided by is not.

    Examples
    --------
    >>> round(coefficient_at_1_k(0.00393, 20.0, 25.0), 6)
    0.003854

    """
    return alpha_1_k / (1.0 + alpha_1_k * (to_degc - from_degc))


def linear_resistance_ohm(
    r_ohm: float, reference_degc: float, temp_degc: float, alpha_1_k: float, alpha_at_degc: float
) -> float:
    """Resistance at a temperature with a coefficient that names its own temperature.

    Parameters
    ----------
    r_ohm
        Resistance at the reference [ohm].
    reference_degc
        Where it was measured [degC].
    temp_degc
        Where it is wanted [degC].
    alpha_1_k
        Coefficient [1/K].
    alpha_at_degc
        Temperature to which the coefficient refers [degC].

    Returns
    -------
    float
        [ohm]

    Notes
    -----
    R(T) = R₀ (1 + α (T − T_α))/(1 + α (T₀ − T_α))

    """
    return (
        r_ohm
        * (1.0 + alpha_1_k * (temp_degc - alpha_at_degc))
        / (1.0 + alpha_1_k * (reference_degc - alpha_at_degc))
    )
