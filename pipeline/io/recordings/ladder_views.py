"""How the recording of a ladder is laid out in the viewer: one workspace a signal, one for all."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from pipeline.io.recordings.error_map import map_view
from pipeline.io.recordings.ladder_scales import TIMELINE, angle_scale, error_scale, map_reach
from pipeline.io.recordings.views import PALETTE, bar_view, page_view, workspace
from pipeline.physics.notation import quantity
from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import CURRENT, SPEED, angle_of, mapped_signals
from pipeline.views.names import quantity_words

if TYPE_CHECKING:
    from rerun.blueprint import Blueprint


def ladder_layout(result: Diagnosis) -> Blueprint:
    """The layout of a search: a tab a signal, and a last tab with all steps as lines.

    Parameters
    ----------
    result
        The diagnosis.

    """
    signals = mapped_signals(result)
    tabs = [_workspace(result, signal) for signal in signals]
    tabs = [*tabs, _overview(signals)] if tabs else [_page()]
    return workspace(*tabs, timeline=TIMELINE, panel="expanded")


def _page() -> Any:
    return page_view("/sheet", "What this step adds")


def _workspace(result: Diagnosis, signal: str) -> Any:
    import rerun.blueprint as rrb

    named = quantity_words(signal)
    unit, over = error_scale(result, signal).unit, angle_scale(result, signal).unit
    flat = result.ladder[0].map_of(signal, SPEED, CURRENT)
    upper = [_page()]
    if flat is not None:
        reach = map_reach(result, signal)
        colour = f"full colour ±{quantity(reach, flat.unit, 2)} on every step"
        upper.append(map_view(f"/map/{signal}", flat, f"{named}: mean error, {colour}"))
    angle = angle_of(signal)
    turn = "electrical" if angle == "theta_elec_rad" else "mechanical"
    lower = [
        bar_view(
            f"rms error per step [{unit}], beside its noise floor",
            f"/errors/{signal}",
            f"/floor/{signal}",
            legend=True,
        )
    ]
    if result.ladder[0].map_of(signal, angle) is not None:
        lower.append(
            bar_view(
                f"mean error [{over}] over {turn} angle [°]",
                f"/angle/{signal}",
                f"/angle_axis/{signal}",
            )
        )
    lower.append(bar_view("held-out error in noise floors, % of windows", f"/spread/{signal}"))
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
            names=quantity_words(signal), colors=PALETTE[place % len(PALETTE)], widths=2.5
        )
        for place, signal in enumerate(signals)
    }
    return rrb.Horizontal(
        rrb.TimeSeriesView(
            origin="/over",
            name="error over noise floor, step by step",
            contents=list(lines),
            overrides=lines,
            plot_legend=rrb.Corner2D.RightTop,
        ),
        _page(),
        column_shares=[1.6, 1.0],
        name="All steps",
    )
