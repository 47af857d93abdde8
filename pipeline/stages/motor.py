"""One motor, from its files to its datasheet, report page and recordings."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

from pipeline.contracts.motor import agree
from pipeline.contracts.validate import validate
from pipeline.crosscheck.registry import check_all
from pipeline.crosscheck.verdict import verdict
from pipeline.fit.registry import estimators, fit_all
from pipeline.io.code_version import code_version
from pipeline.io.ingest import Entry, read_capture
from pipeline.io.publish import canonical_json, write_whole
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.datasheet import CaptureReference, Check, Datasheet
from pipeline.records.errors import CaptureError
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Stopwatch


@dataclass(frozen=True, slots=True)
class MotorJob:
    """Everything a worker needs for one motor; plain data, so that it crosses a process."""

    motor_id: str
    entries: tuple[Entry, ...]
    input: str
    output: str
    config_sha256: str
    required: tuple[str, ...]
    release: str
    report: bool
    recordings: bool
    gates: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    fit: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    crosscheck: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    findings: tuple[Finding, ...] = ()


@dataclass(frozen=True, slots=True)
class MotorResult:
    """What comes back: the datasheet (None if no capture was usable), findings, files, times."""

    motor_id: str
    datasheet: Datasheet | None
    findings: tuple[Finding, ...]
    files: tuple[str, ...]
    seconds: Mapping[str, float]


def process_motor(job: MotorJob) -> MotorResult:
    """Reads, validates, fits, checks and writes one motor; refused captures become findings."""
    watch = Stopwatch()
    captures, findings = _usable_captures(job, watch)
    if not captures:
        return MotorResult(job.motor_id, None, tuple(findings), (), watch.seconds)
    campaign = Campaign(job.motor_id, captures)
    findings.extend(agree(campaign))
    with watch.stage("fit"):
        constants, evidence, failures = fit_all(campaign, job.fit)
    findings.extend(Finding(job.motor_id, "warning", *failure) for failure in failures)
    with watch.stage("crosscheck"):
        checks = check_all(constants, campaign, job.crosscheck)
    datasheet = assemble(job, campaign, constants, checks)
    files = _write(job, campaign, datasheet, evidence, (*job.findings, *findings), watch)
    return MotorResult(job.motor_id, datasheet, tuple(findings), files, watch.seconds)


def _usable_captures(job: MotorJob, watch: Stopwatch) -> tuple[tuple[Capture, ...], list[Finding]]:
    captures: list[Capture] = []
    findings: list[Finding] = []
    for entry in job.entries:
        try:
            with watch.stage("read"):
                capture = read_capture(Path(job.input), entry)
            with watch.stage("validate"):
                capture, found = validate(capture, job.gates)
        except CaptureError as error:
            findings.append(Finding.refusal(entry.path, error))
        else:
            captures.append(capture)
            findings.extend(found)
    return tuple(sorted(captures, key=lambda capture: capture.path)), findings


def assemble(
    job: MotorJob, campaign: Campaign, constants: Constants, checks: tuple[Check, ...]
) -> Datasheet:
    """The datasheet of one motor; its version is a digest of inputs, configuration and code."""
    references = tuple(
        CaptureReference(c.path, c.sha256, c.meta.test, c.integrity, c.meta.station)
        for c in campaign.captures
    )
    chosen = constants.chosen()
    status, why = verdict(chosen, checks, references, job.required, job.release)
    motor_type, lot = campaign.nameplate("motor_type"), campaign.nameplate("lot")
    return Datasheet(
        motor_id=campaign.motor_id,
        motor_type=None if motor_type is None else str(motor_type),
        lot=None if lot is None else str(lot),
        version=_version(job, campaign),
        status=status,
        why=why,
        captures=references,
        config_sha256=job.config_sha256,
        code_version=code_version(),
        constants=chosen,
        alternatives=constants.rest(),
        checks=checks,
    )


def _version(job: MotorJob, campaign: Campaign) -> str:
    inputs: list[dict[str, Any]] = [
        {"path": c.path, "sha256": c.sha256, "integrity": c.integrity, "meta": asdict(c.meta)}
        for c in campaign.captures
    ]
    work = {"inputs": inputs, "config": job.config_sha256, "code": code_version()}
    return hashlib.sha256(canonical_json(work)).hexdigest()


def _write(
    job: MotorJob,
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: tuple[Evidence, ...],
    findings: tuple[Finding, ...],
    watch: Stopwatch,
) -> tuple[str, ...]:
    """Writes what the job asks for; returns the files, relative to the output folder."""
    output, stem = Path(job.output), file_stem(job.motor_id)
    files = [f"datasheets/{stem}.json"]
    with watch.stage("datasheet"):
        write_whole(output / files[0], canonical_json(datasheet.document()))
    if job.report:
        from pipeline.report.motor_page import render_motor

        files.append(f"report/{stem}.html")
        with watch.stage("report"):
            terms = {term.name: term for estimator in estimators() for term in estimator.terms}
            page = render_motor(datasheet, evidence, findings, terms)
            write_whole(output / files[-1], page.encode())
    if job.recordings:
        with watch.stage("recordings"):
            files += _record(output, stem, campaign, datasheet, evidence, findings)
    return tuple(files)


def _record(
    output: Path,
    stem: str,
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: tuple[Evidence, ...],
    findings: tuple[Finding, ...],
) -> list[str]:
    """A recording a capture and one of the motor; what the datasheet says of a capture is first."""
    from pipeline.io.recordings.capture import write_recording
    from pipeline.io.recordings.motor import write_motor_recording
    from pipeline.io.recordings.seal import SEAL
    from pipeline.stages.replay import replay

    names = [f"recordings/motor-{stem}.rrd"]
    shown = [*(one for capture in campaign.captures for one in replay(capture, datasheet))]
    shown += evidence
    write_motor_recording(campaign, datasheet, shown, findings, output / names[0])
    for capture in campaign.captures:
        names.append(f"recordings/{stem}/{_place(capture.path)}.rrd")
        own = tuple(f for f in findings if f.file == capture.path)
        write_recording(capture, shown, output / names[-1], datasheet, own)
    return [file for name in names for file in (name, name + SEAL)]


def _place(path: str) -> str:
    """A capture's path with each part made safe as a file name."""
    return "/".join(file_stem(part) for part in path.split("/"))
