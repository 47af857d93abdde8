"""What rounding to a converter's steps does to a reading, beyond white noise.

The mean of Q(x + n), n of standard deviation s, is off x by Σ_k (-1)^k q/(πk) sin(2πkx/q)
exp(-2π²k²s²/q²): noise of half a step hides it, and without noise all samples of a steady level are
off by the same part of a step, however many they are. Over all x its mean square is
q²/(2π²) Σ_k exp(-4π²k²s²/q²)/k², q²/12 without noise.

Reference: Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, 4.
"""

from __future__ import annotations

import math

import numpy as np

from pipeline.records.capture import Array

_K = np.arange(1.0, 65.0)


def resolution(signal: Array) -> float:
    """The step of a converter: the least spacing of a signal's values.

    Parameters
    ----------
    signal
        Readings [n, any unit]; those that are not finite are left out.

    Returns
    -------
    float
        Step q in the unit of the signal; 0 where all values are one.

    Notes
    -----
    Spacings below 1e-7 of the span are rounding of a sum of channels, not steps. Readings of a
    continuous channel have a least spacing too: that it is a step has to show elsewhere.

    Examples
    --------
    >>> resolution(np.array([0.5, 1.5, 1.0, 3.0]))
    0.5

    """
    values = np.unique(signal[np.isfinite(signal)])
    spacing = np.diff(values)
    spacing = spacing[spacing > 1e-7 * float(np.ptp(values))] if values.size > 1 else spacing
    return float(spacing.min()) if spacing.size else 0.0


def rounding_rms(step: float, sigma: float) -> float:
    """Root mean square of what rounding leaves in the mean of many samples of one level.

    Parameters
    ----------
    step
        Step q of the converter [any unit].
    sigma
        Standard deviation of the noise before the converter [same unit].

    Returns
    -------
    float
        [same unit], over all levels alike: q/√12 without noise, next to none at half a step of
        noise.

    Notes
    -----
    q²/(2π²) Σ_k exp(−4π² k² σ²/q²)/k², its square.

    References
    ----------
    Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, ch. 4.

    Examples
    --------
    >>> round(rounding_rms(1.0, 0.0) * math.sqrt(12.0), 2), round(rounding_rms(1.0, 0.5), 4)
    (1.0, 0.0016)

    """
    if step <= 0.0:
        return 0.0
    terms = np.exp(-((2.0 * math.pi * _K * sigma / step) ** 2)) / _K**2
    return step * math.sqrt(float(terms.sum()) / 2.0) / math.pi


def noise_after_rounding(signal: Array, step: float) -> float:
    """Standard deviation of the sample-to-sample scatter of a rounded signal.

    Parameters
    ----------
    signal
        Readings [n, any unit]; those that are not finite are left out.
    step
        Step of the converter [same unit].

    Returns
    -------
    float
        [same unit]; 0 for fewer than six samples.

    Notes
    -----
    Second differences have the variance 6 s². The mean square is taken of those below eight of
    their standard deviations, itself taken as one step at least: a median would be 0 or a whole
    step where the noise is less than a step.

    """
    second = np.diff(signal[np.isfinite(signal)], n=2)
    if second.size < 4:
        return 0.0
    usual = float(np.median(np.abs(second))) / 0.6744897501960817
    inner = second[np.abs(second) <= 8.0 * max(usual, step)]
    return math.sqrt(float(np.mean(inner**2)) / 6.0) if inner.size else 0.0


def noise_before_rounding(sigma: float, step: float) -> float:
    """The noise before a converter that scatters by a given amount after it.

    Parameters
    ----------
    sigma
        Standard deviation of the readings' scatter [any unit].
    step
        Step q of the converter [same unit]; 0 where there is none.

    Returns
    -------
    float
        Standard deviation [same unit], over all levels alike; 0 where rounding alone explains it.

    Notes
    -----
    s_after² = s² + q²/12 − (mean square of the means' error, see `rounding_rms`), which is 0
    without noise, solved for s.

    """
    if step <= 0.0 or sigma >= 2.0 * step:
        return math.sqrt(max(sigma**2 - step**2 / 12.0, 0.0))
    trial = np.linspace(0.0, 2.1, 421)
    means = np.exp(-((2.0 * math.pi * _K[:, None] * trial) ** 2)) / _K[:, None] ** 2
    after = trial**2 + 1.0 / 12.0 - means.sum(axis=0) / (2.0 * math.pi**2)
    return step * float(np.interp((sigma / step) ** 2, np.maximum.accumulate(after), trial))
