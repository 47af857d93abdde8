"""Captures of a folder as validated campaigns, one a motor; for compare, diagnose and plan.

Untrusted files are parsed by workers under limits, as in a run, and never in the driver.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from pipeline.execution.tasks.captures import ReadTask, usable_captures
from pipeline.execution.tasks.survey_tasks import survey_with
from pipeline.execution.workers.pools import core_count
from pipeline.execution.workers.worker_pool import local_workers
from pipeline.io.ingest.files import input_folder
from pipeline.io.ingest.guard import ReadLimits
from pipeline.io.ingest.survey import Survey, survey
from pipeline.io.maps.places import source_maps
from pipeline.records.capture import Campaign
from pipeline.records.errors import UsageError, meant
from pipeline.records.finding import Finding, lines_of
from pipeline.records.outcome import Outcome, faults_of, first_that_applies
from pipeline.report.text.console import nothing_usable


class Gathered(NamedTuple):
    """Campaigns by motor_id, findings on refused or doubtful files, and a line on other files."""

    campaigns: tuple[Campaign, ...]
    findings: tuple[Finding, ...]
    note: str


def campaigns(
    folder: str,
    source: str = "auto",
    motor: str | None = None,
    limits: ReadLimits | None = None,
    config_dir: str | None = None,
    only: Collection[str] | None = None,
) -> Gathered:
    """Every motor's usable captures, of the files `only` where that is given.

    Parameters
    ----------
    folder
        The input folder, as the user named it.
    source
        Name of the source map, `auto` to recognise it.
    motor
        A motor_id; None for all motors.
    limits
        Time [s] and memory [MB] that reading one file may take; None for the defaults.
    config_dir
        Folder of configuration files that come before those of the package.
    only
        Files to read, relative to the folder; None for all.

    Raises
    ------
    UsageError
        The folder is not there or holds no capture of `motor`.

    """
    input_folder(folder)
    sources = source_maps(source, config_dir)
    bounds = limits or ReadLimits()
    with local_workers(core_count()) as workers:
        ask = partial(survey_with, workers, Path(folder), sources, bounds, recover=False)
        of_files = _of_files(survey(Path(folder), sources, ask), only)
        tasks = _tasks(folder, of_files, motor, bounds)
        read = workers.all_of(usable_captures, tasks)
    findings = list(of_files.findings)
    motors = []
    for task, (captures, doubts) in zip(tasks, read, strict=True):
        findings += doubts
        if captures:
            motors.append(Campaign(task.motor_id, captures))
    return Gathered(tuple(motors), tuple(findings), of_files.note)


def _of_files(survey: Survey, only: Collection[str] | None) -> Survey:
    if only is None:
        return survey
    entries = tuple(entry for entry in survey.entries if entry.path in only)
    findings = tuple(finding for finding in survey.findings if finding.file in only)
    return Survey(entries, findings, ())


def _tasks(folder: str, survey: Survey, motor: str | None, limits: ReadLimits) -> list[ReadTask]:
    motors = survey.motors
    if motor is not None and motor not in motors:
        raise UsageError(f"no capture of motor {motor} in {folder}", meant(motor, motors))
    wanted = motors if motor is None else [motor]
    return [ReadTask(name, folder, motors[name], limits) for name in wanted]


def outcome_of(
    folder: str, gathered: Gathered, texts: Sequence[str], *, undecided: bool
) -> Outcome:
    """The text of each motor, the refusals, and the remedy where nothing is usable.

    Parameters
    ----------
    folder
        The input folder, as the user named it.
    gathered
        The captures of each motor, and the refusals.
    texts
        Text of each motor.
    undecided
        Whether too little data decided any motor.

    """
    refused = any(finding.severity == "refused" for finding in gathered.findings)
    lines = lines_of(gathered.findings)
    if not texts:
        lines.append(nothing_usable(folder, refused=refused))
    if gathered.note:
        lines.append(f"note: {gathered.note}")
    code = first_that_applies(3 if refused else 0, 4 if undecided else 0)
    faults = faults_of(gathered.findings)
    return Outcome(code, "\n".join(texts), tuple(lines), faults=faults)
