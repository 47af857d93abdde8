"""Pole pairs from two frequencies."""

from __future__ import annotations

from typing import NamedTuple

POLE_PAIRS_TOLERANCE = 0.02
"""How far from a whole number a ratio of frequencies may be [1]."""


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
