"""Apparent inductances at the largest current of a constant-speed torque map."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.electrical.flux_pairs import Flux, flux_pairs, frame_of, instant_voltage
from pipeline.estimation.electrical.operating_points import Point, operating_points
from pipeline.estimation.electrical.pole_pairs import pole_pairs_to_use
from pipeline.estimation.electrical.sample_hold import hold_s
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import magnet_coefficient
from pipeline.estimation.uncertainty.instruments import (
    contributions,
    instrument_uncertainties,
    unstated_note,
)
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.pole_pairs import BY_VOLTAGE
from pipeline.records.uncertainty import Contribution

METHOD = Method("inductance_rated")
GIVES = ("ld_rated_h", "lq_rated_h")
EXPERIMENT = (
    "record a torque_map at constant speed with vd_v and vq_v: q current stepped to plus and minus "
    "rated, at zero d current and at rated d current"
)
FRAME = "assumed:frame_angle"
HOLD = "assumed:voltage_hold"


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

    Notes
    -----
    ψ_d = (v_q⁺ + v_q⁻) / (2 ω_e) and ψ_q = (v_d⁻ - v_d⁺) / (2 ω_e) of points with +i_q and -i_q,
    so that R and odd inverter errors cancel (`flux_pairs`). The voltage's timing and the angle it
    is late by are taken out first. In a frame turned by ε the drop of R is taken off along the
    pair's own current, which leaves L_other tan² ε on each axis; that is taken off here.

    References
    ----------
    Armando, Bojoi, Guglielmi, Pellegrino and Pastorelli, IEEE Trans. Ind. Appl. 49(5), 2013.

    """
    captures = [c for c in campaign.of("torque_map") if c.has("t_s", "iq_a", "vd_v", "vq_v")]
    pairs, rests = pole_pairs_to_use(known, campaign)
    table = operating_points(captures, pairs)
    points = [
        p
        for p in table.points
        if np.isfinite([p.vd_v, p.vq_v, p.omega_mech_rad_s]).all() and not p.standing
    ]
    if pairs is None or not points:
        why = rests if points else "no settled points with voltages at speed"
        return METHOD.nothing(GIVES, f"{why}; {EXPERIMENT}")
    magnet = magnet_coefficient(known)[0]
    points = _without_ripple(points, pairs, magnet, known.best("r_phase_ohm"))
    look = _Look(points, pairs, magnet, captures, *frame_of(points, pairs))
    fluxes = flux_pairs(points, pairs)
    of_axes = _direct(fluxes, magnet), _quadrature(fluxes, magnet)
    turned_rad = round(look.angle_rad, 3) + 0.0
    words = (
        f"{table.note()}; {_timing_words(captures)}; frame turned by {turned_rad:g} rad, "
        f"currents {1e6 * look.behind_s:.3g} µs late, taken out"
    )
    words = "; ".join(w for w in (words, rests) if w)
    estimates = (
        _estimate("ld_rated_h", _direct, *of_axes, look, words),
        _estimate("lq_rated_h", _quadrature, *of_axes[::-1], look, words),
    )
    return Fit(estimates, _evidence(fluxes, *of_axes))


@dataclass(frozen=True, slots=True)
class _Look:
    """What both axes are judged on: points, and how far the frame is turned and currents late."""

    points: Sequence[Point]
    pole_pairs: int
    magnet_1_k: float
    captures: Sequence[Capture]
    angle_rad: float
    behind_s: float

    @property
    def behind_rad(self) -> float:
        """What the fastest point turns while the currents are late."""
        return self.behind_s * self.pole_pairs * max(abs(p.omega_mech_rad_s) for p in self.points)


