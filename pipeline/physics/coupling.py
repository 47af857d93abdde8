"""Torque and speed constants in every convention of datasheets, from one coupling k = p ψ.

Of the amplitude-invariant frame x = (2/3)(a + b e^{j2π/3} + c e^{-j2π/3}), with d on the magnet.

References: [1] D. C. Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 8 and 11.
[2] R. Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, 2010, ch. 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from pipeline.physics.units import RAD_S_PER_RPM

CouplingName = Literal[
    "ke_phase_peak_v_s_rad",
    "ke_ll_peak_v_s_rad",
    "ke_ll_rms_v_s_rad",
    "ke_ll_peak_v_krpm",
    "ke_ll_rms_v_krpm",
    "kv_ll_peak_rpm_v",
    "kv_six_step_rpm_v",
    "kt_peak_nm_a",
    "kt_rms_nm_a",
    "kt_power_invariant_nm_a",
    "kt_six_step_nm_a",
]


@dataclass(frozen=True, slots=True)
class Coupling:
    """One convention for the coupling k = p ψ [V·s/rad]: value = factor · k^power.

    Attributes
    ----------
    unit, words, formula
        Unit of the value, its meaning, and the formula as text.
    factor
        In the unit, for k in V·s/rad.
    power
        1, or −1 for speed constants.

    """

    unit: str
    words: str
    formula: str
    factor: float
    power: Literal[1, -1] = 1


COUPLINGS: dict[CouplingName, Coupling] = {
    "ke_phase_peak_v_s_rad": Coupling("V·s/rad", "back-EMF, phase peak", "k", 1.0),
    "ke_ll_peak_v_s_rad": Coupling("V·s/rad", "back-EMF, line-line peak", "√3·k", math.sqrt(3.0)),
    "ke_ll_rms_v_s_rad": Coupling("V·s/rad", "back-EMF, line-line rms", "√1.5·k", math.sqrt(1.5)),
    "ke_ll_peak_v_krpm": Coupling(
        "V/krpm",
        "back-EMF, line-line peak",
        "√3·k·1000·2π/60",
        math.sqrt(3.0) * 1e3 * RAD_S_PER_RPM,
    ),
    "ke_ll_rms_v_krpm": Coupling(
        "V/krpm",
        "back-EMF, line-line rms",
        "√1.5·k·1000·2π/60",
        math.sqrt(1.5) * 1e3 * RAD_S_PER_RPM,
    ),
    "kv_ll_peak_rpm_v": Coupling(
        "rpm/V",
        "speed per volt of line-line peak back-EMF",
        "60/(2π·√3·k)",
        1.0 / (math.sqrt(3.0) * RAD_S_PER_RPM),
        -1,
    ),
    "kv_six_step_rpm_v": Coupling(
        "rpm/V",
        "ideal no-load speed per volt of DC link, six-step",
        "(π/3)·60/(2π·√3·k)",
        math.pi / 3.0 / (math.sqrt(3.0) * RAD_S_PER_RPM),
        -1,
    ),
    "kt_peak_nm_a": Coupling("N·m/A", "torque per peak q ampere (FOC)", "1.5·k", 1.5),
    "kt_rms_nm_a": Coupling(
        "N·m/A", "torque per rms phase ampere", "(3/√2)·k", 3.0 / math.sqrt(2.0)
    ),
    "kt_power_invariant_nm_a": Coupling(
        "N·m/A", "torque per q ampere of the power-invariant frame", "√1.5·k", math.sqrt(1.5)
    ),
    "kt_six_step_nm_a": Coupling(
        "N·m/A",
        "torque per DC-link ampere, six-step, sine back-EMF",
        "(3·√3/π)·k",
        3.0 * math.sqrt(3.0) / math.pi,
    ),
}


def coupling_as(name: CouplingName, k_v_s_rad: float) -> float:
    """The value that a convention gives the coupling of a machine.

    Parameters
    ----------
    name
        Of the convention, a key of `COUPLINGS`.
    k_v_s_rad
        The coupling k = p ψ, phase peak back-EMF per mechanical speed [V·s/rad].

    Returns
    -------
    float
        In the convention's unit.

    Notes
    -----
    value = factor · k^(±1) with the factors of `COUPLINGS`, of a sinusoidal machine. A trapezoidal
    machine with two phases on has Kt = Ke line-line (flat top) and needs no conversion.

    References
    ----------
    D. C. Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 8.
    R. Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, CRC Press, 2010, ch. 3.

    Examples
    --------
    >>> coupling_as("kt_peak_nm_a", 0.1), round(coupling_as("ke_ll_peak_v_s_rad", 0.1), 6)
    (0.15000000000000002, 0.173205)

    """
    form = COUPLINGS[name]
    return form.factor * k_v_s_rad**form.power


def coupling_from(name: CouplingName, value: float) -> float:
    """The coupling of a machine from its value in a convention: the inverse of `coupling_as`.

    Parameters
    ----------
    name
        Of the convention, a key of `COUPLINGS`.
    value
        In the convention's unit; not 0 for one that is the inverse of k.

    Returns
    -------
    float
        k = p ψ = (value/factor)^(±1) [V·s/rad], phase peak.

    """
    form = COUPLINGS[name]
    return float((value / form.factor) ** form.power)


def motor_constant_nm_sqrt_w(kt_peak_nm_a: float, r_phase_ohm: float) -> float:
    """Torque per root of copper loss, the same number in every convention.

    Parameters
    ----------
    kt_peak_nm_a
        Torque per peak q ampere [N·m/A].
    r_phase_ohm
        Wye-equivalent phase resistance [ohm], above zero.

    Returns
    -------
    float
        [N·m/√W]

    Notes
    -----
    K_m = Kt_peak/√(1.5 R) = Kt_rms/√(3 R), for the copper loss is 1.5 R i_q² of the peak ampere.

    References
    ----------
    D. C. Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 11.

    Examples
    --------
    >>> motor_constant_nm_sqrt_w(0.3, 0.06)
    1.0

    """
    return kt_peak_nm_a / math.sqrt(1.5 * r_phase_ohm)
