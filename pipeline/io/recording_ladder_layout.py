"""How the recording of a ladder is laid out in the viewer: one workspace a signal, one for all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.io.recording_layout import PALETTE
from pipeline.io.recording_map import BAR_GAP, BAR_WIDTH, CELL
from pipeline.physics.glossary import suffix_of
from pipeline.records.diagnosis import Diagnosis

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint


def ladder_layout(result: Diagnosis) -> Blueprint:
    """A tab a signal: page and map above, bars below; a last tab with all rungs as lines."""
    import rerun.blueprint as rrb

    from pipeline.io.recording_ladder import RUNG, shown_signals

    signals = shown_signals(result)
    tabs = [_workspace(result, signal) for signal in signals]
    tabs = [*tabs, _overview(signals)] if tabs else [_page()]
    return rrb.Blueprint(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state="expanded", timeline=RUNG, play_state="paused"),
        rrb.SelectionPanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        auto_views=False,
        auto_layout=False,
    )


def _page() -> Any:
    import rerun.blueprint as rrb

    return rrb.TextDocumentView(origin="/sheet", name="What this rung adds")


def _workspace(result: Diagnosis, signal: str) -> Any:
    import rerun.blueprint as rrb

    from pipeline.io.recording_ladder import CURRENT, SPEED, angle_of, angle_scale, error_scale

    named = signal_words(signal)
    unit, over = error_scale(result, signal).unit, angle_scale(result, signal).unit
    flat = result.ladder[0].map_of(signal, SPEED, CURRENT)
    upper = [_page()]
    if flat is not None:
        width, height = CELL * flat.mean.shape[1], CELL * flat.mean.shape[0]
        bounds = rrb.VisualBounds2D(
            x_range=(-70.0, width + BAR_GAP + BAR_WIDTH + 90.0), y_range=(-45.0, height + 70.0)
        )
        upper.append(
            rrb.Spatial2DView(
                origin=f"/map/{signal}",
                contents=[f"/map/{signal}/{part}" for part in ("picture", "bar", "axes", "frame")],
                name=f"{named}: mean error over speed and current",
                visual_bounds=bounds,
            )
        )
    angle = angle_of(signal)
    turn = "electrical" if angle == "theta_elec_rad" else "mechanical"
    lower = [
        rrb.BarChartView(
            name=f"rms error per rung [{unit}], beside its noise floor",
            origin="/",
            contents=[f"/errors/{signal}", f"/floor/{signal}"],
        )
    ]
    if result.ladder[0].map_of(signal, angle) is not None:
        lower.append(
            rrb.BarChartView(
                name=f"mean error [{over}] over {turn} angle [°]",
                origin="/",
                contents=[f"/angle/{signal}", f"/angle_axis/{signal}"],
            )
        )
    lower.append(
        rrb.BarChartView(
            name="held-out error in noise floors, % of windows", origin=f"/spread/{signal}"
        )
    )
    shares = [1.0, 1.5][: len(upper)]
    return rrb.Vertical(
        rrb.Horizontal(*upper, column_shares=shares),
        rrb.Horizontal(*lower),
        row_shares=[1.5, 1.0],
        name=named,
    )


def _overview(signals: tuple[str, ...]) -> Any:
    import rerun as rr
    import rerun.blueprint as rrb

    lines: dict[Any, Any] = {
        f"/over/{signal}": rr.SeriesLines(
            names=signal_words(signal), colors=PALETTE[place % len(PALETTE)], widths=2.5
        )
        for place, signal in enumerate(signals)
    }
    return rrb.Horizontal(
        rrb.TimeSeriesView(
            origin="/over",
            name="error over noise floor, rung by rung",
            contents=list(lines),
            overrides=lines,
            plot_legend=rrb.Corner2D.RightTop,
        ),
        _page(),
        column_shares=[1.6, 1.0],
        name="All rungs",
    )


def signal_words(signal: str) -> str:
    """A signal without its unit: `torque_shaft_nm` is torque shaft."""
    suffix = suffix_of(signal)
    stem = signal[: -len(suffix) - 1] if suffix else signal
    return stem.replace("_", " ").replace("alpha", "acceleration")
