"""One capture as a Rerun recording: its traces, what a model makes of them, what was found wrong.

A recording holds the entities

    /measured, /measured_1  every table of the capture, one component a column, float32; a long
                            one as the fields of one component
    /samples                rows of the first table as components, where it is a long one
    /model/ESTIMATOR/N      `measured`, `fitted`, `residual` of each series fitted to this capture
    /maps/SIGNAL            residual over speed and current: `picture`, `values`; `axes`, `bar`
    /angle/SIGNAL           residual over one turn; /orders/SIGNAL its amplitudes by order
    /lanes/regime, rows     what the machine did; rows that a gate set aside
    /findings               one text log line a finding, rows set aside, residual; at its row
    /datasheet              the motor's constants as a markdown page

on the timeline `t` (duration) or, for a table without `t_s`, `row`.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import islice
from pathlib import PurePosixPath

import numpy as np
from rerun import RecordingStream

from pipeline.io.recordings.capture_lanes import lanes_of, lines_of, send_lane, send_lines
from pipeline.io.recordings.capture_maps import ResidualMaps, residual_maps
from pipeline.io.recordings.capture_traces import (
    capture_traces,
    first_of_each,
    fit_traces,
    own_evidence,
    sample_table,
)
from pipeline.io.recordings.capture_views import Shown, capture_layout
from pipeline.io.recordings.datasheet_page import capture_markdown
from pipeline.io.recordings.error_map import send_frame, send_map
from pipeline.io.recordings.stream import (
    Bars,
    recording,
    send_axis_ends,
    send_bars,
    send_page,
    send_property,
    send_trace,
)
from pipeline.io.recordings.views import MODEL, RESIDUAL
from pipeline.physics.notation import scale_for
from pipeline.records.capture import Capture
from pipeline.records.datasheet import Datasheet
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding

MOST_MAPS = 2
MAP_WORDS = ("speed [rad/s]", "iq [A]")


def recording_bytes(
    capture: Capture,
    evidence: Sequence[Evidence],
    datasheet: Datasheet | None = None,
    findings: Sequence[Finding] = (),
) -> bytes:
    """The recording of one capture as bytes.

    Parameters
    ----------
    capture
        The capture.
    evidence
        Plots of the fits.
    datasheet
        Shown as a page; None without one.
    findings
        Shown as a log.

    """
    of_capture = own_evidence(capture, evidence)
    traces, fits = list(capture_traces(capture)), list(fit_traces(of_capture))
    drawn = (residual_maps(capture, one) for one in first_of_each(of_capture))
    maps = tuple(islice((one for one in drawn if one is not None), MOST_MAPS))
    name = f"{capture.meta.motor_id} {PurePosixPath(capture.path).stem}"
    table = sample_table(traces)
    lanes = lanes_of(capture)
    shown = Shown(traces, fits, maps, tuple(lanes), datasheet is not None, table)
    with recording(name, identity(capture, datasheet), capture_layout(shown)) as recorded:
        for trace in (*traces, *(fit.trace for fit in fits)):
            send_trace(recorded.stream, trace)
        if table is not None and table[1] > 1:
            send_trace(recorded.stream, table[0])
        for one in maps:
            _send_maps(recorded.stream, one)
        for entity, lane in lanes.items():
            send_lane(recorded.stream, entity, capture, lane)
        send_lines(recorded.stream, capture, lines_of(capture, of_capture, findings))
        _send_properties(recorded.stream, capture)
        if datasheet is not None:
            send_page(recorded.stream, "/datasheet", capture_markdown(datasheet, capture.path))
    return recorded.content


def identity(capture: Capture, datasheet: Datasheet | None) -> tuple[str, str, str]:
    """What the id of a recording is made of: the same work has the same id.

    Parameters
    ----------
    capture
        The capture.
    datasheet
        Its version counts.

    """
    return capture.path, capture.sha256, "" if datasheet is None else datasheet.version


def _send_maps(stream: RecordingStream, maps: ResidualMaps) -> None:
    if maps.flat is not None:
        send_map(stream, f"/maps/{maps.signal}", maps.flat, maps.reach)
        send_frame(stream, f"/maps/{maps.signal}", maps.flat, maps.reach, MAP_WORDS)
    if maps.turn is None:
        return
    scale = scale_for(max(maps.turn.reach, maps.floor), maps.unit)
    edges = np.degrees(np.array(maps.turn.x.edges))
    shown = np.nan_to_num(maps.turn.mean) / 10.0**scale.exponent
    send_bars(stream, f"/angle/{maps.signal}", Bars.between(edges, shown, RESIDUAL))
    most = scale.shown(max(maps.turn.reach, maps.floor))
    send_axis_ends(stream, f"/angle_axis/{maps.signal}", (most, -most), edges[-1])
    if maps.orders.size:
        places = np.arange(1.0, maps.orders.size + 1.0) - 0.4
        amplitudes = maps.orders / 10.0**scale.exponent
        send_bars(stream, f"/orders/{maps.signal}", Bars(amplitudes, places, 0.8, MODEL))
        send_axis_ends(stream, f"/orders_axis/{maps.signal}", (most,), places[-1] + 1.0)


def _send_properties(stream: RecordingStream, capture: Capture) -> None:
    names = ("motor_id", "motor_type", "lot", "station", "test", "started_at")
    stated = {name: getattr(capture.meta, name) for name in names}
    of_file = {"file": capture.path, "sha256": capture.sha256, "integrity": capture.integrity}
    send_property(stream, "capture", stated | of_file)
