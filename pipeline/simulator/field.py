"""The magnetic field of the motor: one energy function of flux, everything else its gradient.

The state is flux, the energy W(psi_d, psi_q, eps) per phase pair is given, current is its
gradient and torque its derivative by angle, so reciprocity and conservation hold whatever the
effects. Compiled by numba; imported only where something is simulated.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit
from numpy.typing import NDArray

from pipeline.simulator.plant import Plant

Array = NDArray[np.float64]
Pair = tuple[float, float]

SQRT3 = math.sqrt(3.0)


@njit(cache=True)
def magnet(eps: float, degc: float, p: Plant) -> tuple[float, float, float, float]:
    """Magnet flux in the rotor frame and its derivative by electrical angle.

    Parameters
    ----------
    eps
        Electrical angle [rad].
    degc
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    psi_d, psi_q, dpsi_d/deps, dpsi_q/deps
        [Wb, Wb, Wb/rad, Wb/rad]

    Notes
    -----
    ψ(T) = ψ_25 (1 + α (T − 25)). The 5th, 7th, 11th and 13th harmonics of a phase's flux linkage
    are the orders 6 and 12 in the rotor frame: the 5th and 11th turn against the rotor, the 7th and
    13th with it.

    """
    psi = p.psi_wb * (1.0 + p.alpha_magnet * (degc - 25.0))
    if p.h5 == 0.0 and p.h7 == 0.0:
        return psi, 0.0, 0.0, 0.0
    a5, a7 = 6.0 * eps + p.p5, 6.0 * eps + p.p7
    a11, a13 = 12.0 * eps + p.p11, 12.0 * eps + p.p13
    c5, s5, c7, s7 = math.cos(a5), math.sin(a5), math.cos(a7), math.sin(a7)
    c11, s11, c13, s13 = math.cos(a11), math.sin(a11), math.cos(a13), math.sin(a13)
    d = 1.0 + p.h5 * c5 + p.h7 * c7 + p.h11 * c11 + p.h13 * c13
    q = p.h7 * s7 - p.h5 * s5 + p.h13 * s13 - p.h11 * s11
    dd = -6.0 * (p.h5 * s5 + p.h7 * s7) - 12.0 * (p.h11 * s11 + p.h13 * s13)
    dq = 6.0 * (p.h7 * c7 - p.h5 * c5) + 12.0 * (p.h13 * c13 - p.h11 * c11)
    return psi * d, psi * q, psi * dd, psi * dq


@njit(cache=True)
def bend_q(y: float, p: Plant) -> float:
    """Current that saturation adds on the q axis.

    Parameters
    ----------
    y
        q flux less the magnet's [Wb].
    p
        The plant.

    Returns
    -------
    float
        [A], odd in y.

    Notes
    -----
    (ψ₀/L_q)(sinh(y/ψ₀) − y/ψ₀), or s (y/L_q) |y/ψ₀|ⁿ with the strength s.

    """
    if p.sat_q == 0.0:
        return 0.0
    if p.sat_form == 1.0:
        u = y / p.sat_psi_q
        return float(p.sat_psi_q / p.lq_h * (math.sinh(u) - u))
    return float(y / p.lq_h * p.sat_q * abs(y / p.sat_psi_q) ** p.sat_exponent)


@njit(cache=True)
def slope_q(y: float, p: Plant) -> float:
    """Derivative of `bend_q` by flux [A/Wb].

    Parameters
    ----------
    y
        q flux less the magnet's [Wb].
    p
        The motor in numbers.

    """
    if p.sat_q == 0.0:
        return 0.0
    if p.sat_form == 1.0:
        return float((math.cosh(y / p.sat_psi_q) - 1.0) / p.lq_h)
    n = p.sat_exponent
    return float((n + 1.0) * p.sat_q * abs(y / p.sat_psi_q) ** n / p.lq_h)


@njit(cache=True)
def current(
    psi_d: float, psi_q: float, eps: float, degc: float, p: Plant
) -> tuple[float, float, float]:
    """Currents of a state, and the derivative of the field energy by angle.

    Parameters
    ----------
    psi_d, psi_q
        Flux linkages in the rotor frame [Wb].
    eps
        Electrical angle [rad].
    degc
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    i_d, i_q
        dW/dψ [A].
    w_eps
        dW/dε at constant rotor-frame flux [V·A·s/rad].

    Notes
    -----
    W(ψ_d, ψ_q, ε) is 2/3 of the field energy, and every effect is a term of it. So the currents are
    reciprocal (di_d/dψ_q = di_q/dψ_d) and no term makes energy.

    References
    ----------
    Woodson and Melcher, Electromechanical Dynamics, part I, Wiley, 1968, ch. 3 (energy state
    functions).

    """
    md, mq, md_eps, mq_eps = magnet(eps, degc, p)
    x, y = psi_d - md, psi_q - mq
    nu_d, nu_q, lean = 1.0, 1.0, 0.0
    if p.nu_q != 0.0 or p.nu_d != 0.0:
        angle = 6.0 * eps + p.nu_phase
        c, s = math.cos(angle), math.sin(angle)
        nu_d, nu_q = 1.0 + p.nu_d * c, 1.0 + p.nu_q * c
        lean = -3.0 * s * (p.nu_d * x * x / p.ld_h + p.nu_q * y * y / p.lq_h)
    i_d = nu_d * x / p.ld_h
    i_q = nu_q * y / p.lq_h + bend_q(y, p)
    if p.sat_d != 0.0:
        u = x / p.x0_wb
        i_d += p.sat_d * p.x0_wb / p.ld_h * 4.0 * (math.sqrt(1.0 + 0.25 * u * u) - 1.0)
    if p.cross != 0.0:
        root = math.sqrt(p.x0_wb * p.x0_wb + x * x)
        tie = p.cross / p.lq_h * y
        i_q += tie * x / root
        i_d += 0.5 * tie * y * p.x0_wb * p.x0_wb / (root * root * root)
    return i_d, i_q, lean - i_d * md_eps - i_q * mq_eps


@njit(cache=True)
def stiffness(
    psi_d: float, psi_q: float, eps: float, degc: float, p: Plant
) -> tuple[float, float, float]:
    """Reciprocal inductances: the second derivatives of the field energy.

    Parameters
    ----------
    psi_d, psi_q
        Flux linkages in the rotor frame [Wb].
    eps
        Electrical angle [rad].
    degc
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    g_dd, g_qq, g_dq
        d²W/dψ² [1/H].

    """
    md, mq, _, _ = magnet(eps, degc, p)
    x, y = psi_d - md, psi_q - mq
    c = math.cos(6.0 * eps + p.nu_phase)
    g_dd = (1.0 + p.nu_d * c) / p.ld_h
    g_qq = (1.0 + p.nu_q * c) / p.lq_h + slope_q(y, p)
    g_dq = 0.0
    if p.sat_d != 0.0:
        u = x / p.x0_wb
        g_dd += p.sat_d / p.ld_h * u / math.sqrt(1.0 + 0.25 * u * u)
    if p.cross != 0.0:
        square = p.x0_wb * p.x0_wb
        root = math.sqrt(square + x * x)
        tie = p.cross / p.lq_h
        g_qq += tie * x / root
        g_dq += tie * y * square / root**3
        g_dd -= 1.5 * tie * y * y * square * x / root**5
    return g_dd, g_qq, g_dq


@njit(cache=True)
def energy(psi_d: float, psi_q: float, eps: float, degc: float, p: Plant) -> float:
    """Stored field energy, zero at zero current.

    Parameters
    ----------
    psi_d, psi_q
        Flux linkages in the rotor frame [Wb].
    eps
        Electrical angle [rad].
    degc
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    float
        1.5 W [J]: the three phases of an amplitude-invariant frame.

    """
    md, mq, _, _ = magnet(eps, degc, p)
    x, y = psi_d - md, psi_q - mq
    c = math.cos(6.0 * eps + p.nu_phase)
    w = 0.5 * (1.0 + p.nu_d * c) * x * x / p.ld_h + 0.5 * (1.0 + p.nu_q * c) * y * y / p.lq_h
    if p.sat_q != 0.0 and p.sat_form == 1.0:
        u = y / p.sat_psi_q
        w += p.sat_psi_q**2 / p.lq_h * (math.cosh(u) - 1.0 - 0.5 * u * u)
    elif p.sat_q != 0.0:
        n = p.sat_exponent
        w += y * y / p.lq_h * p.sat_q * abs(y / p.sat_psi_q) ** n / (n + 2.0)
    if p.sat_d != 0.0:
        h = 0.5 * x / p.x0_wb
        arc = math.copysign(math.log(abs(h) + math.sqrt(1.0 + h * h)), h)
        w += p.sat_d * p.x0_wb**2 / p.ld_h * 4.0 * (h * math.sqrt(1.0 + h * h) + arc - 2.0 * h)
    if p.cross != 0.0:
        w += 0.5 * p.cross / p.lq_h * y * y * x / math.sqrt(p.x0_wb**2 + x * x)
    return float(1.5 * w)


@njit(cache=True)
def flux(i_d: float, i_q: float, eps: float, degc: float, p: Plant) -> tuple[float, float]:
    """Flux that carries given currents: the inverse of `current`.

    Parameters
    ----------
    i_d, i_q
        Currents [A].
    eps
        Electrical angle [rad].
    degc
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    psi_d, psi_q
        [Wb], by Newton's method to rounding.

    """
    md, mq, _, _ = magnet(eps, degc, p)
    d, q = md + p.ld_h * i_d, mq + p.lq_h * i_q
    for _ in range(60):
        now_d, now_q, _ = current(d, q, eps, degc, p)
        g_dd, g_qq, g_dq = stiffness(d, q, eps, degc, p)
        r_d, r_q = i_d - now_d, i_q - now_q
        det = g_dd * g_qq - g_dq * g_dq
        step_d = (g_qq * r_d - g_dq * r_q) / det
        step_q = (g_dd * r_q - g_dq * r_d) / det
        d += step_d
        q += step_q
        if abs(step_d) + abs(step_q) <= 1e-15 * (abs(d) + abs(q) + 1e-12):
            break
    return d, q


@njit(cache=True)
def torque_of(psi_d: float, psi_q: float, i_d: float, i_q: float, w_eps: float, p: Plant) -> float:
    """Electromagnetic torque of a state.

    Parameters
    ----------
    psi_d, psi_q
        Flux linkages in the rotor frame [Wb].
    i_d, i_q
        Their currents [A].
    w_eps
        dW/dε at constant rotor-frame flux [V·A·s/rad].
    p
        The plant.

    Returns
    -------
    float
        [N·m]; cogging is not in it.

    Notes
    -----
    T = 1.5 p (ψ_d i_q − ψ_q i_d − dW/dε), which is −d(1.5 W)/dθ at constant flux of the phases.

    """
    return float(1.5 * p.pole_pairs * (psi_d * i_q - psi_q * i_d - w_eps))


@njit(cache=True)
def cogging(theta: float, p: Plant) -> float:
    """Torque of the magnets against the slots on the rotor.

    Parameters
    ----------
    theta
        Shaft angle [rad].
    p
        The plant.

    Returns
    -------
    float
        Σ A_k sin(k θ + φ_k) [N·m].

    """
    torque = 0.0
    for k in range(p.lines):
        torque += p.cog_amplitude[k] * math.sin(p.cog_order[k] * theta + p.cog_phase[k])
    return torque


@njit(cache=True)
def fluxes(i_d: Array, i_q: Array, eps: Array, degc: float, p: Plant) -> Array:
    """Flux [n, 2] of currents [n] at electrical angles [n].

    Parameters
    ----------
    i_d
        Current along d [n, A].
    i_q
        Current along q [n, A].
    eps
        Electrical angle [n, rad].
    degc
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    psi_wb = np.empty((i_d.size, 2))
    for k in range(i_d.size):
        psi_wb[k, 0], psi_wb[k, 1] = flux(i_d[k], i_q[k], eps[k], degc, p)
    return psi_wb


