"""Constants that follow from flux, inductance and resistance alone."""

from __future__ import annotations

from pipeline.estimation.formulas import Formula, estimator_of
from pipeline.physics.coupling import coupling_as

FORMULAS: dict[str, Formula] = {
    "saliency_ratio": Formula(("lq_h", "ld_h"), (1.0, -1.0), lambda lq, ld: lq / ld, "lq_h / ld_h"),
    "kt_from_ke_nm_a": Formula(
        ("pole_pairs", "psi_pm_wb"),
        (1.0, 1.0),
        lambda pairs, psi: coupling_as("kt_peak_nm_a", pairs * psi),
        "1.5 pole_pairs psi_pm_wb",
    ),
    "tau_elec_s": Formula(
        ("lq_h", "r_phase_ohm"), (1.0, -1.0), lambda lq, r: lq / r, "lq_h / r_phase_ohm"
    ),
}

ESTIMATOR = estimator_of("derived_electrical", FORMULAS)
