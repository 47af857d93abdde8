"""Error maps as inline SVG: cells from blue over white to red, and bars over an angle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from html import escape

import numpy as np

from pipeline.physics.notation import quantity
from pipeline.records.error_map import ErrorMap
from pipeline.report.charts.axis import Axis, axis_for, symmetric_axis
from pipeline.report.charts.chart import Panel
from pipeline.report.charts.ticks import x_ticks, y_ticks
from pipeline.views.names import quantity_words

WIDTH, LEFT, TOP, HEIGHT, BOTTOM = 400.0, 52.0, 20.0, 180.0, 38.0
BAR, BAR_GAP, BAR_LABELS = 12.0, 12.0, 70.0
STEPS, ANGLE_HEIGHT = 12, 84.0
SURE = 0.05
_COLD, _WARM, _NEUTRAL = (33, 102, 172), (178, 24, 43), 247


def colour(share: float) -> str:
    """Hexadecimal colour of a share from −1 (blue) over 0 (white) to 1 (red).

    Parameters
    ----------
    share
        From −1 to 1 [1].

    """
    end = _WARM if share > 0 else _COLD
    strength = min(abs(share), 1.0)
    return "#" + "".join(f"{round(_NEUTRAL + (c - _NEUTRAL) * strength):02x}" for c in end)


def heatmap(error_map: ErrorMap, reach: float) -> str:
    """SVG of a map of x and y; `reach` [unit] is full colour. Cells show their numbers on hover.

    A dot marks a cell whose mean chance does not make: p below 0.05 over the number of cells.

    Parameters
    ----------
    error_map
        The map.
    reach
        Value at full colour or at the axis' end [unit of the map].

    Raises
    ------
    ValueError
        A map of one variable.

    """
    if error_map.y is None:
        raise ValueError("a heat map needs two variables")
    right = WIDTH - BAR_GAP - BAR - BAR_LABELS
    panel = Panel(
        axis_for(error_map.x.variable, error_map.x.edges[0], error_map.x.edges[-1], LEFT, right, 5),
        axis_for(
            error_map.y.variable, error_map.y.edges[0], error_map.y.edges[-1], TOP + HEIGHT, TOP, 5
        ),
    )
    frame = f'x="{LEFT:g}" y="{TOP:g}" width="{right - LEFT:g}" height="{HEIGHT:g}"'
    largest = quantity(error_map.reach, error_map.unit, 3)
    words = f"{error_map.signal} over speed and current, largest {largest}"
    return (
        f'<svg class="heat" viewBox="0 0 {WIDTH:g} {TOP + HEIGHT + BOTTOM:g}" role="img" '
        f'aria-label="{escape(words)}"><rect class="gap" {frame}/>'
        f"{''.join(_cells(error_map, reach, panel))}"
        f'<rect class="frame" {frame}/>{_ticks(panel)}{_scale_bar(error_map, reach, right)}</svg>'
    )


def _cells(error_map: ErrorMap, reach: float, panel: Panel) -> Iterator[str]:
    y = error_map.y or error_map.x
    across, down = panel.place(np.array(error_map.x.edges), np.array(y.edges))
    for row, column in zip(*np.nonzero(np.isfinite(error_map.mean)), strict=True):
        left, right, low, high = *across[column : column + 2], *down[row : row + 2]
        mean, p_value = float(error_map.mean[row, column]), float(error_map.p_value[row, column])
        hover = f"{quantity(mean, error_map.unit, 3)}, n {error_map.count[row, column]}"
        hover += "" if math.isnan(p_value) else f", p {p_value:.2g}"
        sure = p_value * int(np.isfinite(error_map.mean).sum()) < SURE
        mark = f'<path class="sure" d="M{(left + right) / 2:.1f} {(low + high) / 2:.1f}h0"/>'
        yield (
            f'<g><title>{escape(hover)}</title><rect fill="{colour(mean / reach if reach else 0)}" '
            f'x="{left:.1f}" y="{high:.1f}" width="{right - left + 0.3:.1f}" '
            f'height="{low - high + 0.3:.1f}"/>{mark if sure else ""}</g>'
        )


def _ticks(panel: Panel) -> str:
    x, y = panel.x, panel.y
    marks = [x_ticks(x, y.start), y_ticks(y, x.start)]
    middle = (x.start + x.end) / 2
    marks.append(
        f'<text class="title x" x="{middle:.1f}" y="{y.start + 31:.1f}">{escape(x.title)}</text>'
    )
    return (
        "".join(marks) + f'<text class="title" x="2" y="{y.end - 7:.1f}">{escape(y.title)}</text>'
    )


def _scale_bar(error_map: ErrorMap, reach: float, right: float) -> str:
    """The colours of −reach to reach, with both ends and zero named."""
    left, step = right + BAR_GAP, HEIGHT / (2 * STEPS + 1)
    parts = [
        f'<rect fill="{colour(n / STEPS)}" x="{left:.1f}" y="{TOP + (STEPS - n) * step:.1f}" '
        f'width="{BAR:g}" height="{step + 0.3:.1f}"/>'
        for n in range(-STEPS, STEPS + 1)
    ]
    for value, place in ((reach, TOP + 8), (0.0, TOP + HEIGHT / 2 + 4), (-reach, TOP + HEIGHT)):
        text = quantity(value, error_map.unit, 2) if value else "0"
        parts.append(
            f'<text class="tick" x="{left + BAR + 4:.1f}" y="{place:.1f}">{escape(text)}</text>'
        )
    return "".join(parts)


def angle_bars(error_map: ErrorMap, reach: float) -> str:
    """SVG of a signal's mean error over one turn, on an axis from −reach to reach [unit].

    Parameters
    ----------
    error_map
        The map.
    reach
        Value at full colour or at the axis' end [unit of the map].

    """
    x = axis_for("theta_deg", 0.0, 360.0, LEFT, WIDTH - 14.0, 4)
    y = symmetric_axis(error_map.signal, 1.05 * reach, TOP + ANGLE_HEIGHT, TOP)
    edges = x.pixels(np.degrees(np.array(error_map.x.edges)))
    base = y.pixel(0.0)
    marks = "".join(
        f"M{left:.1f} {base:.1f}V{top:.1f}H{right:.1f}V{base:.1f}Z"
        for left, right, top, mean in zip(
            edges[:-1],
            edges[1:],
            y.pixels(np.nan_to_num(error_map.mean)),
            error_map.mean,
            strict=True,
        )
        if not math.isnan(mean)
    )
    turn = "electrical" if error_map.x.variable == "theta_elec_rad" else "mechanical"
    words = f"{quantity_words(error_map.signal)} over the {turn} angle [°]"
    return (
        f'<svg class="heat" viewBox="0 0 {WIDTH:g} {TOP + ANGLE_HEIGHT + BOTTOM:g}" role="img" '
        f'aria-label="{escape(words)}">{_angle_frame(x, y)}'
        f'<path class="bars residual" d="{marks}"/>'
        f'<text class="title x" x="{(LEFT + WIDTH - 14) / 2:.1f}" '
        f'y="{TOP + ANGLE_HEIGHT + 31:.1f}">{turn} angle [°]</text>'
        f'<text class="title" x="2" y="{TOP - 7:.1f}">mean error [{escape(y.scale.unit)}]</text>'
        "</svg>"
    )


def _angle_frame(x: Axis, y: Axis) -> str:
    return y_ticks(y, x.start, x.end) + x_ticks(x, y.start)
