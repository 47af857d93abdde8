"""A comparison for people: each signal's error before and after, where it lives, what moved."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

from pipeline.physics.notation import MINUS, number_text, quantity, reading, significant
from pipeline.records.comparison import Comparison, Dependence, SignalError
from pipeline.records.error_map import ErrorMap
from pipeline.records.model_verdict import number
from pipeline.records.naming import counted
from pipeline.views.names import quantity_words

SURE, SHARE, MOVED = 1e-3, 0.05, 3.0
"""P-value and share of variance from which on a variable is named, change in u of a parameter."""
KINDS = {"equation": "from the measured state", "free_run": "on its own"}


@dataclass(frozen=True, slots=True)
class ErrorRow:
    """One signal's error over all captures; `before` is the ratio without what was added."""

    signal: str
    kind: str
    rmse: str
    floor: str
    ratio: str
    before: str
    held_out: str
    worst: str


@dataclass(frozen=True, slots=True)
class CaptureRow:
    """One signal's error in one capture."""

    capture: str
    signal: str
    kind: str
    split: str
    rmse: str
    floor: str
    ratio: str


@dataclass(frozen=True, slots=True)
class MoveRow:
    """One parameter before and after, and its change over the u that it had before."""

    parameter: str
    before: str
    after: str
    in_u: str


@dataclass(frozen=True, slots=True)
class ComparisonView:
    """One comparison, every text ready to be shown.

    `added` are sizes of the effects that were asked for; `unknown` parameters that these captures
    do not determine, `together` what they determine of them; `places` what errors depend on.
    """

    headline: str
    signals: tuple[ErrorRow, ...]
    captures: tuple[CaptureRow, ...]
    added: tuple[tuple[str, str], ...]
    places: tuple[str, ...]
    unknown: tuple[str, ...]
    together: tuple[tuple[str, str], ...]
    moved: tuple[MoveRow, ...]
    stayed: str


def comparison_view(result: Comparison) -> ComparisonView:
    """The view of one comparison.

    Parameters
    ----------
    result
        The comparison.

    """
    own = ("", *result.effects)
    moved = [m for m in result.moved if abs(m.in_u) >= MOVED]
    still = counted(len(result.moved) - len(moved), "parameter")
    return ComparisonView(
        headline(result),
        tuple(_signals(result)),
        tuple(map(_capture, result.errors)),
        tuple(
            (name, number_text(one.value, one.u, one.unit))
            for name, one in result.parameters.items()
            if "." in name and name.split(".")[0] in own
        ),
        tuple(_places(result)),
        tuple(name for name, one in result.parameters.items() if not one.known),
        tuple((c.expression, reading(c.value, c.u, c.unit).text()) for c in result.combinations),
        tuple(
            MoveRow(
                m.parameter,
                reading(m.before, m.u_before, m.unit).text(),
                reading(m.after, m.u_after, m.unit).text(),
                f"{m.in_u:+.1f}".replace("-", MINUS),
            )
            for m in sorted(moved, key=lambda m: -abs(m.in_u))
        ),
        f"{still} stayed within {MOVED:.0f} u" if result.moved else "",
    )


def headline(result: Comparison) -> str:
    """How far the model is off, and how far it was without what was added, in a sentence.

    Parameters
    ----------
    result
        The comparison.

    """
    if not result.errors or result.held_out is None:
        return "; ".join(result.notes)
    held_out = any(error.split == "held_out" for error in result.errors)
    what = "held-out error" if held_out else "error of the fit, none held out,"
    if result.bare is not None:
        falls = "falls" if result.held_out < result.bare else "goes"
        names = result.added or result.effects
        added = " and ".join(name.replace("_", " ") for name in names)
        return (
            f"with {added} the {what} {falls} from {number(result.bare)} to "
            f"{number(result.held_out)} (1 is the noise floor)"
        )
    return (
        f"model {result.name} with {', '.join(result.effects) or 'no effects'}: {what} "
        f"{number(result.held_out)} (1 is the noise floor)"
    )


def ratio_of(error: SignalError) -> float:
    """An error over its noise floor.

    Parameters
    ----------
    error
        The error.

    """
    return error.rmse / max(error.noise_floor, 1e-300)


