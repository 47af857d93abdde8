"""Copper coefficient from resistance captures of the winding soaked at two temperatures."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.estimation.electrical.direct_current import (
    POINT_OPTIONS,
    TEST,
    captures_of,
    columns_of,
    direct_current_points,
    fit_direct_current,
    shifted,
)
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    budget_of,
    contributions,
    instrument_uncertainties,
    unstated_note,
)
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate, not_identifiable
from pipeline.records.uncertainty import Contribution

NAME = "soak"
GIVEN = "temp_coeff_copper_1_k"
EXPERIMENT = (
    "repeat a resistance capture of one pair with the winding soaked at least 15 K warmer, "
    "or record a heat_run"
)


def fit_soak(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Alpha at 25 degC = (dR/dT)/R25 of the pairs that were measured at two temperatures.

    The model is that of `fit_direct_current` without knowledge of copper; instrument gains cancel
    and a thermometer's offset enters only through R25.
    """
    del known
    points, notes = direct_current_points(campaign, options)
    spans = {
        pair: float(np.ptp([p.temp_degc for p in points if p.pair == pair]))
        for pair in sorted({p.pair for p in points})
    }
    points = [p for p in points if spans[p.pair] >= options["least_span_k"]]
    if not points:
        return Fit((not_identifiable(GIVEN, "1/K", NAME, EXPERIMENT),))
    columns = columns_of(points)
    fit = fit_direct_current(points, columns, np.inf)
    if not fit.full_rank or fit.u_alpha_1_k > options["worst_u_rel"] * abs(fit.alpha_1_k):
        return Fit((not_identifiable(GIVEN, "1/K", NAME, EXPERIMENT),))

    def evaluate(shift: Shift) -> np.ndarray:
        return np.array([fit_direct_current(shifted(points, shift), columns, np.inf).alpha_1_k])

    used = captures_of(campaign, points)
    shared = contributions(evaluate, instrument_uncertainties(used))[0]
    scatter = Contribution(f"scatter:{NAME}:{GIVEN}", fit.u_alpha_1_k, "A", fit.dof)
    temps = [p.temp_degc for p in points]
    estimate = Estimate(
        GIVEN,
        fit.alpha_1_k,
        "1/K",
        "measured",
        NAME,
        budget_of([scatter, *shared]),
        {"temp_winding_degc": 25.0, "temp_low_degc": min(temps), "temp_high_degc": max(temps)},
        tuple(c.path for c in used),
        "; ".join(n for n in [*notes, unstated_note(used)] if n),
    )
    return Fit((estimate,))


ESTIMATOR = Estimator(
    NAME,
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
