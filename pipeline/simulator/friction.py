"""Friction of the shaft, compiled: its size, its part that grows with speed, its direction."""

from __future__ import annotations

import math

from numba import njit

from pipeline.simulator.plant import Plant


@njit(cache=True)
def grip(omega: float, torque: float, flux_ratio: float, p: Plant) -> float:
    """Size of the friction that opposes the direction of motion, whatever the speed.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    torque
        Electromagnetic torque, which loads the bearings [N·m].
    flux_ratio
        Flux over the magnets' at 25 degC [1].
    p
        The plant.

    Returns
    -------
    float
        [N·m], not negative.

    Notes
    -----
    f (T_c + μ |T| + T_s/(1 + (ω/ω_s)²)) + T_h (ψ/ψ_pm)^1.6: Coulomb, load-dependent, Stribeck and
    magnetic hysteresis, the last by Steinmetz's exponent. f is `friction`, by which bearings and
    seals differ at this time from what the motor states.

    References
    ----------
    Armstrong-Hélouvry, Dupont and Canudas de Wit, Automatica 30(7), 1994, 1083 (friction),
    doi:10.1016/0005-1098(94)90209-7.

    """
    size = p.coulomb + p.load_friction * abs(torque)
    if p.stribeck != 0.0:
        size += p.stribeck / (1.0 + (omega / p.stribeck_w) ** 2)
    size *= p.friction
    if p.hysteresis != 0.0:
        size += p.hysteresis * flux_ratio**1.6
    return float(size)


@njit(cache=True)
def fluid(omega: float, flux_ratio: float, p: Plant) -> float:
    """Friction that grows with speed.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    flux_ratio
        Flux over the magnets' at 25 degC [1].
    p
        The plant.

    Returns
    -------
    float
        [N·m], of the sign of the speed.

    Notes
    -----
    f B ω + T_w |ω/ω_rated|ⁿ sign ω + k ω (ψ/ψ_pm)²/(1 + (ω/ω_k)²): viscous, windage, and eddy
    currents that their own field keeps out at high speed.

    """
    drag = p.friction * p.b_visc * omega
    if p.windage != 0.0:
        u = abs(omega) / p.omega_rated
        drag += math.copysign(p.windage * u**p.windage_exponent, omega)
    if p.eddy != 0.0:
        drag += p.eddy * omega * flux_ratio * flux_ratio / (1.0 + (omega / p.eddy_knee) ** 2)
    return float(drag)


@njit(cache=True)
def direction(omega: float, bristle: float, p: Plant) -> float:
    """Sense of the friction, -1 to 1.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    bristle
        Deflection [rad].
    p
        The plant.

    Returns
    -------
    float
        z/z₀ of the bristle where there is one, else tanh(ω/ω_ε), a sign without a jump.

    """
    if p.bristle > 0.0:
        return float(bristle / p.bristle)
    return math.tanh(omega / p.omega_eps)


@njit(cache=True)
def bristle_after(bristle: float, travel: float, p: Plant) -> float:
    """Deflection of the bristle after a travel (Dahl's model).

    Parameters
    ----------
    bristle
        Deflection before [rad].
    travel
        Of the shaft, in one sense [rad].
    p
        The plant; `bristle` there is the largest deflection z₀.

    Returns
    -------
    float
        Deflection after [rad].

    Notes
    -----
    dz = dx (1 − sign(dx) z/z₀), solved exactly: z → ±z₀ with exp(−|Δx|/z₀).

    References
    ----------
    P. R. Dahl, Solid friction damping of mechanical vibrations, AIAA Journal 14(12), 1976, 1675,
    doi:10.2514/3.61511.

    """
    if p.bristle <= 0.0 or travel == 0.0:
        return bristle
    end = math.copysign(p.bristle, travel)
    return end + (bristle - end) * math.exp(-abs(travel) / p.bristle)
