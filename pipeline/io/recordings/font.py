"""Which characters the viewer can draw: it has one font, and without a window it dies of others.

The ranges were found by showing every character of their blocks to the viewer of the pinned
version; a test shows them all to it again.
"""

from __future__ import annotations

import re

# First and last code point of what was seen to be drawn, and all that a unit or a name needs.
RANGES = (
    (0x20, 0x7E),
    (0xA0, 0xAC),
    (0xAE, 0x148),
    (0x14A, 0x1C3),
    (0x1C5, 0x24F),
    (0x384, 0x38A),
    (0x38E, 0x3A1),
    (0x3A3, 0x3E1),
    (0x3F0, 0x45F),
    (0x1E00, 0x1EFF),
    (0x2010, 0x2027),
    (0x2030, 0x205E),
    (0x2070, 0x2071),
    (0x2074, 0x208E),
    (0x20A0, 0x20BF),
)
SINGLE = "→←↑↓√∞≈≠≤≥−∂∆∑±×·✓✔✗⚠●■▲Ω"


_OTHER = re.compile("[^\n\t" + "".join(f"{chr(a)}-{chr(b)}" for a, b in RANGES) + SINGLE + "]")


_NEGATIVE_POWER = re.compile("(×10)?⁻([⁰¹²³⁴-⁹]+)")
_DIGITS = str.maketrans("⁰¹²³⁴⁵⁶⁷⁸⁹", "0123456789")


def in_headings(unit: str) -> str:
    """A unit for the heading of a table, whose font has no superscript minus: ×10⁻⁶ as 1e-6.

    Parameters
    ----------
    unit
        As people write it.

    """

    def plain(match: re.Match[str]) -> str:
        return ("1e-" if match[1] else "^-") + match[2].translate(_DIGITS)

    return _NEGATIVE_POWER.sub(plain, unit)


def drawable(text: str) -> str:
    """The text with every character that the viewer cannot draw as its code point, ‹1F600›.

    Parameters
    ----------
    text
        Any text.

    """
    return _OTHER.sub(lambda other: f"‹{ord(other.group()):X}›", text)
