"""The registry: every datasheet version ever published, and what people decided of it.

A Delta table of events (`table`) that only grows, and a JSON file a version beside it
(`exports`). Nothing here reads a clock; whoever publishes or decides says when it is.
"""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any, Literal

from pipeline.io.registry.exports import Exports, Key, place_of
from pipeline.io.registry.table import EventTable, Row
from pipeline.io.storage.datasheets import datasheet_of
from pipeline.io.storage.publish import canonical_json
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import PipelineError, UsageError
from pipeline.records.ledger import (
    START,
    Event,
    Revocation,
    Selection,
    Version,
    faults,
    histories,
    select,
)

DIGEST = re.compile("[0-9a-f]{64}")


@dataclass(frozen=True, slots=True)
class Receipt:
    """What became of the datasheets handed in: all are in the registry but the `conflicts`.

    A conflict is a version that is registered with other content, although equal inputs,
    configuration and code must give equal bytes; the registered content stays.
    """

    added: tuple[Event, ...]
    known: tuple[Event, ...]
    conflicts: tuple[Event, ...]


@dataclass(frozen=True, slots=True)
class Verification:
    """What `verify` found: `faults` are mismatches and gaps, `notes` traces of dead writers."""

    versions: int
    decisions: int
    faults: tuple[str, ...]
    notes: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class _Sheet:
    """A datasheet document on its way in."""

    document: Mapping[str, Any]
    content: bytes
    sha256: str

    @property
    def key(self) -> Key:
        return self.document["motor_id"], self.document["version"]


