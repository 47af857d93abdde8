"""Constants that follow from torque, inertia, flux and resistance together."""

from __future__ import annotations

import math

from pipeline.estimation.formulas import Formula, estimator_of
from pipeline.physics.coupling import motor_constant_nm_sqrt_w

FORMULAS: dict[str, Formula] = {
    "kt_rms_nm_a": Formula(
        ("kt_peak_nm_a",), (1.0,), lambda kt: math.sqrt(2.0) * kt, "sqrt(2) kt_peak_nm_a"
    ),
    "motor_constant_nm_sqrt_w": Formula(
        ("kt_peak_nm_a", "r_phase_ohm"),
        (1.0, -0.5),
        motor_constant_nm_sqrt_w,
        "kt_peak_nm_a / sqrt(1.5 r_phase_ohm)",
    ),
    "tau_mech_s": Formula(
        ("j_rotor_kgm2", "r_phase_ohm", "pole_pairs", "psi_pm_wb"),
        (1.0, 1.0, -2.0, -2.0),
        lambda j, r, pairs, psi: j * r / (1.5 * (pairs * psi) ** 2),
        "j_rotor_kgm2 r_phase_ohm / (1.5 (pole_pairs psi_pm_wb)²)",
    ),
}

ESTIMATOR = estimator_of("derived", FORMULAS)
