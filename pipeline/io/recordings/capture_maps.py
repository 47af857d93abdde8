"""Where a capture's residual lives: over speed and current, over the angle, and in its orders."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from pipeline.numerics.cell_means import mean_map, visits_of
from pipeline.physics.glossary import unit_of
from pipeline.records.capture import Array, Capture, Indices
from pipeline.records.error_map import Bins, ErrorMap
from pipeline.records.evidence import Evidence

SPEED_CELLS, CURRENT_CELLS = 24, 16
MOST_ANGLE_CELLS, SAMPLES_A_CELL = 180, 8
HIGHEST_ORDER = 36
FULL_COLOUR_SHARE = 0.01
FEWEST_SAMPLES, NARROWEST_SHARE = 4, 0.2


@dataclass(frozen=True, slots=True)
class ResidualMaps:
    """One signal's residual [unit]: over speed and current, over one turn, and its orders.

    `floor` [unit] is 1 % of the signal's own reach: full colour, and the axes of the residual, are
    never finer, so that noise stays white and what matters has colour. Cells of fewer than four
    samples are empty. `orders` [k] are amplitudes of the mean over one turn, from order 1.
    """

    signal: str
    unit: str
    floor: float
    flat: ErrorMap | None
    turn: ErrorMap | None
    orders: Array

    @property
    def reach(self) -> float:
        """Full colour of the map over speed and current [unit]."""
        return max(self.floor, 0.0 if self.flat is None else self.flat.reach)


def residual_maps(capture: Capture, evidence: Evidence) -> ResidualMaps | None:
    """Maps of the residual of one series that was fitted over time.

    Parameters
    ----------
    capture
        Holds speed, current and angle.
    evidence
        The fit.

    Returns
    -------
    ResidualMaps or None
        None where neither speed nor angle is recorded.

    """
    series = evidence.series[0]
    error = series.measured - series.fitted
    at = dict(_variables(capture, series.x))
    flat = _flat(evidence.y_name, error, at)
    turn = _turn(evidence.y_name, error, at, angle_of(evidence.y_name))
    if flat is None and turn is None:
        return None
    return ResidualMaps(
        evidence.y_name,
        unit_of(evidence.y_name),
        signal_floor(series.measured),
        flat,
        turn,
        np.zeros(0) if turn is None else order_amplitudes(turn.mean),
    )


def angle_of(signal: str) -> str:
    """The angle that the error of a signal is drawn over.

    Parameters
    ----------
    signal
        Glossary name; torque ripples with the shaft, voltages with the electrical angle.

    """
    return "theta_mech_rad" if signal == "torque_shaft_nm" else "theta_elec_rad"


def angle_words(signal: str) -> str:
    """Which turn the residual of a signal is drawn over, in a word.

    Parameters
    ----------
    signal
        Glossary name.

    """
    return "mechanical" if angle_of(signal) == "theta_mech_rad" else "electrical"


def signal_floor(measured: Array) -> float:
    """Smallest value of full colour for the residual of a signal.

    Parameters
    ----------
    measured
        The signal [n].

    Returns
    -------
    float
        1 % of its largest value; 1 where it has none.

    """
    finite = np.abs(measured[np.isfinite(measured)])
    return FULL_COLOUR_SHARE * float(finite.max(initial=0.0)) or 1.0


def order_amplitudes(mean: Array) -> Array:
    """Amplitudes of the orders of a mean over one turn.

    Parameters
    ----------
    mean
        Mean of each cell of the turn [c].

    Returns
    -------
    array
        From order 1 on, in the unit of the mean; empty where cells are missing.

    """
    if mean.size < 4 or not np.isfinite(mean).all():
        return np.zeros(0)
    amplitude: Array = 2.0 * np.abs(np.fft.rfft(mean)) / mean.size
    return amplitude[1 : min(HIGHEST_ORDER, mean.size // 2 - 1) + 1]


def _variables(capture: Capture, t_s: Array) -> Iterator[tuple[str, Array]]:
    """What the error may live on, at the instants of the residual; NaN outside a column's span."""
    names = ("omega_mech_rad_s", "iq_a", "theta_mech_rad", "theta_elec_rad")
    for name in names:
        if capture.has("t_s", name):
            known_s, values = capture.finite("t_s", name).values()
            if known_s.size > 1:
                yield name, np.interp(t_s, known_s, values, left=np.nan, right=np.nan)
    pole_pairs = capture.meta.pole_pairs
    if pole_pairs and capture.has("t_s", "theta_mech_rad") and not capture.has("theta_elec_rad"):
        columns = capture.arrays("t_s", "theta_mech_rad")
        yield (
            "theta_elec_rad",
            pole_pairs * np.interp(t_s, columns["t_s"], columns["theta_mech_rad"]),
        )
    if capture.has("t_s", "theta_mech_rad") and not capture.has("omega_mech_rad_s"):
        columns = capture.arrays("t_s", "theta_mech_rad")
        if columns["t_s"].size > 2:
            speed = np.gradient(columns["theta_mech_rad"], columns["t_s"])
            yield "omega_mech_rad_s", np.interp(t_s, columns["t_s"], speed)