@njit(cache=True)
def torques(i_d: Array, i_q: Array, eps: Array, degc: float, p: Plant) -> Array:
    """Electromagnetic torque [n] of currents [n] at electrical angles [n], cogging not in.

    Parameters
    ----------
    i_d
        Current along d [n, A].
    i_q
        Current along q [n, A].
    eps
        Electrical angle [n, rad].
    degc
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    torque_nm = np.empty(i_d.size)
    for k in range(i_d.size):
        d, q = flux(i_d[k], i_q[k], eps[k], degc, p)
        now_d, now_q, w_eps = current(d, q, eps[k], degc, p)
        torque_nm[k] = torque_of(d, q, now_d, now_q, w_eps, p)
    return torque_nm


@njit(cache=True)
def inductances(eps: Array, degc: float, p: Plant) -> Array:
    """Incremental Ld, Lq, Ldq [n, 3] at zero current, at electrical angles [n].

    Parameters
    ----------
    eps
        Electrical angle [n, rad].
    degc
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    l_h = np.empty((eps.size, 3))
    for k in range(eps.size):
        md, mq, _, _ = magnet(eps[k], degc, p)
        g_dd, g_qq, g_dq = stiffness(md, mq, eps[k], degc, p)
        det = g_dd * g_qq - g_dq * g_dq
        l_h[k, 0], l_h[k, 1], l_h[k, 2] = g_qq / det, g_dd / det, -g_dq / det
    return l_h


