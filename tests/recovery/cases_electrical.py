"""Resistance, inductance, flux and temperature coefficients, with their Cramér-Rao bounds.

The bounds are written from the simulator's noise model and closed-form responses, not with the
estimators' own code.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl

from pipeline.estimation.estimators import (
    hand_turn,
    heat_run,
    lcr,
    open_circuit,
    resistance,
    soak,
    thermal,
)
from pipeline.records.constants import Constants
from pipeline.simulator.bench import truth
from pipeline.simulator.protocols import HandTurn, Lcr, Resistance
from tests.recovery.harness import Case, Trial, cramer_rao
from tests.recovery.simulated import BENCH, MOTOR, Plan, recorded

SIGMA_I = BENCH.current_noise_rel * MOTOR.current_rated_a
SIGMA_V = BENCH.voltage_noise_rel * MOTOR.vdc_v
WARM_DEGC = 62.0
RESISTANCE: Plan = (
    ("resistance_ab", "resistance", {"pair": "ab"}),
    ("resistance_bc", "resistance", {"pair": "bc"}),
    ("resistance_ca", "resistance", {"pair": "ca"}),
    ("resistance_ab_warm", "resistance", {"pair": "ab", "temp_degc": WARM_DEGC}),
)
LCR: Plan = (("lcr", "lcr", {}),)
SPEEDS = (0.3, 0.6, 0.9)
SPIN_WARM_DEGC = 58.0
SPINS: Plan = (
    ("open_circuit_0", "open_circuit", {"levels": SPEEDS, "dwell_s": 0.1}),
    (
        "open_circuit_1",
        "open_circuit",
        {"levels": (-0.3, -0.8), "dwell_s": 0.1, "temp_magnet_degc": SPIN_WARM_DEGC},
    ),
)
HAND: Plan = (("hand_turn", "hand_turn", {"with_angle": False}),)
HEAT: Plan = (("heat_run", "heat_run", {}),)
LONG_HEAT: Plan = (("heat_run", "heat_run", {"duration_tau": 6.0}),)


@cache
def true_constants() -> Mapping[str, float]:
    """What is true of the motor that all cases simulate."""
    return truth(MOTOR)["constants"]


def _resistance_trial(seed: int) -> Trial:
    campaign, real = recorded(RESISTANCE, seed)
    true = true_constants()
    gain = real.voltage / real.current
    factor = gain * (1.0 - true["temp_coeff_copper_1_k"] * real.temperature_degc)
    names = ("r_phase_ohm", "r_ll_ohm")
    return Trial(campaign, {n: true[n] for n in names}, {n: true[n] * factor for n in names})


def _resistance_covariance(u_alpha_rel: float) -> np.ndarray:
    """Covariance of R_ab, R_bc, R_ca, alpha: plateaus with an offset each capture and one V0.

    Current noise counts as R times itself in the voltage; all samples of a plateau are one mean.
    """
    how = Resistance()
    r_ll, alpha = 2.0 * MOTOR.r_phase_ohm, MOTOR.temp_coeff_copper_1_k
    levels = np.array([x for x in how.levels if x != 0.0]) * MOTOR.current_rated_a
    sigma = math.hypot(SIGMA_V, r_ll * SIGMA_I) / math.sqrt(how.dwell_s * how.rate_hz)

    def mean(p: np.ndarray) -> np.ndarray:
        captures = ((0, 0.0), (1, 0.0), (2, 0.0), (0, WARM_DEGC - 25.0))
        return np.concatenate(
            [
                p[pair] * (1.0 + p[3] * excess) * levels + p[4] * np.sign(levels) + p[5 + k]
                for k, (pair, excess) in enumerate(captures)
            ]
        )

    at = np.array([r_ll, r_ll, r_ll, alpha, 0.0, 0.0, 0.0, 0.0, 0.0])
    prior = np.full(at.size, np.inf)
    prior[3] = u_alpha_rel * alpha
    return cramer_rao(mean, at, sigma, prior)


@cache
def _resistance_bound() -> Mapping[str, float]:
    covariance = _resistance_covariance(resistance.ESTIMATOR.options["u_rel_copper"])
    u_ll = math.sqrt(covariance[:3, :3].sum()) / 3.0
    return {"r_phase_ohm": u_ll / 2.0, "r_ll_ohm": u_ll}


def _soak_trial(seed: int) -> Trial:
    campaign, real = recorded(RESISTANCE, seed)
    name = "temp_coeff_copper_1_k"
    alpha = true_constants()[name]
    seen = alpha / (1.0 - alpha * real.temperature_degc)
    return Trial(campaign, {name: alpha}, {name: seen})


@cache
def _soak_bound() -> Mapping[str, float]:
    return {"temp_coeff_copper_1_k": math.sqrt(_resistance_covariance(math.inf)[3, 3])}


def _lcr_trial(seed: int) -> Trial:
    campaign, real = recorded(LCR, seed)
    true = true_constants()
    names = ("ld_h", "lq_h")
    return Trial(campaign, {n: true[n] for n in names}, {n: true[n] * real.lcr for n in names})


@cache
def _lcr_bound() -> Mapping[str, float]:
    """Both inductances of readings whose noise is a share of each reading."""
    angles = np.arange(Lcr().angles) * 2.0 * math.pi / Lcr().angles
    swing = np.cos(2.0 * angles + math.pi / 3.0)

    def mean(p: np.ndarray) -> np.ndarray:
        return p[0] * (1.0 + swing) + p[1] * (1.0 - swing)

    at = np.array([MOTOR.ld_h, MOTOR.lq_h])
    covariance = cramer_rao(mean, at, BENCH.lcr_noise_rel * mean(at))
    return dict(zip(("ld_h", "lq_h"), np.sqrt(np.diag(covariance)).tolist(), strict=True))


def _spin_trial(seed: int) -> Trial:
    campaign, real = recorded(SPINS, seed)
    true = true_constants()
    alpha = true["temp_coeff_magnet_1_k"]
    factor = 1.0 - alpha * real.temperature_degc
    psi = true["psi_pm_wb"]
    truths = {"psi_pm_wb": psi, "temp_coeff_magnet_1_k": alpha}
    seen = {"psi_pm_wb": psi * real.voltage * factor, "temp_coeff_magnet_1_k": alpha / factor}
    ke = true["ke_ll_rms_v_s_rad"]
    truths |= {"ke_ll_rms_v_s_rad": ke, "pole_pairs": float(true["pole_pairs"])}
    seen |= {"ke_ll_rms_v_s_rad": ke * real.voltage * factor, "pole_pairs": truths["pole_pairs"]}
    return Trial(campaign, truths, seen)


@cache
def _spin_bound() -> Mapping[str, float]:
    """Three line voltages: the amplitude's information is 9/2 omega_e² / sigma² a sample.

    Phase, speed and offsets are orthogonal to the amplitude over whole cycles.
    """
    fastest = MOTOR.pole_pairs * MOTOR.speed_rated_rad_s
    levels = ((SPEEDS, 25.0), ((0.3, 0.8), SPIN_WARM_DEGC))
    information = np.zeros((2, 2))
    for speeds, degc in levels:
        rate = _nice(40.0 * fastest * max(speeds) / (2.0 * math.pi))
        slope = np.array([1.0 + MOTOR.temp_coeff_magnet_1_k * (degc - 25.0), degc - 25.0])
        slope[1] *= MOTOR.psi_pm_wb
        each = sum(4.5 * (share * fastest) ** 2 for share in speeds) * 0.1 * rate / SIGMA_V**2
        information += np.outer(slope, slope) * each
    u_psi, u_alpha = np.sqrt(np.diag(np.linalg.inv(information))).tolist()
    k = MOTOR.pole_pairs * math.sqrt(1.5)
    return {
        "psi_pm_wb": u_psi,
        "temp_coeff_magnet_1_k": u_alpha,
        "ke_ll_rms_v_s_rad": k * u_psi,
    }


def _nice(wanted_hz: float) -> float:
    """The next of 1, 2, 5, 10 times a power of ten."""
    decade = 10.0 ** math.floor(math.log10(wanted_hz))
    return next(x * decade for x in (1.0, 2.0, 5.0, 10.0) if x * decade >= wanted_hz * (1 - 1e-9))


def _hand_trial(seed: int) -> Trial:
    """A thermometer at the magnets, off as the station's are: an assumed one is not drawn."""
    plain, real = recorded(HAND, seed)
    shown_degc = 25.0 + real.temperature_degc
    captures = (
        replace(
            c, tables=tuple(t.with_columns(temp_magnet_degc=pl.lit(shown_degc)) for t in c.tables)
        )
        for c in plain.captures
    )
    true = true_constants()
    psi, pairs = true["psi_pm_wb"], float(true["pole_pairs"])
    assumed = hand_turn.ESTIMATOR.options["alpha_assumed_1_k"]
    seen = psi * real.voltage / (1.0 + assumed * real.temperature_degc)
    return Trial(
        replace(plain, captures=tuple(captures)),
        {"psi_pm_wb": psi, "pole_pairs": pairs},
        {"psi_pm_wb": seen, "pole_pairs": pairs},
    )


