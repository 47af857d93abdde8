"""What a comparison of lots draws: distributions, drift and bands of cogging torque."""

from __future__ import annotations

import numpy as np
import polars as pl

from pipeline.io.recordings.stream import Array, Trace, placed
from pipeline.io.recordings.views import BASELINE, CANDIDATE
from pipeline.physics.notation import Scale, scale_for
from pipeline.records.lot_constant import ConstantResult, Side
from pipeline.records.lot_regression import CoggingBand, LotRegression

PLACE = "place"
MOTORS = "/motors"
"""Who the motors are; each of their constants stands below it."""
SIDES: tuple[Side, ...] = ("baseline", "candidate")
COLOURS = {"baseline": BASELINE, "candidate": CANDIDATE}
BINS = 16
COVERAGE = 2.0
FILL = 8


def constant_scale(constant: ConstantResult) -> Scale:
    """The unit in which a constant is shown.

    Parameters
    ----------
    constant
        Its result.

    """
    return scale_for(max(abs(motor.value) for motor in constant.motors), constant.unit)


def histogram(constant: ConstantResult) -> tuple[Array, dict[Side, Array]]:
    """Motors by value of a constant, of both sides in common bins.

    Parameters
    ----------
    constant
        Its result.

    Returns
    -------
    tuple of array and dict
        Edges in the shown unit [B + 1], and motors a bin of each side [B].

    """
    scale = constant_scale(constant)
    shown = {s: np.array([scale.shown(m.value) for m in constant.of(s)]) for s in SIDES}
    every = np.concatenate(list(shown.values()))
    low, high = float(every.min()), float(every.max())
    if high <= low:
        low, high = low - 0.5 * abs(low or 1.0) * 0.01, high + 0.5 * abs(high or 1.0) * 0.01
    edges = np.linspace(low, high, BINS + 1)
    counts = {s: np.histogram(v, edges)[0].astype(np.float64) for s, v in shown.items()}
    return edges, counts


def drift(constant: ConstantResult) -> pl.DataFrame | None:
    """Lot by lot: mean, its ±U, EWMA and its control limits as change from the baseline [%].

    Parameters
    ----------
    constant
        Its result.

    Returns
    -------
    DataFrame or None
        Mean, its ±U, EWMA and its control limits [%]; None without a baseline.

    """
    before = [lot.mean for lot in constant.lots if lot.side == "baseline"]
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
        for place, lot in enumerate(constant.lots)
    ]
    return pl.DataFrame(rows, schema=dict.fromkeys(rows[0], pl.Float64))


def band_trace(band: CoggingBand) -> Trace:
    """A band of cogging torque [mN·m] over 0.1°, with lines between its edges that fill it.

    Parameters
    ----------
    band
        Mean and standard deviation over the motors of a side.

    Returns
    -------
    Trace
        In mN·m, over steps of 0.1°.

    """
    low, high = 1e3 * np.array(band.low_nm), 1e3 * np.array(band.high_nm)
    columns = {"mean": 1e3 * np.array(band.mean_nm), "low": low, "high": high}
    for number in range(1, FILL):
        columns[f"fill_{number}"] = low + (high - low) * number / FILL
    frame = pl.DataFrame({name: v.astype(np.float32) for name, v in columns.items()})
    tenths = np.rint(10.0 * np.degrees(np.array(band.theta_mech_rad))).astype(np.int64)
    first = np.unique(tenths, return_index=True)[1]
    return placed(f"/cogging/{band.side}", PLACE, frame[first.tolist()], tenths[first])


def leading_order(result: LotRegression) -> int:
    """The order of the largest mean amplitude on either side.

    Parameters
    ----------
    result
        The comparison.

    Returns
    -------
    int
        1 where none is known.

    """
    return max(result.orders, key=lambda level: level.mean).order if result.orders else 1
