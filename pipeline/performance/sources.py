"""The constants that a motor's numbers are derived from, as draws, and what is missing of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from pipeline.performance.draws import joint_draws, uniform_draws
from pipeline.performance.heat import Heat
from pipeline.performance.machine import Machine
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K, Array
from pipeline.physics.units import REFERENCE_DEGC
from pipeline.records.estimate import Estimate
from pipeline.records.performance import Blank
from pipeline.records.uncertainty import type_b

SEEN = 2.0
"""Standard deviations from which on an inductance is seen to go with the current."""
ELECTRICAL = ("r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "pole_pairs")
MECHANICAL = ("torque_coulomb_nm", "b_visc_nm_s_rad")
SATURATION = ("ld_rated_h", "lq_rated_h")
HEAT = ("rth_winding_k_w", "cth_winding_j_k", "tau_thermal_winding_s", "tau_thermal_body_s")
COPPER, MAGNET = "temp_coeff_copper_1_k", "temp_coeff_magnet_1_k"
ASSUMED = {
    COPPER: (COPPER_COEFFICIENT_25_1_K, 5e-5, "pure copper"),
    MAGNET: (-1.0e-3, 4e-4, "from ferrite to sintered NdFeB: half of that range either side"),
}
"""Coefficients [1/K] where they were not measured, with their u."""
TESTS = {
    "r_phase_ohm": "resistance",
    "ld_h": "current_step or lcr with the rotor on the d axis",
    "lq_h": "current_step or lcr with the rotor on the q axis",
    "psi_pm_wb": "open_circuit",
    "pole_pairs": "open_circuit with the shaft's angle",
    "torque_coulomb_nm": "spin_down, with j_rotor_kgm2 from a drive",
    "b_visc_nm_s_rad": "spin_down, with j_rotor_kgm2 from a drive",
    "rth_winding_k_w": "heat_run of three thermal time constants",
}


@dataclass(frozen=True, slots=True)
class Sources:
    """The constants that a motor's numbers are derived from.

    Attributes
    ----------
    draws
        Draws by name.
    known
        Estimates, with the conditions that they were measured at.
    assumed
        Sentences on what was assumed.

    """

    draws: Mapping[str, Array]
    known: Mapping[str, Estimate]
    assumed: tuple[str, ...]

    def has(self, *names: str) -> bool:
        """Whether all of some constants are known.

        Parameters
        ----------
        *names
            Names of constants.

        """
        return all(name in self.draws for name in names)

    @property
    def size(self) -> int:
        """The published values and the draws."""
        return next(iter(self.draws.values())).size


def sources_of(constants: Mapping[str, Estimate]) -> Sources:
    """The draws of all constants that the numbers depend on.

    Parameters
    ----------
    constants
        Estimates by name.

    Returns
    -------
    Sources
        A temperature coefficient that was not measured is assumed, with a budget of its own.

    """
    wanted = (*ELECTRICAL, *MECHANICAL, *SATURATION, *HEAT, COPPER, MAGNET)
    known = {n: constants[n] for n in wanted if n in constants and constants[n].known}
    assumed = []
    for name, (value, u, words) in ASSUMED.items():
        if name not in known:
            budget = type_b(f"assumed:{name}", u)
            known[name] = Estimate(name, value, "1/K", "assumed", "performance", budget)
            assumed.append(f"{name} = {value:.3g} ± {2 * u:.1g} 1/K was not measured ({words})")
    return Sources(joint_draws(known), known, tuple(assumed))


def machine_at(sources: Sources, temp_winding_degc: Array, temp_magnet_degc: Array) -> Machine:
    """The machine at given temperatures.

    Parameters
    ----------
    sources
        Draws of the constants.
    temp_winding_degc
        One for all draws, or one a draw.
    temp_magnet_degc
        One for all draws, or one a draw.

    Returns
    -------
    Machine
        Drag that was not measured is 0.

    Notes
    -----
    R = R25 (1 + α (T_w − 25)) and ψ = ψ25 (1 + α_m (T_m − 25)).

    """
    d = sources.draws
    zero = np.zeros(sources.size)
    winding, magnet = temp_winding_degc - REFERENCE_DEGC, temp_magnet_degc - REFERENCE_DEGC
    (ld_slope, within_d), (lq_slope, within_q) = _slope(sources, "d", 1), _slope(sources, "q", 2)
    return Machine(
        pole_pairs=float(d["pole_pairs"][0]),
        r_ohm=d["r_phase_ohm"] * (1.0 + d[COPPER] * winding),
        psi_wb=d["psi_pm_wb"] * (1.0 + d[MAGNET] * magnet),
        ld_h=d["ld_h"],
        lq_h=d["lq_h"],
        ld_slope_h_a=ld_slope,
        lq_slope_h_a2=lq_slope,
        within_d_a=within_d,
        within_q_a=within_q,
        beyond=uniform_draws("saturation beyond the recorded currents", 0.0, 1.0),
        coulomb_nm=d.get("torque_coulomb_nm", zero),
        viscous_nm_s_rad=d.get("b_visc_nm_s_rad", zero),
    )


def _slope(sources: Sources, axis: str, power: int) -> tuple[Array, float]:
    """How an axis' apparent inductance goes with a power of its current, and up to which current.

    Zero where it was not measured under current, at no current of that axis, or where the change is
    one that chance makes.
    """
    rated = sources.known.get(f"l{axis}_rated_h")
    at = None if rated is None else rated.at.get(f"i{axis}_a")
    if rated is None or not isinstance(at, (int, float)) or abs(at) < 1e-3:
        return np.zeros(sources.size), float("inf")
    change = sources.draws[f"l{axis}_rated_h"] - sources.draws[f"l{axis}_h"]
    if abs(change[0]) < SEEN * float(np.std(change[1:])):
        return np.zeros(sources.size), float("inf")
    return change / float(at) ** power, abs(float(at))


def heat_of(sources: Sources) -> Heat | None:
    """The path of heat from the winding.

    Parameters
    ----------
    sources
        Draws of the constants.

    Returns
    -------
    Heat or None
        One node where no second one was found; None without a heat run.

    """
    d = sources.draws
    if not sources.has(*HEAT[:3]):
        return None
    body = d.get(HEAT[3], np.full(sources.size, 1.0))
    return Heat(d[HEAT[0]], d[HEAT[1]], d[HEAT[2]], body)


def missing(sources: Sources, names: tuple[str, ...], of: str, words: str) -> Blank | None:
    """The blank of a number that needs constants which are missing.

    Parameters
    ----------
    sources
        Draws of the constants.
    names
        Constants that it needs.
    of
        Name of the number.
    words
        Its meaning.

    Returns
    -------
    Blank or None
        None where all are known.

    """
    lacking = [name for name in names if name not in sources.draws]
    if not lacking:
        return None
    tests = dict.fromkeys(TESTS.get(name, name) for name in lacking)
    return Blank(of, words, f"needs {', '.join(lacking)}", "; ".join(tests))
