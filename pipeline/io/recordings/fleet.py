"""The fleet's table, a row a motor, and the workspace that a row opens: one layout for all."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import rerun.blueprint as rrb
from rerun.blueprint import Blueprint
from rerun.blueprint.table import TableBlueprint

from pipeline.io.recordings.fleet_columns import APPLICATION, CAPTURE, SHOWN, STEPS_A_CAPTURE
from pipeline.io.recordings.stream import ROW
from pipeline.io.recordings.views import (
    MEASURED,
    MODEL,
    PALETTE,
    RESIDUAL,
    Line,
    ViewPlan,
    bar_view,
    findings_view,
    page_view,
    rows_axis,
    time_view,
    workspace,
)
from pipeline.views.names import quantity_words

PREVIEW_REACH = 2.0
MOTOR = "property:motor"


def motor_layout(signals: Sequence[str], captures: int) -> Blueprint:
    """The layout of one motor: datasheet at the left; residuals, cogging and findings at the right.

    Parameters
    ----------
    signals
        Quantities with residuals.
    captures
        How many captures there is room for.

    """
    colours = (RESIDUAL, *PALETTE[1:], MODEL, MEASURED)
    lines = tuple(
        Line(f"/overview/{name}", "percent", quantity_words(name), colours[place % len(colours)])
        for place, name in enumerate(signals)
    )
    words = f"residuals of all captures [% of the signal's reach, ±{PREVIEW_REACH:g}]"
    plots: list[Any] = []
    if lines:
        plan = ViewPlan(words, lines, 2.0, PREVIEW_REACH, rows=captures * STEPS_A_CAPTURE)
        plots.append(time_view(plan))
        plots.append(
            rrb.StateTimelineView(
                origin="/overview_lane",
                name="which capture",
                time_view=rows_axis(captures * STEPS_A_CAPTURE),
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
    tabs = rrb.Tabs(
        page_view("/sheet", "Datasheet"), page_view("/checks", "Checks"), table, active_tab=0
    )
    motor = rrb.Horizontal(tabs, right, column_shares=[1.0, 1.6], name="Motor")
    return workspace(motor, timeline=CAPTURE)


def table_layout(captures: int) -> TableBlueprint:
    """The layout of the fleet's table: verdict, lot, key constants, previews; refused motors first.

    Parameters
    ----------
    captures
        How many captures the previews have room for.

    """
    table = rrb.table
    preview = table.PreviewCell(
        rrb.TimeSeriesView(
            origin="/preview/residual",
            name="residual",
            axis_x=rows_axis(captures * STEPS_A_CAPTURE),
            axis_y=rrb.archetypes.ScalarAxis(range=(-PREVIEW_REACH, PREVIEW_REACH)),
            plot_legend=rrb.PlotLegend(visible=False),
        ),
        bar_view("zero-current torque", "/preview/cogging"),
    )
    heading = f"residuals [%, ±{PREVIEW_REACH:g}], zero-current torque [mN·m]"
    columns = [
        table.Column(f"{MOTOR}:id", name="motor"),
        table.Column(f"{MOTOR}:verdict", name="verdict"),
        table.Column(f"{MOTOR}:lot", name="lot"),
        table.Column("recording link", name=heading, column_type=preview),
        *(table.Column(f"property:shown:{one.key}", name=one.heading) for one in SHOWN),
        table.Column(f"{MOTOR}:failed", name="failed checks"),
        table.Column(f"{MOTOR}:largest_residual_percent", name="residual [%]"),
        table.Column(f"{MOTOR}:type", name="type", visible=False),
        table.Column(f"{MOTOR}:order", visible=False),
        table.Column(f"{MOTOR}:captures", name="captures"),
        table.Column("property:RecordingInfo:name", visible=False),
    ]
    return table.TableBlueprint(
        table_layout=table.TableLayout(columns=columns),
        default_layout="table",
        sort_by=table.SortBy(f"{MOTOR}:order"),
        previews_config=table.PreviewsConfig(timeline=CAPTURE),
    )


def write_layouts(folder: Path, signals: Sequence[str], captures: int) -> tuple[Path, Path]:
    """Writes the layouts of table and motors as .rbl files, for a server to register.

    Parameters
    ----------
    folder
        Where they are written.
    signals
        Quantities that any motor has.
    captures
        The most captures that a motor has.

    Returns
    -------
    tuple of Path
        The files of table and motor.

    """
    table, motor = folder / "table.rbl", folder / "motor.rbl"
    table_layout(captures).save(APPLICATION, table)
    motor_layout(signals, captures).save(APPLICATION, motor)
    return table, motor
