"""What a motor's recording and the fleet's table agree on: names, steps, constants shown."""

from __future__ import annotations

from dataclasses import dataclass

CAPTURE, STEPS_A_CAPTURE = "capture", 1000
APPLICATION = "fleet"


@dataclass(frozen=True, slots=True)
class Shown:
    """A constant of the fleet's table: its property, heading, and factor from the SI unit."""

    constant: str
    key: str
    heading: str
    factor: float


SHOWN = (
    Shown("r_phase_ohm", "r_phase_mohm", "R [mΩ]", 1e3),
    Shown("ld_h", "ld_uh", "Ld [µH]", 1e6),
    Shown("lq_h", "lq_uh", "Lq [µH]", 1e6),
    Shown("psi_pm_wb", "psi_pm_mwb", "ψ [mWb]", 1e3),
    Shown("kt_peak_nm_a", "kt_peak_mnm_a", "Kt [mN·m/A]", 1e3),
    Shown("cogging_amplitude_nm", "cogging_mnm", "cogging [mN·m]", 1e3),
    Shown("j_rotor_kgm2", "j_rotor_1e6_kgm2", "J [1e-6 kg·m²]", 1e6),
    Shown("torque_coulomb_nm", "torque_coulomb_mnm", "friction [mN·m]", 1e3),
)
