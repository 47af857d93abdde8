"""Drag over inertia of coasts, with what its change with time makes of it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.mechanical.drag_forms import DRAG_FORMS
from pipeline.estimation.mechanical.drag_over_time import DragOverTime, drag_over_time
from pipeline.estimation.mechanical.shaft_rows import shaft_rows
from pipeline.estimation.method import Method
from pipeline.estimation.protocol import Fit
from pipeline.records.capture import Capture

ENCODER = ("eccentric cos", "eccentric sin", "unbalance cos", "unbalance sin")
ONE_COAST = (
    "one coast has one speed at every time: friction that changes with time would look as one that "
    "changes with speed"
)


def by_time(
    method: Method, solution: Fit, captures: Sequence[Capture], forms: Sequence[str], level: float
) -> Fit:
    """The constants of coasts, with what start and end of the coasts differ by.

    Parameters
    ----------
    method
        Whose constants they are.
    solution
        T_c/J [rad/s²] and B/J [1/s] by a drag that goes by speed, and perhaps by sense.
    captures
        The coasts.
    forms
        Further forms of drag over speed in it, of `DRAG_FORMS`.
    level
        Chance of a change that is none [1].

    Returns
    -------
    Fit
        Without a value of a drag that had most of its change still before it when the coasts ended.
        The note of a single coast says what it cannot tell.

    """
    over_time = _over_time(captures, forms, level)
    if over_time is None and len(captures) > 1:
        return solution
    estimates = []
    for place, one in enumerate(solution.estimates):
        if not one.known:
            estimates.append(one)
        elif over_time is None:
            estimates.append(replace(one, note=f"{one.note}; {ONE_COAST}"))
        elif over_time.is_open(place):
            estimates.append(method.missing(one.name, over_time.words))
        else:
            part = over_time.part(place, one.number, 1.0, f"{method.name}:{one.name}:time")
            notes = f"{over_time.words}; {one.note}"
            estimates.append(replace(one, budget=(*one.budget, part), note=notes))
    return replace(solution, estimates=tuple(estimates))


def _over_time(
    captures: Sequence[Capture], forms: Sequence[str], level: float
) -> DragOverTime | None:
    """The change of the drag with time, where the coasts show one."""
    rows = shaft_rows(captures, DRAG_FORMS)
    if rows is None:
        return None
    law = np.column_stack([-rows.sense, -rows.speed_rad_s])
    beside = np.column_stack([rows.columns[name] for name in ENCODER])
    of_speed = np.column_stack([law, *(-rows.columns[name] for name in forms), beside])
    return drag_over_time(rows, law, beside, (of_speed,), level)
