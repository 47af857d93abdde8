"""Apparent inductances at the largest current of a constant-speed torque map."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement

import numpy as np
from numpy.typing import NDArray

from pipeline.fit.instruments import (
    budget_of,
    contributions,
    instrument_uncertainties,
    unstated_note,
)
from pipeline.fit.operating_points import Point, operating_points, pole_pairs_of
from pipeline.fit.protocol import Estimator, Fit
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution

Array = NDArray[np.float64]

NAME = "inductance_rated"
GIVES = ("ld_rated_h", "lq_rated_h")
EXPERIMENT = (
    "record a torque_map at constant speed with vd_v and vq_v: q current stepped to plus and minus "
    "rated, at zero d current and at rated d current"
)
SAME = 0.03
MAGNET_COEFFICIENT_1_K = -0.0011
HOLD = "assumed:voltage_hold"


@dataclass(frozen=True, slots=True)
class Flux:
    """Flux linkages of one pair of points with +i_q and -i_q at one speed and one d current."""

    group: int
    id_a: float
    iq_a: float
    psi_d_wb: float
    psi_q_wb: float
    u_d_wb: float
    u_q_wb: float
    temp_magnet_degc: float


@dataclass(frozen=True, slots=True)
class Result:
    """An inductance [H], its scatter [H] and the currents that it holds for."""

    value_h: float
    u_h: float
    id_a: float
    iq_a: float


_Find = Callable[[Sequence[Flux], float], Result | None]


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """L_q = psi_q / i_q at i_d = 0 and L_d = (psi_d - psi_d at i_d = 0) / i_d, both at rated.

    psi_d = (v_q+ + v_q-) / 2 w, psi_q = (v_d- - v_d+) / 2 w of points with +i_q and -i_q, so that
    R and odd inverter errors cancel. The voltage's timing and the angle it is late by are taken
    out first. Reference: Armando, Bojoi, Guglielmi, Pellegrino, Pastorelli, IEEE Trans. Ind. Appl.
    49(5), 2013.
    """
    del options
    captures = [c for c in campaign.of("torque_map") if c.has("t_s", "iq_a", "vd_v", "vq_v")]
    pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    table = operating_points(captures, pairs)
    points = [p for p in table.points if np.isfinite(p.vd_v) and np.isfinite(p.vq_v)]
    if pairs is None or not points:
        why = "pole pairs unknown" if points else "no settled points with voltages"
        note = f"{why}; {EXPERIMENT}"
        return Fit(tuple(not_identifiable(n, "H", NAME, note) for n in GIVES))
    alpha = known.best("temp_coeff_magnet_1_k")
    magnet = MAGNET_COEFFICIENT_1_K if alpha is None else alpha.number
    words = f"{table.note()}; {_timing_words(captures)}"
    points = _without_ripple(points, pairs, magnet, known.best("r_phase_ohm"))
    fluxes = flux_pairs(points, pairs)
    estimates = []
    for name, find in (("ld_rated_h", _direct), ("lq_rated_h", _quadrature)):
        found = find(fluxes, magnet)
        if found is None:
            why = "no settled pair of plus and minus q current at the currents needed"
            estimates.append(not_identifiable(name, "H", NAME, f"{why}; {EXPERIMENT}"))
            continue

        def value(shift: Mapping[str, float], find: _Find = find, nominal: Result = found) -> Array:
            shifted = find(flux_pairs([p.shifted(shift) for p in points], pairs), magnet)
            return np.array([(shifted or nominal).value_h])

        gains = instrument_uncertainties(captures, ("voltage", "current"))
        parts = contributions(value, gains)[0]
        parts.append(Contribution(HOLD, found.value_h * _hold_doubt(points, pairs), "B"))
        parts.append(Contribution(f"scatter:{NAME}:{name}", found.u_h, "A"))
        paths = tuple(sorted({p.capture.path for p in points}))
        at = {"id_a": found.id_a, "iq_a": found.iq_a}
        unstated = unstated_note(captures, ("voltage", "current"))
        note = f"{words}; {unstated}" if unstated else words
        estimates.append(
            Estimate(name, found.value_h, "H", "measured", NAME, budget_of(parts), at, paths, note)
        )
    return Fit(tuple(estimates), _evidence(fluxes))


def _without_ripple(
    points: Sequence[Point], pole_pairs: int, magnet: float, resistance: Estimate | None
) -> list[Point]:
    """Points with held voltages less the drop R of the ripple current between samples.

    While the inverter holds its vector v still, flux bends by -j w R i only and not by -w² psi as
    on its circle. With x = w T / 2 the period's mean flux is short by x²/3 v/(j w), the mean
    current by that over L of each axis. Inductances of a first pass are good enough. Without R
    nothing is done.
    """
    first = flux_pairs(points, pole_pairs)
    direct, quadrature = _direct(first, magnet), _quadrature(first, magnet)
    if resistance is None or direct is None or quadrature is None:
        return list(points)
    corrected = []
    for point in points:
        if point.capture.meta.voltage_timing != "held":
            corrected.append(point)
            continue
        omega = pole_pairs * point.omega_mech_rad_s
        half = 0.5 * omega * point.period_s
        bend = _instant(point, pole_pairs) / (1j * omega)
        short = complex(bend.real / direct.value_h, bend.imag / quadrature.value_h)
        drop = -resistance.number * short * half**2 / 3.0 * np.exp(1j * half)
        voltage = complex(point.vd_v, point.vq_v) - drop
        corrected.append(replace(point, vd_v=voltage.real, vq_v=voltage.imag))
    return corrected


def flux_pairs(points: Sequence[Point], pole_pairs: int) -> list[Flux]:
    """Flux linkages from every pair of settled points with opposite q current.

    A point with no q current is a pair with itself. Voltages are first brought to the sampling
    instant (`voltage_timing`) and turned back by the angle delta + tau w_e that the pairs without
    d current show: there v+ + v- = 2 j w_e psi_d, whatever R and L. What of that angle differs
    from pair to pair (an eccentric encoder) goes into the uncertainty.
    """
    largest = max(max(abs(p.iq_a), abs(p.id_a)) for p in points)
    matched = [
        (one, other)
        for one, other in combinations_with_replacement(points, 2)
        if one.group == other.group
        and abs(one.id_a - other.id_a) < SAME * largest
        and abs(one.iq_a + other.iq_a) < SAME * largest
        and (one is not other or abs(one.iq_a) < SAME * largest)
    ]
    offset, late_s, wobble = _lateness(matched, pole_pairs, largest)
    fluxes = []
    for one, other in matched:
        plus, minus = (one, other) if one.iq_a >= other.iq_a else (other, one)
        first, v_first = _corrected(plus, pole_pairs, offset, late_s)
        second, v_second = _corrected(minus, pole_pairs, offset, late_s)
        omega = 0.5 * pole_pairs * (plus.omega_mech_rad_s + minus.omega_mech_rad_s)
        half = (v_first + v_second) / 2.0
        gap = (v_second - v_first) / 2.0
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
                    wobble * (abs(half.real) + abs(gap.real)) / np.sqrt(2.0),
                )
                / abs(omega),
                _root_sum(
                    share * plus.u_vd_v,
                    share * minus.u_vd_v,
                    wobble * (abs(half.imag) + abs(gap.imag)) / np.sqrt(2.0),
                )
                / abs(omega),
                0.5 * (plus.temp_magnet_degc + minus.temp_magnet_degc),
            )
        )
    return fluxes


def _root_sum(*parts: float) -> float:
    return float(np.sqrt(sum(part**2 for part in parts)))


def _instant(point: Point, pole_pairs: int) -> complex:
    """The dq voltage at the sampling instant, of a mean over the period about or after it.

    Over one period T the mean of a vector turning at w is sinc(w T / 2) exp(j w T / 2) of what it
    is at the start of the period, and sinc alone of what it is in the middle.
    """
    voltage = complex(point.vd_v, point.vq_v)
    timing = point.capture.meta.voltage_timing
    if timing == "instant":
        return voltage
    half = 0.5 * pole_pairs * point.omega_mech_rad_s * point.period_s
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
        if max(abs(one.id_a), abs(other.id_a)) > SAME * largest:
            continue
        omega = 0.5 * pole_pairs * (one.omega_mech_rad_s + other.omega_mech_rad_s)
        total = (_instant(one, pole_pairs) + _instant(other, pole_pairs)) / (1j * omega)
        omegas.append(omega)
        angles.append(float(np.angle(total)))
    if not omegas:
        return 0.0, 0.0, 0.0
    spread = np.ptp(omegas) > 0.1 * np.max(np.abs(omegas))
    columns = [np.ones(len(omegas)), np.array(omegas)] if spread else [np.array(omegas)]
    design = np.column_stack(columns)
    found = np.linalg.lstsq(design, np.array(angles), rcond=None)[0]
    free = len(angles) - design.shape[1]
    left = np.array(angles) - design @ found
    wobble = float(np.sqrt(left @ left / free)) if free > 0 else 0.0
    return (float(found[0]) if spread else 0.0), float(found[-1]), wobble


def _corrected(
    point: Point, pole_pairs: int, offset: float, late_s: float
) -> tuple[complex, complex]:
    """Current and voltage in the magnet's frame."""
    turn = np.exp(-1j * offset)
    late = np.exp(-1j * late_s * pole_pairs * point.omega_mech_rad_s)
    current = complex(point.id_a, point.iq_a)
    return complex(current * turn), complex(_instant(point, pole_pairs) * turn * late)


