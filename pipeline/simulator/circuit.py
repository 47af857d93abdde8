"""Phase equations of the motor, compiled.

v_x - v_n = R_x i_x + drop(i_x) + dpsi_x/dt for the phases a, b, c.
"""

from __future__ import annotations

import math

from numba import njit

from pipeline.simulator.field import SQRT3, Array, Pair, current, torque_of
from pipeline.simulator.motion import Mechanics, extra
from pipeline.simulator.plant import Plant

Field = tuple[float, float, float, float, float, float, float, float, float]
"""What `windings` returns."""


@njit(cache=True)
def phase_drop(i: float, p: Plant) -> float:
    """Voltage that dead time and switches take from one phase, less what a compensation gives back.

    Parameters
    ----------
    i
        Phase current [A].
    p
        The plant.

    Returns
    -------
    float
        V_d i/√(i² + i_knee²) − V_c clip(i/i_ramp, ±1) [V].

    References
    ----------
    Jeong and Park, IEEE Trans. Ind. Electron. 38(2), 1991, 108 (dead-time effect),
    doi:10.1109/41.88903.

    """
    given_v = p.given_v * min(max(i / p.given_ramp_a, -1.0), 1.0)
    return float(p.dead_v * i / math.sqrt(i * i + p.dead_knee_a * p.dead_knee_a) - given_v)


@njit(cache=True)
def resistance_rise(omega: float, degc: float, p: Plant) -> float:
    """Factor on the phase resistances from temperature and skin effect.

    Parameters
    ----------
    omega
        Shaft speed [rad/s].
    degc
        Temperature of the winding [degC].
    p
        The plant.

    Returns
    -------
    float
        (1 + α (T − 25)) (1 + s u²/(1 + (u/u_knee)²)) [1], u the speed over the rated one.

    """
    factor = 1.0 + p.alpha_copper * (degc - 25.0)
    if p.skin != 0.0:
        u = p.pole_pairs * omega / p.omega_elec_rated
        factor *= 1.0 + p.skin * u * u / (1.0 + (u / p.skin_knee) ** 2)
    return float(factor)


@njit(cache=True)
def windings(flux: Pair, mechanics: Mechanics, volt: Pair, warm: Pair, p: Plant) -> Field:
    """Phase equations of the motor at a state.

    Parameters
    ----------
    flux
        Stator-frame flux linkages, alpha and beta [Wb].
    mechanics
        Angle and speed of the rotor, then of the far mass [rad, rad/s].
    volt
        Applied voltage, alpha and beta [V].
    warm
        Temperatures of winding and magnets [degC].
    p
        The plant.

    Returns
    -------
    tuple
        Flux rates, alpha and beta [V]; electromagnetic torque [N·m]; powers in, in copper and in
        switches [W]; i_d and i_q [A]; flux over the magnets' at 25 degC [1].

    Notes
    -----
    v_x − v_n = R_x i_x + drop(i_x) + dψ_x/dt for the phases a, b, c. The star point v_n takes the
    mean of the three, which alpha and beta do not see.

    """
    theta, omega = mechanics[0], mechanics[1]
    eps = p.pole_pairs * theta
    c, s = math.cos(eps), math.sin(eps)
    psi_d, psi_q = c * flux[0] + s * flux[1], c * flux[1] - s * flux[0]
    i_d, i_q, w_eps = current(psi_d, psi_q, eps, warm[1], p)
    i_alpha, i_beta = c * i_d - s * i_q, s * i_d + c * i_q
    i_a = i_alpha
    i_b = -0.5 * i_alpha + 0.5 * SQRT3 * i_beta
    i_c = -0.5 * i_alpha - 0.5 * SQRT3 * i_beta
    rise = resistance_rise(omega, warm[0], p)
    u_a, u_b, u_c = rise * p.r_a_ohm * i_a, rise * p.r_b_ohm * i_b, rise * p.r_c_ohm * i_c
    copper, switches = u_a * i_a + u_b * i_b + u_c * i_c, 0.0
    if p.dead_v != 0.0:
        e_a, e_b, e_c = phase_drop(i_a, p), phase_drop(i_b, p), phase_drop(i_c, p)
        switches = e_a * i_a + e_b * i_b + e_c * i_c
        u_a, u_b, u_c = u_a + e_a, u_b + e_b, u_c + e_c
    d_alpha = volt[0] - (2.0 * u_a - u_b - u_c) / 3.0
    d_beta = volt[1] - (u_b - u_c) / SQRT3
    if p.extras > 0:
        u_d = extra(1, (theta, omega), (i_d, i_q), warm, p)
        u_q = extra(2, (theta, omega), (i_d, i_q), warm, p)
        d_alpha -= c * u_d - s * u_q
        d_beta -= s * u_d + c * u_q
    torque = torque_of(psi_d, psi_q, i_d, i_q, w_eps, p)
    ratio = math.sqrt(psi_d * psi_d + psi_q * psi_q) / p.psi_wb if p.psi_wb > 0.0 else 0.0
    power = 1.5 * (volt[0] * i_alpha + volt[1] * i_beta)
    return d_alpha, d_beta, torque, power, copper, switches, i_d, i_q, ratio


@njit(cache=True)
def stator_current(y: Array, t_m: float, p: Plant) -> Pair:
    """Currents in alpha and beta that belong to a state [A].

    Parameters
    ----------
    y
        State of the integration.
    t_m
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    eps = p.pole_pairs * y[2]
    c, s = math.cos(eps), math.sin(eps)
    i_d, i_q, _ = current(c * y[0] + s * y[1], c * y[1] - s * y[0], eps, t_m, p)
    return c * i_d - s * i_q, s * i_d + c * i_q