class Registry:
    """A registry in a folder or at an object-store URL; `options` are deltalake's for a URL."""

    def __init__(self, place: str, options: Mapping[str, str] | None = None) -> None:
        self.place = place
        self._table = EventTable(place, options)
        self._exports = Exports(place, options)

    def publish(self, documents: Iterable[Mapping[str, Any] | bytes], now: datetime) -> Receipt:
        """Registers datasheets in one commit, each version once.

        Parameters
        ----------
        documents
            Datasheets as documents, or as the bytes of the file that a run wrote.
        now
            Time of the commit, with its zone.

        Returns
        -------
        Receipt
            When it is returned, the disk has the rows and the files. Safe to repeat after any
            failure, and beside other writers.

        Raises
        ------
        MachineError
            The registry cannot be written.
        UsageError
            A document is no datasheet.

        """
        sheets = {sheet.key: sheet for sheet in map(_sheet, documents)}
        if not sheets:
            return Receipt((), (), ())
        prepared: set[Key] = set()

        def decide(events: Sequence[Event]) -> list[Row]:
            known = {event.key for event in events}
            new = [sheet for sheet in sheets.values() if sheet.key not in known]
            fresh = {sheet.key: sheet.content for sheet in new if sheet.key not in prepared}
            prepared.update(fresh)
            self._exports.prepare_all(fresh)
            return _rows(events, new, now)

        try:
            before, added = self._table.append(decide)
        except PipelineError:
            self._withdraw(prepared)
            raise
        return self._settled(sheets, before, added)

    def _withdraw(self, prepared: Iterable[Key]) -> None:
        """Takes away the pending files whose rows are certainly not in the table."""
        with suppress(PipelineError):
            known = {event.key for event in self._table.events() or ()}
            for key in set(prepared) - known:
                self._exports.discard(key)

    def _settled(
        self, sheets: Mapping[Key, _Sheet], before: Sequence[Event], added: Sequence[Event]
    ) -> Receipt:
        registered = {e.key: e for e in reversed(before) if e.kind == "publish"}
        known, conflicts = [], []
        settled = {event.key for event in added}
        for key in sheets.keys() - {event.key for event in added}:
            event = registered[key]
            if event.content_sha256 == sheets[key].sha256:
                settled.add(key)
                known.append(event)
            else:
                self._exports.discard(key)
                conflicts.append(event)
        self._exports.settle_all(
            {key: sheet.content for key, sheet in sheets.items() if key in settled}
        )
        order = sorted(known, key=lambda e: e.sequence), sorted(conflicts, key=lambda e: e.sequence)
        return Receipt(tuple(added), tuple(order[0]), tuple(order[1]))

    def decide(
        self,
        kind: Literal["approve", "revoke"],
        wanted: Selection,
        by: str,
        why: str,
        now: datetime,
    ) -> tuple[Version, bool]:
        """Appends a decision of a person on one version.

        Parameters
        ----------
        kind
            `approve` or `revoke`.
        wanted
            Selects exactly one version.
        by
            The person.
        why
            The reason.
        now
            Time of the commit, with its zone.

        Returns
        -------
        tuple of Version and bool
            The version with the decision, and whether it is new: repeating the last decision adds
            nothing.

        Raises
        ------
        UsageError
            Not exactly one version is selected, the version is refused, or more than the approval
            is missing.

        """
        versions: list[Version] = []

        def append(events: Sequence[Event]) -> list[Row]:
            version = one_of(select(events, wanted), wanted, self.place)
            _allowed(kind, version)
            versions[:] = [version]
            last = version.decisions[-1] if version.decisions else None
            if last is not None and (last.kind, last.by, last.why) == (kind, by, why):
                return []
            number, chain = (events[-1].sequence, events[-1].chain) if events else (0, START)
            revision = version.revision
            event = Event(number + 1, _utc(now), kind, *version.key, revision, by=by, why=why)
            return [(event.linked(chain), None)]

        if self._table.events() is None:
            raise self._missing()
        _, added = self._table.append(append)
        decided = versions[0]
        return replace(decided, decisions=(*decided.decisions, *added)), bool(added)

    def tag(
        self,
        kind: Literal["tag", "untag"],
        versions: Sequence[Version],
        name: str,
        by: str,
        now: datetime,
    ) -> int:
        """Gives versions a name, or takes it from them, in one commit.

        Parameters
        ----------
        kind
            `tag` or `untag`.
        versions
            The versions.
        name
            The name.
        by
            The person.
        now
            Time of the commit, with its zone.

        Returns
        -------
        int
            How many versions were changed.

        """
        revisions = {version.key: version.revision for version in versions}

        def append(events: Sequence[Event]) -> list[Row]:
            tags_of = {v.key: v.tags for history in histories(events).values() for v in history}
            number, chain = (events[-1].sequence, events[-1].chain) if events else (0, START)
            rows: list[Row] = []
            for key, revision in revisions.items():
                if (name in tags_of[key]) == (kind == "tag"):
                    continue
                number += 1
                event = Event(number, _utc(now), kind, *key, revision, by=by, why=name)
                event = event.linked(chain)
                chain = event.chain
                rows.append((event, None))
            return rows

        if self._table.events() is None:
            raise self._missing()
        _, added = self._table.append(append)
        return len(added)

    def events(self) -> list[Event]:
        """Every event in the order of commits; raises UsageError where there is no registry."""
        events = self._table.events()
        if events is None:
            raise self._missing()
        return events

    def history(self, motor_id: str, until: datetime | None = None) -> tuple[Version, ...]:
        """The versions of a motor, oldest first, as they stood at a moment.

        Parameters
        ----------
        motor_id
            The motor.
        until
            The moment; None for now.

        Returns
        -------
        tuple of Version
            Empty for an unknown motor.

        """
        return histories(self.events(), until).get(motor_id, ())

    def revocations(self) -> Mapping[str, tuple[Revocation, ...]]:
        """The versions that are revoked now, by motor; none where there is no registry yet."""
        motors = histories(self._table.events() or ())
        by_motor = {m: tuple(r for v in past if (r := v.revocation)) for m, past in motors.items()}
        return {motor_id: revoked for motor_id, revoked in by_motor.items() if revoked}

    def last_commit(self) -> int | None:
        """The number of the table's last commit; None where it is not to be seen on a disk."""
        return self._table.last_commit()

    def has_files(self, contents: Iterable[tuple[Key, str]]) -> bool:
        """Whether every version has its file.

        Parameters
        ----------
        contents
            Motor, version and digest of each.

        Returns
        -------
        bool
            A file gets its name when its row is safe; of a disk only.

        """
        return self._table_is_there() and all(
            (content := self._exports.read(key)) is not None and _digest(content) == sha256
            for key, sha256 in contents
        )

    def _table_is_there(self) -> bool:
        folder = self._table.folder
        return folder is not None and (folder / "_delta_log").is_dir()

    def select(self, wanted: Selection) -> tuple[Version, ...]:
        """Every version that is selected, by motor and revision; `newest` keeps one a motor.

        Parameters
        ----------
        wanted
            Which versions are meant.

        """
        return select(self.events(), wanted)

    def documents(self, versions: Sequence[Version]) -> list[dict[str, Any]]:
        """The datasheet documents of versions, as they were published.

        Parameters
        ----------
        versions
            The versions; the order is kept.

        """
        texts = dict(self._table.contents([v.published.sequence for v in versions]))
        return [json.loads(texts[v.published.sequence]) for v in versions]

    def datasheets(self, versions: Sequence[Version]) -> list[Datasheet]:
        """The datasheets of versions.

        Parameters
        ----------
        versions
            The versions; the order is kept.

        """
        return [datasheet_of(document) for document in self.documents(versions)]

    def verify(self) -> Verification:
        """Compares rows with their chain, contents with digests, and files with rows.

        Returns
        -------
        Verification
            A file of an interrupted writer whose row was committed is given its name, and noted.

        Raises
        ------
        UsageError
            There is no registry.

        """
        gaps = [f"commit {n} is missing from the log" for n in self._table.missing_commits()]
        try:
            events = self.events()
            published = [event for event in events if event.kind == "publish"]
            faults_found = [*gaps, *faults(events), *self._content_faults(published)]
        except UsageError:
            raise
        except PipelineError as error:
            return Verification(0, 0, (*gaps, error.message), ())
        file_faults, notes = self._file_faults(published)
        unique = len({event.key for event in published})
        decisions = len(events) - len(published)
        return Verification(unique, decisions, (*faults_found, *file_faults), tuple(notes))

    def _content_faults(self, published: Sequence[Event]) -> Iterable[str]:
        rows = {event.sequence: event for event in published}
        unread = set(rows)
        for number, text in self._table.contents(list(rows)):
            unread.discard(number)
            event = rows[number]
            if _digest(text.encode()) != event.content_sha256:
                yield f"row {number} ({event.motor_id!r}): its datasheet is not what was published"
            elif not _agrees(event, text):
                yield f"row {number} ({event.motor_id!r}): says other than its datasheet"
        yield from (f"row {number}: its datasheet is missing" for number in sorted(unread))

    def _file_faults(self, published: Sequence[Event]) -> tuple[list[str], list[str]]:
        sentences, notes = [], []
        for event in {e.key: e for e in reversed(published)}.values():
            place, sha256 = place_of(event.key), event.content_sha256 or ""
            content = self._exports.read(event.key)
            if content is None and self._exports.finish(event.key, sha256):
                notes.append(f"{place}: finished what an interrupted writer had left pending")
            elif content is None:
                sentences.append(f"{place}: the file is missing; publishing the version writes it")
            elif _digest(content) != sha256:
                sentences.append(f"{place}: the file is not what was published")
        if pending := self._exports.pending():
            notes.append(f"{pending} pending files of writers that were interrupted or still write")
        rows = {place_of(event.key) for event in published}
        unlisted = (name for name in self._exports.names() if name not in rows)
        sentences += [f"{name}: the file has no row; the table lost it" for name in unlisted]
        return sorted(sentences), sorted(notes)

    def _missing(self) -> UsageError:
        return UsageError(f"no registry at {self.place}", "name the one of a run by registry=")


