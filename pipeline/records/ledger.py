"""The events of the registry, and what follows from them: revisions, statuses, what was valid when.

The registry is a list of events that only grows. A datasheet version enters it by `publish` and
is never changed; `approve` and `revoke` say what people decided of it, and why; `tag` and `untag`
give it a name that many versions may share.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from datetime import datetime
from typing import Literal

from pipeline.records.datasheet import DatasheetStatus, left_to_a_person

EventKind = Literal["publish", "approve", "revoke", "tag", "untag"]
Standing = Literal["released", "provisional", "refused", "revoked"]
START = "0" * 64


@dataclass(frozen=True, slots=True)
class Event:
    """One row of the registry, in the order of commits.

    Attributes
    ----------
    sequence
        1, 2, ... over all rows.
    recorded_at
        Time of the commit, UTC.
    kind
        `publish`, `approve`, `revoke`, `tag` or `untag`.
    motor_id, version
        The datasheet that it concerns.
    revision
        Counts the versions of one motor from 1.
    motor_type, lot, stations, status, reasons, content_sha256
        Of the datasheet; for `publish` alone.
    by, why
        Who decided, and why; the `why` of a tag is its name.
    chain
        sha256 of this row and of the `chain` before it, so that no row can be changed, removed or
        inserted without notice.

    """

    sequence: int
    recorded_at: datetime
    kind: EventKind
    motor_id: str
    version: str
    revision: int
    motor_type: str | None = None
    lot: str | None = None
    stations: tuple[str, ...] = ()
    status: DatasheetStatus | None = None
    reasons: tuple[str, ...] = ()
    content_sha256: str | None = None
    by: str | None = None
    why: str | None = None
    chain: str = ""

    @property
    def key(self) -> tuple[str, str]:
        """What a version is known by: motor and version."""
        return self.motor_id, self.version

    def linked(self, before: str) -> Event:
        """This event with its chain.

        Parameters
        ----------
        before
            The chain of the row before it; `START` for the first row.

        """
        return replace(self, chain=_link(self, before))


def _link(event: Event, before: str) -> str:
    content = {f.name: getattr(event, f.name) for f in fields(event) if f.name != "chain"}
    content["recorded_at"] = event.recorded_at.isoformat(timespec="microseconds")
    text = json.dumps([before, content], sort_keys=True, allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


@dataclass(frozen=True, slots=True)
class Revocation:
    """A version that was revoked: its digest, that of its content, by whom and why."""

    version: str
    content_sha256: str
    by: str
    why: str


@dataclass(frozen=True, slots=True)
class Version:
    """One version of a motor's datasheet, and what was decided of it.

    Attributes
    ----------
    published
        The row that entered it.
    decisions
        Approvals and revocations, oldest first.
    tags
        Names that it bears.

    """

    published: Event
    decisions: tuple[Event, ...] = ()
    tags: frozenset[str] = frozenset()

    @property
    def key(self) -> tuple[str, str]:
        """What it is known by: motor and version."""
        return self.published.key

    @property
    def motor_id(self) -> str:
        """The motor's serial number."""
        return self.published.motor_id

    @property
    def version(self) -> str:
        """Digest of inputs, configuration and code."""
        return self.published.version

    @property
    def revision(self) -> int:
        """1, 2, ... of this motor, in the order of commits."""
        return self.published.revision

    @property
    def status(self) -> Standing:
        """What the datasheet says of itself, unless a person decided otherwise since.

        A refused datasheet is never released: an approval heals no failed check.
        """
        own = self.published.status or "refused"
        if not self.decisions:
            return own
        if self.decisions[-1].kind == "revoke":
            return "revoked"
        return own if own == "refused" else "released"

    @property
    def revocation(self) -> Revocation | None:
        """The first revocation of a version that is revoked now; None for any other.

        The first: one that repeats it in other words must not change what takes its place.
        """
        if self.status != "revoked":
            return None
        first = next(event for event in self.decisions if event.kind == "revoke")
        own = self.published
        return Revocation(own.version, own.content_sha256 or "", first.by or "", first.why or "")

    @property
    def open_points(self) -> tuple[str, ...]:
        """What keeps the version from a release and no approval settles."""
        return tuple(one for one in self.published.reasons if not left_to_a_person(one))


