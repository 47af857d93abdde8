"""By what numbers conventions differ, and which of them a measured ratio lands on.

Reference: JCGM 100:2008 (GUM), 6.2 (expanded uncertainty). The numbers: `coupling.COUPLINGS`.
"""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

Quantity = Literal[
    "coupling", "power", "impedance", "time_constant", "temperature_coefficient", "count"
]
"""What a ratio is of: torque per ampere or volt per speed; power; resistance or inductance; L/R;
a coefficient per kelvin; pole pairs or cycles."""
MOST_SUSPECTS = 2


class Convention(NamedTuple):
    """A number by which two conventions differ, and the quantities that it can enter."""

    number: float
    label: str
    words: str
    enters: frozenset[Quantity]


def _convention(number: float, label: str, words: str, *enters: Quantity) -> Convention:
    return Convention(number, label, words, frozenset(enters))


# A current convention enters torque per ampere and power; one of voltage enters both as well. A
# time constant is a ratio of impedances: no convention of torque, speed or amplitude is in it.
_BOTH: tuple[Quantity, ...] = ("coupling", "power")
_WINDING: tuple[Quantity, ...] = ("impedance", "time_constant")
CONVENTIONS: tuple[Convention, ...] = (
    _convention(math.pi / 3.0, "1.0472",
        "six-step no-load speed per DC volt against line-line peak", "coupling"),
    _convention(2.0 * math.sqrt(3.0) / math.pi, "1.1027",
        "torque per DC ampere, six-step, against peak", *_BOTH),
    _convention(2.0 / math.sqrt(3.0), "1.1547",
        "Kt = Ke line-line peak, the DC form, against 1.5 p psi", "coupling"),
    _convention(2.0 / math.sqrt(3.0), "1.1547",
        "full modulation by space vectors, Vdc/√3, against a sine's, Vdc/2", "power"),
    _convention(math.sqrt(1.5), "1.2247",
        "power-invariant against amplitude-invariant frame", *_BOTH),
    _convention(math.sqrt(2.0), "1.4142", "peak against rms", *_BOTH),
    _convention(1.5, "1.5",
        "the factor 3/2 of the amplitude-invariant frame left out", *_BOTH),
    _convention(1.5, "1.5",
        "one terminal against the two others in parallel, or a delta's winding against its "
        "terminals", *_WINDING),
    _convention(math.sqrt(3.0), "1.7321", "line-line against phase", *_BOTH),
    _convention(1.8, "1.8", "degrees Fahrenheit against Celsius", "temperature_coefficient"),
    _convention(2.0, "2",
        "poles against pole pairs, peak to peak against peak, or both amplitudes rms",
        *_BOTH, "count"),
    _convention(2.0, "2", "line-line against phase impedance", *_WINDING),
    _convention(3.0 / math.sqrt(2.0), "2.1213", "torque per rms ampere against p psi", "coupling"),
    _convention(3.0, "3", "a delta's winding against its wye equivalent", *_WINDING),
    _convention(2.0 * math.pi, "2*pi", "per cycle against per radian", *_BOTH, *_WINDING),
    _convention(60.0 / (2.0 * math.pi), "9.5493", "rpm against rad/s", *_BOTH),
    _convention(100.0, "100", "hundredths against the unit: N·cm against N·m", *_BOTH),
    _convention(1000.0, "1000",
        "thousandths against the unit: ms, mA, mV, mH or mN·m", *_BOTH, *_WINDING),
)  # fmt: skip


def convention_suspect(
    ratio: float, half_width: float, quantity: Quantity, pole_pairs: int | None = None
) -> str | None:
    """The convention whose number a ratio of two like quantities lands on.

    Parameters
    ----------
    ratio
        Of two values of one quantity [1].
    half_width
        Of its coverage interval [1]: the expanded uncertainty U = k u (GUM 6.2).
    quantity
        What the ratio is of: a convention that cannot enter it is no explanation of it.
    pole_pairs
        Of the machine; a factor by which electrical and mechanical angles differ.

    Returns
    -------
    str or None
        One of `conventions_hit`, or two, the nearest first; None where it hits none, or so many
        that they say nothing.

    """
    hits = conventions_hit(ratio, half_width, quantity, pole_pairs)
    return " or ".join(hits) if 0 < len(hits) <= MOST_SUSPECTS else None


def conventions_hit(
    ratio: float, half_width: float, quantity: Quantity, pole_pairs: int | None = None
) -> list[str]:
    """The conventions whose number lies in the ratio's coverage interval, the nearest first.

    Parameters
    ----------
    ratio
        Of two values of one quantity [1].
    half_width
        Of its coverage interval [1]: the expanded uncertainty U = k u (GUM 6.2).
    quantity
        What the ratio is of: a convention that cannot enter it is no explanation of it.
    pole_pairs
        Of the machine; a factor by which electrical and mechanical angles differ.

    Returns
    -------
    list of str
        One text a convention, `1/` before its number where the ratio is the inverse. Empty where
        the interval holds 1, for nothing is to be explained then, and where a number is not finite
        or the ratio not above zero.

    Examples
    --------
    >>> conventions_hit(1.42, 0.02, "coupling")
    ['1.4142: peak against rms']

    """
    if not (ratio > 0.0 and math.isfinite(ratio) and math.isfinite(half_width)):
        return []
    if abs(ratio - 1.0) <= half_width:
        return []
    known = [c for c in CONVENTIONS if quantity in c.enters]
    if pole_pairs is not None and pole_pairs > 1 and quantity in ("coupling", "power", "count"):
        words = "electrical against mechanical angle, speed or frequency"
        known.append(
            Convention(float(pole_pairs), f"the pole pairs ({pole_pairs})", words, frozenset())
        )
    hits = []
    for number, label, words, _ in known:
        place = number if ratio > 1.0 else 1.0 / number
        if abs(ratio - place) <= half_width:
            text = f"{label if ratio > 1.0 else f'1/{label}'}: {words}"
            hits.append((abs(ratio - place), text))
    return [text for _, text in sorted(hits)]
