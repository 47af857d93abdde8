"""One machine, many names: conversions between the conventions of datasheets and instruments.

Frame: x = (2/3)(a + b e^{j2π/3} + c e^{-j2π/3}), amplitude-invariant; d on the magnet's flux; the
electrical angle θ is 0 with d on phase a. Resistance and inductance are wye equivalents.

References: [1] D. C. Hanselman, Brushless Permanent Magnet Motor Design, 2006, ch. 8 and 11.
[2] J. R. Hendershot, T. J. E. Miller, Design of Brushless Permanent-Magnet Machines, 2010.
[3] IEEE Std 112-2017: copper resistance in proportion to 234.5 + T (IEC 60034-1: 235 + T).
[4] R. Krishnan, Permanent Magnet Synchronous and Brushless DC Motor Drives, 2010, ch. 3.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

RAD_S_PER_RPM = 2.0 * math.pi / 60.0
COPPER_ZERO_K = 234.5
COPPER_COEFFICIENT_25_1_K = 1.0 / (COPPER_ZERO_K + 25.0)
POLE_PAIRS_TOLERANCE = 0.02
SALIENT_FROM = 1.1
UNLOGGED_U_K = 20.0
"""Standard uncertainty of a temperature that nobody logged [K], of estimates and of models."""
UNLOGGED_D_SHARE = 0.02
"""Reluctance torque of a d current that nobody logged, over the magnet's torque [1]."""

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
PAIR_AXES_RAD: dict[str, float] = {
    "ab": -math.pi / 6.0,
    "bc": math.pi / 2.0,
    "ca": 7.0 * math.pi / 6.0,
}


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


def phase_from_line(line: float) -> float:
    """Wye-equivalent phase resistance or inductance from terminal to terminal.

    Parameters
    ----------
    line
        X_ll [ohm or H]. For an inductance, the mean over the rotor's angle.

    Returns
    -------
    float
        X_ll / 2 in the same unit, for either winding: a delta of 1.5 X_ll a winding also reads
        X_ll.

    """
    return line / 2.0


def line_from_phase(phase: float) -> float:
    """Terminal-to-terminal resistance or inductance of a wye-equivalent phase.

    Parameters
    ----------
    phase
        X [ohm or H].

    Returns
    -------
    float
        2 X in the same unit.

    """
    return 2.0 * phase


def delta_from_wye(phase: float) -> float:
    """Resistance or inductance of the winding of a balanced delta from its wye equivalent.

    Parameters
    ----------
    phase
        X [ohm or H].

    Returns
    -------
    float
        3 X in the same unit.

    """
    return 3.0 * phase


def wye_from_delta(winding: float) -> float:
    """Wye-equivalent phase resistance or inductance of the winding of a balanced delta.

    Parameters
    ----------
    winding
        X [ohm or H].

    Returns
    -------
    float
        X / 3 in the same unit.

    """
    return winding / 3.0


class Phases(NamedTuple):
    """One value a phase or a pair: a, b, c, or ab, bc, ca."""

    a: float
    b: float
    c: float


def phase_resistances_ohm(rab_ohm: float, rbc_ohm: float, rca_ohm: float) -> Phases:
    """Wye-equivalent phase resistances from three line-to-line ones, balanced or not.

    Parameters
    ----------
    rab_ohm, rbc_ohm, rca_ohm
        Between two terminals, the third open [ohm].

    Returns
    -------
    Phases
        a, b, c [ohm].

    Notes
    -----
    R_a = (R_ab + R_ca − R_bc)/2 and its turns; exact for a delta too, being its star equivalent.

    Examples
    --------
    >>> phase_resistances_ohm(3.0, 5.0, 4.0)
    Phases(a=1.0, b=2.0, c=3.0)

    """
    return Phases(
        (rab_ohm + rca_ohm - rbc_ohm) / 2.0,
        (rab_ohm + rbc_ohm - rca_ohm) / 2.0,
        (rbc_ohm + rca_ohm - rab_ohm) / 2.0,
    )


def line_resistances_ohm(ra_ohm: float, rb_ohm: float, rc_ohm: float) -> Phases:
    """Line-to-line resistances from the phases of a wye.

    Parameters
    ----------
    ra_ohm, rb_ohm, rc_ohm
        Phases.

    Returns
    -------
    Phases
        ab, bc and ca [ohm].

    """
    return Phases(ra_ohm + rb_ohm, rb_ohm + rc_ohm, rc_ohm + ra_ohm)


