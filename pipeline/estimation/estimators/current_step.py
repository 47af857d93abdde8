"""Ld and Lq near zero current from voltage steps on a locked rotor, with saturation separated."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.electrical.step_budget import (
    birge_ratio,
    gains,
    rotor_angles,
    rounded_levels,
    unexplained,
)
from pipeline.estimation.electrical.step_fit import (
    AXES,
    Offer,
    Solution,
    between_models,
    offers_of,
    solve,
)
from pipeline.estimation.electrical.step_model import StepModel
from pipeline.estimation.electrical.step_parameters import (
    LD,
    LQ,
    SHARED,
    SPACE,
    TERMS,
    Drive,
    drive_of,
)
from pipeline.estimation.electrical.step_record import (
    StepRecord,
    disagreement,
    read_step,
    rotor_angle_rad,
)
from pipeline.estimation.electrical.terminals import PAIRS, UNALIGNED
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import unstated_note
from pipeline.numerics.integrals import trapezoid
from pipeline.numerics.least_squares import linear_fit
from pipeline.numerics.plateaus import decimated
from pipeline.physics.windings import unaligned_inductances_h
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series

METHOD = Method("current_step")
GIVES = ("ld_h", "lq_h")
EXPERIMENT = (
    "record current_step captures with the rotor locked on d and on q (pair ab: theta_elec_deg -30 "
    "and 60), both senses of current, two or more amplitudes; or pairs ab, bc and ca at one angle"
)


def inductances(shared: Array, flux_d: Array, flux_q: Array) -> tuple[Array, Array]:
    """Incremental inductances of both axes of a locked machine, as iron bends with the current.

    Parameters
    ----------
    shared : array [m, 10]
        L_d0 [H] and a..d of the d axis, L_q0 [H] and a..d of the q axis [powers of 1/Wb].
    flux_d, flux_q : array [m], Wb
        What the currents added to the flux linkage of each axis.

    Returns
    -------
    array [m], array [m], H
        Incremental L_d and L_q.

    Notes
    -----
    What is fitted is the current I of a pair under the voltage e - R_source I of a supply,

    dI/dt = (e - (R + R_source) I) / L(I),  L = 2 (cos²γ L_d + sin²γ L_q),
    i_d + j i_q = (2/√3) I e^{jγ},

    γ from the d axis to the pair's current. Both axes saturate with their own flux y,

    L_d = L_d0 / (1 + a y + b y² + c y³ + d y⁴), L_q = L_q0 / (1 + a y² + b |y|³ + c y⁴ + d |y|⁵),

    so that i is a polynomial of y. The q axis begins with y²: both senses are alike, and iron has
    no corner at zero current. `electrical.step_model` integrates it and takes its Jacobian by
    one-sided differences.

    References
    ----------
    IEEE Std 1812-2014, 8 (step response at standstill).

    """
    y = np.abs(flux_q)
    bend_d = _polynomial(shared[:, LD + 1 : LD + 1 + TERMS], flux_d)
    bend_q = _polynomial(shared[:, LQ + 1 : LQ + 1 + TERMS], y) * y
    return shared[:, LD] / np.maximum(1.0 + bend_d, 0.05), shared[:, LQ] / np.maximum(
        1.0 + bend_q, 0.05
    )


def _polynomial(terms: Array, flux: Array) -> Array:
    """Polynomial of a flux [m] without a constant."""
    value = terms[:, 3] * flux
    for column in (2, 1, 0):
        value = (value + terms[:, column]) * flux
    return value


def along_ramp(shared: Array, cos_g: float, current_a: Array) -> Array:
    """Incremental inductance [n] between the terminals as the current follows a ramp [n] from 0.

    Parameters
    ----------
    shared : array [10]
        Inductances and saturation of both axes.
    cos_g
        Cosine of the angle from the d axis to the pair's current.
    current_a : array [n], A
        Pair current, from 0.

    Returns
    -------
    array [n], H

    """
    one, sin_g = shared[None, :], math.sqrt(max(1.0 - cos_g**2, 0.0))
    flux_d, flux_q = np.zeros(1), np.zeros(1)
    volts = np.empty(current_a.size)
    for k in range(current_a.size):
        l_d, l_q = inductances(one, flux_d, flux_q)
        volts[k] = 2.0 * float(cos_g**2 * l_d[0] + sin_g**2 * l_q[0])
        if k + 1 < current_a.size:
            step = SPACE * float(current_a[k + 1] - current_a[k])
            middle = flux_d + 0.5 * l_d * cos_g * step, flux_q + 0.5 * l_q * sin_g * step
            l_d, l_q = inductances(one, *middle)
            flux_d, flux_q = flux_d + l_d * cos_g * step, flux_q + l_q * sin_g * step
    return volts


def fit_current_step(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Least squares of the simulated current on the measured one, all captures together.

    Saturation terms enter where they lower the Bayesian information criterion; what the
    rejected ones would still change is in the uncertainty.
    Gains scale v and i, and L with v/i. References: Schwarz, Ann. Statist. 6(2), 1978 (BIC);
    Hoeting et al., Statist. Sci. 14(4), 1999, eq. 5 (variance between models).
    """
    records, notes = _records(campaign.of("current_step"))
    axes = _axes_identified(records, options["least_share"])
    odd = disagreement(records)
    if odd or not axes:
        return METHOD.nothing(GIVES, "; ".join([*notes, odd or EXPERIMENT]))
    model = StepModel(records, inductances)
    solution = solve(model, axes)
    limit = options["most_unexplained"]
    bad = [f"{path} ({x:.0%})" for path, x in unexplained(solution).items() if not x <= limit]
    if bad:
        words = f"the current of {', '.join(bad)} is no step on a locked rotor; {EXPERIMENT}"
        return METHOD.nothing(GIVES, words)
    used = tuple(r.capture for r in records)
    notes.append(unstated_note(used, ("voltage", "current")))
    offers = offers_of(solution, axes, solution.sigmas)
    estimates = []
    for name in GIVES:
        if name not in axes:
            missing = f"no step with enough current on the {name[1]} axis; {EXPERIMENT}"
            estimates.append(METHOD.missing(name, missing))
            continue
        estimates.append(_estimate(name, solution, offers[name], notes, options))
    return Fit(tuple(estimates), tuple(_evidence(solution, axes)))