def _estimate(
    name: str, find: _Find, result: Result | None, other: Result | None, look: _Look, words: str
) -> Estimate:
    """The inductance of one axis, less what the `other` leaves on it in a turned frame."""
    if result is None:
        why = "no settled pair of plus and minus q current at the currents needed"
        return METHOD.missing(name, f"{why}; {EXPERIMENT}")

    def value(shift: Mapping[str, float]) -> Array:
        moved = flux_pairs([p.shifted(shift) for p in look.points], look.pole_pairs)
        return np.array([(find(moved, look.magnet_1_k) or result).value_h])

    parts = contributions(value, instrument_uncertainties(look.captures, ("voltage", "current")))[0]
    hold = _hold_doubt(look.points, look.pole_pairs)
    across = result.value_h if other is None else other.value_h
    angle, behind = look.angle_rad, look.behind_rad
    doubt = 2.0 * abs(angle * behind) + behind**2 + (other is None) * angle**2
    parts += [
        Contribution(HOLD, result.value_h * hold, "B"),
        Contribution(FRAME, across * doubt, "B"),
        METHOD.scatter(name, result.u_h),
    ]
    inductance = result.value_h - across * float(np.tan(angle)) ** 2
    used = {p.capture.path for p in look.points}
    notes = [words, unstated_note(look.captures, ("voltage", "current"))]
    if name == "ld_rated_h":
        fluxes = flux_pairs(look.points, look.pole_pairs)
        notes.append(_other_side(fluxes, look.magnet_1_k, result))
    at = {"id_a": result.id_a, "iq_a": result.iq_a}
    return METHOD.measured(name, inductance, parts, sorted(used), at, notes)


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
        half = 0.5 * omega * hold_s(point.capture.meta, point.period_s, omega)
        bend = instant_voltage(point, pole_pairs) / (1j * omega)
        short = complex(bend.real / direct.value_h, bend.imag / quadrature.value_h)
        drop = -resistance.number * short * half**2 / 3.0 * np.exp(1j * half)
        voltage = complex(point.vd_v, point.vq_v) - drop
        corrected.append(replace(point, vd_v=voltage.real, vq_v=voltage.imag))
    return corrected


def _quadrature(fluxes: Sequence[Flux], magnet: float) -> Result | None:
    """psi_q over i_q at the largest q current without d current."""
    tolerance = policy().flux_pairs.same_current
    largest = max((f.iq_a for f in fluxes), default=0.0)
    without_d = [f for f in fluxes if abs(f.id_a) < tolerance * max(largest, 1e-300)]
    rated = max((f.iq_a for f in without_d), default=0.0)
    if rated <= 0.0:
        return None
    used = [f for f in without_d if f.iq_a > (1.0 - tolerance) * rated]
    weights = np.array([1.0 / max(f.u_q_wb, 1e-150) ** 2 for f in used])
    weights /= weights.sum()
    value = float(sum(w * f.psi_q_wb / f.iq_a for w, f in zip(weights, used, strict=True)))
    noise = [np.hypot(f.u_q_wb, value * f.u_iq_a) / f.iq_a for f in used]
    u = float(np.linalg.norm(weights * noise))
    return Result(value, u, used[0].id_a, rated)


def _direct(fluxes: Sequence[Flux], magnet: float) -> Result | None:
    """Change of psi_d from no d current to the largest, at the smallest q current that has both.

    Of two d currents of one size the negative, which a drive uses: iron saturates on the other.
    Some q current is preferred: with none at all the inverter's dead time has no sign to cancel.
    """
    tolerance = policy().flux_pairs.same_current
    reach = max((max(abs(f.id_a), f.iq_a) for f in fluxes), default=0.0)
    pairs = [
        (f, zero)
        for f in fluxes
        for zero in fluxes
        if f.group == zero.group
        and abs(zero.id_a) < tolerance * reach < abs(f.id_a)
        and abs(f.iq_a - zero.iq_a) < tolerance * reach
    ]
    if not pairs:
        return None
    rated = max(abs(f.id_a) for f, _ in pairs)
    side = 1.0 if min(f.id_a for f, _ in pairs) > -(1.0 - tolerance) * rated else -1.0
    at_rated = [(f, zero) for f, zero in pairs if side * f.id_a > (1.0 - tolerance) * rated]
    driven = [f.iq_a for f, _ in at_rated if f.iq_a > tolerance * reach]
    smallest = min(driven, default=0.0)
    used = [(f, zero) for f, zero in at_rated if abs(f.iq_a - smallest) < tolerance * reach]
    values, variances = [], []
    for f, zero in used:
        warm = magnet * (f.temp_magnet_degc - zero.temp_magnet_degc) * zero.psi_d_wb
        step = f.id_a - zero.id_a
        values.append((f.psi_d_wb - zero.psi_d_wb - warm) / step)
        variances.append((f.u_d_wb**2 + zero.u_d_wb**2) / step**2)
    weights = 1.0 / np.maximum(variances, 1e-300)
    weights /= weights.sum()
    # A flux that is in several differences is one noise in all of them.
    levers: dict[int, float] = {}
    for (f, zero), weight in zip(used, weights, strict=True):
        share = float(weight) / (f.id_a - zero.id_a)
        levers[id(f)] = levers.get(id(f), 0.0) + share
        levers[id(zero)] = levers.get(id(zero), 0.0) - share
    value = float(weights @ values)
    noise = {id(f): np.hypot(f.u_d_wb, value * f.u_id_a) for pair in used for f in pair}
    u = float(np.sqrt(sum((share * noise[k]) ** 2 for k, share in levers.items())))
    return Result(value, u, used[0][0].id_a, smallest)


