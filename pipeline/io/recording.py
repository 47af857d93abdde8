"""Rerun recordings: one capture's traces, what was fitted to them, and what was found wrong.

A recording holds the entities

    /measured, /measured_1  every table of the capture, one component a column, float32
    /model/ESTIMATOR/N      `measured`, `fitted`, `residual` of each series fitted to this capture
    /findings               one text log line a finding, at its first row
    /datasheet              the motor's constants as a markdown page

on the timeline `t` (duration) or, for a table without `t_s`, `row`. Two files of equal input
differ in the ids that Rerun draws, so compare their content, never their bytes.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pipeline.io.publish import write_whole
from pipeline.io.recording_sheet import sheet_markdown
from pipeline.records.capture import Capture
from pipeline.records.datasheet import Datasheet
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding

if TYPE_CHECKING:
    from rerun import RecordingStream, TimeColumn

APPLICATION = "motor-datasheets"
ROWS_A_CHUNK = 4096
TIME, ROW = "t", "row"
FLUSH_S = 300.0


@dataclass(frozen=True, slots=True)
class Trace:
    """A table on its way into a recording: `index` is `TIME` or `ROW`, the rest float32."""

    entity: str
    index: str
    frame: pl.DataFrame

    @property
    def columns(self) -> tuple[str, ...]:
        """The components, the index left out."""
        return tuple(name for name in self.frame.columns if name != self.index)


@dataclass(frozen=True, slots=True)
class FitTrace:
    """One fitted series: the quantity `y_name`, and its trace of measured, fitted, residual."""

    title: str
    label: str
    y_name: str
    trace: Trace
    reach: float


def write_recording(
    capture: Capture,
    evidence: Sequence[Evidence],
    path: Path,
    datasheet: Datasheet | None = None,
    findings: Sequence[Finding] = (),
) -> None:
    """Writes one capture's .rrd, whole or not at all, with the layout that shows it.

    `evidence` may be of the whole campaign; what was fitted to other captures is left out.
    Raises MachineError where the disk refuses.
    """
    write_whole(path, recording_bytes(capture, evidence, datasheet, findings))


def recording_bytes(
    capture: Capture,
    evidence: Sequence[Evidence],
    datasheet: Datasheet | None = None,
    findings: Sequence[Finding] = (),
) -> bytes:
    """One capture's .rrd, footer included.

    Made in memory, since a stream onto a full disk may wait for its dead writer for ever.
    """
    import rerun as rr

    from pipeline.io.recording_layout import capture_layout

    rr.set_strict_mode(True)
    traces, fits = list(capture_traces(capture)), list(fit_traces(capture, evidence))
    name = recording_id(capture, datasheet)
    stream = rr.RecordingStream(APPLICATION, recording_id=name, send_properties=False)
    memory = stream.memory_recording()
    stream.send_blueprint(capture_layout(traces, fits), make_active=False, make_default=True)
    _send(stream, capture, [*traces, *(fit.trace for fit in fits)])
    _send_texts(stream, capture, datasheet, findings)
    stream.flush(timeout_sec=FLUSH_S)
    content: bytes = memory.drain_as_bytes()
    return content


def recording_id(capture: Capture, datasheet: Datasheet | None) -> str:
    """The id of a recording: the same work, the same id."""
    parts = (capture.path, capture.sha256, "" if datasheet is None else datasheet.version)
    return hashlib.sha256("\n".join(parts).encode("utf-8", "surrogatepass")).hexdigest()[:32]


def capture_traces(capture: Capture) -> Iterator[Trace]:
    """Every table of a capture that has rows and columns to show."""
    for number, table in enumerate(capture.tables):
        entity = "/measured" if number == 0 else f"/measured_{number}"
        values = table.drop("t_s", strict=False).select(pl.all().cast(pl.Float32).fill_null(np.nan))
        if table.height == 0 or values.width == 0:
            continue
        if "t_s" in table.columns:
            yield timed(entity, table["t_s"].to_numpy(), values)
        else:
            rows = pl.Series(ROW, np.arange(table.height, dtype=np.int64))
            yield Trace(entity, ROW, values.insert_column(0, rows))


def fit_traces(capture: Capture, evidence: Sequence[Evidence]) -> Iterator[FitTrace]:
    """The series that were fitted to this capture over time."""
    for number, one in enumerate(evidence):
        if one.capture != capture.path or one.x_name != "t_s":
            continue
        for place, series in enumerate(one.series):
            if series.fitted.size == 0 or series.x.size == 0:
                continue
            with np.errstate(invalid="ignore"):
                residual = series.measured - series.fitted
            columns = {"measured": series.measured, "fitted": series.fitted, "residual": residual}
            frame = pl.DataFrame({k: v.astype(np.float32) for k, v in columns.items()})
            trace = timed(f"/model/{one.estimator}/{number}_{place}", series.x, frame)
            finite = np.abs(residual[np.isfinite(residual)])
            reach = float(finite.max()) if finite.size else 0.0
            yield FitTrace(one.title, series.label, one.y_name, trace, reach)


def timed(entity: str, t_s: NDArray[np.float64], values: pl.DataFrame) -> Trace:
    """A trace on the time line; rows whose instant is not finite have no place there."""
    finite = np.isfinite(t_s)
    nanoseconds = np.rint(t_s[finite] * 1e9).astype(np.int64)
    index = pl.Series(TIME, nanoseconds).cast(pl.Duration("ns"))
    kept = values if finite.all() else values.filter(pl.Series(finite))
    return Trace(entity, TIME, kept.insert_column(0, index))


def send_trace(stream: RecordingStream, trace: Trace) -> None:
    """Sends a table in slices of 4096 rows."""
    import rerun as rr

    for batch in trace.frame.to_arrow().to_batches(max_chunksize=ROWS_A_CHUNK):
        rr.send_record_batch(batch, stream, index=trace.index, entity_path=trace.entity)


def _send(stream: RecordingStream, capture: Capture, traces: Sequence[Trace]) -> None:
    import rerun as rr

    for trace in traces:
        send_trace(stream, trace)
    meta = capture.meta
    stated: dict[str, Any] = {
        "motor_id": meta.motor_id,
        "motor_type": meta.motor_type,
        "lot": meta.lot,
        "station": meta.station,
        "test": meta.test,
        "started_at": meta.started_at,
        "file": capture.path,
        "sha256": capture.sha256,
        "integrity": capture.integrity,
    }
    stream.send_property("capture", rr.AnyValues(**stated))


def _send_texts(
    stream: RecordingStream,
    capture: Capture,
    datasheet: Datasheet | None,
    findings: Sequence[Finding],
) -> None:
    import rerun as rr

    if datasheet is not None:
        page = rr.TextDocument(
            sheet_markdown(datasheet, capture.path), media_type=rr.MediaType.MARKDOWN
        )
        stream.log("/datasheet", page, static=True)
        stream.send_property(
            "motor", rr.AnyValues(status=datasheet.status, why=list(datasheet.why))
        )
    if findings:
        _send_findings(stream, capture, sorted(findings))


def _send_findings(stream: RecordingStream, capture: Capture, findings: Sequence[Finding]) -> None:
    """One log line a finding, at the first row it speaks of; no wall clock is written."""
    import rerun as rr

    rr.send_columns(
        "/findings",
        indexes=[_places(capture, findings)],
        columns=rr.TextLog.columns(
            text=[_log_line(finding) for finding in findings],
            level=["ERROR" if finding.severity == "refused" else "WARN" for finding in findings],
        ),
        recording=stream,
    )


def _log_line(finding: Finding) -> str:
    rows = "" if finding.rows is None else f"rows {finding.rows[0]}-{finding.rows[1]}: "
    return f"{rows}{finding.message}; {finding.remedy} [{finding.code}]"


def _places(capture: Capture, findings: Sequence[Finding]) -> TimeColumn:
    """Where findings stand on the capture's own index; row 0 where they name none."""
    import rerun as rr

    table = capture.tables[0] if capture.tables else pl.DataFrame()
    last = max(table.height - 1, 0)
    rows = [0 if f.rows is None else min(max(f.rows[0], 0), last) for f in findings]
    if "t_s" not in table.columns or table.height == 0:
        return rr.TimeColumn(ROW, sequence=rows)
    t_s = np.nan_to_num(table["t_s"].to_numpy()[rows])
    return rr.TimeColumn(TIME, duration=np.rint(t_s * 1e9).astype("timedelta64[ns]"))
