"""How the recording of one capture is laid out: traces, maps, all signals, the datasheet."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint import Blueprint

from pipeline.io.recordings.capture_maps import ResidualMaps, angle_words
from pipeline.io.recordings.capture_traces import FitTrace
from pipeline.io.recordings.error_map import map_view
from pipeline.io.recordings.stream import TIME, Trace
from pipeline.io.recordings.views import (
    AIR,
    MEASURED,
    MODEL,
    PALETTE,
    RESIDUAL,
    WIDE,
    Line,
    ViewPlan,
    bar_view,
    findings_view,
    page_view,
    stacked,
    time_view,
    workspace,
)
from pipeline.physics.notation import quantity, scale_for
from pipeline.views.names import quantity_words, unit_words, with_unit

MOST_FITS, MOST_GROUPS = 2, 2
LOUPE_SHARE = 100.0
MOST_UNITS, HELD_SHARE = 12, 0.1
FIRST_UNITS = ("rad/s", "A", "V", "N·m")


@dataclass(frozen=True, slots=True)
class Shown:
    """What a recording of one capture holds, for its layout."""

    traces: Sequence[Trace]
    fits: Sequence[FitTrace]
    maps: Sequence[ResidualMaps]
    lanes: tuple[str, ...]
    datasheet: bool
    table: tuple[Trace, int] | None


def capture_layout(shown: Shown) -> Blueprint:
    """The layout of a capture: traces with magnifier, lanes and findings; maps; all signals;
    datasheet.

    Parameters
    ----------
    shown
        What the recording holds.

    """
    main = main_views(shown.traces, shown.fits)
    tabs = [_traces_tab(shown, main)]
    if shown.maps:
        tabs.append(_maps_tab(shown.maps))
    further = further_views(shown.traces, shown.fits, main)
    if further:
        tabs.append(stacked(further, name=f"{len(tabs) + 1} · Further signals"))
    tabs.append(_sheet_tab(shown, f"{len(tabs) + 1} · Datasheet & samples"))
    return workspace(*tabs, timeline=shown.traces[0].index if shown.traces else None)


def main_views(traces: Sequence[Trace], fits: Sequence[FitTrace]) -> tuple[ViewPlan, ...]:
    """The first fitted quantities with their residuals, then speed, currents and the like.

    Parameters
    ----------
    traces
        Tables of the capture.
    fits
        What was fitted to them.

    """
    return _views(traces, fits, MOST_FITS, MOST_GROUPS)


def further_views(
    traces: Sequence[Trace], fits: Sequence[FitTrace], main: Sequence[ViewPlan]
) -> tuple[ViewPlan, ...]:
    """Every fitted quantity and every column that the main views leave out.

    Parameters
    ----------
    traces
        Tables of the capture.
    fits
        What was fitted to them.
    main
        The main views.

    """
    every = _views(traces, fits, len(fits), MOST_UNITS)
    return tuple(plan for plan in every if plan not in main)


def loupe_views(fits: Sequence[FitTrace]) -> tuple[ViewPlan, ...]:
    """Measured over model, and the residual, close to the cursor.

    Parameters
    ----------
    fits
        What was fitted; without any over time there are no such views.

    """
    timed = [fit for fit in fits if fit.trace.index == TIME]
    if not timed:
        return ()
    span_s = max(_span_s(fit.trace) for fit in timed)
    around_s = round_s(span_s / LOUPE_SHARE)
    first = timed[0].y_name
    of_signal = [fit for fit in timed if fit.y_name == first and fit.title == timed[0].title]
    words = f"Loupe ±{quantity(around_s, 's', 2)} at the cursor"
    pairs = [
        Line(f.trace.entity, component, f"{word}{_after(f, of_signal)}", colour, width)
        for f in of_signal
        for component, word, colour, width in (
            ("measured", "measured", MEASURED, WIDE),
            ("fitted", "model", MODEL, 1.4),
        )
    ]
    residual = _residual_view(first, of_signal)
    return (
        ViewPlan(f"{words}: {with_unit(first)}", tuple(pairs), 1.5, None, around_s),
        ViewPlan(f"{words}: {residual.name}", residual.lines, 1.0, residual.reach, around_s),
    )


def _views(
    traces: Sequence[Trace], fits: Sequence[FitTrace], most_fits: int, most_groups: int
) -> tuple[ViewPlan, ...]:
    views = []
    quantities = list(dict.fromkeys(fit.y_name for fit in fits))[:most_fits]
    for y_name in quantities:
        title = next(fit.title for fit in fits if fit.y_name == y_name)
        of_title = [fit for fit in fits if (fit.title, fit.y_name) == (title, y_name)]
        views += [_fit_view(title, y_name, of_title, traces), _residual_view(y_name, of_title)]
    groups = _by_unit(traces, set(quantities))
    chosen = list(groups.items())[:most_groups]
    views += [_group_view(unit, columns, traces) for unit, columns in chosen]
    return tuple(views)


def _fit_view(
    title: str, y_name: str, fits: Sequence[FitTrace], traces: Sequence[Trace]
) -> ViewPlan:
    """Measured under model; the measured trace is the whole column where the capture has it."""
    home = next((trace for trace in traces if y_name in trace.columns), None)
    if home is None:
        measured = [
            Line(f.trace.entity, "measured", f"measured{_after(f, fits)}", MEASURED, WIDE)
            for f in fits
        ]
    else:
        measured = [Line(home.entity, y_name, "measured", MEASURED, WIDE, home.packed)]
    models = [Line(f.trace.entity, "fitted", f"model{_after(f, fits)}", MODEL) for f in fits]
    shown = [(f.trace.frame, column) for f in fits for column in ("measured", "fitted")]
    span = _span(shown if home is None else [(home.frame, y_name), *shown])
    return ViewPlan(f"{title}: {with_unit(y_name)}", (*measured, *models), 3.0, span=span)


def _residual_view(y_name: str, fits: Sequence[FitTrace]) -> ViewPlan:
    """What is left over, on an axis that is symmetric, stays so, and never magnifies noise."""
    reach = max(*(AIR * fit.reach for fit in fits), *(fit.floor for fit in fits))
    lines = [
        Line(f.trace.entity, "residual", f"measured − model{_after(f, fits)}", RESIDUAL)
        for f in fits
    ]
    around = quantity(reach, unit_words(y_name), 2)
    return ViewPlan(f"{with_unit(y_name)}, measured − model (±{around})", tuple(lines), 1.8, reach)


def _after(fit: FitTrace, fits: Sequence[FitTrace]) -> str:
    return f" {fit.label}" if fit.label and len(fits) > 1 else ""


def _group_view(unit: str, columns: Sequence[tuple[str, str]], traces: Sequence[Trace]) -> ViewPlan:
    packed = {trace.entity for trace in traces if trace.packed}
    lines = [
        Line(
            entity,
            column,
            quantity_words(column),
            PALETTE[place % len(PALETTE)],
            packed=entity in packed,
        )
        for place, (entity, column) in enumerate(columns)
    ]
    names = ", ".join(line.name for line in lines)
    frames = {trace.entity: trace.frame for trace in traces}
    span = _span([(frames[entity], column) for entity, column in columns])
    return ViewPlan(f"{names} [{unit}]", tuple(lines), 2.0, span=span)


def _span(frames: Sequence[tuple[pl.DataFrame, str]]) -> tuple[float, float] | None:
    """The y axis over all values of some columns: by itself the viewer may settle on the first.

    Around values that are all but held it is wider, so that their noise does not fill the view.
    """
    ends = [_ends(frame[column].to_numpy()) for frame, column in frames]
    lows, highs = [low for low, _ in ends], [high for _, high in ends]
    low, high = min(lows, default=math.inf), max(highs, default=-math.inf)
    if not math.isfinite(high - low):
        return None
    most = max(abs(low), abs(high))
    if high - low < HELD_SHARE * most:
        middle = 0.5 * (low + high)
        return middle - 0.5 * HELD_SHARE * most, middle + 0.5 * HELD_SHARE * most
    air = (AIR - 1.0) * (high - low) / 2.0
    return (low - air, high + air) if air > 0.0 else None


def _ends(values: NDArray[np.float32]) -> tuple[float, float]:
    """The least and the largest finite value; of none, infinities that any value replaces."""
    finite = values[np.isfinite(values)]
    return float(finite.min(initial=np.inf)), float(finite.max(initial=-np.inf))


def _by_unit(traces: Sequence[Trace], fitted: set[str]) -> dict[str, list[tuple[str, str]]]:
    """(entity, column) by unit, speed and currents first; quantities shown above left out."""
    groups: dict[str, list[tuple[str, str]]] = {unit: [] for unit in FIRST_UNITS}
    for trace in traces:
        for column in trace.columns:
            if column not in fitted:
                groups.setdefault(unit_words(column), []).append((trace.entity, column))
    return {unit: columns for unit, columns in groups.items() if columns}


def _traces_tab(shown: Shown, plans: Sequence[ViewPlan]) -> Any:
    rows: list[Any] = [time_view(plan) for plan in plans]
    shares = [plan.share for plan in plans]
    if shown.lanes:
        lanes = rrb.StateTimelineView(
            origin="/lanes",
            contents=list(shown.lanes),
            name="Regime, and rows that gates set aside"
            if len(shown.lanes) > 1
            else "Regime"
            if shown.lanes[0].endswith("regime")
            else "Rows that gates set aside",
            time_view=rrb.archetypes.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
        )
        rows.append(lanes)
        shares.append(2.0)
    loupe = loupe_views(shown.fits)
    side: list[Any] = [time_view(plan) for plan in loupe]
    side_shares = [plan.share for plan in loupe]
    side.append(findings_view("/findings", "Findings of this capture, at their rows"))
    traces_view = rrb.Vertical(*rows, row_shares=shares or None)
    right = rrb.Vertical(*side, row_shares=[*side_shares, 1.0])
    return rrb.Horizontal(traces_view, right, column_shares=[1.7, 1.0], name="1 · Traces")


def _maps_tab(maps: Sequence[ResidualMaps]) -> Any:
    rows = []
    for one in maps:
        scale = scale_for(one.reach, one.unit)
        colour = f"full colour ±{scale.shown(one.reach):.3g} {scale.unit}"
        views: list[Any] = []
        if one.flat is not None:
            name = f"{quantity_words(one.signal)} residual over speed and current, {colour}"
            values = rrb.TensorView(
                origin=f"/maps/{one.signal}/values",
                name=f"values [{unit_words(one.signal)}]",
            )
            picture = map_view(f"/maps/{one.signal}", one.flat, name)
            views.append(rrb.Tabs(picture, values, active_tab=0))
        if one.turn is not None:
            unit = scale_for(max(one.turn.reach, one.floor), one.unit).unit or "1"
            turn = f"residual [{unit}] over {angle_words(one.signal)} angle [°]"
            views.append(bar_view(turn, f"/angle/{one.signal}", f"/angle_axis/{one.signal}"))
            if one.orders.size:
                orders = f"its amplitude [{unit}] by {angle_words(one.signal)} order"
                axis = f"/orders_axis/{one.signal}"
                views.append(bar_view(orders, f"/orders/{one.signal}", axis))
        rows.append(rrb.Horizontal(*views, column_shares=[1.5, 1.0, 0.8][: len(views)]))
    return rrb.Vertical(*rows, name="2 · Residual maps")


def _sheet_tab(shown: Shown, name: str) -> Any:
    views: list[Any] = [page_view("/datasheet", "Datasheet")] if shown.datasheet else []
    if shown.table is not None:
        table, step = shown.table
        if step == 1:
            views.append(_table_view(table, "Samples"))
        else:
            thin = _table_view(table, f"Samples, one row in {step}")
            views.append(rrb.Tabs(thin, _table_view(shown.traces[0], "All samples"), active_tab=0))
    return rrb.Horizontal(*views, name=name)


def _table_view(trace: Trace, name: str) -> Any:
    query = rrb.archetypes.DataframeQuery(timeline=trace.index)
    return rrb.DataframeView(origin=trace.entity, name=name, query=query)


def _span_s(trace: Trace) -> float:
    index = trace.frame[TIME].cast(int)
    return float(index[-1] - index[0]) * 1e-9 if index.len() else 0.0


def round_s(around_s: float) -> float:
    """The next 1, 2 or 5 times a power of ten.

    Parameters
    ----------
    around_s
        A time, 0 or more.

    """
    if around_s <= 0.0:
        return 1e-3
    decade = 10.0 ** math.floor(math.log10(around_s))
    return next(step * decade for step in (1.0, 2.0, 5.0, 10.0) if step * decade >= around_s)
