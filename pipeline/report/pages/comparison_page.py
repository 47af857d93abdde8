"""The page of one comparison: errors before and after, where they live, earlier ones."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pipeline.records.comparison import Comparison, Trace
from pipeline.records.comparison_history import Earlier
from pipeline.records.evidence import Evidence, Series
from pipeline.report.charts.chart import chart
from pipeline.report.charts.heatmap import angle_bars, heatmap
from pipeline.report.pages.page import Link, link_block, render
from pipeline.views.comparison import KINDS, comparison_view, ratio_of, signal_title
from pipeline.views.constants import sentence
from pipeline.views.ladder import CURRENT, SPEED, angle_of
from pipeline.views.names import in_words, quantity_words


@dataclass(frozen=True, slots=True)
class Figure:
    """One drawing with its words; `path` names the capture."""

    title: str
    caption: str
    path: str
    svg: str


def render_comparison(
    result: Comparison, earlier: Sequence[Earlier] = (), links: Sequence[Link] = ()
) -> str:
    """The self-contained HTML page of one comparison; equal input gives equal text.

    Parameters
    ----------
    result
        The comparison.
    earlier
        Comparisons of the same motor before this one.
    links
        Links to other pages.

    """
    view = comparison_view(result)
    return render(
        "comparison.html.jinja",
        result=result,
        view=view,
        headline=sentence(view.headline),
        links=link_block(links),
        title_of=signal_title,
        places=[in_words(place) for place in view.places],
        maps=_maps(result),
        traces=[_trace(one) for one in _worst_traces(result)],
        earlier=earlier,
    )


def _maps(result: Comparison) -> list[Figure]:
    """Each signal's error over speed and current, and over the angle of a turn."""
    pictures = []
    for signal in dict.fromkeys(one.signal for one in result.maps):
        own = [one for one in result.maps if one.signal == signal]
        flat = next((one for one in own if one.variables == (SPEED, CURRENT)), None)
        turn = next((one for one in own if one.variables == (angle_of(signal),)), None)
        svg = "" if flat is None else heatmap(flat, flat.reach)
        svg += "" if turn is None else angle_bars(turn, turn.reach)
        if svg:
            pictures.append(Figure(quantity_words(signal), "mean error", "", svg))
    return pictures


def _worst_traces(result: Comparison) -> list[Trace]:
    """Of each signal and kind the trace of the capture that is farthest over its floor: without
    what was added, where anything was.
    """
    ratios = {(e.signal, e.kind, e.capture): ratio_of(e) for e in (*result.errors, *result.before)}
    worst: dict[tuple[str, str], Trace] = {}
    for one in result.traces:
        key = (one.signal, one.kind)
        best = worst.get(key)
        if best is None or _ratio(one, ratios) > _ratio(best, ratios):
            worst[key] = one
    return list(worst.values())


def _ratio(trace: Trace, ratios: Mapping[Any, float]) -> float:
    return ratios.get((trace.signal, trace.kind, trace.capture), 0.0)


def _trace(trace: Trace) -> Figure:
    before = np.empty(0) if trace.before is None else trace.before
    series = (Series("", trace.t_s, trace.measured, trace.model, before),)
    drawn = Evidence(
        "", quantity_words(trace.signal), "t_s", trace.signal, "line", series, trace.capture
    )
    how = "held out" if trace.split == "held_out" else "in the fit"
    caption = f"model {KINDS[trace.kind]}, {how}"
    return Figure(quantity_words(trace.signal), caption, trace.capture, chart(drawn))
