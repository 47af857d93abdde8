"""The most torque at each speed under a current and a voltage limit: MTPA, field weakening, MTPV.

References: T. M. Jahns, IEEE Trans. Ind. Appl. IA-23(4), 1987, 681, doi:10.1109/TIA.1987.4504966
(flux weakening); S. Morimoto et al., IEEE Trans. Ind. Appl. 26(5), 1990, 866, doi:10.1109/28.60058
(current and voltage limits, MTPA and MTPV).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pipeline.performance.machine import Machine, drag_nm, inductances_h, torque_nm, voltage_v
from pipeline.records.capture import Array

COARSE_DEG, FINER, ROUNDS = 3.0, ((3.0, 41), (0.15, 13)), 8
LEAST_DEG, MOST_DEG = -45.0, 90.0
CLOSE = 2e-3


@dataclass(frozen=True, slots=True)
class Point:
    """Currents of the most torque at one speed.

    Attributes
    ----------
    id_a, iq_a
        Phase peak [n]; NaN where no current is allowed.
    torque_nm
        Air-gap torque [n].

    """

    id_a: Array
    iq_a: Array
    torque_nm: Array


def most_torque(machine: Machine, limit_a: Array, limit_v: float, omega_rad_s: float) -> Point:
    """The most air-gap torque under both limits at one speed, for every draw.

    Parameters
    ----------
    machine : Machine
        Fields [n].
    limit_a : array [n], A
        Phase current, peak, at most.
    limit_v : float, V
        Phase voltage, peak, at most.
    omega_rad_s : float, rad/s
        Mechanical speed, 0 or more.

    Returns
    -------
    Point
        The angle of the current is searched on a grid of 3°, then of 0.15° and of 0.025° about the
        best.

    Notes
    -----
    With i_d = -I sin β and i_q = I cos β, the voltage is a quadratic in I at each β for given
    inductances, so the currents that the voltage allows are the ones between its roots. Torque is
    taken at the larger end within the current limit; inductances that go with the current follow in
    `ROUNDS` repetitions, each half way.

    """
    coarse = np.radians(np.arange(LEAST_DEG, MOST_DEG + 0.5 * COARSE_DEG, COARSE_DEG))
    beta = np.broadcast_to(coarse, (machine.r_ohm.size, coarse.size))
    best, point = _best(machine, beta, limit_a, limit_v, omega_rad_s)
    for reach_deg, count in FINER:
        steps = np.radians(reach_deg) * np.linspace(-1.0, 1.0, count)
        best, point = _best(machine, best[:, None] + steps, limit_a, limit_v, omega_rad_s)
    return point


def _best(
    machine: Machine, beta: Array, limit_a: Array, limit_v: float, omega_rad_s: float
) -> tuple[Array, Point]:
    """The best of angles [n, b, rad] for every draw, and its point."""
    current = allowed_current_a(machine, beta, limit_a, limit_v, omega_rad_s)
    id_a, iq_a = -current * np.sin(beta), current * np.cos(beta)
    torque = np.where(np.isfinite(current), torque_nm(machine, id_a, iq_a), -np.inf)
    at = np.argmax(torque, axis=1)[:, None]

    def taken(values: Array) -> Array:
        return np.take_along_axis(values, at, axis=1)[:, 0]

    most = taken(torque)
    most = np.where(np.isfinite(most), most, np.nan)
    return taken(beta), Point(taken(id_a), taken(iq_a), most)


def allowed_current_a(
    machine: Machine, beta: Array, limit_a: Array, limit_v: float, omega_rad_s: float
) -> Array:
    """The largest current that both limits allow, at given angles.

    Parameters
    ----------
    machine
        Constants of n draws.
    beta
        Angle of the current ahead of the q axis [n, b, rad].
    limit_a
        Current limit, phase peak [n].
    limit_v
        Phase voltage, peak.
    omega_rad_s
        Mechanical speed.

    Returns
    -------
    array [n, b]
        In A; NaN where no current is allowed.

    Notes
    -----
    With i_d = −I sin β and i_q = I cos β, v_d = I a_d and v_q = I a_q + ω ψ, so that |v|² = V² is a
    quadratic equation in I. Inductances that depend on the current are iterated.

    """
    omega = machine.pole_pairs * omega_rad_s
    r, psi = machine.r_ohm[:, None], machine.psi_wb[:, None]
    sine, cosine = np.sin(beta), np.cos(beta)
    current = np.broadcast_to(limit_a[:, None], beta.shape)
    for _ in range(ROUNDS if machine.bends else 1):
        filled = np.nan_to_num(current)
        ld, lq = inductances_h(machine, -filled * sine, filled * cosine)
        # v_d = I a_d and v_q = I a_q + ω ψ
        a_d, a_q = -r * sine - omega * lq * cosine, r * cosine - omega * ld * sine
        square, half = a_d**2 + a_q**2, a_q * omega * psi
        root = half**2 - square * ((omega * psi) ** 2 - limit_v**2)
        with np.errstate(invalid="ignore", divide="ignore"):
            low = (-half - np.sqrt(root)) / square
            high = (-half + np.sqrt(root)) / square
        most = np.minimum(high, limit_a[:, None])
        there = (root >= 0.0) & (most >= np.maximum(low, 0.0))
        half_way = 0.5 * (most + filled) if machine.bends else most
        current = np.where(there, half_way, np.nan)
    return current


def regime_of(machine: Machine, point: Point, limit_a: float, limit_v: float, omega: float) -> str:
    """What limits the torque of the first draw.

    Parameters
    ----------
    machine
        Constants of the draws.
    point
        Currents of the most torque.
    limit_a
        Current limit.
    limit_v
        Voltage limit.
    omega
        Mechanical speed [rad/s].

    Returns
    -------
    str
        `MTPA` where only the current limits, `field weakening` where both do, `MTPV` where only the
        voltage does, `none` where there is no torque.

    """
    if not np.isfinite(point.torque_nm[0]):
        return "none"
    one = machine.one(0)
    current = float(np.hypot(point.id_a[0], point.iq_a[0]))
    volts = float(voltage_v(one, point.id_a[:1], point.iq_a[:1], np.array([omega]))[0])
    if volts < limit_v * (1.0 - CLOSE):
        return "MTPA"
    return "field weakening" if current > limit_a * (1.0 - CLOSE) else "MTPV"


def shaft_torque_nm(machine: Machine, point: Point, omega_rad_s: float) -> Array:
    """What the shaft delivers.

    Parameters
    ----------
    machine
        Constants of n draws.
    point
        Currents of the most torque.
    omega_rad_s
        Mechanical speed.

    Returns
    -------
    array [n]
        Air-gap torque less drag [N·m]; 0 where nothing is left.

    """
    left = point.torque_nm - drag_nm(machine, np.array(omega_rad_s))
    return np.maximum(np.nan_to_num(left, nan=0.0), 0.0)


def current_for(
    machine: Machine, torque: Array, limit_a: float, limit_v: float, omega: Array
) -> tuple[Array, Array]:
    """Currents i_d, i_q [m, A] of least copper loss that give air-gap torques at speeds [m].

    Parameters
    ----------
    machine : Machine
        One draw.
    torque : array [m], N·m
        Air-gap torque wanted, above 0.
    limit_a, limit_v : float
        Phase current [A] and voltage [V], peak, at most.
    omega : array [m], rad/s
        Mechanical speeds.

    Returns
    -------
    array, array [m], A
        NaN where the limits do not allow the torque.

    """
    beta = np.radians(np.arange(LEAST_DEG, MOST_DEG, 0.1))
    sine, cosine = np.sin(beta), np.cos(beta)
    current = np.broadcast_to(0.5 * limit_a, (torque.size, beta.size))
    k = 1.5 * machine.pole_pairs
    for _ in range(ROUNDS if machine.bends else 1):
        ld, lq = (
            values[0]
            for values in inductances_h(machine, (-current * sine)[None], (current * cosine)[None])
        )
        # k ψ cos β I + k (L_q - L_d) sin β cos β I² = T
        square, linear = k * (lq - ld) * sine * cosine, k * machine.psi_wb[0] * cosine
        inside = linear**2 + 4.0 * square * torque[:, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            current = 2.0 * torque[:, None] / (linear + np.sqrt(inside))
        current = np.where(np.isfinite(current), current, 10.0 * limit_a)
    volts = voltage_v(machine, (-current * sine)[None], (current * cosine)[None], omega[:, None])[0]
    fits = (current <= limit_a * (1.0 + 1e-9)) & (volts <= limit_v * (1.0 + 1e-9))
    least = np.where(fits, current, np.inf)
    at = np.argmin(least, axis=1)
    rows = np.arange(torque.size)
    amps = np.where(np.isfinite(least[rows, at]), current[rows, at], np.nan)
    return -amps * sine[at], amps * cosine[at]
