"""Numbers for people: engineering notation, rounded by their uncertainty.

Reference: JCGM 100:2008 (GUM), 7.2.6: at most two significant digits of the uncertainty, the
value to the same place.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from decimal import ROUND_HALF_EVEN, Decimal

COVERAGE_FACTOR = 2.0
MINUS = "−"
_PREFIXES = {-12: "p", -9: "n", -6: "µ", -3: "m", 0: "", 3: "k", 6: "M"}
_WORDS = {"ohm": "Ω", "degC": "°C", "deg": "°", "N·m/sqrt(W)": "N·m/√W", "1/K": "K⁻¹", "1": ""}
_PREFIXABLE = ("V", "A", "N·m", "Ω", "H", "Wb", "s", "W", "Hz")
_SUPERSCRIPT = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")


@dataclass(frozen=True, slots=True)
class Scale:
    """A power of ten and the unit text that goes with it: value = shown number * 10**exponent."""

    exponent: int
    unit: str

    def shown(self, value: float) -> float:
        """The number to show beside `unit`.

        Parameters
        ----------
        value
            In the unit without a prefix.

        """
        return value / 10.0**self.exponent


@dataclass(frozen=True, slots=True)
class Reading:
    """A number ready to be read: `value` ± `expanded` `unit`; `expanded` empty if none stated."""

    value: str
    expanded: str
    unit: str
    exponent: int = 0

    def text(self) -> str:
        """One line of plain text."""
        spread = f" ± {self.expanded}" if self.expanded else ""
        return f"{self.value}{spread} {self.unit}".strip()


def unit_text(unit: str) -> str:
    """A unit of the glossary as people write it: `ohm` is Ω, `1` is nothing.

    Parameters
    ----------
    unit
        Such as `ohm`, which is Ω; `1` is the empty text.

    """
    return _WORDS.get(unit, unit)


def scale_for(magnitude: float, unit: str) -> Scale:
    """The SI prefix, or power of ten where a prefix would mislead, that fits a magnitude.

    Parameters
    ----------
    magnitude
        Of the number [unit].
    unit
        As in the glossary.

    Returns
    -------
    Scale
        Of a power of a thousand. A prefix, p to M, stands before the first unit of a product (mN·m,
        µH). Units such as kg·m² and rad/s take a power of ten instead, and only outside 0.001 to
        10000; 1/K always does; degrees, of angle or temperature, never.

    Examples
    --------
    >>> scale_for(2.5e-4, "H").unit, scale_for(2.5e-6, "kg·m²").unit, scale_for(1e5, "degC").unit
    ('µH', '×10⁻⁶ kg·m²', '°C')

    """
    shown = unit_text(unit)
    if not math.isfinite(magnitude) or magnitude == 0.0 or shown in {"°C", "°"}:
        return Scale(0, shown)
    exponent = 3 * math.floor(math.log10(abs(magnitude)) / 3 + 1e-12)
    if _takes_prefix(shown):
        exponent = min(max(exponent, -12), 6)
        return Scale(exponent, _PREFIXES[exponent] + shown)
    if 1e-3 <= abs(magnitude) < 1e4 and shown != "K⁻¹":
        return Scale(0, shown)
    return Scale(exponent, times_ten(exponent, shown))


def times_ten(exponent: int, shown: str) -> str:
    """The text of a unit after a power of ten, such as `×10⁻⁶ kg·m²`.

    Parameters
    ----------
    exponent
        Of ten; 0 for the unit alone.
    shown
        The unit as people write it.

    """
    if exponent == 0:
        return shown
    return f"×10{str(exponent).translate(_SUPERSCRIPT)} {shown}".strip()


def reading(value: float, u: float, unit: str, scale: Scale | None = None) -> Reading:
    """Value and expanded uncertainty in engineering notation, rounded by the uncertainty.

    Parameters
    ----------
    value
        The number [unit].
    u
        Its standard uncertainty [unit]; 0 or not finite where none is stated.
    unit
        As in the glossary.
    scale
        Prefix or power of ten; by default what fits the larger of both.

    Returns
    -------
    Reading
        Value and U = 2 u, both to the place of the second digit of U. Without an uncertainty the
        value has four significant digits, a whole number below a million all of its own.

    References
    ----------
    JCGM 100:2008 (GUM), 7.2.6.

    Examples
    --------
    >>> reading(0.123456, 0.00042, "ohm").text()
    '123.46 ± 0.84 mΩ'

    """
    expanded = COVERAGE_FACTOR * u
    if not math.isfinite(expanded) or expanded <= 0.0:
        if float(value).is_integer() and abs(value) < 1e6:
            return Reading(_signed(Decimal(int(value))), "", unit_text(unit))
        chosen = scale or scale_for(_rounded_magnitude(value), unit)
        return Reading(significant(chosen.shown(value), 4), "", chosen.unit, chosen.exponent)
    chosen = scale or scale_for(max(abs(value), expanded), unit)
    place = _place_of(chosen.shown(expanded), 2)
    quantum = Decimal(1).scaleb(place)
    return Reading(
        _signed(_to_place(chosen.shown(value), quantum)),
        _signed(_to_place(chosen.shown(expanded), quantum)),
        chosen.unit,
        chosen.exponent,
    )


def number_text(value: float | None, u: float | None, unit: str) -> str:
    """A reading as one line of text, or that there is none.

    Parameters
    ----------
    value
        The number [unit]; None where it is not identifiable.
    u
        Its standard uncertainty [unit], if any.
    unit
        As in the glossary.

    Returns
    -------
    str
        See `reading`.

    """
    if value is None:
        return "not identifiable"
    return reading(value, 0.0 if u is None else u, unit).text()


def quantity(value: float, unit: str, digits: int = 4) -> str:
    """A number without uncertainty in engineering notation.

    Parameters
    ----------
    value
        The number [unit].
    unit
        As in the glossary.
    digits
        Significant digits.

    Returns
    -------
    str
        A dash where the number is not finite.

    Examples
    --------
    >>> quantity(0.0123456, "N·m"), quantity(9999.96, "V")
    ('12.35 mN·m', '10.00 kV')

    """
    if not math.isfinite(value):
        return "–"
    scale = scale_for(_rounded_magnitude(value, digits), unit)
    return f"{significant(scale.shown(value), digits)} {scale.unit}".strip()


def significant(value: float, digits: int) -> str:
    """Plain decimal text with some significant digits, trailing zeros of a fraction kept.

    Parameters
    ----------
    value
        Any number.
    digits
        Significant digits, at least 1.

    Returns
    -------
    str
        Without exponent; 0 is `0`, and a number that is not finite a dash.

    Examples
    --------
    >>> significant(0.5, 3), significant(1234.0, 2)
    ('0.500', '1200')

    """
    if value == 0.0 or not math.isfinite(value):
        return "0" if value == 0.0 else "–"
    place = _place_of(value, digits)
    return _signed(_to_place(value, Decimal(1).scaleb(place)))


def plain(value: float, digits: int = 6) -> str:
    """The shortest text of a number, without trailing zeros.

    Parameters
    ----------
    value
        Any number.
    digits
        Significant digits at most.

    """
    text = f"{value:.{digits}g}"
    return text.replace("-", MINUS) if "e" not in text else text


def _takes_prefix(shown: str) -> bool:
    return shown == "rad" or any(
        shown == unit or shown.startswith((unit + "/", unit + "·")) for unit in _PREFIXABLE
    )


def _rounded_magnitude(value: float, digits: int = 4) -> float:
    if value == 0.0 or not math.isfinite(value):
        return 0.0
    return abs(float(_to_place(value, Decimal(1).scaleb(_place_of(value, digits)))))


def _place_of(value: float, digits: int) -> int:
    """The power of ten of the last of `digits` significant digits, after rounding to them."""
    exact = abs(Decimal(repr(float(value))))
    place = exact.adjusted() - digits + 1
    rounded = exact.quantize(Decimal(1).scaleb(place), rounding=ROUND_HALF_EVEN)
    return rounded.adjusted() - digits + 1


def _to_place(value: float, quantum: Decimal) -> Decimal:
    return Decimal(repr(float(value))).quantize(quantum, rounding=ROUND_HALF_EVEN)


def _signed(number: Decimal) -> str:
    text = format(number, "f")
    if not text.startswith("-"):
        return text
    return text[1:] if not text.strip("-0.") else MINUS + text[1:]
