"""The registry: every datasheet version ever published, and what people decided of it.

A Delta table of events (`table`) that only grows, and a JSON file a version beside it
(`exports`). Nothing here reads a clock; whoever publishes or decides says when it is.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from datetime import datetime
from typing import Any, Literal

from pipeline.io.registry.exports import Exports, Key
from pipeline.io.registry.rows import (
    UNNUMBERED,
    Sheet,
    appended,
    publication_rows,
    sha256_of,
    sheet_of,
    utc,
)
from pipeline.io.registry.table import EventTable, Row
from pipeline.io.registry.verification import Verification, verify
from pipeline.io.storage.datasheets import datasheet_of
from pipeline.io.storage.identity import Identity
from pipeline.records.datasheet import Datasheet
from pipeline.records.errors import PipelineError, UsageError
from pipeline.records.ledger import (
    Event,
    Revocation,
    Selection,
    Version,
    histories,
    select,
)


@dataclass(frozen=True, slots=True)
class Receipt:
    """What became of the datasheets handed in: all are in the registry but the `conflicts`.

    A conflict is a version that is registered with other content, although equal inputs,
    configuration and code must give equal bytes; the registered content stays.
    """

    added: tuple[Event, ...]
    known: tuple[Event, ...]
    conflicts: tuple[Event, ...]


class Registry:
    """A registry in a folder or at an object-store URL; `options` are deltalake's for a URL."""

    def __init__(self, place: str, options: Mapping[str, str] | None = None) -> None:
        self.place = place
        self._table = EventTable(place, options)
        self._exports = Exports(place, options)
        self._settled_files: dict[Key, tuple[str, Identity]] = {}
        self._settled_at = -1

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
        sheets = {sheet.key: sheet for sheet in map(sheet_of, documents)}
        if not sheets:
            return Receipt((), (), ())
        prepared: set[Key] = set()

        def decide(events: Sequence[Event]) -> list[Row]:
            known = {event.key for event in events}
            new = [sheet for sheet in sheets.values() if sheet.key not in known]
            fresh = {sheet.key: sheet.content for sheet in new if sheet.key not in prepared}
            prepared.update(fresh)
            self._exports.prepare_all(fresh)
            return publication_rows(events, new, now)

        try:
            before, added = self._table.append(decide)
        except PipelineError:
            self._withdraw(prepared)
            raise
        receipt = self._settled(sheets, before, added)
        if added:
            self._table.merge_small()
        return receipt

    def unsettled(self, contents: Mapping[Key, str]) -> set[Key]:
        """The versions to publish: all but those that this object has published before.

        The table must hold as many commits as then, and the file of a version be the same file with
        the same times. So what somebody took away is published again.

        Parameters
        ----------
        contents
            Digest of each version's content.

        Returns
        -------
        set of Key
            All versions where the registry is no folder of this machine.

        """
        commit = self.last_commit()
        if commit is None or commit < self._settled_at:
            return set(contents)
        return {
            key
            for key, sha256 in contents.items()
            if self._settled_files.get(key) != (sha256, self._exports.identity(key))
        }

    def _withdraw(self, prepared: Iterable[Key]) -> None:
        """Takes away the pending files whose rows are certainly not in the table."""
        with suppress(PipelineError):
            known = {event.key for event in self._table.events() or ()}
            for key in set(prepared) - known:
                self._exports.discard(key)

    def _settled(
        self, sheets: Mapping[Key, Sheet], before: Sequence[Event], added: Sequence[Event]
    ) -> Receipt:
        registered = {e.key: e for e in reversed(before) if e.kind == "publish"}
        known, conflicts = [], []
        settled = {event.key for event in added}
        for key in sheets.keys() - settled:
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
        self._settled_at = -1 if (commit := self.last_commit()) is None else commit
        for key in settled:
            if (identity := self._exports.identity(key)) is not None:
                self._settled_files[key] = sheets[key].sha256, identity
        known.sort(key=lambda event: event.sequence)
        conflicts.sort(key=lambda event: event.sequence)
        return Receipt(tuple(added), tuple(known), tuple(conflicts))

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
            revision = version.revision
            event = Event(UNNUMBERED, utc(now), kind, *version.key, revision, by=by, why=why)
            return appended(events, [(event, None)])

        if self._table.events() is None:
            raise self._missing()
        _, added = self._table.append(append)
        self._table.merge_small()
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
            changed = [
                Event(UNNUMBERED, utc(now), kind, *key, revision, by=by, why=name)
                for key, revision in revisions.items()
                if (name in tags_of[key]) != (kind == "tag")
            ]
            return appended(events, [(event, None) for event in changed])

        if self._table.events() is None:
            raise self._missing()
        _, added = self._table.append(append)
        self._table.merge_small()
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
            (content := self._exports.read(key)) is not None and sha256_of(content) == sha256
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
        verification = verify(self._table, self._exports)
        if verification is None:
            raise self._missing()
        return verification

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
