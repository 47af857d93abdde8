"""The ladder as a Rerun recording: drag the timeline `rung` and the residual map goes quiet.

A recording holds, on the sequence timeline `rung` and for every SIGNAL whose error is told,

    /sheet                 what this rung adds, with parameters and errors, as a markdown page
    /errors/SIGNAL         rms error of the rungs up to here (bars), in /floor/SIGNAL their floor
    /map/SIGNAL/picture    mean error over speed and q current, one colour scale for all rungs
    /map/SIGNAL/values     the same numbers [unit of the signal] as a tensor
    /angle/SIGNAL          mean error over the electrical angle (torque: the mechanical one)
    /spread/SIGNAL         how the errors are spread, in noise floors
    /over/SIGNAL           the error over its floor, as a line over the rungs

Two files of equal input differ in the ids that Rerun draws, so compare their content.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from pipeline.io.publish import canonical_json, write_whole
from pipeline.io.recording import APPLICATION, FLUSH_S
from pipeline.io.recording_ladder_sheet import rung_markdown
from pipeline.io.recording_layout import MEASURED, MODEL, RESIDUAL
from pipeline.io.recording_map import BAR_GAP, CELL, bar_picture, map_labels, map_picture
from pipeline.physics.notation import Scale, scale_for
from pipeline.records.diagnosis import Diagnosis, LadderRung
from pipeline.records.error_map import ErrorMap

if TYPE_CHECKING:
    from rerun import RecordingStream

RUNG = "rung"
SPEED, CURRENT = "omega_mech_rad_s", "iq_a"
WORDS = ("speed [rad/s]", "iq [A]")
_GREY = (140, 140, 140)
_FAINT = (140, 140, 140, 60)


def write_ladder_recording(result: Diagnosis, path: Path) -> None:
    """Writes the ladder of one motor as .rrd; MachineError where the disk refuses."""
    write_whole(path, ladder_bytes(result))


def ladder_bytes(result: Diagnosis) -> bytes:
    """The .rrd of one motor's ladder, made in memory."""
    import rerun as rr

    from pipeline.io.recording_ladder_layout import ladder_layout

    rr.set_strict_mode(True)
    digest = hashlib.sha256(canonical_json(result.document())).hexdigest()[:32]
    stream = rr.RecordingStream(APPLICATION, recording_id=digest, send_properties=False)
    memory = stream.memory_recording()
    layout = ladder_layout(result)
    stream.send_blueprint(layout, make_active=False, make_default=True)
    _send_sheets(stream, result)
    for signal in shown_signals(result):
        _send_errors(stream, result, signal)
        _send_maps(stream, result, signal)
        _send_angle_ends(stream, result, signal)
        _send_spread(stream, result, signal)
    stated: dict[str, Any] = {
        "motor_id": result.motor_id,
        "model": result.model,
        "verdict": result.verdict,
    }
    stream.send_property("diagnosis", rr.AnyValues(**stated))
    stream.flush(timeout_sec=FLUSH_S)
    content: bytes = memory.drain_as_bytes()
    return content


def shown_signals(result: Diagnosis) -> tuple[str, ...]:
    """Signals with an error on every rung, the one farthest over its noise floor first."""
    if not result.ladder:
        return ()
    first = result.ladder[0].errors
    everywhere = [name for name in first if all(name in rung.errors for rung in result.ladder)]

    def over(name: str) -> float:
        return first[name].rmse / max(first[name].noise_floor, 1e-300)

    mapped = [n for n in everywhere if result.ladder[0].map_of(n, SPEED, CURRENT) is not None]
    rest = [name for name in everywhere if name not in mapped]
    return (*sorted(mapped, key=lambda n: (-over(n), n)), *sorted(rest, key=lambda n: -over(n)))


def angle_of(signal: str) -> str:
    """The angle that a signal's error is drawn over: torque ripples with the shaft."""
    return "theta_mech_rad" if signal == "torque_shaft_nm" else "theta_elec_rad"


def common_reach(ladder: Sequence[LadderRung], signal: str) -> float:
    """Full colour of a signal's maps on all rungs [unit]: no more than the first rung's largest."""
    flat = [rung.map_of(signal, SPEED, CURRENT) for rung in ladder]
    return max((one.reach for one in flat if one is not None), default=0.0)


def error_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which a signal's errors are drawn on all rungs: mV where volts would be small."""
    errors = [rung.errors[signal] for rung in result.ladder]
    return scale_for(max(e.rmse for e in errors), errors[0].unit)


def angle_reach(result: Diagnosis, signal: str) -> float:
    """The largest mean error over the angle on any rung [unit]."""
    turns = [rung.map_of(signal, angle_of(signal)) for rung in result.ladder]
    return max((one.reach for one in turns if one is not None), default=0.0)


def angle_scale(result: Diagnosis, signal: str) -> Scale:
    """The unit in which a signal's error is drawn over the angle on all rungs."""
    return scale_for(angle_reach(result, signal), result.ladder[0].errors[signal].unit)


def _send(stream: RecordingStream, entity: str, rungs: Sequence[int], columns: Any) -> None:
    import rerun as rr

    index = rr.TimeColumn(RUNG, sequence=list(rungs))
    rr.send_columns(entity, indexes=[index], columns=columns, recording=stream)


