"""Flux linkages from pairs of settled points with opposite q current, in the magnet's frame."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.electrical.operating_points import Point
from pipeline.estimation.electrical.sample_hold import hold_s
from pipeline.estimation.policy import policy
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.quantisation import covariance_alike


@dataclass(frozen=True, slots=True)
class Flux:
    """Flux linkages of one pair of points with opposite q current, at one speed and d current.

    Attributes
    ----------
    group
        Number of the constant-speed stretch.
    id_a, iq_a
        Currents in the frame of the magnet [A].
    psi_d_wb, psi_q_wb
        Flux linkages [Wb].
    u_d_wb, u_q_wb
        Their standard uncertainties from scatter and rounding [Wb].
    temp_magnet_degc
        Mean temperature of the magnets.
    u_id_a, u_iq_a
        What rounding leaves in the currents [A], as standard uncertainties.

    """

    group: int
    id_a: float
    iq_a: float
    psi_d_wb: float
    psi_q_wb: float
    u_d_wb: float
    u_q_wb: float
    temp_magnet_degc: float
    u_id_a: float = 0.0
    u_iq_a: float = 0.0


def frame_of(points: Sequence[Point], pole_pairs: int) -> tuple[float, float]:
    """Angle of the drive's frame against the magnet's [rad] and delay of its currents [s].

    Parameters
    ----------
    points
        Settled points at speed.
    pole_pairs
        Of the motor.

    Returns
    -------
    angle_rad, delay_s : float
        By the pairs of points without d current.

    """
    matched, largest = _matched(points)
    offset = _lateness(matched, pole_pairs, largest)[0]
    return -offset, current_lag(points, pole_pairs, offset)


def _matched(points: Sequence[Point]) -> tuple[list[tuple[Point, Point]], float]:
    """Pairs of opposite q current at one speed and one d current, and the largest current [A].

    Each point is in one pair at most, so that the noise of a pair is its own; of several the one
    of the same capture goes first, then the nearest. A point without q current is its own pair.
    """
    largest = max(max(abs(p.iq_a), abs(p.id_a)) for p in points)
    tolerance_a = policy().flux_pairs.same_current * largest
    matched, unmatched = [], list(points)
    while unmatched:
        one = unmatched.pop(0)
        if abs(2.0 * one.iq_a) < tolerance_a:
            matched.append((one, one))
            continue
        fitting = [
            (other.capture is not one.capture, abs(one.iq_a + other.iq_a), k)
            for k, other in enumerate(unmatched)
            if one.group == other.group
            and abs(one.id_a - other.id_a) < tolerance_a
            and abs(one.iq_a + other.iq_a) < tolerance_a
        ]
        if fitting:
            matched.append((one, unmatched.pop(min(fitting)[2])))
    return matched, largest


def flux_pairs(points: Sequence[Point], pole_pairs: int) -> list[Flux]:
    """Flux linkages from every pair of settled points with opposite q current.

    A point with no q current is a pair with itself. Voltages are first brought to the sampling
    instant (`voltage_timing`) and turned back by the angle delta + tau w_e that the pairs without
    d current show: there v+ + v- = 2 j w_e psi_d, whatever R and L. What of that angle differs
    from pair to pair (an eccentric encoder) goes into the uncertainty.

    Parameters
    ----------
    points
        Settled points at speed, with voltages.
    pole_pairs
        Of the motor.

    Returns
    -------
    list of Flux
        Flux linkages [Wb] with standard errors [Wb], and the currents [A] that they hold for.

    Notes
    -----
    ψ_d = (v_q⁺ + v_q⁻) / (2 ω_e), ψ_q = (v_d⁻ - v_d⁺) / (2 ω_e), superscripts for the sign of i_q.

    """
    matched, largest = _matched(points)
    offset, late_s, wobble = _lateness(matched, pole_pairs, largest)
    behind_s = current_lag(points, pole_pairs, offset)
    least = policy().flux_pairs.same_current * largest
    fluxes = []
    for one, other in matched:
        plus, minus = (one, other) if one.iq_a >= other.iq_a else (other, one)
        first, v_first = _corrected(plus, pole_pairs, offset, late_s, behind_s)
        second, v_second = _corrected(minus, pole_pairs, offset, late_s, behind_s)
        omega = 0.5 * pole_pairs * (plus.omega_mech_rad_s + minus.omega_mech_rad_s)
        half = _less_drop((v_first + v_second) / 2.0, first + second, 1.0, least)
        gap = _less_drop((v_second - v_first) / 2.0, second - first, 1.0j, least)
        share = 0.5 if plus is not minus else np.sqrt(0.5)
        fluxes.append(
            Flux(
                plus.group,
                float((first + second).real) / 2.0,
                float((first - second).imag) / 2.0,
                half.imag / omega,
                gap.real / omega,
                _root_sum(
                    share * plus.u_vq_v,
                    share * minus.u_vq_v,
                    _left(plus, minus, "vq_v", 1.0),
                    wobble * (abs(half.real) + abs(gap.real)) / np.sqrt(2.0),
                )
                / abs(omega),
                _root_sum(
                    share * plus.u_vd_v,
                    share * minus.u_vd_v,
                    _left(plus, minus, "vd_v", -1.0),
                    wobble * (abs(half.imag) + abs(gap.imag)) / np.sqrt(2.0),
                )
                / abs(omega),
                0.5 * (plus.temp_magnet_degc + minus.temp_magnet_degc),
                _left(plus, minus, "id_a", 1.0),
                _left(plus, minus, "iq_a", -1.0),
            )
        )
    return fluxes


def _less_drop(voltage: complex, current: complex, axis: complex, least_a: float) -> complex:
    """A voltage less what its drop along a current beside the `axis` (1 d, j q) adds across it.

    In a frame turned by e the current of a pair leaves its axis by tan e, and R i of that part
    would count as flux, by R tan(e) / w. The drop of the axis's own part is in the voltage along
    it, so R and odd inverter errors cancel as they do without e; what is left is
    tan² e of the other axis's inductance.
    """
    along, aside = (current / axis).real, (current / axis).imag
    if abs(along) < 2.0 * least_a:
        return voltage
    drop = (voltage / axis).real * aside / along
    return voltage - 1j * axis * drop


def _left(plus: Point, minus: Point, name: str, sign: float) -> float:
    """What rounding leaves in half the sum of a pair's means, or in half their difference."""
    if name not in plus.rounded or name not in minus.rounded:
        return 0.0
    one, other = plus.rounded[name], minus.rounded[name]
    errors = 0.5 * np.array([one.u, sign * other.u])
    return float(np.sqrt(covariance_alike(errors, [one.cell, other.cell]).sum()))


