"""Magnet flux and inductances at zero current, from tables of flux linkage or steady voltage."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from pipeline.estimation.electrical.magnet_temperature import (
    assumed_temperature,
    magnet_column,
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import magnet_coefficient
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    contributions,
    instrument_uncertainties,
    shifted_gains,
    shifted_offsets,
    unstated_note,
)
from pipeline.numerics.least_squares import LinearFit, linear_fit
from pipeline.numerics.quantisation import resolution, spread_alike, steps_of
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Array, Campaign, Capture, Flags, Indices
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import propagate

METHOD = Method("flux_map")
EXPERIMENT = (
    "record a flux_map: flux linkages of both axes over d and q currents of both senses, five "
    "levels or more each, zero among them"
)
LINKAGES = {"d": "psi_d_wb", "q": "psi_q_wb"}
PLACES = {"psi_pm_wb": ("d", 0), "ld_h": ("d", 1), "lq_h": ("q", 1)}
"""The axis of each constant, and the place of its derivative in `direct_flux` or
`quadrature_flux`."""
SAME = 0.01
STEP_1_K = 1e-5


def direct_flux(id_a: Array, iq_a: Array) -> Array:
    """The derivatives of ψ_d by what is fitted: Taylor's terms at zero current, to third order.

    Parameters
    ----------
    id_a, iq_a : array [n], A
        Rotor-frame currents, amplitude-invariant.

    Returns
    -------
    array [n, 6]
        Those by ψ_pm [1] and L_d [A], and of i_d², i_q², i_d³, i_d i_q²: ψ_d is even in i_q.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines: flux linkages against currents).

    """
    ones = np.ones(id_a.size)
    return np.column_stack([ones, id_a, id_a**2, iq_a**2, id_a**3, id_a * iq_a**2])


def quadrature_flux(id_a: Array, iq_a: Array) -> Array:
    """The derivatives of ψ_q by what is fitted, as those of ψ_d in `direct_flux`.

    Parameters
    ----------
    id_a, iq_a : array [n], A
        Rotor-frame currents, amplitude-invariant.

    Returns
    -------
    array [n, 5]
        Those by an offset [1] and L_q [A], and of i_d i_q, i_q³, i_d² i_q: but for a frame that is
        turned a little, ψ_q is odd in i_q.

    """
    ones = np.ones(id_a.size)
    return np.column_stack([ones, iq_a, id_a * iq_a, iq_a**3, id_a**2 * iq_a])


TERMS: Mapping[str, Callable[[Array, Array], Array]] = {"d": direct_flux, "q": quadrature_flux}


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """ψ_pm, L_d and L_q at zero current, by the widest range of currents that says the same.

    Notes
    -----
    Iron bends flux linkage. So the terms are fitted to the rows within a range of current, and that
    range is the widest whose result lies within the intervals of all narrower ones [1]. A table of
    v_q at several speeds shows ω_e ψ_d; each level of current has an offset of its own there, which
    holds what resistance and inverter drop.

    References
    ----------
    [1] Lepski, Theory Probab. Appl. 35(3), 1991, 454, doi:10.1137/1135065.

    """
    captures = campaign.of(METHOD.name)
    by_axis = _by_axis(captures, pole_pairs_of(known, campaign.nameplate("pole_pairs")))
    alpha, alpha_budget = magnet_coefficient(known)
    estimates, evidence = [], []
    for name, (axis, place) in PLACES.items():
        rows = by_axis.get(axis)
        used = None if rows is None else _widest(rows, place, alpha, options["level"])
        if used is None:
            estimates.append(METHOD.missing(name, EXPERIMENT))
            continue
        estimate = _estimate(name, used, alpha)
        if name == "psi_pm_wb":
            warmer = float(used.solved(alpha + STEP_1_K).coefficients[place])
            slope = (warmer - estimate.number) / STEP_1_K
            budget = propagate([(1.0, estimate.budget), (slope, alpha_budget)])
            estimate = replace(estimate, budget=budget)
        estimates.append(estimate)
        if place == 1:
            evidence.append(_plot(used, alpha))
    return Fit(tuple(estimates), tuple(evidence))


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows [n] of all tables that show the flux linkage of one axis.

    `signal` is `factor` times the flux linkage, and an offset a `level` where that is not negative;
    `rounded` and `rounded_a` are what its readings and those of its axis's current are rounded to.
    """

    axis: str
    captures: Sequence[Capture]
    table: Indices
    id_a: Array
    iq_a: Array
    signal: Array
    factor: Array
    level: Indices
    excess_k: Array
    rounded: Array
    rounded_a: Array

    @property
    def reach(self) -> Array:
        """The larger of both currents, each over its largest [n]."""
        shares = [np.abs(i) / max(float(np.abs(i).max()), 1e-300) for i in (self.id_a, self.iq_a)]
        return np.maximum(*shares)

    def at(self, rows: Flags) -> _Rows:
        """Some of the rows."""
        names = ("table", "id_a", "iq_a", "signal", "factor", "level", "excess_k")
        kept = (*names, "rounded", "rounded_a")
        return replace(self, **{name: getattr(self, name)[rows] for name in kept})

    def design(self, alpha_1_k: float) -> Array:
        """The derivatives [n, k] of the signal, those by offsets of levels last."""
        terms = TERMS[self.axis](self.id_a, self.iq_a)
        if self.axis == "d":
            terms[:, 0] *= 1.0 + alpha_1_k * self.excess_k
        levels = np.unique(self.level[self.level >= 0])
        return np.column_stack(
            [terms * self.factor[:, None], self.level[:, None] == levels[None, :]]
        )

    def solved(self, alpha_1_k: float) -> LinearFit:
        """Least squares over these rows; what their readings are rounded to adds to its scatter."""
        design = self.design(alpha_1_k)
        found = linear_fit(design, self.signal)
        if not (self.rounded.any() or self.rounded_a.any()):
            return found
        across = self.id_a if self.axis == "d" else self.iq_a
        levers = np.linalg.pinv(design).astype(np.float64)
        slope = self.factor * found.coefficients[1]
        left = _rounded(levers, self.signal, self.rounded)
        left += _rounded(levers * slope, across, self.rounded_a)
        return replace(found, covariance=found.covariance + left)

    def shifted(self, shift: Shift) -> _Rows:
        """The rows as they were if instruments are off."""
        kinds = ("current", "voltage", "clock")
        amps, volts, fast = shifted_gains(shift, self.captures, self.table, *kinds)
        warmer = shifted_offsets(shift, map(magnet_source, self.captures), self.table)
        return replace(
            self,
            id_a=amps * self.id_a,
            iq_a=amps * self.iq_a,
            signal=volts * self.signal,
            factor=np.where(self.level < 0, 1.0, 1.0 / fast) * self.factor,
            excess_k=self.excess_k + warmer,
        )


