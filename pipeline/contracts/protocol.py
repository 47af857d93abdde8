"""What a gate is: one file in `gates/`, one `GATE`, found by the registry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pipeline.records.capture import Capture, Flags, Mask
from pipeline.records.errors import CaptureError
from pipeline.records.finding import Finding


@dataclass(frozen=True, slots=True)
class Lost:
    """Rows [n] of a column, of the table of that number, whose values are no readings."""

    table: int
    column: str
    rows: Flags


@dataclass(frozen=True, slots=True)
class Passed:
    """What a gate says of a capture that it lets through: rows set aside, values that are missing
    in truth, and warnings.
    """

    masks: tuple[Mask, ...] = ()
    findings: tuple[Finding, ...] = ()
    lost: tuple[Lost, ...] = ()


GateFunction = Callable[[Capture, Mapping[str, float]], Passed]


@dataclass(frozen=True, slots=True)
class Gate:
    """`check(capture, options)` is pure; it raises CaptureError for a capture of no use.

    `tests`: the tests it looks at. `options`: its thresholds with defaults, each with its reason
    beside it; `gates.NAME.KEY=` in the configuration overrides them and `gates.NAME.enabled=0`
    turns the gate off. `follows`: gates whose fault, where both find one, is the cause of this
    one's, and is reported first.
    """

    name: str
    tests: tuple[str, ...]
    check: GateFunction
    options: Mapping[str, float] = field(default_factory=dict)
    follows: tuple[str, ...] = ()

    def settings(self) -> Mapping[str, float]:
        """Every key that the configuration may set, with its default."""
        return {"enabled": 1.0, **self.options}


def warning(
    capture: Capture, code: str, message: str, remedy: str, rows: tuple[int, int] | None = None
) -> Finding:
    """A finding that lets the capture through.

    Parameters
    ----------
    capture
        The capture.
    code
        Short stable identifier, usually the gate's name.
    message
        What is doubtful.
    remedy
        What to do about it.
    rows
        First and last row concerned, from 0.

    """
    return Finding(capture.path, "warning", code, message + time_of(capture, rows), remedy, rows)


def time_of(capture: Capture, rows: tuple[int, int] | None) -> str:
    """The time of rows, by which one finds them where rows have no numbers; empty if unknown.

    Parameters
    ----------
    capture
        The capture.
    rows
        First and last row; None for none. Of a capture of several tables they are those of any.

    """
    if rows is None or len(capture.tables) != 1 or "t_s" not in capture.tables[0].columns:
        return ""
    t_s = capture.tables[0]["t_s"].to_numpy()
    if rows[1] >= t_s.size or not np.isfinite(t_s[list(rows)]).all():
        return ""
    first, last = (f"{t_s[row]:.6g}" for row in rows)
    return f" (at {first} s)" if rows[0] == rows[1] else f" ({first} to {last} s)"


def span_of(rows: Flags) -> tuple[int, int]:
    """First and last row that a mask marks.

    Parameters
    ----------
    rows
        Marked rows [n]; at least one.

    """
    where = np.flatnonzero(rows)
    return int(where[0]), int(where[-1])


def with_time(capture: Capture, fault: CaptureError) -> CaptureError:
    """A refusal whose message ends with the time of its rows.

    Parameters
    ----------
    capture
        That is refused.
    fault
        Why.

    """
    message = fault.message + time_of(capture, fault.rows)
    return CaptureError(fault.code, message, fault.remedy, fault.rows)