def _root_sum(*parts: float) -> float:
    return float(np.sqrt(sum(part**2 for part in parts)))


def instant_voltage(point: Point, pole_pairs: int) -> complex:
    """The dq voltage at the sampling instant, of a mean over the period about or after it.

    Over the time T for which a vector is held (`hold_s`) the mean of a vector turning at w is
    sinc(w T / 2) exp(j w T / 2) of what it is at the start, and sinc alone of what it is in the
    middle.

    Parameters
    ----------
    point
        Means of a settled point, and when its voltages are valid (`voltage_timing`).
    pole_pairs
        Of the motor.

    Returns
    -------
    complex, V
        v_d + j v_q.

    Notes
    -----
    v̄ = v sinc(ω_e T / 2) e^{jω_e T / 2} over the period that follows, sinc alone about its middle.

    """
    voltage = complex(point.vd_v, point.vq_v)
    timing = point.capture.meta.voltage_timing
    if timing == "instant":
        return voltage
    omega = pole_pairs * point.omega_mech_rad_s
    half = 0.5 * omega * hold_s(point.capture.meta, point.period_s, omega)
    turned = np.exp(1j * half) if timing == "held" else 1.0
    return complex(voltage / (np.sinc(half / np.pi) * turned))


def _lateness(
    matched: Sequence[tuple[Point, Point]], pole_pairs: int, largest: float
) -> tuple[float, float, float]:
    """Angle offset [rad] and delay [s] of the voltages, and the rms angle left [rad].

    With one speed alone the two are one, and all of it is taken as delay.
    """
    omegas, angles = [], []
    for one, other in matched:
        if max(abs(one.id_a), abs(other.id_a)) > policy().flux_pairs.same_current * largest:
            continue
        omega = 0.5 * pole_pairs * (one.omega_mech_rad_s + other.omega_mech_rad_s)
        total = (instant_voltage(one, pole_pairs) + instant_voltage(other, pole_pairs)) / (
            1j * omega
        )
        omegas.append(omega)
        angles.append(float(np.angle(total)))
    if not omegas:
        return 0.0, 0.0, 0.0
    spread = np.ptp(omegas) > 0.1 * np.max(np.abs(omegas))
    columns = [np.ones(len(omegas)), np.array(omegas)] if spread else [np.array(omegas)]
    design = np.column_stack(columns)
    lateness = np.linalg.lstsq(design, np.array(angles), rcond=None)[0]
    free = len(angles) - design.shape[1]
    residuals = np.array(angles) - design @ lateness
    wobble = float(np.sqrt(residuals @ residuals / free)) if free > 0 else 0.0
    return (float(lateness[0]) if spread else 0.0), float(lateness[-1]), wobble


