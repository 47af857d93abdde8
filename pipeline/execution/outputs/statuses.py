"""The current statuses of an output's motors by the registry, on the pages that show them.

A run updates the pages after it has registered its datasheets, `registry approve` and `revoke`
after a decision. The datasheets themselves never change.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path

from pipeline.execution.caches.run_cache import note_files
from pipeline.execution.jobs import MotorResult
from pipeline.execution.outputs.page_links import (
    DIAGNOSIS,
    INDEX,
    MOTOR,
    links_of,
    relink,
    rewritten,
)
from pipeline.execution.outputs.sheet_memory import SheetMemory
from pipeline.io.registry.store import Registry
from pipeline.io.storage.datasheets import read_datasheet
from pipeline.io.storage.publish import write_whole
from pipeline.records.current_status import CurrentStatus, current_status
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import PipelineError
from pipeline.records.finding import Finding
from pipeline.records.ledger import Version, histories
from pipeline.records.naming import file_stem
from pipeline.records.plain_form import record_of

Histories = Mapping[str, Sequence[Version]]
Statuses = Mapping[str, CurrentStatus]


def histories_of(registry: Registry | None) -> Histories:
    """The versions of each motor; empty without a registry, or where it cannot be read.

    Parameters
    ----------
    registry
        The registry; None for none.

    """
    if registry is None:
        return {}
    try:
        return histories(registry.events())
    except PipelineError:
        return {}


def status_now(output: Path, sheet: Datasheet, versions: Histories) -> CurrentStatus:
    """The current status of a datasheet of an output folder.

    Parameters
    ----------
    output
        The output folder of a run.
    sheet
        The datasheet.
    versions
        Versions of each motor, oldest first.

    """
    name = output / "datasheets" / f"{file_stem(sheet.motor_id)}.json"
    sha256 = hashlib.sha256(name.read_bytes()).hexdigest()
    return current_status(sheet, versions.get(sheet.motor_id, ()), sha256)


def with_current_statuses(
    output: Path, results: Sequence[MotorResult], versions: Histories, memory: SheetMemory
) -> tuple[list[MotorResult], Statuses]:
    """Rewrites the pages whose status is out of date.

    Parameters
    ----------
    output
        The output folder of a run.
    results
        What each motor came to.
    versions
        Versions of each motor, oldest first.
    memory
        Datasheets that were read before, and pages that are up to date.

    Returns
    -------
    tuple
        The results with the new digests, and the current status of each motor.

    """
    updated, statuses = [], {}
    for motor in results:
        files = dict(motor.finished.files)
        for name in [name for name in files if name.startswith("datasheets/")]:
            sheet = memory.sheet(output / name, files[name]).datasheet
            current = current_status(sheet, versions.get(sheet.motor_id, ()), files[name])
            statuses[sheet.motor_id] = current
            files |= _brought_up_to_date(output, sheet, current, files, memory)
        finished = replace(motor.finished, files=tuple(files.items()))
        updated.append(replace(motor, finished=finished))
    return updated, statuses


def _brought_up_to_date(
    output: Path,
    sheet: Datasheet,
    current: CurrentStatus,
    files: Mapping[str, str],
    memory: SheetMemory,
) -> dict[str, str]:
    """Name and digest of the motor's own pages that were rewritten, of those that are no longer
    what they were made of: the datasheet, its status, and the files that they link to.
    """
    stem, changed = file_stem(sheet.motor_id), dict[str, str]()
    shown = {
        kind.format(stem): (kind, links_of(output, kind, sheet.motor_id))
        for kind in (MOTOR, DIAGNOSIS)
        if kind.format(stem) in files
    }
    made_of = (files[f"datasheets/{stem}.json"], current)
    due = [
        kind
        for page, (kind, links) in shown.items()
        if not memory.shows(page, (files[page], made_of, links))
    ]
    if MOTOR in due:
        changed |= _rewritten(output, sheet, current)
    # pages of other commands are none of these files: it is not known when they change
    at_rest = [kind for kind, _ in shown.values() if kind not in due]
    relinked = relink(output, sheet.motor_id, but={MOTOR, *at_rest})
    changed |= {page: sha256 for page, sha256 in relinked.items() if page in files}
    for page, (_, links) in shown.items():
        memory.note(page, (changed.get(page, files[page]), made_of, links))
    return changed


def _rewritten(output: Path, sheet: Datasheet, current: CurrentStatus) -> dict[str, str]:
    """Name and digest of a motor's page that showed an outdated status and was rewritten.

    The run cache is updated too, as the page still belongs to the same work.
    """
    from pipeline.report.pages.page import with_links
    from pipeline.report.pages.status_block import with_status

    links = links_of(output, MOTOR, sheet.motor_id)
    changed = rewritten(
        output,
        MOTOR.format(file_stem(sheet.motor_id)),
        lambda before: with_links(with_status(before, sheet, current), links),
    )
    if changed:
        note_files(output, sheet.motor_id, tuple(changed.items()))
    return changed


def show_decision(registry: Registry, motor_id: str) -> tuple[str, ...]:
    """Rewrites the pages that show a motor in the output folder of a registry.

    Does nothing for a registry outside an output folder, or a motor that is not in the output.

    Parameters
    ----------
    registry
        The registry.
    motor_id
        The motor.

    Returns
    -------
    tuple
        Their names.

    Raises
    ------
    MachineError
        A page cannot be written.

    """
    output = None if "://" in registry.place else Path(registry.place).parent
    if output is None or not (output / "report").is_dir():
        return ()
    path = output / "datasheets" / f"{file_stem(motor_id)}.json"
    if not path.is_file():
        return ()
    versions = histories_of(registry)
    sheet = read_datasheet(path)
    pages = list(_rewritten(output, sheet, status_now(output, sheet, versions)))
    if (output / INDEX).is_file():
        pages += _index(output, versions)
    return tuple((output / page).as_posix() for page in pages)


def findings_of(output: Path) -> tuple[Finding, ...]:
    """The findings of the last run of an output folder; none where nothing was run.

    Parameters
    ----------
    output
        The output folder of a run.

    """
    try:
        documents = json.loads((output / "findings.json").read_bytes())["findings"]
    except FileNotFoundError:
        return ()
    return tuple(record_of(Finding, document) for document in documents)


def _index(output: Path, versions: Histories) -> Iterable[str]:
    from pipeline.report.pages.fleet_page import render_fleet

    paths = sorted((output / "datasheets").glob("*.json"))
    sheets = [replace(read_datasheet(path), alternatives=(), captures=()) for path in paths]
    statuses = {sheet.motor_id: status_now(output, sheet, versions) for sheet in sheets}
    links = links_of(output, INDEX)
    after = render_fleet(sheets, findings_of(output), statuses, links).encode()
    if after == (output / INDEX).read_bytes():
        return ()
    write_whole(output / INDEX, after)
    return (INDEX,)
