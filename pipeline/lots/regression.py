"""Lots against lots: every constant of the limits file, what motors show, one verdict."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.lots.assess import Assessment, assess
from pipeline.lots.bounds import hold
from pipeline.lots.cogging import cogging_bands, order_levels
from pipeline.lots.constant import Family, Material, result
from pipeline.lots.lot_test import holm
from pipeline.lots.sample import Member, independent, lots_in_order, values_of
from pipeline.lots.traits import checks_failed, compare_traits, effects_shown, orders_shown
from pipeline.lots.verdict import overall
from pipeline.physics.glossary import Term
from pipeline.physics.notation import quantity
from pipeline.records.diagnosis_summary import DiagnosisSummary
from pipeline.records.limits import ConstantLimits, Limits
from pipeline.records.lot_constant import ConstantResult, Verdict
from pipeline.records.lot_regression import EffectChange, Group, LimitsUsed, LotRegression, Outlier
from pipeline.records.model_verdict import number

WORDS: Mapping[Verdict, str] = {
    "pass": "the same as the baseline",
    "marginal": "the same as the baseline, with remarks",
    "fail": "not the same as the baseline",
    "undecided": "not shown to be the same as the baseline",
    "not_evaluated": "not evaluated",
    "INSUFFICIENT_HISTORY": "not decided: INSUFFICIENT_HISTORY, too few baseline lots",
    "CONFOUNDED": "not decided: CONFOUNDED, the lot and its station cannot be separated",
}


@dataclass(frozen=True, slots=True)
class Samples:
    """What is compared: one version a motor on both sides.

    Attributes
    ----------
    baseline, candidate
        The groups.
    members
        Their datasheets.
    repeats
        Versions of any motor from captures of their own, for the stations.
    golden
        Those of golden motors among them, which are in no lot.
    diagnoses
        What the model of each motor lacks.

    """

    baseline: Group
    candidate: Group
    members: tuple[Member, ...]
    repeats: tuple[Member, ...] = ()
    golden: tuple[Member, ...] = ()
    diagnoses: Mapping[str, DiagnosisSummary] = field(default_factory=dict)


def compare_lots(
    samples: Samples, limits: Limits, terms: Mapping[str, Term], notes: Sequence[str] = ()
) -> LotRegression:
    """Lots against lots: every constant of the limits file, what motors show, one verdict.

    Parameters
    ----------
    samples
        The datasheets of both sides, of repeats and of golden motors.
    limits
        The limits file.
    terms
        Unit and words of each constant.
    notes
        Remarks to pass on.

    Returns
    -------
    LotRegression
        Of mode `lots`.

    """
    lots = lots_in_order(samples.members)
    order = [lot for lot, _ in lots]
    materials = [
        _material(one_limits, samples, limits, terms, order) for one_limits in limits.family()
    ]
    constants = tuple(
        result(material, family, limits, dict(lots))
        for material, family in zip(materials, _families(materials, limits), strict=True)
    )
    effects = _effects(samples, limits)
    verdict, reasons = overall(constants, effects)
    short = any(one.test.status == "INSUFFICIENT_HISTORY" for one in constants)
    return LotRegression(
        mode="lots",
        verdict=verdict,
        headline=_headline(samples, verdict, constants, effects),
        reasons=reasons,
        history="INSUFFICIENT_HISTORY" if short else "sufficient",
        baseline=samples.baseline,
        candidate=samples.candidate,
        limits=used(limits),
        constants=constants,
        effects=effects,
        orders=order_levels(samples.members),
        cogging=cogging_bands(samples.members),
        outliers=_outliers(constants),
        golden=tuple(sorted({member.sheet.motor_id for member in samples.golden})),
        notes=(*notes, *_notes(materials)),
    )


def used(limits: Limits) -> LimitsUsed:
    """The limits file as the report states it.

    Parameters
    ----------
    limits
        The limits.

    """
    rule = (
        f"Limits by their decision rule with guard bands, U = {limits.k:g} u. A change of a lot's "
        f"mean is tested against the scatter of at least {limits.min_lots} baseline lots, Holm "
        f"over the constants at {limits.alpha:g}; sameness by two one-sided tests at "
        f"{limits.alpha:g}."
    )
    return LimitsUsed(limits.name, limits.sha256, rule, limits.alpha, limits.min_lots)


def _material(
    of_constant: ConstantLimits,
    samples: Samples,
    limits: Limits,
    terms: Mapping[str, Term],
    order: Sequence[str],
) -> Material:
    values, missing = values_of(of_constant.name, samples.members)
    golden, _ = values_of(of_constant.name, samples.golden)
    repeats, _ = values_of(of_constant.name, samples.repeats)
    golden = independent(golden)
    assessment = assess(values, golden, order)
    mean = float(np.mean(assessment.base_means)) if assessment.base else None
    term = terms.get(of_constant.name)
    return Material(
        of_constant,
        term.unit if term else "1",
        term.words if term else of_constant.name,
        assessment,
        hold(of_constant, values, assessment.corrected, mean, assessment.within_sd, limits.k),
        tuple(golden),
        tuple(independent(repeats)),
        tuple(missing) if values else (),
    )


def _families(materials: Sequence[Material], limits: Limits) -> list[Family]:
    """Holm over the constants, for the lot-level test and for that of the motors."""
    lots = [_lot_p(material.assessment, limits.min_lots) for material in materials]
    motors = [_motor_p(material.assessment) for material in materials]
    size = max(sum(p is not None for p in motors), 1)
    return [
        Family(lot, motor, size)
        for lot, motor in zip(_adjusted(lots), _adjusted(motors), strict=True)
    ]


def _lot_p(assessment: Assessment, needed: int) -> float | None:
    if assessment.contrast is None or len(assessment.base) < needed or _constant(assessment):
        return None
    return assessment.contrast.lot_p


def _motor_p(assessment: Assessment) -> float | None:
    return (
        None
        if assessment.contrast is None or _constant(assessment)
        else assessment.contrast.motor_p
    )


def _constant(assessment: Assessment) -> bool:
    """Whether nothing scatters and nothing changed, as a count of poles does: no test of it."""
    return (
        assessment.contrast is not None
        and assessment.contrast.u == 0.0 == assessment.contrast.difference
    )


def _adjusted(p_values: Sequence[float | None]) -> list[float | None]:
    known = [p for p in p_values if p is not None]
    adjusted = iter(holm(known).tolist() if known else [])
    return [None if p is None else float(next(adjusted)) for p in p_values]


def _effects(samples: Samples, limits: Limits) -> tuple[EffectChange, ...]:
    """Cogging orders and checks of the datasheets, effects of the diagnoses, each one family."""
    return (
        *compare_traits(orders_shown(samples.members, limits.order_share), "datasheet"),
        *compare_traits(checks_failed(samples.members), "datasheet"),
        *compare_traits(effects_shown(samples.members, samples.diagnoses), "diagnosis"),
    )


def _headline(
    samples: Samples,
    verdict: Verdict,
    constants: Sequence[ConstantResult],
    effects: Sequence[EffectChange],
) -> str:
    lots = ", ".join(samples.candidate.lots)
    one = "Lot" if len(samples.candidate.lots) == 1 else "Lots"
    compared = sum(bool(constant.motors) for constant in constants)
    text = f"{one} {lots}: {WORDS[verdict]}; {compared} of {len(constants)} constants compared"
    failed = [f"{c.name} ({c.why.partition(':')[0]})" for c in constants if c.verdict == "fail"]
    failed += [f"{e.name} ({e.why.partition(':')[0]})" for e in effects if e.verdict == "fail"]
    return f"{text}: {', '.join(failed)}" if failed else text


def _outliers(constants: Sequence[ConstantResult]) -> tuple[Outlier, ...]:
    """The motors apart from their lot, the furthest first."""
    outliers = [
        Outlier(
            motor.motor_id,
            motor.lot,
            motor.side,
            one.name,
            motor.value,
            one.unit,
            motor.z or 0.0,
            motor.capture,
            f"{quantity(motor.value, one.unit)} is {number(abs(motor.z or 0.0))} robust standard "
            f"deviations {'above' if (motor.z or 0.0) > 0 else 'below'} its lot's median",
        )
        for one in constants
        for motor in one.motors
        if motor.outlier
    ]
    return tuple(sorted(outliers, key=lambda o: (-abs(o.z), o.motor_id, o.constant)))


def _notes(materials: Sequence[Material]) -> list[str]:
    """What the comparison left out, once each."""
    notes: dict[str, list[str]] = {}
    for material in materials:
        if material.assessment.unlinked and not material.assessment.confounded:
            lots = ", ".join(material.assessment.unlinked)
            notes.setdefault(
                f"baseline lots {lots} are of stations that nothing links to the candidate's, "
                "and are left out",
                [],
            ).append(material.limits.name)
    return [f"{words} ({', '.join(names)})" for words, names in notes.items()]
