"""Where the uncertainty of an inductance from steps comes from."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pipeline.estimation.electrical.step_fit import AXES, Solution
from pipeline.estimation.electrical.step_parameters import LD, LQ, Array
from pipeline.estimation.electrical.step_record import StepRecord, rotor_angle_rad
from pipeline.estimation.uncertainty.instruments import (
    current_source,
    instrument_uncertainties,
    station,
    voltage_source,
)
from pipeline.records.uncertainty import Contribution


def gains(name: str, solution: Solution) -> list[Contribution]:
    """Each instrument's share, by the linearised fit: dp = -C J' W dr under its gain.

    A gain scales what was read. Where the voltage drives the model sample by sample, it scales the
    predicted current. It acts on the captures of its station alone. Nobody says how much of a gain
    stays from day to day: of captures of several days half its variance is taken as the
    instrument's, half as each day's own, so that a ratio of d of one day and q of the next does
    not lose it.

    Parameters
    ----------
    name
        `ld_h` or `lq_h`.
    solution
        The fit.

    Returns
    -------
    list of Contribution
        [H], signed, one a source and day.

    """
    records = solution.model.records
    days = sorted({_day(record) for record in records})
    lever, currents = _lever(name, solution), _driven_currents(solution)
    parts = []
    for source, u in instrument_uncertainties(
        [r.capture for r in records], ("voltage", "current")
    ).items():
        change = _under_gain(source, solution, currents)
        acting = [float(lever @ (change * _rows_of(day, solution))) for day in days]
        if len(days) == 1:
            parts.append(Contribution(source, u * acting[0], "B"))
            continue
        half = u * math.sqrt(0.5)
        parts.append(Contribution(source, half * sum(acting), "B"))
        for day, share in zip(days, acting, strict=True):
            parts.append(Contribution(f"{source}:{day}", half * share, "B"))
    return parts


def _under_gain(source: str, solution: Solution, currents: Sequence[Array]) -> Array:
    """Change of the weighted residuals [n] by a gain of one source of the driven currents."""
    change = []
    for record, weight, current in zip(
        solution.model.records, solution.weights, currents, strict=True
    ):
        amps, volts = np.zeros(record.i_a.size), np.zeros(record.i_a.size)
        if voltage_source(record.capture.meta) == source and record.wave.has_supply:
            volts = -record.v_v * weight[1]
        elif voltage_source(record.capture.meta) == source:
            amps = current * weight[0]
        if current_source(record.capture.meta) == source:
            amps = amps - record.i_a * weight[0]
        change += [amps, volts]
    return np.concatenate(change)


def _day(record: StepRecord) -> str:
    """The day of a capture, empty where it does not say."""
    return (record.capture.meta.started_at or "")[:10]


def _rows_of(day: str, solution: Solution) -> Array:
    """1 for the residuals [n] of captures of a day, else 0."""
    records = solution.model.records
    return np.concatenate([np.full(2 * r.i_a.size, float(_day(r) == day)) for r in records])


def rotor_angles(name: str, solution: Solution, u_theta_rad: float) -> list[Contribution]:
    """What an error of each angle at which the rotor was locked makes of an inductance.

    One error for all captures of one stated angle, as the rotor was locked once. On an axis only
    its square counts, c δ² with a root mean square of √3 c u² for a normal δ.

    Parameters
    ----------
    name
        `ld_h` or `lq_h`.
    solution
        The fit.
    u_theta_rad
        Standard uncertainty of an angle at which the rotor was locked [rad, electrical].

    Returns
    -------
    list of Contribution
        [H], one an angle and station.

    """
    places = [_place(record) for record in solution.model.records]
    turned = [
        (n, replace(record, axis_rad=record.axis_rad + side * u_theta_rad))
        for side in (-1.0, 1.0)
        for n, record in enumerate(solution.model.records)
    ]
    ends = _moves(name, solution, turned).reshape(2, len(places))
    parts = []
    for place in sorted(set(places)):
        before, after = ends[:, [one == place for one in places]].sum(axis=1).tolist()
        odd, even = 0.5 * (after - before), 0.5 * (after + before)
        u = math.copysign(math.hypot(odd, math.sqrt(3.0) * even), odd)
        parts.append(Contribution(f"theta_elec:{place[1]:g}@{place[0]}", u, "B"))
    return parts


def rounded_levels(name: str, solution: Solution) -> float:
    """Standard uncertainty by the rounding of a voltage that drives the model as it was sampled.

    Parameters
    ----------
    name
        Of the inductance, `ld_h` or `lq_h`.
    solution
        The fit of all captures.

    Returns
    -------
    float
        [H]; 0 where every voltage is a supply's, whose samples' weights hold it already.

    Notes
    -----
    What rounding leaves in the mean of a level, one error between two of the edges that move, added
    in squares.

    """
    rounded = []
    for n, record in enumerate(solution.model.records):
        wave, rounding = record.wave, record.voltage_noise.rounding
        if wave.has_supply or rounding < 1e-9 * float(np.max(np.abs(wave.levels_v))):
            continue
        edges = np.flatnonzero(wave.moves.any(axis=1) & ~wave.moves.all(axis=1))
        for cells in np.split(np.arange(wave.levels_v.size), edges):
            levels = wave.levels_v.copy()
            levels[cells] += rounding
            rounded.append((n, replace(record, wave=replace(wave, levels_v=levels))))
    return float(np.linalg.norm(_moves(name, solution, rounded)))


def unexplained(solution: Solution) -> dict[str, float]:
    """What the fit leaves of each capture's current beyond its noise.

    Parameters
    ----------
    solution
        The fit of all captures.

    Returns
    -------
    dict
        Root mean square over the span of the current [1], by path.

    """
    parts, first = {}, 0
    for record, weight in zip(solution.model.records, solution.weights, strict=True):
        rows = slice(first, first + record.i_a.size)
        first = rows.stop + record.i_a.size
        residuals = solution.fit.residuals[rows] / weight[0]
        noise = record.current_noise.sigma**2 / record.count
        excess = max(float(np.mean(residuals**2)) - float(np.mean(noise)), 0.0)
        parts[record.capture.path] = math.sqrt(excess) / max(float(np.ptp(record.i_a)), 1e-300)
    return parts


def birge_ratio(solution: Solution) -> float:
    """How far the captures disagree on L beyond their own scatter, at least 1.

    Each capture gets a factor of its own on both inductances, by one Gauss-Newton step; their chi
    square over what the axes leave of the captures. Reference: Birge, Phys. Rev. 40, 1932, 207.

    Parameters
    ----------
    solution
        The fit of all captures.

    Returns
    -------
    float
        [1], by which the scatter is widened.

    References
    ----------
    Birge, Phys. Rev. 40, 1932, 207, doi:10.1103/PhysRev.40.207.

    """
    where = np.flatnonzero(solution.free)
    axes = [k for k in (LD, LQ) if solution.free[k]]
    records, fit = solution.model.records, solution.fit
    if len(records) <= len(axes):
        return 1.0
    together = np.searchsorted(where, axes)
    factor = fit.jacobian[:, together] @ solution.parameters[axes]
    owner = np.repeat(np.arange(len(records)), [2 * r.i_a.size for r in records])
    of_record = np.where(owner[:, None] == np.arange(len(records)), factor[:, None], 0.0)
    others = np.delete(fit.jacobian, together, axis=1)
    scale = np.linalg.norm(others, axis=0)
    basis = np.linalg.qr(others[:, scale > 0.0] / scale[scale > 0.0])[0]
    of_record = of_record - basis @ (basis.T @ of_record)
    residuals = fit.residuals - basis @ (basis.T @ fit.residuals)
    spread = of_record * solution.scatter[:, None]
    score, meat = of_record.T @ residuals, spread.T @ spread
    chi2 = float(score @ np.linalg.pinv(meat, 1e-10, hermitian=True) @ score)
    return max(1.0, math.sqrt(chi2 / (len(records) - len(axes))))


def _lever(name: str, solution: Solution) -> Array:
    """Change of one inductance by a change of each weighted residual [n]."""
    fit = solution.fit
    row = int(np.flatnonzero(np.flatnonzero(solution.free) == AXES[name][0])[0])
    scale = np.linalg.norm(fit.jacobian, axis=0)
    scale[scale == 0.0] = 1.0
    scaled = fit.jacobian / scale
    inverse = np.linalg.pinv(scaled.T @ scaled, hermitian=True)
    return -(inverse[row] / scale[row]) @ scaled.T


def _place(record: StepRecord) -> tuple[str, float]:
    angle = rotor_angle_rad(record.capture) or 0.0
    return station(record.capture.meta), round(math.degrees(angle), 3)


def _moves(name: str, solution: Solution, altered: Sequence[tuple[int, StepRecord]]) -> Array:
    """Change [k, H] of an inductance by each record that is in the place of a capture."""
    model = solution.model
    places = [*range(len(model.records)), *(n for n, _ in altered)]
    instead = model.of([*model.records, *(record for _, record in altered)], places)
    readings = [
        (np.vstack([current[:, 0], volts[:, 0]]) * solution.weights[n]).ravel()
        for n, (current, volts) in zip(
            places, instead.predict_both([solution.parameters[None, :]] * len(places)), strict=True
        )
    ]
    edges = np.cumsum([2 * record.i_a.size for record in model.records])[:-1]
    levers = np.split(_lever(name, solution), edges)
    moved = readings[len(model.records) :]
    return np.array(
        [levers[n] @ (one - readings[n]) for (n, _), one in zip(altered, moved, strict=True)]
    )


def _driven_currents(solution: Solution) -> list[Array]:
    """Predicted current [n] of each capture, without the offset."""
    model = solution.model
    rows = [solution.parameters[None, :]] * len(model.records)
    offsets = [
        0.0 if slots.offset_a is None else float(solution.parameters[at + slots.offset_a])
        for at, slots in zip(model.layout.starts, model.layout.slots, strict=True)
    ]
    return [i[:, 0] - x for i, x in zip(model.predict(rows), offsets, strict=True)]
