"""Where a model's error lives: its mean over speed and current, angle, temperature and time."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.data.segment import Segment, slow_orders
from pipeline.criticism.library.equations import equation_of
from pipeline.criticism.machine.model import Model
from pipeline.criticism.operating import Array, Flags, Indices
from pipeline.criticism.policy.validation import Validation
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.regression.parallel import on_each
from pipeline.criticism.residuals.channels import reported_signal
from pipeline.criticism.residuals.residual import residual
from pipeline.numerics.cell_means import mean_map, visits_of
from pipeline.records.error_map import Bins, ErrorMap, Histogram

CURVES = (
    "omega_mech_rad_s",
    "iq_a",
    "id_a",
    "i_pair_a",
    "temp_winding_degc",
    "temp_magnet_degc",
    "t_s",
)
"""Variables over which an error is drawn as a curve."""


@dataclass(frozen=True, slots=True)
class Errors:
    """The errors of a signal as window means.

    Attributes
    ----------
    signal
        Reported name of the signal.
    error, sigma
        Errors and their noise [n, unit of the signal].
    segment, window
        Number of the segment and of the window [n].
    at
        Window means of what an error may depend on [n], NaN where a capture does not record it.

    """

    signal: str
    error: Array
    sigma: Array
    segment: Indices
    window: Indices
    at: Mapping[str, Array]


def window_errors(system: LinearSystem, whitened: Array) -> tuple[Errors, ...]:
    """The errors of every signal in the plain windows of all captures.

    Parameters
    ----------
    system
        The fit.
    whitened
        Residual over the noise [R].

    Returns
    -------
    tuple of Errors
        Sorted by signal.

    """
    system_segments = system.segments
    parts: dict[str, list[tuple[int, Flags]]] = {}
    for place, (number, channel, order) in enumerate(system.labels):
        in_group = system.group == place
        if order == 0 and system_segments[number].weak is not None and in_group.any():
            parts.setdefault(reported_signal(system_segments[number], channel), []).append(
                (number, in_group)
            )
    variables = [window_variables(segment) for segment in system_segments]
    return tuple(
        _errors_of(signal, groups, variables, system, whitened)
        for signal, groups in sorted(parts.items())
    )


def _errors_of(
    signal: str,
    groups: Sequence[tuple[int, Flags]],
    variables: Sequence[Mapping[str, Array]],
    system: LinearSystem,
    whitened: Array,
) -> Errors:
    unit = np.concatenate([system.unit[rows] for _, rows in groups])
    noise_ratio = np.concatenate([system.noise_ratio[rows] for _, rows in groups])

    def variable(name: str, number: int, in_capture: Flags) -> Array:
        values = variables[number].get(name, np.full(system.segments[number].size, np.nan))
        return values[system.window[in_capture]]

    names = sorted({name for number, _ in groups for name in variables[number]})
    return Errors(
        signal,
        np.concatenate([whitened[rows] for _, rows in groups]) * unit,
        unit * noise_ratio,
        np.concatenate([np.full(int(rows.sum()), number) for number, rows in groups]),
        np.concatenate([system.window[rows] for _, rows in groups]),
        {name: np.concatenate([variable(name, *group) for group in groups]) for name in names},
    )


def window_variables(segment: Segment) -> dict[str, Array]:
    """Window means of what an error may depend on.

    Parameters
    ----------
    segment
        The segment.

    Returns
    -------
    dict of array [W]
        By glossary name; the speed is from the ends of the angle. Empty for a table.

    """
    weak = segment.weak
    if weak is None:
        return {}
    signals = dict(segment.recorded)
    values = {}
    theta = signals.get("theta_mech_rad")
    if theta is not None and np.ptp(theta) > 0:
        turned = theta[weak.starts + weak.length - 1] - theta[weak.starts]
        values["omega_mech_rad_s"] = turned / ((weak.length - 1) * segment.ts_s)
    for name in CURVES[1:]:
        if name in signals:
            values[name] = weak.means(signals[name][None])[0]
    if "t_s" not in values:
        values["t_s"] = weak.starts.astype(np.float64) * segment.ts_s
    return values


def speed_current_map(errors: Errors, policy: Validation) -> ErrorMap | None:
    """Mean error over cells of speed and q current.

    Parameters
    ----------
    errors
        Errors of a signal.
    policy
        Number of cells.

    Returns
    -------
    ErrorMap or None
        None where no capture records both.

    """
    if "iq_a" not in errors.at or "omega_mech_rad_s" not in errors.at:
        return None
    speed, current = errors.at["omega_mech_rad_s"], errors.at["iq_a"]
    inside = np.isfinite(speed) & np.isfinite(current)
    if inside.sum() < 2:
        return None
    x = Bins("omega_mech_rad_s", _even(speed[inside], policy.speed_cells))
    y = Bins("iq_a", _even(current[inside], policy.current_cells))
    cell = _place(current[inside], y) * x.count + _place(speed[inside], x)
    return _window_map(errors, inside, cell, x, y)


def curve(errors: Errors, variable: str, policy: Validation) -> ErrorMap | None:
    """Mean error over ranges of one variable that hold equal shares of the windows.

    Parameters
    ----------
    errors
        Errors of a signal.
    variable
        Glossary name.
    policy
        Number of ranges.

    Returns
    -------
    ErrorMap or None
        None where the variable was not recorded or does not vary.

    """
    value = errors.at.get(variable)
    if value is None:
        return None
    inside = np.isfinite(value)
    if inside.sum() < 2 or np.ptp(value[inside]) <= 1e-9 * np.abs(value[inside]).max():
        return None
    edges = np.unique(np.quantile(value[inside], np.linspace(0.0, 1.0, policy.curve_cells + 1)))
    x = Bins(variable, tuple(float(edge) for edge in edges))
    return _window_map(errors, inside, _place(value[inside], x), x, None)


def direction(errors: Errors) -> ErrorMap | None:
    """Mean error by sense of rotation.

    Parameters
    ----------
    errors
        Errors of a signal.

    Returns
    -------
    ErrorMap or None
        Two cells; None where the shaft turns in one sense only.

    """
    value = errors.at.get("omega_mech_rad_s")
    if value is None:
        return None
    inside = np.isfinite(value) & (value != 0.0)
    sense = np.sign(value[inside])
    if np.unique(sense).size < 2:
        return None
    x = Bins("direction", (-1.0, 0.0, 1.0))
    return _window_map(errors, inside, (sense > 0).astype(np.int64), x, None)


def _window_map(errors: Errors, inside: Flags, cell: Indices, x: Bins, y: Bins | None) -> ErrorMap:
    visit = visits_of(cell, errors.segment[inside])
    error, sigma = errors.error[inside], errors.sigma[inside]
    return mean_map(errors.signal, (error, sigma), cell, visit, x, y)


def _even(value: Array, cells: int) -> tuple[float, ...]:
    low, high = float(value.min()), float(value.max())
    if high <= low:
        low, high = low - 0.5, high + 0.5
    return tuple(float(edge) for edge in np.linspace(low, high, cells + 1))


def _place(value: Array, bins: Bins) -> Indices:
    inner = np.array(bins.edges[1:-1])
    return np.searchsorted(inner, value, side="right").astype(np.int64)


def angle_maps(fit: Fit) -> tuple[ErrorMap, ...]:
    """Mean error over the electrical and the mechanical angle of a turn, sample by sample.

    Parameters
    ----------
    fit
        The fit.

    Returns
    -------
    tuple of ErrorMap
        By signal and angle.

    Notes
    -----
    The mean of each window is subtracted first: what is left turns with the shaft. A window is one
    visit of every cell that it crosses.

    """
    parts: dict[tuple[str, str], list[tuple[Array, Array, Array, Array]]] = {}
    cells = {
        "theta_elec_rad": fit.policy.validation.angle_cells,
        "theta_mech_rad": _mechanical_cells(fit.model),
    }
    turning = [segment for segment in fit.segments if _turns(segment)]
    windows = [0 if s.weak is None else s.weak.starts.size for s in turning]
    arguments = [(fit.alone, cells, sum(windows[:n])) for n in range(len(turning))]
    for of_segment in on_each(_by_angle, turning, arguments):
        for signal, variable, part in of_segment:
            parts.setdefault((signal, variable), []).append(part)
    maps = []
    for (signal, variable), pieces in sorted(parts.items()):
        error, sigma, cell, window = (np.concatenate(part) for part in zip(*pieces, strict=True))
        x = Bins(variable, tuple(np.linspace(0.0, 2 * math.pi, cells[variable] + 1).tolist()))
        cell = cell.astype(np.int64)
        visit = window.astype(np.int64) * x.count + cell
        maps.append(mean_map(signal, (error, sigma), cell, visit, x, None))
    return tuple(maps)


def _turns(segment: Segment) -> bool:
    theta = segment.recorded.get("theta_mech_rad")
    mapped = equation_of(segment).use.angle_maps
    return theta is not None and mapped and float(np.ptp(theta)) > 0.1


def _mechanical_cells(model: Model) -> int:
    """Four cells a wave of the highest order that a slow turn is looked at in, and one more: every
    wave then meets the cells at other phases, and all together show its shape.
    """
    highest = math.ceil(max(slow_orders(model.machine), default=1))
    return min(max(4 * highest, 72) + 1, model.policy.validation.most_angle_cells)


def _by_angle(
    segment: Segment, fit: Fit, cells: Mapping[str, int], first: int
) -> list[tuple[str, str, tuple[Array, Array, Array, Array]]]:
    """Signal, variable and parts [n] of a map: errors, noise, cells and windows."""
    weak, parts = segment.weak, []
    if weak is None:
        return []
    residuals = residual(segment, fit.model, fit.values)
    theta = segment.recorded["theta_mech_rad"]
    starts = disjoint(weak.starts, weak.length)
    rows = starts[:, None] + np.arange(2, weak.length - 2)[None, :]
    window = np.broadcast_to(first + np.arange(starts.size)[:, None], rows.shape).ravel()
    own_zero = "bench_angle_rad" in equation_of(segment).observes.constants
    # the bench's encoder has a zero of its own, which is known as an electrical angle alone
    zero_rad = fit.values["bench_angle_rad"] if own_zero else 0.0
    turned = {
        "theta_elec_rad": fit.model.machine.pole_pairs * theta - zero_rad,
        "theta_mech_rad": theta,
    }
    for place, channel in enumerate(segment.channels):
        inside = residuals[place][rows]
        inside = inside - inside.mean(axis=1, keepdims=True)
        noise = float(np.sqrt((inside**2).mean())) or 1.0
        for variable, angle in turned.items():
            share = np.mod(angle[rows].ravel() / (2 * math.pi), 1.0)
            cell = np.minimum((share * cells[variable]).astype(np.int64), cells[variable] - 1)
            error = inside.ravel()
            part = (error, np.full(error.size, noise), cell.astype(float), window.astype(float))
            parts.append((reported_signal(segment, channel), variable, part))
    return parts


def disjoint(starts: Indices, length: int) -> Indices:
    """Windows that share no samples.

    Parameters
    ----------
    starts
        First samples, ascending [W].
    length
        Samples a window.

    Returns
    -------
    array of int
        Those that are kept, the earliest first.

    """
    chosen: list[int] = []
    for start in starts.tolist():
        if not chosen or start >= chosen[-1] + length:
            chosen.append(start)
    return np.array(chosen, dtype=np.int64)


def histograms(errors: Sequence[Errors], policy: Validation) -> tuple[Histogram, ...]:
    """How the window errors of each signal, over their noise floor, are distributed.

    Parameters
    ----------
    errors
        Errors of each signal.
    policy
        Number of bins, and how far they reach.

    """
    edges = np.linspace(-policy.histogram_reach, policy.histogram_reach, policy.histogram_cells + 1)
    histograms_of = []
    for one in errors:
        inside = np.clip(one.error / one.sigma, edges[0], np.nextafter(edges[-1], 0.0))
        count, _ = np.histogram(inside, edges)
        histograms_of.append(Histogram(one.signal, tuple(edges.tolist()), tuple(count.tolist())))
    return tuple(histograms_of)


def all_maps(system: LinearSystem, residual_over_floor: Array) -> tuple[ErrorMap, ...]:
    """Every map of every signal: speed and current, angles, and one curve a variable.

    Parameters
    ----------
    system
        The fit.
    residual_over_floor
        [R].

    """
    maps: list[ErrorMap | None] = []
    policy = system.policy.validation
    for errors in window_errors(system, residual_over_floor):
        maps.append(speed_current_map(errors, policy))
        maps.extend(curve(errors, variable, policy) for variable in CURVES)
        maps.append(direction(errors))
    return (*(one for one in maps if one is not None), *angle_maps(system.fit))
