"""Ld and Lq near zero current from voltage steps on a locked rotor, saturation parted off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from pipeline.fit.instruments import (
    budget_of,
    current_source,
    instrument_uncertainties,
    unstated_note,
    voltage_source,
)
from pipeline.fit.protocol import Estimator, Fit
from pipeline.fit.step_model import LD, LQ, SHARED, SPACE, TERMS, StepModel, along_ramp, start_of
from pipeline.fit.step_record import StepRecord, disagreement, read_step
from pipeline.numerics.least_squares import (
    NonlinearFit,
    autocorrelation_time,
    gauss_newton,
    linear_fit,
)
from pipeline.numerics.plateaus import decimated
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Contribution

NAME = "current_step"
GIVES = ("ld_h", "lq_h")
EXPERIMENT = (
    "record current_step captures with the rotor locked on d and on q (pair ab: theta_elec_deg -30 "
    "and 60), both senses of current, two or more amplitudes"
)
AXES = {
    "ld_h": (LD, tuple(range(LD + 1, LD + 1 + TERMS))),
    "lq_h": (LQ, tuple(range(LQ + 1, LQ + 1 + TERMS))),
}
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]
Offer = tuple[float, int, float]


@dataclass(frozen=True, slots=True)
class Solution:
    """The model, its fit over the free parameters, and each capture's noise.

    `weighted_by` are the noises that weighted this fit's residuals, `sigmas` those found in it.
    """

    model: StepModel
    parameters: Array
    free: Flags
    fit: NonlinearFit
    weighted_by: tuple[float, ...]
    sigmas: tuple[float, ...]

    def covariance(self) -> Array:
        """Covariance over all parameters [k, k], zero where one was held."""
        full = np.zeros((self.free.size, self.free.size))
        where = np.flatnonzero(self.free)
        full[np.ix_(where, where)] = self.fit.covariance
        return full


def fit_current_step(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Least squares of the simulated current on the measured one, all captures together.

    Saturation terms come in where the Bayesian information criterion pays for them; what the
    rejected ones would still change is in the uncertainty.
    Gains scale v and i, and L with v/i. References: Schwarz, Ann. Statist. 6(2), 1978 (BIC);
    Hoeting et al., Statist. Sci. 14(4), 1999, eq. 5 (variance between models).
    """
    del known
    records, notes = _records(campaign.of("current_step"))
    axes = _axes_told(records, options["least_share"])
    odd = disagreement(records)
    if odd or not axes:
        reason = "; ".join([*notes, odd or EXPERIMENT])
        return Fit(tuple(not_identifiable(n, "H", NAME, reason) for n in GIVES))
    model = StepModel(records)
    solution = _solve(model, axes)
    used = tuple(r.capture for r in records)
    notes.append(unstated_note(used, ("voltage", "current")))
    offers = _offers(solution, axes, solution.sigmas)
    estimates = []
    for name in GIVES:
        if name not in axes:
            missing = f"no step with enough current on the {name[1]} axis; {EXPERIMENT}"
            estimates.append(not_identifiable(name, "H", NAME, missing))
            continue
        estimates.append(_estimate(name, solution, offers[name], notes))
    return Fit(tuple(estimates), tuple(_evidence(solution, axes)))


def _records(captures: Sequence[Capture]) -> tuple[list[StepRecord], list[str]]:
    records: list[StepRecord] = []
    notes: list[str] = []
    for capture in captures:
        try:
            record = read_step(capture)
        except KeyError as error:
            notes.append(str(error.args[0]))
            continue
        if record is None:
            notes.append(f"{capture.path}: no step stands out of the noise")
        else:
            records.append(record)
    return records, notes


def _axes_told(records: Sequence[StepRecord], least_share: float) -> tuple[str, ...]:
    """Which of Ld and Lq these rotor angles tell apart: L = 2 (cos² Ld + sin² Lq)."""
    if not records:
        return ()
    cos2 = np.array([math.cos(r.axis_rad) ** 2 for r in records])
    if np.ptp(cos2) > least_share:
        return GIVES
    if np.all(cos2 > 1.0 - 0.1 * least_share):
        return ("ld_h",)
    return ("lq_h",) if np.all(cos2 < 0.1 * least_share) else ()


