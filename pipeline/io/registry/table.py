"""The Delta table of the registry: events in, events out, one commit after another.

A blind append never conflicts in Delta, so two writers would both add the version they found
missing. Every commit here carries one application transaction, and Delta refuses a commit whose
transaction was advanced since the table was read: read, decide, write becomes one step, on a disk
as in an object store. The loser reads again and decides again.

Reference: Delta transaction protocol, "Transaction Identifiers"; Kung & Robinson, ACM TODS 6 (1981)
213 (optimistic concurrency).
"""

from __future__ import annotations

import json
import os
import random
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from pipeline.io.registry.exports import one_line
from pipeline.io.registry.stand_in import StandIn, unfit
from pipeline.io.storage.publish import sync_file, sync_folder
from pipeline.records.errors import MachineError, UsageError
from pipeline.records.ledger import Event
from pipeline.records.parse import whole

if TYPE_CHECKING:
    import polars as pl
    from deltalake import DeltaTable

# Delta keeps microseconds and signed 64-bit numbers; nothing else is offered to it.
COLUMNS: Mapping[str, tuple[str, bool]] = {
    "sequence": ("long", False),
    "recorded_at": ("timestamp", False),
    "kind": ("string", False),
    "motor_id": ("string", False),
    "version": ("string", False),
    "revision": ("long", False),
    "motor_type": ("string", True),
    "lot": ("string", True),
    "stations": ("strings", False),
    "status": ("string", True),
    "reasons": ("strings", False),
    "content_sha256": ("string", True),
    "by": ("string", True),
    "why": ("string", True),
    "chain": ("string", False),
    "content": ("string", True),
}
CONFIGURATION = {
    "delta.appendOnly": "true",
    # Time travel to every commit: expired logs would be cleaned away at a checkpoint.
    "delta.enableExpiredLogCleanup": "false",
    "delta.logRetentionDuration": "interval 36500 days",
}
APPLICATION = "registry"
# More small files than this are merged into one, which keeps a look at the registry fast; rows,
# old files and Delta's time travel stay.
MOST_FILES = 32
SMALL_BYTES = 16 << 20
PATIENCE_S = 120.0
LONGEST_PAUSE_S = 0.25

Row = tuple[Event, str | None]
Decide = Callable[[Sequence[Event]], Sequence[Row]]


# Schemes that deltalake has always known; what it makes of another is asked of it.
USUAL_SCHEMES = frozenset({"s3", "s3a", "gs", "gcs", "az", "azure", "abfs", "abfss", "file"})


