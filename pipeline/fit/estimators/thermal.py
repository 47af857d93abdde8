"""Thermal resistance from winding to ambient, from the heat balance of a heat run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.fit.heat_record import TURNING, HeatRecord, ambient_degc, read_heat
from pipeline.fit.instruments import budget_of, current_source, temperature_source
from pipeline.fit.protocol import Estimator, Fit
from pipeline.numerics.least_squares import LinearFit, autocorrelation_time, linear_fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution

NAME = "thermal"
GIVEN = "rth_winding_k_w"
EXPERIMENT = (
    "record a heat_run of at least three thermal time constants with temp_winding_degc, "
    "temp_ambient_degc or ambient_degc, and temp_case_degc or temp_magnet_degc"
)
Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Balance:
    """Steady thermal resistance [K/W] with its scatter, and the winding temperature it predicts."""

    rth_k_w: float
    u_rth_k_w: float
    dof: float
    fitted_degc: Array
    covered: float
    words: str


def fit_thermal(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Heat balance in integral form, so that no temperature is differentiated.

    One node:   T_w - T_w0 = (1/C) ∫P - (1/CR) ∫(T_w - T_a)
    Two nodes:  the winding also gives to a body whose temperature was measured, and that body to
    ambient; the steady resistance is R_wa beside R_wm + R_ma. P = 1.5 R(T_w) i², from the
    resistance test, so that an inverter's loss is not counted. Of several runs the best is used.
    Reference: Boglietti et al., IEEE Trans. Ind. Electron. 56(3), 2009 (lumped networks).
    """
    reasons: list[str] = []
    best: tuple[Balance, HeatRecord, Array] | None = None
    for capture in campaign.of("heat_run"):
        try:
            record = read_heat(capture, known)
        except KeyError as error:
            reasons.append(str(error.args[0]))
            continue
        ambient = None if record is None else ambient_degc(record)
        if record is None or ambient is None:
            reasons.append(f"{capture.path}: no steady current, or ambient not known")
            continue
        balance = _balance(record, _losses_w(record, known), ambient)
        if balance is None or balance.u_rth_k_w > options["worst_u_rel"] * balance.rth_k_w:
            reasons.append(f"{capture.path}: too short for the slowest part of the rise")
        elif best is None or balance.u_rth_k_w < best[0].u_rth_k_w:
            best = balance, record, np.array([ambient])
    if best is None:
        reason = "; ".join([*reasons, EXPERIMENT])
        return Fit((not_identifiable(GIVEN, "K/W", NAME, reason),))
    return Fit((_estimate(*best, known),), (_evidence(*best[:2]),))


def _losses_w(record: HeatRecord, known: Constants) -> Array:
    """Copper loss [n]: 1.5 R(T) (i_d² + i_q²), R as measured where no resistance test is there."""
    r25, alpha = known.best("r_phase_ohm"), known.best("temp_coeff_copper_1_k")
    if r25 is None:
        return 1.5 * record.r_phase_ohm * record.square_a2
    coefficient = 1.0 / 259.5 if alpha is None else alpha.number
    r_ohm = r25.number * (1.0 + coefficient * (record.temp_winding_degc - 25.0))
    losses: Array = 1.5 * r_ohm * record.square_a2
    return losses


def _integral(values: Array, t_s: Array) -> Array:
    steps = 0.5 * (values[1:] + values[:-1]) * np.diff(t_s)
    return np.concatenate([[0.0], np.cumsum(steps)])


def _balance(record: HeatRecord, losses_w: Array, ambient: float) -> Balance | None:
    """The two-node balance where a second body was measured and takes heat, else one node."""
    t, winding = record.t_s, record.temp_winding_degc
    ones, power = np.ones(t.size), _integral(losses_w, t)
    outward = -_integral(winding - ambient, t)
    single = linear_fit(np.column_stack([ones, power, outward]), winding)
    if record.temp_second_degc is not None and np.isfinite(record.temp_second_degc).all():
        second = record.temp_second_degc
        across = -_integral(winding - second, t)
        double = _winding_fit(np.column_stack([ones, power, across, outward]), winding)
        body = linear_fit(np.column_stack([ones, -across, -_integral(second - ambient, t)]), second)
        found = _two_nodes(double, body, winding, t)
        if found is not None:
            return found
    tau = autocorrelation_time(single.residuals)
    inverse_c, rate = float(single.coefficients[1]), float(single.coefficients[2])
    if not single.full_rank or inverse_c <= 0.0 or rate <= 0.0:
        return None
    covered = float(t[-1] - t[0]) * rate
    rth = inverse_c / rate
    gradient = np.array([0.0, 1.0 / rate, -rth / rate])
    u = math.sqrt(float(gradient @ single.covariance @ gradient) * tau)
    # One exponential is a guess about what follows the end of the record: its weight there.
    u = math.hypot(u, rth * math.exp(-covered))
    words = f"one time constant of {1.0 / rate:.3g} s, {covered:.1f} of them recorded"
    fitted = winding - single.residuals
    return Balance(rth, u, max(single.dof / tau, 1.0), fitted, covered, words)


