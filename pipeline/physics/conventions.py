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
    """One name for the coupling k = p·psi [V·s/rad]: value = factor · k^power, power 1 or -1."""

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
    """The value that a convention gives the coupling k = p·psi [V·s/rad], phase peak.

    value = factor · k^(±1) with the factors of `COUPLINGS` [1, ch. 8; 4, ch. 3]. A trapezoidal
    machine with two phases on has Kt = Ke line-line (flat top) and needs no conversion.
    """
    form = COUPLINGS[name]
    return form.factor * k_v_s_rad**form.power


def coupling_from(name: CouplingName, value: float) -> float:
    """The coupling k = p·psi [V·s/rad], phase peak, from its value in a convention.

    k = (value / factor)^(±1); the inverse of `coupling_as`.
    """
    form = COUPLINGS[name]
    return float((value / form.factor) ** form.power)


def motor_constant_nm_sqrt_w(kt_peak_nm_a: float, r_phase_ohm: float) -> float:
    """Torque per root of copper loss [N·m/√W]: K_m = Kt_peak/√(1.5 R) = Kt_rms/√(3 R) [1, ch. 11].

    The same number in every convention, because copper loss is 1.5 R i_q² of the peak ampere.
    """
    return kt_peak_nm_a / math.sqrt(1.5 * r_phase_ohm)


def phase_from_line(line: float) -> float:
    """Wye-equivalent phase resistance or inductance from terminal to terminal: X_ll/2.

    Holds for both windings: a delta of 1.5·X_ll a winding also reads X_ll. For an inductance,
    X_ll is the mean over the rotor's angle.
    """
    return line / 2.0


def line_from_phase(phase: float) -> float:
    """Terminal-to-terminal resistance or inductance of a wye-equivalent phase: 2·X_phase."""
    return 2.0 * phase


def delta_from_wye(phase: float) -> float:
    """Resistance or inductance of a balanced delta's winding from the wye equivalent: 3·X."""
    return 3.0 * phase


def wye_from_delta(winding: float) -> float:
    """Wye-equivalent phase resistance or inductance of a balanced delta's winding: X/3."""
    return winding / 3.0


class Phases(NamedTuple):
    """One value a phase or a pair: a, b, c, or ab, bc, ca."""

    a: float
    b: float
    c: float


def phase_resistances_ohm(rab_ohm: float, rbc_ohm: float, rca_ohm: float) -> Phases:
    """Wye-equivalent phase resistances [ohm] from three line-to-line ones, balanced or not.

    R_a = (R_ab + R_ca − R_bc)/2 and its turns; exact for a delta too, being its star equivalent.
    """
    return Phases(
        (rab_ohm + rca_ohm - rbc_ohm) / 2.0,
        (rab_ohm + rbc_ohm - rca_ohm) / 2.0,
        (rbc_ohm + rca_ohm - rab_ohm) / 2.0,
    )


def line_resistances_ohm(ra_ohm: float, rb_ohm: float, rc_ohm: float) -> Phases:
    """Line-to-line resistances ab, bc, ca [ohm] from the wye-equivalent phases."""
    return Phases(ra_ohm + rb_ohm, rb_ohm + rc_ohm, rc_ohm + ra_ohm)


def delta_windings_ohm(ra_ohm: float, rb_ohm: float, rc_ohm: float) -> Phases:
    """Windings ab, bc, ca [ohm] of the delta that a wye is equivalent to (Kennelly's theorem).

    R_ab = (R_a R_b + R_b R_c + R_c R_a)/R_c and its turns.
    """
    total = ra_ohm * rb_ohm + rb_ohm * rc_ohm + rc_ohm * ra_ohm
    return Phases(total / rc_ohm, total / ra_ohm, total / rb_ohm)


