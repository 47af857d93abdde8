"""Ticks of an axis as SVG: labels, and lines across the drawing where they are wanted."""

from __future__ import annotations

import numpy as np

from pipeline.report.charts.axis import Axis
from pipeline.report.charts.svg import text


def x_ticks(x: Axis, below: float, lines: tuple[float, float] | None = None) -> str:
    """Labels under a drawing that ends at `below` [px], with lines from the first to the second.

    Parameters
    ----------
    x
        The axis.
    below
        Where the drawing ends [px].
    lines
        From where to where lines go [px]; None for no lines.

    """
    return "".join(
        (f'<path class="grid" d="M{place:.1f} {lines[0]:.1f}V{lines[1]:.1f}"/>' if lines else "")
        + text("tick x", place, below + 15, label)
        for place, label in zip(x.pixels(np.array(x.ticks)).tolist(), x.labels(), strict=True)
    )


def y_ticks(y: Axis, left: float, right: float | None = None) -> str:
    """Labels left of a drawing that begins at `left` [px], with lines to `right`.

    Parameters
    ----------
    y
        The axis.
    left
        Where the drawing begins [px].
    right
        Where lines end [px]; None for no lines.

    """
    return "".join(
        (f'<path class="grid" d="M{left:.1f} {place:.1f}H{right:.1f}"/>' if right else "")
        + text("tick y", left - 5, place + 4, label)
        for place, label in zip(y.pixels(np.array(y.ticks)).tolist(), y.labels(), strict=True)
    )
