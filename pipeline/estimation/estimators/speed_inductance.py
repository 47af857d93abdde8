"""Pole pairs by the voltages that currents induce at speed, over inductances at standstill."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from pipeline.estimation.electrical.flux_slope import (
    COLUMNS,
    STANDSTILL,
    Slope,
    flux_slope,
    rows_of_slope,
    slope_budget,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.method import Method
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.physics.glossary import Term
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.pole_pairs import BY_VOLTAGE, CONTRADICTION_SIGMAS
from pipeline.records.uncertainty import Contribution, propagate, standard_uncertainty

WORDS = "pole pairs by voltages at speed over inductances at standstill, no whole number"
TERM = Term(BY_VOLTAGE, "1", WORDS, "constant", 0.0, 1e4)
METHOD = Method("speed_inductance", (TERM,))
EXPERIMENT = (
    "record current_step or lcr captures, and a torque_map with vd_v, vq_v, id_a and iq_a, or a "
    "drive with theta_mech_rad too, in which currents change at speed; an open_circuit spin counts "
    "pole pairs better"
)


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Pole pairs p = (p L) / L: p L by `flux_slope` of the voltages of each axis, L at standstill.

    Of several logs the one that knows p L best counts, of an axis. Both axes count by their
    uncertainties; axes that contradict each other tell nothing.
    """
    stated = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    logs = [rows_of_slope(campaign.of(test), stated) for test in ("drive", "torque_map")]
    found = []
    for axis in COLUMNS:
        inductances = [known.by(method, f"l{axis}_h") for method in STANDSTILL]
        still = next((e for e in inductances if e is not None), None)
        slopes = [flux_slope(rows, axis) for rows in logs if rows]
        seen = [s for s in slopes if s is not None and s.value_h > 0.0]
        if still is not None and seen:
            slope = min(seen, key=lambda s: s.u_h)
            found.append(_pole_pairs(axis, slope, still))
    if not found:
        return METHOD.nothing([BY_VOLTAGE], EXPERIMENT)
    return Fit((_joined(found),))


def _pole_pairs(axis: str, slope: Slope, still: Estimate) -> Estimate:
    """Pole pairs by one axis."""
    value = slope.value_h / still.number
    budget = slope_budget(METHOD, axis, slope)
    parts = propagate([(1.0 / still.number, budget), (-value / still.number, still.budget)])
    share = policy().pole_pairs.inductance_share
    iron = Contribution(f"assumed:inductance_at_speed:{axis}", value * share, "B")
    late = policy().at_speed.behind_s2 * value * slope.behind_h_s2 / still.number
    behind = Contribution(f"assumed:frame:{axis}", late, "B")
    words = f"{value:.3g} by l{axis}_h of {still.method}"
    return METHOD.measured(
        BY_VOLTAGE,
        value,
        [*parts, iron, behind],
        {*still.captures, *(c.path for c in slope.rows.captures)},
        None,
        words,
    )


def _joined(found: Sequence[Estimate]) -> Estimate:
    """Both axes by their uncertainties, or the one that there is."""
    weights = np.array([1.0 / e.u**2 for e in found])
    weights /= weights.sum()
    values = [e.number for e in found]
    parts = propagate([(float(w), e.budget) for w, e in zip(weights, found, strict=True)])
    words = ", ".join(e.note for e in found)
    if len(found) == 2:
        apart = propagate([(1.0, found[0].budget), (-1.0, found[1].budget)])
        if abs(values[0] - values[1]) > CONTRADICTION_SIGMAS * standard_uncertainty(apart):
            return METHOD.missing(BY_VOLTAGE, f"the axes contradict each other: {words}")
    paths = sorted({path for e in found for path in e.captures})
    return METHOD.measured(BY_VOLTAGE, float(weights @ values), parts, paths, None, words)


ESTIMATOR = Estimator(
    METHOD.name,
    gives=(BY_VOLTAGE,),
    tests=("drive", "torque_map"),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("ld_h", "lq_h", "pole_pairs"),
    terms=METHOD.terms,
    clock_powers={BY_VOLTAGE: 1},
)
