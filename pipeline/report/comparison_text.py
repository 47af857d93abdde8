"""What `compare` prints: errors by signal beside their noise floor, and where they live."""

from __future__ import annotations

import math
from collections.abc import Sequence

from pipeline.physics.notation import quantity, reading, significant
from pipeline.records.comparison import Comparison, Dependence, SignalError
from pipeline.records.error_map import ErrorMap
from pipeline.records.naming import counted
from pipeline.views.table_text import safe, table

_SURE = 1e-3
_SHARE = 0.05
_MOVED = 3.0
_KINDS = {"equation": "", "free_run": ", on its own"}


def comparison_text(result: Comparison) -> str:
    """A few lines and tables for a terminal."""
    effects = ", ".join(result.effects) or "no effects"
    if not result.errors:
        return f"{safe(result.motor_id)}: {'; '.join(result.notes)}"
    out = any(error.split == "held_out" for error in result.errors)
    what = "held-out error" if out else "error of the fit, none held out,"
    head = (
        f"{safe(result.motor_id)}: model {result.name} with {effects}: {what} "
        f"{result.held_out:.4g} (1 is the noise floor)"
    )
    lines = [head, *(f"  note: {note}" for note in result.notes)]
    if result.bare is not None:
        lines.append(f"  without what was added: {result.bare:.4g}")
    told = [*_errors(result), *_places(result), *_undetermined(result), *_moves(result)]
    return "\n".join([*lines, *told])


def _errors(result: Comparison) -> list[str]:
    rows: list[Sequence[str]] = [("  error", "rms", "noise floor", "ratio", "captures", "worst in")]
    names = dict.fromkeys((e.signal, e.kind) for e in result.errors)
    for signal, kind in names:
        mine = [e for e in result.errors if (e.signal, e.kind) == (signal, kind)]
        worst = max(mine, key=_ratio)
        rows.append(
            (
                f"  {signal}{_KINDS[kind]}",
                quantity(_pooled(mine, "rmse"), worst.unit, 3),
                quantity(_pooled(mine, "noise_floor"), worst.unit, 3),
                significant(_pooled(mine, "rmse") / max(_pooled(mine, "noise_floor"), 1e-300), 2),
                f"{sum(e.split == 'held_out' for e in mine)} of {len(mine)} held out",
                f"{worst.capture} ({significant(_ratio(worst), 2)})",
            )
        )
    return table(rows, right=(1, 2, 3)).splitlines()


def _pooled(errors: Sequence[SignalError], name: str) -> float:
    total = sum(e.n * getattr(e, name) ** 2 for e in errors)
    return math.sqrt(total / sum(e.n for e in errors))


def _ratio(error: SignalError) -> float:
    return error.rmse / max(error.noise_floor, 1e-300)


def _places(result: Comparison) -> list[str]:
    """Variables that an error surely depends on, and the cell of speed and current it is in; of
    signals that are over their noise floor in some capture, since below it there is no failure.
    """
    lines = []
    over = {e.signal for e in result.errors if e.kind == "equation" and _ratio(e) > 1.0}
    for signal in dict.fromkeys(d.signal for d in result.where if d.signal in over):
        sure = [d for d in result.where if d.signal == signal and _surely(d)]
        sure.sort(key=lambda d: -d.explained)
        told = [f"{d.variable} ({100 * d.explained:.0f} %)" for d in sure[:4]]
        worst = next((_worst(m) for m in result.maps if m.signal == signal and m.y is not None), "")
        if told or worst:
            lines.append(f"  {signal} depends on {', '.join(told) or 'nothing surely'}{worst}")
    return lines


def _surely(dependence: Dependence) -> bool:
    p_value = dependence.p_value
    return p_value is not None and p_value < _SURE and dependence.explained >= _SHARE


def _worst(one: ErrorMap) -> str:
    """The cell whose mean is farthest from zero among those that chance does not make."""
    if one.y is None:
        return ""
    cells = one.mean.size
    sure = [
        (abs(one.mean[row, column]), row, column)
        for row in range(one.mean.shape[0])
        for column in range(one.mean.shape[1])
        if one.p_value[row, column] * cells < _SURE
    ]
    if not sure:
        return ""
    _, row, column = max(sure)
    speed, current = one.x.edges[column : column + 2], one.y.edges[row : row + 2]
    return (
        f"; worst at {speed[0]:.3g} to {speed[1]:.3g} rad/s, {current[0]:.3g} to "
        f"{current[1]:.3g} A: {quantity(float(one.mean[row, column]), one.unit, 2)}"
    )


def _undetermined(result: Comparison) -> list[str]:
    """Parameters that these captures do not determine, and what they tell of them together."""
    unknown = [name for name, one in result.parameters.items() if not one.known]
    lines = [f"  not identifiable from these captures: {', '.join(unknown)}"] if unknown else []
    known = [(one.expression, reading(one.value, one.u, one.unit)) for one in result.combinations]
    return lines + [f"  but {expression} = {shown.text()}" for expression, shown in known]


def _moves(result: Comparison) -> list[str]:
    """Parameters that the added effects moved, the farthest first, and how many stayed."""
    moved = [m for m in result.moved if abs(m.in_u) >= _MOVED]
    if not result.moved:
        return []
    rows: list[Sequence[str]] = [("  moved", "before", "after", "change/u")]
    rows += [
        (
            f"  {m.parameter}",
            reading(m.before, m.u_before, m.unit).text(),
            reading(m.after, m.u_after, m.unit).text(),
            f"{m.in_u:+.1f}",
        )
        for m in sorted(moved, key=lambda m: -abs(m.in_u))
    ]
    still = counted(len(result.moved) - len(moved), "parameter")
    stayed = f"  {still} stayed within {_MOVED:.0f} u"
    return [*(table(rows, right=(1, 2, 3)).splitlines() if moved else []), stayed]
