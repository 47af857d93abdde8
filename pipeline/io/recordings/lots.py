"""Lot against lot as a Rerun recording: the verdict, who lies where, cogging, drift lot by lot.

A recording holds the entities

    /verdict              the sentence, its reasons and a table of constants, as a markdown page
    /hist/NAME/SIDE       motors per bin of a constant, both sides over each other
    /cogging/SIDE         `mean`, `low`, `high` of the zero-current torque [mN·m] over 0.1°
    /orders/SIDE          its mean amplitude by order [mN·m]
    /drift/NAME           lot means as change from the baseline's [%], with ±U and control limits
    /motors               one row a motor: lot, side, the value of each constant

on one sequence timeline `place`: tenths of degrees, lots and motors all count from 0, and one
timeline serves every view at once.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import polars as pl
from numpy.typing import NDArray

from pipeline.io.publish import canonical_json
from pipeline.io.recordings.font import drawable
from pipeline.io.recordings.lots_page import verdict_markdown
from pipeline.io.recordings.seal import write_sealed
from pipeline.io.recordings.stream import (
    Trace,
    recording,
    send_bars,
    send_page,
    send_property,
    send_trace,
)
from pipeline.io.recordings.views import BASELINE, CANDIDATE
from pipeline.physics.notation import Scale, scale_for
from pipeline.records.lot_constant import ConstantResult, Side
from pipeline.records.lot_regression import CoggingBand, LotRegression
from pipeline.records.naming import file_stem

if TYPE_CHECKING:
    from rerun import RecordingStream

Array = NDArray[np.float64]

PLACE = "place"
SIDES: tuple[Side, ...] = ("baseline", "candidate")
COLOURS = {"baseline": BASELINE, "candidate": CANDIDATE}
BINS = 16
COVERAGE = 2.0
FILL = 8


def lots_name(result: LotRegression) -> str:
    """The file of a comparison, by what was held against what."""
    return f"lots-{file_stem(f'{result.baseline.selector} {result.candidate.selector}')}.rrd"


def write_lots_recording(result: LotRegression, path: Path) -> None:
    """Writes one comparison of lots as .rrd and its seal; MachineError where the disk refuses."""
    write_sealed(path, lots_bytes(result))


def lots_bytes(result: LotRegression) -> bytes:
    """The .rrd of one comparison of lots, made in memory."""
    from pipeline.io.recordings.lots_views import lots_layout

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


def compared(result: LotRegression) -> tuple[ConstantResult, ...]:
    """Constants that both sides have: those that fail first, then by size of the change."""
    ranks = ("fail", "CONFOUNDED", "marginal", "undecided", "INSUFFICIENT_HISTORY")

    def weight(one: ConstantResult) -> tuple[int, float, str]:
        rank = ranks.index(one.verdict) if one.verdict in ranks else len(ranks)
        return rank, -abs(one.effect.in_sd or 0.0), one.name

    both = [one for one in result.constants if all(one.of(side) for side in SIDES)]
    return tuple(sorted(both, key=weight))


def constant_scale(one: ConstantResult) -> Scale:
    """The unit in which a constant is shown."""
    return scale_for(max(abs(motor.value) for motor in one.motors), one.unit)


def histogram(one: ConstantResult) -> tuple[Array, dict[Side, Array]]:
    """Left edges of common bins in the shown unit [B + 1], and motors per bin of each side [B]."""
    scale = constant_scale(one)
    shown = {s: np.array([scale.shown(m.value) for m in one.of(s)]) for s in SIDES}
    every = np.concatenate(list(shown.values()))
    low, high = float(every.min()), float(every.max())
    if high <= low:
        low, high = low - 0.5 * abs(low or 1.0) * 0.01, high + 0.5 * abs(high or 1.0) * 0.01
    edges = np.linspace(low, high, BINS + 1)
    counts = {s: np.histogram(v, edges)[0].astype(np.float64) for s, v in shown.items()}
    return edges, counts


def drift(one: ConstantResult) -> pl.DataFrame | None:
    """Lot by lot: mean, its ±U, EWMA and its control limits as change from the baseline [%]."""
    before = [lot.mean for lot in one.lots if lot.side == "baseline"]
    centre = float(np.mean(before)) if before else 0.0
    if not before or centre == 0.0:
        return None

    def change(value: float | None) -> float:
        return np.nan if value is None else 100.0 * (value - centre) / abs(centre)

    rows = [
        {
            "mean": change(lot.mean),
            "low": change(lot.mean - COVERAGE * lot.u),
            "high": change(lot.mean + COVERAGE * lot.u),
            "ewma": change(lot.ewma),
            "ewma_low": change(lot.ewma_low),
            "ewma_high": change(lot.ewma_high),
            # from the last lot before on, so that even a single one is a line
            "candidate": change(lot.mean) if place >= len(before) - 1 else np.nan,
        }
        for place, lot in enumerate(one.lots)
    ]
    return pl.DataFrame(rows, schema=dict.fromkeys(rows[0], pl.Float64))


def band_trace(band: CoggingBand) -> Trace:
    """A band of cogging torque [mN·m] over 0.1°, with lines between its edges that fill it."""
    low, high = 1e3 * np.array(band.low_nm), 1e3 * np.array(band.high_nm)
    columns = {"mean": 1e3 * np.array(band.mean_nm), "low": low, "high": high}
    for number in range(1, FILL):
        columns[f"fill_{number}"] = low + (high - low) * number / FILL
    frame = pl.DataFrame({name: v.astype(np.float32) for name, v in columns.items()})
    tenths = np.rint(10.0 * np.degrees(np.array(band.theta_mech_rad))).astype(np.int64)
    first = np.unique(tenths, return_index=True)[1]
    index = pl.Series(PLACE, tenths[first])
    return Trace(f"/cogging/{band.side}", PLACE, frame[first.tolist()].insert_column(0, index))


def leading_order(result: LotRegression) -> int:
    """The order of the largest mean amplitude on either side; 1 where none is told."""
    return max(result.orders, key=lambda level: level.mean).order if result.orders else 1


def _send_histograms(stream: RecordingStream, one: ConstantResult) -> None:
    edges, counts = histogram(one)
    width = float(edges[1] - edges[0])
    for side in SIDES:
        entity = f"/hist/{one.name}/{side}"
        send_bars(stream, entity, counts[side], edges[:-1], width, COLOURS[side])


def _send_drift(stream: RecordingStream, one: ConstantResult) -> None:
    told = drift(one)
    if told is not None:
        index = pl.Series(PLACE, np.arange(told.height, dtype=np.int64))
        send_trace(stream, Trace(f"/drift/{one.name}", PLACE, told.insert_column(0, index)))


def _send_orders(stream: RecordingStream, result: LotRegression) -> None:
    width = max([0.4, *(level.order / 60.0 for level in result.orders)])
    for side, shift in zip(SIDES, (-width, 0.0), strict=True):
        own = [level for level in result.orders if level.side == side]
        if own:
            values = 1e3 * np.array([level.mean for level in own])
            left = np.array([float(level.order) for level in own]) + shift
            send_bars(stream, f"/orders/{side}", values, left, width, COLOURS[side])


def _send_motors(stream: RecordingStream, result: LotRegression) -> None:
    """A row a motor; a constant that it lacks stays empty."""
    rows: dict[str, dict[str, Any]] = {}
    shown = compared(result)
    for one in shown:
        for motor in one.motors:
            row = rows.setdefault(motor.motor_id, {})
            row |= {"motor": motor.motor_id, "lot": motor.lot, "side": motor.side}
            row[one.name] = motor.value
    if not rows:
        return
    told = [rows[name] for name in sorted(rows, key=lambda n: (rows[n]["side"], n))]
    texts: dict[str, Any] = {
        key: [drawable(str(row[key])) for row in told] for key in ("motor", "lot", "side")
    }
    numbers = {one.name: [row.get(one.name) for row in told] for one in shown}
    frame = pl.DataFrame(texts | numbers, schema=_types(texts, numbers))
    index = pl.Series(PLACE, np.arange(frame.height, dtype=np.int64))
    send_trace(stream, Trace("/motors", PLACE, frame.insert_column(0, index)))


def _types(texts: Sequence[str] | dict[str, Any], numbers: dict[str, Any]) -> dict[str, Any]:
    return dict.fromkeys(texts, pl.String) | dict.fromkeys(numbers, pl.Float64)
