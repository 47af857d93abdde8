"""One motor, from its files to its datasheet, report page and recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.contracts.motor import agree
from pipeline.crosscheck import agreement
from pipeline.crosscheck.registry import check_all
from pipeline.crosscheck.verdict import verdict
from pipeline.fit import alone
from pipeline.fit.registry import estimators, fit_all
from pipeline.io.code_version import code_version
from pipeline.io.publish import canonical_json, together
from pipeline.records.agreement import Disagreement
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.content import content_digest
from pipeline.records.datasheet import CaptureReference, Check, Datasheet, Superseded
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.ledger import Revocation
from pipeline.records.model_verdict import ModelVerdict
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Stopwatch
from pipeline.stages.fleet.captures import ReadTask, usable_captures
from pipeline.stages.fleet.fits import FitMemory
from pipeline.stages.fleet.jobs import Files, Finished, MotorJob, MotorResult
from pipeline.stages.fleet.keeping import libraries_version, note_motor
from pipeline.stages.fleet.keys import key_of, superseding_parts, version_parts
from pipeline.stages.fleet.model_tests import ModelMemory, judged_model


def process_motor(job: MotorJob) -> MotorResult:
    """Reads, validates, fits, checks and writes one motor; refused captures become findings.

    When all its files are on the disk, this is noted, so that a batch that was stopped goes on.
    """
    watch = Stopwatch()
    finished = _finish(job, watch)
    if job.key is not None and not job.refused:
        note_motor(Path(job.output), job.motor_id, job.key, finished)
    return MotorResult(job.motor_id, finished, watch.seconds)


def _finish(job: MotorJob, watch: Stopwatch) -> Finished:
    task = ReadTask(job.motor_id, job.input, job.entries, job.limits, job.gates, job.refused)
    captures, found = usable_captures(task, watch)
    findings = list(found)
    if not captures:
        return Finished(found, ())
    campaign = Campaign(job.motor_id, captures)
    findings.extend(agree(campaign))
    readings = tuple(content_digest(capture) for capture in captures)
    version = _version(job, readings)
    with watch.stage("fit"):
        recall = None if job.key is None else FitMemory(job, readings, version)
        constants, evidence, failures = fit_all(campaign, job.fit, recall)
        if recall is not None:
            recall.save()
    findings.extend(Finding(job.motor_id, "warning", *failure) for failure in failures)
    with watch.stage("crosscheck"):
        apart = captures_apart(campaign, job.fit)
        findings.extend(agreement.findings(apart))
        checks = check_all(constants, campaign, job.crosscheck, apart)
    with watch.stage("residual test"):
        recalled = None if job.key is None else ModelMemory(job, readings, version)
        model, broken = judged_model(campaign, job.model, constants, recalled)
    findings.extend(broken)
    datasheet = superseding(
        assemble(job, campaign, readings, version, constants, checks, model), job.revoked
    )
    files = _write(job, campaign, datasheet, evidence, (*job.findings, *findings), watch)
    return Finished(tuple(findings), files)


def captures_apart(
    campaign: Campaign, options: Mapping[str, Mapping[str, float]]
) -> tuple[Disagreement, ...]:
    """Where the captures are not of one motor; those that stand alone tell which motor is usual."""
    for captures in (alone.repeated(campaign), campaign.captures):
        apart = agreement.disagreements(alone.readings(campaign.motor_id, captures, options))
        if not apart:
            return ()
    return apart


def assemble(
    job: MotorJob,
    campaign: Campaign,
    readings: Sequence[str],
    version: str,
    constants: Constants,
    checks: tuple[Check, ...],
    model: ModelVerdict,
) -> Datasheet:
    """The datasheet of one motor; `readings` are the digests of its captures as read."""
    references = tuple(
        CaptureReference(
            c.path, c.sha256, c.meta.test, c.integrity, c.meta.station, c.meta.started_at, read
        )
        for c, read in zip(campaign.captures, readings, strict=True)
    )
    chosen = constants.chosen()
    status, why = verdict(
        chosen, checks, references, job.required, job.release, model, campaign.motor_id
    )
    motor_type, lot = campaign.nameplate("motor_type"), campaign.nameplate("lot")
    return Datasheet(
        motor_id=campaign.motor_id,
        motor_type=None if motor_type is None else str(motor_type),
        lot=None if lot is None else str(lot),
        version=version,
        status=status,
        why=why,
        captures=references,
        config_sha256=job.config_sha256,
        code_version=code_version(),
        constants=chosen,
        alternatives=constants.rest(),
        checks=checks,
        libraries=libraries_version(),
        model=model,
    )


def _version(job: MotorJob, readings: Sequence[str]) -> str:
    """Digest of the captures as read, the configuration, the code and its libraries."""
    return key_of(
        version_parts(
            code_version(), libraries_version(), [job.motor_id, *readings], job.config_sha256
        )
    )


def superseding(sheet: Datasheet, revoked: Sequence[Revocation]) -> Datasheet:
    """The datasheet, as another version where its own is revoked and has other content.

    Where the revoked version holds these very bytes, it was not them that were doubted alone: they
    stay that version, and stay revoked.
    """
    known = {revocation.version: revocation for revocation in revoked}
    while (old := known.get(sheet.version)) is not None:
        content = canonical_json(sheet.document())
        if hashlib.sha256(content).hexdigest() == old.content_sha256:
            return sheet
        place = Superseded(old.version, old.by, old.why)
        version = key_of(superseding_parts(sheet.version, place))
        sheet = replace(sheet, version=version, supersedes=place)
    return sheet


def _write(
    job: MotorJob,
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: tuple[Evidence, ...],
    findings: tuple[Finding, ...],
    watch: Stopwatch,
) -> Files:
    """Writes what the job asks for, all of it or nothing; returns the files, relative to output."""
    stem = file_stem(job.motor_id)
    files: list[tuple[str, str]] = []
    with together(Path(job.output)) as write_one:

        def write(name: str, content: bytes) -> str:
            write_one(name, content)
            files.append((name, hashlib.sha256(content).hexdigest()))
            return files[-1][1]

        with watch.stage("datasheet"):
            write(f"datasheets/{stem}.json", canonical_json(datasheet.document()))
        if job.report:
            from pipeline.report.motor_page import render_motor

            with watch.stage("report"):
                terms = {term.name: term for estimator in estimators() for term in estimator.terms}
                page = render_motor(datasheet, evidence, findings, terms)
                write(f"report/{stem}.html", page.encode())
        if job.recordings:
            from pipeline.io.recordings.seal import SEAL, seal_line

            with watch.stage("recordings"):
                for name, content in _recordings(stem, campaign, datasheet, evidence, findings):
                    sha256 = write(name, content)
                    write(name + SEAL, seal_line(name.rsplit("/", 1)[-1], sha256))
    return tuple(files)


def _recordings(
    stem: str,
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: tuple[Evidence, ...],
    findings: tuple[Finding, ...],
) -> Iterator[tuple[str, bytes]]:
    """Name and content of the motor's recording and of one a capture; what the datasheet says of a
    capture comes first in it.
    """
    from pipeline.io.recordings.capture import recording_bytes
    from pipeline.io.recordings.motor import motor_bytes
    from pipeline.stages.replay import replay

    shown = [*(one for capture in campaign.captures for one in replay(capture, datasheet))]
    shown += evidence
    yield f"recordings/motor-{stem}.rrd", motor_bytes(campaign, datasheet, shown, findings)
    for capture in campaign.captures:
        own = tuple(f for f in findings if f.file == capture.path)
        content = recording_bytes(capture, shown, datasheet, own)
        yield f"recordings/{stem}/{_place(capture.path)}.rrd", content


def _place(path: str) -> str:
    """A capture's path with each part made safe as a file name."""
    return "/".join(file_stem(part) for part in path.split("/"))