def _flat(signal: str, error: Array, at: dict[str, Array]) -> ErrorMap | None:
    if "omega_mech_rad_s" not in at or "iq_a" not in at:
        return None
    speed, current = at["omega_mech_rad_s"], at["iq_a"]
    inside = np.isfinite(speed) & np.isfinite(current) & np.isfinite(error)
    if inside.sum() < 2 or min(np.abs(v[inside]).max() for v in (speed, current)) <= 0.0:
        return None
    x = Bins("omega_mech_rad_s", _even(speed[inside], SPEED_CELLS))
    y = Bins("iq_a", _even(current[inside], CURRENT_CELLS))
    cell = _place(current[inside], y) * x.count + _place(speed[inside], x)
    return _map(signal, error[inside], cell, x, y)


def _turn(signal: str, error: Array, at: dict[str, Array], angle: str) -> ErrorMap | None:
    """The mean over one turn, the capture's mean removed; None below one whole turn."""
    if angle not in at:
        return None
    inside = np.isfinite(at[angle]) & np.isfinite(error)
    if inside.sum() < 2 or np.ptp(at[angle][inside]) < 2.0 * np.pi:
        return None
    cells = min(MOST_ANGLE_CELLS, max(12, int(inside.sum()) // SAMPLES_A_CELL))
    x = Bins(angle, tuple(np.linspace(0.0, 2.0 * np.pi, cells + 1).tolist()))
    cell = _place(np.mod(at[angle][inside], 2.0 * np.pi), x)
    return _map(signal, error[inside] - error[inside].mean(), cell, x, None)


def _map(signal: str, error: Array, cell: Indices, x: Bins, y: Bins | None) -> ErrorMap:
    visit = visits_of(cell, np.zeros(cell.size, dtype=np.int64))
    means = mean_map(signal, (error, np.ones(error.size)), cell, visit, x, y)
    return replace(means, mean=np.where(means.count < FEWEST_SAMPLES, np.nan, means.mean))


def _even(value: Array, cells: int) -> tuple[float, ...]:
    """Edges over the values, a fifth of the largest apart at least: a held speed is one place."""
    low, high = float(value.min()), float(value.max())
    more = max(NARROWEST_SHARE * max(abs(low), abs(high)) - (high - low), 0.0) / 2.0
    return tuple(np.linspace(low - more, high + more, cells + 1).tolist())


def _place(value: Array, bins: Bins) -> Indices:
    low, high = bins.edges[0], bins.edges[-1]
    place = ((value - low) / (high - low) * bins.count).astype(np.int64)
    return np.clip(place, 0, bins.count - 1)