def _send_sheets(stream: RecordingStream, result: Diagnosis) -> None:
    import rerun as rr

    pages = [rung_markdown(result, place) for place in range(len(result.ladder))]
    kinds = [rr.MediaType.MARKDOWN] * len(pages)
    rungs = range(len(pages))
    _send(stream, "/sheet", rungs, rr.TextDocument.columns(text=pages, media_type=kinds))


def _send_errors(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    """Bars that grow with the rung, and the same over the noise floor as a line."""
    import rerun as rr

    scale = error_scale(result, signal)
    errors = [rung.errors[signal] for rung in result.ladder]
    rmse = np.array([scale.shown(error.rmse) for error in errors])
    floor = np.array([scale.shown(error.noise_floor) for error in errors])
    places = np.arange(rmse.size, dtype=np.float64)
    for entity, values, colour in (("errors", rmse, MODEL), ("floor", floor, MEASURED)):
        for rung in range(rmse.size):
            shown = np.where(places <= rung, values, 0.0)
            _send_bars(stream, f"/{entity}/{signal}", rung, shown, places, 0.7, colour)
    over = rmse / np.maximum(floor, 1e-300)
    columns = rr.Scalars.columns(scalars=over)
    _send(stream, f"/over/{signal}", range(rmse.size), columns)


def _tensor(values: NDArray[np.float64]) -> Any:
    """One row of a column of tensors; a bare list of arrays would become one of more axes."""
    import rerun as rr

    return rr.encodings.TensorData(array=np.ascontiguousarray(values))


def _send_bars(
    stream: RecordingStream,
    entity: str,
    rung: int,
    values: NDArray[np.float64],
    places: NDArray[np.float64],
    width: float,
    colour: tuple[int, int, int],
) -> None:
    import rerun as rr

    columns = rr.BarChart.columns(
        values=_tensor(values), abscissa=_tensor(places), color=[colour], widths=[width]
    )
    _send(stream, entity, [rung], columns)


def _send_maps(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    import rerun as rr

    reach = common_reach(result.ladder, signal)
    for place, rung in enumerate(result.ladder):
        flat = rung.map_of(signal, SPEED, CURRENT)
        if flat is not None:
            picture = map_picture(flat, reach)
            shape = rr.encodings.ImageFormat(
                width=picture.shape[1],
                height=picture.shape[0],
                color_model="RGB",
                channel_datatype="U8",
            )
            columns = rr.Image.columns(buffer=[picture.tobytes()], format=[shape])
            _send(stream, f"/map/{signal}/picture", [place], columns)
            _send(
                stream, f"/map/{signal}/values", [place], rr.Tensor.columns(data=_tensor(flat.mean))
            )
            if place == 0:
                _send_frame(stream, signal, flat, reach)
        turn = rung.map_of(signal, angle_of(signal))
        if turn is not None:
            edges = np.degrees(np.array(turn.x.edges))
            shown = np.nan_to_num(turn.mean) / 10.0 ** angle_scale(result, signal).exponent
            _send_bars(
                stream,
                f"/angle/{signal}",
                place,
                shown,
                edges[:-1],
                float(edges[1] - edges[0]),
                RESIDUAL,
            )


def _send_angle_ends(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    """Two marks beyond the turn that keep the bars' axis the same on every rung."""
    import rerun as rr

    reach = angle_scale(result, signal).shown(angle_reach(result, signal))
    marks = rr.BarChart([reach, -reach], abscissa=[362.0, 364.0], color=_FAINT, widths=[1.0, 1.0])
    stream.log(f"/angle_axis/{signal}", marks, static=True)


def _send_frame(stream: RecordingStream, signal: str, flat: ErrorMap, reach: float) -> None:
    """Ticks, words and the border of a map; they are the same on every rung."""
    import rerun as rr

    labels = map_labels(flat, reach, WORDS)
    points = rr.Points2D(
        labels.places, labels=list(labels.texts), show_labels=True, radii=0.01, colors=_GREY
    )
    stream.log(f"/map/{signal}/axes", points, static=True)
    rows, columns = flat.mean.shape
    border = np.array([[0, 0], [columns, 0], [columns, rows], [0, rows], [0, 0]]) * CELL
    frame = rr.LineStrips2D([border], colors=_GREY, radii=0.5)
    stream.log(f"/map/{signal}/frame", frame, static=True)
    place = rr.Transform3D(translation=[columns * CELL + BAR_GAP, 0.0, 0.0])
    stream.log(f"/map/{signal}/bar", place, rr.Image(bar_picture(rows)), static=True)


def _send_spread(stream: RecordingStream, result: Diagnosis, signal: str) -> None:
    for place, rung in enumerate(result.ladder):
        for spread in rung.histograms:
            if spread.signal == signal:
                edges = np.array(spread.edges)
                share = 100.0 * np.array(spread.count) / max(sum(spread.count), 1)
                width = float(edges[1] - edges[0])
                _send_bars(stream, f"/spread/{signal}", place, share, edges[:-1], width, MEASURED)
