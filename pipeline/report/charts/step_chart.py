"""The ladder in one picture: every signal's error over its noise floor, step by step."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping, Sequence

from pipeline.report.charts.svg import line, picture, text
from pipeline.views.names import quantity_words
from pipeline.views.table_text import shortened

WIDTH, HEIGHT, LEFT, TOP, BOTTOM = 760.0, 250.0, 56.0, 22.0, 44.0
LABEL_PITCH, COLOURS = 14.0, 6
LETTER, MOST_LEVELS, LONGEST = 6.3, 3, 30
END_LETTER = 8.2
"""Width of a letter of a signal's name where the chart is small and its letters are large [px]."""
LEAST = 1e-3


def step_chart(names: Sequence[str], over: Mapping[str, Sequence[float]]) -> str:
    """SVG of `over`, each signal's error over its noise floor [steps], on a logarithmic scale.

    `names` are the steps in words. The band below 1 is the noise floor. What is below `LEAST`
    stands at the foot with an arrow.

    Parameters
    ----------
    names
        The steps in words.
    over
        Error over noise floor of each signal [steps].

    """
    finite = [max(v, LEAST) for errors in over.values() for v in errors if math.isfinite(v)]
    if not finite or not names:
        return '<p class="empty">no errors to draw</p>'
    low = min(math.floor(math.log10(min(finite)) * 2) / 2, -0.5)
    high = max(math.ceil(math.log10(max(finite)) * 2) / 2, 0.5)
    bottom = TOP + HEIGHT
    ends = {name: shortened(quantity_words(name), LONGEST) for name in over}
    right = WIDTH - 24.0 - END_LETTER * max(map(len, ends.values()))

    def y(value: float) -> float:
        place = (math.log10(max(value, 10**low)) - low) / (high - low)
        return bottom - HEIGHT * place

    def x(step: int) -> float:
        return LEFT + (right - LEFT) * (step + 0.5) / len(names)

    parts = [
        f'<rect class="band" x="{LEFT:g}" y="{y(1.0):.1f}" width="{right - LEFT:g}" '
        f'height="{bottom - y(1.0):.1f}"/>'
    ]
    for decade in range(math.ceil(low), math.floor(high) + 1):
        place = y(10.0**decade)
        parts.append(f'<path class="grid" d="M{LEFT:g} {place:.1f}H{right:g}"/>')
        parts.append(text("tick y", LEFT - 6, place + 4, f"{10.0**decade:g}"))
    levels = _levels(names, right - LEFT)
    for step, name in enumerate(names):
        parts.append(text("tick x", x(step), bottom + 16 + LABEL_PITCH * (step % levels), name))
    parts += _lines(over, ends, x, y)
    parts += [
        text("tick x", x(n), bottom - 6, f"↓ {value:.1g}")
        for errors in over.values()
        for n, value in enumerate(errors)
        if value < LEAST
    ]
    words = "error over noise floor of every signal, step by step"
    title = text("title", 2, 12, "held-out error over noise floor")
    floor = text("tick", LEFT + 8, y(1.0) + 14, "noise floor")
    return picture("ladder", WIDTH, bottom + BOTTOM, words, title, floor, *parts)


def _levels(names: Sequence[str], wide: float) -> int:
    """Over how many lines the steps' words go in turn, so that neighbours do not meet."""
    pitch = wide / len(names)
    longest = LETTER * max(map(len, names))
    return min(math.ceil(longest / pitch), MOST_LEVELS, len(names))


def _lines(
    over: Mapping[str, Sequence[float]],
    words: Mapping[str, str],
    x: Callable[[int], float],
    y: Callable[[float], float],
) -> Iterator[str]:
    ends = sorted((y(values[-1]), name) for name, values in over.items())
    places: dict[str, float] = {}
    last = -math.inf
    for place, name in ends:
        last = max(place, last + LABEL_PITCH)
        places[name] = last
    lift = max(last - TOP - HEIGHT, 0.0)
    for number, (name, values) in enumerate(over.items()):
        curve = line(map(x, range(len(values))), map(y, values))
        dots = "".join(f"M{x(n):.1f} {y(v):.1f}h0" for n, v in enumerate(values))
        css = f"c{number % COLOURS}"
        yield f'<path class="{css}" d="{curve}"/><path class="{css} dots few" d="{dots}"/>'
        end, height = x(len(values) - 1) + 12, places[name] - lift + 4
        yield text(f"end t{number % COLOURS}", end, height, words[name], quantity_words(name))
