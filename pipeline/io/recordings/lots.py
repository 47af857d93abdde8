"""Lot against lot as a Rerun recording: the verdict, who lies where, cogging, drift lot by lot.

A recording holds the entities

    /verdict              the sentence, its reasons and a table of constants, as a markdown page
    /hist/NAME/SIDE       motors per bin of a constant, both sides over each other
    /cogging/SIDE         `mean`, `low`, `high` of the zero-current torque [mN·m] over 0.1°
    /orders/SIDE          its mean amplitude by order [mN·m]
    /drift/NAME           lot means as change from the baseline's [%], with ±U and control limits
    /motors               one row a motor: its name, lot and side
    /motors/NAME          a constant of it, in the unit of the histogram

on one sequence timeline `place`: tenths of degrees, lots and motors all count from 0, and one
timeline serves every view at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import polars as pl
import rerun.blueprint as rrb
from rerun import RecordingStream
from rerun.blueprint import Blueprint

from pipeline.io.recordings.datasheet_page import plain
from pipeline.io.recordings.font import drawable, in_headings
from pipeline.io.recordings.lots_traces import (
    COLOURS,
    FILL,
    MOTORS,
    PLACE,
    SIDES,
    band_trace,
    constant_scale,
    drift,
    histogram,
    leading_order,
)
from pipeline.io.recordings.stream import (
    Bars,
    placed,
    recording,
    send_bars,
    send_page,
    send_property,
    send_trace,
)
from pipeline.io.recordings.views import (
    BASELINE,
    CANDIDATE,
    MEASURED,
    RESIDUAL,
    WIDE,
    Line,
    ViewPlan,
    bar_view,
    page_view,
    time_view,
    workspace,
)
from pipeline.io.storage.publish import canonical_json
from pipeline.records.lot_constant import ConstantResult
from pipeline.records.lot_regression import LotRegression
from pipeline.records.naming import file_stem
from pipeline.views.lots import ConstantRow, compared, lot_view
from pipeline.views.names import quantity_words

DIGITS = 5
"""Significant digits of a constant in the table of motors."""
MOST_OUTLIERS = 12
MOST_SHOWN, GRID, PERIODS = 2, 3, 6
FILL_ALPHA, FILL_WIDTH = 40, 3.0


def lots_name(result: LotRegression) -> str:
    """The file name of a comparison of lots, by what was compared with what.

    Parameters
    ----------
    result
        The comparison.

    """
    return f"lots-{file_stem(f'{result.baseline.selector} {result.candidate.selector}')}.rrd"


def lots_bytes(result: LotRegression) -> bytes:
    """The recording of one comparison of lots as bytes.

    Parameters
    ----------
    result
        The comparison.

    """
    identity = canonical_json(result.document()).decode()
    name = f"{result.baseline.selector} → {result.candidate.selector}"
    with recording(name, (identity,), lots_layout(result)) as recorded:
        send_page(recorded.stream, "/verdict", verdict_markdown(result))
        for one in compared(result):
            _send_histograms(recorded.stream, one)
            _send_drift(recorded.stream, one)
        for band in result.cogging:
            send_trace(recorded.stream, band_trace(band))
        _send_orders(recorded.stream, result)
        _send_motors(recorded.stream, result)
        stated = {
            "verdict": result.verdict,
            "headline": result.headline,
            "baseline": result.baseline.selector,
            "candidate": result.candidate.selector,
            "lots": [*result.baseline.lots, *result.candidate.lots],
        }
        send_property(recorded.stream, "regression", stated)
    return recorded.content


def _send_histograms(stream: RecordingStream, constant: ConstantResult) -> None:
    edges, counts = histogram(constant)
    for side in SIDES:
        bars = Bars.between(edges, counts[side], COLOURS[side])
        send_bars(stream, f"/hist/{constant.name}/{side}", bars)


def _send_drift(stream: RecordingStream, constant: ConstantResult) -> None:
    moving = drift(constant)
    if moving is not None:
        send_trace(stream, placed(f"/drift/{constant.name}", PLACE, moving))


def _send_orders(stream: RecordingStream, result: LotRegression) -> None:
    width = max([0.4, *(level.order / 60.0 for level in result.orders)])
    for side, shift in zip(SIDES, (-width, 0.0), strict=True):
        of_side = [level for level in result.orders if level.side == side]
        if of_side:
            values = 1e3 * np.array([level.mean for level in of_side])
            edges = np.array([float(level.order) for level in of_side]) + shift
            send_bars(stream, f"/orders/{side}", Bars(values, edges, width, COLOURS[side]))


def _send_motors(stream: RecordingStream, result: LotRegression) -> None:
    """A row a motor, in the units of the histograms; a constant that it lacks stays empty.

    The viewer makes a column as wide as its heading, so these are as long as what stands below.
    """
    shown = compared(result)
    motors = {motor.motor_id: motor for one in shown for motor in one.motors}
    ordered = sorted(motors.values(), key=lambda motor: (motor.side, motor.motor_id))
    if not ordered:
        return
    names = {
        "motor_serial_number": [drawable(motor.motor_id) for motor in ordered],
        "production_lot": [drawable(motor.lot) for motor in ordered],
        "baseline_or_candidate": [motor.side for motor in ordered],
    }
    send_trace(stream, placed(MOTORS, PLACE, pl.DataFrame(names)))
    for one in shown:
        scale, values = constant_scale(one), {m.motor_id: m.value for m in one.motors}
        column = pl.Series(
            in_headings(scale.unit) or "1",
            [values.get(motor.motor_id) for motor in ordered],
            pl.Float64,
        )
        shown_values = pl.DataFrame([(column / 10.0**scale.exponent).round_sig_figs(DIGITS)])
        send_trace(stream, placed(f"{MOTORS}/{one.name}", PLACE, shown_values))


def verdict_markdown(result: LotRegression) -> str:
    """Verdict, headline, reasons, one line a constant, outliers and notes as a page.

    Parameters
    ----------
    result
        The comparison.

    """
    before, after = result.baseline, result.candidate
    lines = [
        f"# {plain(before.selector)} → {plain(after.selector)}: {plain(result.verdict)}",
        "",
        f"**{plain(result.headline)}**",
        "",
        f"{before.motors} \\+ {after.motors} motors, "
        f"{len(before.lots)} \\+ {len(after.lots)} lots; "
        "blue is the baseline, orange the candidate, everywhere.",
        "",
    ]
    lines += [f"- {plain(reason)}" for reason in result.reasons]
    if result.history != "sufficient":
        needed = result.limits.min_lots
        lines.append(f"- insufficient history: the test over lots needs {needed} baseline lots")
    lines += [
        "",
        "| | constant | baseline | candidate | change ± U | p |",
        "| --- |" + " --- |" * 5,
    ]
    view = lot_view(result)
    lines += [_line(row) for row in view.rows]
    lines += ["", *(f"- {len(r.members)} constants: {plain(r.text)}" for r in view.reasons)]
    changed = [one for one in result.effects if one.verdict != "pass"]
    if changed:
        lines += ["", "## Effects and orders", ""]
        lines += [f"- {plain(one.verdict)}: {plain(one.name)}: {plain(one.why)}" for one in changed]
    if result.outliers:
        lines += ["", "## Motors apart from their lot", ""]
        lines += [
            f"- {plain(o.motor_id)}: {plain(o.constant)} {plain(o.why)}"
            + (f" ({plain(o.capture)})" if o.capture else "")
            for o in result.outliers[:MOST_OUTLIERS]
        ]
    lines += ["", *(f"{plain(note)}\n" for note in result.notes)]
    order = [*before.lots, *after.lots]
    lines += ["## Lots by number", ""]
    lines += [f"- {number}: {plain(lot)}" for number, lot in enumerate(order)]
    return "\n".join([*lines, ""])


def _line(row: ConstantRow) -> str:
    strong = "**" if row.tone == "fail" else ""
    return (
        f"| {row.mark} | {strong}{plain(row.name)}{strong} | {row.before} | {row.after} "
        f"| {strong}{plain(row.change)}{strong} | {row.p_value} |"
    )


def lots_layout(result: LotRegression) -> Blueprint:
    """The layout of a comparison of lots: verdict; all distributions; drift of every constant.

    Parameters
    ----------
    result
        The comparison.

    """
    shown = compared(result)
    tabs: list[Any] = [_verdict_tab(result, shown)]
    if shown:
        views = [histogram_view(one) for one in shown]
        name = "2 · All distributions"
        tabs.append(rrb.Grid(*views, grid_columns=GRID, name=name))
    drifting = [one for one in shown if drift(one) is not None]
    if drifting:
        views = [time_view(drift_plan(one)) for one in drifting]
        tabs.append(rrb.Grid(*views, grid_columns=GRID, name="3 · Drift, lot by lot"))
    return workspace(*tabs, timeline=PLACE)


def histogram_view(constant: ConstantResult) -> Any:
    """Motors a bin of one constant, both sides over each other.

    Parameters
    ----------
    constant
        Its result.

    """
    unit = constant_scale(constant).unit or "1"
    verdict = constant.verdict.replace("_", " ").lower()
    name = f"{quantity_words(constant.name)} [{unit}], motors per bin: {verdict}"
    return bar_view(name, *(f"/hist/{constant.name}/{side}" for side in SIDES), legend=True)


def drift_plan(constant: ConstantResult) -> ViewPlan:
    """Lot means with ±U, the candidate in its own colour, and the control limits of the chart.

    Parameters
    ----------
    constant
        Its result.

    """
    entity = f"/drift/{constant.name}"
    lines = (
        Line(entity, "low", "mean ± U", (*BASELINE, 110)),
        Line(entity, "high", "mean ± U", (*BASELINE, 110)),
        Line(entity, "mean", "lot mean", BASELINE, WIDE),
        Line(entity, "candidate", "candidate", CANDIDATE, 4.0),
        Line(entity, "ewma", "EWMA", MEASURED),
        Line(entity, "ewma_low", "limit", (*RESIDUAL, 160)),
        Line(entity, "ewma_high", "limit", (*RESIDUAL, 160)),
    )
    words = f"{quantity_words(constant.name)}: change from the baseline [%] by lot number"
    return ViewPlan(words, lines, 1.0, rows=len(constant.lots))


def cogging_plan(result: LotRegression) -> ViewPlan | None:
    """Both bands of cogging torque over the mechanical angle.

    Parameters
    ----------
    result
        The comparison.

    Returns
    -------
    ViewPlan or None
        None where no motor was turned without current.

    """
    lines: list[Line] = []
    for band in result.cogging:
        entity, colour = f"/cogging/{band.side}", COLOURS[band.side]
        words, faint = f"{band.side}: mean ± sd of {band.motors} motors", (*colour, FILL_ALPHA)
        lines.append(Line(entity, "mean", words, colour, WIDE))
        lines += [Line(entity, f"fill_{n}", words, faint, FILL_WIDTH) for n in range(1, FILL)]
        lines += [Line(entity, edge, words, (*colour, 110)) for edge in ("low", "high")]
    if not lines:
        return None
    order = leading_order(result)
    words = (
        f"cogging torque [mN·m] over mechanical angle [0.1°], {PERIODS} periods of order {order}"
    )
    return ViewPlan(words, tuple(lines), 1.0, rows=-(-3600 * PERIODS // order))


def _verdict_tab(result: LotRegression, shown: Sequence[ConstantResult]) -> Any:
    pages: list[Any] = [page_view("/verdict", "Verdict")]
    shares = [1.4]
    if shown:
        order = [MOTORS, *(f"{MOTORS}/{one.name}" for one in shown)]
        query = rrb.archetypes.DataframeQuery(timeline=PLACE, entity_order=order)
        pages.append(rrb.DataframeView(origin=MOTORS, name="Motors", query=query))
        shares.append(1.0)
    right: list[Any] = []
    if shown:
        views = [histogram_view(one) for one in shown[:MOST_SHOWN]]
        right.append(rrb.Horizontal(*views))
    lower: list[Any] = []
    plan = cogging_plan(result)
    if plan is not None:
        lower.append(time_view(plan))
    if result.orders:
        orders = "its amplitude [mN·m] by mechanical order"
        sides = dict.fromkeys(level.side for level in result.orders)
        lower.append(bar_view(orders, *(f"/orders/{side}" for side in sides), legend=True))
    if lower:
        right.append(rrb.Horizontal(*lower, column_shares=[1.8, 1.0][: len(lower)]))
    columns = [rrb.Vertical(*pages, row_shares=shares)]
    columns += [rrb.Vertical(*right)] if right else []
    return rrb.Horizontal(*columns, column_shares=[1.0, 1.5][: len(columns)], name="1 · Lots")