def pooled(errors: Sequence[SignalError], name: str) -> float:
    """Root of the mean square of `rmse` or `noise_floor` over all windows of some captures.

    Parameters
    ----------
    errors
        The errors of some captures.
    name
        `rmse` or `noise_floor`.

    """
    total = sum(e.n * getattr(e, name) ** 2 for e in errors)
    return math.sqrt(total / max(sum(e.n for e in errors), 1))


def _signals(result: Comparison) -> list[ErrorRow]:
    """Equations before trajectories, the signal farthest over its noise floor first."""
    rows = []
    for signal, kind in dict.fromkeys((e.signal, e.kind) for e in result.errors):
        own = [e for e in result.errors if (e.signal, e.kind) == (signal, kind)]
        old = [e for e in result.before if (e.signal, e.kind) == (signal, kind)]
        worst = max(own, key=ratio_of)
        rows.append(
            (
                (kind != "equation", -_pooled_ratio(own)),
                ErrorRow(
                    signal,
                    kind,
                    quantity(pooled(own, "rmse"), worst.unit, 3),
                    quantity(pooled(own, "noise_floor"), worst.unit, 3),
                    significant(_pooled_ratio(own), 2),
                    significant(_pooled_ratio(old), 2) if old else "",
                    f"{sum(e.split == 'held_out' for e in own)} of {len(own)} held out",
                    f"{worst.capture} ({significant(ratio_of(worst), 2)})",
                ),
            )
        )
    return [row for _, row in sorted(rows, key=lambda one: one[0])]


def _pooled_ratio(errors: Sequence[SignalError]) -> float:
    return pooled(errors, "rmse") / max(pooled(errors, "noise_floor"), 1e-300)


def _capture(error: SignalError) -> CaptureRow:
    return CaptureRow(
        error.capture,
        error.signal,
        KINDS[error.kind],
        "held out" if error.split == "held_out" else "in the fit",
        quantity(error.rmse, error.unit, 3),
        quantity(error.noise_floor, error.unit, 3),
        significant(ratio_of(error), 3),
    )


def _places(result: Comparison) -> Iterator[str]:
    """Variables that an error depends on, and the cell of speed and current it is in; of
    signals that are over their noise floor in some capture, since below it there is no failure.
    """
    over = {e.signal for e in result.errors if e.kind == "equation" and ratio_of(e) > 1.0}
    for signal in dict.fromkeys(d.signal for d in result.where if d.signal in over):
        sure = [d for d in result.where if d.signal == signal and _significant(d)]
        sure.sort(key=lambda d: -d.explained)
        depends = [f"{d.variable} ({100 * d.explained:.0f} %)" for d in sure[:4]]
        worst = next((_worst(m) for m in result.maps if m.signal == signal and m.y is not None), "")
        if depends or worst:
            yield f"{signal} depends on {', '.join(depends) or 'nothing known'}{worst}"


def _significant(dependence: Dependence) -> bool:
    p_value = dependence.p_value
    return p_value is not None and p_value < SURE and dependence.explained >= SHARE


def _worst(error_map: ErrorMap) -> str:
    """The cell whose mean is farthest from zero among those that chance does not make."""
    if error_map.y is None:
        return ""
    cells = error_map.mean.size
    sure = [
        (abs(error_map.mean[row, column]), row, column)
        for row in range(error_map.mean.shape[0])
        for column in range(error_map.mean.shape[1])
        if error_map.p_value[row, column] * cells < SURE
    ]
    if not sure:
        return ""
    _, row, column = max(sure)
    speed, current = error_map.x.edges[column : column + 2], error_map.y.edges[row : row + 2]
    at = f"{speed[0]:.3g} to {speed[1]:.3g} rad/s, {current[0]:.3g} to {current[1]:.3g} A"
    mean = quantity(float(error_map.mean[row, column]), error_map.unit, 2)
    return f"; worst at {at.replace('-', MINUS)}: {mean}"


def signal_title(row: ErrorRow) -> str:
    """A signal in words, with `on its own` for a free run.

    Parameters
    ----------
    row
        The row.

    """
    words = quantity_words(row.signal)
    return words if row.kind == "equation" else f"{words}, {KINDS[row.kind]}"
