"""The closed table of unit suffixes: a name ends in its unit, and only these units exist."""

from __future__ import annotations

import math

TURN_RAD = 2.0 * math.pi
"""One turn."""
RAD_S_PER_RPM = 2.0 * math.pi / 60.0
"""One revolution a minute."""
REFERENCE_DEGC = 25.0
"""The temperature that constants are given at."""
SUFFIX_UNITS: dict[str, str] = {
    "s": "s",
    "v": "V",
    "a": "A",
    "ohm": "ohm",
    "h": "H",
    "wb": "Wb",
    "rad": "rad",
    "deg": "deg",
    "rad_s": "rad/s",
    "rad_s2": "rad/s²",
    "hz": "Hz",
    "nm": "N·m",
    "degc": "degC",
    "k": "K",
    "w": "W",
    "kgm2": "kg·m²",
    "nm_a": "N·m/A",
    "nm_s_rad": "N·m·s/rad",
    "nm_sqrt_w": "N·m/sqrt(W)",
    "v_s_rad": "V·s/rad",
    "v_s2_rad": "V·s²/rad",
    "v_krpm": "V/krpm",
    "rpm_v": "rpm/V",
    "k_w": "K/W",
    "j_k": "J/K",
    "1_k": "1/K",
    "1_s": "1/s",
    "nm_a2": "N·m/A²",
}
