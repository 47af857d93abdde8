"""A comparison as a Rerun recording: measured under model over time, capture by capture.

A recording holds, on the timeline `t` (duration), for every capture that was simulated,

    /CAPTURE/equation/SIGNAL  `measured`, `model`, `residual`: the model from the measured state
    /CAPTURE/free_run/SIGNAL  the same of the model on its own, from each window's start
                              where effects were added, both with `before` and `residual_before`:
                              the model without them
    /sheet                    every error beside its noise floor, as a markdown page
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import rerun.blueprint as rrb
from numpy.typing import NDArray
from rerun.blueprint import Blueprint

from pipeline.io.recordings.capture_views import LOUPE_SHARE, round_s
from pipeline.io.recordings.datasheet_page import plain
from pipeline.io.recordings.stream import (
    TIME,
    recording,
    send_page,
    send_property,
    send_trace,
    timed,
)
from pipeline.io.recordings.stream import Trace as Table
from pipeline.io.recordings.views import (
    AIR,
    BASELINE,
    MEASURED,
    MODEL,
    RESIDUAL,
    WIDE,
    Line,
    ViewPlan,
    page_view,
    stacked,
    workspace,
)
from pipeline.io.storage.publish import canonical_json
from pipeline.numerics.thinning import line_points
from pipeline.physics.notation import quantity
from pipeline.records.comparison import Comparison, Trace
from pipeline.views.comparison import KINDS, comparison_view
from pipeline.views.names import with_unit

MOST_POINTS = 4000
MOST_LOUPES = 2
"""Signals of a capture that have a loupe: those farthest over their noise floors."""


def comparison_bytes(result: Comparison) -> bytes:
    """The recording of one comparison as bytes.

    Parameters
    ----------
    result
        The comparison.

    """
    identity = canonical_json(result.document()).decode()
    with recording(f"{result.motor_id} comparison", (identity,), _layout(result)) as recorded:
        for trace in result.traces:
            send_trace(recorded.stream, table_of(trace))
        send_page(recorded.stream, "/sheet", _sheet(result))
        stated = {
            "motor_id": result.motor_id,
            "model": result.name,
            "effects": list(result.effects),
            "held_out": result.held_out,
        }
        send_property(recorded.stream, "comparison", stated)
    return recorded.content


def entity_of(trace: Trace) -> str:
    """Where a trace lies in a recording; the path of its capture is one part of the address.

    Parameters
    ----------
    trace
        The trace.

    """
    safe = "".join(c if c.isalnum() or c in "._-" else "_" for c in trace.capture)
    return f"/{safe}/{trace.kind}/{trace.signal}"


def table_of(trace: Trace) -> Table:
    """A trace as columns of float32; of a long one the rows that a screen could separate.

    Every stretch keeps the extremes of what was measured, of the model and of the residual.

    Parameters
    ----------
    trace
        The trace; extremes of measured, model and residual are kept in every stretch.

    """
    columns = {
        "measured": trace.measured,
        "model": trace.model,
        "residual": trace.measured - trace.model,
    }
    if trace.before is not None:
        columns |= {"before": trace.before, "residual_before": trace.measured - trace.before}
    rows = np.unique(np.concatenate([line_points(c, MOST_POINTS) for c in columns.values()]))
    frame = pl.DataFrame({name: c[rows].astype(np.float32) for name, c in columns.items()})
    return timed(entity_of(trace), trace.t_s[rows], frame)


def planned(result: Comparison, capture: str) -> tuple[ViewPlan, ...]:
    """Views of one capture: each signal with its residual below, on an axis that stays.

    Parameters
    ----------
    result
        The comparison.
    capture
        Path of the capture.

    """
    of_capture = (_views_of(trace) for trace in result.traces if trace.capture == capture)
    return tuple(plan for views in of_capture for plan in views)


def _views_of(trace: Trace) -> tuple[ViewPlan, ViewPlan]:
    """A signal, and its residual: without what was added, behind, and with it."""
    entity = entity_of(trace)
    measured = Line(entity, "measured", "measured", MEASURED, WIDE)
    model, residual_plan = Line(entity, "model", "model", MODEL), _residual_plan(trace)
    lines: tuple[Line, ...] = (measured, model)
    if trace.before is not None:
        before = Line(entity, "before", "model before", BASELINE)
        lines = (measured, before, replace(model, name="model after"))
        without = Line(entity, "residual_before", "measured − model before", BASELINE)
        after = replace(residual_plan.lines[0], name="measured − model after")
        reach = max(residual_plan.reach or 0.0, _reach(trace.measured - trace.before))
        residual_plan = replace(residual_plan, lines=(without, after), reach=reach)
    words = f"{with_unit(trace.signal)}, model {KINDS[trace.kind]}"
    return ViewPlan(words, lines, 2.0), residual_plan


def _residual_plan(trace: Trace) -> ViewPlan:
    """What the model leaves, on an axis of its own size."""
    line = Line(entity_of(trace), "residual", "measured − model", RESIDUAL)
    words = f"{with_unit(trace.signal)}, left over"
    return ViewPlan(words, (line,), 1.0, _reach(trace.measured - trace.model))


def _reach(residual: NDArray[np.float64]) -> float:
    most = float(np.max(np.abs(residual), initial=0.0, where=np.isfinite(residual)))
    return AIR * most or 1.0


def loupes(result: Comparison, capture: str) -> tuple[ViewPlan, ...]:
    """Views of one capture at the cursor: the signals that are farthest over their noise floors.

    Parameters
    ----------
    result
        The comparison.
    capture
        Path of the capture.

    """
    ratios = {
        (one.signal, one.kind): one.rmse / one.noise_floor
        for one in result.errors
        if one.capture == capture and one.noise_floor > 0.0
    }
    of_capture = [trace for trace in result.traces if trace.capture == capture]
    of_capture.sort(key=lambda trace: -ratios.get((trace.signal, trace.kind), 0.0))
    plans: list[ViewPlan] = []
    for trace in of_capture[:MOST_LOUPES]:
        around_s = round_s(float(np.ptp(trace.t_s)) / LOUPE_SHARE)
        words = f"Loupe ±{quantity(around_s, 's', 2)}: "
        views = (_views_of(trace)[0], _residual_plan(trace))
        plans += [replace(one, name=words + one.name, around_s=around_s) for one in views]
    return tuple(plans)


def _layout(result: Comparison) -> Blueprint:
    """A tab a capture: equations, free runs, loupes at the cursor; errors in the last tab."""
    tabs: list[Any] = []
    for capture in dict.fromkeys(trace.capture for trace in result.traces):
        plans = planned(result, capture)
        sides = []
        for kind in KINDS:
            of_kind = [p for p in plans if f"/{kind}/" in p.lines[0].entity]
            if of_kind:
                sides.append(stacked(of_kind))
        shares = [1.6] * len(sides) + [1.0]
        sides.append(stacked(loupes(result, capture)))
        name = capture.rsplit("/", 1)[-1]
        tabs.append(rrb.Horizontal(*sides, column_shares=shares, name=name))
    tabs.append(page_view("/sheet", "All errors"))
    return workspace(*tabs, timeline=TIME)


def _sheet(result: Comparison) -> str:
    view = comparison_view(result)
    lines = [
        f"# {plain(result.motor_id)}",
        "",
        plain(view.headline),
        "",
        "| capture | signal | | rms | noise floor | ratio |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    lines += [
        f"| {plain(one.capture)} | {plain(one.signal)} | {one.kind}, {one.split} "
        f"| {one.rmse} | {one.floor} | {one.ratio} |"
        for one in view.captures
    ]
    return "\n".join([*lines, ""])
