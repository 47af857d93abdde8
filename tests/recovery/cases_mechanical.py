"""Torque, cogging, friction and inertia, with their Cramér-Rao bounds.

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
    cogging,
    drive_voltage,
    inductance_rated,
    inertia,
    spin_down,
    torque_map,
)
from pipeline.estimation.policy import DEFAULT
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import Contribution
from pipeline.simulator.bench import truth
from pipeline.simulator.design import Instruments
from pipeline.simulator.protocols import SpinDown, TorqueMap
from tests.recovery.harness import Case, Trial, cramer_rao
from tests.recovery.simulated import BENCH, MOTOR, Plan, recorded

SIGMA_I = BENCH.current_noise_rel * MOTOR.current_rated_a
SIGMA_T = BENCH.torque_noise_rel * MOTOR.torque_rated_nm
KT = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb
RELUCTANCE = 1.5 * MOTOR.pole_pairs * (MOTOR.ld_h - MOTOR.lq_h)
ALPHA = MOTOR.temp_coeff_magnet_1_k
SPEEDS = (0.3, -0.3, 0.6)
DWELL_S = 0.06
MAP: Plan = tuple(
    (f"torque_map_{k}", "torque_map", {"speed": speed, "dwell_s": DWELL_S})
    for k, speed in enumerate(SPEEDS)
)
HELD_MAP: Plan = tuple((stem, test, {**how, "voltage_timing": "held"}) for stem, test, how in MAP)
COGGING_MOTOR = MOTOR.having(cogging={"size": 4e-3})
TURNS: Plan = (
    ("cogging_cw", "cogging", {"direction": 1, "turns": 2.1}),
    ("cogging_ccw", "cogging", {"direction": -1, "turns": 2.1}),
)
NOISY_ENCODER = replace(BENCH, encoder_noise_rad=1e-3)
COASTS: Plan = (
    ("spin_down_0", "spin_down", {"direction": 1}),
    ("spin_down_1", "spin_down", {"direction": -1, "level": 0.8}),
)
DRIVES: Plan = (*COASTS, ("drive_0", "drive", {}))


def _warmed(real: Instruments) -> float:
    """What a thermometer's offset makes of a constant that is brought to 25 degC."""
    return 1.0 / (1.0 + ALPHA * real.temperature_degc)


def _map_trial(seed: int) -> Trial:
    campaign, real = recorded(MAP, seed)
    ratio = real.torque / real.current
    true = {"kt_peak_nm_a": KT, "kt_reluctance_nm_a2": RELUCTANCE}
    seen = {
        "kt_peak_nm_a": KT * ratio * _warmed(real),
        "kt_reluctance_nm_a2": RELUCTANCE * ratio / real.current,
    }
    return Trial(campaign, true, seen)


@cache
def _map_bound() -> Mapping[str, float]:
    """Plateaus at three speeds, an offset each; current noise counts as Kt times itself.

    Noise of a dq current from three phase sensors is sqrt(2/3) of one's.
    """
    how = TorqueMap()
    i_d, i_q = (
        axis.ravel() * MOTOR.current_rated_a
        for axis in np.meshgrid(how.id_levels, how.iq_levels, indexing="ij")
    )
    sigma = math.hypot(SIGMA_T, KT * SIGMA_I * math.sqrt(2.0 / 3.0))
    sigma /= math.sqrt(DWELL_S * BENCH.pwm_hz)

    def mean(p: np.ndarray) -> np.ndarray:
        torque = p[0] * i_q + p[1] * i_d * i_q
        return np.concatenate([torque + offset for offset in p[2:]])

    covariance = cramer_rao(mean, np.array([KT, RELUCTANCE, 0.0, 0.0, 0.0]), sigma)
    u = np.sqrt(np.diag(covariance))
    return {"kt_peak_nm_a": float(u[0]), "kt_reluctance_nm_a2": float(u[1])}


def _inductance_trial(seed: int) -> Trial:
    campaign, real = recorded(HELD_MAP, seed)
    gain = real.voltage_commanded / real.current
    true = {"ld_rated_h": MOTOR.ld_h, "lq_rated_h": MOTOR.lq_h}
    resistance = Estimate("r_phase_ohm", MOTOR.r_phase_ohm, "ohm", "measured", "given")
    seen = {name: value * gain for name, value in true.items()}
    return Trial(campaign, true, seen, Constants((resistance,)))


def _coast_ratio() -> Constants:
    """The coast-down's ratio as known, so that creep friction loses its viscous part."""
    coulomb = MOTOR.torque_coulomb_nm / MOTOR.j_rotor_kgm2
    viscous = MOTOR.b_visc_nm_s_rad / MOTOR.j_rotor_kgm2
    return Constants(
        (
            Estimate("coast_coulomb_rad_s2", coulomb, "rad/s²", "measured", "given"),
            Estimate("coast_viscous_1_s", viscous, "1/s", "measured", "given"),
        )
    )


def _cogging_trial(seed: int) -> Trial:
    campaign, real = recorded(TURNS, seed, COGGING_MOTOR)
    stated = truth(COGGING_MOTOR)["constants"]
    names = ("cogging_amplitude_nm", "torque_coulomb_nm")
    true = {name: float(stated[name]) for name in names}
    seen = {name: value * real.torque for name, value in true.items()}
    return Trial(campaign, true, seen, _coast_ratio())


@cache
def _cogging_bound() -> Mapping[str, float]:
    """Four whole turns in white noise: sqrt(2/n) an amplitude, sqrt(1/n) half a difference."""
    campaign, _ = recorded(TURNS, 0, COGGING_MOTOR)
    n = sum(c.tables[0].height for c in campaign.captures) * 2.0 / 2.1
    return {
        "cogging_amplitude_nm": SIGMA_T * math.sqrt(2.0 / n),
        "torque_coulomb_nm": SIGMA_T / math.sqrt(n),
    }


