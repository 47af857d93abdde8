"""`inspect`: what a file holds, which tests it would do for, and a source map to start from."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pipeline.execution.tasks.inspect_tasks import InspectTask, in_workers, look_into
from pipeline.io.ingest.guard import ReadLimits
from pipeline.physics.glossary import TESTS
from pipeline.records.errors import CaptureError, UsageError
from pipeline.records.naming import counted, printable
from pipeline.records.outcome import Outcome, faults_of
from pipeline.settings import InspectSettings
from pipeline.stages import inspect_map
from pipeline.stages.inspect_record import file_record

if TYPE_CHECKING:
    from pipeline.io.inspection.describe import InspectReport


def main(settings: InspectSettings) -> Outcome:
    """Prints what a file or folder holds; with a source map for what is not the contract's.

    Exit code 3 and one line a file where `run` would refuse it.

    Parameters
    ----------
    settings
        The keys of `inspect`.

    """
    place = Path(settings.file)
    if not settings.file or not place.exists():
        raise UsageError(f"file={settings.file or ''} is not there", "name a file or a folder")
    inspect_map.check_answers(settings)
    if place.is_dir():
        return inspect_map.folder(settings)
    task = InspectTask(
        str(place.parent),
        place.name,
        ReadLimits(settings.read_seconds, settings.read_memory_mb),
        settings.answers,
    )
    try:
        (seen,) = in_workers(look_into, [task])
    except CaptureError as error:
        message = f"{printable(settings.file)}: {error.message}"
        refusal = CaptureError(error.code, message, error.remedy, error.rows)
        refusal.file = settings.file
        raise refusal from error
    inspect_map.check_fields(settings, [seen])
    text = render(seen.report)
    code = CaptureError.exit_code if seen.refusals else 0
    refused = tuple(finding.line() for finding in seen.refusals)
    faults = faults_of(seen.refusals)
    record = {"files": [file_record(seen.file, seen.report)]}
    if seen.report.shape is None and not settings.check:
        document: dict[str, object] = {**record, "asked": {}, "map": None, "motors": None}
        return Outcome(code, text, refused, result=document, faults=faults)
    more = inspect_map.finish(settings, str(place.parent), [seen], (seen.file,))
    code = more.exit_code if settings.check else code
    document = {**record, **more.result}
    return Outcome(code, text + more.text, refused, result=document, faults=faults)


def render(report: InspectReport) -> str:
    """The report as text for people.

    Parameters
    ----------
    report
        What is known of the file.

    """
    from pipeline.io.inspection.text import field_line

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
        lines.append(f"{stream.name}: {counted(stream.rows, 'row')}{stream.pace}")
        lines += [f"  {field_line(seen)}" for seen in stream.fields]
    if report.streams:
        when = "tests, once a source map reads it" if report.starter else "tests"
        lines += [f"{when}:", *(f"  {line}" for line in _tests(report, metadata.get("pair")))]
    if report.starter:
        lines += ["a source map to start from:", "", report.starter.rstrip("\n")]
    return "\n".join(lines) + "\n"


def _tests(report: InspectReport, pair: str | None) -> Iterator[str]:
    """One line a test of the contract: enough, or what is missing."""
    from pipeline.contracts.requirements import requirements

    columns = report.columns
    if any(stream.rate_hz is not None for stream in report.streams):
        columns |= {"t_s"}
    for test in TESTS:
        missing = [need.text() for need in requirements(test, pair) if not need.met_by(columns)]
        yield f"{test}: " + (f"needs {'; '.join(missing)}" if missing else "enough")