def one_of(versions: Sequence[Version], wanted: Selection, place: str) -> Version:
    """The only version that is meant.

    Parameters
    ----------
    versions
        Versions that were selected.
    wanted
        How they were selected, for the message.
    place
        The registry, for the message.

    Raises
    ------
    UsageError
        There is none, or there are several.

    """
    if len(versions) == 1:
        return versions[0]
    name = f"motor {wanted.motor_id!r}"
    if wanted.revision is not None:
        name += f" revision {wanted.revision}"
    if wanted.version is not None:
        name += f" version {wanted.version}"
    if not versions:
        raise UsageError(f"no {name} in {place}", "`registry list` shows what there is")
    numbers = ", ".join(str(version.revision) for version in versions)
    raise UsageError(f"{name} is revisions {numbers}", "name one by revision=")


def _allowed(kind: str, version: Version) -> None:
    if kind == "revoke":
        return
    name = f"motor {version.motor_id!r} revision {version.revision}"
    reasons = "; ".join(version.open_points)
    if version.published.status == "refused":
        raise UsageError(f"{name} is refused: {reasons}", "no decision changes that; record anew")
    if version.open_points:
        raise UsageError(f"{name} is not ready for approval: {reasons}", "complete it first")


def _sheet(given: Mapping[str, Any] | bytes) -> _Sheet:
    """The document with its bytes; raises UsageError where it is no datasheet."""
    try:
        document = json.loads(given) if isinstance(given, bytes) else given
        motor_id, version = document["motor_id"], document["version"]
        _event_fields(document)
    except (LookupError, TypeError, ValueError) as error:
        raise UsageError(f"no datasheet: {error!r}", "publish what `run` wrote") from error
    if not isinstance(motor_id, str) or not DIGEST.fullmatch(str(version)):
        raise UsageError(f"motor {motor_id!r}: version {version!r} is no sha256", "run again")
    try:
        content = given if isinstance(given, bytes) else canonical_json(document)
    except UnicodeEncodeError as error:
        raise UsageError(f"motor {motor_id!r}: its text is not Unicode", "rename it") from error
    return _Sheet(document, content, _digest(content))


