"""What `regress` prints: the verdict, what led to it, a line a constant, where the report is."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.records.lot_regression import LotRegression
from pipeline.records.naming import counted
from pipeline.views.lots import lot_view
from pipeline.views.table_text import NONE, blocks, safe


def regression_text(regression: LotRegression, files: Sequence[str]) -> str:
    """The text for a terminal.

    Parameters
    ----------
    regression
        The comparison of lots.
    files
        Names of the files that were written.

    """
    lines = [f"{regression.verdict}: {safe(regression.headline)}"]
    lines += [f"  {safe(reason)}" for reason in regression.reasons]
    if regression.mode == "lots" and regression.history != "sufficient":
        lots, needed = len(regression.baseline.lots), regression.limits.min_lots
        lines.append(f"  lot-level test: {regression.history}, {lots} of {needed} baseline lots")
    view = lot_view(regression)
    if view.rows:
        head = ("constant", "baseline", "candidate", "change ± U", "p", "same", "verdict")
        rows = [
            (r.name, r.before, r.after, r.change, r.p_value, r.same, r.verdict) for r in view.rows
        ]
        for block in blocks([head, *rows], right=(1, 2, 3, 4)):
            lines += ["", block]
    if view.reasons:
        lines.append("")
        lines += [f"{counted(len(r.members), 'constant')}: {safe(r.text)}" for r in view.reasons]
    if view.absent:
        lines += ["", f"not compared, since neither side has it: {', '.join(view.absent)}"]
    changed = [one for one in regression.effects if one.verdict != "pass"]
    if changed:
        lines.append("")
        lines += [f"{one.verdict}: {one.name}: {one.why}" for one in changed]
    if regression.outliers:
        lines.append("")
        lines += [
            f"outlier: {safe(o.motor_id)}: {o.constant} {o.why} ({safe(o.capture or NONE)})"
            for o in regression.outliers[:10]
        ]
    lines += [f"note: {safe(note)}" for note in regression.notes]
    return "\n".join([*lines, "", *(f"wrote {name}" for name in files)])
