"""The ideal permanent-magnet machine in its rotor frame, amplitude-invariant, motor convention.

Reference: [1] IEEE Std 1812-2014, clause 3; [2] P. Vas, Sensorless Vector and Direct Torque
Control, 1998, ch. 2.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class DqMeans:
    """Means over a window [w]: currents [A], their rates [A/s], speed [rad/s, electrical]."""

    id_a: Array
    iq_a: Array
    id_rate_a_s: Array
    iq_rate_a_s: Array
    omega_elec_rad_s: Array


def dq_voltages(
    state: DqMeans, r_ohm: Array, ld_h: float, lq_h: float, psi_wb: Array
) -> tuple[Array, Array]:
    """Rotor-frame voltages of the ideal machine.

    Parameters
    ----------
    state
        Means over windows: currents, their rates, electrical speed.
    r_ohm
        Phase resistance at the temperature of each window [w, ohm].
    ld_h, lq_h
        Inductances [H].
    psi_wb
        Magnet flux linkage, phase peak, at the temperature of each window [w, Wb].

    Returns
    -------
    v_d, v_q [w, V]

    Notes
    -----
    v_d = R i_d + L_d di_d/dt − ω L_q i_q

    v_q = R i_q + L_q di_q/dt + ω (L_d i_d + ψ), with ω the electrical speed.

    References
    ----------
    IEEE Std 1812-2014, clause 3.
    P. Vas, Sensorless Vector and Direct Torque Control, Oxford University Press, 1998, ch. 2.

    """
    speed = state.omega_elec_rad_s
    vd = r_ohm * state.id_a + ld_h * state.id_rate_a_s - speed * lq_h * state.iq_a
    vq = r_ohm * state.iq_a + lq_h * state.iq_rate_a_s + speed * (ld_h * state.id_a + psi_wb)
    return vd, vq


def air_gap_torque(
    id_a: Array, iq_a: Array, kt_nm_a: Array, pole_pairs: float, saliency_h: float
) -> Array:
    """Torque of the ideal machine: that of the magnets and that of saliency.

    Parameters
    ----------
    id_a, iq_a
        Rotor-frame currents, phase peak [n, A].
    kt_nm_a
        Torque constant 1.5 p ψ [n, N·m/A], of the peak ampere.
    pole_pairs
        p [1].
    saliency_h
        L_d − L_q [H], below zero with interior magnets.

    Returns
    -------
    array [n, N·m]

    Notes
    -----
    T = K_t i_q + 1.5 p (L_d − L_q) i_d i_q

    References
    ----------
    IEEE Std 1812-2014, clause 3.

    Examples
    --------
    >>> float(air_gap_torque(np.array(-2.0), np.array(3.0), np.array(0.5), 4.0, -0.125))
    6.0

    """
    return kt_nm_a * iq_a + 1.5 * pole_pairs * saliency_h * id_a * iq_a
