"""What counts now of one version of a datasheet: what it says of itself, and what people decided.

A datasheet never changes. Whatever shows or uses its status (page, table, terminal, export) asks
here, so that all of them agree, whenever a person approves or revokes.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from pipeline.records.datasheet import AWAITS_APPROVAL, Datasheet
from pipeline.records.ledger import Event, Standing, Version, in_force


@dataclass(frozen=True, slots=True)
class CurrentStatus:
    """Status now, and the reasons that stand: those that an approval was given in spite of, too.

    `version` is the registered one, None where there is none of this content; `in_force` the one of
    its motor that an export takes, None where no version is released.
    """

    status: Standing
    why: tuple[str, ...]
    version: Version | None = None
    in_force: Version | None = None

    @property
    def decision(self) -> Event | None:
        """The last decision of a person on this version."""
        return self.version.decisions[-1] if self.version and self.version.decisions else None

    @property
    def exported(self) -> bool:
        """Whether this is the version that an export takes."""
        return self.in_force is not None and self.in_force == self.version


def current_status(
    sheet: Datasheet, history: Sequence[Version] = (), content_sha256: str | None = None
) -> CurrentStatus:
    """The status of a datasheet by the `history` of its motor in the registry, oldest first.

    Without a history it is what the datasheet says of itself. So it is where `content_sha256`, the
    digest of the datasheet's file, is not the one that is registered: no decision was on that.
    """
    valid = in_force(history)
    for version in history:
        same = content_sha256 in (None, version.published.content_sha256)
        if version.version == sheet.version and same:
            return status_of(version, valid)
    return CurrentStatus(sheet.status, sheet.why, None, valid)


def status_of(version: Version, valid: Version | None) -> CurrentStatus:
    """The status of a registered version; `valid` is the version of its motor that is in force."""
    why = version.published.reasons
    if version.decisions:
        why = tuple(reason for reason in why if reason != AWAITS_APPROVAL)
    return CurrentStatus(version.status, why, version, valid)
