"""One motor as a Rerun recording: the row of the fleet's table, and what opens from it.

A recording holds the entities

    /sheet                the datasheet as a markdown page, /checks its checks
    /constants            every constant on the timeline `row`, in the datasheet's numbers
    /overview/SIGNAL      residuals of every capture in a row [% of the signal's reach] on `t`
    /overview_lane        which capture that is
    /preview              the same as one curve, red where the datasheet is refused
    /cogging/wave, orders zero-current torque over one turn [mN·m], and by order
    /findings             one text log line a finding on `row`

and the properties `motor`, `constants` (as the datasheet) and `shown` (in the table's units).
Two motors differ in what they hold, never in where, so that one layout fits a whole fleet.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pipeline.io.recordings.capture import first_of_each, own_evidence
from pipeline.io.recordings.capture_maps import FULL_COLOUR_SHARE, signal_floor
from pipeline.io.recordings.datasheet_page import checks_markdown, sheet_markdown
from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.seal import write_sealed
from pipeline.io.recordings.stream import (
    ROW,
    TIME,
    nanoseconds,
    recording,
    send_bars,
    send_page,
    send_property,
    send_trace,
    timed,
)
from pipeline.records.capture import Campaign
from pipeline.records.datasheet import Datasheet
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.records.naming import file_stem

if TYPE_CHECKING:
    from rerun import RecordingStream

Array = NDArray[np.float64]

POINTS_A_SERIES = 400
GAP_SHARE = 0.02
WAVE_CELLS = 180
HIGHEST_ORDER = 60
APPLICATION = "fleet"
ORDER = ("refused", "provisional", "released")


@dataclass(frozen=True, slots=True)
class Shown:
    """A constant of the fleet's table: its property, heading, and factor from the SI unit."""

    constant: str
    key: str
    heading: str
    factor: float


SHOWN = (
    Shown("r_phase_ohm", "r_phase_mohm", "R [mΩ]", 1e3),
    Shown("ld_h", "ld_uh", "Ld [µH]", 1e6),
    Shown("lq_h", "lq_uh", "Lq [µH]", 1e6),
    Shown("psi_pm_wb", "psi_pm_mwb", "ψ [mWb]", 1e3),
    Shown("kt_peak_nm_a", "kt_peak_mnm_a", "Kt [mN·m/A]", 1e3),
    Shown("cogging_amplitude_nm", "cogging_mnm", "cogging [mN·m]", 1e3),
    Shown("j_rotor_kgm2", "j_rotor_gcm2", "J [g·cm²]", 1e7),
    Shown("torque_coulomb_nm", "torque_coulomb_mnm", "friction [mN·m]", 1e3),
)


@dataclass(frozen=True, slots=True)
class Strip:
    """One series in the overview: residual [% of the signal's reach] of one capture, on `t_s`."""

    capture: str
    signal: str
    t_s: Array
    percent: Array


def write_motor_recording(
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: Sequence[Evidence],
    findings: Sequence[Finding],
    path: Path,
) -> None:
    """Writes one motor's .rrd and its seal; MachineError where the disk refuses."""
    write_sealed(path, motor_bytes(campaign, datasheet, evidence, findings))


def motor_bytes(
    campaign: Campaign,
    datasheet: Datasheet,
    evidence: Sequence[Evidence],
    findings: Sequence[Finding],
) -> bytes:
    """The .rrd of one motor, made in memory."""
    from pipeline.io.recordings.fleet import motor_layout

    strips = tuple(overview(campaign, evidence))
    with recording(
        datasheet.motor_id,
        (),
        motor_layout(signals_of(strips)),
        (APPLICATION, segment_id(datasheet)),
    ) as made:
        send_page(made.stream, "/sheet", sheet_markdown(datasheet, ""))
        send_page(made.stream, "/checks", checks_markdown(datasheet))
        _send_constants(made.stream, datasheet)
        _send_overview(made.stream, strips, refused=datasheet.status == "refused")
        _send_cogging(made.stream, evidence)
        _send_findings(made.stream, findings)
        _send_properties(made.stream, datasheet, strips)
    return made.content