def _solve(model: StepModel, axes: Sequence[str]) -> Solution:
    """Adds saturation terms while they pay, then drops those that no longer do.

    A term pays where it lowers the weighted sum of squares by more than log n (BIC). Terms are
    proposed by the score of the present fit under white noise, one an axis and round, and judged
    after a fit with them by their own standard error, which counts correlated residuals.
    """
    free = np.ones(model.layout.size, dtype=bool)
    free[: len(SHARED)] = False
    free[[AXES[name][0] for name in axes]] = True
    start = start_of(model.records, model.layout)
    if len(axes) == 1:
        start[[LD, LQ]] = start[AXES[axes[0]][0]]
    solution = _fit(model, start, free, [record.sigma_a for record in model.records])
    price = math.log(sum(float(r.count.sum()) for r in model.records))
    for _ in range(TERMS):
        offers = _offers(solution, axes, [record.sigma_a for record in model.records])
        wanted = [max(own)[1] for own in offers.values() if own and max(own)[0] > price]
        if not wanted:
            break
        free = solution.free.copy()
        free[wanted] = True
        solution = _fit(model, solution.parameters, free, solution.sigmas)
    while True:
        worth = {k: _worth(solution, k) for name in axes for k in AXES[name][1] if solution.free[k]}
        idle = [k for k, value in worth.items() if value < price]
        if not idle:
            return solution
        least = min(idle, key=lambda k: worth[k])
        free, start = solution.free.copy(), solution.parameters.copy()
        free[least], start[least] = False, 0.0
        solution = _fit(model, start, free, solution.sigmas)


def _worth(solution: Solution, term: int) -> float:
    """What dropping one term would cost in weighted squares: (value/u)², Wald."""
    variance = float(solution.covariance()[term, term])
    return float(solution.parameters[term]) ** 2 / max(variance, 1e-300)