def _records(captures: Sequence[Capture]) -> tuple[list[StepRecord], list[str]]:
    """Records of steps, with notes of those that are of no use.

    An angle that no capture knows is found of all three pairs. They lie 120° apart, so one that is
    off by δ makes the saliency small by 2 δ² of itself and no more.
    """
    angles = {capture.path: rotor_angle_rad(capture) for capture in captures}
    if any(angle is not None for angle in angles.values()):
        return _read(captures, None)
    records, notes = _read(captures, 0.0)
    mean_h = {
        pair: float(np.mean([r.l_start_h for r in records if r.pair == pair] or [math.nan]))
        for pair in PAIRS
    }
    if not all(map(math.isfinite, mean_h.values())):
        return _read(captures, None)
    place = unaligned_inductances_h(*mean_h.values()).theta_low_rad
    return [replace(r, axis_rad=r.axis_rad - place) for r in records], [*notes, UNALIGNED]


def _read(
    captures: Sequence[Capture], unknown_rad: float | None
) -> tuple[list[StepRecord], list[str]]:
    records: list[StepRecord] = []
    notes: list[str] = []
    for capture in captures:
        try:
            record = read_step(capture, unknown_rad)
        except KeyError as error:
            notes.append(str(error.args[0]))
            continue
        if record is None:
            notes.append(f"{capture.path}: no step stands out of the noise")
        else:
            records.append(record)
    return records, notes


def _axes_identified(records: Sequence[StepRecord], least_share: float) -> tuple[str, ...]:
    """Which of Ld and Lq these rotor angles separate: L = 2 (cos² Ld + sin² Lq)."""
    if not records:
        return ()
    cos2 = np.array([math.cos(r.axis_rad) ** 2 for r in records])
    if np.ptp(cos2) > least_share:
        return GIVES
    if np.all(cos2 > 1.0 - 0.1 * least_share):
        return ("ld_h",)
    return ("lq_h",) if np.all(cos2 < 0.1 * least_share) else ()


