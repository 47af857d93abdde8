"""What a capture's recording draws: its tables, and what was fitted to them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import polars as pl

from pipeline.io.recordings.capture_maps import signal_floor
from pipeline.io.recordings.stream import ROW, Trace, placed, timed
from pipeline.records.capture import Capture
from pipeline.records.evidence import Evidence

LONG_ROWS, TABLE_ROWS = 100_000, 20_000


@dataclass(frozen=True, slots=True)
class FitTrace:
    """One fitted series: the quantity `y_name`, and its trace of measured, fitted, residual.

    `reach` is the largest residual, `floor` 1 % of the largest measured value [unit].
    """

    title: str
    label: str
    y_name: str
    trace: Trace
    reach: float
    floor: float


def capture_traces(capture: Capture) -> Iterator[Trace]:
    """Every table of a capture that has rows and columns to show.

    Parameters
    ----------
    capture
        The capture.

    """
    for number, table in enumerate(capture.tables):
        entity = "/measured" if number == 0 else f"/measured_{number}"
        values = table.drop("t_s", strict=False).select(pl.all().cast(pl.Float32).fill_null(np.nan))
        if table.height == 0 or values.width == 0:
            continue
        if "t_s" in table.columns:
            trace = timed(entity, table["t_s"].to_numpy(), values)
        else:
            trace = placed(entity, ROW, values)
        identifiers = all(name.isascii() and name.isidentifier() for name in trace.columns)
        yield replace(trace, packed=identifiers and table.height > LONG_ROWS)


def sample_table(traces: Sequence[Trace]) -> tuple[Trace, int] | None:
    """What the table of samples shows.

    Parameters
    ----------
    traces
        Tables of the capture.

    Returns
    -------
    tuple of Trace and int or None
        The first table, of a packed one evenly spaced rows; and that it is one row in how many.

    """
    if not traces:
        return None
    first = traces[0]
    if not first.packed:
        return first, 1
    step = -(-first.frame.height // TABLE_ROWS)
    return Trace("/samples", first.index, first.frame.gather_every(step)), step


def own_evidence(capture: Capture, evidence: Sequence[Evidence]) -> tuple[Evidence, ...]:
    """What was fitted to a capture over time.

    Parameters
    ----------
    capture
        The capture.
    evidence
        Plots of the fits of a campaign.

    """
    return tuple(
        one
        for one in evidence
        if one.capture == capture.path
        and one.x_name == "t_s"
        and any(series.fitted.size and series.x.size for series in one.series)
    )


def first_of_each(evidence: Sequence[Evidence]) -> tuple[Evidence, ...]:
    """The first plot of each quantity that has a single series.

    Parameters
    ----------
    evidence
        Plots of the fits.

    """
    first: dict[str, Evidence] = {}
    for one in evidence:
        if len(one.series) == 1:
            first.setdefault(one.y_name, one)
    return tuple(first.values())


def fit_traces(evidence: Sequence[Evidence]) -> Iterator[FitTrace]:
    """The series of a capture's own plots.

    Parameters
    ----------
    evidence
        As `own_evidence` gives it.

    """
    for number, one in enumerate(evidence):
        for place, series in enumerate(one.series):
            if series.fitted.size == 0 or series.x.size == 0:
                continue
            with np.errstate(invalid="ignore", over="ignore"):
                residual = series.measured - series.fitted
                columns = {"measured": series.measured, "fitted": series.fitted}
                columns |= {"residual": residual}
                frame = pl.DataFrame({k: v.astype(np.float32) for k, v in columns.items()})
            trace = timed(f"/model/{one.estimator}/{number}_{place}", series.x, frame)
            finite = np.abs(residual[np.isfinite(residual)])
            reach, floor = float(finite.max(initial=0.0)), signal_floor(series.measured)
            yield FitTrace(one.title, series.label, one.y_name, trace, reach, floor)
