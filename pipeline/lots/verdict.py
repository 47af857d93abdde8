"""From the numbers to the verdict on a constant, and from constants to the verdict on a lot.

Three questions, each with its own evidence:

1. Is every motor within its limits? Guard-banded decisions; needs no history.
2. Is the lot the same as the baseline? Equivalence of means within a margin (TOST); needs no
   history either, since it concerns these two groups alone.
3. Is the lot beyond the scatter of lots? The lot-level test; needs `min_lots` baseline lots, and
   is INSUFFICIENT_HISTORY below.

A constant fails by any of: a motor outside its limits; a significant lot-level test; without the
history, a difference that is beyond the margin and, motor for motor, beyond chance. It passes
where sameness is shown, or, for a constant without a margin, where the lot-level test had its
history and saw no change. Absence of evidence alone never passes.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

from pipeline.lots.assess import Assessment
from pipeline.physics.notation import MINUS, quantity
from pipeline.records.limits import ConstantLimits
from pipeline.records.lot_constant import (
    MOST_RELATIVE,
    Conformity,
    ConstantResult,
    Equivalence,
    LotTest,
    Verdict,
)
from pipeline.records.lot_regression import EffectChange

HELD_BACK: tuple[Verdict, ...] = (
    "CONFOUNDED",
    "INSUFFICIENT_HISTORY",
    "undecided",
    "not_evaluated",
)


class Judged(NamedTuple):
    """A verdict with its reason in one sentence."""

    verdict: Verdict
    why: str


class Answers(NamedTuple):
    """The answers to the three questions on one constant.

    Attributes
    ----------
    conformity
        Decisions on the candidate's motors.
    lots
        The lot-level test.
    same
        The test of equivalence.
    motor_p_holm
        P value of the motor-level test, adjusted for the number of constants; None where none was
        made.
    alpha
        Level of the tests [1].

    """

    conformity: Conformity
    lots: LotTest
    same: Equivalence
    motor_p_holm: float | None
    alpha: float


def judge(limits: ConstantLimits, unit: str, assessment: Assessment, answers: Answers) -> Judged:
    """The verdict on one constant, by the three questions of the module.

    Parameters
    ----------
    limits
        Of the constant.
    unit
        Of the constant.
    assessment
        Its values and their contrast.
    answers
        The answers to the three questions.

    Returns
    -------
    Judged
        The verdict, and its reason in one sentence.

    """
    if not assessment.candidate or not assessment.base:
        side = "candidate" if not assessment.candidate else "baseline"
        return Judged("not_evaluated", f"no motor of the {side} has it")
    moved, conformity = _moved(assessment, unit), answers.conformity
    if conformity.worst in ("fail", "conditional_fail"):
        return Judged("fail", f"{moved}: {_outside(conformity)}")
    if assessment.confounded:
        return Judged("CONFOUNDED", assessment.confounded)
    changed = _changed(limits, unit, assessment, answers)
    return changed or _not_failed(conformity, answers.lots, answers.same, moved)


def _changed(
    limits: ConstantLimits, unit: str, assessment: Assessment, answers: Answers
) -> Judged | None:
    """The verdict where a change is proven, else None."""
    test, same, moved = answers.lots, answers.same, _moved(assessment, unit)
    if test.status == "evaluated":
        if not test.significant:
            return None
        words = f"{moved}: beyond the scatter of {test.lots} lots, p {_p(test.p_holm)}"
        if limits.tolerate and same.status == "equivalent":
            return Judged("marginal", f"{words}, yet within the margin")
        small = ", although within the margin" if same.status == "equivalent" else ""
        return Judged("fail", words + small)
    if not _beyond(assessment, same, answers.motor_p_holm, answers.alpha):
        return None
    margin, p = quantity(same.margin or 0.0, unit, 3), _p(answers.motor_p_holm)
    return Judged("fail", f"{moved}: beyond the margin of {margin}, p {p} by motors")


def _not_failed(conformity: Conformity, test: LotTest, same: Equivalence, moved: str) -> Judged:
    history = f"{test.lots} of {test.needed} baseline lots"
    if same.status == "equivalent":
        words = f"{moved}: shown to lie within the margin, p {_p(same.p_value)}"
    elif test.status != "evaluated":
        return Judged("INSUFFICIENT_HISTORY", f"{moved}: not shown to be the same, {history}")
    elif same.status == "not_evaluated":
        words = f"{moved}: no change beyond the scatter of {test.lots} lots; no margin is stated"
    else:
        return Judged("undecided", f"{moved}: no change seen, but not shown to be the same either")
    if conformity.worst == "conditional_pass":
        return Judged("marginal", f"{words}; {conformity.worst_motor} is in the guard band")
    return Judged("pass", words)


def overall(
    constants: Sequence[ConstantResult], effects: Sequence[EffectChange]
) -> tuple[Verdict, tuple[str, ...]]:
    """The verdict on a comparison and its reasons.

    Parameters
    ----------
    constants
        Results of all constants.
    effects
        Changes of what motors show.

    Returns
    -------
    verdict, reasons
        Any constant or effect can fail it. Only constants that decide can hold back a pass, and one
        that neither side has is not part of the comparison.

    """
    everything: tuple[ConstantResult | EffectChange, ...] = (*effects, *constants)
    failed = _reasons(everything, "fail")
    if failed:
        return "fail", failed
    present = [one for one in constants if one.motors]
    deciding = [one for one in present if one.decides]
    for verdict in HELD_BACK:
        if held := _reasons(deciding, verdict):
            return verdict, held
    if not any(one.verdict in ("pass", "marginal") for one in present):
        return "undecided", ("no constant could be compared",)
    doubts: tuple[Verdict, ...] = ("marginal", *HELD_BACK)
    doubtful = tuple(
        reason
        for verdict in doubts
        for reason in _reasons((*effects, *present), verdict)
        if verdict != "not_evaluated"
    )
    return ("marginal", doubtful) if doubtful else ("pass", ())


def _reasons(results: Sequence[ConstantResult | EffectChange], verdict: Verdict) -> tuple[str, ...]:
    return tuple(f"{one.name}: {one.why}" for one in results if one.verdict == verdict)


def _beyond(
    assessment: Assessment, same: Equivalence, motor_p_holm: float | None, alpha: float
) -> bool:
    """Whether the difference is beyond the margin and beyond the chance of drawing motors."""
    if assessment.contrast is None or same.margin is None or motor_p_holm is None:
        return False
    return abs(assessment.contrast.difference) > same.margin and motor_p_holm < alpha


def _outside(conformity: Conformity) -> str:
    failed = {"fail", "conditional_fail"}
    number = sum(count.motors for count in conformity.counts if count.decision in failed)
    total = sum(count.motors for count in conformity.counts)
    kind = conformity.worst.replace("_", " ")
    return f"{number} of {total} motors outside the limits, {conformity.worst_motor} is a {kind}"


def _moved(assessment: Assessment, unit: str) -> str:
    """The change in words: relative where it can be, and where that share says something."""
    if assessment.contrast is None:
        return "not compared with the baseline"
    before = sum(assessment.base_means) / len(assessment.base_means)
    change = assessment.contrast.difference
    if before and abs(change) <= MOST_RELATIVE * abs(before):
        return f"{100.0 * change / abs(before):+.3g} %".replace("-", MINUS)
    return f"{'+' if change > 0.0 else ''}{quantity(change, unit, 3)}"


def _p(value: float | None) -> str:
    return "unknown" if value is None else "< 0.001" if value < 0.001 else f"{value:.3f}"