def _estimate(
    name: str,
    solution: Solution,
    offers: Sequence[Offer],
    notes: Sequence[str],
    options: Mapping[str, float],
) -> Estimate:
    place, terms = AXES[name]
    value = float(solution.parameters[place])
    scatter = math.sqrt(max(float(solution.covariance()[place, place]), 0.0))
    scatter *= birge_ratio(solution)
    parts = [
        METHOD.scatter(name, scatter),
        METHOD.scatter(f"saturation:{name}", between_models(solution, offers)),
        METHOD.scatter(f"rounding:{name}", rounded_levels(name, solution)),
        *gains(name, solution),
        *rotor_angles(name, solution, math.radians(options["u_theta_elec_deg"])),
    ]
    largest = max(SPACE * r.largest_a * abs(_share(r, name)) for r in solution.model.records)
    at: dict[str, float | int | str] = {"current_a": 0.0, "current_largest_a": largest}
    words = [*notes]
    if any(solution.free[list(terms)]):
        ratio = _incremental(name, solution, largest) / value
        words.append(f"incremental {ratio - 1.0:+.1%} at {largest:.3g} A on this axis")
    else:
        words.append(f"no saturation seen up to {largest:.3g} A on this axis")
    bounds = (1e-3 * value, 1e3 * value)
    used = [r.capture for r in solution.model.records]
    return replace(METHOD.measured(name, value, parts, used, at, words), bounds=bounds)


def _share(record: StepRecord, name: str) -> float:
    return math.cos(record.axis_rad) if name == "ld_h" else math.sin(record.axis_rad)


def _incremental(name: str, solution: Solution, current_a: float) -> float:
    """Incremental inductance of one axis at an axis current [A]."""
    ramp = np.linspace(0.0, current_a / SPACE, 81)
    shared = solution.parameters[: len(SHARED)]
    return float(along_ramp(shared, 1.0 if name == "ld_h" else 0.0, ramp)[-1]) / 2.0


def _chord(record: StepRecord, drive: Drive) -> float:
    """Mean inductance [H] between the terminals over one capture, by the integrated form.

    i = (1/L) ∫v dt - (R/L) ∫i dt + c with the open voltages and the edges found as v, which are
    exact, and the resistance of pair and supply as R.
    """
    edges_s = drive.edges_s[0]
    areas = np.concatenate([[0.0], np.cumsum(drive.levels_v[0] * np.diff(edges_s))])
    volts = np.interp(record.t_s, edges_s, areas)
    amps = trapezoid(record.t_s, record.i_a)
    design = np.column_stack([volts, amps, np.ones(volts.size)])
    fit = linear_fit(design, record.i_a, 1.0 / np.sqrt(record.count))
    return 1.0 / float(fit.coefficients[0]) if fit.coefficients[0] != 0.0 else math.nan


def _evidence(solution: Solution, labels: Sequence[str]) -> Iterator[Evidence]:
    model = solution.model
    yield _saturation_plot(solution, labels)
    predicted = model.predict([solution.parameters[None, :]] * len(model.records))
    for record, current in zip(model.records, predicted, strict=True):
        rows = decimated(record.t_s.size)
        series = Series("current", record.t_s[rows], record.i_a[rows], current[rows, 0])
        title, axes = f"Step response on {record.pair}", ("t_s", f"i{record.pair[0]}_a")
        caption = "Current of the locked rotor; the fit is one model for all steps."
        yield METHOD.plot(title, axes, "line", (series,), caption, record.capture.path)


def _saturation_plot(solution: Solution, axes: Sequence[str]) -> Evidence:
    """Inductance between the terminals of each step against its largest current."""
    model = solution.model
    series = []
    for name in axes:
        x, y, fitted = [], [], []
        for record, at, slots in zip(
            model.records, model.layout.starts, model.layout.slots, strict=True
        ):
            if abs(_share(record, name)) < math.sqrt(0.5):
                continue
            drive = drive_of(record, slots, solution.parameters[None, at : at + slots.size])
            peak = float(record.i_a[int(np.argmax(np.abs(record.i_a)))])
            ramp = np.linspace(0.0, peak, 41)
            shared = solution.parameters[: len(SHARED)]
            inside = along_ramp(shared, math.cos(record.axis_rad), ramp)
            x.append(peak)
            y.append(_chord(record, drive))
            fitted.append(float(inside.mean()))
        series.append(over_x(name, np.array(x), np.array(y), np.array(fitted)))
    return METHOD.plot(
        "Inductance between the terminals against the step's largest current",
        ("current_a", "inductance_ll_h"), "scatter", series,
        "Mean over each step by the integrated form, beside the model; twice Ld or Lq.",
    )  # fmt: skip


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("current_step",),
    EXPERIMENT,
    fit_current_step,
    clock_powers=dict.fromkeys(GIVES, 1),
    options={
        "least_share": 0.2,
        # Rms over the current's span: lag in iron and a warming winding leave a tenth of this.
        "most_unexplained": 0.02,
        # A rotor that current aligned stops short by asin(friction / holding torque).
        "u_theta_elec_deg": 0.5,
    },
)