def _quadrature(fluxes: Sequence[Flux], magnet: float) -> Result | None:
    """psi_q over i_q at the largest q current without d current."""
    del magnet
    largest = max((f.iq_a for f in fluxes), default=0.0)
    near = [f for f in fluxes if abs(f.id_a) < SAME * max(largest, 1e-300)]
    rated = max((f.iq_a for f in near), default=0.0)
    if rated <= 0.0:
        return None
    used = [f for f in near if f.iq_a > (1.0 - SAME) * rated]
    weights = np.array([1.0 / max(f.u_q_wb, 1e-300) ** 2 for f in used])
    weights /= weights.sum()
    value = float(sum(w * f.psi_q_wb / f.iq_a for w, f in zip(weights, used, strict=True)))
    u = float(
        np.sqrt(sum((w * f.u_q_wb / f.iq_a) ** 2 for w, f in zip(weights, used, strict=True)))
    )
    return Result(value, u, used[0].id_a, rated)


def _direct(fluxes: Sequence[Flux], magnet: float) -> Result | None:
    """Change of psi_d from no d current to the largest, at the smallest q current that has both.

    Some q current is preferred: with none at all the inverter's dead time has no sign to cancel.
    """
    reach = max((max(abs(f.id_a), f.iq_a) for f in fluxes), default=0.0)
    both = [
        (f, zero)
        for f in fluxes
        for zero in fluxes
        if f.group == zero.group
        and abs(zero.id_a) < SAME * reach < abs(f.id_a)
        and abs(f.iq_a - zero.iq_a) < SAME * reach
    ]
    if not both:
        return None
    rated = max(abs(f.id_a) for f, _ in both)
    at_rated = [(f, zero) for f, zero in both if abs(f.id_a) > (1.0 - SAME) * rated]
    driven = [f.iq_a for f, _ in at_rated if f.iq_a > SAME * reach]
    smallest = min(driven, default=0.0)
    used = [(f, zero) for f, zero in at_rated if abs(f.iq_a - smallest) < SAME * reach]
    values, variances = [], []
    for f, zero in used:
        warm = magnet * (f.temp_magnet_degc - zero.temp_magnet_degc) * zero.psi_d_wb
        step = f.id_a - zero.id_a
        values.append((f.psi_d_wb - zero.psi_d_wb - warm) / step)
        variances.append((f.u_d_wb**2 + zero.u_d_wb**2) / step**2)
    weights = 1.0 / np.maximum(variances, 1e-300)
    weights /= weights.sum()
    u = float(np.sqrt(np.sum(weights**2 * variances)))
    return Result(float(weights @ values), u, used[0][0].id_a, smallest)


