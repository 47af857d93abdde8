"""`run`: recordings in, motor datasheets out."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor, ThreadPoolExecutor
from dataclasses import dataclass
from datetime import UTC, datetime
from multiprocessing import get_context
from pathlib import Path
from typing import Any

from pipeline.contracts.registry import gates
from pipeline.crosscheck.registry import rules
from pipeline.fit.registry import estimators
from pipeline.io.ingest import Entry, Survey, survey
from pipeline.io.limits import limits_file, required_constants
from pipeline.io.publish import canonical_json, write_whole
from pipeline.io.registry import Registry
from pipeline.io.source_map import SourceMap, find_map, load_source_maps
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import MachineError, PipelineError, UsageError
from pipeline.records.finding import Finding
from pipeline.records.outcome import Outcome, Stopwatch, first_that_applies
from pipeline.report.console import summary
from pipeline.settings import RunSettings, configuration_folder, result_document
from pipeline.stages.motor import MotorJob, MotorResult, process_motor

MANIFEST = "outputs.json"


@dataclass(frozen=True, slots=True)
class Registered:
    """What became of the datasheets in the registry: exit code, a line of text, error lines."""

    code: int = 0
    text: str = ""
    errors: tuple[str, ...] = ()


def main(settings: RunSettings) -> Outcome:
    """Every motor of `input` to `output`; refused captures are named and the rest goes on."""
    watch = Stopwatch()
    _known_options(settings)
    folder = Path(settings.input)
    if not folder.is_dir():
        raise UsageError(f"input={settings.input} is no folder", "name the folder of captures")
    if Path(settings.output).exists() and not Path(settings.output).is_dir():
        raise UsageError(f"output={settings.output} is a file", "name a folder to write to")
    registry = _registry(settings)
    conf = configuration_folder()
    limits = limits_file(conf / "limits", settings.limits)
    with watch.stage("survey"):
        found = survey(folder, _source_maps(conf / "source", settings.source))
    jobs = _jobs(settings, found, limits)
    with watch.stage("motors"):
        results, died = _process(jobs, settings.workers)
    findings = tuple(
        sorted({*found.findings, *(f for r in results for f in r.findings)}, key=_order)
    )
    with watch.stage("fleet"):
        _publish(settings, results, findings)
    with watch.stage("registry"):
        registered = _register(registry, Path(settings.output), results)
    for result in results:
        for name, seconds in result.seconds.items():
            watch.seconds[f"  {name}"] = watch.seconds.get(f"  {name}", 0.0) + seconds
    outcome = _outcome(settings, results, findings, found, watch)
    return Outcome(
        first_that_applies(outcome.exit_code, registered.code, *(e.exit_code for e in died)),
        "\n".join(filter(None, [outcome.text, registered.text])),
        (*outcome.errors, *registered.errors, *(f"error: {e}" for e in died)),
        outcome.timings,
    )


def _known_options(settings: RunSettings) -> None:
    """Refuses an option of an estimator or check that does not exist: a typo must not be silent."""
    plugs: tuple[tuple[str, Mapping[str, Any], Mapping[str, Mapping[str, float]]], ...] = (
        ("fit", settings.fit, {e.name: e.options for e in estimators()}),
        ("gates", settings.gates, {g.name: g.settings() for g in gates()}),
        ("crosscheck", settings.crosscheck, {r.name: r.options for r in rules()}),
    )
    for room, given, known in plugs:
        for name, options in given.items():
            if name not in known:
                raise UsageError(f"{room}.{name}: no such plug-in", f"one of {', '.join(known)}")
            for option in options:
                if option not in known[name]:
                    has = ", ".join(known[name]) or "none"
                    raise UsageError(f"{room}.{name}.{option}: no such option", f"it has {has}")


def _registry(settings: RunSettings) -> Registry | None:
    """The registry of this run; raises UsageError for a place where none can be."""
    if settings.registry is None:
        return None
    place = settings.registry
    if place in ("", "auto"):
        place = (Path(settings.output) / "registry").as_posix()
    return Registry(place, {name: str(v) for name, v in settings.registry_options.items()})


def _register(
    registry: Registry | None, output: Path, results: Sequence[MotorResult]
) -> Registered:
    """Publishes all datasheets in one commit; a registry that fails leaves the outputs whole."""
    names = [name for r in results for name in r.files if name.startswith("datasheets/")]
    if registry is None or not names:
        return Registered()
    try:
        sheets = ((output / name).read_bytes() for name in names)
        receipt = registry.publish(sheets, datetime.now(UTC))
    except MachineError as error:
        return Registered(error.exit_code, errors=(f"error: {error}",))
    counts = f"{len(receipt.added)} new, {len(receipt.known)} known"
    text = f"registry {registry.place}: {counts}"
    errors = tuple(
        f"error: motor {event.motor_id}: version {event.version[:12]} is registered with other "
        "content; the same work gave other bytes, so the registered one stays"
        for event in receipt.conflicts
    )
    return Registered(1 if errors else 0, text, errors)


def _source_maps(folder: Path, name: str) -> dict[str, SourceMap]:
    """Every source map, or the one that was asked for."""
    maps = load_source_maps(folder)
    return maps if name == "auto" else {name: find_map(maps, name)}


def _order(finding: Finding) -> tuple[str, str, str, tuple[int, int]]:
    return finding.file, finding.severity, finding.code, finding.rows or (-1, -1)


def _jobs(settings: RunSettings, found: Survey, limits: Path) -> list[MotorJob]:
    motors: dict[str, list[Entry]] = {}
    for entry in found.entries:
        motors.setdefault(entry.said["motor_id"], []).append(entry)
    required = required_constants(limits)
    # Of the limits file, what a lot is held to changes no datasheet.
    work = canonical_json({**result_document(settings), "required": required})
    return [
        MotorJob(
            motor_id=motor_id,
            entries=tuple(own),
            input=settings.input,
            output=settings.output,
            config_sha256=_digest(work, own),
            required=required,
            release=settings.release,
            report=settings.report,
            recordings=settings.recordings,
            gates=settings.gates,
            fit=settings.fit,
            crosscheck=settings.crosscheck,
            findings=tuple(f for f in found.findings if f.file in {e.path for e in own}),
        )
        for motor_id, own in sorted(motors.items())
    ]


def _digest(work: bytes, entries: Sequence[Entry]) -> str:
    """Digest of the settings, the limits file and the source maps that these captures need."""
    maps = sorted({repr(entry.source) for entry in entries if entry.source is not None})
    return hashlib.sha256("\n".join([work.decode(), *maps]).encode()).hexdigest()


def _process(
    jobs: Sequence[MotorJob], workers: int
) -> tuple[list[MotorResult], tuple[MachineError, ...]]:
    """The results in the order of the jobs, and an error for each job whose worker died.

    What was raised on purpose (a full disk) ends the run: it would meet the next motor too.
    """
    if not jobs:
        return [], ()
    with _executor(min(workers or os.cpu_count() or 1, len(jobs))) as executor:
        futures = [executor.submit(process_motor, job) for job in jobs]
        errors = [future.exception() for future in futures]
    died = []
    for job, error in zip(jobs, errors, strict=True):
        if isinstance(error, PipelineError):
            raise error
        if error is not None:
            what = f"motor {job.motor_id} could not be finished: {type(error).__name__}: {error}"
            remedy = "report it with this line; the other motors are done"
            died.append(MachineError(what, remedy))
    return [f.result() for f, e in zip(futures, errors, strict=True) if e is None], tuple(died)


def _executor(workers: int) -> Executor:
    if workers == 1:
        return ThreadPoolExecutor(1)
    return ProcessPoolExecutor(workers, mp_context=get_context("spawn"))


def _publish(
    settings: RunSettings, results: Sequence[MotorResult], findings: Sequence[Finding]
) -> None:
    """Writes what belongs to the batch, then takes away what an earlier run left behind."""
    output = Path(settings.output)
    document = {"schema": "findings/1", "findings": [f.document() for f in findings]}
    write_whole(output / "findings.json", canonical_json(document))
    files = ["findings.json", *(name for result in results for name in result.files)]
    if settings.report:
        from pipeline.report.fleet_page import render_fleet

        files.append("report/index.html")
        page = render_fleet(_datasheets(results), tuple(findings))
        write_whole(output / "report/index.html", page.encode())
    _sweep(output, files)


def _sweep(output: Path, files: Sequence[str]) -> None:
    """Removes the files that the last run listed and this one did not write."""
    manifest = output / MANIFEST
    before = json.loads(manifest.read_bytes())["files"] if manifest.is_file() else []
    for name in sorted(set(before) - set(files)):
        stale = output / name
        if stale.resolve().is_relative_to(output.resolve()):
            stale.unlink(missing_ok=True)
    write_whole(manifest, canonical_json({"schema": "outputs/1", "files": sorted(files)}))


def _datasheets(results: Sequence[MotorResult]) -> tuple[Datasheet, ...]:
    return tuple(r.datasheet for r in results if r.datasheet is not None)


def _outcome(
    settings: RunSettings,
    results: Sequence[MotorResult],
    findings: Sequence[Finding],
    found: Survey,
    watch: Stopwatch,
) -> Outcome:
    datasheets = _datasheets(results)
    statuses = [{check.status for check in sheet.checks} for sheet in datasheets]
    code = first_that_applies(
        1 if any("fail" in seen for seen in statuses) else 0,
        3 if any(finding.severity == "refused" for finding in findings) else 0,
        4 if not datasheets or any(seen == {"not_evaluated"} for seen in statuses) else 0,
    )
    lines = tuple(finding.line() for finding in findings)
    if not found.entries:
        nothing = f"undecided: no usable capture in {settings.input}; `inspect FILE` says why"
        lines = (*lines, nothing)
    if found.note:
        lines = (*lines, f"note: {found.note}")
    text = summary(datasheets, findings, settings.output, report=settings.report)
    return Outcome(code, text, lines, watch.table())
