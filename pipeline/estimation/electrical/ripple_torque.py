"""Torque of ripple currents, which the means of the currents do not show."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from pipeline.estimation.electrical.sample_hold import hold_s
from pipeline.estimation.policy import policy
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.records.capture import Array, Capture, Indices
from pipeline.records.estimate import Estimate

COLUMNS = ("id_a", "iq_a", "vd_v", "vq_v")
WARMTH = "temp_winding_degc"
NEEDED = (*COLUMNS, "t_s", "theta_mech_rad")
ORDERS = (6, 12, 18, 24)
"""Cycles an electrical turn of what harmonics of a balanced winding make in the rotor's frame."""
SIGNED = np.concatenate([ORDERS, np.negative(ORDERS)])
RIPPLE = "assumed:ripple_torque"
"""Doubt of a torque of ripple, in its standard uncertainties."""
Complex = NDArray[np.complexfloating]


@dataclass(frozen=True, slots=True)
class Winding:
    """What the torque of ripple rests on beside the rows: resistance of a phase at 25 degC and its
    relative standard uncertainty.
    """

    pole_pairs: int
    r_phase_ohm: float
    u_resistance: float = 0.0


def winding_of(pole_pairs: int | None, resistance: Estimate | None) -> Winding | None:
    """The winding, where both are known.

    Parameters
    ----------
    pole_pairs
        None where not known.
    resistance
        Of a phase at 25 degC [ohm]; None where not known.

    """
    if pole_pairs is None or resistance is None:
        return None
    return Winding(pole_pairs, resistance.number, resistance.u / resistance.number)


def ripple_torque(
    voltage_v: Complex, current_a: Complex, r_phase_ohm: float, omega_mech_rad_s: float
) -> float:
    r"""Mean torque that harmonics of voltage and current make on a shaft that turns steadily.

    Parameters
    ----------
    voltage_v, current_a
        Amplitudes d + j q at each order in the rotor's frame, none of them the mean [k, V, A].
    r_phase_ohm
        Of the winding as warm as it is [ohm].
    omega_mech_rad_s
        Speed [rad/s].

    Returns
    -------
    float
        [N·m], beside what the mean currents make; a brake has the sign against the speed.

    Notes
    -----
    T_h ω = 1.5 Σ (Re v_k i_k* - R \|i_k\|²). What power comes in at the terminals is stored, lost
    in copper or goes to the shaft. Over whole cycles nothing stays stored, and that of the means is
    the torque of the means.

    References
    ----------
    Krause, Wasynczuk, Sudhoff and Pekarek, Analysis of Electric Machinery and Drive Systems, 3rd
    ed., 2013, 1.3 (energy balance) and 3.3 (power in a reference frame).

    Examples
    --------
    A controller without integrator answers -2 V to each ampere of ripple, of 1 ohm.

    >>> current = np.array([0.1 + 0.0j])
    >>> round(ripple_torque(-2.0 * current, current, 1.0, 10.0), 6)
    -0.0045

    """
    power = np.sum((voltage_v * current_a.conj()).real - r_phase_ohm * np.abs(current_a) ** 2)
    return 1.5 * float(power) / omega_mech_rad_s


def ripple_of(
    capture: Capture, data: Mapping[str, Array], rows: slice, winding: Winding | None
) -> tuple[float, float]:
    """Torque of ripple over some rows of a drive, and its standard uncertainty.

    Parameters
    ----------
    capture
        Says what a voltage sample stands for.
    data
        Columns of equal length [n]: `COLUMNS`, `t_s`, `theta_mech_rad`; `temp_winding_degc`, where
        it is there.
    rows
        Over which the shaft turns steadily.
    winding
        None where it is not known.

    Returns
    -------
    torque_nm, u_nm : float
        Zeros where a column is missing or the rows do not resolve the lowest order. The
        uncertainty has the sign of the torque that a drop of an inverter would add; it is that of
        a winding not as warm as taken, of a commanded voltage that is not at the terminals, and
        of one that is half a period early or late.

    """
    if winding is None:
        return 0.0, 0.0
    rows_data = {name: column[rows] for name, column in data.items()}
    if not all(name in rows_data and np.all(np.isfinite(rows_data[name])) for name in NEEDED):
        return 0.0, 0.0
    ripples = _ripples(capture, rows_data, [slice(0, rows_data["t_s"].size)], winding)
    if not ripples:
        return 0.0, 0.0
    (there,) = _beyond_noise(ripples)
    return _torque(there, winding, _winding_temperature(rows_data), _drop_v(capture, rows_data))


