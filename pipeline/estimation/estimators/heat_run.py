"""Copper coefficient, and R as the drive sees it, from a winding that warms under current."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.heat_record import (
    REFERENCE,
    TURNING,
    HeatRecord,
    read_heat,
    reference_resistance,
)
from pipeline.estimation.uncertainty.instruments import (
    budget_of,
    current_source,
    temperature_source,
    unstated_note,
    voltage_source,
)
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.records.capture import Array, Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence, Series
from pipeline.records.uncertainty import Budget, Contribution, propagate

METHOD = Method("heat_run")
GIVES = ("temp_coeff_copper_1_k", "r_phase_ohm")
LAG = "assumed:thermometer_lag"
EXPERIMENT = (
    "record a heat_run: steady current on a locked rotor until the winding is 20 K warmer, with "
    "temp_winding_degc, voltage and current"
)


@dataclass(frozen=True, slots=True)
class Line:
    """R(T) = r25 + slope (T - 25) of one heat run [ohm, ohm/K] with scatter and its means.

    It warms by dT/dt = rise_25 - rise_rate (T - 25) [K/s, 1/s].
    """

    record: HeatRecord
    r25_ohm: float
    slope_ohm_k: float
    covariance: Array
    span_k: float
    rise_rate_1_s: float
    rise_25_k_s: float
    dof: float
    fitted: Array


def resistance(temp_winding_degc: Array) -> Array:
    """The derivatives of a winding's resistance by what is fitted: it is linear in both.

    Parameters
    ----------
    temp_winding_degc : array [n], degC
        Winding temperature.

    Returns
    -------
    array [n, 2]
        dR/dR25 [1] and dR/d(slope) [K].

    Notes
    -----
    R(T) = R25 + s (T - 25), s = α R25; so α = s / R25.

    References
    ----------
    IEEE Std 112-2017, 5.4 (copper's resistance is linear in temperature).

    """
    excess = temp_winding_degc - 25.0
    return np.column_stack([np.ones(excess.size), excess])


def fit_heat_run(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Alpha at 25 degC and R25 by `resistance` of every run.

    dR/dT is free of whatever the inverter adds at a constant current. R25 is that of the
    resistance test where the voltage is a drive's command, so that the drop does not enter;
    a measured voltage uses its own R25, with which the gains cancel. Of several runs the one
    whose slope is known best is used.
    """
    lines, notes = _lines(campaign, known, options)
    if not lines:
        reason = "; ".join([*notes, EXPERIMENT])
        return METHOD.nothing(GIVES, reason)
    line = min(lines, key=lambda one: one.covariance[1, 1] / one.slope_ohm_k**2)
    resistance = _resistance(line, options, notes)
    reference = reference_resistance(line.record, known)
    commanded = line.record.capture.meta.voltage_kind == "commanded"
    if reference is not None and (commanded or line.record.turning):
        alpha = _alpha_against(line, reference, options, notes)
    else:
        alpha = _alpha_alone(line, resistance, options, notes)
    return Fit((alpha, resistance), (_evidence(lines),))


def _lines(
    campaign: Campaign, known: Constants, options: Mapping[str, float]
) -> tuple[list[Line], list[str]]:
    lines: list[Line] = []
    notes: list[str] = []
    for capture in campaign.of("heat_run"):
        try:
            record = read_heat(capture, known)
        except KeyError as error:
            notes.append(str(error.args[0]))
            continue
        if record is None:
            notes.append(f"{capture.path}: no steady current found")
            continue
        line = _line(record)
        if line is None or line.span_k < options["least_span_k"]:
            notes.append(f"{capture.path}: the winding warms too little")
        else:
            lines.append(line)
    return lines, notes


def _line(record: HeatRecord) -> Line | None:
    """Straight line of R against T over block means; errors by the residuals' correlation."""
    excess = record.temp_winding_degc - 25.0
    design = resistance(record.temp_winding_degc)
    fit = linear_fit(design, record.r_phase_ohm)
    if not fit.full_rank or fit.dof < 10 or fit.coefficients[1] <= 0.0:
        return None
    tau = autocorrelation_time(fit.residuals)
    rate = linear_fit(design, np.gradient(excess, record.t_s))
    return Line(
        record,
        float(fit.coefficients[0]),
        float(fit.coefficients[1]),
        fit.covariance * tau,
        float(np.ptp(excess)),
        max(-float(rate.coefficients[1]), 0.0),
        float(rate.coefficients[0]),
        max(fit.dof / tau, 1.0),
        record.r_phase_ohm - fit.residuals,
    )


def _slope_budget(line: Line, options: Mapping[str, float]) -> Budget:
    """Contributions to dR/dT: scatter, gains, and a thermometer that lags.

    A lag tau_l behind a temperature that settles at rate k makes the slope smaller by k tau_l, and
    R25 larger by what the winding warms in tau_l at 25 degC; one exponential does not separate it
    from alpha, so a slow thermometer has to be stated (`u_lag_s`).
    """
    slope = line.slope_ohm_k
    parts = [
        METHOD.scatter("slope", math.sqrt(float(line.covariance[1, 1])), line.dof),
        *_gains(line, slope),
        Contribution(LAG, slope * line.rise_rate_1_s * options["u_lag_s"], "B"),
    ]
    return budget_of(parts)


def _gains(line: Line, value_ohm: float) -> list[Contribution]:
    """What the gains of voltage and current make of a resistance, or of its slope [its unit]."""
    meta = line.record.capture.meta
    return [
        Contribution(voltage_source(meta), value_ohm * meta.instrument_u("u_rel_voltage"), "B"),
        Contribution(current_source(meta), -value_ohm * meta.instrument_u("u_rel_current"), "B"),
    ]


def _alpha_against(
    line: Line, reference: Estimate, options: Mapping[str, float], notes: Sequence[str]
) -> Estimate:
    r25 = reference.number
    alpha = line.slope_ohm_k / r25
    budget = propagate(
        [(1.0 / r25, _slope_budget(line, options)), (-alpha / r25, reference.budget)]
    )
    paths = tuple(sorted({line.record.capture.path, *reference.captures}))
    return _alpha(line, alpha, budget, paths, [f"R25 from {reference.method}", *notes])


def _alpha_alone(
    line: Line, resistance: Estimate, options: Mapping[str, float], notes: Sequence[str]
) -> Estimate:
    """Alpha from one run's own line; its scatter with the correlation of slope and R25."""
    r25, slope = line.r25_ohm, line.slope_ohm_k
    alpha = slope / r25
    gradient = np.array([-alpha / r25, 1.0 / r25])
    u = math.sqrt(float(gradient @ line.covariance @ gradient))
    systematic = [p for p in resistance.budget if p.kind == "B"]
    budget = propagate(
        [
            (1.0 / r25, tuple(p for p in _slope_budget(line, options) if p.kind == "B")),
            (-alpha / r25, budget_of(systematic)),
            (1.0, (METHOD.scatter("alpha", u, line.dof),)),
        ]
    )
    return _alpha(line, alpha, budget, (line.record.capture.path,), ["R25 from the run", *notes])


def _alpha(
    line: Line, alpha: float, budget: Budget, paths: tuple[str, ...], words: Sequence[str]
) -> Estimate:
    temps = line.record.temp_winding_degc
    at = {
        "temp_winding_degc": 25.0,
        "temp_low_degc": round(float(temps.min()), 2),
        "temp_high_degc": round(float(temps.max()), 2),
        "current_a": round(float(line.record.current_a.mean()), 4),
    }
    notes = [*words, unstated_note((line.record.capture,))]
    return METHOD.measured(GIVES[0], alpha, budget, paths, at, notes)


def _resistance(line: Line, options: Mapping[str, float], notes: Sequence[str]) -> Estimate:
    """R at 25 degC by the run's line; one current does not separate an inverter's drop from it."""
    meta = line.record.capture.meta
    commanded = meta.voltage_kind == "commanded"
    drop = options["drop_commanded_v" if commanded else "drop_measured_v"]
    current = float(line.record.current_a.mean())
    r25 = line.r25_ohm
    scatter = math.sqrt(float(line.covariance[0, 0]))
    parts = [
        METHOD.scatter("r25", scatter, line.dof),
        *_gains(line, r25),
        Contribution(
            temperature_source(meta), -line.slope_ohm_k * meta.instrument_u("u_temp_degc"), "B"
        ),
        Contribution("assumed:voltage_offset_v", drop / current, "B"),
        Contribution(LAG, -line.slope_ohm_k * line.rise_25_k_s * options["u_lag_s"], "B"),
    ]
    at = {"temp_winding_degc": 25.0, "current_a": round(current, 4)}
    words = [*notes]
    if commanded:
        words.append(f"commanded voltage: an inverter's drop up to {drop:g} V (k=1) is in u_b")
    return METHOD.measured(GIVES[1], r25, parts, (line.record.capture,), at, words)


def _evidence(lines: Sequence[Line]) -> Evidence:
    series = [
        Series(r.capture.path, r.temp_winding_degc, r.r_phase_ohm, line.fitted)
        for r, line in ((line.record, line) for line in lines)
    ]
    return METHOD.plot(
        "Resistance against winding temperature", ("temp_winding_degc", "r_phase_ohm"), "scatter",
        series, "Voltage along the current over current, block means.",
    )  # fmt: skip


ESTIMATOR = Estimator(
    METHOD.name,
    GIVES,
    ("heat_run",),
    EXPERIMENT,
    fit_heat_run,
    uses=("temp_coeff_magnet_1_k", *TURNING, *REFERENCE),
    rank=1,
    options={
        "least_span_k": 5.0,
        # A bead of half a millimetre in the winding follows within a tenth of a second, one in a
        # sleeve within one.
        "u_lag_s": 0.5,
        "drop_measured_v": 0.0005,
        "drop_commanded_v": 0.3,
    },
)
