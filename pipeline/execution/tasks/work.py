"""From files to a datasheet: exactly the code that the bytes of a datasheet depend on.

The code version of a datasheet covers this module and everything that it imports: readers, gates,
estimators, checks, records. Code that shows, caches or registers datasheets is not part of it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from pipeline.contracts.motor import agree
from pipeline.crosscheck import agreement
from pipeline.crosscheck.registry import check_all
from pipeline.crosscheck.verdict import verdict
from pipeline.estimation import alone
from pipeline.estimation.registry import Recall, fit_all
from pipeline.execution.jobs import MotorJob
from pipeline.execution.tasks.captures import ReadTask, Usable, usable_captures
from pipeline.execution.tasks.model_tests import Verdicts, judged_model
from pipeline.io.storage.publish import canonical_json
from pipeline.records.agreement import Disagreement
from pipeline.records.capture import Campaign
from pipeline.records.consistent_constants import separated
from pipeline.records.constants import Constants
from pipeline.records.datasheet import CaptureReference, Check, Datasheet
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.outcome import Stopwatch

UNTESTED = ModelVerdict("not_tested", note="the residual test is not made yet")


@dataclass(frozen=True, slots=True)
class Stamp:
    """The version of a datasheet and the parts of its digest.

    `readings` are the digests of the motor's captures as they were read, in their order; `campaign`
    is everything that estimators are given, for cache keys.
    """

    version: str
    readings: tuple[str, ...]
    config_sha256: str
    code_version: str
    libraries: str
    campaign: Sequence[Any]


@dataclass(frozen=True, slots=True)
class Judged:
    """Constants, evidence of the fits, checks, residual test and findings of one motor; its
    diagnosis where one was asked for. Before the residual test is made, `model` is `UNTESTED`.
    """

    constants: Constants
    evidence: tuple[Evidence, ...]
    checks: tuple[Check, ...]
    model: ModelVerdict
    findings: tuple[Finding, ...]
    diagnosis: Diagnosis | None = None


def read(job: MotorJob, watch: Stopwatch) -> Usable:
    """The motor's usable captures by path, and the findings on refused or doubtful files.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    watch
        Takes the time of each stage [s].

    """
    task = ReadTask(
        job.motor_id, job.input, job.entries, job.limits, job.gates, refused=job.refused
    )
    return usable_captures(task, watch)


def judge(job: MotorJob, campaign: Campaign, recall: Recall | None, watch: Stopwatch) -> Judged:
    """Fits every estimator and makes every check; fits that `recall` has cached are not made again.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    campaign
        The captures of one motor.
    recall
        Cache of the estimators' fits; None for no cache.
    watch
        Takes the time of each stage [s].

    """
    with watch.stage("fit"):
        constants, evidence, failures = fit_all(campaign, job.fit, recall)
    checks = check(job, campaign, constants, watch)
    broken = (Finding(job.motor_id, "warning", *failure) for failure in failures)
    findings = (*agree(campaign), *broken, *checks.findings)
    return replace(checks, evidence=evidence, findings=findings)


def check(job: MotorJob, campaign: Campaign, constants: Constants, watch: Stopwatch) -> Judged:
    """Makes every check of fitted constants.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    campaign
        The captures of one motor.
    constants
        The fitted constants.
    watch
        Takes the time of each stage [s].

    """
    with watch.stage("crosscheck"):
        apart = disagreements_between_captures(campaign, job.fit)
        checks = check_all(constants, campaign, job.crosscheck, apart)
    return Judged(constants, (), checks, UNTESTED, tuple(agreement.findings(apart)))


def with_verdict(
    job: MotorJob, campaign: Campaign, judged: Judged, verdicts: Verdicts | None, watch: Stopwatch
) -> Judged:
    """Compares the model with the captures, unless `verdicts` has cached what that comes to.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    campaign
        The captures of one motor.
    judged
        Constants and checks of the motor.
    verdicts
        Cache of verdicts; None for no cache.
    watch
        Takes the time of each stage [s].

    """
    with watch.stage("residual test"):
        tested = judged_model(campaign, job.model, judged.constants, verdicts, job.diagnose)
    return replace(
        judged,
        model=tested.verdict,
        findings=(*judged.findings, *tested.findings),
        diagnosis=tested.diagnosis,
    )


def disagreements_between_captures(
    campaign: Campaign, options: Mapping[str, Mapping[str, float]]
) -> tuple[Disagreement, ...]:
    """Disagreements between captures that are not of one motor.

    Constants that one capture alone determines show which motor the majority is of.

    Parameters
    ----------
    campaign
        The captures of one motor.
    options
        Options by estimator.

    """
    for captures in (alone.repeated(campaign), campaign.captures):
        apart = agreement.disagreements(alone.readings(campaign, captures, options))
        if not apart:
            return ()
    return apart


def assemble(job: MotorJob, campaign: Campaign, judged: Judged, stamp: Stamp) -> Datasheet:
    """The datasheet of one motor.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    campaign
        The captures of one motor.
    judged
        Constants, checks and verdict of the motor.
    stamp
        The version and the parts of its digest.

    """
    references = references_of(campaign, stamp.readings)
    chosen = _with_notes(separated(judged.constants.chosen(), judged.model), judged.model)
    status, why = verdict(
        chosen,
        judged.checks,
        references,
        job.required,
        job.release,
        judged.model.reason(campaign.motor_id) if job.model_gates else None,
    )
    return Datasheet(
        motor_id=campaign.motor_id,
        motor_type=campaign.text("motor_type"),
        lot=campaign.text("lot"),
        version=stamp.version,
        status=status,
        why=why,
        captures=references,
        config_sha256=stamp.config_sha256,
        code_version=stamp.code_version,
        constants=chosen,
        alternatives=judged.constants.rest(),
        checks=judged.checks,
        libraries=stamp.libraries,
        model=judged.model,
    )


def _with_notes(constants: Mapping[str, Estimate], model: ModelVerdict) -> dict[str, Estimate]:
    """The constants, with a note where an effect of the motor makes them something else."""
    noted = dict(constants)
    for name, words in model.touches.items():
        if name in noted and noted[name].known:
            note = "; ".join(part for part in (words, noted[name].note) if part)
            noted[name] = replace(noted[name], note=note)
    return noted


def references_of(campaign: Campaign, readings: Sequence[str]) -> tuple[CaptureReference, ...]:
    """The captures as a datasheet names them.

    Parameters
    ----------
    campaign
        The captures of one motor.
    readings
        Digests of the captures as they were read.

    """
    return tuple(
        CaptureReference(
            c.path, c.sha256, c.meta.test, c.integrity, c.meta.station, c.meta.started_at, reading
        )
        for c, reading in zip(campaign.captures, readings, strict=True)
    )


def content_of(sheet: Datasheet) -> bytes:
    """The bytes of a datasheet's file.

    Parameters
    ----------
    sheet
        The datasheet.

    """
    return canonical_json(sheet.document())