@njit(cache=True)
def open_flux(eps: Array, degc: Array, p: Plant) -> Array:
    """Phase flux linkages a, b, c [n, 3] with the terminals open, at electrical angles [n].

    Parameters
    ----------
    eps
        Electrical angle [n, rad].
    degc
        Temperature of the magnets [n, degC].
    p
        The motor in numbers.

    """
    psi_wb = np.empty((eps.size, 3))
    for k in range(eps.size):
        d, q, _, _ = magnet(eps[k], degc[k], p)
        c, s = math.cos(eps[k]), math.sin(eps[k])
        alpha, beta = c * d - s * q, s * d + c * q
        psi_wb[k, 0] = alpha
        psi_wb[k, 1] = -0.5 * alpha + 0.5 * SQRT3 * beta
        psi_wb[k, 2] = -0.5 * alpha - 0.5 * SQRT3 * beta
    return psi_wb


@njit(cache=True)
def open_emf(eps: Array, omega_elec: Array, degc: Array, p: Plant) -> Array:
    """Phase voltages with the terminals open.

    Parameters
    ----------
    eps
        Electrical angle [n, rad].
    omega_elec
        Electrical speed [n, rad/s].
    degc
        Temperature of the magnets [n, degC].
    p
        The plant.

    Returns
    -------
    array [n, 3]
        a, b, c [V]: ω dψ/dε of `open_flux`.

    """
    emf_v = np.empty((eps.size, 3))
    for k in range(eps.size):
        d, q, d_eps, q_eps = magnet(eps[k], degc[k], p)
        c, s = math.cos(eps[k]), math.sin(eps[k])
        rate_d, rate_q = (d_eps - q) * omega_elec[k], (q_eps + d) * omega_elec[k]
        alpha, beta = c * rate_d - s * rate_q, s * rate_d + c * rate_q
        emf_v[k, 0] = alpha
        emf_v[k, 1] = -0.5 * alpha + 0.5 * SQRT3 * beta
        emf_v[k, 2] = -0.5 * alpha - 0.5 * SQRT3 * beta
    return emf_v
