"""Torque against speed with its intervals, and the efficiency map, as inline SVG."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from html import escape

import numpy as np

from pipeline.physics.notation import quantity
from pipeline.records.performance import Curve, MapCell
from pipeline.report.charts.axis import Axis, axis_for, x_ticks, y_ticks
from pipeline.report.charts.svg import band, line, picture, text

WIDTH, LEFT, TOP, HEIGHT, BOTTOM, LEGEND = 560.0, 66.0, 22.0, 230.0, 40.0, 18.0
RIGHT, BAR, STEPS = 14.0, 12.0, 10
AIR = 1.08


def band_chart(curves: Sequence[Curve], y_name: str, regimes: Sequence[str] = ()) -> str:
    """SVG of curves over one x with their 95 % bands; empty for none.

    Parameters
    ----------
    curves
        The curves, over one x.
    y_name
        Name of the quantity, ending in its unit.
    regimes
        What limits the first curve at each x.

    """
    if not curves:
        return ""
    first = curves[0]
    top, lowest = max(max(one.high) for one in curves), min(min(one.low) for one in curves)
    # a curve that hardly moves is shown in its own range, not as a line under the frame's edge
    base = 0.0 if lowest < 0.5 * top else lowest - 0.5 * (top - lowest)
    x = axis_for(first.x_name, 0.0, max(first.x), LEFT, WIDTH - RIGHT, 6)
    y = axis_for(y_name, base, base + AIR * (top - base), TOP + HEIGHT, TOP, 5)
    marks = [y_ticks(y, LEFT, WIDTH - RIGHT), x_ticks(x, TOP + HEIGHT)]
    marks += _changes(first, regimes, x)
    for number, one in enumerate(curves):
        marks.append(_band(one, x, y, number + 1))
    if len(curves) > 1:
        marks += _legend(curves)
    words = f"{', '.join(one.words for one in curves)} over {x.title}"
    height = TOP + HEIGHT + BOTTOM + (LEGEND if len(curves) > 1 else 0.0)
    return picture("heat", WIDTH, height, words, *marks, _titles(x, y))


def _band(one: Curve, x: Axis, y: Axis, colour: int) -> str:
    at = x.pixels(np.array(one.x))
    low, high, value = (y.pixels(np.array(v)) for v in (one.low, one.high, one.value))
    area = band(at.tolist(), high.tolist(), low.tolist())
    return (
        f'<path class="range r{colour}" d="{area}"/><path class="c{colour}" d="{line(at, value)}"/>'
    )


def _changes(one: Curve, regimes: Sequence[str], x: Axis) -> Iterator[str]:
    """A stroke and a name where another limit takes over."""
    for k in range(1, len(regimes)):
        if regimes[k] != regimes[k - 1] and regimes[k] != "none":
            place = x.pixel(0.5 * (one.x[k - 1] + one.x[k]))
            yield (
                f'<path class="noise" d="M{place:.1f} {TOP:g}V{TOP + HEIGHT:g}"/>'
                + text("tick", place + 4, TOP + 12, regimes[k])
            )


def _legend(curves: Sequence[Curve]) -> list[str]:
    step = (WIDTH - LEFT) / len(curves)
    base = TOP + HEIGHT + BOTTOM + 6
    return [
        f'<path class="c{n + 1}" d="M{LEFT + n * step:.1f} {base:.1f}h18"/>'
        + text("tick", LEFT + n * step + 24, base + 4, one.words)
        for n, one in enumerate(curves)
    ]


def efficiency_chart(cells: Sequence[MapCell], envelope: Curve | None) -> str:
    """SVG of efficiency over speed and shaft torque, a cell an operating point; empty for none.

    Cells show speed, torque, efficiency and the losses by place on hover; the line is peak torque.

    Parameters
    ----------
    cells
        The operating points.
    envelope
        Peak torque over speed; None for none.

    """
    if not cells:
        return ""
    omegas = np.unique([c.omega_mech_rad_s for c in cells])
    wide = float(np.min(np.diff(omegas))) if omegas.size > 1 else float(omegas[0])
    torques = np.unique(np.round([c.torque_shaft_nm for c in cells], 9))
    tall = float(np.min(np.diff(torques))) if torques.size > 1 else float(torques[0])
    right = WIDTH - RIGHT - BAR - 52.0
    x = axis_for("omega_mech_rad_s", 0.0, float(omegas[-1]) + wide / 2, LEFT, right, 6)
    top = float(torques[-1]) + tall / 2
    y = axis_for("torque_shaft_nm", 0.0, top, TOP + HEIGHT, TOP, 5)
    low, high = min(c.efficiency for c in cells), max(c.efficiency for c in cells)
    low = min(max(low, 0.5), high - 0.05)
    marks = []
    for c in cells:
        across = x.pixels(np.array([c.omega_mech_rad_s - wide / 2, c.omega_mech_rad_s + wide / 2]))
        up = y.pixels(np.array([c.torque_shaft_nm - tall / 2, c.torque_shaft_nm + tall / 2]))
        share = (c.efficiency - low) / (high - low)
        marks.append(
            f'<rect fill="{heat_colour(share)}" x="{across[0]:.1f}" y="{up[1]:.1f}" '
            f'width="{across[1] - across[0] + 0.3:.1f}" height="{up[0] - up[1] + 0.3:.1f}">'
            f"<title>{escape(_cell_title(c))}</title></rect>"
        )
    if envelope is not None:
        within = np.array(envelope.value) <= top
        speeds, peaks = np.array(envelope.x)[within], np.array(envelope.value)[within]
        marks.append(f'<path class="ink" d="{line(x.pixels(speeds), y.pixels(peaks))}"/>')
    marks += [x_ticks(x, TOP + HEIGHT), y_ticks(y, LEFT), *_scale(low, high, right)]
    best = max(cells, key=lambda c: c.efficiency)
    words = f"efficiency over speed and torque, best {100 * best.efficiency:.1f} %"
    return picture("heat", WIDTH, TOP + HEIGHT + BOTTOM, words, *marks, _titles(x, y, right))


def heat_colour(share: float) -> str:
    """Hexadecimal colour of a share from 0 (dark blue) over green to 1 (yellow), of even steps in
    lightness; shares beyond are the ends.

    Parameters
    ----------
    share
        From 0 to 1 [1].

    """
    stops = np.array([(68, 1, 84), (59, 82, 139), (33, 145, 140), (94, 201, 98), (253, 231, 37)])
    place = min(max(share, 0.0), 1.0) * (len(stops) - 1)
    at = min(int(place), len(stops) - 2)
    mixed = stops[at] + (stops[at + 1] - stops[at]) * (place - at)
    return "#" + "".join(f"{round(float(c)):02x}" for c in mixed)


def _cell_title(c: MapCell) -> str:
    parts = [
        f"{c.omega_mech_rad_s:.4g} rad/s, {quantity(c.torque_shaft_nm, 'N·m', 3)}",
        f"{100 * c.efficiency:.2f} % ({100 * c.low:.2f} to {100 * c.high:.2f})",
        f"copper {quantity(c.copper_w, 'W', 3)}",
        f"friction, windage and iron {quantity(c.rotation_w, 'W', 3)}",
    ]
    if c.inverter_w is not None:
        parts.append(f"inverter {quantity(c.inverter_w, 'W', 3)}")
    return ", ".join(parts)


def _scale(low: float, high: float, right: float) -> list[str]:
    left, step = right + 10.0, HEIGHT / STEPS
    bars = [
        f'<rect fill="{heat_colour((n + 0.5) / STEPS)}" x="{left:.1f}" '
        f'y="{TOP + (STEPS - 1 - n) * step:.1f}" width="{BAR:g}" height="{step + 0.3:.1f}"/>'
        for n in range(STEPS)
    ]
    ends = ((high, TOP + 9.0), (0.5 * (low + high), TOP + HEIGHT / 2 + 4), (low, TOP + HEIGHT))
    return bars + [text("tick", left + BAR + 4, y, f"{100 * share:.0f} %") for share, y in ends]


def _titles(x: Axis, y: Axis, right: float = WIDTH - RIGHT) -> str:
    below = text("title x", (LEFT + right) / 2, TOP + HEIGHT + 32, x.title)
    return below + text("title", 2, TOP - 8, y.title)
