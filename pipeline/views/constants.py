"""Which constants stand together on a page, and how each is written for people."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from pipeline.physics.glossary import CONSTANTS, Term

_GROUPED: dict[str, tuple[tuple[str, str, str], ...]] = {
    "Electrical": (
        ("r_phase_ohm", "R", "phase"),
        ("r_ll_ohm", "R", "ll"),
        ("resistance_imbalance", "ΔR/R", ""),
        ("temp_coeff_copper_1_k", "α", "copper"),
        ("ld_h", "L", "d"),
        ("lq_h", "L", "q"),
        ("saliency_ratio", "L", "q/d"),
        ("ld_rated_h", "L", "d, rated"),
        ("lq_rated_h", "L", "q, rated"),
        ("tau_elec_s", "τ", "e"),
    ),
    "Magnet and torque": (
        ("pole_pairs", "p", ""),
        ("psi_pm_wb", "ψ", "pm"),
        ("temp_coeff_magnet_1_k", "α", "magnet"),
        ("kt_peak_nm_a", "K", "t, peak"),
        ("kt_rms_nm_a", "K", "t, rms"),
        ("kt_from_ke_nm_a", "K", "t, from Ke"),
        ("motor_constant_nm_sqrt_w", "K", "m"),
        ("ke_phase_peak_v_s_rad", "K", "e, phase peak"),
        ("ke_ll_peak_v_s_rad", "K", "e, ll peak"),
        ("ke_ll_rms_v_s_rad", "K", "e, ll rms"),
        ("ke_ll_peak_v_krpm", "K", "e, ll peak"),
        ("kv_ll_peak_rpm_v", "K", "v, ll peak"),
    ),
    "Mechanical": (
        ("j_rotor_kgm2", "J", ""),
        ("torque_coulomb_nm", "T", "C"),
        ("b_visc_nm_s_rad", "B", ""),
        ("cogging_order", "n", "cog"),
        ("cogging_amplitude_nm", "T", "cog"),
        ("cogging_peak_nm", "T", "cog, peak"),
        ("tau_mech_s", "τ", "m"),
    ),
    "Thermal": (("rth_winding_k_w", "R", "th"),),
}
"""Name, letter and subscript of the constants under each heading of a datasheet."""
_OTHERS = (
    ("coast_coulomb_rad_s2", "T", "C over J"),
    ("coast_viscous_1_s", "B", "over J"),
    ("ks_v", "k", "S"),
    ("kv_v_s_rad", "k", "V"),
    ("ka_v_s2_rad", "k", "A"),
    ("cogging_amplitude_a", "I", "cog"),
    ("holding_friction_a", "I", "friction"),
)
GROUPS = {title: tuple(name for name, _, _ in rows) for title, rows in _GROUPED.items()}
OTHER = "Further constants"
KEY_CONSTANTS = (
    "r_phase_ohm", "ld_h", "lq_h", "psi_pm_wb", "pole_pairs", "kt_peak_nm_a", "kv_ll_peak_rpm_v",
    "cogging_amplitude_nm", "j_rotor_kgm2", "torque_coulomb_nm",
)  # fmt: skip
PARTIAL_CONSTANTS = (
    "coast_coulomb_rad_s2", "coast_viscous_1_s", "ks_v", "kv_v_s_rad", "ka_v_s2_rad",
    "cogging_amplitude_a", "holding_friction_a", "motor_constant_nm_sqrt_w", "kt_from_ke_nm_a",
)  # fmt: skip
"""What logs of a part of a motor give, in a batch that has none of `KEY_CONSTANTS`."""
_SYMBOLS = {
    name: (letter, sub) for rows in (*_GROUPED.values(), _OTHERS) for name, letter, sub in rows
}


def symbol(name: str) -> tuple[str, str]:
    """Letter and subscript of a constant; both empty where it has no usual symbol.

    Parameters
    ----------
    name
        Name of the constant.

    """
    return _SYMBOLS.get(name, ("", ""))


def constant_words(name: str, own: Mapping[str, Term] | None = None) -> str:
    """What a constant is, in the glossary's words or in those of the plug-in that owns it.

    Parameters
    ----------
    name
        Name of the constant.
    own
        Terms of plug-ins that the glossary lacks, by name.

    """
    term = CONSTANTS.get(name) or (own or {}).get(name)
    if term is None:
        return name.replace("_", " ")
    words = term.words.replace("degC", "°C")
    return sentence(f"temperature coefficient {words}" if words.startswith("of ") else words)


def grouped(names: Iterable[str]) -> list[tuple[str, list[str]]]:
    """The names under the headings of a datasheet, known ones in its order, others sorted last.

    Parameters
    ----------
    names
        Names of constants.

    """
    present = set(names)
    known = {name for group in GROUPS.values() for name in group}
    groups = [(title, [n for n in group if n in present]) for title, group in GROUPS.items()]
    groups.append((OTHER, sorted(present - known, key=in_order)))
    return [(title, members) for title, members in groups if members]


def in_order(name: str) -> list[tuple[int, str]]:
    """A key that sorts numbers in names by their size: harmonic 5 before harmonic 11.

    Parameters
    ----------
    name
        The name.

    """
    return [(int(part), "") if part.isdigit() else (-1, part) for part in re.split(r"(\d+)", name)]


def sentence(text: str) -> str:
    """The text with a capital first letter, unless its first word is a name such as `lq_h`.

    Parameters
    ----------
    text
        The text.

    """
    first = text.split(" ", 1)[0]
    return text if "_" in first else text[:1].upper() + text[1:]