def _by_axis(captures: Sequence[Capture], pole_pairs: int | None) -> dict[str, _Rows]:
    """Rows of the tables by axis: flux linkages where there are any, else q voltages at speeds."""
    maps = [c for c in captures if c.has("id_a", "iq_a", *LINKAGES.values())]
    if maps:
        return {
            axis: _joined(axis, maps, [_flux_table(c, name) for c in maps])
            for axis, name in LINKAGES.items()
        }
    sweeps = [c for c in captures if c.has("id_a", "omega_mech_rad_s", "vq_v")]
    if not sweeps or pole_pairs is None:
        return {}
    return {"d": _joined("d", sweeps, [_speed_table(c, pole_pairs) for c in sweeps])}


def _joined(axis: str, captures: Sequence[Capture], tables: Sequence[dict[str, Array]]) -> _Rows:
    first, levels = 0, []
    for one in tables:
        levels.append(np.where(one["level"] < 0, -1, one["level"] + first).astype(np.int64))
        first += int(one["level"].max(initial=-1)) + 1
    names = ("id_a", "iq_a", "signal", "factor", "excess_k", "rounded", "rounded_a")
    table = np.repeat(np.arange(len(tables)), [one["id_a"].size for one in tables])
    columns = {name: np.concatenate([one[name] for one in tables]) for name in names}
    return _Rows(axis, tuple(captures), table, level=np.concatenate(levels), **columns)


def _flux_table(capture: Capture, linkage: str) -> dict[str, Array]:
    columns = _columns(capture, "id_a", "iq_a", linkage)
    size = columns["id_a"].size
    signal = columns.pop(linkage)
    across = columns["id_a" if linkage == LINKAGES["d"] else "iq_a"]
    read = {"signal": signal, "rounded": steps_of(signal), "rounded_a": _steps_a(across)}
    return columns | read | {"factor": np.ones(size), "level": np.full(size, -1.0)}


def _speed_table(capture: Capture, pole_pairs: int) -> dict[str, Array]:
    """The drop of the q current is taken off in the file, and with it what that current does."""
    columns = _columns(capture, "id_a", "omega_mech_rad_s", "vq_v")
    signal = columns.pop("vq_v")
    id_a, omega = columns["id_a"], columns.pop("omega_mech_rad_s")
    order, level = np.argsort(id_a), np.empty(id_a.size)
    level[order] = np.cumsum(np.diff(id_a[order], prepend=id_a[order[:1]]) > SAME * np.ptp(id_a))
    return columns | {
        "iq_a": np.zeros(id_a.size),
        "signal": signal,
        "rounded": steps_of(signal),
        "rounded_a": _steps_a(id_a),
        "factor": pole_pairs * omega,
        "level": level,
    }


