"""Shaft mechanics that several packages use."""

from __future__ import annotations

import math


def cogging_order(slots: int, pole_pairs: int) -> int:
    """Fundamental cogging order a mechanical turn: LCM(slots, 2p).

    Reference: [1] Z. Q. Zhu, D. Howe, Influence of design parameters on cogging torque, IEEE Trans.
    Energy Convers. 15 (4), 2000.
    """
    return math.lcm(slots, 2 * pole_pairs)