def _other_side(fluxes: Sequence[Flux], magnet: float, result: Result) -> str:
    """L_d at the largest d current of the other sign in words, empty where there is none."""
    across = [f for f in fluxes if f.id_a * result.id_a <= 0.0]
    tolerance = policy().flux_pairs.same_current
    reach = max((max(abs(f.id_a), f.iq_a) for f in fluxes), default=0.0)
    without_q = [f for f in fluxes if abs(f.id_a) < tolerance * reach and f not in across]
    other = _direct([*across, *without_q], magnet)
    if other is None:
        return ""
    return f"{1e6 * other.value_h:.4g} µH at {other.id_a:.3g} A of d current"


def _hold_doubt(points: Sequence[Point], pole_pairs: int) -> float:
    """Relative doubt of period means: a held vector's flux runs on a polygon, a turned one's not.

    Seen from the middle of a side the two differ by 1/cos(w T / 2) - 1; rectangular, GUM 4.3.7.
    """
    centred = [p for p in points if p.capture.meta.voltage_timing == "centred"]
    speeds = [pole_pairs * abs(p.omega_mech_rad_s) for p in centred]
    late = [
        0.5 * w * hold_s(p.capture.meta, p.period_s, w)
        for p, w in zip(centred, speeds, strict=True)
    ]
    if not late:
        return 0.0
    return float(np.mean(1.0 / np.cos(np.minimum(late, 1.0)) - 1.0) / np.sqrt(3.0))


def _timing_words(captures: Sequence[Capture]) -> str:
    timings = sorted({c.meta.voltage_timing for c in captures})
    return f"voltage timing {', '.join(timings)} and its lateness taken out"


def _evidence(
    fluxes: Sequence[Flux], direct: Result | None, quadrature: Result | None
) -> tuple[Evidence, ...]:
    """Flux linkages with the line of the published inductance through the flux at no current."""
    if not fluxes:
        return ()
    tolerance = policy().flux_pairs.same_current
    reach = max(max(abs(f.id_a), f.iq_a, 1e-300) for f in fluxes)
    plots = []
    for axis, current, flux, result in (
        ("q", "iq_a", "psi_q_wb", quadrature),
        ("d", "id_a", "psi_d_wb", direct),
    ):
        other = "id_a" if axis == "q" else "iq_a"
        series = []
        levels = sorted({round(getattr(f, other) / (tolerance * reach)) for f in fluxes})
        for level in levels:
            pairs = [f for f in fluxes if round(getattr(f, other) / (tolerance * reach)) == level]
            pairs.sort(key=lambda f: (getattr(f, current), f.group))
            x = np.array([getattr(f, current) for f in pairs])
            y = np.array([getattr(f, flux) for f in pairs])
            amps = float(np.mean([getattr(f, other) for f in pairs])) if level else 0.0
            label = f"{other} {amps:.3g} A"
            line = np.array([])
            if result is not None:
                zero = x[np.abs(x) < tolerance * reach], y[np.abs(x) < tolerance * reach]
                start = float(np.mean(zero[1] - result.value_h * zero[0])) if zero[0].size else 0.0
                line = start + result.value_h * x if axis == "q" or zero[0].size else line
            series.append(Series(label, x, y, line))
        title = f"Flux linkage of the {axis} axis at constant speed"
        caption = "line: the published apparent inductance"
        plots.append(METHOD.plot(title, (current, flux), "scatter", series, caption))
    return tuple(plots)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("torque_map",),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", BY_VOLTAGE, "temp_coeff_magnet_1_k", "r_phase_ohm"),
    aids=(BY_VOLTAGE,),
    rank=0,
    clock_powers=dict.fromkeys(GIVES, 1),
)
