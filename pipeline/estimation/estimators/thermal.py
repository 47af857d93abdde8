"""Thermal resistance from winding to ambient, from the heat balance of a heat run."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.heat_record import (
    REFERENCE,
    TURNING,
    HeatRecord,
    ambient_degc,
    read_heat,
    reference_resistance,
)
from pipeline.estimation.uncertainty.instruments import (
    current_source,
    temperature_source,
    voltage_source,
)
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import (
    LinearFit,
    autocorrelation_time,
    gauss_newton,
    linear_fit,
)
from pipeline.numerics.plateaus import white_noise_sigma
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.glossary import Term
from pipeline.records.capture import Array, Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution, propagate, type_b

GIVEN = "rth_winding_k_w"
CAPACITY, WINDING_TAU, BODY_TAU = "cth_winding_j_k", "tau_thermal_winding_s", "tau_thermal_body_s"
TERMS = (
    Term(CAPACITY, "J/K", "heat capacity of the winding", "constant", 0.0, 1e7),
    Term(WINDING_TAU, "s", "winding alone: C over its conductances", "constant", 0.0, 1e7),
    Term(BODY_TAU, "s", "body alone: C over its conductances", "constant", 0.0, 1e7),
)
METHOD = Method("thermal", TERMS)
GIVES = (GIVEN, CAPACITY, WINDING_TAU, BODY_TAU)
EXPERIMENT = (
    "record a heat_run of at least three thermal time constants with temp_winding_degc, "
    "temp_ambient_degc or ambient_degc, and temp_case_degc or temp_magnet_degc"
)


@dataclass(frozen=True, slots=True)
class Balance:
    """Steady thermal resistance [K/W] with its scatter, and the winding temperature it predicts.

    `values` are the constants of `GIVES` [k], the last missing for one node, and `scatter` [k, k]
    their common scatter: row j holds what each of k independent sources has in constant j.
    """

    rth_k_w: float
    u_rth_k_w: float
    dof: float
    fitted_degc: Array
    covered: float
    words: str
    values: Array
    scatter: Array


def _common_scatter(covariance: Array) -> Array:
    """Independent sources [k, k] of a covariance [k, k], the first constant's being the first."""
    sizes = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    ties = covariance / np.outer(sizes, sizes) + 1e-12 * np.eye(sizes.size)
    return sizes[:, None] * np.linalg.cholesky(ties)


def heat_balance(t_s: Array, losses_w: Array, rise_k: Array) -> Array:
    """The derivatives of the winding's temperature by what is fitted, for one heat capacity.

    Parameters
    ----------
    t_s : array [n], s
        Times.
    losses_w : array [n], W
        Copper loss.
    rise_k : array [n], K
        Winding over ambient.

    Returns
    -------
    array [n, 3]
        dT/dT0 [1], dT/d(1/C) [J] and dT/d(1/(C R)) [K·s].

    Notes
    -----
    C dT/dt = P - (T - T_a)/R in integral form, so that no temperature is differentiated:

    T(t) = T0 + (1/C) ∫P dt - (1/(C R)) ∫(T - T_a) dt, and R = (1/C) / (1/(C R)).

    References
    ----------
    Boglietti et al., IEEE Trans. Ind. Electron. 56(3), 2009, 871, doi:10.1109/TIE.2008.2011622
    (lumped networks).

    """
    power, outward = trapezoid(t_s, losses_w), -trapezoid(t_s, rise_k)
    return np.column_stack([np.ones(t_s.size), power, outward])