@cache
def _hand_bound() -> Mapping[str, float]:
    """Mean over the hands that the simulator draws, of 9/2 (p omega)² / sigma² summed."""
    how = HandTurn()
    u = np.arange(round(how.duration_s * how.rate_hz)) / (how.duration_s * how.rate_hz)
    omega = 2.0 * math.pi * 30.0 * u**2 * (1.0 - u) ** 2 / how.duration_s
    information = 4.5 * float(np.sum((MOTOR.pole_pairs * omega) ** 2)) / SIGMA_V**2
    return {"psi_pm_wb": 1.0 / math.sqrt(information)}


def _heat_trial(seed: int) -> Trial:
    """R25 from the resistance test of the same station, as in a campaign."""
    campaign, real = recorded((*HEAT, *RESISTANCE), seed)
    known = Constants(
        resistance.ESTIMATOR.fit(campaign, Constants(), resistance.ESTIMATOR.options).estimates
    )
    name = "temp_coeff_copper_1_k"
    alpha = true_constants()[name]
    seen = alpha * real.voltage_commanded / real.voltage
    seen /= 1.0 - alpha * real.temperature_degc
    return Trial(campaign, {name: alpha}, {name: seen}, known)


@cache
def _heat_bound() -> Mapping[str, float]:
    """Slope of R over the rise, with the noise of i and of the thermometer, and that of R25."""
    table = recorded(HEAT, 0)[0].captures[0].tables[0]
    temp = table["temp_winding_degc"].to_numpy()
    r_ohm, alpha = MOTOR.r_phase_ohm, MOTOR.temp_coeff_copper_1_k
    current = float(np.median(table["id_a"].to_numpy()))
    noise = r_ohm * SIGMA_I * math.sqrt(2.0 / 3.0) / current
    noise = math.hypot(noise, r_ohm * alpha * BENCH.temperature_noise_degc)
    u_slope = noise / (float(temp.std()) * math.sqrt(temp.size))
    u_r25 = _resistance_bound()["r_phase_ohm"]
    return {"temp_coeff_copper_1_k": math.hypot(u_slope / r_ohm, alpha * u_r25 / r_ohm)}


