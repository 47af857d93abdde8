"""What `compare` prints: errors by signal beside their noise floor, and where they live."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.records.comparison import Comparison
from pipeline.views.comparison import ComparisonView, comparison_view
from pipeline.views.table_text import NONE, blocks, safe

_KINDS = {"equation": "", "free_run": ", on its own"}


def comparison_text(result: Comparison) -> str:
    """A few lines and tables for a terminal.

    Parameters
    ----------
    result
        The comparison.

    """
    view = comparison_view(result)
    lines = [f"{safe(result.motor_id)}: {safe(view.headline)}"]
    if not result.errors:
        return lines[0]
    lines += [f"  note: {safe(note)}" for note in result.notes]
    facts = [*_errors(view), *(f"  {safe(place)}" for place in view.places)]
    if view.unknown:
        facts.append(f"  not identifiable from these captures: {', '.join(view.unknown)}")
    facts += [f"  but {expression} = {text}" for expression, text in view.together]
    return "\n".join([*lines, *facts, *_moves(view)])


def _errors(view: ComparisonView) -> list[str]:
    rows: list[Sequence[str]] = [
        ("  error", "rms", "noise floor", "ratio", "before", "held out", "worst in")
    ]
    rows += [
        (
            f"  {row.signal}{_KINDS[row.kind]}",
            row.rmse,
            row.floor,
            row.ratio,
            row.before or NONE,
            row.held_out.removesuffix(" held out"),
            row.worst,
        )
        for row in view.signals
    ]
    if not any(row.before for row in view.signals):
        rows = [(*row[:4], *row[5:]) for row in rows]
    return blocks(rows, right=range(1, len(rows[0]) - 1))


def _moves(view: ComparisonView) -> list[str]:
    """Parameters that the added effects moved, the farthest first, and how many stayed."""
    if not view.stayed:
        return []
    rows: list[Sequence[str]] = [("  moved", "before", "after", "change/u")]
    rows += [(f"  {m.parameter}", m.before, m.after, m.in_u) for m in view.moved]
    moved = blocks(rows, right=(1, 2, 3)) if view.moved else []
    return [*moved, f"  {view.stayed}"]
