"""One constant's result, put together from its numbers, limits and place in the family."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.lots.assess import Assessment, label
from pipeline.lots.bounds import Held, conformity
from pipeline.lots.capability import NONE as NO_CAPABILITY
from pipeline.lots.capability import capability
from pipeline.lots.chart import ewma_chart
from pipeline.lots.equivalence import NOT_EVALUATED, equivalence
from pipeline.lots.gauge import study
from pipeline.lots.lot_test import detectable, power
from pipeline.lots.outliers import critical_z, robust_z
from pipeline.lots.sample import Value
from pipeline.lots.variance import variance_components
from pipeline.lots.verdict import Answers, judge
from pipeline.records.limits import ConstantLimits, Limits
from pipeline.records.lot_constant import (
    Component,
    ConstantResult,
    EffectSize,
    Equivalence,
    Gauge,
    LotMean,
    LotTest,
    MotorValue,
    Power,
    Side,
    StationBias,
)

SHIFT_SD = 1.5


@dataclass(frozen=True, slots=True)
class Family:
    """What a constant's test needs of the others: adjusted p values, how many were tested."""

    lot_p_holm: float | None
    motor_p_holm: float | None
    size: int


@dataclass(frozen=True, slots=True)
class Material:
    """Everything known of one constant: values, repeats and golden motors with it."""

    limits: ConstantLimits
    unit: str
    words: str
    assessment: Assessment
    held: Held
    golden: tuple[Value, ...]
    repeats: tuple[Value, ...]
    missing: tuple[str, ...]


def result(
    made: Material, family: Family, limits: Limits, started: Mapping[str, str]
) -> ConstantResult:
    """The record of one constant in a comparison of lots.

    Parameters
    ----------
    made
        Values, limits and what follows from them.
    family
        Its place among the constants tested.
    limits
        The limits file.
    started
        First start of each lot, in order of time.

    Returns
    -------
    ConstantResult
        With its verdict and the reason.

    """
    of_lots = made.assessment
    candidate = [v for v in of_lots.values if v.side == "candidate"]
    lots = {lot: list(v) for side in (of_lots.base, of_lots.candidate) for lot, v in side.items()}
    mean = float(np.mean(of_lots.candidate_means)) if of_lots.candidate else 0.0
    flat = [value for values in of_lots.candidate.values() for value in values]
    spread = float(np.std(flat, ddof=1)) if len(flat) > 1 else None
    conform = conformity(made.held, candidate, of_lots.corrected, mean, spread)
    test = _test(of_lots, family, limits)
    same = _equivalence(of_lots, made.held.margin, limits.alpha)
    answers = Answers(conform, test, same, family.motor_p_holm, limits.alpha)
    decided = judge(made.limits, made.unit, of_lots, answers)
    tolerance = made.held.tolerance
    return ConstantResult(
        name=made.limits.name,
        unit=made.unit,
        words=made.words,
        verdict=decided.verdict,
        why=decided.why,
        decides=made.limits.decides,
        temperature_degc=25.0,
        motors=_motors(of_lots, made.held),
        lots=_lots(of_lots, limits, started),
        bounds=made.held.bounds,
        conformity=conform,
        test=test,
        equivalence=same,
        effect=_effect(of_lots, limits.k),
        power=_power(of_lots, limits, family.size),
        capability=capability(flat, tolerance.lower, tolerance.upper)
        if tolerance is not None
        else NO_CAPABILITY,
        variance=_variance(made, lots),
        gauge=gauge_of(made.repeats),
        stations=_stations(made),
        missing=made.missing,
    )


def _test(assessment: Assessment, family: Family, limits: Limits) -> LotTest:
    lots, needed, contrast = len(assessment.base), limits.min_lots, assessment.contrast
    if assessment.confounded:
        return LotTest("CONFOUNDED", lots, needed)
    if contrast is None:
        return LotTest("not_evaluated", lots, needed)
    if lots < needed or family.lot_p_holm is None:
        return LotTest("INSUFFICIENT_HISTORY", lots, needed)
    t = contrast.lot_t
    return LotTest(
        "evaluated",
        lots,
        needed,
        t if t is not None and math.isfinite(t) else None,
        contrast.lot_dof,
        contrast.lot_p,
        family.lot_p_holm,
        family.lot_p_holm < limits.alpha,
    )


def _equivalence(assessment: Assessment, margin: float | None, alpha: float) -> Equivalence:
    if assessment.contrast is None or margin is None or assessment.within_sd is None:
        return NOT_EVALUATED
    contrast = assessment.contrast
    return equivalence(contrast.difference, contrast.u, contrast.dof, margin, alpha)


def _effect(assessment: Assessment, k: float) -> EffectSize:
    contrast = assessment.contrast
    if contrast is None:
        return EffectSize()
    before = float(np.mean(assessment.base_means))
    return EffectSize(
        contrast.difference,
        contrast.u,
        k,
        k * contrast.u,
        contrast.difference / abs(before) if before else None,
        contrast.difference / assessment.within_sd if assessment.within_sd else None,
    )


def _power(assessment: Assessment, limits: Limits, family: int) -> Power:
    """Against a shift of 1.5 standard deviations of motors, at the hardest step of Holm's."""
    contrast = assessment.contrast
    if contrast is None or not assessment.within_sd:
        return Power("none")
    shift, alpha = SHIFT_SD * assessment.within_sd, limits.alpha / max(family, 1)
    by_lots = len(assessment.base) >= limits.min_lots and contrast.lot_se is not None
    se = contrast.lot_se if by_lots and contrast.lot_se is not None else contrast.u
    dof = contrast.lot_dof if by_lots and contrast.lot_dof is not None else contrast.dof
    return Power(
        "lots" if by_lots else "motors",
        shift,
        power(shift, se, dof, alpha),
        detectable(se, dof, alpha),
    )