def _steps_a(current_a: Array) -> Array:
    """What readings of a current are rounded to [n]; 0 of levels that were set, which have no
    scatter.
    """
    if resolution(current_a) > SAME * float(np.ptp(current_a)):
        return np.zeros(current_a.size)
    return steps_of(current_a)


def _rounded(levers: Array, values: Array, steps: Array) -> Array:
    """Covariance [k, k] by what rounding leaves in readings [n]: one error in all of one step."""
    cells = np.round(np.abs(values) / np.where(steps > 0.0, steps, 1.0))
    alike = [*zip(cells.tolist(), steps.tolist(), strict=True)]
    return spread_alike(levers, np.sign(values) * steps / math.sqrt(12.0), alike)


def _columns(capture: Capture, *names: str) -> dict[str, Array]:
    """Columns without rows that lack one of them, and how much warmer than 25 °C magnets are."""
    columns = capture.finite(*names)
    thermometer = magnet_column(capture)
    degc = assumed_temperature(capture, REFERENCE_DEGC)
    if thermometer is not None:
        degc = float(np.nanmean(capture.arrays(thermometer)[thermometer]))
    return columns | {"excess_k": np.full(columns[names[0]].size, degc - REFERENCE_DEGC)}


def _widest(rows: _Rows, place: int, alpha_1_k: float, level: float) -> _Rows | None:
    """The rows of the widest range of current by which a coefficient lies within its intervals by
    all narrower ranges; None where no range determines it, or zero current is outside of all.
    """
    across = rows.id_a if rows.axis == "d" else rows.iq_a
    edge = SAME * float(np.ptp(across)) if across.size else 0.0
    if not across.size or across.min() > edge or across.max() < -edge:
        return None
    reach, widest = rows.reach, None
    low, high = -math.inf, math.inf
    for limit in np.unique(np.round(reach / SAME)) * SAME:
        window = rows.at(reach <= limit + 0.5 * SAME)
        found = window.solved(alpha_1_k)
        u = found.u(place)
        tied = found.rank < np.count_nonzero(found.rows.any(axis=0))
        if tied or found.dof < 1 or not math.isfinite(u):
            continue
        value = float(found.coefficients[place])
        if low <= value <= high:
            widest = window
        half = float(stdtrit(found.dof, 1.0 - 0.5 * level)) * u
        low, high = max(low, value - half), min(high, value + half)
    return widest


def _estimate(name: str, rows: _Rows, alpha_1_k: float) -> Estimate:
    place, captures = PLACES[name][1], rows.captures
    found = rows.solved(alpha_1_k)

    def value(shift: Shift) -> Array:
        return rows.shifted(shift).solved(alpha_1_k).coefficients[place : place + 1]

    uncertainties = instrument_uncertainties(captures, ("voltage", "current", "clock"))
    parts = contributions(value, uncertainties | magnet_uncertainties(captures))[0]
    parts.append(METHOD.scatter(name, found.u(place), found.dof))
    reach = {"id_a": float(np.abs(rows.id_a).max()), "iq_a": float(np.abs(rows.iq_a).max())}
    within = " and ".join(f"{size:.3g} A of {key[:2]}" for key, size in reach.items() if size)
    notes = [f"at zero current, by rows within {within}"]
    notes.append(unstated_note(captures, ("voltage", "current")))
    notes.append(unlogged_note(captures) if name == "psi_pm_wb" else "")
    number = float(found.coefficients[place])
    return METHOD.measured(name, number, parts, captures, {"current_a": 0.0}, notes)


def _plot(rows: _Rows, alpha_1_k: float) -> Evidence:
    """Flux linkage against the current of its axis, offsets of levels taken off."""
    found, terms = rows.solved(alpha_1_k), TERMS[rows.axis](rows.id_a, rows.iq_a).shape[1]
    design = rows.design(alpha_1_k)
    fitted = design[:, :terms] @ found.coefficients[:terms] / rows.factor
    current = rows.id_a if rows.axis == "d" else rows.iq_a
    series = [
        over_x(c.path, current[at], (fitted + found.residuals / rows.factor)[at], fitted[at])
        for number, c in enumerate(rows.captures)
        for at in [rows.table == number]
    ]
    title = f"Flux linkage of the {rows.axis} axis near zero current"
    return METHOD.plot(title, (f"i{rows.axis}_a", LINKAGES[rows.axis]), "scatter", series)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=tuple(PLACES),
    tests=(METHOD.name,),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", "temp_coeff_magnet_1_k"),
    aids=("pole_pairs", "temp_coeff_magnet_1_k"),
    rank=3,
    options={
        # Chance that a narrower range's interval misses what a wider one says.
        "level": 0.01,
    },
)
