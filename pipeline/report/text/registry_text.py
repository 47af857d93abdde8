"""What `registry` prints: versions, one datasheet, a difference, what verification found."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.physics.notation import MINUS, quantity, reading
from pipeline.records.datasheet import Datasheet
from pipeline.records.difference import Change
from pipeline.records.estimate import Estimate
from pipeline.records.ledger import Version
from pipeline.records.naming import counted
from pipeline.views.model_words import model_words
from pipeline.views.status_text import decision, when
from pipeline.views.table_text import NONE, blocks, safe, table

SHOWN_DIGITS = 12


def versions_table(versions: Sequence[Version]) -> str:
    """One line a version: motor, revision, status, lot, type, when, digest, last decision.

    Where that is wider than the window, tables that all begin with motor and revision.

    Parameters
    ----------
    versions
        The versions.

    """
    widest = max((len(safe(v.motor_id)) for v in versions), default=0)
    own = "motor".ljust(widest) + "  revision"
    head = (own, "status", "lot", "type", "published", "version", "decided")
    rows = [
        (
            f"{safe(v.motor_id).ljust(widest)}  {v.revision:>8}",
            v.status,
            v.published.lot or NONE,
            v.published.motor_type or NONE,
            when(v.published.recorded_at),
            v.version[:SHOWN_DIGITS],
            decision(v.decisions[-1]) if v.decisions else NONE,
        )
        for v in versions
    ]
    return "\n".join(blocks([head, *rows]))


def in_force_table(versions: Sequence[tuple[str, Version | None, Version]]) -> str:
    """One line a motor: (motor, what is valid, what is newest) at one moment.

    Parameters
    ----------
    versions
        Of each motor its id, the version in force and the newest one.

    """
    head = ("motor", "valid", "published", "version", "newest")
    rows = [
        (
            motor_id,
            NONE if valid is None else f"revision {valid.revision}",
            NONE if valid is None else when(valid.published.recorded_at),
            NONE if valid is None else valid.version[:SHOWN_DIGITS],
            f"revision {last.revision}, {last.status}",
        )
        for motor_id, valid, last in versions
    ]
    return table([head, *rows])


def datasheet_text(version: Version, sheet: Datasheet) -> str:
    """A version with its constants, checks and decisions.

    Parameters
    ----------
    version
        The version.
    sheet
        The datasheet.

    """
    own = version.published
    lines = [
        f"{safe(version.motor_id)} revision {version.revision}: {version.status}",
        f"version    {version.version}",
        f"published  {when(own.recorded_at)}",
        f"type {safe(own.motor_type or NONE)}, lot {safe(own.lot or NONE)}, "
        f"station {safe(', '.join(own.stations) or NONE)}, "
        f"{counted(len(sheet.captures), 'capture')}, code {safe(sheet.code_version)}",
    ]
    if (old := sheet.supersedes) is not None:
        who = f"revoked by {safe(old.by)}: {safe(old.why)}"
        lines.append(f"  takes the place of version {old.version[:SHOWN_DIGITS]}, {who}")
    lines += [f"  {sheet.status} as published: {safe(reason)}" for reason in sheet.why]
    lines.append(f"  model: {safe(model_words(sheet.model, version.motor_id).sentence)}")
    lines += [f"  {decision(event)}" for event in version.decisions]
    if version.tags:
        lines.append(f"  tags: {safe(', '.join(sorted(version.tags)))}")
    rows = [(name, _value(est), est.status) for name, est in sorted(sheet.constants.items())]
    checks = [(c.name, c.status, c.meaning) for c in sheet.checks]
    for part in (rows, checks):
        if part:
            lines += ["", table(part)]
    return "\n".join(lines)


def difference_text(before: Version, after: Version, changes: Sequence[Change]) -> str:
    """Two versions of a motor and the change of every constant in units of its uncertainty.

    Parameters
    ----------
    before
        The earlier version.
    after
        The later version.
    changes
        Change of each constant.

    """
    name = safe(after.motor_id)
    lines = [
        f"{name}: revision {before.revision} ({before.status}) to "
        f"{after.revision} ({after.status})",
        "",
    ]
    head = ("constant", "before", "after", "change", "change/u", "change/u_d", "")
    rows = [
        (
            change.name,
            _value(change.before),
            _value(change.after),
            NONE if change.change is None else _change(change),
            _ratio(change.in_u),
            _ratio(change.in_u_of_difference),
            _remark(change),
        )
        for change in changes
    ]
    lines += blocks([head, *rows], right=(1, 2, 3, 4, 5))
    lines += [
        "",
        "u: both uncertainties, root sum of squares",
        "u_d: the same where what one instrument adds to both cancels",
    ]
    return "\n".join(lines)


def _value(estimate: Estimate | None) -> str:
    if estimate is None or estimate.value is None:
        return NONE
    return reading(estimate.number, estimate.u, estimate.unit).text()


def _change(change: Change) -> str:
    value = change.change or 0.0
    if value == 0.0:
        return "0"
    text = quantity(value, change.unit, 3)
    return text if value < 0.0 else f"+{text}"


def _ratio(value: float | None) -> str:
    if value is None:
        return NONE
    if math.isinf(value):
        return "exact"
    return f"{value:+.2f}".replace("-", MINUS) if value else "0"


def _remark(change: Change) -> str:
    """What else than the value changed: it came, it went, its conditions or its status."""
    before, after = change.before, change.after
    if before is None or after is None:
        return "came" if before is None else "went"
    remarks = []
    if before.status != after.status:
        remarks.append(f"{before.status} to {after.status}")
    if before.known and after.known and dict(before.at) != dict(after.at):
        remarks.append("at other conditions")
    if before.method != after.method:
        remarks.append(f"{before.method} to {after.method}")
    return ", ".join(remarks)