def segment_id(datasheet: Datasheet) -> str:
    """The id of a motor's recording, which names its row: one a motor, whatever its serial."""
    return file_stem(datasheet.motor_id)


def overview(campaign: Campaign, evidence: Sequence[Evidence]) -> Iterator[Strip]:
    """What every capture leaves over, one capture after the other on a common time [s]."""
    begin = 0.0
    for capture in campaign.captures:
        told = first_of_each(own_evidence(capture, evidence))
        if not told:
            continue
        last = max(float(one.series[0].x[-1]) for one in told)
        first = min(float(one.series[0].x[0]) for one in told)
        for one in told:
            series = one.series[0]
            reach = signal_floor(series.measured) / FULL_COLOUR_SHARE
            percent = 100.0 * (series.measured - series.fitted) / reach
            kept = extremes(percent, POINTS_A_SERIES)
            yield Strip(capture.path, one.y_name, begin + series.x[kept] - first, percent[kept])
        begin += (last - first) * (1.0 + GAP_SHARE)


def signals_of(strips: Sequence[Strip]) -> tuple[str, ...]:
    """The quantities of an overview, in the order in which they first come."""
    return tuple(dict.fromkeys(strip.signal for strip in strips))


def extremes(values: Array, most: int) -> NDArray[np.int64]:
    """Places of the lowest and highest value of each of `most`/2 stretches: no spike is lost."""
    if values.size <= most:
        return np.arange(values.size)
    edges = np.linspace(0, values.size, most // 2 + 1).astype(np.int64)
    clean = np.nan_to_num(values)
    kept = {
        int(start + pick(clean[start:stop]))
        for start, stop in pairwise(edges)
        for pick in (np.argmin, np.argmax)
    }
    return np.array(sorted(kept), dtype=np.int64)


def _send_constants(stream: RecordingStream, datasheet: Datasheet) -> None:
    """One row a constant; text where there is no number, so that no row is dropped."""
    import rerun as rr

    told = [est for _, est in sorted(datasheet.constants.items())]
    numbers = pl.DataFrame(
        {
            "value": [None if e.value is None else float(e.value) for e in told],
            "u": [e.u if e.known else None for e in told],
        },
        schema={"value": pl.Float64, "u": pl.Float64},
    )
    texts: dict[str, list[str]] = {
        "name": [e.name for e in told],
        "unit": [e.unit for e in told],
        "status": [e.status for e in told],
        "method": [e.method for e in told],
    }
    frame = pl.DataFrame({k: [drawable(t) for t in v] for k, v in texts.items()})
    index = pl.Series(ROW, np.arange(len(told), dtype=np.int64))
    whole = pl.concat([frame, numbers], how="horizontal").insert_column(0, index)
    for batch in whole.to_arrow().to_batches():
        rr.send_record_batch(batch, stream, index=ROW, entity_path="/constants")


def _send_overview(stream: RecordingStream, strips: Sequence[Strip], *, refused: bool) -> None:
    import rerun as rr

    from pipeline.io.recordings.views import MEASURED, RESIDUAL

    for strip in strips:
        frame = pl.DataFrame({"percent": strip.percent.astype(np.float32)})
        send_trace(stream, timed(f"/overview/{strip.signal}", strip.t_s, frame))
    if not strips:
        return
    t_s = np.concatenate([strip.t_s for strip in strips])
    order = np.argsort(t_s, kind="stable")
    percent = np.concatenate([strip.percent for strip in strips])[order]
    style = rr.SeriesLines(colors=RESIDUAL if refused else MEASURED, names="residual [%]")
    stream.log("/preview", style, static=True)
    index = rr.TimeColumn(TIME, duration=nanoseconds(t_s[order]).astype("timedelta64[ns]"))
    columns = rr.Scalars.columns(scalars=percent)
    rr.send_columns("/preview", indexes=[index], columns=columns, recording=stream)
    starts = {strip.capture: strip.t_s[0] for strip in reversed(strips)}
    places = nanoseconds(np.array([starts[name] for name in starts]))
    rr.send_columns(
        "/overview_lane",
        indexes=[rr.TimeColumn(TIME, duration=places.astype("timedelta64[ns]"))],
        columns=rr.StateChange.columns(state=[drawable(_stem(name)) for name in starts]),
        recording=stream,
    )


def _send_cogging(stream: RecordingStream, evidence: Sequence[Evidence]) -> None:
    """Torque over one turn, both directions averaged so that friction drops out; its orders."""
    from pipeline.io.recordings.views import MODEL, RESIDUAL

    for one in evidence:
        if one.estimator != "cogging":
            continue
        if one.kind == "bars":
            series = one.series[0]
            low = series.x <= HIGHEST_ORDER
            values, left = 1e3 * series.measured[low], series.x[low] - 0.4
            if values.size:
                send_bars(stream, "/cogging/orders", values, left, 0.8, MODEL)
        else:
            wave, left = _wave(one)
            send_bars(stream, "/cogging/wave", wave, left, 360.0 / WAVE_CELLS, RESIDUAL)


def _wave(one: Evidence) -> tuple[Array, Array]:
    """Means over cells of one turn [mN·m] of all directions, each less its own mean."""
    turn = 2.0 * np.pi
    total = np.zeros(WAVE_CELLS)
    for series in one.series:
        fine = np.isfinite(series.measured)
        place = (np.mod(series.x[fine], turn) / turn * WAVE_CELLS).astype(int) % WAVE_CELLS
        values = series.measured[fine] - series.measured[fine].mean()
        count = np.bincount(place, minlength=WAVE_CELLS)
        total += np.bincount(place, values, WAVE_CELLS) / np.maximum(count, 1)
    mean = 1e3 * total / len(one.series)
    return mean, np.arange(WAVE_CELLS) * 360.0 / WAVE_CELLS


def _send_findings(stream: RecordingStream, findings: Sequence[Finding]) -> None:
    import rerun as rr

    told = sorted(findings)
    lines = [drawable(f"{_stem(f.file)}: {f.message}; {f.remedy} [{f.code}]") for f in told]
    levels = ["ERROR" if f.severity == "refused" else "WARN" for f in told]
    rr.send_columns(
        "/findings",
        indexes=[rr.TimeColumn(ROW, sequence=list(range(len(told) or 1)))],
        columns=rr.TextLog.columns(
            text=lines or ["no capture was refused or warned of"], level=levels or ["INFO"]
        ),
        recording=stream,
    )


def _send_properties(
    stream: RecordingStream, datasheet: Datasheet, strips: Sequence[Strip]
) -> None:
    known = {name: e.number for name, e in sorted(datasheet.constants.items()) if e.known}
    failed = [check.name for check in datasheet.checks if check.status == "fail"]
    marginal = [check.name for check in datasheet.checks if check.status == "marginal"]
    worst = max((float(np.nanmax(np.abs(s.percent))) for s in strips), default=None)
    motor: dict[str, Any] = {
        "id": datasheet.motor_id,
        "verdict": datasheet.status,
        "order": ORDER.index(datasheet.status),
        "lot": datasheet.lot or "",
        "type": datasheet.motor_type or "",
        "failed": ", ".join(failed) or "none",
        "marginal": ", ".join(marginal) or "none",
        "why": list(datasheet.why),
        "captures": len(datasheet.captures),
        "version": datasheet.version,
        "largest_residual_percent": None if worst is None else _round(worst),
    }
    send_property(stream, "motor", motor)
    send_property(stream, "constants", known)
    shown = {s.key: _round(s.factor * known[s.constant]) for s in SHOWN if s.constant in known}
    send_property(stream, "shown", shown)


def _round(value: float) -> float:
    return float(f"{value:.4g}")


def _stem(path: str) -> str:
    return path.rsplit("/", 1)[-1].rsplit(".", 1)[0]
