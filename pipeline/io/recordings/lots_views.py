"""How the recording of a comparison of lots is laid out: verdict, all distributions, drift."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from pipeline.io.recordings.lots_traces import (
    COLOURS,
    FILL,
    MOTORS,
    PLACE,
    SIDES,
    constant_scale,
    drift,
    leading_order,
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
from pipeline.records.lot_constant import ConstantResult
from pipeline.records.lot_regression import LotRegression
from pipeline.views.lots import compared
from pipeline.views.names import quantity_words

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint

MOST_SHOWN, GRID, PERIODS = 2, 3, 6
FILL_ALPHA, FILL_WIDTH = 40, 3.0


def lots_layout(result: LotRegression) -> Blueprint:
    """The layout of a comparison of lots: verdict; all distributions; drift of every constant.

    Parameters
    ----------
    result
        The comparison.

    """
    import rerun.blueprint as rrb

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
    name = f"{quantity_words(constant.name)} [{unit}], motors per bin: {constant.verdict}"
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
    import rerun.blueprint as rrb

    left: list[Any] = [page_view("/verdict", "Verdict")]
    shares = [1.4]
    if shown:
        order = [MOTORS, *(f"{MOTORS}/{one.name}" for one in shown)]
        query = rrb.archetypes.DataframeQuery(timeline=PLACE, entity_order=order)
        left.append(rrb.DataframeView(origin=MOTORS, name="Motors", query=query))
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
    columns = [rrb.Vertical(*left, row_shares=shares)]
    columns += [rrb.Vertical(*right)] if right else []
    return rrb.Horizontal(*columns, column_shares=[1.0, 1.5][: len(columns)], name="1 · Lots")
