"""Two terminals of a locked rotor, the third open: voltage steps, compiled."""

from __future__ import annotations

import numpy as np
from numba import njit

from pipeline.simulator.circuit import resistance_rise
from pipeline.simulator.field import Array, Pair, current, magnet, stiffness
from pipeline.simulator.plant import Plant

Circuit = tuple[float, float, float]


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
def pair_rate(flux: Pair, circuit: Circuit, volt: float, spot: Pair, p: Plant) -> Pair:
    """Flux rate that lets current change along the pair alone.

    Parameters
    ----------
    flux
        Flux linkages in d and q [Wb].
    circuit
        Space vector of one ampere through the pair, in d and q [1]; resistance of pair and supply
        [ohm].
    volt
        Open voltage of the supply [V].
    spot
        Electrical angle [rad] and temperature of the magnets [degC].
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
    way, ohm = (circuit[0], circuit[1]), circuit[2]
    g_dd, g_qq, g_dq = stiffness(flux[0], flux[1], spot[0], spot[1], p)
    det = g_dd * g_qq - g_dq * g_dq
    l_d = (g_qq * way[0] - g_dq * way[1]) / det
    l_q = (g_dd * way[1] - g_dq * way[0]) / det
    i = pair_current(flux, way, spot[0], spot[1], p)
    rate = (volt - ohm * i) / (1.5 * (way[0] * l_d + way[1] * l_q))
    return l_d * rate, l_q * rate


@njit(cache=True)
def advanced(
    flux: Pair, circuit: Circuit, ramp: Pair, time: tuple[float, int], spot: Pair, p: Plant
) -> Pair:
    """Flux after `time` = (step, how many), by RK4 under the voltage `ramp` = (start, slope).

    Parameters
    ----------
    flux
        Flux linkages [Wb].
    circuit
        As `pair_rate` takes it.
    ramp
        Voltage at the start [V] and its slope [V/s].
    time
        Length [s] and number of the steps.
    spot
        Electrical angle [rad] and temperature of the magnets [degC].
    p
        The motor in numbers.

    """
    d, q = flux
    h, slope = time[0], ramp[1]
    for m in range(time[1]):
        v1 = ramp[0] + slope * m * h
        v2, v4 = v1 + 0.5 * slope * h, v1 + slope * h
        a1, b1 = pair_rate((d, q), circuit, v1, spot, p)
        at = (d + 0.5 * h * a1, q + 0.5 * h * b1)
        a2, b2 = pair_rate(at, circuit, v2, spot, p)
        at = (d + 0.5 * h * a2, q + 0.5 * h * b2)
        a3, b3 = pair_rate(at, circuit, v2, spot, p)
        a4, b4 = pair_rate((d + h * a3, q + h * b3), circuit, v4, spot, p)
        d += h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        q += h * (b1 + 2.0 * b2 + 2.0 * b3 + b4) / 6.0
    return d, q


@njit(cache=True)
def pair_step(
    source: Array,
    time: tuple[float, int],
    pair: tuple[float, float, float, float],
    eps: float,
    warm: Pair,
    p: Plant,
) -> Array:
    """Voltage and current of one terminal pair, the rotor locked and the third terminal open.

    Parameters
    ----------
    source
        Open voltage of the supply [V] at each sample, linear between them except that a jump of
        more than half its largest value is an edge; and by how much of a sample such an edge comes
        before the later point [n + 1, 2].
    time
        Sampling period [s], and integration steps a sample.
    pair
        Current direction in alpha and beta [1], the pair's resistance at 25 degC and that of the
        supply [ohm].
    eps
        Electrical angle of the rotor [rad].
    warm
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
    volts, early = source[:, 0], source[:, 1]
    rows = np.empty((volts.size - 1, 2))
    c, s = np.cos(eps), np.sin(eps)
    way = (c * pair[0] + s * pair[1], c * pair[1] - s * pair[0])
    whole = pair[2] * resistance_rise(0.0, warm[0], p) + pair[3]
    circuit, spot = (way[0], way[1], whole), (eps, warm[1])
    d, q, _, _ = magnet(eps, warm[1], p)
    flux = (d, q)
    edge = 0.5 * np.max(np.abs(volts))
    step_s, substeps = time
    h = step_s / substeps
    for n in range(volts.size - 1):
        i = pair_current(flux, way, eps, warm[1], p)
        rows[n, 0], rows[n, 1] = volts[n] - pair[3] * i, i
        jump = volts[n + 1] - volts[n]
        if abs(jump) > edge:
            after = early[n + 1]
            first = (h * (1.0 - after), substeps)
            flux = advanced(flux, circuit, (volts[n], 0.0), first, spot, p)
            if after > 0.0:
                last = (h * after, substeps)
                flux = advanced(flux, circuit, (volts[n + 1], 0.0), last, spot, p)
        else:
            flux = advanced(flux, circuit, (volts[n], jump / step_s), (h, substeps), spot, p)
    return rows
