"""Torque constant of a loaded drive with a transducer, without a torque map."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from pipeline.estimation.electrical.magnet_temperature import (
    magnet_source,
    magnet_uncertainties,
    unlogged_note,
)
from pipeline.estimation.mechanical.shaft_nuisances import LOAD_BETWEEN
from pipeline.estimation.mechanical.shaft_regimes import shaft_partitions
from pipeline.estimation.mechanical.shaft_rows import (
    ACCELERATION_NOISE,
    CURRENT_NOISE,
    DRIVE,
    ShaftRows,
    shaft_rows,
)
from pipeline.estimation.method import Method
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
from pipeline.estimation.uncertainty.nuisances import allowed_for
from pipeline.estimation.uncertainty.regimes import Disagreement, Regression, disagreement, scatter
from pipeline.numerics.least_squares import LinearFit, autocorrelation_time, linear_fit
from pipeline.numerics.selection import needed_columns
from pipeline.records.capture import Array, Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.evidence import Evidence
from pipeline.records.uncertainty import Contribution, propagate

METHOD = Method("drive_torque")
GIVES = ("kt_peak_nm_a",)
EXPERIMENT = (
    "record a drive with iq_a, theta_mech_rad and torque_shaft_nm in which the load changes by "
    "steps at several speeds of both senses"
)
NUISANCES = (
    "offset", "d q current", "q current cubed", "load lag", LOAD_BETWEEN, "current lag",
    "load friction", "windage",
)  # fmt: skip
STEP_1_K = 1e-5


def torque(rows: ShaftRows, alpha_1_k: float) -> Array:
    """The derivatives of the transducer's torque by what is fitted: it is linear in all four.

    Parameters
    ----------
    rows
        Window means [w] of current, speed and its sign, and acceleration.
    alpha_1_k
        Coefficient of the magnet's flux at 25 °C.

    Returns
    -------
    array [w, 4]
        Columns of Kt [A], T_c [1], B [rad/s] and J [rad/s²].

    Notes
    -----
    T = Kt (1 + α (T_m - 25)) i_q - T_c sign(ω) - B ω - J dω/dt. A window's second derivative stands
    for that of the angle (weak form), so none is taken of the data.

    References
    ----------
    Messenger and Bortz, Multiscale Model. Simul. 19(3), 2021, 1474, doi:10.1137/20M1343166.

    """
    driving = rows.q_current_a + alpha_1_k * rows.warm_current_k_a
    return np.column_stack([driving, -rows.sense, -rows.speed_rad_s, -rows.acceleration_rad_s2])


def fit(campaign: Campaign, known: Constants, options: Mapping[str, float]) -> Fit:
    """Kt by `torque` over the windows of all drives with a transducer.

    Not where a torque map or table gives it: at settled points nothing has to be known of the
    motion. J and friction are for `inertia` to give, with coasts beside. Current and acceleration
    are columns with noise of their own, which makes coefficients too small; how much is in u, and
    where it is a twentieth or more, as without a load that changes, nothing is determined.
    """
    better = [c for c in campaign.of("torque_map", "torque_table") if _usable(c)]
    if better:
        return METHOD.nothing(GIVES, f"{better[0].meta.test} gives it with fewer assumptions")
    drives = [c for c in campaign.of("drive") if _usable(c)]
    rows = shaft_rows(drives, {"windage": lambda x: x * np.abs(x)}) if drives else None
    if rows is None or rows.disjoint(DRIVE) < policy().drag.least_freedom + 4:
        return METHOD.nothing(GIVES, f"no drive with a torque transducer; {EXPERIMENT}")
    alpha, alpha_budget = magnet_coefficient(known)
    pool = {name: rows.columns[name] for name in NUISANCES}
    pool = {name: column for name, column in pool.items() if np.ptp(column) > 0.0}
    pool |= {"offset": np.ones(rows.count)}
    base, sigma = torque(rows, alpha), np.ones(rows.count)
    chosen = _nuisances(rows, base, pool, options["level"])
    design = np.column_stack([base, *(pool[name] for name in chosen)])
    solution = linear_fit(design, rows.load_nm)
    if not solution.full_rank:
        return METHOD.nothing(GIVES, f"the load goes with speed and acceleration; {EXPERIMENT}")
    bias = attenuation(rows, solution, design)
    regression = Regression(design, rows.load_nm, sigma, rows.cluster)
    deviation, dof = scatter(regression, solution, policy().shaft_rows.overlap)
    if reason := _strange(solution.coefficients, deviation, bias):
        return METHOD.nothing(GIVES, f"{reason}; {EXPERIMENT}")
    kt = float(solution.coefficients[0])
    warmer = _refit(rows, alpha + STEP_1_K, chosen, pool, {})
    parts = [
        METHOD.scatter("kt", float(deviation[0]), float(dof[0])),
        Contribution("assumed:noise_of_columns", bias, "B"),
        *propagate([((float(warmer) - kt) / STEP_1_K, alpha_budget)]),
        *_instruments(rows, alpha, chosen, pool),
    ]
    doubt = disagreement(regression, 0, partial(shaft_partitions, rows), options["level"])
    if doubt is not None:
        parts.append(doubt.part(f"{METHOD.name}:kt", kt))
    notes = _notes(rows, chosen, doubt)
    at = {"iq_a": float(np.max(np.abs(rows.q_current_a))), "temp_magnet_degc": 25.0}
    estimate: Estimate = METHOD.measured(GIVES[0], kt, parts, rows.captures, at, notes)
    return Fit((estimate,), _plots(rows, solution))


def _notes(rows: ShaftRows, chosen: Sequence[str], doubt: Disagreement | None) -> list[str]:
    words = [
        allowed_for(chosen),
        doubt.words("the torque constant") if doubt is not None else "",
        f"{rows.count} windows",
        unlogged_note(rows.captures),
        unstated_note(rows.captures, ("current", "torque")),
    ]
    return [one for one in words if one]


def _nuisances(rows: ShaftRows, base: Array, pool: Mapping[str, Array], level: float) -> list[str]:
    """Columns of the pool that the load needs beside those of `base` [w, k]."""
    residuals = linear_fit(np.column_stack([base, *pool.values()]), rows.load_nm).residuals
    tau = autocorrelation_time(residuals, policy().evidence.memory_rows)
    most, sigma = policy().drag.most_nuisances, np.ones(rows.count)
    return needed_columns(base, pool, rows.load_nm, sigma, level, most, tau)


def _usable(capture: Capture) -> bool:
    return capture.has("iq_a", "torque_shaft_nm")


def attenuation(rows: ShaftRows, solution: LinearFit, design: Array) -> float:
    """What the noise of current and acceleration takes of the torque constant.

    Parameters
    ----------
    rows
        With the noise of their windows.
    solution
        The fit.
    design
        Its columns [w, k], those of `torque` first.

    Returns
    -------
    float
        [N·m/A], above zero.

    Notes
    -----
    (X'X)⁻¹ n Σ β, Σ the variance of the columns' noise: the bias of least squares to first order.

    References
    ----------
    Fuller, Measurement Error Models, 1987, 1.1 and 2.2.

    """
    noise = np.zeros(design.shape[1])
    noise[0] = float(np.sum(rows.columns[CURRENT_NOISE] ** 2))
    noise[3] = float(np.sum(rows.columns[ACCELERATION_NOISE] ** 2))
    size = np.linalg.norm(design, axis=0)
    gram = (design / size).T @ (design / size)
    moved = np.linalg.solve(gram, noise * solution.coefficients / size) / size
    return float(np.abs(moved[0]))


def _strange(coefficients: Array, deviation: Array, bias_nm_a: float) -> str:
    """Why Kt is not determined; empty where it is."""
    kt, *drags = coefficients[:4].tolist()
    least = policy().evidence.sigmas
    if bias_nm_a > policy().shaft_rows.attenuated_share * abs(kt) or abs(kt) < least * deviation[0]:
        return "the load hardly changes beside what speed and acceleration take"
    if kt < 0.0:
        return "torque and current are of opposite sign: look at the signs of the columns"
    if not any(one > least * u for one, u in zip(drags, deviation[1:4].tolist(), strict=True)):
        return (
            "torque follows the current alone, without friction or inertia, as one that a drive "
            "computes from its current: that is no measurement of it"
        )
    return ""


def _refit(
    rows: ShaftRows,
    alpha_1_k: float,
    chosen: list[str],
    pool: Mapping[str, Array],
    shift: Mapping[str, float],
) -> float:
    """Kt with instruments off by `shift`."""
    amps, force = shifted_gains(shift, rows.captures, rows.capture, "current", "torque")
    warmer = shifted_offsets(shift, map(magnet_source, rows.captures), rows.capture)
    base = torque(rows, alpha_1_k)
    base[:, 0] = amps * (base[:, 0] + alpha_1_k * rows.q_current_a * warmer)
    design = np.column_stack([base, *(pool[name] for name in chosen)])
    return float(linear_fit(design, force * rows.load_nm).coefficients[0])


def _instruments(
    rows: ShaftRows, alpha_1_k: float, chosen: list[str], pool: Mapping[str, Array]
) -> list[Contribution]:
    """What transducer, current sensors and thermometer do to Kt, by refitting."""

    def kt(shift: Mapping[str, float]) -> Array:
        return np.array([_refit(rows, alpha_1_k, chosen, pool, shift)])

    gains = instrument_uncertainties(rows.captures, ("current", "torque"))
    return contributions(kt, gains | magnet_uncertainties(rows.captures))[0]


def _plots(rows: ShaftRows, solution: LinearFit) -> tuple[Evidence, ...]:
    title = "Torque by current and motion"
    fitted = rows.load_nm - solution.residuals
    columns = rows.capture, rows.time_s, rows.load_nm, fitted
    return tuple(METHOD.traces(rows.captures, title, "torque_shaft_nm", columns, "window means"))


ESTIMATOR = Estimator(
    name=METHOD.name,
    gives=GIVES,
    tests=("drive",),
    experiment=EXPERIMENT,
    fit=fit,
    uses=("temp_coeff_magnet_1_k",),
    aids=("temp_coeff_magnet_1_k",),
    rank=8,
    clock_powers={},
    options={
        # False alarm of a nuisance or of a regime, over all that are tried.
        "level": 0.001,
    },
)
