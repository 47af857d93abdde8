"""Shaft mechanics that several packages use."""

from __future__ import annotations

import math


def cogging_order(slots: int, pole_pairs: int) -> int:
    """Fundamental cogging order a mechanical turn: LCM(slots, 2p).

    Parameters
    ----------
    slots
        Of the stator.
    pole_pairs
        p, of the rotor.

    Returns
    -------
    int
        Periods of the cogging torque a turn [1/turn].

    References
    ----------
    Zhu and Howe, IEEE Trans. Energy Convers. 15(4), 2000, 407, doi:10.1109/60.900501.

    Examples
    --------
    >>> cogging_order(12, 7), cogging_order(9, 4)
    (84, 72)

    """
    return math.lcm(slots, 2 * pole_pairs)
