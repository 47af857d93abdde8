"""One motor as a Rerun recording: the row of the fleet's table, and what opens from it.

A recording holds the entities

    /sheet                the datasheet as a markdown page, /checks its checks
    /constants            every constant on the timeline `row`, in the datasheet's numbers
    /overview/SIGNAL      residuals of all captures [% of the signal's reach], 1000 steps each, on
                          the timeline `capture`; /overview_lane which capture that is
    /cogging/wave, orders zero-current torque over one turn [mN·m], and by order
    /preview/residual     all residuals as one curve, red where the datasheet is refused
    /preview/cogging      four periods of the zero-current torque
    /findings             one text log line a finding at its capture, on `capture`

and the properties `motor` and `shown` (key constants in the table's units).
Two motors differ in what they hold, never in where, so that one layout fits a whole fleet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import polars as pl
import rerun as rr
from rerun import RecordingStream

from pipeline.io.recordings.capture_maps import FULL_COLOUR_SHARE, signal_floor
from pipeline.io.recordings.capture_traces import first_of_each, own_evidence
from pipeline.io.recordings.datasheet_page import checks_markdown, sheet_markdown
from pipeline.io.recordings.fleet import motor_layout
from pipeline.io.recordings.fleet_columns import APPLICATION, CAPTURE, SHOWN, STEPS_A_CAPTURE
from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.stream import (
    ROW,
    Bars,
    placed,
    recording,
    send_bars,
    send_page,
    send_property,
    send_rows,
    send_trace,
)
from pipeline.io.recordings.views import MEASURED, MODEL, RESIDUAL
from pipeline.numerics.thinning import line_points
from pipeline.records.capture import Array, Campaign, Indices
from pipeline.records.datasheet import Datasheet
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem

POINTS_A_SERIES = 400
WAVE_CELLS, PREVIEW_PERIODS = 720, 4
HIGHEST_ORDER = 120
ORDER = ("refused", "provisional", "released")


KEY_CONSTANTS = tuple(one.constant for one in SHOWN)


@dataclass(frozen=True, slots=True)
class Strip:
    """One series in the overview: residual [% of the signal's reach] at `places` of `CAPTURE`."""

    capture: str
    signal: str
    places: Indices
    percent: Array


def motor_bytes(
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: Sequence[Evidence],
    findings: Sequence[Finding],
) -> bytes:
    """The recording of one motor as bytes.

    Parameters
    ----------
    campaign
        Its captures.
    datasheet
        Its datasheet.
    evidence
        Plots of the fits.
    findings
        On its files.

    """
    strips = tuple(overview(campaign, evidence))
    signals = list(dict.fromkeys(strip.signal for strip in strips))
    layout = motor_layout(signals, len({strip.capture for strip in strips}))
    ids = APPLICATION, segment_id(datasheet)
    with recording(datasheet.motor_id, (), layout, ids) as recorded:
        send_page(recorded.stream, "/sheet", sheet_markdown(datasheet, KEY_CONSTANTS))
        send_page(recorded.stream, "/checks", checks_markdown(datasheet))
        _send_constants(recorded.stream, datasheet)
        _send_overview(recorded.stream, strips, refused=datasheet.status == "refused")
        _send_cogging(recorded.stream, evidence)
        _send_findings(recorded.stream, strips, findings)
        _send_properties(recorded.stream, datasheet, strips)
    return recorded.content


def segment_id(datasheet: Datasheet) -> str:
    """The id of a motor's recording, which names its row: one a motor, whatever its serial number.

    Parameters
    ----------
    datasheet
        Its datasheet.

    """
    return file_stem(datasheet.motor_id)


def overview(campaign: Campaign, evidence: Sequence[Evidence]) -> Iterator[Strip]:
    """Residuals of every capture, all equally wide, relative to the signal's range on this motor.

    Parameters
    ----------
    campaign
        Captures of the motor.
    evidence
        Plots of the fits.

    Yields
    ------
    Strip
        Relative to the range in its own capture, a torque of nothing but cogging would seem all
        wrong.

    """
    fits = [(c.path, first_of_each(own_evidence(c, evidence))) for c in campaign.captures]
    drawn = [(number, *one) for number, one in enumerate(one for one in fits if one[1])]
    reach: dict[str, float] = {}
    for _, _, fits_of_path in drawn:
        for one in fits_of_path:
            floor_percent = signal_floor(one.series[0].measured) / FULL_COLOUR_SHARE
            reach[one.y_name] = max(floor_percent, reach.get(one.y_name, 0.0))
    for number, path, fits_of_path in drawn:
        for one in fits_of_path:
            series = one.series[0]
            percent = 100.0 * (series.measured - series.fitted) / reach[one.y_name]
            rows = line_points(percent, POINTS_A_SERIES)
            span = float(series.x[-1] - series.x[0]) or 1.0
            share = (series.x[rows] - series.x[0]) / span
            places = np.rint((number + share * 0.98) * STEPS_A_CAPTURE).astype(np.int64)
            # a gap after the last value, so that no line is drawn to the next capture
            places, values = np.append(places, places[-1] + 1), np.append(percent[rows], np.nan)
            yield Strip(path, one.y_name, places, values)


def _send_constants(stream: RecordingStream, datasheet: Datasheet) -> None:
    """One row a constant; text where there is no number, so that no row is dropped."""
    estimates = [est for _, est in sorted(datasheet.constants.items())]
    numbers = pl.DataFrame(
        {
            "value": [None if e.value is None else float(e.value) for e in estimates],
            "u": [e.u if e.known else None for e in estimates],
        },
        schema={"value": pl.Float64, "u": pl.Float64},
    )
    texts: dict[str, list[str]] = {
        "name": [e.name for e in estimates],
        "unit": [e.unit for e in estimates],
        "status": [e.status for e in estimates],
        "method": [e.method for e in estimates],
    }
    frame = pl.DataFrame({k: [drawable(t) for t in v] for k, v in texts.items()})
    table = pl.concat([frame, numbers], how="horizontal")
    send_trace(stream, placed("/constants", ROW, table))


def _send_overview(stream: RecordingStream, strips: Sequence[Strip], *, refused: bool) -> None:
    for strip in strips:
        frame = pl.DataFrame({"percent": strip.percent.astype(np.float32)})
        send_trace(stream, placed(f"/overview/{strip.signal}", CAPTURE, frame, strip.places))
    if not strips:
        return
    places = np.concatenate([strip.places for strip in strips])
    order = np.argsort(places, kind="stable")
    percent = np.concatenate([strip.percent for strip in strips])[order]
    style = rr.SeriesLines(
        colors=RESIDUAL if refused else MEASURED,
        names="residual [%]",
        aggregation_policy=rr.components.AggregationPolicy.MinMax,
    )
    stream.log("/preview/residual", style, static=True)
    columns = rr.Scalars.columns(scalars=percent)
    send_rows(stream, "/preview/residual", CAPTURE, places[order].tolist(), columns)
    starts = _starts(strips)
    states = rr.StateChange.columns(state=[drawable(_stem(name)) for name in starts])
    send_rows(stream, "/overview_lane", CAPTURE, list(starts.values()), states)


def _starts(strips: Sequence[Strip]) -> dict[str, int]:
    """Where each capture begins in the overview."""
    return {strip.capture: int(strip.places[0]) for strip in reversed(strips)}


def _send_cogging(stream: RecordingStream, evidence: Sequence[Evidence]) -> None:
    """Torque over one turn, both directions averaged so that friction drops out; its orders."""
    of_cogging = [one for one in evidence if one.estimator == "cogging"]
    for one in of_cogging:
        if one.kind == "bars":
            series = one.series[0]
            low = series.x <= HIGHEST_ORDER
            if low.any():
                values, edges = 1e3 * series.measured[low], series.x[low] - 0.4
                send_bars(stream, "/cogging/orders", Bars(values, edges, 0.8, MODEL))
        else:
            wave, edges = _wave(one)
            width = 360.0 / WAVE_CELLS
            send_bars(stream, "/cogging/wave", Bars(wave, edges, width, RESIDUAL))
            order = 1 + int(np.argmax(np.abs(np.fft.rfft(wave))[1:]))
            cells = max(WAVE_CELLS * PREVIEW_PERIODS // order, 2)
            preview = Bars(wave[:cells], edges[:cells], width, RESIDUAL)
            send_bars(stream, "/preview/cogging", preview)


def _wave(evidence: Evidence) -> tuple[Array, Array]:
    """Means over cells of one turn [mN·m] of all directions, each less its own mean."""
    turn = 2.0 * np.pi
    total = np.zeros(WAVE_CELLS)
    for series in evidence.series:
        finite = np.isfinite(series.measured)
        place = (np.mod(series.x[finite], turn) / turn * WAVE_CELLS).astype(int) % WAVE_CELLS
        values = series.measured[finite] - series.measured[finite].mean()
        count = np.bincount(place, minlength=WAVE_CELLS)
        total += np.bincount(place, values, WAVE_CELLS) / np.maximum(count, 1)
    mean = 1e3 * total / len(evidence.series)
    return mean, np.arange(WAVE_CELLS) * 360.0 / WAVE_CELLS


def _send_findings(
    stream: RecordingStream, strips: Sequence[Strip], findings: Sequence[Finding]
) -> None:
    starts, ordered = _starts(strips), sorted(findings)
    lines = [drawable(f"{_stem(f.file)}: {f.message}; {f.remedy} [{f.code}]") for f in ordered]
    levels = ["ERROR" if f.severity == "refused" else "WARN" for f in ordered]
    places = [starts.get(f.file, 0) for f in ordered]
    columns = rr.TextLog.columns(
        text=lines or ["no capture was refused or warned of"], level=levels or ["INFO"]
    )
    send_rows(stream, "/findings", CAPTURE, places or [0], columns)


def _send_properties(
    stream: RecordingStream, datasheet: Datasheet, strips: Sequence[Strip]
) -> None:
    known = {name: e.number for name, e in sorted(datasheet.constants.items()) if e.known}
    failed = [check.name for check in datasheet.checks if check.status == "fail"]
    worst = max((float(np.nanmax(np.abs(s.percent))) for s in strips), default=None)
    motor: dict[str, Any] = {
        "id": datasheet.motor_id,
        "verdict": datasheet.status,
        "order": ORDER.index(datasheet.status),
        "lot": datasheet.lot or "",
        "type": datasheet.motor_type or "",
        "failed": ", ".join(failed) or "none",
        "captures": len({strip.capture for strip in strips}),
        "largest_residual_percent": None if worst is None else _round(worst),
    }
    send_property(stream, "motor", motor)
    shown = {s.key: _round(s.factor * known[s.constant]) for s in SHOWN if s.constant in known}
    send_property(stream, "shown", shown)


def _round(value: float) -> float:
    return float(f"{value:.4g}")


def _stem(path: str) -> str:
    return path.rsplit("/", 1)[-1].rsplit(".", 1)[0]