def _coast_true() -> dict[str, float]:
    return {
        "coast_coulomb_rad_s2": MOTOR.torque_coulomb_nm / MOTOR.j_rotor_kgm2,
        "coast_viscous_1_s": MOTOR.b_visc_nm_s_rad / MOTOR.j_rotor_kgm2,
    }


def _coast_trial(seed: int) -> Trial:
    campaign, _ = recorded(COASTS, seed, MOTOR, NOISY_ENCODER)
    true = _coast_true()
    return Trial(campaign, true, true)


@cache
def _coast_bound() -> Mapping[str, float]:
    """Two coasts in white noise of the angle: shared ratios, start angle and speed of each.

    theta = theta_0 + ((w_0 + r)(1 - e^(-bt)) - r b t) / b with b = B/J, r = T_c/B.
    """
    campaign, _ = recorded(COASTS, 0, MOTOR, NOISY_ENCODER)
    clocks = [c.tables[0]["t_s"].to_numpy() for c in campaign.of("spin_down")]
    lsb = 2.0 * math.pi / 2.0**BENCH.encoder_bits
    sigma = math.hypot(NOISY_ENCODER.encoder_noise_rad, lsb / math.sqrt(12.0))

    def mean(p: np.ndarray) -> np.ndarray:
        a, b = p[:2]
        parts = []
        for k, t in enumerate(clocks):
            start, speed = p[2 + 2 * k : 4 + 2 * k]
            decay = -np.expm1(-b * t)
            parts.append(start + (speed + a / b) * decay / b - a / b * t)
        return np.concatenate(parts)

    top = MOTOR.speed_rated_rad_s
    starts = [1.0, SpinDown().level * top, 1.0, 0.8 * top]
    u = np.sqrt(np.diag(cramer_rao(mean, np.array([*_coast_true().values(), *starts]), sigma)))
    return dict(zip(_coast_true(), (float(x) for x in u[:2]), strict=True))


def _known_kt(real: Instruments) -> Constants:
    """Kt as the torque map of that station would have found it, gains and all."""
    value = KT * real.torque / real.current * _warmed(real)
    budget = (
        Contribution(f"current@{BENCH.station}", -BENCH.u_rel_current * value, "B"),
        Contribution(f"temperature@{BENCH.station}", -ALPHA * BENCH.u_temp_degc * value, "B"),
        Contribution(f"torque@{BENCH.station}", BENCH.u_rel_torque * value, "B"),
    )
    reluctance = RELUCTANCE * real.torque / real.current**2
    return Constants(
        (
            Estimate("kt_peak_nm_a", value, "N·m/A", "measured", "torque_map", budget),
            Estimate("kt_reluctance_nm_a2", reluctance, "N·m/A²", "measured", "torque_map"),
        )
    )


def _drive_trial(seed: int) -> Trial:
    campaign, real = recorded(DRIVES, seed)
    true = {
        "j_rotor_kgm2": MOTOR.j_rotor_kgm2,
        "torque_coulomb_nm": MOTOR.torque_coulomb_nm,
        "b_visc_nm_s_rad": MOTOR.b_visc_nm_s_rad,
    }
    seen = {name: value * real.torque for name, value in true.items()}
    return Trial(campaign, true, seen, _known_kt(real))


def _through_switches(campaign: Campaign, seed: int) -> tuple[Campaign, float]:
    """The drive as commanded to an inverter whose switches and leads have a resistance [ohm]."""
    (drive,) = campaign.captures
    (table,) = drive.tables
    drop_v = DEFAULT.inverter.conduction_share * MOTOR.vdc_v
    u_ohm = drop_v / float(np.max(np.abs(table["iq_a"].to_numpy())))
    ohm = u_ohm * float(np.random.default_rng(seed).standard_normal())
    drops = [pl.col(f"v{axis}_v") + ohm * pl.col(f"i{axis}_a") for axis in "dq"]
    driven = replace(drive, tables=(table.with_columns(drops),))
    return replace(campaign, captures=(driven,)), ohm


def _voltage_trial(seed: int) -> Trial:
    plan: Plan = (("drive_0", "drive", {"voltage_timing": "held"}),)
    campaign, real = recorded(plan, seed)
    campaign, switches_ohm = _through_switches(campaign, seed)
    true = {
        "ke_phase_peak_v_s_rad": MOTOR.pole_pairs * MOTOR.psi_pm_wb,
        "r_phase_ohm": MOTOR.r_phase_ohm,
    }
    gain = real.voltage_commanded
    seen = {
        "ke_phase_peak_v_s_rad": true["ke_phase_peak_v_s_rad"] * gain,
        "r_phase_ohm": true["r_phase_ohm"] * gain / real.current + switches_ohm,
    }
    return Trial(campaign, true, seen)


def _unbounded() -> Mapping[str, float]:
    """Closed-loop logs: the noise runs through the controller, no bound in closed form."""
    return {}


CASES = (
    Case("torque_map", torque_map.ESTIMATOR, _map_trial, _map_bound, few=24),
    Case("inductance_rated", inductance_rated.ESTIMATOR, _inductance_trial, _unbounded, few=24),
    Case("cogging", cogging.ESTIMATOR, _cogging_trial, _cogging_bound, few=24),
    Case("spin_down", spin_down.ESTIMATOR, _coast_trial, _coast_bound),
    Case("inertia", inertia.ESTIMATOR, _drive_trial, _unbounded, few=24),
    Case("drive_voltage", drive_voltage.ESTIMATOR, _voltage_trial, _unbounded, few=24),
)
