"""One motor, from its files to its datasheet, report page and recordings."""

from __future__ import annotations

import hashlib
import importlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

from pipeline.estimation.registry import BROKEN, estimator_terms, estimators
from pipeline.execution.caches.fits import FitMemory, ModelMemory
from pipeline.execution.caches.keys import SupersedingParts, key_of
from pipeline.execution.caches.run_cache import note_motor
from pipeline.execution.caches.stamp import stamp_of
from pipeline.execution.caches.versions import datasheet_code
from pipeline.execution.jobs import Finished, MotorJob, MotorResult, WarmUp
from pipeline.execution.tasks import work
from pipeline.execution.tasks.model_tests import judged_model
from pipeline.execution.tasks.start import starts_from_fits
from pipeline.execution.workers.gate import Gate
from pipeline.execution.workers.segment_worker import open_own, shared_or_in_order
from pipeline.io.storage.publish import canonical_json, together
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.datasheet import Datasheet, Superseded
from pipeline.records.diagnosis import Diagnosis
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.ledger import Revocation
from pipeline.records.naming import file_stem
from pipeline.records.outcome import Stopwatch
from pipeline.records.performance import Blank, Performance

LATE_IMPORTS = (
    "pipeline.criticism.adequacy",
    "pipeline.io.recordings.capture",
    "pipeline.io.recordings.motor",
    "pipeline.performance.derive",
    "pipeline.report.pages.motor_page",
    "pipeline.report.pages.motor_page",
    "rerun",
    "rerun.blueprint",
)
"""Modules that a motor imports when it needs them."""
Write = Callable[[str, bytes], str]
"""Writes a file of a motor, and gives its sha256."""


def process_motor(job: MotorJob, gate: Gate | None = None) -> MotorResult | None:
    """Reads, validates, fits, checks and writes one motor; refused captures become findings.

    When all its files are on the disk, this is noted, so that a batch that was stopped goes on.

    Parameters
    ----------
    job
        What to do with one motor, and how.
    gate
        No file is written before it opens; None for none.

    Returns
    -------
    MotorResult or None
        None where the gate was dropped.

    """
    watch = Stopwatch()
    finished = _finish(job, watch, gate)
    if finished is None:
        return None
    if job.key is not None and not job.refused:
        note_motor(Path(job.output), job.motor_id, job.key, finished)
    return MotorResult(job.motor_id, finished, watch.seconds, lasting=not job.refused)


def test_model(job: MotorJob) -> None:
    """Makes the residual test of a motor beside its fits, where it does not start from them.

    The verdict is kept for `process_motor`, which waits for it.
    """
    captures, _ = work.read(job, Stopwatch())
    campaign = Campaign(job.motor_id, captures, job.constants)
    if not captures or starts_from_fits(campaign):
        return
    verdicts = ModelMemory(job, stamp_of(job, campaign))
    with shared_or_in_order():
        judged_model(campaign, job.model, Constants(), verdicts, job.diagnose)


def warm_up(start: WarmUp) -> None:
    """Imports and starts what a worker needs for its first motor, a second's work."""
    from pipeline.criticism.library.registry import effects

    if start.shares:
        open_own()
    for name in LATE_IMPORTS:
        importlib.import_module(name)
    estimators()
    effects(None)
    datasheet_code()


def _finish(job: MotorJob, watch: Stopwatch, gate: Gate | None) -> Finished | None:
    """Writes the files of one motor, all of them or nothing; None where the gate was dropped.

    What needs no verdict on the model comes before it: the verdict is what takes longest, and where
    a worker would be idle it is made there meanwhile.
    """
    captures, findings = work.read(job, watch)
    if not captures:
        return Finished(findings, ())
    campaign = Campaign(job.motor_id, captures, job.constants)
    stamp = stamp_of(job, campaign)
    recall = None if job.key is None else FitMemory(job, stamp)
    verdicts = None if job.key is None else ModelMemory(job, stamp)
    checked = work.judge(job, campaign, recall, watch)
    if recall is not None:
        recall.save()
    draft = work.assemble(job, campaign, checked, stamp)
    with watch.stage("performance"):
        performance = performance_at(campaign, draft, job.operate)
    if gate is not None and not gate.passed():
        return None
    with _files(job) as (write, files):
        if job.recordings:
            with watch.stage("recordings"):
                read = (*job.findings, *findings, *checked.findings)
                shown = _shown(campaign, draft, checked.evidence)
                for name, content in _capture_recordings(campaign, draft, shown, read):
                    _write_sealed(write, name, content)
        with shared_or_in_order():
            judged = work.with_verdict(job, campaign, checked, verdicts, watch)
        findings = (*findings, *judged.findings)
        sheet = superseding(work.assemble(job, campaign, judged, stamp), job.revoked)
        if job.recordings:
            with watch.stage("recordings"):
                content = _motor_recording(campaign, sheet, shown, (*job.findings, *findings))
                _write_sealed(write, f"recordings/motor-{file_stem(job.motor_id)}.rrd", content)
        _write(job, sheet, judged, (*job.findings, *findings), performance, write, watch)
    return Finished(findings, tuple(files))


def superseding(sheet: Datasheet, revoked: Sequence[Revocation]) -> Datasheet:
    """The datasheet, as another version where its own is revoked and has other content.

    Where the revoked version holds these very bytes, it was not them that were doubted alone: they
    stay that version, and stay revoked.

    Parameters
    ----------
    sheet
        The datasheet.
    revoked
        Revocations of the motor's versions.

    """
    known = {revocation.version: revocation for revocation in revoked}
    while (old := known.get(sheet.version)) is not None:
        if hashlib.sha256(work.content_of(sheet)).hexdigest() == old.content_sha256:
            return sheet
        place = Superseded(old.version, old.by, old.why)
        version = key_of(SupersedingParts(sheet.version, place))
        sheet = replace(sheet, version=version, supersedes=place)
    return sheet


