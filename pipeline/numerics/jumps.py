"""Jumps of a signal, or of a speed, between samples."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import grey_opening, maximum_filter1d

from pipeline.numerics.quantisation import resolution

Array = NDArray[np.float64]
_LASTING = 4
"""Samples of an acceleration that is none of jumps: a line from sample to sample follows it."""
_ROUNDED_STEPS = 2.5
"""Steps of its resolution up to which rounding alone may bend an angle: three roundings of half a
step each, the middle one twice, make two."""


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


def speed_jumps(theta_rad: Array, share: float, times: float, beside: int = 0) -> NDArray[np.bool_]:
    """Samples at which a shaft changes its speed from one to the next, and those beside them.

    Parameters
    ----------
    theta_rad
        Angle at even samples [n].
    share
        Least change of the speed over the highest [1].
    times
        Least change over the usual one [1], so that neither noise nor a steady acceleration is one.
    beside
        Samples on either side in which the speed settles.

    Returns
    -------
    array [n]
        What drove the shaft there happened between samples, or in too few to follow it.

    Notes
    -----
    Of the changes of the speed what is above their morphological opening: an acceleration that
    lasts, however large, is no jump.
    Of an angle that is rounded the usual change may be none, and rounding makes one of up to two
    steps of its resolution.

    References
    ----------
    Serra, Image Analysis and Mathematical Morphology, Academic Press, 1982 (top-hat transform).

    Examples
    --------
    >>> speed_jumps(np.array([0.0, 1.0, 2.0, 3.0, 8.0, 13.0, 18.0]), 0.1, 10.0).nonzero()[0]
    array([3])

    """
    found = np.zeros(theta_rad.size, dtype=bool)
    if theta_rad.size > 2:
        speed = np.diff(theta_rad)
        change = np.abs(np.diff(speed))
        least = max(share * float(np.abs(speed).max()), times * float(np.median(change)))
        lasting = grey_opening(change, _LASTING)
        found[1:-1] = change - lasting > max(least, _ROUNDED_STEPS * resolution(theta_rad), 1e-300)
    return maximum_filter1d(found, 2 * beside + 1)
