"""Temperatures of winding and magnets, compiled: a network of two masses."""

from __future__ import annotations

import numpy as np
from numba import njit

from pipeline.simulator.field import Array
from pipeline.simulator.plant import Plant


@njit(cache=True)
def heat(
    t_w: float, t_m: float, watt: float, ambient: float, h: float, p: Plant
) -> tuple[float, float]:
    """Temperatures of winding and magnets a moment later.

    Parameters
    ----------
    t_w, t_m
        Of winding and magnets now [degC].
    watt
        Heat into the winding [W].
    ambient
        [degC]
    h
        Time [s].
    p
        The plant.

    Returns
    -------
    t_w, t_m
        After h [degC], by the midpoint rule.

    Notes
    -----
    C_w dT_w/dt = P − (T_w − T_m)/R_wm − (T_w − T_a)/R_wa

    C_m dT_m/dt = (T_w − T_m)/R_wm − (T_m − T_a)/R_ma

    """
    across = (t_w - t_m) / p.rth_wm
    rate_w = (watt - across - (t_w - ambient) / p.rth_wa) / p.cth_w
    rate_m = (across - (t_m - ambient) / p.rth_ma) / p.cth_m
    mid_w, mid_m = t_w + 0.5 * h * rate_w, t_m + 0.5 * h * rate_m
    across = (mid_w - mid_m) / p.rth_wm
    t_w += h * (watt - across - (mid_w - ambient) / p.rth_wa) / p.cth_w
    t_m += h * (across - (mid_m - ambient) / p.rth_ma) / p.cth_m
    return t_w, t_m


@njit(cache=True)
def warmed(watt_25: Array, start: tuple[float, float], ambient: float, h: float, p: Plant) -> Array:
    """Temperatures under copper losses, which grow with the temperature of the winding.

    Parameters
    ----------
    watt_25
        Copper losses as they would be at 25 degC [n, W].
    start
        Temperatures of winding and magnets at the first row [degC].
    ambient
        [degC]
    h
        Time between rows [s].
    p
        The plant.

    Returns
    -------
    array [n, 2]
        Of winding and magnets [degC].

    """
    temperatures_k = np.empty((watt_25.size, 2))
    t_w, t_m = start
    for k in range(watt_25.size):
        temperatures_k[k, 0], temperatures_k[k, 1] = t_w, t_m
        watt = watt_25[k] * (1.0 + p.alpha_copper * (t_w - 25.0))
        t_w, t_m = heat(t_w, t_m, watt, ambient, h, p)
    return temperatures_k
