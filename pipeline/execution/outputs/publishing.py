"""The outputs of a whole batch: its findings, its page, its list of files, its outcome."""

from __future__ import annotations

import hashlib
import json
import os
import shlex
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from pipeline.execution.jobs import Files, MotorResult
from pipeline.execution.outputs.page_links import INDEX, links_of
from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.execution.outputs.statuses import Statuses
from pipeline.io.ingest.survey import Survey
from pipeline.io.storage.publish import canonical_json, partial_owner, write_whole
from pipeline.records.datasheet import Datasheet
from pipeline.records.finding import Finding, lines_of
from pipeline.records.naming import counted, printable
from pipeline.records.outcome import Outcome, first_that_applies
from pipeline.report.text.console import nothing_usable, summary
from pipeline.report.text.next_command import next_command
from pipeline.settings import RunSettings

MANIFEST = "outputs.json"
INPUT, OUTPUT = "\ue000", "\ue001"
"""Placeholders for the names of the folders; no file may have such a name."""
MOST_NAMED = 5
"""Most names of removed files in a note; datasheets come first."""
FOLDERS = ("datasheets", "report", "recordings", "performance", "sheet", "diagnosis", ".cache")
Others = Mapping[str, tuple[str, ...]]
"""Files of the motors of earlier runs that an output holds beside the batch, by motor."""


@dataclass(frozen=True, slots=True)
class Fleet:
    """The datasheets of a batch with what its page shows of each, those of other motors that the
    output holds, and all constants as a table.
    """

    datasheets: tuple[Datasheet, ...]
    others: tuple[Datasheet, ...]
    tables: Mapping[str, bytes]

    @property
    def every(self) -> tuple[Datasheet, ...]:
        """All datasheets of the output, by motor."""
        return tuple(sorted((*self.datasheets, *self.others), key=lambda one: one.motor_id))


def other_motors(output: Path, batch: Collection[str], *, prune: bool) -> Others:
    """The motors of earlier runs that stay in an output: none with `prune`.

    Parameters
    ----------
    output
        The output folder of a run.
    batch
        The motors of this run.
    prune
        Whether motors of earlier runs are removed.

    """
    listed = {} if prune else _manifest(output).get("motors")
    others = {}
    for motor_id, names in listed.items() if isinstance(listed, dict) else ():
        there = isinstance(names, list) and all(isinstance(name, str) for name in names)
        if motor_id in batch or not there:
            continue
        files = tuple(name for name in names if _inside(output, name).is_file())
        if any(name.startswith("datasheets/") for name in files):
            others[motor_id] = files
    return others


def fleet_of(
    output: Path, results: Sequence[MotorResult], others: Others, memory: SheetMemory
) -> Fleet:
    """The datasheets of an output, read back from where they were written.

    Parameters
    ----------
    output
        The output folder of a run.
    results
        What each motor came to.
    others
        Motors of earlier runs that stay in the output.
    memory
        Datasheets that were read before.

    """
    from pipeline.views.tables import fleet_files

    own: dict[str, str | None] = {n: s for motor in results for n, s in motor.finished.files}
    rest: dict[str, str | None] = dict.fromkeys(name for f in others.values() for name in f)
    batch, further = (
        [
            memory.sheet(output / name, sha256)
            for name, sha256 in files.items()
            if name.startswith("datasheets/")
        ]
        for files in (own, rest)
    )
    frames = {sheet.datasheet.motor_id: sheet.constants for sheet in (*batch, *further)}
    tables = fleet_files([frame for _, frame in sorted(frames.items())]) if frames else {}
    return Fleet(
        tuple(sheet.datasheet for sheet in batch),
        tuple(sheet.datasheet for sheet in further),
        tables,
    )


def publish(
    settings: RunSettings,
    results: Sequence[MotorResult],
    fleet: Fleet,
    findings: Sequence[Finding],
    statuses: Statuses,
    others: Others,
) -> tuple[Files, tuple[str, ...]]:
    """Writes the outputs of the batch, then removes the outdated files of an earlier run.

    Parameters
    ----------
    settings
        The keys of `run`.
    results
        What each motor came to.
    fleet
        What the fleet's outputs need of each datasheet.
    findings
        What was refused or is doubtful.
    statuses
        Current status of each motor.
    others
        Motors of earlier runs that stay in the output.

    Returns
    -------
    tuple
        Every file of the batch, and the names of the removed files.

    """
    output = Path(settings.output)
    files: list[tuple[str, str]] = []

    def write(name: str, content: bytes) -> None:
        write_whole(output / name, content)
        files.append((name, hashlib.sha256(content).hexdigest()))

    document = {"schema": "findings/1", "findings": [f.document() for f in findings]}
    write("findings.json", canonical_json(document))
    files += [file for motor in results for file in motor.finished.files]
    for name, content in fleet.tables.items():
        write(name, content)
    if settings.report:
        from pipeline.report.pages.fleet_page import render_fleet

        links = links_of(output, INDEX, coming=fleet.tables)
        page = render_fleet(fleet.every, tuple(findings), statuses, links)
        write(INDEX, page.encode())
    motors = dict(others)
    for motor in results:
        motors[motor.motor_id] = tuple(sorted(name for name, _ in motor.finished.files))
    kept = (name for names in others.values() for name in names)
    names = sorted({*(name for name, _ in files), *kept})
    removed = _sweep(output, names)
    listed = {"schema": "outputs/1", "files": names, "motors": motors}
    write(MANIFEST, canonical_json(listed))
    return tuple(sorted(files)), removed


