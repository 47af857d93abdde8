"""Shaft mechanics: drag, coasting, cogging orders.

References: [1] B. Armstrong-Hélouvry, Control of Machines with Friction, 1991. [2] Z. Q. Zhu,
D. Howe, Influence of design parameters on cogging torque, IEEE Trans. Energy Convers. 15, 2000.
"""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def friction_nm(
    omega_mech_rad_s: ArrayLike, torque_coulomb_nm: float, b_visc_nm_s_rad: float
) -> Array:
    """Drag [n, N·m] that opposes positive rotation: T_c sign(ω) + b ω [1]."""
    omega = np.asarray(omega_mech_rad_s, dtype=np.float64)
    drag: Array = torque_coulomb_nm * np.sign(omega) + b_visc_nm_s_rad * omega
    return drag


def coast_rad_s(
    t_s: ArrayLike, omega_start_rad_s: float, coulomb_rad_s2: float, viscous_1_s: float
) -> Array:
    """Speed [n, rad/s] of a rotor that coasts from ω0 > 0, until it stops [1].

    dω/dt = −a − ω/τ with a = T_c/J and 1/τ = b/J: ω = (ω0 + aτ) e^{−t/τ} − aτ, not below 0. Only
    T_c/J and b/J enter, so a coast-down alone does not tell J.
    """
    t = np.asarray(t_s, dtype=np.float64)
    # expm1 keeps the limit of a small viscous part, where the closed form divides by zero.
    lost = -np.expm1(-viscous_1_s * t) / viscous_1_s if viscous_1_s != 0.0 else t
    omega: Array = omega_start_rad_s - (coulomb_rad_s2 + viscous_1_s * omega_start_rad_s) * lost
    return np.maximum(omega, 0.0)


def cogging_order(slots: int, pole_pairs: int) -> int:
    """Fundamental cogging order a mechanical turn: LCM(slots, 2p) [2]."""
    return math.lcm(slots, 2 * pole_pairs)