class EventTable:
    """The registry's table at a folder or an object-store URL; opened anew for every call."""

    def __init__(self, place: str, options: Mapping[str, str] | None = None) -> None:
        self.place = place
        self.options = dict(options or {})
        self._stand_in: StandIn | None = None
        if self.folder is not None and unfit(self.folder):
            self._stand_in = StandIn(self.folder)
            if unfit(Path(self._stand_in.place)):
                raise UsageError(
                    f"registry {place!r}: Delta cannot work below a folder with such a name, nor "
                    "below that for temporary files",
                    "set TMPDIR to a folder with a plain name, or registry=null",
                )
        if self.folder is None and place.partition("://")[0] not in USUAL_SCHEMES:
            self._known_scheme()

    def _known_scheme(self) -> None:
        """Raises UsageError where deltalake keeps no tables at such an address."""
        from deltalake import DeltaTable
        from deltalake.exceptions import DeltaError

        try:
            DeltaTable(self.place, storage_options=self.options or None)
        except (DeltaError, OSError, ValueError) as error:
            reason = str(error).lower()
            if "scheme" not in reason and "recognise url" not in reason:
                return
            known = ", ".join(sorted(USUAL_SCHEMES))
            words = f"registry {self.place}: no registry can be at such an address"
            raise UsageError(words, f"a folder, or a URL of {known}") from error

    def events(self) -> list[Event] | None:
        """Every event in the order of commits; None where there is no table."""
        with self._failures():
            table = self._opened()
            return None if table is None else _events(table)

    def contents(self, sequences: Sequence[int], batch: int = 256) -> Iterator[tuple[int, str]]:
        """Texts of datasheets.

        Parameters
        ----------
        sequences
            Numbers of the rows.
        batch
            Rows that are read at a time.

        Yields
        ------
        tuple of int and str
            In the order of `sequences`; a row that is not there is left out.

        """
        with self._failures():
            table = self._opened()
            if table is None:
                return
            for start in range(0, len(sequences), batch):
                batch_of_sequences = sequences[start : start + batch]
                numbers = ", ".join(str(int(number)) for number in batch_of_sequences)
                rows = _rows(table, ("sequence", "content"), f"sequence IN ({numbers})")
                contents_by_row: dict[int, str] = dict(rows.iter_rows())
                yield from (
                    (number, contents_by_row[number])
                    for number in batch_of_sequences
                    if number in contents_by_row
                )

    def append(self, decide: Decide) -> tuple[list[Event], list[Event]]:
        """Adds the rows that a function makes of the events so far.

        Parameters
        ----------
        decide
            Called again with the newer events whenever another writer was faster.

        Returns
        -------
        tuple of list of Event
            Events before, and events added.

        Raises
        ------
        MachineError
            The table cannot be written; nothing was added then.

        """
        give_up = time.monotonic() + PATIENCE_S
        pauses = random.Random()  # noqa: S311 (only spreads the writers out; in no result)
        pause_s = 0.002
        with self._failures():
            table = self._opened() or self._created()
            while True:
                before = _events(table)
                rows = decide(before)
                if not rows:
                    return before, []
                self._open_to_writing()
                version = table.version()
                if self._committed(table, rows):
                    self._sync(table.version())
                    return before, [event for event, _ in rows]
                table = self._opened() or self._created()
                if table.version() == version or time.monotonic() > give_up:
                    raise MachineError(
                        f"registry {self.place}: the commit failed", "is it writable, and not full?"
                    )
                time.sleep(pauses.uniform(0.5, 1.0) * pause_s)
                pause_s = min(2.0 * pause_s, LONGEST_PAUSE_S)

    @property
    def folder(self) -> Path | None:
        """The folder on this machine's disk; None for an object store."""
        return None if "://" in self.place else Path(self.place)

    @property
    def _opened_at(self) -> str:
        """Where deltalake finds the table: there, or in the folder that stands in for it."""
        return self.place if self._stand_in is None else self._stand_in.place

    def missing_commits(self) -> list[int]:
        """Numbers of the commits that are missing from the log before the last one (disk only)."""
        present = self._commits()
        return sorted(set(range(max(present, default=0))) - present)

    def last_commit(self) -> int | None:
        """The number of the last commit; None where no log is to be seen on a disk."""
        return max(self._commits(), default=None)

    def _commits(self) -> set[int]:
        """Numbers of the commits whose log is on this machine's disk."""
        log = None if self.folder is None else self.folder / "_delta_log"
        if log is None or not log.is_dir():
            return set()
        return {n for path in log.glob("*.json") if (n := whole(path.stem)) is not None}

    def _opened(self) -> DeltaTable | None:
        from deltalake import DeltaTable
        from deltalake.exceptions import TableNotFoundError

        if self.folder is not None and not self.folder.is_dir():
            return None
        try:
            return DeltaTable(self._opened_at, storage_options=self.options or None)
        except TableNotFoundError:
            return None

    def _created(self) -> DeltaTable:
        """The new, empty table, or the one that another writer made meanwhile."""
        from deltalake import DeltaTable, Field, Schema
        from deltalake.exceptions import DeltaError
        from deltalake.schema import ArrayType, PrimitiveType

        strings = ArrayType(PrimitiveType("string"), contains_null=False)
        fields = [
            Field(name, strings if kind == "strings" else PrimitiveType(kind), nullable=nullable)
            for name, (kind, nullable) in COLUMNS.items()
        ]
        try:
            if self.folder is not None:
                self.folder.mkdir(parents=True, exist_ok=True)
            return DeltaTable.create(
                self._opened_at if self._stand_in is None else self._stand_in.create(),
                Schema(fields),
                mode="error",
                name="motor datasheets",
                description="every datasheet version ever published, and what was decided of it",
                configuration=CONFIGURATION,
                storage_options=self.options or None,
            )
        except DeltaError:
            table = self._opened()
            if table is None:
                raise
            return table

    def _open_to_writing(self) -> None:
        """Raises MachineError where nothing may be written: deltalake would panic over it."""
        if self.folder is None:
            return
        for folder in (self.folder, self.folder / "_delta_log"):
            if folder.is_dir() and not os.access(folder, os.W_OK | os.X_OK):
                message = f"registry {self.place}: {folder.name} cannot be written"
                raise MachineError(message, "is it open to you?")

    def _committed(self, table: DeltaTable, rows: Sequence[Row]) -> bool:
        """Whether the rows were added to exactly the events that `table` was opened with."""
        from deltalake import CommitProperties, Transaction, write_deltalake
        from deltalake.exceptions import DeltaError

        last = rows[-1][0].sequence
        properties = CommitProperties(app_transactions=[Transaction(APPLICATION, last)])
        try:
            if self._stand_in is None:
                write_deltalake(table, _frame(rows), mode="append", commit_properties=properties)
            else:
                self._stand_in.append(table, _frame(rows), properties)
        except DeltaError:
            return False
        return True

    def merge_small(self) -> None:
        """Merges small files where there are many; a writer that does so too may be faster.

        Raises
        ------
        MachineError
            The table cannot be read.

        """
        import polars as pl
        from deltalake.exceptions import DeltaError

        if self._stand_in is not None:
            return
        with self._failures():
            if (table := self._opened()) is None:
                return
            sizes = pl.DataFrame(table.get_add_actions(flatten=True))["size_bytes"].to_list()
            if sum(size < SMALL_BYTES for size in sizes) > MOST_FILES:
                with suppress(DeltaError):
                    table.optimize.compact(target_size=SMALL_BYTES)
                    self._sync(table.version())

    def _sync(self, version: int) -> None:
        """Waits until the disk has a commit and the files it added."""
        if self.folder is None:
            return
        log = self.folder / "_delta_log"
        commit = log / f"{version:020d}.json"
        for line in commit.read_text(encoding="utf-8").splitlines():
            if added := json.loads(line).get("add"):
                sync_file(self.folder / unquote(added["path"]))
        sync_file(commit)
        sync_folder(log)
        sync_folder(self.folder)

    @contextmanager
    def _failures(self) -> Iterator[None]:
        """Failures of the table and the disk as one line that names the registry."""
        from deltalake.exceptions import DeltaError

        try:
            yield
        except (DeltaError, OSError) as error:
            raise MachineError(
                f"registry {self.place}: {one_line(error)}", "is it whole, and open to you?"
            ) from error


