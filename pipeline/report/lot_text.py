"""What `regress` prints: the verdict, what led to it, a line a constant, where the report is."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.physics.notation import quantity
from pipeline.records.lot_constant import ConstantResult, Side
from pipeline.records.lot_regression import LotRegression
from pipeline.views.table_text import NONE, safe, table


def regression_text(found: LotRegression, files: Sequence[str]) -> str:
    """The text for a terminal."""
    lines = [f"{found.verdict}: {safe(found.headline)}"]
    lines += [f"  {safe(reason)}" for reason in found.reasons]
    if found.mode == "lots" and found.history != "sufficient":
        lots, needed = len(found.baseline.lots), found.limits.min_lots
        lines.append(f"  lot-level test: {found.history}, {lots} of {needed} baseline lots")
    shown = [one for one in found.constants if one.motors]
    if shown:
        head = ("constant", "baseline", "candidate", "change", "± U", "p", "same", "verdict")
        lines += ["", table([head, *map(_row, shown)], right=(1, 2, 3, 4, 5))]
    absent = [one.name for one in found.constants if not one.motors]
    if absent:
        lines += ["", f"not compared, since neither side has it: {', '.join(absent)}"]
    changed = [one for one in found.effects if one.verdict != "pass"]
    if changed:
        lines.append("")
        lines += [f"{one.verdict}: {one.name}: {one.why}" for one in changed]
    if found.outliers:
        lines.append("")
        lines += [
            f"outlier: {safe(o.motor_id)}: {o.constant} {o.why} ({safe(o.capture or NONE)})"
            for o in found.outliers[:10]
        ]
    lines += [f"note: {safe(note)}" for note in found.notes]
    return "\n".join([*lines, "", *(f"wrote {name}" for name in files)])


def mean_of(one: ConstantResult, side: Side) -> float | None:
    """The mean of lot means of a side, or of its motors where there are no lots."""
    means = [lot.mean for lot in one.lots if lot.side == side]
    means = means or [motor.value for motor in one.of(side)]
    return sum(means) / len(means) if means else None


def _row(one: ConstantResult) -> tuple[str, ...]:
    before, after = mean_of(one, "baseline"), mean_of(one, "candidate")
    effect, p = one.effect, one.test.p_holm
    scale = 100.0 / abs(before) if before else None
    return (
        one.name,
        NONE if before is None else quantity(before, one.unit),
        NONE if after is None else quantity(after, one.unit),
        NONE if effect.relative is None else f"{100.0 * effect.relative:+.2f} %",
        NONE
        if effect.expanded_u is None or scale is None
        else f"{effect.expanded_u * scale:.2f} %",
        NONE if p is None else f"{p:.2g}",
        one.equivalence.status.replace("_", " "),
        one.verdict,
    )
