"""Untrusted files inspected by workers, each file under its limits."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.execution.jobs import OfFile
from pipeline.execution.workers.pools import core_count
from pipeline.execution.workers.worker_pool import local_workers
from pipeline.io.ingest.files import size_bytes
from pipeline.io.ingest.guard import died, reading
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding

if TYPE_CHECKING:
    from pipeline.io.inspection.describe import InspectReport
    from pipeline.io.maps.source_map import SourceMap


@dataclass(frozen=True, slots=True)
class InspectTask(OfFile):
    """An untrusted file of a folder to inspect."""

    answers: Mapping[str, str]


@dataclass(frozen=True, slots=True)
class Looked:
    """The report of one file, and why `run` would refuse it."""

    file: str
    report: InspectReport
    refusals: tuple[Finding, ...]


def in_workers(work: Callable[[Any], Any], tasks: Sequence[Any]) -> list[Any]:
    """The results of tasks in workers, in their order.

    Parameters
    ----------
    work
        What is done with a task; importable in a worker.
    tasks
        The tasks.

    Raises
    ------
    MachineError
        One cannot be.

    """
    with local_workers(min(core_count(), len(tasks)) or 1) as workers:
        return workers.all_of(work, tasks)


def look_into(task: InspectTask) -> Looked:
    """What a file holds, and the lines by which `run` would refuse it.

    In a worker, under its limits.

    Parameters
    ----------
    task
        The file, and how to read it.

    """
    from pipeline.io.inspection.describe import describe
    from pipeline.io.maps.places import source_maps

    if task.refused is not None:
        raise died(task.refused)
    sources = source_maps()
    with reading(task.file, size_bytes(task.place), task.limits):
        report = describe(task.place, sources, task.answers)
        refusals = _refusals(task.place, sources)
        if not report.faults:
            faults = tuple(f"{one.message}; {one.remedy}" for one in refusals)
            report = replace(report, faults=faults)
    return Looked(task.file, report, refusals)


def _refusals(path: Path, sources: Mapping[str, SourceMap]) -> tuple[Finding, ...]:
    """Why `run` would refuse a file by itself; nothing of one that it leaves alone."""
    from pipeline.contracts.validate import validate
    from pipeline.io.ingest.capture_reader import read_capture
    from pipeline.io.ingest.identification import identify
    from pipeline.io.ingest.survey import question_of

    answer = identify(path.parent, question_of(path), sources)
    if answer.entry is None:
        return tuple(one for one in answer.findings if one.severity == "refused")
    try:
        validate(read_capture(path.parent, answer.entry), {})
    except CaptureError as fault:
        return (Finding.refusal(path.name, fault),)
    return ()