def fit_thermal(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Thermal resistance by `heat_balance`, or by `network` where a second body was measured.

    With two nodes the winding also gives to that body, and it to ambient; the steady resistance
    is R_wa beside R_wm + R_ma. P = 1.5 R(T_w) i², with R from the resistance test, so that an
    inverter's loss is not counted. Of several runs the best is used.
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
        return METHOD.nothing(GIVES, "; ".join([*reasons, EXPERIMENT]))
    return Fit(_estimates(*best, known), (_evidence(*best[:2]),))


def _losses_w(record: HeatRecord, known: Constants) -> Array:
    """Copper loss [n]: 1.5 R(T) (i_d² + i_q²), R as measured where no resistance test is there."""
    r25, alpha = reference_resistance(record, known), known.best("temp_coeff_copper_1_k")
    if r25 is None:
        return 1.5 * record.r_phase_ohm * record.square_a2
    coefficient = COPPER_COEFFICIENT_25_1_K if alpha is None else alpha.number
    r_ohm = r25.number * (1.0 + coefficient * (record.temp_winding_degc - 25.0))
    return 1.5 * r_ohm * record.square_a2


def _balance(record: HeatRecord, losses_w: Array, ambient: float) -> Balance | None:
    """The two-node balance where a second body was measured and takes heat, else one node."""
    t, winding = record.t_s, record.temp_winding_degc
    balanced = heat_balance(t, losses_w, winding - ambient)
    outward = balanced[:, 2]
    single = linear_fit(balanced, winding)
    if record.temp_second_degc is not None and np.isfinite(record.temp_second_degc).all():
        second = record.temp_second_degc
        across = -trapezoid(t, winding - second)
        one = balanced[:, 0]
        double = _winding_fit(np.column_stack([*balanced[:, :2].T, across, outward]), winding)
        body = linear_fit(np.column_stack([one, -across, -trapezoid(t, second - ambient)]), second)
        start, direct = _start(double, body)
        if start is not None and (
            two_nodes := _two_nodes(record, losses_w, ambient, start, direct)
        ):
            return two_nodes
    noise = max(white_noise_sigma(winding), 1e-4 * float(np.ptp(winding)))
    if float(np.std(single.residuals)) > policy().heat_record.unexplained * noise:
        cold = abs(float(winding[0]) - ambient) < 3.0 * record.capture.meta.instrument_u(
            "u_temp_degc"
        )
        return _hidden_body(t, losses_w, winding, ambient, cold)
    tau = autocorrelation_time(single.residuals)
    inverse_c, rate = float(single.coefficients[1]), float(single.coefficients[2])
    if not single.full_rank or inverse_c <= 0.0 or rate <= 0.0:
        return None
    covered = float(t[-1] - t[0]) * rate
    rth = inverse_c / rate
    slopes = np.array(
        [[1.0 / rate, -rth / rate], [-1.0 / inverse_c**2, 0.0], [0.0, -1.0 / rate**2]]
    )
    covariance = slopes @ single.covariance[1:, 1:] @ slopes.T * tau
    u = math.sqrt(covariance[0, 0])
    # One exponential is a guess about what follows the end of the record: its weight there.
    u = math.hypot(u, rth * math.exp(-covered))
    words = f"one time constant of {1.0 / rate:.3g} s, {covered:.1f} of them recorded"
    fitted = winding - single.residuals
    values = np.array([rth, 1.0 / inverse_c, 1.0 / rate])
    covariance[0, 0] = u**2
    scatter = _common_scatter(covariance)
    return Balance(rth, u, max(single.dof / tau, 1.0), fitted, covered, words, values, scatter)


def _hidden_body(
    t_s: Array, losses_w: Array, winding: Array, ambient: float, cold: bool
) -> Balance | None:
    """The two nodes of `network` by the winding alone, where one time constant does not do.

    With the body left out of both equations, and integrated twice so that no temperature is
    differentiated,

    T = T0 + c t + k ∫P + k g ∬P - (f + g) ∫(T - T_a) - h ∬(T - T_a),

    with k = 1/C, f = a + b, g = c + d and h = f g - b c, so that R = k g / h. A `cold` motor begins
    at ambient, and has no c; with it a constant loss does not part c from k. None where these are
    not those of two bodies that cool.
    """
    power, outward = trapezoid(t_s, losses_w), -trapezoid(t_s, winding - ambient)
    columns = [power, trapezoid(t_s, power), outward, trapezoid(t_s, outward), np.ones(t_s.size)]
    fit = linear_fit(np.column_stack(columns if cold else [*columns, t_s]), winding)
    k, kg, both, h = (float(c) for c in fit.coefficients[:4])
    if not fit.full_rank or min(k, kg, h) <= 0.0 or both <= kg / k:
        return None
    f = both - kg / k
    slopes = np.array([
        [0.0, 1.0 / h, 0.0, -kg / h**2],
        [-1.0 / k**2, 0.0, 0.0, 0.0],
        [-kg / (k * f) ** 2, 1.0 / (k * f**2), -1.0 / f**2, 0.0],
        [1.0 / kg, -k / kg**2, 0.0, 0.0],
    ])  # fmt: skip
    tau = autocorrelation_time(fit.residuals)
    covariance = slopes @ fit.covariance[:4, :4] @ slopes.T * tau
    slowest = 0.5 * both - math.sqrt(max(0.25 * both**2 - h, 0.0))
    covered, rth = float(t_s[-1] - t_s[0]) * slowest, kg / h
    covariance[0, 0] += (rth * math.exp(-covered)) ** 2
    values = np.array([rth, 1.0 / k, 1.0 / f, k / kg])
    words = f"winding {1.0 / f:.3g} s and a body of {k / kg:.3g} s that was not measured"
    fitted, dof = winding - fit.residuals, max(fit.dof / tau, 1.0)
    scatter = _common_scatter(covariance)
    return Balance(rth, math.sqrt(covariance[0, 0]), dof, fitted, covered, words, values, scatter)


def _start(double: LinearFit, body: LinearFit) -> tuple[Array | None, bool]:
    """Rates k, a, b, c, d by the integral form, and whether heat goes straight to ambient.

    None where the second body does not take heat beyond doubt.
    """
    direct = double.coefficients.size > 3
    k, b = (float(v) for v in double.coefficients[1:3])
    a = float(double.coefficients[3]) if direct else 0.0
    c, d = (float(v) for v in body.coefficients[1:])
    determined = double.full_rank and body.full_rank and min(k, b, c, d) > 0.0
    if not determined or b < 3.0 * double.u(2) or c < 3.0 * body.u(1):
        return None, direct
    return np.array([k, a, b, c, d]), direct


def _winding_fit(design: Array, winding: Array) -> LinearFit:
    """Winding's balance; heat straight to ambient, the last column, only where it shows."""
    full = linear_fit(design, winding)
    if full.coefficients[-1] > 3.0 * full.u(3) * math.sqrt(autocorrelation_time(full.residuals)):
        return full
    return linear_fit(design[:, :3], winding)


def _two_nodes(
    record: HeatRecord, losses_w: Array, ambient: float, start: Array, direct: bool
) -> Balance | None:
    """Least squares of the simulated network on both temperatures, from the integral form's rates.

    R = k/(a + b d/(c + d)) with k = 1/C_w, a to ambient, b to the body, which gains c and loses d
    [1/s]. The integral form alone is far from the bound, because its noise is not white.
    """
    second = record.temp_second_degc
    if second is None:
        return None
    t, winding = record.t_s, record.temp_winding_degc
    sigmas = [max(white_noise_sigma(x), 1e-6) for x in (winding, second)]
    measured = np.concatenate([winding / sigmas[0], second / sigmas[1]])
    free = np.array([True, direct, True, True, True, True, True])
    x0 = np.concatenate([start, [winding[0] - ambient, second[0] - ambient]])
    widths = 1e-5 * np.where(x0 != 0.0, np.abs(x0), np.abs(x0[:5]).max())

    def residuals_and_jacobian(values: Array) -> tuple[Array, Array]:
        full = x0.copy()
        full[free] = values
        places = np.flatnonzero(free)
        variants = np.tile(full, (places.size + 1, 1))
        variants[np.arange(1, places.size + 1), places] += widths[places]
        course = network(t, losses_w, variants) + ambient
        course = course / np.array(sigmas)[:, None, None]
        predicted = course.transpose(1, 0, 2).reshape(places.size + 1, -1)
        slopes = (predicted[1:] - predicted[0]) / widths[places][:, None]
        return predicted[0] - measured, slopes.T

    low = np.full(int(free.sum()), -np.inf)
    low[:-2] = 0.0
    fit = gauss_newton(residuals_and_jacobian, x0[free], low, tolerance=1e-4)
    full = x0.copy()
    full[free] = fit.parameters
    k, a, b, c, d = (float(v) for v in full[:5])
    total = a + b * d / (c + d) if c + d > 0.0 else 0.0
    if k <= 0.0 or total <= 0.0 or d <= 0.0:
        return None
    rth = k / total
    slope = np.zeros(7)
    slope[:3] = 1.0 / total, -rth / total, -rth / total * d / (c + d)
    slope[3:5] = -rth / total * b * np.array([-d, c]) / (c + d) ** 2
    halves = fit.residuals[: t.size], fit.residuals[t.size :]
    tau = max(autocorrelation_time(half) for half in halves)
    spread = fit.cost / max(fit.residuals.size - int(free.sum()), 1) * tau
    u = fit.u_of(slope[free]) * math.sqrt(spread)
    if not math.isfinite(u):
        return None
    outward, back = a + b, c + d
    slopes = np.array([slope, *_time_slopes(k, outward, back)])
    covariance = slopes[:, free] @ fit.covariance @ slopes[:, free].T * spread
    values = np.array([rth, 1.0 / k, 1.0 / outward, 1.0 / back])
    words = f"winding {1.0 / outward:.3g} s and body {1.0 / back:.3g} s, two nodes"
    dof = max((fit.residuals.size - int(free.sum())) / tau, 1.0)
    covered = float(t[-1] - t[0]) * outward
    fitted = winding + halves[0] * sigmas[0]
    return Balance(rth, u, dof, fitted, covered, words, values, _common_scatter(covariance))


def _time_slopes(k: float, outward: float, back: float) -> Array:
    """Derivatives [3, 7] of 1/k, 1/(a + b) and 1/(c + d) by k, a, b, c, d and both starts."""
    slopes = np.zeros((3, 7))
    slopes[0, 0] = -1.0 / k**2
    slopes[1, 1:3], slopes[2, 3:5] = -1.0 / outward**2, -1.0 / back**2
    return slopes


def network(t_s: Array, losses_w: Array, variants: Array) -> Array:
    """Rise over ambient of two heat capacities, winding and body.

    Parameters
    ----------
    t_s : array [n], s
        Times.
    losses_w : array [n], W
        Copper loss.
    variants : array [m, 7]
        One set of parameters a row: k [K/J], a, b, c, d [1/s], first rise of either [K].

    Returns
    -------
    array [2, m, n], K
        Rise of winding and of body.

    Notes
    -----
    dT_w/dt = k P - a T_w - b (T_w - T_m) and dT_m/dt = c (T_w - T_m) - d T_m, rises over ambient;
    R = k / (a + b d / (c + d)). Exact over each step for the mean loss of its ends, by
    Sylvester's formula for the exponential of a 2 x 2 matrix.

    References
    ----------
    Boglietti et al., IEEE Trans. Ind. Electron. 56(3), 2009, 871, doi:10.1109/TIE.2008.2011622.

    """
    k, a, b, c, d = (variants[:, j] for j in range(5))
    matrix = np.empty((variants.shape[0], 2, 2))
    matrix[:, 0, 0], matrix[:, 0, 1] = -(a + b), b
    matrix[:, 1, 0], matrix[:, 1, 1] = c, -(c + d)
    half_trace = 0.5 * (matrix[:, 0, 0] + matrix[:, 1, 1])
    root = np.sqrt(0.25 * (matrix[:, 0, 0] - matrix[:, 1, 1]) ** 2 + b * c) + 1e-12
    steps = np.diff(t_s)[:, None]
    fast, slow = np.exp((half_trace - root) * steps), np.exp((half_trace + root) * steps)
    shifted = matrix - (half_trace - root)[:, None, None] * np.eye(2)
    exponential = (
        fast[..., None, None] * np.eye(2)
        + ((slow - fast) / (2.0 * root))[..., None, None] * shifted
    )
    determinant = (a + b) * (c + d) - b * c + 1e-300
    steady = np.stack([k * (c + d) / determinant, k * c / determinant], axis=1)
    drive = steady - np.einsum("nmij,mj->nmi", exponential, steady)
    means = 0.5 * (losses_w[1:] + losses_w[:-1])
    course = np.empty((t_s.size, variants.shape[0], 2))
    course[0] = state = variants[:, 5:7]
    for row, watt in enumerate(means):
        state = np.einsum("mij,mj->mi", exponential[row], state) + drive[row] * watt
        course[row + 1] = state
    return course.transpose(2, 1, 0)


def _estimates(
    balance: Balance, record: HeatRecord, ambient: Array, known: Constants
) -> tuple[Estimate, ...]:
    """Budget: the loss by the errors of R and i², or of v and i; the rise by the thermometer.

    What is wrong with the loss is wrong with the heat capacity the other way round, and leaves the
    time constants alone. A thermometer's offset leaves the loss alone, for R25 is low by what R(T)
    of it is high, and the rise as well where it measured the ambient too; else it is one of the
    ambient the other way round.
    """
    meta = record.capture.meta
    thermometer = temperature_source(meta)
    current = type_b(current_source(meta), meta.instrument_u("u_rel_current"))
    resistance = reference_resistance(record, known)
    if resistance is None:
        volts = type_b(voltage_source(meta), meta.instrument_u("u_rel_voltage"))
        loss = propagate([(-1.0, volts), (-1.0, current)])
    else:
        budget = tuple(part for part in resistance.budget if part.source != thermometer)
        loss = propagate([(-2.0, current), (-1.0 / resistance.number, budget)])
    offsets = np.zeros(len(GIVES))
    if record.temp_ambient_degc is None:
        u_degc = meta.instrument_u("u_temp_degc")
        offsets = _by_offset(balance, record, _losses_w(record, known), float(ambient[0]), u_degc)
    at = {
        "current_a": round(float(record.current_a.mean()), 4),
        "temp_ambient_degc": round(float(ambient[0]), 2),
        "temp_high_degc": round(float(record.temp_winding_degc.max()), 2),
    }
    note = f"steady state by {balance.words}; the motor as mounted on this bench"
    estimates = []
    signs = {GIVEN: 1.0, CAPACITY: -1.0}
    for name, value, row, offset in zip(
        GIVES, balance.values, balance.scatter, offsets, strict=False
    ):
        parts = [METHOD.scatter(of, u, balance.dof) for of, u in zip(GIVES, row, strict=False) if u]
        parts += propagate([(signs.get(name, 0.0) * float(value), loss)])
        parts.append(Contribution(thermometer, float(offset), "B"))
        parts = [part for part in parts if part.u]
        estimates.append(METHOD.measured(name, float(value), parts, (record.capture,), at, note))
    if len(estimates) < len(GIVES):
        estimates.append(METHOD.missing(BODY_TAU, f"one node explains the run; {EXPERIMENT}"))
    return tuple(estimates)


def _by_offset(
    balance: Balance, record: HeatRecord, losses_w: Array, ambient: float, u_degc: float
) -> Array:
    """What a thermometer that reads high by `u_degc` makes of each constant [their units]."""
    moved = [_balance(record, losses_w, ambient + side * u_degc) for side in (-1.0, 1.0)]
    low, high = (None if one is None else one.values for one in moved)
    if low is not None and high is not None and low.size == high.size == balance.values.size:
        return 0.5 * (low - high)
    rise = float(record.temp_winding_degc.max()) - ambient
    signs = np.array([1.0, -1.0, 0.0, 0.0])[: balance.values.size]
    return balance.values * signs * u_degc / rise


def _evidence(balance: Balance, record: HeatRecord) -> Evidence:
    series = Series("winding", record.t_s, record.temp_winding_degc, balance.fitted_degc)
    return METHOD.plot(
        "Winding temperature of the heat run", ("t_s", "temp_winding_degc"), "line", (series,),
        f"Heat balance: {balance.words}.", record.capture.path,
    )  # fmt: skip


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("heat_run",),
    EXPERIMENT,
    fit_thermal,
    terms=METHOD.terms,
    clock_powers={CAPACITY: 1, WINDING_TAU: 1, BODY_TAU: 1},
    uses=("temp_coeff_copper_1_k", "temp_coeff_magnet_1_k", *TURNING, *REFERENCE),
    options={"worst_u_rel": 0.25},
)