def delta_windings_ohm(ra_ohm: float, rb_ohm: float, rc_ohm: float) -> Phases:
    """Windings of the delta that a wye is equivalent to (Kennelly's theorem).

    Parameters
    ----------
    ra_ohm, rb_ohm, rc_ohm
        Phases of the wye [ohm], above zero.

    Returns
    -------
    Phases
        Windings ab, bc, ca [ohm].

    Notes
    -----
    R_ab = (R_a R_b + R_b R_c + R_c R_a)/R_c and its turns.

    Examples
    --------
    >>> delta_windings_ohm(1.0, 1.0, 1.0)
    Phases(a=3.0, b=3.0, c=3.0)

    """
    total = ra_ohm * rb_ohm + rb_ohm * rc_ohm + rc_ohm * ra_ohm
    return Phases(total / rc_ohm, total / ra_ohm, total / rb_ohm)


def copper_resistance_ohm(
    r_ohm: ArrayLike, temp_degc: ArrayLike, reference_degc: ArrayLike
) -> Array:
    """Resistance of copper at another temperature.

    Parameters
    ----------
    r_ohm
        Resistance at the reference [ohm]; the arguments broadcast.
    temp_degc
        Where the resistance is wanted [degC].
    reference_degc
        Where it is `r_ohm` [degC].

    Returns
    -------
    array [ohm]

    Notes
    -----
    R(T) = R₀ (234.5 + T)/(234.5 + T₀). To refer a reading back to 25 degC:
    `copper_resistance_ohm(reading, 25.0, reading_degc)`.

    References
    ----------
    IEEE Std 112-2017, 5.4 (IEC 60034-1 has 235 for 234.5).

    Examples
    --------
    A kelvin is 1/259.5 of the resistance at 25 degC:

    >>> float(copper_resistance_ohm(2.595, 35.0, 25.0))
    2.695

    """
    scale = (COPPER_ZERO_K + np.asarray(temp_degc, dtype=np.float64)) / (
        COPPER_ZERO_K + np.asarray(reference_degc, dtype=np.float64)
    )
    return np.asarray(r_ohm, dtype=np.float64) * scale


def copper_temperature_degc(r_ohm: float, r_reference_ohm: float, reference_degc: float) -> float:
    """Temperature of a copper winding from its resistance: the inverse of `copper_resistance_ohm`.

    Parameters
    ----------
    r_ohm
        Resistance now [ohm].
    r_reference_ohm
        Resistance at the reference [ohm].
    reference_degc
        Temperature of the reference [degC].

    Returns
    -------
    float
        [degC]

    Notes
    -----
    T = (234.5 + T₀) R/R₀ − 234.5

    References
    ----------
    IEEE Std 112-2017, 5.4.

    """
    return r_ohm / r_reference_ohm * (COPPER_ZERO_K + reference_degc) - COPPER_ZERO_K


def coefficient_at_1_k(alpha_1_k: float, from_degc: float, to_degc: float) -> float:
    """A linear temperature coefficient referred to another temperature.

    Parameters
    ----------
    alpha_1_k
        Coefficient [1/K] of the value at `from_degc`.
    from_degc
        Temperature to which it refers [degC].
    to_degc
        Temperature to which it shall refer [degC].

    Returns
    -------
    float
        [1/K]

    Notes
    -----
    α' = α/(1 + α (T' − T)): the slope in ohms is one, the resistance it is divided by is not.

    Examples
    --------
    >>> round(coefficient_at_1_k(0.00393, 20.0, 25.0), 6)
    0.003854

    """
    return alpha_1_k / (1.0 + alpha_1_k * (to_degc - from_degc))


def linear_resistance_ohm(
    r_ohm: float, reference_degc: float, temp_degc: float, alpha_1_k: float, alpha_at_degc: float
) -> float:
    """Resistance at a temperature with a coefficient that names its own temperature.

    Parameters
    ----------
    r_ohm
        Resistance at the reference [ohm].
    reference_degc
        Where it was measured [degC].
    temp_degc
        Where it is wanted [degC].
    alpha_1_k
        Coefficient [1/K].
    alpha_at_degc
        Temperature to which the coefficient refers [degC].

    Returns
    -------
    float
        [ohm]

    Notes
    -----
    R(T) = R₀ (1 + α (T − T_α))/(1 + α (T₀ − T_α))

    """
    return (
        r_ohm
        * (1.0 + alpha_1_k * (temp_degc - alpha_at_degc))
        / (1.0 + alpha_1_k * (reference_degc - alpha_at_degc))
    )