def histories(
    events: Iterable[Event], until: datetime | None = None
) -> Mapping[str, tuple[Version, ...]]:
    """The versions of each motor as they stood at a moment.

    Parameters
    ----------
    events
        Rows of the registry, in any order.
    until
        The moment; None for now.

    Returns
    -------
    mapping of str to tuple of Version
        Motors sorted, versions oldest first. A version that was published twice counts once, by its
        first row.

    """
    published: dict[tuple[str, str], Event] = {}
    decided: dict[tuple[str, str], list[Event]] = {}
    tagged: dict[tuple[str, str], set[str]] = {}
    for event in sorted(events, key=lambda event: event.sequence):
        if until is not None and event.recorded_at > until:
            continue
        if event.kind == "publish":
            published.setdefault(event.key, event)
        elif event.kind == "tag":
            tagged.setdefault(event.key, set()).add(event.why or "")
        elif event.kind == "untag":
            tagged.setdefault(event.key, set()).discard(event.why or "")
        else:
            decided.setdefault(event.key, []).append(event)
    histories: dict[str, list[Version]] = {}
    for key, event in published.items():
        decisions, tags = tuple(decided.get(key, ())), frozenset(tagged.get(key, ()))
        histories.setdefault(event.motor_id, []).append(Version(event, decisions, tags))
    return {motor_id: tuple(histories[motor_id]) for motor_id in sorted(histories)}


def in_force(history: Sequence[Version]) -> Version | None:
    """The version of a motor that an export takes.

    Parameters
    ----------
    history
        The versions of one motor.

    Returns
    -------
    Version or None
        The newest released one; None where none is released.

    """
    released = [version for version in history if version.status == "released"]
    return max(released, key=lambda version: version.revision, default=None)


@dataclass(frozen=True, slots=True)
class Selection:
    """Which versions of the registry are meant; what is None does not matter.

    Attributes
    ----------
    motor_id, motor_type, lot, station
        Of the datasheet.
    status
        The status at `until`.
    version
        Beginning of the digest.
    revision
        Number of the version of its motor.
    since, until
        Bounds on when it was published.

    """

    motor_id: str | None = None
    motor_type: str | None = None
    lot: str | None = None
    station: str | None = None
    status: Standing | None = None
    version: str | None = None
    revision: int | None = None
    since: datetime | None = None
    until: datetime | None = None

    def takes(self, version: Version) -> bool:
        """Whether a version is selected.

        Parameters
        ----------
        version
            A version as it stood at `until`.

        """
        own = version.published
        equal = (
            (self.motor_id, own.motor_id),
            (self.motor_type, own.motor_type),
            (self.lot, own.lot),
            (self.status, version.status),
            (self.revision, own.revision),
        )
        return (
            all(wanted is None or wanted == there for wanted, there in equal)
            and (self.station is None or self.station in own.stations)
            and (self.version is None or own.version.startswith(self.version))
            and (self.since is None or own.recorded_at >= self.since)
        )


def select(events: Iterable[Event], wanted: Selection) -> tuple[Version, ...]:
    """Every version of the registry that is selected, by motor and revision.

    Parameters
    ----------
    events
        Rows of the registry.
    wanted
        Which versions are meant.

    """
    motors = histories(events, wanted.until)
    return tuple(v for history in motors.values() for v in history if wanted.takes(v))


def newest(versions: Iterable[Version]) -> tuple[Version, ...]:
    """The newest version of each motor, sorted by motor.

    Parameters
    ----------
    versions
        Versions of any motors, in any order.

    """
    last = {v.motor_id: v for v in sorted(versions, key=lambda v: (v.motor_id, v.revision))}
    return tuple(last.values())


def faults(events: Sequence[Event]) -> list[str]:
    """Whatever a registry shows that this project would not have written.

    Parameters
    ----------
    events
        Every row, in the order in which it is stored.

    Returns
    -------
    list of str
        One sentence a fault: gaps and repeats of the sequence or of a motor's revisions, a version
        published twice, a decision on no version, a chain that does not hold.

    """
    sentences: list[str] = []
    chain, revisions, seen = START, dict[str, int](), set[tuple[str, str]]()
    for expected, event in enumerate(events, start=1):
        name = f"row {event.sequence} ({event.kind} {event.motor_id!r})"
        if event.sequence != expected:
            sentences.append(f"{name}: row {expected} is expected here")
        if event.linked(chain).chain != event.chain:
            sentences.append(f"{name}: does not follow from the row before; it or that was changed")
        chain = event.chain
        if event.kind != "publish":
            if event.key not in seen:
                sentences.append(f"{name}: version {event.version[:12]} was never published")
            continue
        if event.key in seen:
            sentences.append(f"{name}: version {event.version[:12]} is there twice")
            continue
        seen.add(event.key)
        revisions[event.motor_id] = revisions.get(event.motor_id, 0) + 1
        if event.revision != revisions[event.motor_id]:
            counted = revisions[event.motor_id]
            sentences.append(
                f"{name}: says revision {event.revision}, is the {counted}. of its motor"
            )
    return sentences