def ripple_by_speed(capture: Capture, winding: Winding | None) -> tuple[Array, Array, Array]:
    """Torque of ripple over speed, of a drive whose speed and mean current change.

    Parameters
    ----------
    capture, winding
        As of `ripple_of`.

    Returns
    -------
    speed_rad_s, torque_nm_s, u_nm_s : array [g]
        Rising speeds, and torque and its standard uncertainty over speed there; empty where no
        rows show any.

    Notes
    -----
    A ripple keeps its phase on the rotor, from window to window. A step of the current and noise,
    which look like ripple in one window, do not: amplitudes over speed are medians of windows of
    about one speed.

    """
    blank = np.zeros(0)
    if winding is None or not capture.has(*NEEDED):
        return blank, blank, blank
    extra = [WARMTH] if capture.has(WARMTH) else []
    columns = capture.finite(*NEEDED, *extra, needed=NEEDED)
    windows = _windows(winding.pole_pairs * columns["theta_mech_rad"])
    each = _ripples(capture, columns, windows, winding) if windows else []
    each.sort(key=lambda ripple: ripple.omega_mech_rad_s)
    back = [ripple for ripple in each if ripple.omega_mech_rad_s < 0.0]
    middles = _beyond_noise(_middles(back) + _middles(each[len(back) :]))
    if not middles:
        return blank, blank, blank
    speeds = np.array([ripple.omega_mech_rad_s for ripple in middles])
    warmth, drop_v = _winding_temperature(columns), _drop_v(capture, columns)
    both = np.array([_torque(ripple, winding, warmth, drop_v) for ripple in middles])
    return speeds, both[:, 0] / speeds, both[:, 1] / speeds


def _windows(turned_rad: Array) -> list[slice]:
    """Rows, one after the other, of some ripples each and twice as many as unknowns."""
    travel = policy().ripple_torque.window_cycles * 2.0 * np.pi / ORDERS[0]
    least = 2 * (2 + SIGNED.size)
    path = np.cumsum(np.abs(np.diff(turned_rad, prepend=turned_rad[0])))
    edges = [0]
    for edge in np.searchsorted(path, np.arange(travel, path[-1], travel)):
        if edge - edges[-1] >= least:
            edges.append(int(edge))
    windows = [slice(a, b) for a, b in pairwise(edges)]
    return [rows for rows in windows if _steady(turned_rad[rows])]


