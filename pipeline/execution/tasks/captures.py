"""Reads and validates the captures of one motor in a worker, each file under its limits."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

from pipeline.execution.jobs import OfFiles
from pipeline.io.ingest.entry import Entry
from pipeline.io.ingest.files import size_bytes
from pipeline.io.ingest.guard import ReadLimits, died, reading, refusing
from pipeline.records.capture import Capture
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding
from pipeline.records.naming import printable
from pipeline.records.outcome import Stopwatch

Usable = tuple[tuple[Capture, ...], tuple[Finding, ...]]


@dataclass(frozen=True, slots=True)
class ReadTask(OfFiles):
    """One motor's files."""

    motor_id: str
    folder: str
    entries: tuple[Entry, ...]
    limits: ReadLimits
    gates: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    @property
    def name(self) -> str:
        """What the task works on."""
        return f"motor {printable(self.motor_id)}"


def usable_captures(task: ReadTask, watch: Stopwatch | None = None) -> Usable:
    """The usable captures by path, and the findings on refused or doubtful files.

    Parameters
    ----------
    task
        The files of one motor, and how to read them.
    watch
        Takes the time of each stage [s]; None for no timing.

    """
    from pipeline.contracts.duplicates import once
    from pipeline.contracts.validate import validate
    from pipeline.io.ingest.capture_reader import read_capture

    watch = watch or Stopwatch()
    captures: list[Capture] = []
    findings: list[Finding] = []
    folder, refused = Path(task.folder), dict(task.refused)
    for entry in task.entries:
        try:
            if entry.path in refused:
                raise died(refused[entry.path])
            size = size_bytes(folder / entry.path)
            with watch.stage("read"), reading(entry.path, size, task.limits):
                capture = read_capture(folder, entry)
            with watch.stage("validate"), refusing("its validation"):
                capture, doubts = validate(capture, task.gates)
        except CaptureError as error:
            findings.append(Finding.refusal(entry.path, error))
        else:
            captures.append(capture)
            findings.extend(doubts)
    single, doubles = once(sorted(captures, key=lambda capture: capture.path))
    return single, (*findings, *doubles)
