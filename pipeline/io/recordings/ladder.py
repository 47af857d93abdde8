"""The ladder as a Rerun recording: drag the timeline `step` and the residual map goes quiet.

A recording holds, on the sequence timeline `step` and for every SIGNAL whose error is known,

    /sheet                 what this step adds, with parameters and errors, as a markdown page
    /errors/SIGNAL         rms error of the steps up to here (bars), in /floor/SIGNAL their floor
    /map/SIGNAL/picture    mean error over speed and q current, one colour scale for all steps
    /map/SIGNAL/values     the same numbers [unit of the signal] as a tensor
    /angle/SIGNAL          mean error over the electrical angle (torque: the mechanical one)
    /spread/SIGNAL         how the errors are spread, in noise floors
    /over/SIGNAL           the error over its floor, as a line over the steps

In the viewer it has one workspace a signal, and one for all.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb
from rerun import RecordingStream
from rerun.blueprint import Blueprint

from pipeline.io.recordings.datasheet_page import plain
from pipeline.io.recordings.error_map import map_view, send_frame, send_map
from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.stream import (
    Bars,
    recording,
    send_axis_ends,
    send_bars,
    send_property,
    send_rows,
)
from pipeline.io.recordings.views import (
    MEASURED,
    MODEL,
    PALETTE,
    RESIDUAL,
    bar_view,
    page_view,
    workspace,
)
from pipeline.io.storage.publish import canonical_json
from pipeline.physics.notation import Scale, quantity, scale_for
from pipeline.records.diagnosis import Diagnosis
from pipeline.views.ladder import (
    CURRENT,
    SPEED,
    LadderView,
    angle_of,
    ladder_view,
    mapped_signals,
    reaches,
)
from pipeline.views.names import quantity_words

TIMELINE = "step"
WORDS = ("speed [rad/s]", "iq [A]")


def ladder_bytes(result: Diagnosis) -> bytes:
    """The recording of the search of one motor as bytes.

    Parameters
    ----------
    result
        The diagnosis.

    """
    identity = canonical_json(result.document()).decode()
    name = f"{result.motor_id} ladder"
    with recording(name, (identity,), ladder_layout(result)) as recorded:
        _send_sheets(recorded.stream, result)
        for signal in mapped_signals(result):
            _send_errors(recorded.stream, result, signal)
            _send_maps(recorded.stream, result, signal)
            _send_angle_ends(recorded.stream, result, signal)
            _send_spread(recorded.stream, result, signal)
        stated = {"motor_id": result.motor_id, "model": result.model, "verdict": result.verdict}
        send_property(recorded.stream, "diagnosis", stated)
    return recorded.content


def _send_sheets(stream: RecordingStream, result: Diagnosis) -> None:
    pages = [drawable(step_markdown(result, place)) for place in range(len(result.ladder))]
    kinds = [rr.MediaType.MARKDOWN] * len(pages)
    columns = rr.TextDocument.columns(text=pages, media_type=kinds)
    send_rows(stream, "/sheet", TIMELINE, range(len(pages)), columns)


def _send_errors(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    """Bars that grow with the step, and the same over the noise floor as a line."""
    scale = error_scale(result, signal)
    errors = [step.errors[signal] for step in result.ladder]
    rmse = np.array([scale.shown(error.rmse) for error in errors])
    floor = np.array([scale.shown(error.noise_floor) for error in errors])
    places = np.arange(rmse.size, dtype=np.float64)
    for entity, values, colour in (("errors", rmse, MODEL), ("floor", floor, MEASURED)):
        for step in range(rmse.size):
            shown = np.where(places <= step, values, 0.0)
            bars = Bars(shown, places, 0.7, colour)
            send_bars(stream, f"/{entity}/{signal}", bars, (TIMELINE, step))
    columns = rr.Scalars.columns(scalars=rmse / np.maximum(floor, 1e-300))
    send_rows(stream, f"/over/{signal}", TIMELINE, range(rmse.size), columns)


def _send_maps(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    reach = map_reach(result, signal)
    for place, step in enumerate(result.ladder):
        flat = step.map_of(signal, SPEED, CURRENT)
        if flat is not None:
            send_map(stream, f"/map/{signal}", flat, reach, (TIMELINE, place))
            if place == 0:
                send_frame(stream, f"/map/{signal}", flat, reach, WORDS)
        turn = step.map_of(signal, angle_of(signal))
        if turn is not None:
            edges = np.degrees(np.array(turn.x.edges))
            shown = np.nan_to_num(turn.mean) / 10.0 ** angle_scale(result, signal).exponent
            bars = Bars.between(edges, shown, RESIDUAL)
            send_bars(stream, f"/angle/{signal}", bars, (TIMELINE, place))


def _send_angle_ends(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    """Two marks beyond the turn that keep the bars' axis the same on every step."""
    reach = angle_scale(result, signal).shown(angle_reach(result, signal))
    send_axis_ends(stream, f"/angle_axis/{signal}", (reach, -reach), 360.0)