def terminal_inductance_h(
    ld_h: float, lq_h: float, theta_elec_rad: ArrayLike, pair: str = "ab"
) -> Array:
    """Inductance between two terminals, the third open, at electrical angles.

    Parameters
    ----------
    ld_h, lq_h
        Inductances of the axes [H].
    theta_elec_rad
        Electrical angle of d from phase a [n, rad].
    pair
        ab, bc or ca.

    Returns
    -------
    array [n, H]

    Raises
    ------
    KeyError
        There is no such pair.

    Notes
    -----
    L = (L_d + L_q) + (L_d − L_q) cos 2(θ − θ_pair) with θ_pair = −30° (ab), 90° (bc), 210° (ca),
    the direction of the pair's current: 2 L_d where d lies on it, 2 L_q a quarter turn from there.

    References
    ----------
    Hendershot and Miller, Design of Brushless Permanent-Magnet Machines, 2010.

    Examples
    --------
    >>> float(terminal_inductance_h(1e-3, 2e-3, -math.pi / 6.0))
    0.002

    """
    swing = np.cos(2.0 * (np.asarray(theta_elec_rad, dtype=np.float64) - PAIR_AXES_RAD[pair]))
    return (ld_h + lq_h) + (ld_h - lq_h) * swing


class UnalignedInductances(NamedTuple):
    """Axis inductances [H] without knowing which is d, and where the low one lies [rad, mod π]."""

    low_h: float
    high_h: float
    theta_low_rad: float


def unaligned_inductances_h(lab_h: float, lbc_h: float, lca_h: float) -> UnalignedInductances:
    """Both axis inductances from all three pairs at one unknown rotor angle.

    Parameters
    ----------
    lab_h, lbc_h, lca_h
        Between two terminals, the third open, the rotor at one angle throughout [H].

    Returns
    -------
    UnalignedInductances
        With interior magnets the low one is L_d and `theta_low_rad` the electrical angle of d, up
        to half a turn; which is which needs the back-EMF or an alignment.

    Notes
    -----
    L = (m ∓ A)/2 with m the mean of the pairs and A = √(⅔ Σ(L_pair − m)²).

    References
    ----------
    Hendershot and Miller, Design of Brushless Permanent-Magnet Machines, 2010.

    """
    read = dict(zip(("ab", "bc", "ca"), (lab_h, lbc_h, lca_h), strict=True))
    mean = (lab_h + lbc_h + lca_h) / 3.0
    # The pairs lie 120° apart, so their mean drops out of both sums.
    cosine = sum(v * math.cos(2.0 * PAIR_AXES_RAD[k]) for k, v in read.items()) / 1.5
    sine = sum(v * math.sin(2.0 * PAIR_AXES_RAD[k]) for k, v in read.items()) / 1.5
    swing = math.hypot(cosine, sine)
    theta_low = math.atan2(-sine, -cosine) / 2.0 % math.pi
    return UnalignedInductances((mean - swing) / 2.0, (mean + swing) / 2.0, theta_low)


def saliency_words(ratio: float, u: float = 0.0) -> str:
    """What L_q/L_d says of the rotor, in words.

    Parameters
    ----------
    ratio
        L_q over L_d [1].
    u
        Its standard uncertainty [1].

    Returns
    -------
    str
        Surface magnets where the ratio is within 10 % or 2 u of 1, whichever is more.

    """
    margin = max(SALIENT_FROM - 1.0, 2.0 * u)
    if ratio > 1.0 + margin:
        return "interior magnets, salient"
    if ratio < 1.0 - margin:
        return "L_d above L_q: d and q exchanged, or a flux-intensifying rotor"
    return "surface magnets, not salient"


class PolePairs(NamedTuple):
    """The nearest whole number of pole pairs (None beyond the tolerance) and the ratio found."""

    number: int | None
    ratio: float


def pole_pairs_from(f_elec_hz: float, f_mech_hz: float) -> PolePairs:
    """Pole pairs from the electrical and the mechanical frequency, or counts of one stretch.

    Parameters
    ----------
    f_elec_hz
        Electrical frequency [Hz], or cycles; its sign does not matter.
    f_mech_hz
        Mechanical frequency [Hz], or turns; not 0.

    Returns
    -------
    PolePairs
        The nearest whole number of at least 1 where f_elec/f_mech is within `POLE_PAIRS_TOLERANCE`
        of it, else None; and the ratio.

    Examples
    --------
    >>> pole_pairs_from(70.05, 10.0)
    PolePairs(number=7, ratio=7.005)

    """
    ratio = abs(f_elec_hz / f_mech_hz)
    nearest = round(ratio)
    sure = nearest >= 1 and abs(ratio - nearest) <= POLE_PAIRS_TOLERANCE
    return PolePairs(nearest if sure else None, ratio)
