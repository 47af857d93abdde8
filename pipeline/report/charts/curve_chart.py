"""The sketch of an unknown structure: a curve over one variable with its 95 % band."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.physics.notation import scale_for
from pipeline.records.diagnosis import CurvePoint
from pipeline.report.charts.axis import axis_for, padded, x_ticks, y_ticks
from pipeline.report.charts.svg import band, line, picture, text

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
    places = x.pixels(at).tolist()
    area = band(places, y.pixels(high).tolist(), y.pixels(low).tolist())
    return picture(
        "heat",
        WIDTH,
        TOP + HEIGHT + BOTTOM,
        f"what is left over {variable}",
        x_ticks(x, TOP + HEIGHT),
        y_ticks(y, LEFT, WIDTH - RIGHT),
        f'<path class="band" d="{area}"/>'
        f'<path class="fitted" d="{line(places, y.pixels(value).tolist())}"/>',
        text("title x", (LEFT + WIDTH - RIGHT) / 2, TOP + HEIGHT + 32, x.title),
        text("title", 2, TOP - 7, f"{title} [{scale.unit or '1'}]"),
    )
