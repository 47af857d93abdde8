"""Lot against lot as a Rerun recording: the verdict, who lies where, cogging, drift lot by lot.

A recording holds the entities

    /verdict              the sentence, its reasons and a table of constants, as a markdown page
    /hist/NAME/SIDE       motors per bin of a constant, both sides over each other
    /cogging/SIDE         `mean`, `low`, `high` of the zero-current torque [mN·m] over 0.1°
    /orders/SIDE          its mean amplitude by order [mN·m]
    /drift/NAME           lot means as change from the baseline's [%], with ±U and control limits
    /motors               one row a motor: its name, lot and side
    /motors/NAME          a constant of it, in the unit of the histogram

on one sequence timeline `place`: tenths of degrees, lots and motors all count from 0, and one
timeline serves every view at once.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pipeline.io.recordings.font import drawable, in_headings
from pipeline.io.recordings.lots_page import verdict_markdown
from pipeline.io.recordings.lots_traces import (
    COLOURS,
    MOTORS,
    PLACE,
    SIDES,
    band_trace,
    constant_scale,
    drift,
    histogram,
)
from pipeline.io.recordings.lots_views import lots_layout
from pipeline.io.recordings.seal import write_checksummed
from pipeline.io.recordings.stream import (
    Trace,
    recording,
    send_bars,
    send_page,
    send_property,
    send_trace,
)
from pipeline.io.storage.publish import canonical_json
from pipeline.records.lot_constant import ConstantResult
from pipeline.records.lot_regression import LotRegression
from pipeline.records.naming import file_stem
from pipeline.views.lots import compared

if TYPE_CHECKING:
    from rerun import RecordingStream

Array = NDArray[np.float64]
DIGITS = 5
"""Significant digits of a constant in the table of motors."""


def lots_name(result: LotRegression) -> str:
    """The file name of a comparison of lots, by what was compared with what.

    Parameters
    ----------
    result
        The comparison.

    """
    return f"lots-{file_stem(f'{result.baseline.selector} {result.candidate.selector}')}.rrd"


def write_lots_recording(result: LotRegression, path: Path) -> None:
    """Writes one comparison of lots as a recording with its checksum.

    Parameters
    ----------
    result
        The comparison.
    path
        The .rrd file.

    Raises
    ------
    MachineError
        The disk refuses.

    """
    write_checksummed(path, lots_bytes(result))


def lots_bytes(result: LotRegression) -> bytes:
    """The recording of one comparison of lots as bytes.

    Parameters
    ----------
    result
        The comparison.

    """
    identity = canonical_json(result.document()).decode()
    name = f"{result.baseline.selector} → {result.candidate.selector}"
    with recording(name, (identity,), lots_layout(result)) as made:
        send_page(made.stream, "/verdict", verdict_markdown(result))
        for one in compared(result):
            _send_histograms(made.stream, one)
            _send_drift(made.stream, one)
        for band in result.cogging:
            send_trace(made.stream, band_trace(band))
        _send_orders(made.stream, result)
        _send_motors(made.stream, result)
        stated = {
            "verdict": result.verdict,
            "headline": result.headline,
            "baseline": result.baseline.selector,
            "candidate": result.candidate.selector,
            "lots": [*result.baseline.lots, *result.candidate.lots],
        }
        send_property(made.stream, "regression", stated)
    return made.content


def _send_histograms(stream: RecordingStream, constant: ConstantResult) -> None:
    edges, counts = histogram(constant)
    width = float(edges[1] - edges[0])
    for side in SIDES:
        entity = f"/hist/{constant.name}/{side}"
        send_bars(stream, entity, counts[side], edges[:-1], width, COLOURS[side])


def _send_drift(stream: RecordingStream, constant: ConstantResult) -> None:
    moving = drift(constant)
    if moving is not None:
        index = pl.Series(PLACE, np.arange(moving.height, dtype=np.int64))
        send_trace(stream, Trace(f"/drift/{constant.name}", PLACE, moving.insert_column(0, index)))


def _send_orders(stream: RecordingStream, result: LotRegression) -> None:
    width = max([0.4, *(level.order / 60.0 for level in result.orders)])
    for side, shift in zip(SIDES, (-width, 0.0), strict=True):
        own = [level for level in result.orders if level.side == side]
        if own:
            values = 1e3 * np.array([level.mean for level in own])
            left = np.array([float(level.order) for level in own]) + shift
            send_bars(stream, f"/orders/{side}", values, left, width, COLOURS[side])


def _send_motors(stream: RecordingStream, result: LotRegression) -> None:
    """A row a motor, in the units of the histograms; a constant that it lacks stays empty.

    The viewer makes a column as wide as its heading, so these are as long as what stands below.
    """
    shown = compared(result)
    found = {motor.motor_id: motor for one in shown for motor in one.motors}
    ordered = sorted(found.values(), key=lambda motor: (motor.side, motor.motor_id))
    place = pl.Series(PLACE, np.arange(len(ordered), dtype=np.int64))
    if not ordered:
        return
    names = {
        "motor_serial_number": [drawable(motor.motor_id) for motor in ordered],
        "production_lot": [drawable(motor.lot) for motor in ordered],
        "baseline_or_candidate": [motor.side for motor in ordered],
    }
    send_trace(stream, Trace(MOTORS, PLACE, pl.DataFrame(names).insert_column(0, place)))
    for one in shown:
        scale, values = constant_scale(one), {m.motor_id: m.value for m in one.motors}
        column = pl.Series(
            in_headings(scale.unit) or "1",
            [values.get(motor.motor_id) for motor in ordered],
            pl.Float64,
        )
        frame = pl.DataFrame([place, (column / 10.0**scale.exponent).round_sig_figs(DIGITS)])
        send_trace(stream, Trace(f"{MOTORS}/{one.name}", PLACE, frame))
