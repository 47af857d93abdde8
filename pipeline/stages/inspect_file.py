"""`inspect`: what one file holds, which tests it would do for, and a source map to start from."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING

from pipeline.execution.pools import Cluster, open_pool
from pipeline.execution.worker_pool import WorkerPool
from pipeline.io.ingest.files import size_bytes
from pipeline.io.ingest.guard import ReadLimits, died, reading
from pipeline.physics.glossary import TESTS
from pipeline.records.errors import CaptureError, MachineError, UsageError
from pipeline.records.finding import Finding
from pipeline.records.naming import counted, printable
from pipeline.records.outcome import Outcome
from pipeline.settings import InspectSettings

if TYPE_CHECKING:
    from pipeline.io.inspection.describe import InspectReport
    from pipeline.io.inspection.starter_map import FieldSeen
    from pipeline.io.maps.source_map import SourceMap


@dataclass(frozen=True, slots=True)
class InspectTask:
    """An untrusted file to inspect; `refused` is why it must not be read."""

    file: str
    limits: ReadLimits
    refused: str | None = None

    @property
    def name(self) -> str:
        """What the task works on."""
        return f"file {printable(self.file)}"

    def without(self, path: str, reason: str) -> InspectTask:  # noqa: ARG002 (it has one file)
        """The task with its file refused for a reason."""
        return replace(self, refused=reason)


def main(settings: InspectSettings) -> Outcome:
    """Prints what the file holds; exit code 3 and one line where `run` would refuse it."""
    if not settings.file or not Path(settings.file).exists():
        raise UsageError(f"file={settings.file or ''} is no file", "name the file to inspect")
    if Path(settings.file).is_dir():
        raise UsageError(f"{settings.file} is a folder", "name one file of it")
    task = InspectTask(settings.file, ReadLimits(settings.read_seconds, settings.read_memory_mb))
    pool = open_pool("local", Cluster())
    with TemporaryDirectory() as progress, WorkerPool(pool, 1, Path(progress) / "work") as workers:
        try:
            (seen,) = workers.map_tasks(inspect, [task])
        except CaptureError as error:
            message = f"{printable(settings.file)}: {error.message}"
            raise CaptureError(error.code, message, error.remedy, error.rows) from error
    if isinstance(seen, MachineError):
        raise seen
    text, refusals = seen
    return Outcome(CaptureError.exit_code if refusals else 0, text, refusals)


def inspect(task: InspectTask) -> tuple[str, tuple[str, ...]]:
    """The content of a file as text, and the lines by which `run` would refuse it.

    In a worker, under its limits.
    """
    from pipeline.io.inspection.describe import describe
    from pipeline.io.maps.places import source_maps

    if task.refused is not None:
        raise died(task.refused)
    path = Path(task.file)
    sources = source_maps()
    with reading(task.file, size_bytes(path), task.limits):
        report = describe(path, sources)
        refusals = _refusals(path, sources)
        if not report.faults:
            faults = tuple(f"{one.message}; {one.remedy}" for one in refusals)
            report = replace(report, faults=faults)
    return render(report), tuple(finding.line() for finding in refusals)


def _refusals(path: Path, sources: Mapping[str, SourceMap]) -> tuple[Finding, ...]:
    """Why `run` would refuse a file by itself; nothing of one that it leaves alone."""
    from pipeline.contracts.validate import validate
    from pipeline.io.ingest.capture_reader import read_capture
    from pipeline.io.ingest.survey import look, question_of

    answer = look(path.parent, question_of(path), sources)
    if answer.entry is None:
        return tuple(one for one in answer.findings if one.severity == "refused")
    try:
        validate(read_capture(path.parent, answer.entry), {})
    except CaptureError as fault:
        return (Finding.refusal(path.name, fault),)
    return ()


def render(report: InspectReport) -> str:
    """The report as text for people."""
    lines = [
        f"{report.path}: {report.form}, {counted(report.size, 'byte')}, "
        f"sha256 {report.sha256[:16]}",
        f"checksums: {report.checksums}",
    ]
    lines += [f"fault: {fault}" for fault in report.faults]
    metadata = dict(report.metadata)
    if report.source:
        lines.append(f"recognised by the source map: {report.source}")
    elif "contract" in metadata and report.faults:
        lines.append("it says `contract`, but `run` refuses it as it stands")
    elif "contract" in metadata:
        lines.append("in the form of the contract: no source map is needed")
    lines += [f"  {key}: {value}" for key, value in report.metadata]
    for stream in report.streams:
        rate = "" if stream.rate_hz is None else f", {stream.rate_hz:.6g} Hz"
        lines.append(f"{stream.name}: {counted(stream.rows, 'row')}{rate}")
        lines += [f"  {_field(seen)}" for seen in stream.fields]
    if report.streams:
        when = "tests, once a source map reads it" if report.starter else "tests"
        lines += [f"{when}:", *(f"  {line}" for line in _tests(report, metadata.get("pair")))]
    if report.starter:
        lines += ["a source map to start from:", "", report.starter.rstrip("\n")]
    return "\n".join(lines) + "\n"


def _field(seen: FieldSeen) -> str:
    first = "" if seen.first is None else f" (first {seen.first:.6g})"
    if seen.guess is None:
        return f"{seen.name}{first}: not recognised"
    unit = f" [{seen.guess.unit}]" if seen.guess.unit else ""
    verb = "is" if seen.certain else "probably"
    return f"{seen.name}{first}: {verb} {seen.guess.column}{unit}"


def _tests(report: InspectReport, pair: str | None) -> list[str]:
    """One line a test of the contract: enough, or what is missing."""
    from pipeline.contracts.requirements import requirements

    columns = report.columns
    if any(stream.rate_hz is not None for stream in report.streams):
        columns |= {"t_s"}
    lines = []
    for test in TESTS:
        missing = [need.text() for need in requirements(test, pair) if not need.met_by(columns)]
        lines.append(f"{test}: " + (f"needs {'; '.join(missing)}" if missing else "enough"))
    return lines
