"""Two terminals of a locked rotor, the third open: voltage steps, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from pipeline.simulator.converter import resistance_rise
from pipeline.simulator.field import Array, current, magnet, stiffness
from pipeline.simulator.plant import Plant

Pair = tuple[float, float]


@njit(cache=True)
def pair_current(flux: Pair, way: Pair, eps: float, t_m: float, p: Plant) -> float:
    """Current through a terminal pair.

    Parameters
    ----------
    flux
        Flux linkages in d and q [Wb].
    way
        Space vector of one ampere through the pair, in d and q [1]; its length is 2/√3.
    eps
        Electrical angle [rad].
    t_m
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    float
        ¾ (way · i) [A], which is the current where it lies along `way`.

    """
    i_d, i_q, _ = current(flux[0], flux[1], eps, t_m, p)
    return float(0.75 * (way[0] * i_d + way[1] * i_q))


@njit(cache=True)
def pair_rate(
    flux: Pair, way: Pair, volt: float, ohm: float, eps: float, t_m: float, p: Plant
) -> Pair:
    """Flux rate that lets current change along the pair alone.

    Parameters
    ----------
    flux
        Flux linkages in d and q [Wb].
    way
        Space vector of one ampere through the pair, in d and q [1].
    volt
        Open voltage of the supply [V].
    ohm
        Resistance of pair and supply [ohm].
    eps
        Electrical angle [rad].
    t_m
        Temperature of the magnets [degC].
    p
        The plant.

    Returns
    -------
    dpsi_d/dt, dpsi_q/dt
        [V]

    Notes
    -----
    dψ/dt = L way di/dt with L the incremental inductances, and v − R i = 1.5 way · dψ/dt.

    """
    g_dd, g_qq, g_dq = stiffness(flux[0], flux[1], eps, t_m, p)
    det = g_dd * g_qq - g_dq * g_dq
    l_d = (g_qq * way[0] - g_dq * way[1]) / det
    l_q = (g_dd * way[1] - g_dq * way[0]) / det
    i = pair_current(flux, way, eps, t_m, p)
    rate = (volt - ohm * i) / (1.5 * (way[0] * l_d + way[1] * l_q))
    return l_d * rate, l_q * rate


@njit(cache=True)
def advanced(
    flux: Pair,
    way: Pair,
    ramp: tuple[float, float],
    time: tuple[float, int],
    ohm: float,
    eps: float,
    t_m: float,
    p: Plant,
) -> Pair:
    """Flux after `time` = (step, how many), by RK4 under the voltage `ramp` = (start, slope).

    Parameters
    ----------
    flux
        Flux linkages [Wb].
    way
        Direction of the terminal pair in the rotor frame.
    ramp
        Voltage at the start [V] and its slope [V/s].
    time
        Length [s] and number of the steps.
    ohm
        Resistance of the pair [ohm].
    eps
        Electrical angle [rad].
    t_m
        Temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    d, q = flux
    h, slope = time[0], ramp[1]
    for m in range(time[1]):
        v1 = ramp[0] + slope * m * h
        v2, v4 = v1 + 0.5 * slope * h, v1 + slope * h
        a1, b1 = pair_rate((d, q), way, v1, ohm, eps, t_m, p)
        at = (d + 0.5 * h * a1, q + 0.5 * h * b1)
        a2, b2 = pair_rate(at, way, v2, ohm, eps, t_m, p)
        at = (d + 0.5 * h * a2, q + 0.5 * h * b2)
        a3, b3 = pair_rate(at, way, v2, ohm, eps, t_m, p)
        a4, b4 = pair_rate((d + h * a3, q + h * b3), way, v4, ohm, eps, t_m, p)
        d += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        q += h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
    return d, q


@njit(cache=True)
def pair_step(
    source: Array,
    early: Array,
    step_s: float,
    substeps: int,
    pair: tuple[float, float, float],
    source_ohm: float,
    eps: float,
    t_w: float,
    t_m: float,
    p: Plant,
) -> Array:
    """Voltage and current of one terminal pair, the rotor locked and the third terminal open.

    Parameters
    ----------
    source
        Open voltage of the supply at each sample [n + 1, V], linear between them except that a jump
        of more than half its largest value is an edge.
    early
        By how much of a sample an edge comes before the later point [n + 1, samples].
    step_s
        Sampling period [s].
    substeps
        Integration steps a sample.
    pair
        Current direction in alpha and beta [1], and the pair's resistance at 25 degC [ohm].
    source_ohm
        Resistance of the supply [ohm].
    eps
        Electrical angle of the rotor [rad].
    t_w, t_m
        Temperatures of winding and magnets [degC].
    p
        The plant.

    Returns
    -------
    array [n, 2]
        [V] and [A], by the classical Runge-Kutta method of order four.

    Notes
    -----
    The state is the flux vector; the open terminal's voltage is what keeps its current zero.

    """
    out = np.empty((source.size - 1, 2))
    c, s = np.cos(eps), np.sin(eps)
    way = (c * pair[0] + s * pair[1], c * pair[1] - s * pair[0])
    whole = pair[2] * resistance_rise(0.0, t_w, p) + source_ohm
    d, q, _, _ = magnet(eps, t_m, p)
    flux = (d, q)
    edge = 0.5 * np.max(np.abs(source))
    h = step_s / substeps
    for n in range(source.size - 1):
        i = pair_current(flux, way, eps, t_m, p)
        out[n, 0], out[n, 1] = source[n] - source_ohm * i, i
        jump = source[n + 1] - source[n]
        if abs(jump) > edge:
            after = early[n + 1]
            first = (h * (1.0 - after), substeps)
            flux = advanced(flux, way, (source[n], 0.0), first, whole, eps, t_m, p)
            if after > 0.0:
                last = (h * after, substeps)
                flux = advanced(flux, way, (source[n + 1], 0.0), last, whole, eps, t_m, p)
        else:
            ramp = (source[n], jump / step_s)
            flux = advanced(flux, way, ramp, (h, substeps), whole, eps, t_m, p)
    return out
