"""Constants of a motor made up by hand, with what they share."""

from __future__ import annotations

from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import Contribution

CURRENT, VOLTAGE = "current@s", "voltage@s"


def estimate(name: str, value: float, unit: str, at: dict[str, float] | None = None,
             **sources: float) -> Estimate:  # fmt: skip
    """A constant with contributions by source, `current` and `voltage` for the station's."""
    told = {"current": CURRENT, "voltage": VOLTAGE}
    budget = tuple(Contribution(told.get(s, f"scatter:{s}"), u, "B") for s, u in sources.items())
    return Estimate(name, value, unit, "measured", "hand", budget, at or {})


def salient(**other: Estimate) -> dict[str, Estimate]:
    """Four pole pairs, L_q of twice L_d, everything that a sheet needs; `other` replaces some."""
    return {
        "pole_pairs": estimate("pole_pairs", 4, "1"),
        "r_phase_ohm": estimate("r_phase_ohm", 0.05, "ohm", current=-1e-4, voltage=5e-5),
        "ld_h": estimate("ld_h", 1e-4, "H", current=-2e-7),
        "lq_h": estimate("lq_h", 2e-4, "H", current=-4e-7),
        "psi_pm_wb": estimate("psi_pm_wb", 0.01, "Wb", voltage=1e-5),
        "torque_coulomb_nm": estimate("torque_coulomb_nm", 0.02, "N·m", tc=1e-3),
        "b_visc_nm_s_rad": estimate("b_visc_nm_s_rad", 1e-5, "N·m·s/rad", b=1e-6),
        "temp_coeff_copper_1_k": estimate("temp_coeff_copper_1_k", 0.0039, "1/K"),
        "temp_coeff_magnet_1_k": estimate("temp_coeff_magnet_1_k", -0.001, "1/K"),
        "rth_winding_k_w": estimate("rth_winding_k_w", 1.5, "K/W", rth=0.03),
        "cth_winding_j_k": estimate("cth_winding_j_k", 40.0, "J/K", cth=0.5),
        "tau_thermal_winding_s": estimate("tau_thermal_winding_s", 30.0, "s", tau=0.3),
        "tau_thermal_body_s": estimate("tau_thermal_body_s", 400.0, "s", body=4.0),
        **other,
    }
