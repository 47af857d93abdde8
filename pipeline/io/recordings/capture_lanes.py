"""Lanes and lines beside a capture's traces: what the machine did, what was found wrong."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.stream import ROW, TIME, nanoseconds
from pipeline.numerics.regimes import (
    GENERATING,
    LOCKED,
    MOTORING,
    REST,
    UNPOWERED,
    Stretch,
    regimes,
    stretches,
)
from pipeline.physics.notation import quantity
from pipeline.records.capture import Capture
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding

if TYPE_CHECKING:
    from rerun import RecordingStream, TimeColumn

REGIME, ASIDE = "/lanes/regime", "/lanes/rows"
KEPT = "kept"
COLOURS = {
    MOTORING: (56, 142, 60),
    GENERATING: (25, 118, 210),
    LOCKED: (230, 126, 34),
    UNPOWERED: (120, 144, 156),
    REST: (97, 97, 97),
    KEPT: (97, 97, 97),
}
ASIDE_COLOUR = (198, 40, 40)
Line = tuple[str, str, int]


def capture_regimes(capture: Capture) -> tuple[Stretch, ...]:
    """What the machine did over the rows of the main table of a capture.

    Parameters
    ----------
    capture
        The capture.

    Returns
    -------
    tuple of Stretch
        Empty without a clock, or without speed and current.

    """
    if not capture.tables or "t_s" not in capture.tables[0].columns:
        return ()
    table = capture.tables[0]
    speed = next((n for n in ("omega_mech_rad_s", "theta_mech_rad") if n in table.columns), None)
    current = next((n for n in ("iq_a", "ia_a", "ib_a", "ic_a") if n in table.columns), None)
    if table.height < 2 or (speed is None and current is None):
        return ()
    nothing = np.zeros(table.height)
    moved = nothing if speed is None else table[speed].to_numpy()
    if speed == "theta_mech_rad":
        moved = np.gradient(moved, table["t_s"].to_numpy())
    return regimes(moved, nothing if current is None else table[current].to_numpy())


def rows_aside(capture: Capture) -> tuple[Stretch, ...]:
    """Rows of the main table that gates set aside, by the name of the gate.

    Parameters
    ----------
    capture
        The capture.

    Returns
    -------
    tuple of Stretch
        Empty where none are.

    """
    masks = [mask for mask in capture.masks if mask.table == 0 and mask.dropped]
    if not masks or "t_s" not in capture.tables[0].columns:
        return ()
    states = np.full(masks[0].keep.size, KEPT, dtype=object)
    for mask in masks:
        states[~mask.keep] = mask.gate
    return stretches(states.astype(str), np.arange(states.size))


def lines_of(
    capture: Capture, evidence: Sequence[Evidence], findings: Sequence[Finding]
) -> list[Line]:
    """Findings, rows set aside and largest residuals as lines of a log, the worst first.

    Parameters
    ----------
    capture
        The capture.
    evidence
        What was fitted to it.
    findings
        On its file.

    Returns
    -------
    list of tuple
        Level, text and row.

    """
    messages: list[Line] = []
    for one in sorted(findings):
        level = "ERROR" if one.severity == "refused" else "WARN"
        messages.append((level, _finding(one), 0 if one.rows is None else one.rows[0]))
    for mask in capture.masks:
        if mask.dropped and mask.table == 0:
            first = int(np.flatnonzero(~mask.keep)[0])
            messages.append(("WARN", f"{mask.dropped} rows set aside by {mask.gate}", first))
    for one_fit in evidence:
        messages += _residual(capture, one_fit)
    return messages or [("INFO", "nothing was found in this capture", 0)]


def send_lanes(stream: RecordingStream, capture: Capture) -> tuple[str, ...]:
    """Sends the lanes that hold something; returns their entities.

    Parameters
    ----------
    stream
        The recording.
    capture
        The capture.

    """
    sent = []
    for entity, lane in ((REGIME, capture_regimes(capture)), (ASIDE, rows_aside(capture))):
        if lane:
            _send_lane(stream, entity, capture, lane)
            sent.append(entity)
    return tuple(sent)


def send_lines(stream: RecordingStream, capture: Capture, lines: Sequence[Line]) -> None:
    """Sends lines of a log, each at its row; no wall clock is written.

    Parameters
    ----------
    stream
        The recording.
    capture
        Its clock.
    lines
        Level, text and row.

    """
    import rerun as rr

    rr.send_columns(
        "/findings",
        indexes=[_index(capture, [row for _, _, row in lines])],
        columns=rr.TextLog.columns(
            text=[drawable(words) for _, words, _ in lines],
            level=[level for level, _, _ in lines],
        ),
        recording=stream,
    )


def _send_lane(
    stream: RecordingStream, entity: str, capture: Capture, lane: Sequence[Stretch]
) -> None:
    import rerun as rr

    names = list(dict.fromkeys(one.state for one in lane))
    style = rr.StateConfiguration(
        values=[drawable(name) for name in names],
        labels=[drawable(name) for name in names],
        colors=[COLOURS.get(name, ASIDE_COLOUR) for name in names],
    )
    stream.log(entity, style, static=True)
    rr.send_columns(
        entity,
        indexes=[_index(capture, [one.start for one in lane])],
        columns=rr.StateChange.columns(state=[drawable(one.state) for one in lane]),
        recording=stream,
    )


def _finding(finding: Finding) -> str:
    rows = "" if finding.rows is None else f"rows {finding.rows[0]}–{finding.rows[1]}: "
    return f"{rows}{finding.message}; {finding.remedy} [{finding.code}]"


def _residual(capture: Capture, evidence: Evidence) -> list[Line]:
    from pipeline.views.names import quantity_words, unit_words

    lines: list[Line] = []
    unit = unit_words(evidence.y_name)
    for series in evidence.series:
        residuals = series.measured - series.fitted if series.fitted.size else np.zeros(0)
        finite = np.isfinite(residuals)
        if not finite.any():
            continue
        worst = int(np.nanargmax(np.abs(residuals)))
        rms = float(np.sqrt(np.mean(residuals[finite] ** 2)))
        words = (
            f"{evidence.title}: {quantity_words(evidence.y_name)} "
            f"residual rms {quantity(rms, unit, 3)}, "
            f"largest {quantity(float(abs(residuals[worst])), unit, 3)} at {series.x[worst]:.4g} s"
        )
        lines.append(("INFO", words, _row_at(capture, float(series.x[worst]))))
    return lines


def _row_at(capture: Capture, t_s: float) -> int:
    table = capture.tables[0] if capture.tables else pl.DataFrame()
    if "t_s" not in table.columns or table.height == 0:
        return 0
    return int(np.clip(np.searchsorted(table["t_s"].to_numpy(), t_s), 0, table.height - 1))


def _index(capture: Capture, rows: Sequence[int]) -> TimeColumn:
    """Where rows stand on the capture's own index."""
    import rerun as rr

    table = capture.tables[0] if capture.tables else pl.DataFrame()
    places: NDArray[np.int64] = np.clip(np.asarray(rows), 0, max(table.height - 1, 0))
    if "t_s" not in table.columns or table.height == 0:
        return rr.TimeColumn(ROW, sequence=places.tolist())
    t_s = np.nan_to_num(table["t_s"].to_numpy()[places])
    return rr.TimeColumn(TIME, duration=nanoseconds(t_s).astype("timedelta64[ns]"))
