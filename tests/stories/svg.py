"""A few plain drawings as SVG: panels with axes, dots, lines and bars."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from html import escape

import numpy as np

INK, GRID, PAPER = "#3b3f46", "#e3e5e8", "#ffffff"
COLOURS = ("#3566a8", "#c8553d", "#5b8e55", "#8a6bb1", "#c79a2b")
LEFT, TOP, BOTTOM = 64.0, 34.0, 44.0
FONT = "font-family='Helvetica,Arial,sans-serif'"


@dataclass
class Panel:
    """One rectangle with axes; marks are kept in data units and placed when it is drawn."""

    title: str
    x_title: str
    y_title: str
    log: bool = False
    marks: list[tuple[str, np.ndarray, np.ndarray, str]] = field(default_factory=list)
    names: list[tuple[str, str]] = field(default_factory=list)
    x_labels: tuple[str, ...] = ()
    below: bool = False
    notes: list[tuple[float, float, str]] = field(default_factory=list)

    def add(self, kind: str, x, y, colour: str, name: str = "") -> None:
        """`dots`, `line` or `bars` of points [n]."""
        self.marks.append((kind, np.asarray(x, float), np.asarray(y, float), colour))
        if name:
            self.names.append((name, colour))

    def drawn(self, left: float, top: float, width: float, height: float) -> str:
        """SVG of the panel in a rectangle of pixels."""
        x_low, x_high, y_low, y_high = self._ranges()

        def px(x):
            return left + (x - x_low) / (x_high - x_low) * width

        def py(y):
            if self.log:
                y = np.log10(np.maximum(y, 10.0**y_low))
            return top + height - (y - y_low) / (y_high - y_low) * height

        parts = [
            f"<text x='{left:.0f}' y='{top - 12:.0f}' font-size='14' fill='{INK}' "
            f"font-weight='bold'>{escape(self.title)}</text>"
        ]
        parts += self._axes(left, top, width, height, px, py, (x_low, x_high, y_low, y_high))
        for kind, x, y, colour in self.marks:
            parts.append(_mark(kind, px(x), py(y), colour, top + height))
        for x, y, text in self.notes:
            parts.append(_text(float(px(np.array(x))), float(py(np.array(y))) - 5, text, "middle"))
        for n, (name, colour) in enumerate(self.names):
            first = top + height - 15 * len(self.names) if self.below else top
            at = first + 12 + 15 * n
            parts.append(
                f"<rect x='{left + width - 11:.1f}' y='{at - 8:.1f}' width='9' height='9' "
                f"fill='{colour}'/>" + _text(left + width - 15, at, name, "end")
            )
        return "".join(parts)

    def _ranges(self) -> tuple[float, float, float, float]:
        xs = np.concatenate([x for _, x, _, _ in self.marks])
        ys = np.concatenate([y for _, _, y, _ in self.marks])
        bars = any(kind == "bars" for kind, *_ in self.marks)
        x_low, x_high = float(xs.min()), float(xs.max())
        air = 0.6 if self.x_labels else 0.02 * (x_high - x_low)
        if self.log:
            ys = np.log10(ys[ys > 0])
            return x_low - air, x_high + air, math.floor(ys.min()), float(ys.max()) + 0.25
        low, high = float(ys.min()), float(ys.max())
        low = min(low, 0.0) if bars else low
        room = 0.08 * (high - low)
        return x_low - air, x_high + air, low if bars and low == 0.0 else low - room, high + room

    def _axes(self, left, top, width, height, px, py, ranges) -> list[str]:
        x_low, x_high, y_low, y_high = ranges
        parts = []
        if self.log:
            ticks = [10.0**e for e in range(math.ceil(y_low), math.floor(y_high) + 1)]
        else:
            ticks = _ticks(y_low, y_high)
        for tick in ticks:
            y = float(py(np.array(tick)))
            parts.append(
                f"<line x1='{left}' x2='{left + width}' y1='{y:.1f}' y2='{y:.1f}' stroke='{GRID}'/>"
                + _text(left - 6, y + 4, f"{tick:g}", "end")
            )
        labels = (
            list(enumerate(self.x_labels))
            if self.x_labels
            else [(tick, f"{tick:g}") for tick in _ticks(x_low, x_high)]
        )
        for at, label in labels:
            parts.append(_text(float(px(np.array(float(at)))), top + height + 16, label, "middle"))
        parts.append(
            f"<rect x='{left}' y='{top}' width='{width}' height='{height}' fill='none' "
            f"stroke='{INK}' stroke-width='0.8'/>"
        )
        parts.append(_text(left + width / 2, top + height + 34, self.x_title, "middle"))
        parts.append(
            f"<text transform='translate({left - 50:.0f} {top + height / 2:.0f}) rotate(-90)' "
            f"font-size='12' fill='{INK}' text-anchor='middle'>{escape(self.y_title)}</text>"
        )
        return parts


def _mark(kind: str, x: np.ndarray, y: np.ndarray, colour: str, floor: float) -> str:
    if kind == "line":
        points = " ".join(f"{a:.1f},{b:.1f}" for a, b in zip(x, y, strict=True))
        return f"<polyline points='{points}' fill='none' stroke='{colour}' stroke-width='1.6'/>"
    if kind == "dots":
        return "".join(
            f"<circle cx='{a:.1f}' cy='{b:.1f}' r='2.2' fill='{colour}' fill-opacity='0.75'/>"
            for a, b in zip(x, y, strict=True)
        )
    return "".join(
        f"<rect x='{a - 9:.1f}' y='{min(b, floor):.1f}' width='18' height='{abs(floor - b):.1f}' "
        f"fill='{colour}'/>"
        for a, b in zip(x, y, strict=True)
    )


def _text(x: float, y: float, text: str, anchor: str) -> str:
    return (
        f"<text x='{x:.1f}' y='{y:.1f}' font-size='12' fill='{INK}' "
        f"text-anchor='{anchor}'>{escape(text)}</text>"
    )


def _ticks(low: float, high: float) -> list[float]:
    rough = (high - low) / 5
    power = 10.0 ** math.floor(math.log10(rough))
    step = next(m * power for m in (1, 2, 5, 10) if m * power >= rough)
    first = math.ceil(low / step)
    return [round(n * step, 12) for n in range(first, math.floor(high / step) + 1)]


def page(panels: Sequence[Panel], width: float = 460.0, height: float = 290.0) -> str:
    """Panels side by side as one SVG document."""
    full = (LEFT + width + 24) * len(panels)
    tall = TOP + height + BOTTOM
    body = "".join(
        panel.drawn(LEFT + n * (LEFT + width + 24), TOP, width, height)
        for n, panel in enumerate(panels)
    )
    return (
        f"<svg xmlns='http://www.w3.org/2000/svg' viewBox='0 0 {full:.0f} {tall:.0f}' {FONT}>"
        f"<rect width='100%' height='100%' fill='{PAPER}'/>{body}</svg>\n"
    )
