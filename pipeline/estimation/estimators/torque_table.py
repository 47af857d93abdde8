"""Torque constant from a static table of torque and current: no clock, no voltage."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pipeline.estimation.electrical.magnet_temperature import (
    assumed_temperature,
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.electrical.operating_points import pole_pairs_of
from pipeline.estimation.mechanical.locked_rotor import HARMONICS, RIPPLES, SOURCE, ripple_share
from pipeline.estimation.mechanical.other_current import (
    not_along_q,
    reluctance_counts,
    unlogged_share,
)
from pipeline.estimation.method import Method, over_x
from pipeline.estimation.policy import policy
from pipeline.estimation.protocol import Estimator, Fit
from pipeline.estimation.thermal.magnet_coefficient import magnet_coefficient
from pipeline.estimation.uncertainty.instruments import (
    contributions,
    instrument_uncertainties,
    shifted_gains,
    shifted_offsets,
    unstated_note,
)
from pipeline.numerics.least_squares import LinearFit, linear_fit
from pipeline.numerics.selection import needed_columns
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.capture import Array, Campaign, Capture, Indices
from pipeline.records.constants import Constants
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution, propagate

METHOD = Method("torque_table")
GIVES = ("kt_peak_nm_a",)
EXPERIMENT = (
    "record a torque_table: torque against q current in both senses, four levels or more up to "
    "rated current, at several rotor angles"
)
LEAST_ROWS, LEAST_LEVELS = 5, 4
SAME = 0.01
STEP_1_K = 1e-5


def torque(
    iq_a: Array, id_a: Array, warm: Array, theta_elec_rad: Array | None = None
) -> tuple[Array, dict[str, Array]]:
    """What a clamped shaft's torque is linear in.

    T = T0 + Kt (1 + α (T_m - 25)) i_q + K_r i_d i_q - s i_q³ - c sign(i_q)
        + i_q Σ (a_n cos nε + b_n sin nε), n = 6, 12

    Parameters
    ----------
    iq_a, id_a : array [n], A
        Rotor-frame currents, amplitude-invariant.
    warm : array [n], 1
        1 + α (T_m - 25 °C) of the magnets.
    theta_elec_rad : array [n], rad, optional
        Electrical angle ε that each row was clamped at.

    Returns
    -------
    base : array [n, 2 or 3]
        Columns of T0, Kt, and K_r where there is an i_d.
    candidates : dict of array [n]
        Columns that enter where a test asks for them: saturation (i_q³, i_q⁵), friction that
        holds torque back from the transducer, and the torque ripple of the angles.

    References
    ----------
    IEEE Std 1812-2014 (tests of permanent magnet machines: torque of a blocked rotor).

    """
    base = [np.ones(iq_a.size), iq_a * warm]
    if reluctance_counts(id_a, iq_a):
        base.append(id_a * iq_a)
    candidates = {"iq^3": iq_a**3, "iq^5": iq_a**5, "sign iq": np.sign(iq_a)}
    if theta_elec_rad is not None:
        for order in RIPPLES:
            candidates[f"iq cos {order}"] = iq_a * np.cos(order * theta_elec_rad)
            candidates[f"iq sin {order}"] = iq_a * np.sin(order * theta_elec_rad)
    return np.column_stack(base), candidates


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Kt at small current: the slope of torque in q current, saturation taken out.

    Tables of one campaign are one fit with an offset each. Rows at one rotor angle carry the
    torque ripple of that angle (`locked_rotor`).
    """
    tables = [c for c in campaign.of(METHOD.name) if c.has("iq_a", "torque_shaft_nm")]
    captures = [c for c in tables if not c.turning]
    if not captures:
        return METHOD.nothing(GIVES, f"no table of current and torque; {EXPERIMENT}")
    rows = _Rows.of(captures)
    if rows.iq_a.size < LEAST_ROWS + len(captures) or rows.levels < LEAST_LEVELS:
        note = f"{rows.iq_a.size} rows of {rows.levels} currents; {EXPERIMENT}"
        return METHOD.nothing(GIVES, note)
    pairs = pole_pairs_of(known, campaign.nameplate("pole_pairs"))
    rows = rows.with_electrical_angle(pairs)
    alpha, alpha_budget = magnet_coefficient(known)
    base, candidates = rows.columns(alpha)
    chosen = needed_columns(
        base, candidates, rows.torque_nm, np.ones(rows.iq_a.size), options["level"]
    )
    solution = _solve(rows, alpha, chosen)
    kt = float(solution.coefficients[1])
    if not solution.full_rank or solution.dof < 1 or kt == 0.0:
        return METHOD.nothing(GIVES, EXPERIMENT)
    warmer = _solve(rows, alpha + STEP_1_K, chosen).coefficients[1]
    parts = [
        *_instruments(rows, captures, alpha, chosen),
        *propagate([((float(warmer) - kt) / STEP_1_K, alpha_budget)]),
        METHOD.scatter("kt", solution.u(1), solution.dof),
        Contribution(SOURCE, ripple_share(rows.theta_rad, pairs, known) * abs(kt), "B"),
    ]
    if not any(capture.has("id_a") for capture in captures):
        share = unlogged_share(solution.residuals, kt * rows.iq_a)
        if why := not_along_q(share):
            return METHOD.nothing(GIVES, why)
        if share > policy().torque_map.unlogged_d_share:
            parts.append(Contribution("assumed:id_a", share * abs(kt), "B"))
    sags = "; sags with current" if {"iq^3", "iq^5"} & set(chosen) else ""
    notes = [f"slope at small current{sags}", unstated_note(captures, ("current", "torque"))]
    notes.append(unlogged_note(captures))
    at = {"iq_a": float(np.max(np.abs(rows.iq_a)))}
    estimate = METHOD.measured(GIVES[0], kt, parts, captures, at, notes)
    return Fit((estimate,), _evidence(captures, rows, rows.torque_nm - solution.residuals))


