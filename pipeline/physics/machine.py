"""The synchronous machine in its rotor frame; complex numbers are d + jq, amplitude-invariant.

References: [1] R. Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, 2010,
ch. 3. [2] E. Armando et al., Experimental identification of the magnetic model of synchronous
machines, IEEE Trans. Ind. Appl. 49 (5), 2013.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


def linear_flux_wb(i_a: ArrayLike, ld_h: float, lq_h: float, psi_pm_wb: float) -> Complex:
    """Flux linkage [n, Wb] of currents [n, A] without saturation: L_d i_d + psi + j L_q i_q [1]."""
    current = np.asarray(i_a, dtype=np.complex128)
    flux: Complex = ld_h * current.real + psi_pm_wb + 1j * lq_h * current.imag
    return flux


def steady_voltage_v(
    i_a: ArrayLike, flux_wb: ArrayLike, r_phase_ohm: ArrayLike, omega_elec_rad_s: ArrayLike
) -> Complex:
    """Terminal voltage [n, V] at constant current and electrical speed: v = R i + jω ψ [1]."""
    drop = np.asarray(r_phase_ohm) * np.asarray(i_a, dtype=np.complex128)
    voltage: Complex = drop + 1j * np.asarray(omega_elec_rad_s) * np.asarray(flux_wb)
    return voltage


def steady_flux_wb(
    v_v: ArrayLike, i_a: ArrayLike, r_phase_ohm: ArrayLike, omega_elec_rad_s: ArrayLike
) -> Complex:
    """Flux linkage [n, Wb] at constant current and electrical speed: ψ = (v − R i)/jω [2].

    ψ_d = (v_q − R i_q)/ω, ψ_q = −(v_d − R i_d)/ω; without meaning where the speed is zero.
    """
    emf = np.asarray(v_v, dtype=np.complex128) - np.asarray(r_phase_ohm) * np.asarray(i_a)
    flux: Complex = emf / (1j * np.asarray(omega_elec_rad_s, dtype=np.float64))
    return flux


def torque_nm(flux_wb: ArrayLike, i_a: ArrayLike, pole_pairs: int) -> Array:
    """Air-gap torque [n, N·m]: T = 1.5 p (ψ_d i_q − ψ_q i_d).

    In the linear case 1.5 p (psi i_q + (L_d − L_q) i_d i_q) [1]; P = 1.5 Re(v i*) is its power.
    """
    product = np.conj(np.asarray(flux_wb, dtype=np.complex128)) * np.asarray(i_a)
    torque: Array = 1.5 * pole_pairs * np.asarray(product.imag)
    return torque