def _hold_doubt(points: Sequence[Point], pole_pairs: int) -> float:
    """Relative doubt of period means: a held vector's flux runs on a polygon, a turned one's not.

    Seen from the middle of a side the two differ by 1/cos(w T / 2) - 1; rectangular, GUM 4.3.7.
    """
    late = [
        0.5 * pole_pairs * abs(p.omega_mech_rad_s) * p.period_s
        for p in points
        if p.capture.meta.voltage_timing == "centred"
    ]
    if not late:
        return 0.0
    return float(np.mean(1.0 / np.cos(np.minimum(late, 1.0)) - 1.0) / np.sqrt(3.0))


def _timing_words(captures: Sequence[Capture]) -> str:
    timings = sorted({c.meta.voltage_timing for c in captures})
    return f"voltage timing {', '.join(timings)} and its lateness taken out"


def _evidence(fluxes: Sequence[Flux]) -> tuple[Evidence, ...]:
    if not fluxes:
        return ()
    reach = max(max(abs(f.id_a), f.iq_a) for f in fluxes)
    plots = []
    for axis, current, flux in (("q", "iq_a", "psi_q_wb"), ("d", "id_a", "psi_d_wb")):
        other = "id_a" if axis == "q" else "iq_a"
        series = []
        levels = sorted({round(getattr(f, other) / (SAME * reach)) for f in fluxes})
        for level in levels:
            mine = [f for f in fluxes if round(getattr(f, other) / (SAME * reach)) == level]
            mine.sort(key=lambda f: (getattr(f, current), f.group))
            x = np.array([getattr(f, current) for f in mine])
            y = np.array([getattr(f, flux) for f in mine])
            label = f"{other} {float(np.mean([getattr(f, other) for f in mine])):.3g} A"
            series.append(Series(label, x, y, np.array([])))
        title = f"Flux linkage of the {axis} axis at constant speed"
        plots.append(Evidence(NAME, title, current, flux, "scatter", tuple(series)))
    return tuple(plots)


ESTIMATOR = Estimator(
    name=NAME,
    gives=GIVES,
    tests=("torque_map",),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", "temp_coeff_magnet_1_k", "r_phase_ohm"),
    rank=0,
)
