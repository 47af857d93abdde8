"""Constants that are stated of a motor, as priors of the model's parameters."""

from __future__ import annotations

from collections.abc import Iterable, Mapping

from pipeline.physics.conventions import COUPLINGS, coupling_from
from pipeline.records.estimate import Estimate

PARAMETERS: Mapping[str, str] = {
    "r_phase_ohm": "r_ohm",
    "ld_h": "ld_h",
    "lq_h": "lq_h",
    "psi_pm_wb": "psi_wb",
    "j_rotor_kgm2": "j_kgm2",
    "b_visc_nm_s_rad": "b_nm_s_rad",
    "torque_coulomb_nm": "coulomb_friction.torque_nm",
    "temp_coeff_copper_1_k": "copper_temperature.alpha_1_k",
    "temp_coeff_magnet_1_k": "magnet_temperature.alpha_1_k",
}
"""The parameter that a constant is."""
_OF_PAIRS = ("psi_pm_wb", "ld_h", "lq_h")


def stated_parameters(
    stated: Iterable[Estimate], pole_pairs: int, *, counted: bool = True
) -> dict[str, tuple[float, float]]:
    """Value and standard uncertainty by parameter, in its unit.

    Parameters
    ----------
    stated
        Of `records.stated`. Of several that say one parameter the one with the least relative
        uncertainty counts: they may all come from one measurement.
    pole_pairs
        Of the motor, for torque and back-EMF constants.
    counted
        Whether they are known; where not, a flux linkage or inductance says nothing of them.

    Notes
    -----
    Those are the flux linkage of the magnet: k = p ψ in each convention (`COUPLINGS`).

    """
    found: dict[str, tuple[float, float]] = {}
    for one in stated:
        name, value, u = PARAMETERS.get(one.name, ""), one.number, one.u
        if one.name == "r_ll_ohm":
            name, value, u = "r_ohm", value / 2.0, u / 2.0
        elif one.name in COUPLINGS and value > 0.0:
            flux_wb = coupling_from(one.name, value) / pole_pairs
            name, value, u = "psi_wb", flux_wb, flux_wb * u / value
        if not name or u <= 0.0 or (one.name in _OF_PAIRS and not counted):
            continue
        if name not in found or u * abs(found[name][0]) < found[name][1] * abs(value):
            found[name] = value, u
    return found