@contextmanager
def _files(job: MotorJob) -> Iterator[tuple[Write, list[tuple[str, str]]]]:
    """How to write a file of the motor, and the names and digests of those that were written."""
    files: list[tuple[str, str]] = []
    with together(Path(job.output)) as write_one:

        def write(name: str, content: bytes) -> str:
            write_one(name, content)
            files.append((name, hashlib.sha256(content).hexdigest()))
            return files[-1][1]

        yield write, files


def _write(
    job: MotorJob,
    datasheet: Datasheet,
    judged: work.Judged,
    findings: tuple[Finding, ...],
    performance: Performance,
    write: Write,
    watch: Stopwatch,
) -> None:
    """Writes performance, diagnosis, pages and, last of all, the datasheet.

    `performance` is of the constants alone.
    """
    from pipeline.performance.derive import with_model

    stem, performance = file_stem(job.motor_id), with_model(performance, datasheet)
    write(f"performance/{stem}.json", canonical_json(performance.document()))
    if judged.diagnosis is not None:
        for name, content in _diagnosis_files(job, stem, judged.diagnosis):
            write(name, content)
    if job.report:
        from pipeline.execution.outputs.page_links import links_of
        from pipeline.report.pages.motor_page import render_motor, render_sheet

        with watch.stage("report"):
            terms = estimator_terms()
            coming = [f"recordings/motor-{stem}.rrd"] if job.recordings else []
            coming += [] if judged.diagnosis is None else [f"diagnosis/{stem}.html"]
            links = links_of(Path(job.output), "report/{}.html", job.motor_id, coming)
            page = render_motor(datasheet, judged.evidence, findings, terms, links, performance)
            write(f"report/{stem}.html", page.encode())
            write(f"sheet/{stem}.html", render_sheet(datasheet, performance).encode())
    with watch.stage("datasheet"):
        write(f"datasheets/{stem}.json", work.content_of(datasheet))


def performance_at(
    campaign: Campaign, sheet: Datasheet, stated: Mapping[str, float | None]
) -> Performance:
    """The performance of a motor at stated conditions, else at those of its captures, by its
    constants alone; `with_model` adds what the verdict on its model says.

    Numbers that break on odd constants cost nothing but themselves.

    Parameters
    ----------
    campaign
        The captures of one motor.
    sheet
        The datasheet.
    stated
        Stated conditions by key; None where a key is not given.

    """
    from pipeline.performance.conditions import operation_of
    from pipeline.performance.derive import of_constants

    operation = operation_of(campaign, stated)
    try:
        return of_constants(sheet, operation)
    except BROKEN as error:
        why = f"the derivation broke on these constants: {type(error).__name__}: {error}"
        blank = Blank("performance", "performance", why, "report the captures with this line")
        return Performance(sheet.motor_id, sheet.version, operation, blanks=(blank,))


def _diagnosis_files(job: MotorJob, stem: str, diagnosis: Diagnosis) -> Iterator[tuple[str, bytes]]:
    """Name and content of what `diagnose` writes, less the ladder's recording."""
    yield f"diagnosis/{stem}.json", canonical_json(diagnosis.document())
    if diagnosis.unknown is not None and diagnosis.unknown.sketch:
        yield f"diagnosis/effects/{diagnosis.unknown.effect}.py", diagnosis.unknown.source.encode()
    if job.report:
        from pipeline.execution.outputs.page_links import links_of
        from pipeline.report.pages.ladder_page import render_ladder

        coming = (f"report/{stem}.html", f"diagnosis/{stem}.json")
        links = links_of(Path(job.output), "diagnosis/{}.html", job.motor_id, coming)
        yield f"diagnosis/{stem}.html", render_ladder(diagnosis, links=links).encode()


def _shown(
    campaign: Campaign, sheet: Datasheet, evidence: tuple[Evidence, ...]
) -> tuple[Evidence, ...]:
    """The plots of a recording: what the datasheet says of a capture comes first."""
    from pipeline.stages.steps.replay import replay

    return (*(one for capture in campaign.captures for one in replay(capture, sheet)), *evidence)


def _capture_recordings(
    campaign: Campaign, sheet: Datasheet, shown: Sequence[Evidence], findings: Sequence[Finding]
) -> Iterator[tuple[str, bytes]]:
    """Name and content of the recording of each capture."""
    from pipeline.io.recordings.capture import recording_bytes

    stem = file_stem(campaign.motor_id)
    for capture in campaign.captures:
        of_capture = tuple(f for f in findings if f.file == capture.path)
        content = recording_bytes(capture, shown, sheet, of_capture)
        yield f"recordings/{stem}/{_place(capture.path)}.rrd", content


def _motor_recording(
    campaign: Campaign, sheet: Datasheet, shown: Sequence[Evidence], findings: Sequence[Finding]
) -> bytes:
    from pipeline.io.recordings.motor import motor_bytes

    return motor_bytes(campaign, sheet, shown, findings)


def _write_sealed(write: Write, name: str, content: bytes) -> None:
    """Writes a recording and its checksum file."""
    from pipeline.io.recordings.seal import SEAL, seal_line

    write(name + SEAL, seal_line(name.rsplit("/", 1)[-1], write(name, content)))


def _place(path: str) -> str:
    """A capture's path with each part made safe as a file name."""
    return "/".join(file_stem(part) for part in path.split("/"))
