"""Ld and Lq near zero current from voltage steps on a locked rotor, saturation parted off."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import chain, combinations

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
from pipeline.fit.step_model import LD, LQ, SHARED, SPACE, StepModel, inductance, start_of
from pipeline.fit.step_record import StepRecord, read_step
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
AXES = {"ld_h": (LD, (LD + 1, LD + 2, LD + 3)), "lq_h": (LQ, (LQ + 1, LQ + 2, LQ + 3))}
Array = NDArray[np.float64]
Flags = NDArray[np.bool_]


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

    First with all terms of saturation, then with those that the Bayesian information criterion
    keeps; what the rejected ones would still change is in the uncertainty.
    Gains scale v and i, and L with v/i. References: Schwarz, Ann. Statist. 6(2), 1978 (BIC);
    Hoeting et al., Statist. Sci. 14(4), 1999, eq. 5 (variance between models).
    """
    del known
    records, notes = _records(campaign.of("current_step"))
    axes = _axes_told(records, options["least_share"])
    if not axes:
        reason = "; ".join([*notes, EXPERIMENT])
        return Fit(tuple(not_identifiable(n, "H", NAME, reason) for n in GIVES))
    model = StepModel(records)
    solution, rich = _solve(model, axes)
    used = tuple(r.capture for r in records)
    notes.append(unstated_note(used, ("voltage", "current")))
    estimates = []
    for name in GIVES:
        if name not in axes:
            missing = f"no step with enough current on the {name[1]} axis; {EXPERIMENT}"
            estimates.append(not_identifiable(name, "H", NAME, missing))
            continue
        estimates.append(_estimate(name, solution, rich, notes))
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


def _solve(model: StepModel, axes: Sequence[str]) -> tuple[Solution, Solution]:
    """The chosen fit, and the one with all saturation terms that it was chosen from."""
    full = np.ones(model.layout.size, dtype=bool)
    full[: len(SHARED)] = False
    for name in axes:
        full[[AXES[name][0], *AXES[name][1]]] = True
    start = start_of(model.records, model.layout)
    if len(axes) == 1:
        start[[LD, LQ]] = start[AXES[axes[0]][0]]
    rich = _fit(model, start, full, [record.sigma_a for record in model.records])
    chosen = full.copy()
    start = rich.parameters.copy()
    for name in axes:
        dropped = _ranked(rich, name)[0][1]
        chosen[list(dropped)] = False
        start[list(dropped)] = 0.0
    if np.array_equal(chosen, full):
        return rich, rich
    return _fit(model, start, chosen, rich.sigmas), rich


def _fit(model: StepModel, start: Array, free: Flags, sigmas: Sequence[float]) -> Solution:
    """Gauss-Newton over the free parameters; the noise of each capture from its residuals."""
    where = np.flatnonzero(free)

    def residuals_and_jacobian(values: Array) -> tuple[Array, Array]:
        trial = start.copy()
        trial[where] = values
        return model.residuals(trial, sigmas, free)

    low = np.full(where.size, -np.inf)
    for place in (LD, LQ):
        low[where == place] = 1e-3 * start[place]
    fit = gauss_newton(residuals_and_jacobian, start[where], low, tolerance=1e-3)
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


def _ranked(rich: Solution, name: str) -> list[tuple[float, tuple[int, ...], float]]:
    """Saturation terms to drop on one axis, best first: (BIC, dropped, change of L).

    From the full fit alone: dropping the set S costs x_S' C_SS^-1 x_S and moves L by
    -C_LS C_SS^-1 x_S.
    """
    place, terms = AXES[name]
    covariance = rich.covariance()
    samples = max(float(sum(r.count.sum() for r in rich.model.records)), 2.0)
    ranked = []
    for dropped in chain.from_iterable(combinations(terms, k) for k in range(len(terms) + 1)):
        index = list(dropped)
        cost, moved = 0.0, 0.0
        if index:
            inverse = np.linalg.pinv(covariance[np.ix_(index, index)], hermitian=True)
            cost = float(rich.parameters[index] @ inverse @ rich.parameters[index])
            moved = -float(covariance[place, index] @ inverse @ rich.parameters[index])
        kept = len(terms) - len(index)
        ranked.append((cost + kept * math.log(samples), dropped, moved))
    return sorted(ranked)


def _between_models(rich: Solution, name: str) -> float:
    """Standard deviation of L between the models, each weighted by exp(-BIC/2)."""
    ranked = _ranked(rich, name)
    weights = np.array([math.exp(-0.5 * (bic - ranked[0][0])) for bic, _, _ in ranked])
    moved = np.array([change for _, _, change in ranked]) - ranked[0][2]
    return math.sqrt(float(weights @ moved**2 / weights.sum()))


def _estimate(name: str, solution: Solution, rich: Solution, notes: Sequence[str]) -> Estimate:
    place, terms = AXES[name]
    value = float(solution.parameters[place])
    scatter = math.sqrt(max(float(solution.covariance()[place, place]), 0.0))
    parts = [Contribution(f"scatter:{NAME}:{name}", scatter, "A")]
    between = _between_models(rich, name)
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
    first = AXES[name][0]
    low, a, b, c = solution.parameters[first : first + 4]
    return float(low / (1.0 + current_a * (a + current_a * (b + c * current_a**2))))


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
            shared = np.tile(solution.parameters[: len(SHARED)], (41, 1))
            inside = inductance(shared, np.full(41, math.cos(record.axis_rad)), ramp)
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
    options={"least_share": 0.2},
)
