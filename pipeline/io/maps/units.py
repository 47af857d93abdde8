"""The closed table of foreign units: what a bench may write, and what it is in the glossary's unit.

References: BIPM SI Brochure (9th edition), table 8; NIST SP 811, appendix B (pound-force, ounce).
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from pipeline.physics.glossary import COLUMNS
from pipeline.physics.units import TURN_RAD
from pipeline.records.errors import CaptureError

_POUND_FORCE_N = 4.4482216152605
_INCH_M = 0.0254
_KILOGRAM_FORCE_N = 9.80665
COUNTS = "counts"
_SPELLINGS_OF = {
    COUNTS: ("count", "cnt", "cnts", "ticks", "#", "pu", "p.u.", "per unit"),
    "V": ("Volt", "Volts", "volt", "volts", "伏"),
    "A": ("Amp", "Amps", "Ampere", "ampere", "amp", "A pk", "Apk", "A peak", "安"),
    "V_rms": ("Vrms", "V rms", "V RMS", "V eff", "Veff"),
    "A_rms": ("Arms", "A rms", "A RMS", "A eff", "Aeff"),
    "deg": ("度", "degree", "degrees", "°", "Grad"),
    "rad/s": ("rad/sec", "Radian per Second"),
    "deg/s": ("deg/sec", "dps", "°/s"),
    "s": ("second", "Second", "seconds", "sec", "Sek", "Sekunden", "秒"),
    "ms": ("毫秒", "ミリ秒", "msec"),
    "rpm": (
        "RPM", "1/min", "U/min", "u/min", "Upm", "min^-1", "min-1", "min⁻¹", "tr/min", "rev/min",
        "转/分", "回転/分", "r/min",
    ),
    "krpm": ("kRPM",),
    "rev": ("Rotation", "Rotations", "turn", "turns", "revs", "revolution", "revolutions", "cycle"),
    "rev/s": ("Rotation per Second", "turns_per_second", "rps", "turns/s", "turn/s"),
    "rad": ("Radian", "radian", "radians"),
    "N·m": ("Nm", "N.m", "N m", "N-m", "N*m"),
    "mN·m": ("mN m", "mN.m", "mNm"),
    "N·mm": ("Nmm",),
    "N·cm": ("Ncm", "cNm", "cN·m"),
    "uN·m": ("uNm",),
    "kN·m": ("kNm",),
    "ozf·in": ("oz-in", "ozin"),
    "lbf·in": ("lb-in", "lbin", "in-lb", "in·lb"),
    "lbf·ft": ("lb-ft", "ft-lb", "ft-lbs", "ft·lb", "ft lb", "ftlb", "ft-lbf", "ft·lbf", "lbft"),
    "kgf·cm": ("kgcm",),
    "gf·cm": ("gcm",),
    "degC": ("C", "°C", "℃", "deg C", "grad C", "Celsius", "celsius"),
    "degF": ("F", "°F"),
    "Wb": ("V·s", "Vs"),
    "mWb": ("mVs",),
    "ohm": ("Ohm", "ohms", "Ω"),
    "mohm": ("mΩ", "mOhm"),
    "kohm": ("kΩ",),
    "percent": ("pct",),
}  # fmt: skip
_SPELLINGS = {spelled: unit for unit, many in _SPELLINGS_OF.items() for spelled in many}
_LETTERS_ALIKE = str.maketrans("µμΩ⋅・･∙", "uuΩ····")
"""Micro signs, the ohm sign, and the dots between factors, those of Japanese text among them."""


@dataclass(frozen=True, slots=True)
class Scale:
    """value [glossary unit] = factor * value [foreign unit] + shift."""

    factor: float
    shift: float = 0.0


def _prefixed(unit: str, *prefixes: str) -> dict[str, Scale]:
    powers = {"n": 1e-9, "u": 1e-6, "m": 1e-3, "": 1.0, "k": 1e3, "M": 1e6}
    return {prefix + unit: Scale(powers[prefix]) for prefix in prefixes}


_RMS = Scale(math.sqrt(2.0))
"""Of a rotor frame that is scaled to rms: an amplitude is √2 times as much."""
OF_FRAME = frozenset({"id_a", "iq_a", "vd_v", "vq_v"})
"""Columns that may be in rms; a wave has instants."""
_SHARE = {"percent": Scale(0.01), "%": Scale(0.01), "1": Scale(1.0)}
_ANGLE = {
    "rad": Scale(1.0),
    "mrad": Scale(1e-3),
    "deg": Scale(math.pi / 180),
    "rev": Scale(TURN_RAD),
    "rotation": Scale(TURN_RAD),
    "arcmin": Scale(math.pi / 180 / 60),
}
_TORQUE = {
    "N·m": Scale(1.0),
    "mN·m": Scale(1e-3),
    "uN·m": Scale(1e-6),
    "kN·m": Scale(1e3),
    "N·mm": Scale(1e-3),
    "N·cm": Scale(1e-2),
    "ozf·in": Scale(_POUND_FORCE_N / 16 * _INCH_M),
    "lbf·in": Scale(_POUND_FORCE_N * _INCH_M),
    "lbf·ft": Scale(_POUND_FORCE_N * _INCH_M * 12),
    "kgf·cm": Scale(_KILOGRAM_FORCE_N * 1e-2),
    "gf·cm": Scale(_KILOGRAM_FORCE_N * 1e-5),
}
FOREIGN_UNITS: dict[str, dict[str, Scale]] = {
    "s": _prefixed("s", "", "m", "u", "n") | {"min": Scale(60.0), "h": Scale(3600.0)},
    "V": _prefixed("V", "", "m", "u", "k") | {"V_rms": _RMS} | _SHARE,
    "A": _prefixed("A", "", "m", "u", "k") | {"A_rms": _RMS},
    "rad": _ANGLE,
    "deg": {name: Scale(scale.factor * 180 / math.pi) for name, scale in _ANGLE.items()}
    | {"deg": Scale(1.0), "rev": Scale(360.0), "rotation": Scale(360.0)},
    "rad/s": {
        "rad/s": Scale(1.0),
        "deg/s": Scale(math.pi / 180),
        "rpm": Scale(TURN_RAD / 60),
        "krpm": Scale(TURN_RAD / 60 * 1e3),
        "rev/s": Scale(TURN_RAD),
        "Hz": Scale(TURN_RAD),
    },
    "N·m": _TORQUE,
    "degC": {
        "degC": Scale(1.0),
        "K": Scale(1.0, -273.15),
        "degF": Scale(5 / 9, -160 / 9),
        "mdegC": Scale(1e-3),
    },
    "Wb": {"Wb": Scale(1.0), "mWb": Scale(1e-3), "uWb": Scale(1e-6)},
    "H": _prefixed("H", "", "m", "u", "n"),
    "ohm": _prefixed("ohm", "", "m", "u", "k"),
    "Hz": _prefixed("Hz", "", "k", "M"),
}


def normal_unit(text: str) -> str:
    """A unit as the table spells it; brackets, spaces and the two micro signs are evened out.

    Parameters
    ----------
    text
        As it is written; brackets, spaces and the two micro signs are unified.

    """
    bare = text.strip().strip("()[]").strip()
    bare = bare.translate(_LETTERS_ALIKE)
    return _SPELLINGS.get(bare, bare)


def scale_to(unit: str, target: str) -> Scale:
    """The scale from a foreign unit to a unit of the glossary.

    Parameters
    ----------
    unit
        As it is written; `counts` are of the unit that the map's own `scale` makes them.
    target
        Unit of the glossary.

    Returns
    -------
    Scale
        Factor and shift.

    Raises
    ------
    CaptureError
        There is no such unit of that dimension (`unknown_unit`).

    """
    if normal_unit(unit) == COUNTS:
        return Scale(1.0)
    known = FOREIGN_UNITS.get(target, {target: Scale(1.0)})
    scale = known.get(normal_unit(unit))
    if scale is None:
        raise CaptureError(
            "unknown_unit",
            f"the unit {unit!r} is not one this pipeline converts to {target}",
            f"use one of: {', '.join(sorted(known))}",
        )
    return scale


def scale_of(unit: str, column: str) -> Scale:
    """The scale from a foreign unit to that of a column.

    Parameters
    ----------
    unit
        As it is written.
    column
        Of the glossary.

    Returns
    -------
    Scale
        Factor and shift.

    Raises
    ------
    CaptureError
        As `scale_to`; and of an rms value of a column that is in no rotor frame (`unknown_unit`).

    """
    if normal_unit(unit) in ("A_rms", "V_rms") and column not in OF_FRAME:
        raise CaptureError(
            "unknown_unit",
            f"{column} is a wave, and {unit!r} is the unit of an amplitude",
            "write the unit of its instants, such as A or V",
        )
    return scale_to(unit, COLUMNS[column].unit)
