"""Lanes and lines beside a capture's traces: what the machine did, what was found wrong."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import rerun as rr
from rerun import RecordingStream, TimeColumn

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
from pipeline.records.capture import Array, Capture, Indices
from pipeline.records.evidence import Evidence
from pipeline.records.finding import Finding
from pipeline.views.names import quantity_words, unit_words

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


def lanes_of(capture: Capture) -> dict[str, tuple[Stretch, ...]]:
    """The lanes that hold something, by entity.

    Parameters
    ----------
    capture
        The capture.

    """
    lanes = {REGIME: capture_regimes(capture), ASIDE: rows_aside(capture)}
    return {entity: lane for entity, lane in lanes.items() if lane}


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
    rr.send_columns(
        "/findings",
        indexes=[_index(capture, [row for _, _, row in lines])],
        columns=rr.TextLog.columns(
            text=[drawable(words) for _, words, _ in lines],
            level=[level for level, _, _ in lines],
        ),
        recording=stream,
    )


def send_lane(
    stream: RecordingStream, entity: str, capture: Capture, lane: Sequence[Stretch]
) -> None:
    """Sends one lane.

    Parameters
    ----------
    stream
        The recording.
    entity
        Where it lies.
    capture
        Its clock.
    lane
        What was from when on.

    """
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


def _residual(capture: Capture, evidence: Evidence) -> Iterator[Line]:
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
        yield ("INFO", words, _row_at(capture, float(series.x[worst])))


def _row_at(capture: Capture, t_s: float) -> int:
    clock = _clock_s(capture)
    return 0 if clock is None else int(np.clip(np.searchsorted(clock, t_s), 0, clock.size - 1))


def _index(capture: Capture, rows: Sequence[int]) -> TimeColumn:
    """Where rows stand on the capture's own index."""
    height = capture.tables[0].height if capture.tables else 0
    places: Indices = np.clip(np.asarray(rows), 0, max(height - 1, 0))
    clock = _clock_s(capture)
    if clock is None:
        return rr.TimeColumn(ROW, sequence=places.tolist())
    t_s = np.nan_to_num(clock[places])
    return rr.TimeColumn(TIME, duration=nanoseconds(t_s).astype("timedelta64[ns]"))


def _clock_s(capture: Capture) -> Array | None:
    """The clock of the main table [s]; None without a clock or without rows."""
    if not capture.tables or "t_s" not in capture.tables[0].columns or not capture.tables[0].height:
        return None
    return capture.tables[0]["t_s"].to_numpy()
