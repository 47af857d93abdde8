"""A plausible motor, with everything on its datasheet that a page must be able to show."""

from __future__ import annotations

import re

import numpy as np
import pytest

from pipeline.physics.glossary import CONSTANTS
from pipeline.records.datasheet import CaptureReference, Check, Datasheet
from pipeline.records.estimate import Estimate, derived, not_identifiable
from pipeline.records.evidence import Evidence, Series
from pipeline.records.finding import Finding
from pipeline.records.uncertainty import type_a, type_b

STEPS = "joint-P0/current_step_0.mcap"
VALUES = {
    "r_phase_ohm": (0.31004, 4e-4, "resistance"),
    "ld_h": (2.101e-4, 6e-7, "current_step"),
    "lq_h": (2.9e-4, 8e-7, "current_step"),
    "psi_pm_wb": (9.4003e-3, 6e-6, "open_circuit"),
    "kt_peak_nm_a": (0.14102, 2.1e-4, "torque_map"),
    "kv_ll_peak_rpm_v": (58.652, 0.04, "open_circuit"),
    "j_rotor_kgm2": (4.402e-5, 1.9e-7, "inertia"),
    "torque_coulomb_nm": (4.02e-3, 3.1e-5, "spin_down"),
    "b_visc_nm_s_rad": (2.21e-5, 2e-7, "spin_down"),
    "temp_coeff_copper_1_k": (3.86e-3, 1.1e-5, "heat_run"),
}


def estimate(name: str, value: float, u: float, method: str) -> Estimate:
    budget = type_a(f"scatter:{method}:{name}", 0.6 * u, 37.0) + type_b("current@rig-1", 0.8 * u)
    return Estimate(
        name,
        value,
        CONSTANTS[name].unit,
        "measured",
        method,
        budget,
        {"temp_winding_degc": 25.0},
        (STEPS, "joint-P0/resistance_ab_0.mcap"),
        "instrument gains as stated",
    )


def make_datasheet(motor_id: str = "joint-P0", shift: float = 1.0, **changes: object) -> Datasheet:
    constants = {n: estimate(n, v * shift, u, m) for n, (v, u, m) in VALUES.items()}
    ld, lq = constants["ld_h"], constants["lq_h"]
    constants["saliency_ratio"] = derived(
        "saliency_ratio",
        "1",
        lq.number / ld.number,
        [(1 / ld.number, lq), (-lq.number / ld.number**2, ld)],
        "saliency",
    )
    constants["pole_pairs"] = Estimate("pole_pairs", 10, "1", "measured", "open_circuit")
    constants["cogging_amplitude_nm"] = not_identifiable(
        "cogging_amplitude_nm", "N·m", "cogging", "no order stands out of the noise"
    )
    fields = {
        "motor_id": motor_id,
        "motor_type": "joint-250",
        "lot": "A",
        "version": "5f" * 32,
        "status": "provisional",
        "why": ("not approved", "cogging_amplitude_nm is not measured"),
        "captures": (CaptureReference(STEPS, "ab" * 32, "current_step", "verified"),),
        "config_sha256": "cd" * 32,
        "code_version": "0.1.0+g1234567",
        "constants": constants,
        "alternatives": (estimate("ld_h", 2.115e-4, 9e-7, "lcr"),),
        "checks": (
            Check("saliency_ratio", "pass", "Lq over Ld as the design says", 1.38, 2.0, "1"),
            Check(
                "kt_vs_ke", "fail", "torque test against back-EMF", 1.1547, 0.01, "1", "2/sqrt(3)"
            ),
            Check("power_balance", "not_evaluated", "no torque map"),
            Check("tau_elec_vs_l_over_r", "marginal", "step against L/R", 9.4e-4, 9.2e-4, "s"),
        ),
    }
    return Datasheet(**{**fields, **changes})


@pytest.fixture
def datasheet() -> Datasheet:
    return make_datasheet()


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(2)


@pytest.fixture
def evidence(rng: np.random.Generator) -> tuple[Evidence, ...]:
    return make_evidence(rng)


def make_evidence(rng: np.random.Generator) -> tuple[Evidence, ...]:
    time = np.linspace(0.0, 8e-3, 4000)
    steps = []
    for level in (2.0, 5.0, 10.0):
        fitted = level * (1 - np.exp(-time / 9.2e-4))
        noisy = fitted + rng.normal(0, 0.02, time.size)
        steps.append(Series(f"{level:g} A", time, noisy, fitted))
    speed = np.linspace(-200, 200, 41)
    emf = 0.094 * speed
    angle = np.linspace(0, 2 * np.pi, 3000)
    cogging = 0.004 * np.sin(60 * angle)
    orders = np.arange(1, 121, dtype=np.float64)
    spectrum = rng.rayleigh(2e-5, orders.size)
    spectrum[59] = 0.004
    temperature = np.linspace(25, 90, 300)
    ohms = 0.31 * (1 + 0.003854 * (temperature - 25))
    current = np.repeat(np.linspace(-20, 20, 9), 40)
    torque = 0.141 * current
    coast = np.linspace(0, 3.0, 3000)
    omega = 250 * np.exp(-coast / 2.0) - 40
    none = np.empty(0)
    noise = lambda like, sigma: like + rng.normal(0, sigma, like.size)  # noqa: E731
    one = lambda *columns: (Series("", *columns),)  # noqa: E731
    return (
        Evidence(
            "current_step", "Current after the step", "t_s", "ia_a", "line", tuple(steps), STEPS
        ),
        Evidence(
            "open_circuit",
            "Back-EMF against speed",
            "omega_mech_rad_s",
            "vab_v",
            "scatter",
            one(speed, noise(emf, 0.01), emf),
        ),
        Evidence(
            "cogging",
            "Torque over a turn, both directions",
            "theta_mech_rad",
            "torque_shaft_nm",
            "line",
            (
                Series("forward", angle, noise(cogging + 0.005, 5e-4), none),
                Series("backward", angle, noise(cogging - 0.005, 5e-4), none),
            ),
        ),
        Evidence(
            "cogging", "Orders", "order", "torque_shaft_nm", "bars", one(orders, spectrum, none)
        ),
        Evidence(
            "heat_run",
            "Resistance against temperature",
            "temp_winding_degc",
            "r_phase_ohm",
            "scatter",
            one(temperature, noise(ohms, 2e-4), ohms),
        ),
        Evidence(
            "torque_map",
            "Torque against current",
            "iq_a",
            "torque_shaft_nm",
            "scatter",
            one(current, noise(torque, 0.004), torque),
        ),
        Evidence(
            "spin_down",
            "Coasting",
            "t_s",
            "omega_mech_rad_s",
            "line",
            one(coast, noise(omega, 0.3) + 0.5 * np.sin(9 * coast), omega),
        ),
    )


FINDINGS = (
    Finding("joint-P0/x.mcap", "refused", "truncated", "the file ends early", "record it again"),
    Finding(STEPS, "warning", "gap", "12 samples are missing", "look at the cable", (400, 412)),
)


def flat(html: str) -> str:
    """HTML in one line, without the space that stands beside what is a block anyway."""
    blocks = (
        r"(</?(?:h\d|p|div|table|t[rdh]|details|summary|section|figure|[uod]l|li|d[td])\b[^>]*>)"
    )
    return re.sub(rf"\s*{blocks}\s*", r"\1", re.sub(r"\s+", " ", html))