def _steady(turned_rad: Array) -> bool:
    """Whether the shaft turns about as far in either half of these rows."""
    first, middle, last = turned_rad[[0, turned_rad.size // 2, -1]]
    share = (middle - first) / (last - first) if last != first else 0.0
    least = policy().ripple_torque.half_share
    return bool(least < share < 1.0 - least)


@dataclass(frozen=True, slots=True)
class _Ripple:
    """Harmonics of some rows in the rotor's frame at ± `ORDERS`; 0 where they are not resolved.

    `noise_a2` [k] is the variance of each current.
    """

    voltage_v: Complex
    current_a: Complex
    noise_a2: Array
    hold_s: float
    omega_mech_rad_s: float


def _middles(rising: Sequence[_Ripple]) -> list[_Ripple]:
    """Ripples of the mean speeds of neighbours of one sense: medians of amplitudes over speed."""
    count = policy().ripple_torque.alike
    if len(rising) < count:
        return []
    speeds = np.array([r.omega_mech_rad_s for r in rising])
    at = sliding_window_view(speeds, count).mean(axis=1)[:, np.newaxis]

    def middle(amplitudes: list[Complex]) -> tuple[Complex, Array]:
        views = sliding_window_view(np.array(amplitudes) / speeds[:, np.newaxis], count, axis=0)
        both = [np.median(part, axis=2) for part in (views.real, views.imag)]
        off = [
            np.median(np.abs(part - one[:, :, np.newaxis]), axis=2)
            for part, one in zip((views.real, views.imag), both, strict=True)
        ]
        variance = 0.5 * np.pi / count * 1.4826**2 * (off[0] ** 2 + off[1] ** 2)
        return np.asarray(at * (both[0] + 1j * both[1])), np.asarray(at**2 * variance)

    voltage, _ = middle([r.voltage_v for r in rising])
    current, noise = middle([r.current_a for r in rising])
    hold = rising[0].hold_s
    columns = zip(voltage, current, noise, at[:, 0], strict=True)
    return [_Ripple(v, i, noise_a2, hold, w) for v, i, noise_a2, w in columns]


def _beyond_noise(each: Sequence[_Ripple]) -> list[_Ripple]:
    """The same without the orders whose current is none beyond noise in most of them."""
    least = policy().evidence.sigmas ** 2
    seen = [np.abs(ripple.current_a) ** 2 > least * ripple.noise_a2 for ripple in each]
    there = np.median(seen, axis=0) == 1.0 if seen else np.zeros(0)
    return [
        replace(one, voltage_v=there * one.voltage_v, current_a=there * one.current_a)
        for one in each
    ]


def _torque(
    ripple: _Ripple, winding: Winding, warmth: tuple[float, float], drop_v: float | None
) -> tuple[float, float]:
    """Torque of a ripple and its standard uncertainty [N·m]; no drop of a measured voltage.

    One that is less than its own uncertainty is not taken off, and stands in it.
    """
    voltage, current, omega = ripple.voltage_v, ripple.current_a, ripple.omega_mech_rad_s
    warmer, u_resistance = warmth
    r = winding.r_phase_ohm * (1.0 + warmer)
    torque = ripple_torque(voltage, current, r, omega)
    square = float(np.sum(np.abs(current) ** 2))
    doubts_w = [r * np.hypot(u_resistance, winding.u_resistance) * square]
    if drop_v is not None:
        late = float(np.sum(1j * SIGNED * voltage * current.conj()).real)
        late *= winding.pole_pairs * omega
        doubts_w += [drop_v * float(np.sqrt(square)), 0.5 * ripple.hold_s * late]
    u = 1.5 * float(np.linalg.norm(doubts_w)) / omega
    if abs(torque) > abs(u):
        return torque, u
    return 0.0, float(np.copysign(np.hypot(torque, u), omega))


def _ripples(
    capture: Capture, data: Mapping[str, Array], windows: Sequence[slice], winding: Winding
) -> list[_Ripple]:
    """The harmonics of windows of rows, without the windows that do not resolve the lowest order.

    Windows that resolve the same orders are solved at once.
    """
    first, end = (np.array([getattr(w, side) for w in windows]) for side in ("start", "stop"))
    t, turned, sizes = data["t_s"], winding.pole_pairs * data["theta_mech_rad"], end - first
    period_s = (t[end - 1] - t[first]) / (sizes - 1)
    travel = turned[end - 1] - turned[first]
    omega = travel / (t[end - 1] - t[first])
    apart = policy().ripple_torque.apart_cycles * 2.0 * np.pi
    seen = np.outer(np.abs(travel), np.abs(SIGNED)) + 0.5 * apart < np.pi * (sizes[:, None] - 1)
    seen[ORDERS[0] * np.abs(travel) < apart] = False
    signals = np.column_stack([data["vd_v"] + 1j * data["vq_v"], data["id_a"] + 1j * data["iq_a"]])
    ripples: dict[int, _Ripple] = {}
    for there in np.unique(seen[seen.any(axis=1)], axis=0):
        alike = np.flatnonzero((seen == there).all(axis=1))
        for some in np.array_split(
            alike, 1 + sizes[alike].sum() // policy().ripple_torque.rows_at_once
        ):
            rows = np.concatenate([np.arange(first[n], end[n]) for n in some])
            parts, noise_a2 = _amplitudes(
                signals[rows], turned[rows], t[rows], SIGNED[there], sizes[some]
            )
            for n, part, noise in zip(some.tolist(), parts, noise_a2, strict=True):
                amplitudes = np.zeros((2, SIGNED.size), dtype=np.complex128)
                amplitudes[:, there] = part
                ripples[n] = _at_terminals(
                    capture, amplitudes, noise * there, float(omega[n]), float(period_s[n]), winding
                )
    return [ripples[n] for n in sorted(ripples)]


def _at_terminals(
    capture: Capture,
    amplitudes: Complex,
    noise_a2: Array,
    omega_rad_s: float,
    period_s: float,
    winding: Winding,
) -> _Ripple:
    """Harmonics of voltage and current [2, k] without what sampling did to them, at an electrical
    speed; `noise_a2` [k] is the variance of each current.
    """
    voltage, current = amplitudes
    hold, timing = hold_s(capture.meta, period_s, omega_rad_s), capture.meta.voltage_timing
    if timing == "held":
        voltage = voltage * np.exp(-0.5j * (SIGNED + 1) * omega_rad_s * hold)
    if timing == "centred" and hold < period_s:
        # an order that is resolved turns by less than half a cycle in a row
        damping = np.maximum(np.sinc(0.5 * SIGNED * omega_rad_s * period_s / np.pi), 2.0 / np.pi)
        voltage, current, noise_a2 = voltage / damping, current / damping, noise_a2 / damping**2
    return _Ripple(voltage, current, noise_a2, hold, omega_rad_s / winding.pole_pairs)


def _amplitudes(
    signals: Complex,
    turned_rad: Array,
    t_s: Array,
    orders: Indices,
    sizes: NDArray[np.intp],
) -> tuple[Complex, Array]:
    """Amplitudes [w, 2, k] of two signals [n, 2] at orders of an angle, beside a straight line, in
    each of the windows of these `sizes` [w]; and the variance of those of the second [w].
    """
    begins = np.concatenate([[0], np.cumsum(sizes)[:-1]])

    def sums(rows: Array | Complex) -> Any:
        return np.add.reduceat(rows, begins, axis=0)

    span_s = t_s[begins + sizes - 1] - t_s[begins]
    line = (t_s - np.repeat(sums(t_s) / sizes, sizes)) / np.repeat(span_s, sizes)
    turns = np.exp(1j * np.outer(turned_rad, orders))
    design = np.column_stack([np.ones(t_s.size), line, turns])
    normal = np.stack([sums(one.conj()[:, np.newaxis] * design) for one in design.T], axis=1)
    right = np.stack([sums(one.conj()[:, np.newaxis] * signals) for one in design.T], axis=1)
    least = np.finfo(float).eps * design.shape[1]
    parts = np.linalg.pinv(normal, rcond=least, hermitian=True) @ right
    predicted = np.einsum("nk,nk->n", design, np.repeat(parts[:, :, 1], sizes, axis=0))
    variance = sums(np.abs(signals[:, 1] - predicted) ** 2) / (sizes - design.shape[1])
    return parts[:, 2:].transpose(0, 2, 1), variance / sizes


def _winding_temperature(data: Mapping[str, Array]) -> tuple[float, float]:
    """Share of resistance by which the winding is above that at 25 degC, and its uncertainty."""
    spread = policy().capture_spread
    logged = data.get(WARMTH)
    if logged is None or not np.any(np.isfinite(logged)):
        return 0.0, COPPER_COEFFICIENT_25_1_K * policy().magnet.unlogged_k
    warmer = COPPER_COEFFICIENT_25_1_K * (float(np.nanmean(logged)) - 25.0)
    return warmer, spread.resistance_temperature_known


def _drop_v(capture: Capture, columns: Mapping[str, Array]) -> float | None:
    """What an inverter may drop of a commanded voltage's harmonics [V]; None of a measured one.

    The DC link's voltage that is not stated is the least that makes these.
    """
    if capture.meta.voltage_kind == "measured":
        return None
    link_v = capture.meta.vdc_v or float(
        np.sqrt(3.0) * np.nanmax(np.hypot(columns["vd_v"], columns["vq_v"]))
    )
    return policy().ripple_torque.drop_share * policy().capture_spread.inverter * link_v
