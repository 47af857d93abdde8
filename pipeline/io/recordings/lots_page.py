"""The verdict of a comparison of lots as a markdown page inside its recording."""

from __future__ import annotations

from pipeline.io.recordings.datasheet_page import plain
from pipeline.records.lot_regression import LotRegression
from pipeline.views.lots import ConstantRow, lot_view

MOST_OUTLIERS = 12


def verdict_markdown(result: LotRegression) -> str:
    """Verdict, headline, reasons, one line a constant, outliers and notes as a page.

    Parameters
    ----------
    result
        The comparison.

    """
    before, after = result.baseline, result.candidate
    lines = [
        f"# {plain(before.selector)} → {plain(after.selector)}: {plain(result.verdict)}",
        "",
        f"**{plain(result.headline)}**",
        "",
        f"{before.motors} \\+ {after.motors} motors, "
        f"{len(before.lots)} \\+ {len(after.lots)} lots; "
        "blue is the baseline, orange the candidate, everywhere.",
        "",
    ]
    lines += [f"- {plain(reason)}" for reason in result.reasons]
    if result.history != "sufficient":
        needed = result.limits.min_lots
        lines.append(f"- {plain(result.history)}: the test over lots needs {needed} baseline lots")
    lines += [
        "",
        "| | constant | baseline | candidate | change ± U | p |",
        "| --- |" + " --- |" * 5,
    ]
    view = lot_view(result)
    lines += [_line(row) for row in view.rows]
    lines += ["", *(f"- {len(r.members)} constants: {plain(r.text)}" for r in view.reasons)]
    changed = [one for one in result.effects if one.verdict != "pass"]
    if changed:
        lines += ["", "## Effects and orders", ""]
        lines += [f"- {plain(one.verdict)}: {plain(one.name)}: {plain(one.why)}" for one in changed]
    if result.outliers:
        lines += ["", "## Motors apart from their lot", ""]
        lines += [
            f"- {plain(o.motor_id)}: {plain(o.constant)} {plain(o.why)}"
            + (f" ({plain(o.capture)})" if o.capture else "")
            for o in result.outliers[:MOST_OUTLIERS]
        ]
    lines += ["", *(f"{plain(note)}\n" for note in result.notes)]
    order = [*before.lots, *after.lots]
    lines += ["## Lots by number", ""]
    lines += [f"- {number}: {plain(lot)}" for number, lot in enumerate(order)]
    return "\n".join([*lines, ""])


def _line(row: ConstantRow) -> str:
    strong = "**" if row.tone == "fail" else ""
    return (
        f"| {row.mark} | {strong}{plain(row.name)}{strong} | {row.before} | {row.after} "
        f"| {strong}{plain(row.change)}{strong} | {row.p_value} |"
    )
