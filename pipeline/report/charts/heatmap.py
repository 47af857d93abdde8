"""Error maps as inline SVG: cells from blue over white to red, and bars over an angle."""

from __future__ import annotations

import math
from collections.abc import Iterator
from html import escape

import numpy as np

from pipeline.physics.notation import quantity
from pipeline.records.error_map import ErrorMap
from pipeline.report.charts.axis import axis_for, symmetric_axis, x_ticks, y_ticks
from pipeline.report.charts.chart import Panel
from pipeline.report.charts.svg import picture, text
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
    return picture(
        "heat",
        WIDTH,
        TOP + HEIGHT + BOTTOM,
        words,
        f'<rect class="gap" {frame}/>',
        *_cells(error_map, reach, panel),
        f'<rect class="frame" {frame}/>',
        _ticks(panel),
        _scale_bar(error_map, reach, right),
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
    titles = text("title x", (x.start + x.end) / 2, y.start + 31, x.title)
    titles += text("title", 2, y.end - 7, y.title)
    return x_ticks(x, y.start) + y_ticks(y, x.start) + titles


def _scale_bar(error_map: ErrorMap, reach: float, right: float) -> str:
    """The colours of −reach to reach, with both ends and zero named."""
    left, step = right + BAR_GAP, HEIGHT / (2 * STEPS + 1)
    parts = [
        f'<rect fill="{colour(n / STEPS)}" x="{left:.1f}" y="{TOP + (STEPS - n) * step:.1f}" '
        f'width="{BAR:g}" height="{step + 0.3:.1f}"/>'
        for n in range(-STEPS, STEPS + 1)
    ]
    for error, place in ((reach, TOP + 8), (0.0, TOP + HEIGHT / 2 + 4), (-reach, TOP + HEIGHT)):
        number = quantity(error, error_map.unit, 2) if error else "0"
        parts.append(text("tick", left + BAR + 4, place, number))
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
    return picture(
        "heat",
        WIDTH,
        TOP + ANGLE_HEIGHT + BOTTOM,
        words,
        y_ticks(y, x.start, x.end),
        x_ticks(x, y.start),
        f'<path class="bars residual" d="{marks}"/>',
        text("title x", (LEFT + WIDTH - 14) / 2, TOP + ANGLE_HEIGHT + 31, f"{turn} angle [°]"),
        text("title", 2, TOP - 7, f"mean error [{y.scale.unit}]"),
    )