def _offers(
    solution: Solution, axes: Sequence[str], sigmas: Sequence[float]
) -> dict[str, list[Offer]]:
    """For each axis and each term not in use: gain in weighted squares, term, change of L.

    One Gauss-Newton step of the present fit with that term added (Rao's score test).
    """
    everything = solution.free.copy()
    for name in axes:
        everything[list(AXES[name][1])] = True
    residuals, jacobian = solution.model.residuals(solution.parameters, sigmas, everything)
    scale = np.linalg.norm(jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = jacobian / scale
    normal, gradient = scaled.T @ scaled, scaled.T @ residuals
    places = np.flatnonzero(everything)
    offers: dict[str, list[Offer]] = {}
    for name in axes:
        offers[name] = []
        for term in AXES[name][1]:
            if solution.free[term]:
                continue
            use = np.flatnonzero(solution.free[places] | (places == term))
            step = -np.linalg.pinv(normal[np.ix_(use, use)], 1e-13, hermitian=True) @ gradient[use]
            moved = step[np.flatnonzero(places[use] == AXES[name][0])[0]]
            change = float(moved / scale[np.flatnonzero(places == AXES[name][0])[0]])
            offers[name].append((-float(step @ gradient[use]), term, change))
    return offers


def _fit(model: StepModel, start: Array, free: Flags, sigmas: Sequence[float]) -> Solution:
    """Gauss-Newton over the free parameters; the noise of each capture from its residuals."""
    where = np.flatnonzero(free)

    def residuals_and_jacobian(values: Array) -> tuple[Array, Array]:
        trial = start.copy()
        trial[where] = values
        return model.residuals(trial, sigmas, free)

    low, high = model.bounds(start)
    fit = gauss_newton(
        residuals_and_jacobian, start[where], low[where], high[where], tolerance=1e-3
    )
    parameters = start.copy()
    parameters[where] = fit.parameters
    scale = np.linalg.norm(fit.jacobian, axis=0)
    meat = np.zeros((where.size, where.size))
    found, first = [], 0
    for capture, (record, sigma) in enumerate(zip(model.records, sigmas, strict=True)):
        stop = first + record.i_a.size
        rms = float(np.sqrt(np.mean(fit.residuals[first:stop] ** 2)))
        noise = rms * math.sqrt(autocorrelation_time(fit.residuals[first:stop]))
        found.append(sigma * max(noise, 1e-9))
        mine = np.searchsorted(where, model.columns_of(capture, where))
        last = stop + record.wave.u_levels_v.size
        rows = fit.jacobian[first:last, mine] / scale[mine]
        rows[: stop - first] *= noise
        meat[np.ix_(mine, mine)] += rows.T @ rows
        first = last
    bread = fit.covariance * np.outer(scale, scale)
    covariance = bread @ meat @ bread / np.outer(scale, scale)
    honest = NonlinearFit(
        fit.parameters, covariance, fit.residuals, fit.jacobian, fit.cost, fit.converged
    )
    return Solution(model, parameters, free, honest, tuple(sigmas), tuple(found))


def _between_models(solution: Solution, offers: Sequence[Offer]) -> float:
    """Standard deviation of L between the chosen model and those with one term more.

    Each is weighted by exp(-BIC/2), the chosen one by 1.
    """
    price = math.log(sum(float(r.count.sum()) for r in solution.model.records))
    weights = [math.exp(-0.5 * max(price - gain, 0.0)) for gain, _, _ in offers]
    spread = sum(w * change**2 for w, (_, _, change) in zip(weights, offers, strict=True))
    return math.sqrt(spread / (1.0 + sum(weights)))


def _estimate(
    name: str, solution: Solution, offers: Sequence[Offer], notes: Sequence[str]
) -> Estimate:
    place, terms = AXES[name]
    value = float(solution.parameters[place])
    scatter = math.sqrt(max(float(solution.covariance()[place, place]), 0.0))
    parts = [Contribution(f"scatter:{NAME}:{name}", scatter, "A")]
    between = _between_models(solution, offers)
    parts.append(Contribution(f"scatter:{NAME}:saturation:{name}", between, "A"))
    parts += _gains(name, solution)
    largest = max(SPACE * r.largest_a * abs(_share(r, name)) for r in solution.model.records)
    at: dict[str, float | int | str] = {"current_a": 0.0, "current_largest_a": largest}
    words = [n for n in notes if n]
    if any(solution.free[list(terms)]):
        ratio = _incremental(name, solution, largest) / value
        words.append(f"incremental {ratio - 1.0:+.1%} at {largest:.3g} A on this axis")
    else:
        words.append(f"no saturation seen up to {largest:.3g} A on this axis")
    bounds = (1e-3 * value, 1e3 * value)
    paths = tuple(r.capture.path for r in solution.model.records)
    note = "; ".join(words)
    return Estimate(name, value, "H", "measured", NAME, budget_of(parts), at, paths, note, bounds)


def _share(record: StepRecord, name: str) -> float:
    return math.cos(record.axis_rad) if name == "ld_h" else math.sin(record.axis_rad)


def _incremental(name: str, solution: Solution, current_a: float) -> float:
    """Incremental inductance of one axis at an axis current [A]."""
    ramp = np.linspace(0.0, current_a / SPACE, 81)
    shared = solution.parameters[: len(SHARED)]
    return float(along_ramp(shared, 1.0 if name == "ld_h" else 0.0, ramp)[-1]) / 2.0


def _gains(name: str, solution: Solution) -> list[Contribution]:
    """Each instrument's share, by the linearised fit: dp = -C J' W dr under its gain.

    A gain of v scales the predicted current, one of i the measured; both act on the captures of
    their station alone.
    """
    records = solution.model.records
    fit = solution.fit
    where = np.flatnonzero(solution.free)
    row = int(np.flatnonzero(where == AXES[name][0])[0])
    scale = np.linalg.norm(fit.jacobian, axis=0)
    scaled = fit.jacobian / scale
    inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    lever = -(inverse[row] / scale[row]) @ scaled.T
    captures = [r.capture for r in records]
    found = []
    for source, u in instrument_uncertainties(captures, ("voltage", "current")).items():
        change, first = np.zeros(fit.residuals.size), 0
        for record, offset, sigma in zip(
            records, _offsets(solution), solution.weighted_by, strict=True
        ):
            stop = first + record.i_a.size
            weight = np.sqrt(record.count) / sigma
            part = fit.residuals[first:stop]
            if voltage_source(record.capture.meta) == source:
                change[first:stop] += part + (record.i_a - offset) * weight
            if current_source(record.capture.meta) == source:
                change[first:stop] -= (record.i_a - offset) * weight
            first = stop + record.wave.u_levels_v.size
        found.append(Contribution(source, u * float(lever @ change), "B"))
    return found


def _offsets(solution: Solution) -> list[float]:
    layout = solution.model.layout
    return [
        float(solution.parameters[at + 1]) if r.wave.levels_v.size > 1 else 0.0
        for r, at in zip(solution.model.records, layout.starts, strict=True)
    ]


def _chord(record: StepRecord, edges_s: Array) -> float:
    """Mean inductance [H] between the terminals over one capture, by the integrated form.

    i = (1/L) ∫v dt - (R/L) ∫i dt + c with the levels and the fitted edges as v, which are exact.
    """
    areas = np.concatenate([[0.0], np.cumsum(record.wave.levels_v * np.diff(edges_s))])
    volts = np.interp(record.t_s, edges_s, areas)
    mean = 0.5 * (record.i_a[1:] + record.i_a[:-1])
    amps = np.concatenate([[0.0], np.cumsum(mean * np.diff(record.t_s))])
    design = np.column_stack([volts, amps, np.ones(volts.size)])
    fit = linear_fit(design, record.i_a, 1.0 / np.sqrt(record.count))
    return 1.0 / float(fit.coefficients[0]) if fit.coefficients[0] != 0.0 else math.nan


def _evidence(solution: Solution, axes: Sequence[str]) -> list[Evidence]:
    model = solution.model
    found = [_saturation_plot(solution, axes)]
    predicted = model.predict([solution.parameters[None, :]] * len(model.records))
    for record, current in zip(model.records, predicted, strict=True):
        rows = decimated(record.t_s.size)
        found.append(
            Evidence(
                NAME,
                f"Step response on {record.pair}",
                "t_s",
                f"i{record.pair[0]}_a",
                "line",
                (Series("current", record.t_s[rows], record.i_a[rows], current[rows, 0]),),
                record.capture.path,
                "Current of the locked rotor; the fit is one model for all steps.",
            )
        )
    return found


def _saturation_plot(solution: Solution, axes: Sequence[str]) -> Evidence:
    """Inductance between the terminals of each step against its largest current."""
    model = solution.model
    series = []
    for name in axes:
        x, y, fitted = [], [], []
        for record, at in zip(model.records, model.layout.starts, strict=True):
            if abs(_share(record, name)) < math.sqrt(0.5):
                continue
            edges = record.wave.edges_s.copy()
            skip = at + 1 + (record.wave.levels_v.size > 1)
            for k, index in enumerate(record.wave.free):
                edges[index] += solution.parameters[skip + k] * record.wave.period_s
            peak = float(record.i_a[int(np.argmax(np.abs(record.i_a)))])
            ramp = np.linspace(0.0, peak, 41)
            shared = solution.parameters[: len(SHARED)]
            inside = along_ramp(shared, math.cos(record.axis_rad), ramp)
            x.append(peak)
            y.append(_chord(record, edges))
            fitted.append(float(inside.mean()))
        order = np.argsort(x)
        series.append(Series(name, np.array(x)[order], np.array(y)[order], np.array(fitted)[order]))
    return Evidence(
        NAME,
        "Inductance between the terminals against the step's largest current",
        "current_a",
        "inductance_ll_h",
        "scatter",
        tuple(series),
        caption="Mean over each step by the integrated form, beside the model; twice Ld or Lq.",
    )


ESTIMATOR = Estimator(
    NAME,
    GIVES,
    ("current_step",),
    EXPERIMENT,
    fit_current_step,
    clock_powers=dict.fromkeys(GIVES, 1),
    options={"least_share": 0.2},
)