def _send_spread(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    for place, step in enumerate(result.ladder):
        for spread in step.histograms:
            if spread.signal == signal:
                edges = np.array(spread.edges)
                share = 100.0 * np.array(spread.count) / max(sum(spread.count), 1)
                bars = Bars.between(edges, share, MEASURED)
                send_bars(stream, f"/spread/{signal}", bars, (TIMELINE, place))


def step_markdown(result: Diagnosis, place: int) -> str:
    """One step of the search as a page: what was added, its parameters, all errors so far.

    Parameters
    ----------
    result
        The diagnosis.
    place
        Number of the step; the last one has the verdict too.

    """
    view = ladder_view(result)
    step = view.steps[place]
    lines = [f"# Step {place}: {plain(step.title)}", ""]
    for text in (*step.headlines, *step.explanations):
        lines += [plain(text), ""]
    lines += [f"Held-out error **{step.held_out}** (1 is the noise floor)", ""]
    if step.parameters:
        lines += ["| parameter | value ± U (k = 2) |", "| --- | --- |"]
        lines += [f"| {plain(name)} | {text} |" for name, text in step.parameters] + [""]
    lines += _table(view, place)
    if place == len(view.steps) - 1:
        lines += ["", f"**{result.verdict}**: {plain(view.headline)}"]
        for doubt in view.doubts:
            alternatives = (
                f"{doubt.effect} could as well be {doubt.alternatives}: {'; '.join(doubt.tests)}"
            )
            lines += ["", plain(alternatives)]
        if result.unknown is not None:
            one = result.unknown
            lines += ["", f"Left over in {plain(one.signal)}: {plain(one.shape)}"]
        lines += [line for note in result.notes for line in ("", plain(note))]
    return "\n".join(
        [*lines, "", "Drag the time cursor (timeline `step`) to go from step to step.", ""]
    )


def _table(view: LadderView, place: int) -> Iterator[str]:
    """The steps so far, the latest first, of the signals whose noise floor is known."""
    columns = [n for n, cell in enumerate(view.steps[0].errors) if cell is not None and cell.floor]
    names = [cell.signal for cell in view.steps[0].errors if cell is not None and cell.floor]
    yield "| step | model | held out | " + " | ".join(map(plain, names)) + " |"
    yield "| --- | --- | --- |" + " --- |" * len(names)
    floors = [cell.floor if (cell := view.steps[place].errors[n]) else "" for n in columns]
    yield "|  | noise floor | 1 | " + " | ".join(floors) + " |"
    for step in reversed(view.steps[: place + 1]):
        cells = [cell.rmse if (cell := step.errors[n]) else "" for n in columns]
        last = "**" if step.number == place else ""
        change = f" ({step.change})" if step.change else ""
        yield (
            f"| {last}{step.number}{last} | {plain(step.title)} | {step.held_out}{change} | "
            + " | ".join(cells)
            + " |"
        )


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
    if any(spread.signal == signal for spread in result.ladder[0].histograms):
        lower.append(bar_view("held-out error in noise floors, % of windows", f"/spread/{signal}"))
    shares = [1.0, 1.5][: len(upper)]
    return rrb.Vertical(
        rrb.Horizontal(*upper, column_shares=shares),
        rrb.Horizontal(*lower),
        row_shares=[1.5, 1.0],
        name=named,
    )


def _overview(signals: tuple[str, ...]) -> Any:
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


def map_reach(result: Diagnosis, signal: str) -> float:
    """Full colour of the maps of a signal over speed and current, the same on all steps.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    Returns
    -------
    float
        In the unit of the signal.

    """
    return reaches(result.ladder).get((signal, SPEED), 0.0)


def error_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which the errors of a signal are drawn on all steps: mV where volts would be
    small.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    """
    errors = [step.errors[signal] for step in result.ladder]
    return scale_for(max(e.rmse for e in errors), errors[0].unit)


def angle_reach(result: Diagnosis, signal: str) -> float:
    """The largest mean error over the angle on any step.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    Returns
    -------
    float
        In the unit of the signal.

    """
    return reaches(result.ladder).get((signal, angle_of(signal)), 0.0)


def angle_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which the error of a signal is drawn over the angle on all steps.

    Parameters
    ----------
    result
        The diagnosis.
    signal
        Glossary name.

    """
    return scale_for(angle_reach(result, signal), result.ladder[0].errors[signal].unit)