def copper_resistance_ohm(
    r_ohm: ArrayLike, temp_degc: ArrayLike, reference_degc: ArrayLike
) -> Array:
    """Resistance [ohm] of copper at `temp_degc` that has `r_ohm` at `reference_degc`.

    R(T) = R0 (234.5 + T)/(234.5 + T0) [3]; arguments broadcast. To refer a reading back to
    25 degC: `copper_resistance_ohm(reading, 25.0, reading_degc)`.
    """
    scale = (COPPER_ZERO_K + np.asarray(temp_degc, dtype=np.float64)) / (
        COPPER_ZERO_K + np.asarray(reference_degc, dtype=np.float64)
    )
    scaled: Array = np.asarray(r_ohm, dtype=np.float64) * scale
    return scaled


def copper_temperature_degc(r_ohm: float, r_reference_ohm: float, reference_degc: float) -> float:
    """Temperature [degC] of a copper winding from its resistance; inverse of the 234.5 form [3]."""
    return r_ohm / r_reference_ohm * (COPPER_ZERO_K + reference_degc) - COPPER_ZERO_K


def coefficient_at_1_k(alpha_1_k: float, from_degc: float, to_degc: float) -> float:
    """A linear temperature coefficient [1/K] referred to another temperature.

    α' = α/(1 + α (T' − T)): the slope in ohms is one, the resistance it is divided by is not.
    """
    return alpha_1_k / (1.0 + alpha_1_k * (to_degc - from_degc))


def linear_resistance_ohm(
    r_ohm: float, reference_degc: float, temp_degc: float, alpha_1_k: float, alpha_at_degc: float
) -> float:
    """Resistance [ohm] at `temp_degc` with a coefficient that names its own temperature.

    R(T) = R0 (1 + α (T − Tα))/(1 + α (T0 − Tα)).
    """
    return (
        r_ohm
        * (1.0 + alpha_1_k * (temp_degc - alpha_at_degc))
        / (1.0 + alpha_1_k * (reference_degc - alpha_at_degc))
    )


PAIR_AXES_RAD: dict[str, float] = {
    "ab": -math.pi / 6.0,
    "bc": math.pi / 2.0,
    "ca": 7.0 * math.pi / 6.0,
}


def terminal_inductance_h(
    ld_h: float, lq_h: float, theta_elec_rad: ArrayLike, pair: str = "ab"
) -> Array:
    """Inductance [H] between two terminals, the third open, at electrical angles [rad].

    L = (L_d + L_q) + (L_d − L_q) cos 2(θ − θ_pair), θ_pair = −30° (ab), 90° (bc), 210° (ca), the
    direction of the pair's current; 2 L_d where d lies on it [2]. KeyError for another pair.
    """
    swing = np.cos(2.0 * (np.asarray(theta_elec_rad, dtype=np.float64) - PAIR_AXES_RAD[pair]))
    read: Array = (ld_h + lq_h) + (ld_h - lq_h) * swing
    return read


class UnalignedInductances(NamedTuple):
    """Axis inductances [H] without knowing which is d, and where the low one lies [rad, mod π]."""

    low_h: float
    high_h: float
    theta_low_rad: float


def unaligned_inductances_h(lab_h: float, lbc_h: float, lca_h: float) -> UnalignedInductances:
    """Both axis inductances [H] from all three pairs at one unknown rotor angle.

    m = mean, A = √(⅔ Σ(L − m)²), L = (m ∓ A)/2 [2]. With interior magnets the low one is L_d and
    `theta_low_rad` the electrical angle of d, up to half a turn; which is which needs the
    back-EMF or an alignment.
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
    """What L_q/L_d says of the rotor: surface magnets within 10 % of 1 or 2 u, else interior."""
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
    """Pole pairs from the electrical and the mechanical frequency [Hz], or counts of one stretch.

    p = f_elec/f_mech, accepted within 0.02 of a whole number of at least 1.
    """
    ratio = abs(f_elec_hz / f_mech_hz)
    nearest = round(ratio)
    sure = nearest >= 1 and abs(ratio - nearest) <= POLE_PAIRS_TOLERANCE
    return PolePairs(nearest if sure else None, ratio)
