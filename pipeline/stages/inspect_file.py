"""`inspect`: what one file holds, which tests it would do for, and a source map to start from."""

from __future__ import annotations

from pathlib import Path

from pipeline.contracts.requirements import requirements
from pipeline.io.inspect_file import InspectReport, describe
from pipeline.io.source_map import load_source_maps
from pipeline.io.starter_map import FieldSeen
from pipeline.physics.glossary import TESTS
from pipeline.records.errors import UsageError
from pipeline.records.outcome import Outcome
from pipeline.settings import InspectSettings, configuration_folder


def main(settings: InspectSettings) -> Outcome:
    """Prints what the file holds."""
    if not settings.file or not Path(settings.file).exists():
        raise UsageError(f"file={settings.file or ''} is no file", "name the file to look into")
    if Path(settings.file).is_dir():
        raise UsageError(f"{settings.file} is a folder", "name one file of it")
    sources = load_source_maps(configuration_folder() / "source")
    return Outcome(text=render(describe(Path(settings.file), sources)))


def render(report: InspectReport) -> str:
    """The report as text for people."""
    lines = [
        f"{report.path}: {report.form}, {report.size} bytes, sha256 {report.sha256[:16]}",
        f"checksums: {report.checksums}",
    ]
    lines += [f"fault: {fault}" for fault in report.faults]
    said = dict(report.metadata)
    if report.source:
        lines.append(f"recognised by the source map: {report.source}")
    elif "contract" in said and report.faults:
        lines.append("it says `contract`, but `run` refuses it as it stands")
    elif "contract" in said:
        lines.append("in the form of the contract: no source map is needed")
    lines += [f"  {key}: {value}" for key, value in report.metadata]
    for stream in report.streams:
        rate = "" if stream.rate_hz is None else f", {stream.rate_hz:.6g} Hz"
        lines.append(f"{stream.name}: {stream.rows} rows{rate}")
        lines += [f"  {_field(seen)}" for seen in stream.fields]
    if report.streams:
        lines += ["tests:", *(f"  {line}" for line in _tests(report, said.get("pair")))]
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
    columns = report.columns
    if any(stream.rate_hz is not None for stream in report.streams):
        columns |= {"t_s"}
    lines = []
    for test in TESTS:
        missing = [need.text() for need in requirements(test, pair) if not need.met_by(columns)]
        lines.append(f"{test}: " + (f"needs {'; '.join(missing)}" if missing else "enough"))
    return lines
