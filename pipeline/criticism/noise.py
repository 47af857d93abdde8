"""How noisy each sensor of a recording is, from the recording itself."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.effect import Array

_BLOCK = 128


def sensor_noise(signal: Array) -> float:
    """Standard deviation of a signal's white sensor noise [its unit].

    Third differences of white noise have variance 20 σ²; their rms is taken in blocks and the
    median over the blocks keeps steps and bursts out. It is never below the rounding noise
    q/√12 of the smallest step q that occurs often.

    References: [1] von Neumann et al., Ann. Math. Stat. 12 (1941), mean square of successive
    differences; [2] Widrow & Kollar, Quantization Noise (2008), ch. 3.
    """
    third = np.diff(signal, 3)
    if third.size == 0:
        return 0.0
    width = min(_BLOCK, third.size)
    blocks = third[: third.size // width * width].reshape(-1, width)
    # a median of block mean squares sits below their mean by chi-square's skewness
    middle = (1.0 - 2.0 / (9.0 * width / 2.5)) ** 3
    level = math.sqrt(float(np.median((blocks**2).mean(axis=1))) / (20.0 * middle))
    return max(level, _rounding(third) / math.sqrt(12.0))


def _rounding(third: Array) -> float:
    """The step of a quantised signal: its third differences are whole multiples of it."""
    steps = np.abs(third)
    steps = steps[steps > 0]
    if steps.size < 16:
        return 0.0
    step = float(np.quantile(steps, 0.02))
    share = np.abs(steps / step - np.round(steps / step)) < 0.02
    return step if share.mean() > 0.95 else 0.0
