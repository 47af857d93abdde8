"""How a recording of one capture is laid out in the viewer."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from pipeline.physics.glossary import suffix_of
from pipeline.physics.units import SUFFIX_UNITS

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint, TimeSeriesView

    from pipeline.io.recording import FitTrace, Trace

Colour = tuple[int, int, int]
MEASURED: Colour = (120, 144, 156)
MODEL: Colour = (255, 143, 0)
RESIDUAL: Colour = (229, 57, 53)
PALETTE: tuple[Colour, ...] = (
    MEASURED,
    (30, 136, 229),
    (67, 160, 71),
    (142, 36, 170),
    (0, 137, 123),
    (194, 24, 91),
)
MOST_FITS, MOST_GROUPS = 3, 5
AIR = 1.1


@dataclass(frozen=True, slots=True)
class Line:
    """One curve: `component` of `entity`, and how it is drawn."""

    entity: str
    component: str
    name: str
    colour: Colour


@dataclass(frozen=True, slots=True)
class ViewPlan:
    """One time series view; `reach` locks its y axis to -reach..reach, `share` is its height."""

    name: str
    lines: tuple[Line, ...]
    share: float
    reach: float | None = None


def planned_views(traces: Sequence[Trace], fits: Sequence[FitTrace]) -> tuple[ViewPlan, ...]:
    """Fitted quantities with their residuals first, all other columns by unit after them."""
    views = []
    quantities = list(dict.fromkeys((fit.title, fit.y_name) for fit in fits))[:MOST_FITS]
    for title, y_name in quantities:
        own = [fit for fit in fits if (fit.title, fit.y_name) == (title, y_name)]
        views += [_fit_view(title, y_name, own, traces), _residual_view(y_name, own)]
    groups = _by_unit(traces, {y_name for _, y_name in quantities})
    views += [_group_view(unit, columns) for unit, columns in list(groups.items())[:MOST_GROUPS]]
    return tuple(views)


def capture_layout(traces: Sequence[Trace], fits: Sequence[FitTrace]) -> Blueprint:
    """The planned views at the left, datasheet and findings at the right, x axes linked."""
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    plans = planned_views(traces, fits)
    side = rrb.Vertical(
        rrb.TextDocumentView(origin="/datasheet", name="Datasheet"),
        rrb.TextLogView(
            origin="/findings",
            name="Findings of this capture",
            columns=rrb.TextLogColumns(
                text_log_columns=[TextLogColumn("LogLevel"), TextLogColumn("Body")]
            ),
        ),
        row_shares=[3.0, 1.0],
    )
    plots = rrb.Vertical(*map(time_view, plans), row_shares=[plan.share for plan in plans] or None)
    return rrb.Blueprint(
        rrb.Horizontal(plots, side, column_shares=[2.4, 1.0]),
        rrb.TimePanel(state="collapsed", timeline=traces[0].index if traces else None),
        auto_views=False,
        auto_layout=False,
        collapse_panels=True,
    )


def _fit_view(
    title: str, y_name: str, fits: Sequence[FitTrace], traces: Sequence[Trace]
) -> ViewPlan:
    """Measured under model; the measured trace is the whole column where the capture has it."""
    home = next((trace for trace in traces if y_name in trace.columns), None)
    if home is None:
        measured = [
            Line(f.trace.entity, "measured", f"measured{_after(f, fits)}", MEASURED) for f in fits
        ]
    else:
        measured = [Line(home.entity, y_name, "measured", MEASURED)]
    models = [Line(f.trace.entity, "fitted", f"model{_after(f, fits)}", MODEL) for f in fits]
    return ViewPlan(f"{title}: {named(y_name)}", (*measured, *models), 3.0)


def _residual_view(y_name: str, fits: Sequence[FitTrace]) -> ViewPlan:
    """What is left over, on an axis that is symmetric and stays so."""
    reach = AIR * max(fit.reach for fit in fits) or 1.0
    lines = [
        Line(f.trace.entity, "residual", f"measured − model{_after(f, fits)}", RESIDUAL)
        for f in fits
    ]
    return ViewPlan(f"{named(y_name)}, measured − model", tuple(lines), 1.6, reach)


def _after(fit: FitTrace, fits: Sequence[FitTrace]) -> str:
    return f" {fit.label}" if fit.label and len(fits) > 1 else ""


def _group_view(unit: str, columns: Sequence[tuple[str, str]]) -> ViewPlan:
    lines = [
        Line(entity, column, _stem(column), PALETTE[place % len(PALETTE)])
        for place, (entity, column) in enumerate(columns)
    ]
    names = ", ".join(line.name for line in lines)
    return ViewPlan(f"{names} [{unit}]", tuple(lines), 2.0)


def _by_unit(traces: Sequence[Trace], fitted: set[str]) -> dict[str, list[tuple[str, str]]]:
    """(entity, column) by unit, in the order of the tables; quantities shown above left out."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for trace in traces:
        for column in trace.columns:
            if column not in fitted:
                groups.setdefault(_unit(column), []).append((trace.entity, column))
    return groups


def time_view(plan: ViewPlan) -> TimeSeriesView:
    """A time series view of a plan; x axes of all views move together."""
    import rerun.blueprint as rrb
    from rerun.blueprint.components import LinkAxis

    axis_y = None
    if plan.reach is not None:
        axis_y = rrb.archetypes.ScalarAxis(range=(-plan.reach, plan.reach), zoom_lock=True)
    overrides: dict[Any, list[Any]] = {}
    for line in plan.lines:
        overrides.setdefault(line.entity, []).append(_curve(line))
    return rrb.TimeSeriesView(
        name=plan.name,
        origin="/",
        contents=list(overrides),
        axis_x=rrb.archetypes.TimeAxis(link=LinkAxis.LinkToGlobal),
        axis_y=axis_y,
        plot_legend=rrb.Corner2D.RightTop,
        overrides=overrides,
    )


def _curve(line: Line) -> Any:
    """A curve of one column; MinMax, since averaging would hide a spike."""
    import rerun as rr
    from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

    mapping = VisualizerComponentMapping(
        target="Scalars:scalars",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component=line.component,
    )
    style = rr.SeriesLines(
        names=line.name,
        colors=line.colour,
        widths=2.6 if line.colour == MEASURED else 1.4,
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    return style.visualizer(mappings=[mapping])


def _unit(name: str) -> str:
    return SUFFIX_UNITS.get(suffix_of(name), "1")


def _stem(name: str) -> str:
    suffix = suffix_of(name)
    return (name[: -len(suffix) - 1] if suffix else name).replace("_", " ")


def named(name: str) -> str:
    """A column in words with its unit."""
    return f"{_stem(name)} [{_unit(name)}]"
