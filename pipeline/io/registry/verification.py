"""Whether the registry's rows, the datasheets in them and the files beside them agree."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from pipeline.io.registry.exports import Exports, place_of
from pipeline.io.registry.rows import agrees, sha256_of
from pipeline.io.registry.table import EventTable
from pipeline.records.errors import PipelineError, UsageError
from pipeline.records.ledger import Event, faults


@dataclass(frozen=True, slots=True)
class Verification:
    """What `verify` found: `faults` are mismatches and gaps, `notes` traces of dead writers."""

    versions: int
    decisions: int
    faults: tuple[str, ...]
    notes: tuple[str, ...]


def verify(table: EventTable, exports: Exports) -> Verification | None:
    """Compares rows with their chain, contents with digests, and files with rows.

    Parameters
    ----------
    table
        The rows and their contents.
    exports
        The files; one of an interrupted writer whose row was committed is given its name.

    Returns
    -------
    Verification or None
        None where there is no registry.

    Raises
    ------
    UsageError
        The table cannot be reached as it is named.

    """
    gaps = [f"commit {n} is missing from the log" for n in table.missing_commits()]
    try:
        events = table.events()
        if events is None:
            return None
        published = [event for event in events if event.kind == "publish"]
        row_faults = [*gaps, *faults(events), *_content_faults(table, published)]
    except UsageError:
        raise
    except PipelineError as error:
        return Verification(0, 0, (*gaps, error.message), ())
    file_faults, notes = _file_faults(exports, published)
    versions = len({event.key for event in published})
    decisions = len(events) - len(published)
    return Verification(versions, decisions, (*row_faults, *file_faults), tuple(notes))


def _content_faults(table: EventTable, published: Sequence[Event]) -> Iterable[str]:
    rows = {event.sequence: event for event in published}
    unread = set(rows)
    for number, text in table.contents(list(rows)):
        unread.discard(number)
        event = rows[number]
        if sha256_of(text.encode()) != event.content_sha256:
            yield f"row {number} ({event.motor_id!r}): its datasheet is not what was published"
        elif not agrees(event, text):
            yield f"row {number} ({event.motor_id!r}): says other than its datasheet"
    yield from (f"row {number}: its datasheet is missing" for number in sorted(unread))


def _file_faults(exports: Exports, published: Sequence[Event]) -> tuple[list[str], list[str]]:
    """Faults of the files, and notes of interrupted writers."""
    faults_of_files, notes = [], []
    for event in {e.key: e for e in reversed(published)}.values():
        place, sha256 = place_of(event.key), event.content_sha256 or ""
        content = exports.read(event.key)
        if content is None and exports.finish(event.key, sha256):
            notes.append(f"{place}: finished what an interrupted writer had left pending")
        elif content is None:
            faults_of_files.append(
                f"{place}: the file is missing; publishing the version writes it"
            )
        elif sha256_of(content) != sha256:
            faults_of_files.append(f"{place}: the file is not what was published")
    if pending := exports.pending():
        notes.append(f"{pending} pending files of writers that were interrupted or still write")
    rows = {place_of(event.key) for event in published}
    unlisted = (name for name in exports.names() if name not in rows)
    faults_of_files += [f"{name}: the file has no row; the table lost it" for name in unlisted]
    return sorted(faults_of_files), sorted(notes)