def _thermal_trial(seed: int) -> Trial:
    campaign, real = recorded((*LONG_HEAT, *RESISTANCE), seed)
    known = Constants(
        resistance.ESTIMATOR.fit(campaign, Constants(), resistance.ESTIMATOR.options).estimates
    )
    rth = true_constants()["rth_winding_k_w"]
    # A thermometer's offset reads R25 low by as much as it reads R(T) high of it.
    gain = real.voltage * real.current
    return Trial(campaign, {"rth_winding_k_w": rth}, {"rth_winding_k_w": rth / gain}, known)


@cache
def _thermal_bound() -> Mapping[str, float]:
    """The network's five constants and two first temperatures from two noisy thermometers."""
    table = recorded(LONG_HEAT, 0)[0].captures[0].tables[0]
    t = table["t_s"].to_numpy()
    current = float(np.median(table["id_a"].to_numpy()))

    def mean(p: np.ndarray) -> np.ndarray:
        r_wa, r_wm, r_ma, c_w, c_m, t_w, t_m = p
        matrix = np.array(
            [
                [-(1.0 / r_wa + 1.0 / r_wm) / c_w, 1.0 / (r_wm * c_w)],
                [1.0 / (r_wm * c_m), -(1.0 / r_wm + 1.0 / r_ma) / c_m],
            ]
        )
        base = 1.5 * MOTOR.r_phase_ohm * current**2
        matrix[0, 0] += base * MOTOR.temp_coeff_copper_1_k / c_w
        drive = np.array([base / c_w, 0.0])
        steady = -np.linalg.solve(matrix, drive)
        values, vectors = np.linalg.eig(matrix)
        weights = np.linalg.solve(vectors, np.array([t_w, t_m]) - steady)
        course = steady[:, None] + vectors @ (weights[:, None] * np.exp(np.outer(values, t)))
        return course.ravel()

    at = np.array(
        [
            MOTOR.rth_wa_k_w,
            MOTOR.rth_wm_k_w,
            MOTOR.rth_ma_k_w,
            MOTOR.cth_winding_j_k,
            MOTOR.cth_magnet_j_k,
            0.0,
            0.0,
        ]
    )
    covariance = cramer_rao(mean, at, BENCH.temperature_noise_degc)
    through = MOTOR.rth_wm_k_w + MOTOR.rth_ma_k_w
    total = MOTOR.rth_wa_k_w + through
    slope = np.zeros(at.size)
    slope[0] = (through / total) ** 2
    slope[1] = slope[2] = (MOTOR.rth_wa_k_w / total) ** 2
    return {"rth_winding_k_w": math.sqrt(float(slope @ covariance @ slope))}


CASES = (
    Case("resistance", resistance.ESTIMATOR, _resistance_trial, _resistance_bound),
    Case("soak", soak.ESTIMATOR, _soak_trial, _soak_bound),
    Case("lcr", lcr.ESTIMATOR, _lcr_trial, _lcr_bound),
    Case("open_circuit", open_circuit.ESTIMATOR, _spin_trial, _spin_bound),
    Case("hand_turn", hand_turn.ESTIMATOR, _hand_trial, _hand_bound),
    # The simulated thermometer has no lag, so that there is nothing to allow for.
    Case("heat_run", heat_run.ESTIMATOR, _heat_trial, _heat_bound, {"u_lag_s": 0.0}),
    Case("thermal", thermal.ESTIMATOR, _thermal_trial, _thermal_bound),
)
