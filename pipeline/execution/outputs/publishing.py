"""The outputs of a whole batch: its findings, its page, its list of files, its outcome."""

from __future__ import annotations

import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path

from pipeline.execution.jobs import Files, MotorResult
from pipeline.execution.outputs.page_links import INDEX, links_of
from pipeline.execution.outputs.statuses import Statuses
from pipeline.io.ingest.survey import Survey
from pipeline.io.storage.datasheets import read_datasheet
from pipeline.io.storage.publish import canonical_json, partial_owner, write_whole
from pipeline.records.datasheet import Datasheet
from pipeline.records.finding import Finding, lines_of
from pipeline.records.naming import counted
from pipeline.records.outcome import Outcome, first_that_applies
from pipeline.report.text.console import nothing_usable, summary
from pipeline.settings import RunSettings
from pipeline.views.constants import KEY_CONSTANTS

MANIFEST = "outputs.json"
INPUT, OUTPUT = "\ue000", "\ue001"
"""Placeholders for the names of the folders; no file may have such a name."""
OF_BATCH = frozenset(KEY_CONSTANTS)
"""Constants that the page and the summary of the batch show."""
MOST_NAMED = 5
"""Most names of removed files in a note; datasheets come first."""
FOLDERS = ("datasheets", "report", "recordings", "performance", "sheet", "diagnosis", ".cache")


@dataclass(frozen=True, slots=True)
class Fleet:
    """The datasheets of a batch with what its page shows of each, and all constants as a table."""

    datasheets: tuple[Datasheet, ...]
    tables: Mapping[str, bytes]


def fleet_of(output: Path, results: Sequence[MotorResult]) -> Fleet:
    """The datasheets of a batch, read back from where they were written.

    Only what belongs to the batch is kept of each, or memory would grow with the batch.
    """
    from pipeline.views.tables import constants_frame, fleet_files

    names = [name for result in results for name, _ in result.finished.files]
    sheets, frames = [], []
    for name in (name for name in names if name.startswith("datasheets/")):
        sheet = read_datasheet(output / name)
        frames.append(constants_frame(sheet))
        sheets.append(_kept(sheet))
    return Fleet(tuple(sheets), fleet_files(frames) if frames else {})


def _kept(sheet: Datasheet) -> Datasheet:
    constants = {name: one for name, one in sheet.constants.items() if name in OF_BATCH}
    return replace(sheet, constants=constants, alternatives=(), captures=())


def publish(
    settings: RunSettings,
    results: Sequence[MotorResult],
    fleet: Fleet,
    findings: Sequence[Finding],
    statuses: Statuses,
) -> tuple[Files, tuple[str, ...]]:
    """Writes the outputs of the batch, then removes the outdated files of an earlier run.

    `statuses` are the current ones by motor.
    Returns every file of the batch, and the names of the removed files.
    """
    output = Path(settings.output)
    files: list[tuple[str, str]] = []

    def write(name: str, content: bytes) -> None:
        write_whole(output / name, content)
        files.append((name, hashlib.sha256(content).hexdigest()))

    document = {"schema": "findings/1", "findings": [f.document() for f in findings]}
    write("findings.json", canonical_json(document))
    files += [file for result in results for file in result.finished.files]
    for name, content in fleet.tables.items():
        write(name, content)
    if settings.report:
        from pipeline.report.pages.fleet_page import render_fleet

        links = links_of(output, INDEX, coming=fleet.tables)
        page = render_fleet(fleet.datasheets, tuple(findings), statuses, links)
        write(INDEX, page.encode())
    names = sorted(name for name, _ in files)
    removed = _sweep(output, names)
    write(MANIFEST, canonical_json({"schema": "outputs/1", "files": names}))
    return tuple(sorted(files)), removed


def _sweep(output: Path, files: Sequence[str]) -> tuple[str, ...]:
    """Removes the files that the last run listed and this one did not write, and partial files.

    Returns the names of the former.
    """
    removed = []
    for name in sorted(_listed(output / MANIFEST) - set(files)):
        stale = output / name
        if stale.resolve().is_relative_to(output.resolve()):
            with suppress(IsADirectoryError, NotADirectoryError, FileNotFoundError):
                stale.unlink()
                removed.append(name)
    for folder in FOLDERS:
        for partial in (output / folder).rglob(".*.partial"):
            if not _alive(partial_owner(partial)):
                partial.unlink(missing_ok=True)
    return tuple(removed)


def removed_note(removed: Sequence[str], output: str) -> tuple[str, ...]:
    """A line that counts and names the removed files of an earlier run."""
    if not removed:
        return ()
    names = ", ".join(removed[:MOST_NAMED]) + (", ..." if len(removed) > MOST_NAMED else "")
    return (
        f"note: {output} holds what comes of this input alone: "
        f"{counted(len(removed), 'file')} of an earlier run removed: {names}",
    )


def _listed(manifest: Path) -> set[str]:
    """The files that a manifest names; empty for a file that is no manifest."""
    try:
        files = json.loads(manifest.read_bytes())["files"]
    except (OSError, ValueError, LookupError, TypeError, RecursionError):
        return set()
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
    found: Survey,
    statuses: Statuses,
    *,
    report: bool,
) -> Outcome:
    """The text and exit code of the command; `with_folder_names` fills in the folders."""
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
    if found.note:
        lines = (*lines, f"note: {found.note}")
    text = summary(datasheets, findings, OUTPUT, report=report, folder=INPUT, statuses=statuses)
    return Outcome(code, text, lines)


def with_folder_names(outcome: Outcome, settings: RunSettings) -> Outcome:
    """The outcome with the names of the folders, which the cache does not hold."""

    def name(text: str) -> str:
        return text.replace(INPUT, settings.input).replace(OUTPUT, settings.output)

    return Outcome(outcome.exit_code, name(outcome.text), tuple(map(name, outcome.errors)))
