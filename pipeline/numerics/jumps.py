"""Jumps of a signal between its samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def jumps(signal: Array, least: float) -> Array:
    """Steps of a signal that happen within one sample period.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    least
        Size [same unit] up to which a step is none.

    Returns
    -------
    array [n - 1]
        From each sample to the next, same unit: by how much the step is off the median of it and
        its two neighbours, so that neither a ramp nor the slope behind a step is one; 0 at the
        ends.

    Examples
    --------
    >>> jumps(np.array([0.0, 0.0, 4.0, 3.0, 2.0]), 0.5)
    array([0., 4., 0., 0.])

    """
    steps = np.diff(signal)
    found = np.zeros(steps.size)
    if steps.size > 2:
        beside = np.median(np.stack([steps[:-2], steps[1:-1], steps[2:]]), axis=0)
        found[1:-1] = steps[1:-1] - beside
    found[np.abs(found) <= least] = 0.0
    return found