def _winding_fit(design: Array, winding: Array) -> LinearFit:
    """Winding's balance; heat straight to ambient, the last column, only where it shows."""
    full = linear_fit(design, winding)
    tau = autocorrelation_time(full.residuals)
    if full.coefficients[-1] > 3.0 * full.u(3) * math.sqrt(tau):
        return full
    return linear_fit(design[:, :3], winding)


def _two_nodes(double: LinearFit, body: LinearFit, winding: Array, t_s: Array) -> Balance | None:
    """R = 1/(C (a + b d/(c + d))): a to ambient, b to the body, which gains c and loses d [1/s]."""
    if not (double.full_rank and body.full_rank):
        return None
    inverse_c, b = (float(v) for v in double.coefficients[1:3])
    a = float(double.coefficients[3]) if double.coefficients.size > 3 else 0.0
    c, d = (float(v) for v in body.coefficients[1:])
    if min(inverse_c, b, c, d) <= 0.0 or b < 3.0 * double.u(2) or c < 3.0 * body.u(1):
        return None
    taus = autocorrelation_time(double.residuals), autocorrelation_time(body.residuals)
    share = d / (c + d)
    total = a + b * share
    rth = inverse_c / total
    first = (np.array([0.0, 1.0, -rth * share, -rth]) / total)[: double.coefficients.size]
    second = -rth / total * b * np.array([0.0, -d, c]) / (c + d) ** 2
    variance = float(first @ double.covariance @ first) * taus[0]
    variance += float(second @ body.covariance @ second) * taus[1]
    words = f"winding {1.0 / (a + b):.3g} s and body {1.0 / (c + d):.3g} s, two nodes"
    dof = max(min(double.dof / taus[0], body.dof / taus[1]), 1.0)
    covered = float(t_s[-1] - t_s[0]) * (a + b)
    return Balance(rth, math.sqrt(variance), dof, winding - double.residuals, covered, words)


def _estimate(balance: Balance, record: HeatRecord, ambient: Array, known: Constants) -> Estimate:
    """Budget: rise over loss, u_T on the rise unless both thermometers share it; R and i² below."""
    meta = record.capture.meta
    rth = balance.rth_k_w
    rise = float(record.temp_winding_degc.max()) - float(ambient[0])
    parts = [Contribution(f"scatter:{NAME}:{GIVEN}", balance.u_rth_k_w, "A", balance.dof)]
    resistance = known.best("r_phase_ohm")
    gains = {p.source: p.u / resistance.number for p in resistance.budget} if resistance else {}
    gains[current_source(meta)] = gains.get(current_source(meta), 0.0) + 2.0 * (
        meta.u_rel_current or 0.0
    )
    parts += [Contribution(source, -rth * u, "B") for source, u in gains.items()]
    if record.temp_ambient_degc is None and rise > 0.0:
        offset = rth * (meta.u_temp_degc or 0.0) / rise
        mine = gains.pop(temperature_source(meta), 0.0)
        parts = [p for p in parts if p.source != temperature_source(meta)]
        parts.append(Contribution(temperature_source(meta), offset - rth * mine, "B"))
    at = {
        "current_a": round(float(record.current_a.mean()), 4),
        "temp_ambient_degc": round(float(ambient[0]), 2),
        "temp_high_degc": round(float(record.temp_winding_degc.max()), 2),
    }
    return Estimate(
        GIVEN,
        rth,
        "K/W",
        "measured",
        NAME,
        budget_of(parts),
        at,
        (record.capture.path,),
        f"steady state by {balance.words}; the motor as mounted on this bench",
    )


def _evidence(balance: Balance, record: HeatRecord) -> Evidence:
    series = Series("winding", record.t_s, record.temp_winding_degc, balance.fitted_degc)
    return Evidence(
        NAME,
        "Winding temperature of the heat run",
        "t_s",
        "temp_winding_degc",
        "line",
        (series,),
        record.capture.path,
        f"Heat balance: {balance.words}.",
    )


ESTIMATOR = Estimator(
    NAME,
    (GIVEN,),
    ("heat_run",),
    EXPERIMENT,
    fit_thermal,
    uses=("r_phase_ohm", "temp_coeff_copper_1_k", "temp_coeff_magnet_1_k", *TURNING),
    options={"worst_u_rel": 0.25},
)