def _motors(assessment: Assessment, held: Held) -> tuple[MotorValue, ...]:
    by_lot: dict[tuple[Side, str], list[Value]] = {}
    for value in assessment.values:
        if value.side is not None:
            by_lot.setdefault((value.side, value.lot), []).append(value)
    keys = {key: f"{key[0]}/{key[1]}" for key in by_lot}
    scores = robust_z(
        {
            keys[key]: [assessment.corrected[v.motor_id] for v in of_lot]
            for key, of_lot in by_lot.items()
        }
    )
    limit = critical_z(len(assessment.values), len(by_lot))
    return tuple(
        MotorValue(
            motor_id=value.motor_id,
            lot=value.lot,
            side=key[0],
            stations=value.stations,
            value=assessment.corrected[value.motor_id],
            u=value.u,
            correction=-assessment.correction.of(label(value)),
            decision=held.decisions.get(value.motor_id, "not_evaluated"),
            z=z,
            outlier=abs(z) > limit,
            capture=value.captures[0] if value.captures else None,
        )
        for key, of_lot in by_lot.items()
        for value, z in zip(of_lot, scores[keys[key]], strict=True)
    )


def _lots(
    assessment: Assessment, limits: Limits, started: Mapping[str, str]
) -> tuple[LotMean, ...]:
    """Lot means in order of time; charted where the baseline has lots enough."""
    sides: list[tuple[Side, str, tuple[float, ...]]] = [
        ("baseline", lot, values) for lot, values in assessment.base.items()
    ]
    sides += [("candidate", lot, values) for lot, values in assessment.candidate.items()]
    charted = len(assessment.base) >= limits.min_lots and bool(assessment.lots_sd)
    if charted:
        means = np.array([np.mean(values) for _, _, values in sides])
        centre = np.asarray(np.mean(assessment.base_means))
        chart = ewma_chart(means, centre, np.asarray(assessment.lots_sd))
    drawn = []
    for i, (side, lot, values) in enumerate(sides):
        sd = float(np.std(values, ddof=1)) if len(values) > 1 else None
        within_sd = assessment.within_sd if sd is None else sd
        drawn.append(
            LotMean(
                lot,
                side,
                started.get(lot),
                len(values),
                float(np.mean(values)),
                (within_sd or 0.0) / math.sqrt(len(values)),
                sd,
                float(chart.ewma[i]) if charted else None,
                float(chart.low[i]) if charted else None,
                float(chart.high[i]) if charted else None,
                bool(chart.signal[i]) if charted else False,
            )
        )
    return tuple(drawn)


def _variance(made: Material, lots: Mapping[str, Sequence[float]]) -> tuple[Component, ...]:
    again: dict[tuple[str, str], list[float]] = {}
    for value in made.repeats:
        again.setdefault((value.motor_id, label(value)), []).append(value.value)
    biases = [b.bias for b in _stations(made) if b.bias is not None and b.u is not None]
    scatter = [v.u_a for v in made.assessment.values if v.u_a > 0.0]
    return variance_components(lots, list(again.values()), scatter, biases)


def gauge_of(repeats: Sequence[Value]) -> Gauge | None:
    """The gauge study of motors that were measured again on two stations or more.

    Parameters
    ----------
    repeats
        Values from captures of their own, several a motor and station.

    Returns
    -------
    Gauge or None
        None where fewer than two motors were measured twice or more on the same two stations.

    Notes
    -----
    Of the sets of stations, the one with most motors counts. Each motor and station gives as many
    readings as the least repeated of them has, for the study is balanced.

    """
    cells: dict[str, dict[str, list[float]]] = {}
    for value in repeats:
        if value.station is not None:
            cells.setdefault(value.motor_id, {}).setdefault(value.station, []).append(value.value)
    by_stations: dict[tuple[str, ...], list[str]] = {}
    for motor, of_station in cells.items():
        full = tuple(sorted(station for station, values in of_station.items() if len(values) > 1))
        if len(full) > 1:
            by_stations.setdefault(full, []).append(motor)
    if not by_stations:
        return None
    stations, motors = max(by_stations.items(), key=lambda item: (len(item[1]), item[0]))
    if len(motors) < 2:
        return None
    repeated = min(len(cells[motor][station]) for motor in motors for station in stations)
    table = [[cells[motor][s][:repeated] for s in stations] for motor in sorted(motors)]
    return study(np.array(table))


def _stations(made: Material) -> tuple[StationBias, ...]:
    of_lots = made.assessment
    seen = {station: value for value in of_lots.values if (station := label(value))}
    golden: dict[str, set[str]] = {}
    for value in made.golden:
        golden.setdefault(label(value), set()).add(value.motor_id)
    rows = []
    for name in sorted(seen):
        bias = of_lots.correction.bias.get(name)
        motors = len(golden.get(name, ()))
        by = "golden" if bias is not None and motors else "lots" if bias is not None else ""
        if not by:
            sides = {v.side for v in of_lots.values if label(v) == name}
            both = sides >= {"baseline", "candidate"} and seen[name].station is not None
            by = "same_station" if both else "unreferenced"
        u = of_lots.correction.u_of(name) if bias is not None else None
        shown = seen[name].station or "(not stated)"
        rows.append(StationBias(shown, bias, u, by, motors))  # type: ignore[arg-type]
    return tuple(rows)