@dataclass(frozen=True, slots=True)
class _Rows:
    """Rows [n] of all tables, one after the other; `table` is the number of each row's table.

    `theta_elec_rad` is None where angles or pole pairs are not known.
    """

    iq_a: Array
    id_a: Array
    torque_nm: Array
    excess_k: Array
    theta_rad: Array
    table: Indices
    theta_elec_rad: Array | None = None

    @classmethod
    def of(cls, captures: Sequence[Capture]) -> _Rows:
        """The rows that hold current and torque."""
        parts = [_table(capture) for capture in captures]
        joined = {name: np.concatenate([one[name] for one in parts]) for name in parts[0]}
        table = np.repeat(np.arange(len(parts)), [one["iq_a"].size for one in parts])
        return cls(**joined, table=table)

    @property
    def levels(self) -> int:
        """How many currents there are that differ by more than 1 % of their range."""
        reach = float(np.ptp(self.iq_a)) if self.iq_a.size else 0.0
        return np.unique(np.round(self.iq_a / (SAME * reach))).size if reach > 0.0 else 0

    def with_electrical_angle(self, pole_pairs: int | None) -> _Rows:
        """The rows with their electrical angle, where all angles and the pole pairs are known."""
        if pole_pairs is None or not np.all(np.isfinite(self.theta_rad)):
            return self
        return replace(self, theta_elec_rad=pole_pairs * self.theta_rad)

    def columns(self, alpha_1_k: float) -> tuple[Array, dict[str, Array]]:
        """`torque` of these rows, with an offset a further table."""
        warm = 1.0 + alpha_1_k * self.excess_k
        base, candidates = torque(self.iq_a, self.id_a, warm, self.theta_elec_rad)
        offsets = [(self.table == n).astype(float) for n in range(1, int(self.table[-1]) + 1)]
        return np.column_stack([base, *offsets]), candidates


def _table(capture: Capture) -> dict[str, Array]:
    names = ("iq_a", "torque_shaft_nm", "id_a", "temp_magnet_degc", "theta_mech_rad")
    columns = capture.finite(*(name for name in names if capture.has(name)), needed=names[:2])
    warm = assumed_temperature(capture, REFERENCE_DEGC)
    usual = {"id_a": 0.0, "temp_magnet_degc": warm, "theta_mech_rad": np.nan}
    columns = {n: np.full(columns["iq_a"].size, value) for n, value in usual.items()} | columns
    return {
        "iq_a": columns["iq_a"],
        "id_a": np.nan_to_num(columns["id_a"]),
        "torque_nm": columns["torque_shaft_nm"],
        "excess_k": np.nan_to_num(columns["temp_magnet_degc"] - REFERENCE_DEGC),
        "theta_rad": columns["theta_mech_rad"],
    }


def _solve(rows: _Rows, alpha_1_k: float, chosen: Sequence[str]) -> LinearFit:
    base, candidates = rows.columns(alpha_1_k)
    design = np.column_stack([base, *(candidates[name] for name in chosen)])
    return linear_fit(design, rows.torque_nm)


def _instruments(
    rows: _Rows, captures: Sequence[Capture], alpha_1_k: float, chosen: Sequence[str]
) -> list[Contribution]:
    """What clamp, transducer and thermometer do to Kt, by refitting with each shifted."""

    def kt(shift: Mapping[str, float]) -> Array:
        amps, force = shifted_gains(shift, captures, rows.table, "current", "torque")
        warmer = shifted_offsets(shift, map(magnet_source, captures), rows.table)
        moved = replace(
            rows,
            iq_a=amps * rows.iq_a,
            id_a=amps * rows.id_a,
            torque_nm=force * rows.torque_nm,
            excess_k=rows.excess_k + warmer,
        )
        return _solve(moved, alpha_1_k, chosen).coefficients[1:2]

    gains = instrument_uncertainties(captures, ("current", "torque"))
    return contributions(kt, gains | magnet_uncertainties(captures))[0]


def _evidence(captures: Sequence[Capture], rows: _Rows, fitted_nm: Array) -> tuple[Evidence, ...]:
    series = []
    for number, capture in enumerate(captures):
        at = np.flatnonzero(rows.table == number)
        series.append(over_x(capture.path, rows.iq_a[at], rows.torque_nm[at], fitted_nm[at]))
    title = "Torque of the clamped shaft against q current"
    return (METHOD.plot(title, ("iq_a", "torque_shaft_nm"), "scatter", series),)


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=(METHOD.name,),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("pole_pairs", "temp_coeff_magnet_1_k", *HARMONICS),
    aids=("pole_pairs", "temp_coeff_magnet_1_k", *HARMONICS),
    rank=6,
    options={
        # False alarm of a term of saturation or friction, over all candidates.
        "level": 0.01,
    },
)
