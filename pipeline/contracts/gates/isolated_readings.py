"""Single readings that no shaft can have: away from both neighbours, which agree."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pipeline.contracts.protocol import Gate, Passed, span_of, warning
from pipeline.contracts.waveform import Array, Rows
from pipeline.records.capture import Capture, Mask

NAME = "isolated_readings"
COLUMNS = ("omega_mech_rad_s", "theta_mech_rad", "theta_elec_rad")
REMEDY = "look at the sensor's link: a reading that was lost is often written as 0"


def check(capture: Capture, options: Mapping[str, float]) -> Passed:
    """Masks rows whose speed or angle stands alone, counts them, and warns.

    Notes
    -----
    What has inertia cannot leave and come back within two samples. See `isolated` for the
    statistic, whose limit is the option `ratio` [1]. Only logs of at least `least_rows` rows,
    sampled at intervals of at most `most_interval_s` [s], faster than a shaft can follow, are
    looked at.

    """
    masks, findings = [], []
    for number, table in enumerate(capture.tables):
        if "t_s" not in table.columns or table.height < options["least_rows"]:
            continue
        usual_s = float(np.median(np.diff(table["t_s"].to_numpy())))
        if not 0.0 < usual_s <= options["most_interval_s"]:
            continue
        for name in (n for n in COLUMNS if n in table.columns):
            signal = table[name].to_numpy()
            alone = isolated(signal, options["ratio"])
            count = int(np.count_nonzero(alone))
            if not count:
                continue
            first = int(np.flatnonzero(alone)[0])
            words = (
                f"{count} single readings of {name} stand alone, the first {signal[first]:.4g} "
                f"between {signal[first - 1]:.4g} and {signal[first + 1]:.4g}: they are left out"
            )
            masks.append(Mask(NAME, number, ~alone))
            findings.append(warning(capture, NAME, words, REMEDY, span_of(alone)))
    return Passed(tuple(masks), tuple(findings))


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


GATE = Gate(
    NAME,
    ("open_circuit", "hand_turn", "cogging", "spin_down", "drive"),
    check,
    {
        # Gaussian noise departs by 2.3 sigma in 1 % of rows: eight times that is 18 sigma.
        "ratio": 8.0,
        # Fewer rows have no 99 % of their own, and a table of points has no neighbours.
        "least_rows": 500.0,
        # A small motor reaches its speed and stops within some 50 ms; two samples are 40 ms.
        "most_interval_s": 0.02,
    },
)
