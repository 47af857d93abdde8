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
    """One row of the registry, in the order of commits: `sequence` counts 1, 2, ... over all.

    `revision` counts the versions of one motor. `chain` is the sha256 of this row and the chain of
    the row before, so that no row can be changed, lost or put in without notice. What a datasheet
    says of itself (`motor_type` to `content_sha256`) is there for `publish` alone, `by` and `why`
    for the decisions alone; the `why` of a tag is its name.
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
        """This event with its chain, given the chain of the row before it."""
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
    """One version of a motor's datasheet and what was decided of it, oldest decision first.

    `tags` are the names that it bears.
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
    """The versions of each motor, oldest first, as they stood at a moment (now, without one).

    A version published twice counts once, by its first row; motors are sorted.
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
    found: dict[str, list[Version]] = {}
    for key, event in published.items():
        decisions, tags = tuple(decided.get(key, ())), frozenset(tagged.get(key, ()))
        found.setdefault(event.motor_id, []).append(Version(event, decisions, tags))
    return {motor_id: tuple(found[motor_id]) for motor_id in sorted(found)}


def in_force(history: Sequence[Version]) -> Version | None:
    """The newest released version of a motor; None where nothing is released."""
    released = [version for version in history if version.status == "released"]
    return max(released, key=lambda version: version.revision, default=None)


@dataclass(frozen=True, slots=True)
class Selection:
    """Which versions are meant; what is None does not matter.

    `version` is a beginning of the digest, `since` and `until` bound when the version was
    published, and `until` is also the moment whose status counts.
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
        """Whether a version is meant."""
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
    """Every version that is meant, by motor and revision."""
    motors = histories(events, wanted.until)
    return tuple(v for history in motors.values() for v in history if wanted.takes(v))


def newest(versions: Iterable[Version]) -> tuple[Version, ...]:
    """The newest of each motor's versions, in the order of motors."""
    last = {v.motor_id: v for v in sorted(versions, key=lambda v: (v.motor_id, v.revision))}
    return tuple(last.values())


def faults(events: Sequence[Event]) -> list[str]:
    """Everything that no registry written by this project shows, one sentence each.

    Gaps and repeats of the sequence and of a motor's revisions, a version published twice, a
    decision on nothing, a chain that does not hold.
    """
    found: list[str] = []
    chain, revisions, seen = START, dict[str, int](), set[tuple[str, str]]()
    for expected, event in enumerate(events, start=1):
        name = f"row {event.sequence} ({event.kind} {event.motor_id!r})"
        if event.sequence != expected:
            found.append(f"{name}: row {expected} is expected here")
        if event.linked(chain).chain != event.chain:
            found.append(f"{name}: does not follow from the row before; it or that was changed")
        chain = event.chain
        if event.kind != "publish":
            if event.key not in seen:
                found.append(f"{name}: version {event.version[:12]} was never published")
            continue
        if event.key in seen:
            found.append(f"{name}: version {event.version[:12]} is there twice")
            continue
        seen.add(event.key)
        revisions[event.motor_id] = revisions.get(event.motor_id, 0) + 1
        if event.revision != revisions[event.motor_id]:
            counted = revisions[event.motor_id]
            found.append(f"{name}: says revision {event.revision}, is the {counted}. of its motor")
    return found
