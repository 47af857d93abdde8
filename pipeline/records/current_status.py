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
    """The status of a datasheet now, and the reasons for it.

    Attributes
    ----------
    status
        `released`, `provisional`, `refused` or `revoked`.
    why
        Reasons that stand, those in spite of which it was approved too.
    version
        The registered version with this content; None where there is none.
    in_force
        The version of the motor that an export takes; None where none is released.

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
    """The status of a datasheet by what people decided of it.

    Parameters
    ----------
    sheet
        The datasheet.
    history
        The versions of its motor in the registry, oldest first.
    content_sha256
        Digest of the datasheet's file; None where there is no file to compare.

    Returns
    -------
    CurrentStatus
        What the datasheet says of itself where no version of that content is registered: no
        decision was on that content.

    """
    valid = in_force(history)
    for version in history:
        same = content_sha256 in (None, version.published.content_sha256)
        if version.version == sheet.version and same:
            return status_of(version, valid)
    return CurrentStatus(sheet.status, sheet.why, None, valid)


def status_of(version: Version, valid: Version | None) -> CurrentStatus:
    """The status of a registered version.

    Parameters
    ----------
    version
        The version with its decisions.
    valid
        The version of its motor that is in force, None where none is released.

    Returns
    -------
    CurrentStatus
        Once a person has decided, the reason that an approval is awaited is left out.

    """
    why = version.published.reasons
    if version.decisions:
        why = tuple(reason for reason in why if reason != AWAITS_APPROVAL)
    return CurrentStatus(version.status, why, version, valid)
