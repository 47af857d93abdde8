"""Views that several workspaces share: curves, bars, maps, pages, and their colours."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import rerun as rr
import rerun.blueprint as rrb
from rerun.blueprint import BarChartView, Blueprint, TextDocumentView, TimeSeriesView
from rerun.blueprint.components import LinkAxis
from rerun.blueprint.encodings import ComponentSourceKind, TextLogColumn, VisualizerComponentMapping

from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.stream import PACK, TIME, Colour, Tinted

# Tones that read on a dark and on a light ground.
MEASURED: Colour = (120, 144, 156)
MODEL: Colour = (255, 143, 0)
RESIDUAL: Colour = (229, 57, 53)
BASELINE: Colour = (30, 136, 229)
CANDIDATE: Colour = (255, 143, 0)
PALETTE: tuple[Colour, ...] = (
    MEASURED,
    (30, 136, 229),
    (67, 160, 71),
    (142, 36, 170),
    (0, 137, 123),
    (194, 24, 91),
)
AIR = 1.1
WIDE, NARROW = 2.6, 1.4
Panel = Literal["collapsed", "expanded", "hidden"]


@dataclass(frozen=True, slots=True)
class Line:
    """One curve: `component` of `entity`, and how it is drawn; `packed` as the trace is."""

    entity: str
    component: str
    name: str
    colour: Colour | Tinted
    width: float = NARROW
    packed: bool = False


@dataclass(frozen=True, slots=True)
class ViewPlan:
    """One time series view; `reach` locks its y axis to -reach..reach, `share` is its height.

    `around_s` makes it a loupe that shows so much time on each side of the cursor; `span` is the
    y axis to begin with. Over `rows` of a sequence instead of time the x axis is 0..rows.
    """

    name: str
    lines: tuple[Line, ...]
    share: float
    reach: float | None = None
    around_s: float | None = None
    span: tuple[float, float] | None = None
    rows: int | None = None


def time_view(plan: ViewPlan) -> TimeSeriesView:
    """A time series view of a plan; x axes of all but loupes move together.

    Parameters
    ----------
    plan
        What it shows.

    """
    axis_x: Any = rrb.archetypes.TimeAxis(link=LinkAxis.LinkToGlobal)
    ranges: Any = None
    if plan.around_s is not None:
        axis_x, ranges = _loupe(plan.around_s)
    if plan.rows is not None:
        axis_x = rows_axis(plan.rows)
    axis_y = None
    if plan.reach is not None:
        axis_y = rrb.archetypes.ScalarAxis(range=(-plan.reach, plan.reach), zoom_lock=True)
    elif plan.span is not None:
        axis_y = rrb.archetypes.ScalarAxis(range=plan.span)
    overrides: dict[Any, list[Any]] = {}
    for line in plan.lines:
        overrides.setdefault(line.entity, []).append(_curve(line))
    return rrb.TimeSeriesView(
        name=drawable(plan.name),
        origin="/",
        contents=list(overrides),
        axis_x=axis_x,
        axis_y=axis_y,
        plot_legend=rrb.Corner2D.RightTop,
        time_ranges=ranges,
        overrides=overrides,
    )


def rows_axis(rows: int) -> Any:
    """An x axis over all rows of a sequence; by itself the viewer shows those at the cursor.

    Parameters
    ----------
    rows
        How many.

    """
    first, last = (rr.TimeRangeBoundary.absolute(seq=place) for place in (0, max(rows, 1)))
    return rrb.archetypes.TimeAxis(view_range=rr.TimeRange(first, last))


def _loupe(around_s: float) -> tuple[Any, Any]:
    """An axis that follows the cursor, and the stretch of data that it needs."""
    before = rr.TimeRangeBoundary.cursor_relative(seconds=-around_s)
    after = rr.TimeRangeBoundary.cursor_relative(seconds=around_s)
    axis = rrb.archetypes.TimeAxis(view_range=rr.TimeRange(before, after), zoom_lock=True)
    return axis, [rr.VisibleTimeRange(TIME, start=before, end=after)]


def _curve(line: Line) -> Any:
    """A curve of one column; MinMax, since averaging would hide a spike."""
    mapping = VisualizerComponentMapping(
        target="Scalars:scalars",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component=PACK if line.packed else line.component,
        selector=f".{line.component}" if line.packed else None,
    )
    style = rr.SeriesLines(
        names=drawable(line.name),
        colors=line.colour,
        widths=line.width,
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    return style.visualizer(mappings=[mapping])


def bar_view(name: str, *entities: str, legend: bool = False) -> BarChartView:
    """Bars of some entities over one axis.

    Parameters
    ----------
    name
        Of the view.
    legend
        Whether the addresses of the entities are shown.
    *entities
        Where the bars lie.

    """
    return rrb.BarChartView(
        name=drawable(name),
        origin="/",
        contents=list(entities),
        plot_legend=rrb.PlotLegend(visible=legend),
    )


def page_view(entity: str, name: str) -> TextDocumentView:
    """A page of text.

    Parameters
    ----------
    entity
        Where it lies.
    name
        Of the view.

    """
    return rrb.TextDocumentView(origin=entity, name=drawable(name))


def findings_view(entity: str, name: str) -> Any:
    """A log whose lines say what was found; a click on one moves the cursor to its row.

    Parameters
    ----------
    entity
        Where it lies.
    name
        Of the view.

    """
    columns = [TextLogColumn("LogLevel"), TextLogColumn("Body")]
    return rrb.TextLogView(
        origin=entity,
        name=drawable(name),
        columns=rrb.TextLogColumns(text_log_columns=columns),
    )


def workspace(*tabs: Any, timeline: str | None, panel: Panel = "collapsed") -> Blueprint:
    """Tabs that fill the window, side panels hidden, the time line at the bottom.

    Parameters
    ----------
    timeline
        The active one; None for the viewer's choice.
    panel
        State of the time line's panel.
    *tabs
        The tabs.

    """
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state=panel, timeline=timeline, play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def stacked(plans: Sequence[ViewPlan], **more: Any) -> Any:
    """Views over time under each other, heights by their shares.

    Parameters
    ----------
    plans
        What they show.
    **more
        Further options of the container.

    """
    return rrb.Vertical(*map(time_view, plans), row_shares=[p.share for p in plans] or None, **more)
