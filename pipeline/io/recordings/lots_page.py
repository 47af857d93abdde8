"""The verdict of a comparison of lots as a markdown page inside its recording."""

from __future__ import annotations

from pipeline.io.recordings.datasheet_page import plain
from pipeline.physics.notation import MINUS, quantity, reading
from pipeline.records.lot_constant import ConstantResult, Side
from pipeline.records.lot_regression import LotRegression

_MARKS = {"pass": "✓", "fail": "✗", "marginal": "⚠"}
MOST_OUTLIERS = 12


def verdict_markdown(result: LotRegression) -> str:
    """Verdict, headline, reasons, a line a constant, outliers and notes."""
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
    lines += ["", "| | constant | baseline | candidate | Δ | p |", "| --- |" + " --- |" * 5]
    lines += [_line(one) for one in result.constants if one.motors]
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


def side_mean(one: ConstantResult, side: Side) -> tuple[float, float] | None:
    """Mean over a side's lots (else its motors) and the standard deviation between its motors."""
    values = [motor.value for motor in one.of(side)]
    if not values:
        return None
    means = [lot.mean for lot in one.lots if lot.side == side] or values
    middle = sum(values) / len(values)
    spread = sum((v - middle) ** 2 for v in values) / max(len(values) - 1, 1)
    return sum(means) / len(means), float(spread**0.5)


def _line(one: ConstantResult) -> str:
    cells = []
    for side in ("baseline", "candidate"):
        told = side_mean(one, side)
        cells.append("–" if told is None else reading(told[0], 0.5 * told[1], one.unit).text())
    change = "–"
    if one.effect.relative is not None:
        change = f"{100.0 * one.effect.relative:+.2f} %".replace("-", MINUS)
    elif one.effect.difference is not None:
        change = quantity(one.effect.difference, one.unit, 3)
    p_value = "–" if one.test.p_holm is None else f"{one.test.p_holm:.2g}"
    mark = _MARKS.get(one.verdict, "–")
    strong = "**" if one.verdict == "fail" else ""
    return (
        f"| {mark} | {strong}{plain(one.name)}{strong} | {cells[0]} | {cells[1]} "
        f"| {strong}{plain(change)}{strong} | {p_value} |"
    )
