"""What a gate is: one file in `gates/`, one `GATE`, found by the registry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from pipeline.records.capture import Capture, Mask
from pipeline.records.finding import Finding


@dataclass(frozen=True, slots=True)
class Passed:
    """What a gate says of a capture that it lets through: rows set aside, and warnings."""

    masks: tuple[Mask, ...] = ()
    findings: tuple[Finding, ...] = ()


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
    return Finding(capture.path, "warning", code, message, remedy, rows)


def span_of(rows: NDArray[np.bool_]) -> tuple[int, int]:
    """First and last row that a mask marks.

    Parameters
    ----------
    rows
        Marked rows [n]; at least one.

    """
    where = np.flatnonzero(rows)
    return int(where[0]), int(where[-1])