def _rows(table: DeltaTable, columns: Sequence[str], where: str = "true") -> pl.DataFrame:
    import polars as pl
    from deltalake import QueryBuilder
    from deltalake.exceptions import DeltaError

    names = ", ".join(f'"{name}"' for name in columns)
    query = f'SELECT {names} FROM events WHERE {where} ORDER BY "sequence"'  # noqa: S608 (numbers)
    try:
        return pl.DataFrame(QueryBuilder().register("events", table).execute(query).read_all())
    except Exception as error:
        raise DeltaError(str(error)) from error


def _events(table: DeltaTable) -> list[Event]:
    frame = _rows(table, [name for name in COLUMNS if name != "content"])
    return [_event(row) for row in frame.iter_rows(named=True)]


def _event(row: Mapping[str, Any]) -> Event:
    lists = {name: tuple(row[name]) for name in ("stations", "reasons")}
    return Event(**{**row, **lists})


def _frame(rows: Sequence[Row]) -> pl.DataFrame:
    """Rows as Delta takes them, the kind of each column stated and never inferred."""
    import polars as pl

    kinds: dict[str, Any] = {
        "long": pl.Int64(),
        "timestamp": pl.Datetime("us", "UTC"),
        "string": pl.String(),
        "strings": pl.List(pl.String()),
    }
    schema = {name: kinds[kind] for name, (kind, _) in COLUMNS.items()}
    events = [
        [content if name == "content" else _plain(getattr(event, name)) for name in COLUMNS]
        for event, content in rows
    ]
    return pl.DataFrame(events, schema=schema, orient="row")


def _plain(value: Any) -> Any:
    return list(value) if isinstance(value, tuple) else value