def _sweep(output: Path, files: Sequence[str]) -> tuple[str, ...]:
    """Removes the files that the last run listed and this one did not write, and partial files.

    Returns the names of the former.
    """
    removed = []
    for name in sorted(_listed(output) - set(files)):
        stale = _inside(output, name)
        if stale != output:
            with suppress(IsADirectoryError, NotADirectoryError, FileNotFoundError):
                stale.unlink()
                removed.append(name)
    for folder in FOLDERS:
        for partial in (output / folder).rglob(".*.partial"):
            if not _alive(partial_owner(partial)):
                partial.unlink(missing_ok=True)
    return tuple(removed)


def removed_note(removed: Sequence[str], output: str) -> tuple[str, ...]:
    """A line that counts and names the removed files of an earlier run.

    Parameters
    ----------
    removed
        Names of the removed files.
    output
        The output folder, as the user named it.

    """
    if not removed:
        return ()
    names = ", ".join(removed[:MOST_NAMED]) + (", ..." if len(removed) > MOST_NAMED else "")
    return (f"note: {output}: {counted(len(removed), 'file')} of an earlier run removed: {names}",)


def others_note(others: Others, output: str) -> tuple[str, ...]:
    """A line that counts and names the motors of earlier runs that the output still holds.

    Parameters
    ----------
    others
        Motors of earlier runs that stay in the output.
    output
        The output folder, as the user named it.

    """
    if not others:
        return ()
    names = ", ".join([printable(one) for one in sorted(others)][:MOST_NAMED])
    more = ", ..." if len(others) > MOST_NAMED else ""
    return (
        f"note: {output} keeps {counted(len(others), 'motor')} of earlier runs: {names}{more}; "
        "`run prune=true` removes what is not of this input",
    )


def _inside(output: Path, name: str) -> Path:
    """The file of a manifest's name; the output itself for one that is elsewhere."""
    path = output / name
    return path if path.resolve().is_relative_to(output.resolve()) else output


def _manifest(output: Path) -> dict[str, Any]:
    """The list of an earlier run; empty where there is none that can be read."""
    try:
        manifest = json.loads((output / MANIFEST).read_bytes())
    except (OSError, ValueError, RecursionError):
        return {}
    return manifest if isinstance(manifest, dict) else {}


def _listed(output: Path) -> set[str]:
    """The files that the manifest of an output names."""
    files = _manifest(output).get("files")
    return {name for name in files if isinstance(name, str)} if isinstance(files, list) else set()


def _alive(process: int | None) -> bool:
    """Whether a process that may still be writing runs on this machine."""
    if process is None or process == os.getpid():
        return False
    try:
        os.kill(process, 0)
    except ProcessLookupError:
        return False
    except OSError:
        return True
    return True


def outcome_of(
    datasheets: Sequence[Datasheet],
    findings: Sequence[Finding],
    survey: Survey,
    statuses: Statuses,
    *,
    report: bool,
) -> Outcome:
    """The text and exit code of the command; `with_folder_names` fills in the folders.

    Parameters
    ----------
    datasheets
        The datasheets of the batch.
    findings
        What was refused or is doubtful.
    survey
        What the input folder holds.
    statuses
        Current status of each motor.
    report
        Whether pages are written.

    """
    outcomes = [{check.status for check in sheet.checks} for sheet in datasheets]
    refused = any(finding.severity == "refused" for finding in findings)
    code = first_that_applies(
        1 if any("fail" in checked for checked in outcomes) else 0,
        3 if refused else 0,
        4 if not datasheets or any(checked == {"not_evaluated"} for checked in outcomes) else 0,
    )
    lines = tuple(lines_of(findings))
    if not datasheets:
        lines = (*lines, nothing_usable(INPUT, refused=refused))
    if survey.note:
        lines = (*lines, f"note: {survey.note}")
    text = summary(datasheets, findings, OUTPUT, report=report, statuses=statuses)
    return Outcome(code, text, lines, next=next_command(datasheets, INPUT, OUTPUT, statuses))


def with_folder_names(outcome: Outcome, settings: RunSettings) -> Outcome:
    """The outcome with the names of the folders, which the cache does not hold.

    In a command a name stands quoted where a shell asks for it.

    Parameters
    ----------
    outcome
        The outcome.
    settings
        The keys of `run`.

    """

    def name(text: str) -> str:
        for placeholder, folder in ((INPUT, settings.input), (OUTPUT, settings.output)):
            text = text.replace(shlex.quote(placeholder), shlex.quote(folder))
            text = text.replace(placeholder, folder)
        return text

    return replace(
        outcome,
        text=name(outcome.text),
        errors=tuple(map(name, outcome.errors)),
        next=name(outcome.next),
    )
