"""Resistance, inductances and magnet flux from settled points of a shaft that turns."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.electrical.link import link_voltage_v
from pipeline.estimation.electrical.magnet_temperature import (
    assumed_temperature,
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of, turning_tables
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import magnet_coefficient
from pipeline.estimation.uncertainty.instruments import (
    Shift,
    contributions,
    instrument_uncertainties,
    shifted_gains,
    shifted_offsets,
    temperature_source,
    unstated_note,
)
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.numerics.least_squares import LinearFit, linear_fit
from pipeline.numerics.selection import needed_columns
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Array, Campaign, Capture, Indices
from pipeline.records.constants import Constants
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution, propagate

METHOD = Method("steady_points")
GIVES = ("r_phase_ohm", "lq_h", "ld_h", "psi_pm_wb")
"""In the order of the columns of `steady_voltage`."""
COLUMNS = ("omega_mech_rad_s", "id_a", "iq_a", "vd_v", "vq_v")
EXPERIMENT = (
    "record a torque_table of settled points with omega_mech_rad_s, vd_v, vq_v, id_a and iq_a: q "
    "currents of several sizes, d currents of two or more, at two speeds or more"
)
WARMTH = "temp_winding_degc"
UNLOGGED = "assumed:temp_winding_degc"
STEP_1_K = 1e-5


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows [n] of all tables, one after the other; `table` is the number of each row's table."""

    captures: Sequence[Capture]
    table: Indices
    omega_e_rad_s: Array
    id_a: Array
    iq_a: Array
    vd_v: Array
    vq_v: Array
    winding_k: Array
    magnet_k: Array

    @property
    def voltage_v(self) -> Array:
        """Both voltages [2 n], those of the d axis first."""
        return np.concatenate([self.vd_v, self.vq_v])

    def shifted(self, shift: Shift) -> _Rows:
        """The rows as they were if instruments are off."""
        kinds = ("current", "voltage", "clock")
        amps, volts, fast = shifted_gains(shift, self.captures, self.table, *kinds)
        winding = shifted_offsets(shift, map(_winding_source, self.captures), self.table)
        magnet = shifted_offsets(shift, map(magnet_source, self.captures), self.table)
        return replace(
            self,
            omega_e_rad_s=self.omega_e_rad_s / fast,
            id_a=amps * self.id_a,
            iq_a=amps * self.iq_a,
            vd_v=volts * self.vd_v,
            vq_v=volts * self.vq_v,
            winding_k=self.winding_k + winding,
            magnet_k=self.magnet_k + magnet,
        )


def steady_voltage(rows: _Rows, magnet_1_k: float) -> tuple[Array, dict[str, Array]]:
    """What the dq voltages of settled points are linear in.

    v_d = R i_d − ω_e L_q i_q, v_q = R i_q + ω_e (L_d i_d + ψ)

    Parameters
    ----------
    rows
        Currents [n, A], electrical speed [n, rad/s] and temperatures over 25 °C [n, K].
    magnet_1_k
        Coefficient of the magnet's flux at 25 °C [1/K].

    Returns
    -------
    base : array [2 n, 4]
        Columns of R [A], L_q and L_d [A rad/s] and ψ [rad/s].
    candidates : dict of array [2 n]
        Columns that enter where a test asks for them: saturation and cross-saturation, of one
        co-energy; a frame that is turned, a voltage that is late or an iron loss; a resistance that
        grows with frequency; a drop of the inverter; zeros of the voltmeters.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines: steady-state load).

    """
    i_d, i_q, w = rows.id_a, rows.iq_a, rows.omega_e_rad_s
    nothing, copper = np.zeros(w.size), 1.0 + COPPER_COEFFICIENT_25_1_K * rows.winding_k
    warm = 1.0 + magnet_1_k * rows.magnet_k

    def both(of_d: Array, of_q: Array) -> Array:
        return np.concatenate([of_d, of_q])

    base = np.column_stack([
        both(copper * i_d, copper * i_q),
        both(-w * i_q, nothing),
        both(nothing, w * i_d),
        both(nothing, w * warm),
    ])  # fmt: skip
    length = np.maximum(np.hypot(i_d, i_q), 1e-300)
    candidates = {
        "iq^3": both(-w * i_q**3, nothing),
        "iq^5": both(-w * i_q**5, nothing),
        "id^2": both(nothing, w * i_d**2),
        "id^3": both(nothing, w * i_d**3),
        "id iq^2": both(-2.0 * w * i_d * i_q, w * i_q**2),
        "id^2 iq^2": both(-w * i_d**2 * i_q, w * i_d * i_q**2),
        "frame": both(w, nothing),
        "late": both(w**2, nothing),
        "late current": both(w**2 * i_d, w**2 * i_q),
        "drop": both(i_d / length, i_q / length),
        "zero d": both(np.ones(w.size), nothing),
        "zero q": both(nothing, np.ones(w.size)),
    }
    return base, candidates


