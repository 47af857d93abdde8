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

    What has inertia cannot leave and come back within two samples. A row counts where it departs
    from both neighbours the same way, far beyond what its neighbours differ by and beyond what
    99 % of all rows do, in a log that is sampled faster than a shaft can follow.
    """
    masks, findings = [], []
    for number, table in enumerate(capture.tables):
        if "t_s" not in table.columns or table.height < options["least_rows"]:
            continue
        usual_s = float(np.median(np.diff(table["t_s"].to_numpy())))
        if not 0.0 < usual_s <= options["most_interval_s"]:
            continue
        for name in (n for n in COLUMNS if n in table.columns):
            values = table[name].to_numpy()
            alone = isolated(values, options["ratio"])
            count = int(np.count_nonzero(alone))
            if not count:
                continue
            first = int(np.flatnonzero(alone)[0])
            words = (
                f"{count} single readings of {name} stand alone, the first {values[first]:.4g} "
                f"between {values[first - 1]:.4g} and {values[first + 1]:.4g}: they are left out"
            )
            masks.append(Mask(NAME, number, ~alone))
            findings.append(warning(capture, NAME, words, REMEDY, span_of(alone)))
    return Passed(tuple(masks), tuple(findings))


def isolated(values: Array, ratio: float) -> Rows:
    """Rows [n] that leave both neighbours the same way by `ratio` times anything usual.

    Parameters
    ----------
    values : array [n]
        A signal with inertia, any unit.
    ratio : float [1]
        How many times the departure exceeds the neighbours' difference, the scatter of steps, the
        quantum of the signal and the departures of 99 % of all rows.

    Notes
    -----
    departure_k = min(|x_k - x_(k-1)|, |x_(k+1) - x_k|) where both have one sign, else 0.

    """
    steps = np.diff(values)
    before, after = steps[:-1], -steps[1:]
    with np.errstate(invalid="ignore"):
        departure = np.where(before * after > 0, np.minimum(np.abs(before), np.abs(after)), 0.0)
        between = np.abs(values[2:] - values[:-2])
    moved = np.abs(steps[np.isfinite(steps) & (steps != 0)])
    alone = np.zeros(values.shape, dtype=bool)
    if moved.size and np.isfinite(departure).any():
        usual = max(float(np.quantile(departure, 0.99)), float(np.median(moved)), moved.min())
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