def _rows(events: Sequence[Event], new: Sequence[_Sheet], now: datetime) -> list[Row]:
    """The rows of new versions after the events so far: numbered, counted and chained."""
    number, chain = (events[-1].sequence, events[-1].chain) if events else (0, START)
    revisions: dict[str, int] = {}
    for event in events:
        if event.kind == "publish":
            revisions[event.motor_id] = revisions.get(event.motor_id, 0) + 1
    rows: list[Row] = []
    for sheet in new:
        number += 1
        motor_id, version = sheet.key
        revisions[motor_id] = revisions.get(motor_id, 0) + 1
        event = Event(
            number,
            _utc(now),
            "publish",
            motor_id,
            version,
            revisions[motor_id],
            content_sha256=sheet.sha256,
            **_event_fields(sheet.document),
        ).linked(chain)
        chain = event.chain
        rows.append((event, sheet.content.decode()))
    return rows


def _event_fields(document: Mapping[str, Any]) -> dict[str, Any]:
    """What a row repeats of its datasheet, so that a search needs not read it."""
    captures = document["provenance"]["captures"]
    stations = {capture.get("station") for capture in captures} - {None}
    return {
        "motor_type": document["motor_type"],
        "lot": document["lot"],
        "stations": tuple(sorted(stations)),
        "status": document["status"],
        "reasons": tuple(document.get("why", ())),
    }


def _agrees(event: Event, text: str) -> bool:
    """Whether a row says what its datasheet says."""
    try:
        document = json.loads(text)
        expected = {
            "motor_id": document["motor_id"],
            "version": document["version"],
            **_event_fields(document),
        }
    except (ValueError, LookupError, TypeError):
        return False
    return all(getattr(event, name) == value for name, value in expected.items())


def _utc(moment: datetime) -> datetime:
    """The moment in UTC, which is what the table keeps; raises ValueError for one without zone."""
    if moment.tzinfo is None:
        raise ValueError("a moment without time zone")
    return moment.astimezone(UTC)


def _digest(content: bytes) -> str:
    return hashlib.sha256(content).hexdigest()
