"""The sketch of an unknown structure: a curve over one variable with its 95 % band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from html import escape

import numpy as np

from pipeline.physics.notation import scale_for
from pipeline.records.diagnosis import CurvePoint
from pipeline.report.charts.axis import axis_for, padded
from pipeline.report.charts.ticks import x_ticks

WIDTH, LEFT, RIGHT, TOP, HEIGHT, BOTTOM = 560.0, 62.0, 14.0, 20.0, 200.0, 38.0


def curve_chart(variable: str, title: str, unit: str, points: Sequence[CurvePoint]) -> str:
    """SVG of a curve with its band.

    Parameters
    ----------
    variable
        Name of the variable across.
    title
        What the values are.
    unit
        Unit of the values.
    points
        Points in order of `at`.

    """
    at, value, low, high = (
        np.array([getattr(one, name) for one in points]) for name in ("at", "value", "low", "high")
    )
    x = axis_for(variable, float(at.min()), float(at.max()), LEFT, WIDTH - RIGHT, 6)
    reach = padded(min(float(low.min()), 0.0), max(float(high.max()), 0.0))
    scale = scale_for(max(abs(reach[0]), abs(reach[1])), unit)
    y = replace(axis_for("curve", *reach, TOP + HEIGHT, TOP, 4), scale=scale)
    x_px, up, down = x.pixels(at), y.pixels(high).tolist(), y.pixels(low).tolist()
    places = x_px.tolist()
    outline = [*zip(places, up, strict=True), *zip(places[::-1], down[::-1], strict=True)]
    band = "M" + "L".join(f"{px:.1f} {py:.1f}" for px, py in outline) + "Z"
    curve = zip(places, y.pixels(value).tolist(), strict=True)
    line = "M" + "L".join(f"{px:.1f} {py:.1f}" for px, py in curve)
    marks = [x_ticks(x, TOP + HEIGHT)]
    for tick, label in zip(y.ticks, y.labels(), strict=True):
        place = y.pixel(tick)
        marks.append(f'<path class="grid" d="M{LEFT:g} {place:.1f}H{WIDTH - RIGHT:g}"/>')
        marks.append(f'<text class="tick y" x="{LEFT - 5:g}" y="{place + 4:.1f}">{label}</text>')
    return (
        f'<svg class="heat" viewBox="0 0 {WIDTH:g} {TOP + HEIGHT + BOTTOM:g}" role="img" '
        f'aria-label="what is left over {escape(variable)}">{"".join(marks)}'
        f'<path class="band" d="{band}"/><path class="fitted" d="{line}"/>'
        f'<text class="title x" x="{(LEFT + WIDTH - RIGHT) / 2:.1f}" '
        f'y="{TOP + HEIGHT + 32:.1f}">{escape(x.title)}</text>'
        f'<text class="title" x="2" y="{TOP - 7:.1f}">{escape(title)} '
        f"[{escape(scale.unit or '1')}]</text></svg>"
    )
