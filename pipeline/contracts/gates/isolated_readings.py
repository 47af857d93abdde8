"""Single readings that no shaft and no winding can have: away from both neighbours, which agree."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import polars as pl
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.contracts.protocol import Gate, Lost, Passed, span_of, warning
from pipeline.contracts.waveform import Array, Rows
from pipeline.records.capture import Capture

NAME = "isolated_readings"
ANGLES = ("theta_mech_rad", "theta_elec_rad")
MOTION = ("omega_mech_rad_s", *ANGLES)
CURRENTS, TORQUE = ("id_a", "iq_a"), "torque_shaft_nm"
DRIVEN = ("drive", "torque_map")
REMEDY = "look at the sensor's link: a reading that was lost is often written as 0"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Finds single readings that stand alone, which are missing then, counts them, and warns.

    Notes
    -----
    What has inertia or inductance cannot leave and come back within two samples. See `isolated` for
    the statistic, whose limit is the option `ratio` [1]. Only logs of at least `least_rows` rows
    are looked at: the motion at intervals of at most `most_interval_s` [s], faster than a shaft can
    follow, current and torque of a drive of at most `most_drive_s` [s], faster than its control. A
    torque may overshoot where a current moves.

    """
    lost, findings = [], []
    for number, table in enumerate(capture.tables):
        if "t_s" not in table.columns or table.height < options["least_rows"]:
            continue
        usual_s = float(np.median(np.diff(table["t_s"].to_numpy())))
        looked_at = list(MOTION) if 0.0 < usual_s <= options["most_interval_s"] else []
        if capture.meta.test in DRIVEN and 0.0 < usual_s <= options["most_drive_s"]:
            looked_at += [*CURRENTS, TORQUE]
        for name in (n for n in looked_at if n in table.columns):
            signal = table[name].to_numpy()
            alone = isolated(signal, options["ratio"])
            if name in ANGLES:
                alone |= off_course(signal, options["ratio"])
            if name == TORQUE:
                alone &= ~_driven(table, options["ratio"])
            count = int(np.count_nonzero(alone))
            if not count:
                continue
            first = int(np.flatnonzero(alone)[0])
            words = (
                f"{count} single readings of {name} stand alone, the first {signal[first]:.4g} "
                f"between {signal[first - 1]:.4g} and {signal[first + 1]:.4g}: they are left out"
            )
            lost.append(Lost(number, name, alone))
            findings.append(warning(capture, NAME, words, REMEDY, span_of(alone)))
    return Passed((), tuple(findings), tuple(lost))


def _driven(table: pl.DataFrame, ratio: float) -> Rows:
    """Rows of a table beside which a current moves by far more than usual."""
    driven = np.zeros(table.height, dtype=bool)
    for name in (n for n in CURRENTS if n in table.columns):
        beside = sliding_window_view(np.pad(table[name].to_numpy(), 2, mode="edge"), 5)
        moved = beside.max(axis=1) - beside.min(axis=1)
        usual = moved[moved > 0.0]
        driven |= moved > ratio * float(np.median(usual)) if usual.size else False
    return driven


def isolated(values: Array, ratio: float) -> Rows:
    """Rows that leave both neighbours the same way, by far more than anything usual.

    Parameters
    ----------
    values
        A signal with inertia [n, any unit].
    ratio
        How many times the departure exceeds the neighbours' difference, the median step, the
        smallest step and the departures of 99 % of all rows [1].

    Returns
    -------
    array [n] of bool

    Notes
    -----
    departure_k = min(|x_k − x_(k−1)|, |x_(k+1) − x_k|) where x_k is above or below both, else 0.

    Examples
    --------
    >>> ramp = np.arange(9.0)
    >>> ramp[4] = 300.0
    >>> np.flatnonzero(isolated(ramp, 8.0)).tolist()
    []
    >>> ramp = np.arange(900.0)
    >>> ramp[4] = 300.0
    >>> np.flatnonzero(isolated(ramp, 8.0)).tolist()
    [4]

    """
    steps = np.diff(values)
    before, after = steps[:-1], -steps[1:]
    with np.errstate(invalid="ignore"):
        departure = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
        between = np.abs(values[2:] - values[:-2])
    moved = np.abs(steps[np.isfinite(steps) & (steps != 0)])
    alone = np.zeros(values.shape, dtype=bool)
    if moved.size and np.isfinite(departure).any():
        usual = max(float(np.quantile(departure, 0.99)), float(np.median(moved)))
        alone[1:-1] = departure > ratio * np.maximum(usual, between)
    return alone


def off_course(theta: Array, ratio: float) -> Rows:
    """Rows of an angle that are off the way of a shaft that turns fast, which others keep to.

    Parameters
    ----------
    theta
        An angle [n, rad].
    ratio
        How many times the distance exceeds the change of the shaft's pace there, and the distances
        of 99 % of all rows [1].

    Returns
    -------
    array [n] of bool

    Notes
    -----
    Distance from the cubic through the two rows before and the two after, and how far the steps
    between the former, between the latter, and from these to those are of unlike pace: where rows
    are lost, the last is.

    Examples
    --------
    >>> turning = 0.35 * np.arange(900.0)
    >>> turning[4] += 0.3
    >>> np.flatnonzero(off_course(turning, 8.0)).tolist()
    [4]

    """
    alone = np.zeros(theta.shape, dtype=bool)
    with np.errstate(invalid="ignore"):
        near, far = theta[1:-3] + theta[3:-1], theta[:-4] + theta[4:]
        off = np.abs(theta[2:-2] - (4.0 * near - far) / 6.0)
        before, after = theta[1:-3] - theta[:-4], theta[4:] - theta[3:-1]
        across = theta[3:-1] - theta[1:-3]
        pace = np.maximum(np.abs(after - before), np.abs(across - before - after))
    known = off[np.isfinite(off)]
    if known.size and np.any(theta[1:] != theta[:-1]):
        alone[2:-2] = off > ratio * np.maximum(float(np.quantile(known, 0.99)), pace)
    return alone


GATE = Gate(
    NAME,
    ("open_circuit", "hand_turn", "cogging", "spin_down", *DRIVEN),
    check,
    {
        # Gaussian noise departs by 2.3 sigma in 1 % of rows: eight times that is 18 sigma.
        "ratio": 8.0,
        # Fewer rows have no 99 % of their own, and a table of points has no neighbours.
        "least_rows": 500.0,
        # A small motor reaches its speed and stops within some 50 ms; two samples are 40 ms.
        "most_interval_s": 0.02,
        # Control of a current takes a millisecond or more to lead it there and back.
        "most_drive_s": 5e-4,
    },
)
