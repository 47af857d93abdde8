"""The summary that a run prints: one line a motor, what failed, where to look."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence

from pipeline.records.current_status import CurrentStatus, current_status
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Estimate
from pipeline.records.finding import Finding
from pipeline.records.naming import counted, printable
from pipeline.report.status_text import status_lines
from pipeline.views.model_words import model_words

COLUMNS: tuple[tuple[str, str, float], ...] = (
    ("p", "pole_pairs", 1.0),
    ("R [mohm]", "r_phase_ohm", 1e3),
    ("Ld [uH]", "ld_h", 1e6),
    ("Lq [uH]", "lq_h", 1e6),
    ("psi [mWb]", "psi_pm_wb", 1e3),
    ("Kt [mN·m/A]", "kt_peak_nm_a", 1e3),
    ("J [g·cm²]", "j_rotor_kgm2", 1e7),
    ("Tc [mN·m]", "torque_coulomb_nm", 1e3),
    ("cogging", "cogging_order", 1.0),
)
NONE = "-"


def summary(
    datasheets: Sequence[Datasheet],
    findings: Sequence[Finding],
    output: str,
    *,
    report: bool,
    folder: str = "FOLDER",
    statuses: Mapping[str, CurrentStatus] | None = None,
) -> str:
    """The text for a terminal: a table of motors, the failed checks, the counts, the way in.

    `statuses` are the current ones, by motor; what a datasheet says of itself without. `folder` is
    where the captures lie.
    """
    now = {s.motor_id: (statuses or {}).get(s.motor_id, current_status(s)) for s in datasheets}
    lines: list[str] = []
    if datasheets:
        lines += [*_table(datasheets, now), ""]
    for sheet in datasheets:
        lines += [
            f"{printable(sheet.motor_id)}: {c.name} {c.status}: {c.meaning}"
            + (f"; suspect: {c.suspect}" if c.suspect else "")
            for c in sheet.checks
            if c.status in ("fail", "marginal")
        ]
    lines += _unexplained(datasheets, folder)
    lines += [
        f"{printable(motor_id)}: {printable(line)}"
        for motor_id, current in now.items()
        for line in status_lines(current)
    ]
    counts = Counter(current.status for current in now.values())
    states = f"{counts['released']} released, {counts['provisional']} provisional, "
    states += f"{counts['refused']} refused"
    states += f", {counts['revoked']} revoked" if counts["revoked"] else ""
    refused = sum(finding.severity == "refused" for finding in findings)
    lines.append(
        f"{counted(len(datasheets), 'motor')}: {states}; {counted(refused, 'capture')} refused"
    )
    if report and datasheets:
        lines.append(f"open {output}/report/index.html")
    return "\n".join(lines)


def _unexplained(datasheets: Sequence[Datasheet], folder: str) -> list[str]:
    """A line on the motors whose model misses something, with the one it misses most of."""
    told = [s for s in datasheets if s.model is not None and s.model.tested and not s.model.passed]
    if not told:
        return []
    worst = max(told, key=lambda sheet: (sheet.model and sheet.model.residual) or 0.0)
    words = model_words(worst.model, worst.motor_id, folder)
    who = printable(worst.motor_id)
    if len(told) > 1:
        who = f"{len(told)} motors are not explained down to the noise, {who} least"
    # the folder's name is put in last and may stand for another until then
    command = folder.join(printable(part) for part in words.command.split(folder))
    return [f"{who}: {printable(words.sentence)}; `{command}` tells more"]


def nothing_usable(folder: str, *, refused: bool) -> str:
    """The line that says that a folder holds no capture to work on, and what to do."""
    remedy = "`inspect FILE` says why a file is none; name the folder of captures by input="
    if refused:
        remedy = "correct what is refused, or name another folder by input="
    return f"undecided: no usable capture in {folder}; {remedy}"


def _table(datasheets: Sequence[Datasheet], now: Mapping[str, CurrentStatus]) -> list[str]:
    head = ["motor", "lot", "status", "model", *(title for title, *_ in COLUMNS)]
    rows = [
        [
            printable(sheet.motor_id),
            printable(sheet.lot or NONE),
            now[sheet.motor_id].status,
            model_words(sheet.model, sheet.motor_id).short,
            *(_cell(sheet.constants.get(name), scale) for _, name, scale in COLUMNS),
        ]
        for sheet in datasheets
    ]
    widths = [max(len(row[i]) for row in [head, *rows]) for i in range(len(head))]
    return [
        "  ".join(
            text.ljust(width) if column < 4 else text.rjust(width)
            for column, (text, width) in enumerate(zip(row, widths, strict=True))
        ).rstrip()
        for row in [head, *rows]
    ]


def _cell(estimate: Estimate | None, scale: float) -> str:
    if estimate is None or estimate.value is None:
        return NONE
    if isinstance(estimate.value, int):
        return str(estimate.value)
    return f"{estimate.value * scale:.4g}"