FIRST_BENDS = ("iq^3", "id^2")
BENDING = ("iq^3", "iq^5", "id^2", "id^3", "id iq^2", "id^2 iq^2")


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """R, L_d, L_q and ψ at zero current by `steady_voltage`, over all tables of a turning shaft.

    Notes
    -----
    A row is a settled point, so no derivative is in it. Saturation and errors of the frame join
    where the data demand them. What the last term of saturation moves is in u, half of it, and what
    the first one would, where none is demanded (rectangular, GUM 4.3.7).

    """
    tables = [c for c in turning_tables(campaign) if c.has(*COLUMNS)]
    pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    rows = None if pairs is None or not tables else _rows_of(tables, pairs)
    if rows is None or rows.id_a.size < 2 * len(GIVES):
        return METHOD.nothing(GIVES, f"no table of voltages at steady speeds; {EXPERIMENT}")
    alpha, alpha_budget = magnet_coefficient(known)
    chosen = _chosen(rows, alpha, options["level"])
    found = _solved(rows, alpha, chosen)
    shorter, longer = _solved_without(rows, alpha, chosen), _solved_beside(rows, alpha, chosen)
    parts = _instruments(rows, alpha, chosen)
    slope = (_solved(rows, alpha + STEP_1_K, chosen).coefficients - found.coefficients) / STEP_1_K
    notes = ["settled points", allowed_for(chosen), unlogged_note(tables)]
    notes.append(unstated_note(tables, ("voltage", "current")))
    estimates = []
    for place, name in enumerate(GIVES):
        value, u = float(found.coefficients[place]), found.u(place)
        if not np.isfinite(u) or not _apart(rows, alpha, chosen, place):
            estimates.append(METHOD.missing(name, EXPERIMENT))
            continue
        form = 0.5 * max((abs(float(c[place]) - value) for c in shorter), default=0.0)
        moved = (math.hypot(float(f.coefficients[place]) - value, f.u(place)) for f in longer)
        unseen = max(moved, default=0.0) / math.sqrt(3.0)
        budget = [
            METHOD.scatter(name, u, found.dof),
            Contribution("assumed:saturation_form", math.hypot(form, unseen), "B"),
            *propagate([(float(slope[place]), alpha_budget)]),
            *parts[place],
        ]
        if name == "r_phase_ohm":
            budget.append(Contribution("assumed:inverter_drop", _switches_ohm(rows), "B"))
        at = {"temp_magnet_degc": 25.0} if name == "psi_pm_wb" else {"current_a": 0.0}
        at = {WARMTH: REFERENCE_DEGC} if name == "r_phase_ohm" else at
        estimates.append(METHOD.measured(name, value, budget, tables, at, notes))
    return Fit(tuple(estimates), _evidence(rows, found))


def _rows_of(tables: Sequence[Capture], pairs: int) -> _Rows:
    parts = [_table(capture) for capture in tables]
    joined = {name: np.concatenate([one[name] for one in parts]) for name in parts[0]}
    sizes = [one["id_a"].size for one in parts]
    omega_e = pairs * joined.pop("omega_mech_rad_s")
    return _Rows(tables, np.repeat(np.arange(len(parts)), sizes), omega_e, **joined)


def _table(capture: Capture) -> dict[str, Array]:
    """Rows of one table that hold currents, voltages and a speed, with temperatures over 25 °C."""
    warm = [name for name in (WARMTH, "temp_magnet_degc") if capture.has(name)]
    columns = capture.finite(*COLUMNS, *warm, needed=COLUMNS)
    size, ambient = columns["id_a"].size, assumed_temperature(capture, REFERENCE_DEGC)
    for name, key in ((WARMTH, "winding_k"), ("temp_magnet_degc", "magnet_k")):
        degc = columns.pop(name, np.full(size, ambient))
        usual = float(np.nanmean(degc)) if np.isfinite(degc).any() else ambient
        columns[key] = np.where(np.isfinite(degc), degc, usual) - REFERENCE_DEGC
    return columns


