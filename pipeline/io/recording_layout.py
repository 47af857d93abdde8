"""How a recording of one capture is laid out in the viewer."""

from __future__ import annotations

from collections.abc import Sequence
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
Line = tuple[str, str, Colour]


def capture_layout(traces: Sequence[Trace], fits: Sequence[FitTrace]) -> Blueprint:
    """Fitted quantities with their residuals on top, all other columns by unit below.

    Findings and datasheet stand at the right; the x axes are linked, panels hidden.
    """
    import rerun.blueprint as rrb
    from rerun.blueprint.encodings import TextLogColumn

    plots, shares = [], []
    quantities = list(dict.fromkeys((fit.title, fit.y_name) for fit in fits))
    for title, y_name in quantities[:MOST_FITS]:
        own = [fit for fit in fits if (fit.title, fit.y_name) == (title, y_name)]
        plots += [_fit_view(title, y_name, own, traces), _residual_view(y_name, own)]
        shares += [3.0, 1.6]
    fitted = {y_name for _, y_name in quantities[:MOST_FITS]}
    for unit, columns in list(_by_unit(traces, fitted).items())[:MOST_GROUPS]:
        plots.append(_group_view(unit, columns))
        shares.append(2.0)
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
    left = rrb.Vertical(*plots, row_shares=shares) if plots else rrb.Vertical()
    return rrb.Blueprint(
        rrb.Horizontal(left, side, column_shares=[2.4, 1.0]),
        rrb.TimePanel(state="collapsed", timeline=traces[0].index if traces else None),
        auto_views=False,
        auto_layout=False,
        collapse_panels=True,
    )


def _fit_view(
    title: str, y_name: str, fits: Sequence[FitTrace], traces: Sequence[Trace]
) -> TimeSeriesView:
    """Measured under model; the measured trace is the whole column where the capture has it."""
    lines: dict[str, list[Line]] = {}
    home = next((trace for trace in traces if y_name in trace.columns), None)
    if home is not None:
        lines[home.entity] = [(y_name, "measured", MEASURED)]
    for fit in fits:
        after = f" {fit.label}" if fit.label and len(fits) > 1 else ""
        own: list[Line] = [("fitted", f"model{after}", MODEL)]
        if home is None:
            own.insert(0, ("measured", f"measured{after}", MEASURED))
        lines[fit.trace.entity] = own
    return _view(f"{title}: {_named(y_name)}", lines)


def _residual_view(y_name: str, fits: Sequence[FitTrace]) -> TimeSeriesView:
    """What is left over, on an axis that is symmetric and stays so."""
    reach = AIR * max(fit.reach for fit in fits) or 1.0
    lines: dict[str, list[Line]] = {}
    for fit in fits:
        after = f" {fit.label}" if fit.label and len(fits) > 1 else ""
        lines[fit.trace.entity] = [("residual", f"measured − model{after}", RESIDUAL)]
    return _view(f"{_named(y_name)}, measured − model", lines, (-reach, reach))


def _group_view(unit: str, columns: Sequence[tuple[str, str]]) -> TimeSeriesView:
    lines: dict[str, list[Line]] = {}
    for place, (entity, column) in enumerate(columns):
        colour = PALETTE[place % len(PALETTE)]
        lines.setdefault(entity, []).append((column, _stem(column), colour))
    names = ", ".join(_stem(column) for _, column in columns)
    return _view(f"{names} [{unit}]", lines)


def _by_unit(traces: Sequence[Trace], fitted: set[str]) -> dict[str, list[tuple[str, str]]]:
    """(entity, column) by unit, in the order of the tables; quantities shown above left out."""
    groups: dict[str, list[tuple[str, str]]] = {}
    for trace in traces:
        for column in trace.columns:
            if column not in fitted:
                groups.setdefault(_unit(column), []).append((trace.entity, column))
    return groups


def _view(
    name: str, lines: dict[str, list[Line]], value_range: tuple[float, float] | None = None
) -> TimeSeriesView:
    import rerun.blueprint as rrb
    from rerun.blueprint.components import LinkAxis

    axis_y = None
    if value_range is not None:
        axis_y = rrb.archetypes.ScalarAxis(range=value_range, zoom_lock=True)
    return rrb.TimeSeriesView(
        name=name,
        origin="/",
        contents=list(lines),
        axis_x=rrb.archetypes.TimeAxis(link=LinkAxis.LinkToGlobal),
        axis_y=axis_y,
        plot_legend=rrb.Corner2D.RightTop,
        overrides={entity: [_line(*one) for one in own] for entity, own in lines.items()},
    )


def _line(component: str, name: str, colour: Colour) -> Any:
    """A curve of one column; MinMax, since averaging would hide a spike."""
    import rerun as rr
    from rerun.blueprint.encodings import ComponentSourceKind, VisualizerComponentMapping

    mapping = VisualizerComponentMapping(
        target="Scalars:scalars",
        source_kind=ComponentSourceKind.SourceComponent,
        source_component=component,
    )
    style = rr.SeriesLines(
        names=name,
        colors=colour,
        widths=2.6 if colour == MEASURED else 1.4,
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    return style.visualizer(mappings=[mapping])


def _unit(name: str) -> str:
    return SUFFIX_UNITS.get(suffix_of(name), "1")


def _stem(name: str) -> str:
    suffix = suffix_of(name)
    return (name[: -len(suffix) - 1] if suffix else name).replace("_", " ")


def _named(name: str) -> str:
    return f"{_stem(name)} [{_unit(name)}]"
