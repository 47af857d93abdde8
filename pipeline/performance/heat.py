"""What a winding may carry: continuously (duty S1), and for how long (duty S2).

References: IEC 60034-1, 4.2.1 (S1), 4.2.2 (S2), 8.10 (limits of temperature rise); A. Boglietti et
al., IEEE Trans. Ind. Electron. 56(3), 2009, 871, doi:10.1109/TIE.2008.2011622 (lumped networks).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.records.capture import Array


@dataclass(frozen=True, slots=True)
class Heat:
    """The path of heat from winding to ambient.

    Attributes
    ----------
    rth_k_w
        Steady resistance, winding to ambient [n].
    cth_j_k
        Heat capacity of the winding [n].
    tau_winding_s, tau_body_s
        Time constants of winding and body, as a heat run gives them [n].

    """

    rth_k_w: Array
    cth_j_k: Array
    tau_winding_s: Array
    tau_body_s: Array


def continuous_current_a(
    rth_k_w: Array, r_limit_ohm: Array, rise_k: float, other_w: Array
) -> Array:
    """Current at which the winding settles at its temperature limit.

    Parameters
    ----------
    rth_k_w
        Resistance, winding to ambient [n].
    r_limit_ohm
        Phase resistance at the limit [n].
    rise_k
        Limit less ambient temperature.
    other_w
        Other losses that reach the ambient the same way [n].

    Returns
    -------
    array [n]
        Phase peak [A]; 0 where the other losses alone reach the limit.

    Notes
    -----
    I = √((ΔT/R_th − P_other) / (1.5 R)).

    """
    left = np.maximum(rise_k / rth_k_w - other_w, 0.0)
    return np.sqrt(left / (1.5 * r_limit_ohm))


def time_to_limit_s(
    heat: Heat, loss_w: Array, growth_1_k: Array, rise_k: float, longest_s: float = 1e6
) -> Array:
    """Time [n, s] from ambient to a rise of the winding at a constant current; inf for never.

    Parameters
    ----------
    heat : Heat
        The network.
    loss_w : array [n], W
        Copper loss at ambient temperature.
    growth_1_k : array [n], 1/K
        Its growth with the winding's temperature, over that loss.
    rise_k : float, K
        The rise allowed.
    longest_s : float, s
        What is longer counts as never.

    Returns
    -------
    array [n], s

    Notes
    -----
    dT_w/dt = k P (1 + g T_w) - T_w/τ_w + b T_m and dT_m/dt = c T_w - T_m/τ_m with k = 1/C_w, rises
    over ambient. The winding's course depends on b c alone, which the steady state gives:
    R_th = k/(1/τ_w - b c τ_m). The step response of the matrix is taken by its eigenvalues, and the
    time by bisection, since it rises all the way.

    """
    k = 1.0 / heat.cth_j_k
    outward, back = 1.0 / heat.tau_winding_s, 1.0 / heat.tau_body_s
    product = np.maximum((outward - k / heat.rth_k_w) * back, 0.0)
    own = outward - k * loss_w * growth_1_k
    mean = -0.5 * (own + back)
    root = np.sqrt(0.25 * (own - back) ** 2 + product) + 1e-15
    fast, slow = mean - root, mean + root

    def rise(t_s: Array) -> Array:
        # T_w = k P Σ (λ + 1/τ_m)/(λ - λ') (e^{λt} - 1)/λ
        total = np.zeros_like(t_s)
        with np.errstate(over="ignore", invalid="ignore"):
            for one, other in ((fast, slow), (slow, fast)):
                grown = np.where(np.abs(one) < 1e-14, t_s, np.expm1(one * t_s) / one)
                total = total + (one + back) / (one - other) * grown
            return np.asarray(np.nan_to_num(k * loss_w * total, nan=np.inf))

    low, high = np.zeros_like(k), np.full_like(k, longest_s)
    never = rise(high) < rise_k
    for _ in range(60):
        middle = 0.5 * (low + high)
        over = rise(middle) >= rise_k
        low, high = np.where(over, low, middle), np.where(over, middle, high)
    return np.where(never, np.inf, high)
