"""Whether one recorded signal is another in other units, but for noise."""

from __future__ import annotations

import numpy as np

from pipeline.records.capture import Array

_BLOCK = 25
"""Rows whose mean is looked at: what persists for longer is no noise."""
_LEAST_BLOCKS = 12
_LEAST_R2 = 0.98
_EXCESS = 3.0
"""Power of block means over that of white noise from which on a rest is none; of 12 blocks of white
noise one in a thousand has more."""


def same_but_for_noise(signal: Array, other: Array) -> float | None:
    """The factor by which a signal is another one, where what it leaves is noise alone.

    Parameters
    ----------
    signal, other
        Samples of one clock [n]; rows without both are left out.

    Returns
    -------
    float or None
        Slope through zero; None where the rest persists from row to row, as friction, inertia or
        an offset makes it, where there is more of it than a fiftieth of the signal, or where the
        rows are too few to say.

    Examples
    --------
    >>> current = np.sin(np.arange(500) / 9.0)
    >>> same_but_for_noise(0.05 * current, current)
    0.05
    >>> same_but_for_noise(0.05 * current - 0.001 * np.sign(np.cos(np.arange(500) / 9.0)), current)

    """
    finite = np.isfinite(signal) & np.isfinite(other)
    one, two = signal[finite], other[finite]
    blocks = one.size // _BLOCK
    power = float(one @ one)
    if blocks < _LEAST_BLOCKS or power == 0.0 or not np.ptp(two):
        return None
    factor = float(one @ two) / float(two @ two)
    residual = one - factor * two
    if float(residual @ residual) > (1.0 - _LEAST_R2) * power:
        return None
    white = float(np.var(residual)) / _BLOCK
    means = residual[: blocks * _BLOCK].reshape(blocks, _BLOCK).mean(axis=1)
    # rounding and the last digit of a text are no structure
    floor = (1e-4 * float(np.sqrt(power / one.size))) ** 2
    if float(np.mean(means**2)) > _EXCESS * white + floor:
        return None
    return round(factor, 12)
