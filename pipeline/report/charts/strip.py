"""Strip plots: one constant of many motors on one scale, a row a lot, so that a lot stands out."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from statistics import median

from pipeline.physics.notation import COVERAGE_FACTOR, reading
from pipeline.report.charts.axis import Axis, axis_for, padded, x_ticks
from pipeline.report.charts.svg import text

WIDTH, LEFT, RIGHT, ROW, TOP, BOTTOM = 340.0, 76.0, 14.0, 24.0, 6.0, 24.0
LABEL_CHARS = 10


@dataclass(frozen=True, slots=True)
class Dot:
    """One motor on a strip: value and standard uncertainty `u` in the constant's unit."""

    motor_id: str
    link: str
    status: str
    value: float
    u: float


def strip_plot(name: str, unit: str, rows: Sequence[tuple[str, Sequence[Dot]]]) -> str:
    """SVG of (lot, motors) rows: a dot a motor with its ±U, an orange stroke at the lot's median.

    `name` ends in its unit, from which the axis is built; dots link to their motors' pages.

    Parameters
    ----------
    name
        Name of the constant, ending in its unit.
    unit
        Unit that the numbers are shown in.
    rows
        Lot and dots of each row.

    """
    dots = [dot for _, members in rows for dot in members]
    reach = [(d.value - _expanded(d), d.value + _expanded(d)) for d in dots]
    low, high = min(r[0] for r in reach), max(r[1] for r in reach)
    x = axis_for(name, *padded(low, high, 0.04), LEFT, WIDTH - RIGHT, 3)
    bottom = TOP + ROW * len(rows)
    columns = x_ticks(x, bottom, (TOP, bottom))
    lots = "".join(_lot(x, unit, lot, members, i) for i, (lot, members) in enumerate(rows))
    return (
        f'<svg class="strip" viewBox="0 0 {WIDTH:g} {bottom + BOTTOM:g}" role="group" '
        f'aria-label="{escape(x.title)} by lot">{columns}{lots}</svg>'
    )


def _expanded(dot: Dot) -> float:
    return COVERAGE_FACTOR * dot.u if math.isfinite(dot.u) else 0.0


def _lot(x: Axis, unit: str, lot: str, members: Sequence[Dot], index: int) -> str:
    top = TOP + ROW * index
    middle = x.pixel(median(dot.value for dot in members))
    short = lot if len(lot) <= LABEL_CHARS else lot[: LABEL_CHARS - 1] + "…"
    dots = "".join(
        _dot(x, unit, dot, top + ROW * _spread(place, len(members)))
        for place, dot in enumerate(members)
    )
    return (
        text("lot", 4, top + ROW / 2 + 4, short, lot)
        + f'<path class="median" d="M{middle:.1f} {top + 2:.1f}v{ROW - 4:.1f}"/>{dots}'
    )


def _spread(place: int, count: int) -> float:
    """Height in its row [share] at which a dot is drawn, so that equal motors stay visible."""
    return 0.5 if count == 1 else 0.22 + 0.56 * (place % 5) / min(count - 1, 4)


def _dot(x: Axis, unit: str, dot: Dot, y: float) -> str:
    place, half = x.pixel(dot.value), abs(x.pixel(_expanded(dot)) - x.pixel(0.0))
    words = f"{dot.motor_id}: {reading(dot.value, dot.u, unit).text()}"
    return (
        f'<a href="{escape(dot.link)}"><title>{escape(words)}</title>'
        f'<path class="bar" d="M{place - half:.1f} {y:.1f}h{2 * half:.1f}"/>'
        f'<circle class="dot {escape(dot.status)}" cx="{place:.1f}" cy="{y:.1f}" r="3"/></a>'
    )
