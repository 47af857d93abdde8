"""Copper coefficient from resistance captures of the winding soaked at two temperatures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.estimation.electrical.direct_current import (
    POINT_OPTIONS,
    TEST,
    captures_of,
    direct_current_points,
    shifted,
    uncertainties_of,
)
from pipeline.estimation.estimators.resistance import columns_of, fit_direct_current
from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import Shift, contributions, unstated_note
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants

METHOD = Method("soak")
GIVEN = "temp_coeff_copper_1_k"
EXPERIMENT = (
    "repeat a resistance capture of one pair with the winding soaked at least 15 K warmer, "
    "or record a heat_run"
)


def fit_soak(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Alpha at 25 degC of the pairs that were measured at two temperatures.

    Notes
    -----
    α = (dR/dT) / R25, fitted with R25 as in `estimators.resistance.terminal_voltage`, without
    knowledge of copper. Instrument gains cancel, and a thermometer's offset enters only through
    R25.

    """
    points, notes = direct_current_points(campaign, options)
    spans = {
        pair: float(np.ptp([p.temp_degc for p in points if p.pair == pair]))
        for pair in sorted({p.pair for p in points})
    }
    points = [p for p in points if spans[p.pair] >= options["least_span_k"]]
    if not points:
        return METHOD.nothing((GIVEN,), EXPERIMENT)
    columns = columns_of(points)
    fit = fit_direct_current(points, columns, np.inf)
    if not fit.full_rank or fit.u_alpha_1_k > options["worst_u_rel"] * abs(fit.alpha_1_k):
        return METHOD.nothing((GIVEN,), EXPERIMENT)

    def evaluate(shift: Shift) -> np.ndarray:
        return np.array([fit_direct_current(shifted(points, shift), columns, np.inf).alpha_1_k])

    used = captures_of(campaign, points)
    shared = contributions(evaluate, uncertainties_of(points, used))[0]
    parts = [METHOD.scatter(GIVEN, fit.u_alpha_1_k, fit.dof), *shared]
    temps = [p.temp_degc for p in points]
    at = {"temp_winding_degc": 25.0, "temp_low_degc": min(temps), "temp_high_degc": max(temps)}
    notes.append(unstated_note(used))
    return Fit((METHOD.measured(GIVEN, fit.alpha_1_k, parts, used, at, notes),))


ESTIMATOR = Estimator(
    METHOD.name,
    (GIVEN,),
    (TEST,),
    EXPERIMENT,
    fit_soak,
    rank=1,
    options={
        **POINT_OPTIONS,
        "least_span_k": 10.0,
        "worst_u_rel": 0.2,
    },
)
