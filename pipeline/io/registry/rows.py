"""Rows of the registry's table: their number and chain, and what they repeat of a datasheet."""

from __future__ import annotations

import hashlib
import json
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from typing import Any

from pipeline.io.registry.exports import Key
from pipeline.io.registry.table import Row
from pipeline.io.storage.publish import canonical_json
from pipeline.records.errors import UsageError
from pipeline.records.ledger import (
    START,
    Event,
)

DIGEST = re.compile("[0-9a-f]{64}")
UNNUMBERED = 0
"""Number of an event until `appended` gives it its own."""


@dataclass(frozen=True, slots=True)
class Sheet:
    """A datasheet that is to be registered: document, bytes of its file, and their digest."""

    document: Mapping[str, Any]
    content: bytes
    sha256: str

    @property
    def key(self) -> Key:
        """Motor and version."""
        return self.document["motor_id"], self.document["version"]


def sheet_of(given: Mapping[str, Any] | bytes) -> Sheet:
    """A datasheet with its bytes.

    Parameters
    ----------
    given
        The document, or the bytes of its file.

    Raises
    ------
    UsageError
        It is no datasheet.

    """
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
    return Sheet(document, content, sha256_of(content))


def appended(events: Sequence[Event], new: Iterable[Row]) -> list[Row]:
    """New rows, numbered and chained after the events so far.

    Parameters
    ----------
    events
        Every event of the table, in order.
    new
        Events whose number and chain are still to be given, with their content.

    """
    number, chain = (events[-1].sequence, events[-1].chain) if events else (0, START)
    rows: list[Row] = []
    for event, content in new:
        number += 1
        linked = replace(event, sequence=number).linked(chain)
        chain = linked.chain
        rows.append((linked, content))
    return rows


def publication_rows(events: Sequence[Event], new: Sequence[Sheet], now: datetime) -> list[Row]:
    """The rows of new versions, which also count the revisions of their motors.

    Parameters
    ----------
    events
        Every event of the table, in order.
    new
        The datasheets.
    now
        Time of the commit, with its zone.

    """
    revisions = Counter(event.motor_id for event in events if event.kind == "publish")
    rows: list[Row] = []
    for sheet in new:
        motor_id, version = sheet.key
        revisions[motor_id] += 1
        event = Event(
            UNNUMBERED,
            utc(now),
            "publish",
            motor_id,
            version,
            revisions[motor_id],
            content_sha256=sheet.sha256,
            **_event_fields(sheet.document),
        )
        rows.append((event, sheet.content.decode()))
    return appended(events, rows)


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


def agrees(event: Event, text: str) -> bool:
    """Whether a row says what its datasheet says.

    Parameters
    ----------
    event
        The row.
    text
        Its datasheet.

    """
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


def utc(moment: datetime) -> datetime:
    """The moment in UTC, which is what the table keeps.

    Parameters
    ----------
    moment
        With its zone.

    Raises
    ------
    ValueError
        It has no zone.

    """
    if moment.tzinfo is None:
        raise ValueError("a moment without time zone")
    return moment.astimezone(UTC)


def sha256_of(content: bytes) -> str:
    """Digest of a datasheet's bytes.

    Parameters
    ----------
    content
        The bytes.

    """
    return hashlib.sha256(content).hexdigest()
