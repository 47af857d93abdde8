"""The current status of a datasheet in words: the same on a page, a terminal, in an export."""

from __future__ import annotations

import re
from collections.abc import Sequence
from datetime import datetime

from pipeline.records.current_status import CurrentStatus
from pipeline.records.ledger import Event, Version
from pipeline.views.table_text import NONE, safe

WORDS = {
    "released": "Every capture verified, every check holds, approved.",
    "provisional": "Usable, with something missing, unverified or not explained.",
    "refused": "Do not use: a check failed.",
    "revoked": "Do not use: it was released, and revoked.",
}
_REASON = re.compile(
    r"(?P<kind>unverified: |missing: |impossible: )(?P<name>[^ ]+)(?: \((?P<remark>.*)\))?",
    re.DOTALL,
)
IN_SPITE = "Approved in spite of what its model leaves."


def status_words(current: CurrentStatus) -> str:
    """What the status means, in a sentence.

    Parameters
    ----------
    current
        The status in the registry.

    """
    if current.status == "released" and current.why:
        return IN_SPITE
    return WORDS[current.status]


def status_lines(current: CurrentStatus) -> tuple[str, ...]:
    """Who decided what, and which version an export takes where it is not this one.

    Empty for a version on which nothing was decided and beside which nothing else is released.

    Parameters
    ----------
    current
        The status in the registry.

    """
    lines = []
    if current.decision is not None and current.version is not None:
        lines.append(f"revision {current.version.revision}, {decision(current.decision)}")
    if current.in_force is not None and not current.exported:
        lines.append(f"export writes {exported(current.in_force)}, not this one")
    return tuple(lines)


def status_points(why: Sequence[str]) -> tuple[str, ...]:
    """The reasons for a status, as short as a list at the top of a page has to be.

    Parameters
    ----------
    why
        Reasons as the datasheet has them.

    Returns
    -------
    tuple of str
        What is said of several captures or constants once, with all their names; a remark to its
        first semicolon, as the table of constants has all of it.

    Examples
    --------
    >>> status_points(["missing: ld_h (no step; 3 windows)", "missing: lq_h (no step)"])
    ('missing: ld_h, lq_h (no step)',)

    """
    points: dict[tuple[str, str], dict[str, None]] = {}
    for reason in why:
        kind, name, remark = _parts(reason)
        points.setdefault((kind, remark), {})[name] = None
    return tuple(
        f"{kind}{', '.join(names)}{f' ({remark})' if remark else ''}"
        for (kind, remark), names in points.items()
    )


def _parts(reason: str) -> tuple[str, str, str]:
    """What is wrong, with its colon; with what; and the remark on it to its first semicolon."""
    match = _REASON.fullmatch(reason)
    if match is None:
        return reason, "", ""
    remark = (match["remark"] or "").partition("; ")[0]
    return match["kind"], match["name"], remark


def exported(version: Version) -> str:
    """Which version an export writes, and since when it counts: `revision 1, approved by ...`.

    Parameters
    ----------
    version
        The version.

    """
    since = decision(version.decisions[-1]) if version.decisions else "released as published"
    return f"revision {version.revision}, {since}"


def not_exported(last: Version) -> str:
    """That a newer version than the exported one is there, and what it is.

    Parameters
    ----------
    last
        The newest version.

    """
    points = "; ".join(last.published.reasons[:3])
    why = f" ({points})" if points else ""
    return f"revision {last.revision} is newer and {last.status}{why}; it is not exported"


def decision(event: Event) -> str:
    """`approved by NAME on DATE: why`.

    Parameters
    ----------
    event
        The event.

    """
    word = "approved" if event.kind == "approve" else "revoked"
    who, why = safe(event.by or NONE), safe(event.why or NONE)
    return f"{word} by {who} on {when(event.recorded_at)}: {why}"


def when(moment: datetime) -> str:
    """A moment to the second, in UTC.

    Parameters
    ----------
    moment
        The moment, with a zone.

    """
    return moment.strftime("%Y-%m-%dT%H:%M:%SZ")