def current_lag(points: Sequence[Point], pole_pairs: int, offset: float) -> float:
    """How late the currents are sampled [s], from the torque of d current; 0 where not seen.

    A current sampled d late is turned by w_e d against the rotor. The voltages at no d current do
    not show it, the torque does. Without it R d counts as inductance on both axes. Only a delay
    past four times its own scatter is taken out.

    Parameters
    ----------
    points
        Settled points at speed, with torque.
    pole_pairs
        Of the motor.
    offset
        Angle of the drive's frame [rad].

    Returns
    -------
    float, s
        0 where it is not seen.

    Notes
    -----
    T = K i_q + K_rel i_d i_q of currents that are turned by ω_e d beside the frame's offset: the
    slope of torque in ω_e (i_d + (i_d² − i_q²) K_rel / K) is K d, with K_rel / K by the same
    regression.

    """
    torque = np.array([p.torque_nm for p in points])
    i_d, i_q = (np.array([getattr(p, name) for p in points]) for name in ("id_a", "iq_a"))
    groups = sorted({p.group for p in points})
    if not np.all(np.isfinite(torque)) or np.ptp(i_d) < policy().aligned.least_d_share * np.ptp(
        i_q
    ):
        return 0.0
    rows = [np.array([p.group == g for p in points], dtype=float) for g in groups]
    omega = pole_pairs * np.array([p.omega_mech_rad_s for p in points])
    shared = [*rows, i_q, i_d * i_q, i_d, i_d**2, i_q**2, i_q**3, i_d * i_q**3, i_d**2 * i_q]
    ratio, sigma = 0.0, np.ones(torque.size)
    for _ in range(3):
        turned = omega * (i_d + ratio * (i_d**2 - i_q**2))
        solution = linear_fit(np.column_stack([*shared, turned]), torque, sigma)
        kt, reluctance = (float(solution.coefficients[len(groups) + k]) for k in (0, 1))
        if not solution.full_rank or solution.dof < 3 or kt == 0.0:
            return 0.0
        ratio = reluctance / kt
    slope = float(solution.coefficients[-1])
    u = float(np.sqrt(solution.covariance[-1, -1] * solution.chi2_dof))
    return slope / (kt * np.cos(offset)) if abs(slope) > policy().evidence.sigmas * u else 0.0


def _corrected(
    point: Point, pole_pairs: int, offset: float, late_s: float, behind_s: float
) -> tuple[complex, complex]:
    """Current and voltage in the magnet's frame."""
    turn = np.exp(-1j * offset)
    late = np.exp(-1j * late_s * pole_pairs * point.omega_mech_rad_s)
    current = complex(point.id_a, point.iq_a)
    ahead = np.exp(1j * behind_s * pole_pairs * point.omega_mech_rad_s)
    return complex(current * turn * ahead), complex(
        instant_voltage(point, pole_pairs) * turn * late
    )
