"""The summary that a run prints: a line a motor, what failed, why, where to look."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from pipeline.records.current_status import CurrentStatus
from pipeline.records.datasheet import Datasheet
from pipeline.records.finding import Finding
from pipeline.records.naming import counted, printable
from pipeline.views.fleet import Column, FleetView, MotorRow, fleet_view, lacking_alike
from pipeline.views.model_words import model_words
from pipeline.views.status_text import status_lines
from pipeline.views.table_text import NONE, blocks, shortened

MOST_GROUPS = 5
"""So many lines say what models lack."""
FEW = 20
"""So many motors are shown with all their key constants; of more, those that fit one table."""
LONGEST = 20
"""Characters of a motor's id and of a lot's name in a table."""


def summary(
    datasheets: Sequence[Datasheet],
    findings: Sequence[Finding],
    output: str,
    *,
    report: bool,
    statuses: Mapping[str, CurrentStatus] | None = None,
) -> str:
    """The text for a terminal: a table of motors, the failed checks, the counts, the way in.

    Parameters
    ----------
    datasheets
        The datasheets of the batch.
    findings
        What was refused or is doubtful.
    output
        The output folder, as the user named it.
    report
        Whether pages are written.
    statuses
        Current status of each motor; None for what each datasheet states of itself.

    """
    view = fleet_view(datasheets, statuses)
    lines: list[str] = []
    if view.rows:
        lines += [*_tables(view), ""]
    for sheet in (row.sheet for row in view.rows):
        lines += [
            f"{printable(sheet.motor_id)}: {c.name} {c.status}: {c.meaning}"
            + (f"; suspect: {c.suspect}" if c.suspect else "")
            for c in sheet.checks
            if c.status in ("fail", "marginal")
        ]
    lines += _unexplained(datasheets)
    lines += [
        f"{printable(row.sheet.motor_id)}: {printable(line)}"
        for row in view.rows
        for line in status_lines(row.current)
    ]
    counts = Counter(row.current.status for row in view.rows)
    states = f"{counts['released']} released, {counts['provisional']} provisional, "
    states += f"{counts['refused']} refused"
    states += f", {counts['revoked']} revoked" if counts["revoked"] else ""
    refused = sum(finding.severity == "refused" for finding in findings)
    lines.append(
        f"{counted(len(datasheets), 'motor')}: {states}; {counted(refused, 'capture')} refused"
    )
    if datasheets:
        lines.append(f"all constants: {output}/fleet.csv")
    if report and datasheets:
        lines.append(f"open {output}/report/index.html")
    return "\n".join(lines)


def _unexplained(datasheets: Sequence[Datasheet]) -> list[str]:
    """A line for all motors whose models lack the same, with the one that lacks most of it."""
    lines = []
    for group in lacking_alike(datasheets):
        who = printable(group[0].motor_id)
        if len(group) > 1:
            who = f"{counted(len(group), 'motor')}, {who} most"
        sentence = model_words(group[0].model, group[0].motor_id).sentence
        lines.append(f"{who}: {printable(sentence)}")
    more = len(lines) - MOST_GROUPS
    return lines if more <= 0 else [*lines[:MOST_GROUPS], f"{more} more on the page"]


def nothing_usable(folder: str, *, refused: bool) -> str:
    """The line that says that a folder holds no capture to work on, and what to do.

    Parameters
    ----------
    folder
        The input folder, as the user named it.
    refused
        Whether captures were refused.

    """
    remedy = "`inspect FILE` says why a file is none; name the folder of captures by input="
    if refused:
        remedy = "correct what is refused, or name another folder by input="
    return f"undecided: no usable capture in {folder}; {remedy}"


def _tables(view: FleetView) -> list[str]:
    """Tables no wider than a terminal, units as on the page, ± U (k = 2) in the line below a value;
    of many motors one table of values alone.
    """
    head = ["motor", "lot", "status", "model", *map(_heading, view.columns)]
    units = [
        "",
        "",
        "",
        "[error, floors]",
        *(f"[{c.unit}]" if c.unit else "" for c in view.columns),
    ]
    few = len(view.rows) <= FEW
    lines = [line for row in view.rows for line in (_row(row), _spreads(row))[: 2 if few else 1]]
    tables = blocks([head, units, *lines], right=range(3, len(head)))
    return tables if few else tables[:1]


def _heading(column: Column) -> str:
    """The symbol in a line: `Kt` of K with the subscript `t, peak`."""
    letter, below = column.symbol
    return f"{letter}{below.partition(',')[0]}" or column.name


def _row(row: MotorRow) -> list[str]:
    sheet = row.sheet
    return [
        shortened(printable(sheet.motor_id), LONGEST),
        shortened(printable(sheet.lot or NONE), LONGEST),
        row.current.status,
        row.model.short.replace("error ", "").removesuffix(" floors"),
        *(cell.reading.value if cell.reading else NONE for cell in row.cells),
    ]


def _spreads(row: MotorRow) -> list[str]:
    readings = (cell.reading for cell in row.cells)
    return [*[""] * 4, *(f"± {r.expanded}" if r and r.expanded else "" for r in readings)]