def _winding_source(capture: Capture) -> str:
    return temperature_source(capture.meta) if capture.has(WARMTH) else UNLOGGED


def _chosen(rows: _Rows, alpha: float, level: float) -> list[str]:
    base, candidates = steady_voltage(rows, alpha)
    pool = {name: column for name, column in candidates.items() if np.any(column)}
    apart = {name: column for name, column in pool.items() if _own(base, column)}
    sigma = np.ones(base.shape[0])
    return needed_columns(base, apart, rows.voltage_v, sigma, level)


def _own(others: Array, column: Array) -> bool:
    """Whether a column [n] is more than noise beside others [n, k]."""
    left = linear_fit(others, column).residuals
    return bool(np.linalg.norm(left) > policy().drag.least_own_share * np.linalg.norm(column))


def _apart(rows: _Rows, alpha: float, chosen: Sequence[str], place: int) -> bool:
    design = _design(rows, alpha, chosen)
    return _own(np.delete(design, place, axis=1), design[:, place])


def _design(rows: _Rows, alpha: float, chosen: Sequence[str]) -> Array:
    base, candidates = steady_voltage(rows, alpha)
    return np.column_stack([base, *(candidates[name] for name in chosen)])


def _solved(rows: _Rows, alpha: float, chosen: Sequence[str]) -> LinearFit:
    return linear_fit(_design(rows, alpha, chosen), rows.voltage_v)


def _solved_without(rows: _Rows, alpha: float, chosen: Sequence[str]) -> list[Array]:
    """The coefficients without each of the last two terms of saturation: the series may go on."""
    bent = [name for name in chosen if name in BENDING][-2:]
    shorter = ([name for name in chosen if name != omitted] for omitted in bent)
    return [_solved(rows, alpha, names).coefficients for names in shorter]


def _solved_beside(rows: _Rows, alpha: float, chosen: Sequence[str]) -> list[LinearFit]:
    """The fits with the first term of saturation of each axis that no test asks for: noise
    may hide it, and it is in the slope of a straight line all the same.
    """
    straight = [name for name in FIRST_BENDS if name not in chosen]
    ends = (_solved(rows, alpha, [*chosen, name]) for name in straight)
    return [end for end in ends if end.full_rank]


def _instruments(rows: _Rows, alpha: float, chosen: Sequence[str]) -> list[list[Contribution]]:
    """What meters, clock and thermometers do to each constant, by refitting with each shifted."""

    def constants(shift: Shift) -> Array:
        return _solved(rows.shifted(shift), alpha, chosen).coefficients[: len(GIVES)]

    sources = instrument_uncertainties(rows.captures, ("voltage", "current", "clock"))
    logged = [capture for capture in rows.captures if capture.has(WARMTH)]
    sources |= instrument_uncertainties(logged, ("temperature",))
    if len(logged) < len(rows.captures):
        sources[UNLOGGED] = policy().magnet.unlogged_k
    return contributions(constants, sources | magnet_uncertainties(rows.captures))


def _switches_ohm(rows: _Rows) -> float:
    """Standard uncertainty of R [ohm] for switches and leads behind a commanded voltage."""
    commanded = [c for c in rows.captures if c.meta.voltage_kind == "commanded"]
    if not commanded:
        return 0.0
    drop_v = policy().inverter.conduction_share * max(link_voltage_v(c) for c in commanded)
    return drop_v / float(np.hypot(rows.id_a, rows.iq_a).max())


def _evidence(rows: _Rows, found: LinearFit) -> tuple[Evidence, ...]:
    fitted = rows.voltage_v - found.residuals
    size = rows.id_a.size
    plots = []
    for axis, at in (("d", slice(0, size)), ("q", slice(size, 2 * size))):
        volts = rows.voltage_v[at]
        series = [
            over_x(c.path, rows.iq_a[own], volts[own], fitted[at][own])
            for n, c in enumerate(rows.captures)
            for own in [rows.table == n]
        ]
        title = f"Voltage of the {axis} axis at settled points"
        plots.append(METHOD.plot(title, ("iq_a", f"v{axis}_v"), "scatter", series))
    return tuple(plots)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("torque_table",),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", "temp_coeff_magnet_1_k"),
    aids=("pole_pairs", "temp_coeff_magnet_1_k"),
    rank=6,
    options={
        # False alarm of a term of saturation or of a nuisance, over all candidates.
        "level": 0.01,
    },
)
