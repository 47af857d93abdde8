"""What orders leave of a holding current, fitted and held out."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence

import numpy as np

from pipeline.criticism.data.holding_cells import _held_out, _joined
from pipeline.criticism.policy.policy import Policy
from pipeline.records.capture import Capture


def sector_errors(
    captures: Iterable[Capture], orders: Sequence[int], policy: Policy
) -> tuple[float, float]:
    """What orders, and an offset a sense, leave of a holding current.

    Parameters
    ----------
    captures
        Holding currents of one motor.
    orders
        [1/turn]
    policy
        Constants of judgement.

    Returns
    -------
    fitted, held_out
        Root mean squares [A]: of the residuals, and with each sector predicted from all others.

    Raises
    ------
    ValueError
        There is no holding current.

    """
    joined = _joined(captures, policy)
    if joined is None:
        raise ValueError("no capture holds a rotor at many angles")
    theta, current, side, sector = joined
    waves = [wave(k * theta) for k in orders for wave in (np.cos, np.sin)]
    design = np.column_stack([side, *waves])
    left = current - design @ np.linalg.lstsq(design, current, rcond=None)[0]
    count = np.bincount(sector)
    held = float(_held_out(design, current, sector) @ count[count > 0]) / current.size
    return math.sqrt(float(left @ left) / current.size), math.sqrt(held)
