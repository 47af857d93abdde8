"""Field-oriented control, compiled: the numbers of the loop, and the voltage it commands."""

from __future__ import annotations

import math
from typing import NamedTuple

from numba import njit

from pipeline.simulator.field import Array, Pair


class Control(NamedTuple):
    """Controller, inverter and the sensors that are inside the loop."""

    pole_pairs: float
    period_s: float
    substeps: int
    substeps_before: int
    v_limit: float
    l_d: float
    l_q: float
    psi: float
    kp_d: float
    kp_q: float
    ki: float
    speed_loop: bool
    kp_speed: float
    ki_speed: float
    i_limit: float
    held_speed: bool
    dyno_nms: float
    dyno_nm: float
    in_coupling: bool
    at_stator: bool
    gain_a: float
    gain_b: float
    gain_c: float
    offset_a: float
    offset_b: float
    offset_c: float
    lsb_current: float
    delay_s: float
    angle_offset: float
    angle_wobble: float
    angle_wobble_phase: float
    angle_wobble_order: float
    angle_play: float
    angle_late_s: float
    lsb_angle: float
    speed_lag_s: float
    ambient: float
    temp_winding: float
    temp_magnet: float
    theta: float
    omega: float


@njit(cache=True)
def command(loop: Array, seen: Pair, eps: float, omega: float, want: Array, c: Control) -> Pair:
    """Voltage vector for the next period, by field-oriented control.

    Parameters
    ----------
    loop
        Integrators of d [V], q [V] and speed [A], changed in place; they stop at the limits.
    seen
        Currents as the sensors report them, alpha and beta [A].
    eps
        Electrical angle as seen [rad].
    omega
        Shaft speed as seen [rad/s].
    want
        d current [A], q current [A] or speed [rad/s], and more that is not used here.
    c
        The controller.

    Returns
    -------
    v_alpha, v_beta
        [V], turned ahead to the middle of the period in which it acts.

    Notes
    -----
    v_d = K_d e_d + ∫k_i e_d − ω L_q i_q and v_q = K_q e_q + ∫k_i e_q + ω (ψ + L_d i_d), cut in
    length at the limit.

    """
    ce, se = math.cos(eps), math.sin(eps)
    i_d, i_q = ce * seen[0] + se * seen[1], ce * seen[1] - se * seen[0]
    want_q = want[1]
    if c.speed_loop:
        slip = want[1] - omega
        want_q = c.kp_speed * slip + loop[2]
        if abs(want_q) < c.i_limit or want_q * slip < 0.0:
            loop[2] += c.ki_speed * slip * c.period_s
        want_q = min(max(want_q, -c.i_limit), c.i_limit)
    error_d, error_q = want[0] - i_d, want_q - i_q
    omega_e = c.pole_pairs * omega
    v_d = c.kp_d * error_d + loop[0] - omega_e * c.l_q * i_q
    v_q = c.kp_q * error_q + loop[1] + omega_e * (c.psi + c.l_d * i_d)
    size = math.sqrt(v_d * v_d + v_q * v_q)
    if size > c.v_limit:
        v_d, v_q = v_d * c.v_limit / size, v_q * c.v_limit / size
    else:
        loop[0] += c.ki * error_d * c.period_s
        loop[1] += c.ki * error_q * c.period_s
    lead = eps + omega_e * c.period_s * (1.5 - c.substeps_before / c.substeps)
    cl, sl = math.cos(lead), math.sin(lead)
    return cl * v_d - sl * v_q, sl * v_d + cl * v_q
