"""What voltages at speed say of stated pole pairs."""

from __future__ import annotations

import math

from pipeline.records.estimate import Estimate

BY_VOLTAGE = "pole_pairs_by_voltage"
"""Constant: pole pairs by voltages at speed over inductances at standstill, no whole number."""

CONTRADICTION_SIGMAS = 3.0
"""Standard uncertainties by which a stated number is off where it is contradicted, as checks fail:
a sound motor's sheet is not withheld for iron that bends.
"""


def voltages_say(seen: Estimate) -> str:
    """What the voltages at speed say of pole pairs, in words."""
    low, high = seen.interval()
    return (
        f"the voltages at speed are those of {seen.number:.3g} "
        f"({max(low, 0.0):.2g} to {high:.2g}) by the inductances at standstill"
    )


def contradicts(seen: Estimate, stated: int) -> bool:
    """Whether the voltages at speed exclude a stated number of pole pairs.

    Parameters
    ----------
    seen
        `pole_pairs_by_voltage`.
    stated
        What captures state, above 0.

    Notes
    -----
    |ln(p / p_stated)| > 3 u/p: what parts two inductances is a factor, either way.

    """
    off = abs(math.log(seen.number / stated))
    return off > CONTRADICTION_SIGMAS * seen.u / seen.number
