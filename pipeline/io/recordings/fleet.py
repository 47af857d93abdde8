"""The fleet's table, a row a motor, and the workspace that a row opens: one layout for all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pipeline.io.recordings.motor import APPLICATION, SHOWN
from pipeline.io.recordings.stream import ROW, TIME
from pipeline.io.recordings.views import (
    PALETTE,
    RESIDUAL,
    Line,
    ViewPlan,
    bar_view,
    findings_view,
    page_view,
    stem_of,
    time_view,
    workspace,
)

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint
    from rerun.blueprint.table import TableBlueprint

PREVIEW_REACH = 5.0
_ORDER = "property:motor:order"


def motor_layout(signals: Sequence[str]) -> Blueprint:
    """Datasheet at the left; residuals of all captures, cogging and findings at the right."""
    import rerun.blueprint as rrb

    colours = (RESIDUAL, *PALETTE[1:])
    lines = tuple(
        Line(f"/overview/{name}", "percent", stem_of(name), colours[place % len(colours)])
        for place, name in enumerate(signals)
    )
    words = f"what the captures leave over, one after the other [% of reach, ±{PREVIEW_REACH:g}]"
    plots: list[Any] = []
    if lines:
        plots.append(time_view(ViewPlan(words, lines, 2.0, PREVIEW_REACH)))
        plots.append(
            rrb.StateTimelineView(
                origin="/overview_lane",
                name="capture",
                time_view=rrb.archetypes.TimeAxis(link=rrb.components.LinkAxis.LinkToGlobal),
            )
        )
    cogging = rrb.Horizontal(
        bar_view("zero-current torque [mN·m] over mechanical angle [°]", "/cogging/wave"),
        bar_view("its amplitude [mN·m] by mechanical order", "/cogging/orders"),
    )
    findings = findings_view("/findings", "Findings of all captures")
    right = rrb.Vertical(
        *plots, cogging, findings, row_shares=[2.0, 0.8, 1.6, 0.8][-len(plots) - 2 :]
    )
    table = rrb.DataframeView(
        origin="/constants",
        name="Constants",
        query=rrb.archetypes.DataframeQuery(timeline=ROW),
    )
    left = rrb.Tabs(
        page_view("/sheet", "Datasheet"), page_view("/checks", "Checks"), table, active_tab=0
    )
    motor = rrb.Horizontal(left, right, column_shares=[1.0, 1.6], name="Motor")
    return workspace(motor, timeline=TIME)


def table_layout() -> TableBlueprint:
    """The table: verdict, lot, key constants, previews; refused motors first."""
    import rerun.blueprint as rrb

    table = rrb.table
    preview = table.PreviewCell(
        rrb.TimeSeriesView(
            origin="/preview",
            name="residual",
            axis_y=rrb.archetypes.ScalarAxis(range=(-PREVIEW_REACH, PREVIEW_REACH)),
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        bar_view("cogging", "/cogging/wave"),
    )
    heading = f"residual of all captures [%, ±{PREVIEW_REACH:g}], zero-current torque over one turn"
    columns = [
        table.Column("property:motor:id", name="motor"),
        table.Column("property:motor:verdict", name="verdict"),
        table.Column("property:motor:failed", name="failed checks"),
        table.Column("property:motor:lot", name="lot"),
        table.Column("property:motor:largest_residual_percent", name="residual [%]"),
        *(table.Column(f"property:shown:{one.key}", name=one.heading) for one in SHOWN),
        table.Column("recording link", name=heading, column_type=preview),
    ]
    return table.TableBlueprint(
        table_layout=table.TableLayout(columns=columns),
        default_layout="table",
        sort_by=table.SortBy(_ORDER),
    )


def write_layouts(folder: Path, signals: Sequence[str]) -> tuple[Path, Path]:
    """The table's and the motors' layout as .rbl files, for a server to register."""
    table, motor = folder / "table.rbl", folder / "motor.rbl"
    table_layout().save(APPLICATION, table)
    motor_layout(signals).save(APPLICATION, motor)
    return table, motor
