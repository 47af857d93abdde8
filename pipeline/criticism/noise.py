"""How noisy each sensor of a recording is, from the recording itself."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.effect import Array

_BLOCK = 48
_SMOOTH = 21
_BURST = 12.0
_LOOKED_AT = 2000
_STEPS = 600
_TOGETHER = 0.5
_SNAP = 0.06
_QUIET = (0.3, -0.5244)
_STEADY = (0.6, 0.2533)


def sensor_noise(signal: Array, steady: bool = False) -> float:
    """Standard deviation of a signal's white sensor noise [its unit].

    Third differences of white noise have variance 20 σ²; their mean square is taken in blocks
    and a low quantile over the blocks keeps steps and bursts out (a higher one for a `steady`
    signal, an angle, whose rounding comes and goes with its speed). It is never below the rounding
    noise q/√12 of the signal's step q.

    References: [1] von Neumann et al., Ann. Math. Stat. 12 (1941), successive differences; [2]
    Wilson & Hilferty, Proc. Natl. Acad. Sci. 17 (1931); [3] Widrow & Kollar, Quantization Noise
    (2008), ch. 3.
    """
    third = np.diff(signal, 3)
    if third.size == 0:
        return 0.0
    width = min(_BLOCK, third.size)
    blocks = third[: third.size // width * width].reshape(-1, width)
    # Wilson and Hilferty's quantile of chi-square with the samples that third differences leave
    spread = 2.0 / (9.0 * width / 2.2)
    quantile, deviate = _STEADY if steady else _QUIET
    share = (1.0 - spread + deviate * math.sqrt(spread)) ** 3
    power = float(np.quantile((blocks**2).mean(axis=1), quantile))
    level = math.sqrt(power / (20.0 * share))
    return max(level, _rounding(third) / math.sqrt(12.0))


def rounding_error(signal: Array, step: float, shift: float) -> Array:
    """What rounding to multiples of `step` does to a signal [n] like this one [its unit].

    The recorded signal, smoothed, is rounded anew, moved by `shift` steps. Of a steady motion that
    is no white noise: it is a saw-tooth whose beat with the sampling may fall on any order.
    """
    kernel = np.full(_SMOOTH, 1.0 / _SMOOTH)
    padded = np.pad(signal / step, _SMOOTH // 2, mode="reflect", reflect_type="odd")
    smooth = np.convolve(padded, kernel, mode="valid") + shift
    error: Array = (np.round(smooth) - smooth) * step
    return error


def rounding_step(signal: Array) -> float:
    """The step of a signal whose noise is mostly its rounding, 0 of another one [its unit].

    Third differences of a rounded signal are whole steps, so that their phase e^{j2π d/q} stays
    together at the right q, even where a number format has rounded it once more.
    """
    third = np.diff(signal, 3)
    third = third[np.abs(third) < _BURST * np.median(np.abs(third)) + 1e-300]
    spread = float(np.sqrt((third**2).mean())) if third.size >= _BLOCK else 0.0
    if spread == 0.0:
        return 0.0
    sample = third[:: max(third.size // _LOOKED_AT, 1)]
    steps = np.geomspace(0.25 * spread, 2.0 * spread, _STEPS)
    # in single precision, which is several times faster and good to 1e-4 of a turn
    phase = np.outer(2.0 * np.pi / steps, sample).astype(np.float32)
    together = np.hypot(np.cos(phase).mean(axis=1), np.sin(phase).mean(axis=1))
    inner = together[1:-1]
    peaks = 1 + np.flatnonzero((inner >= together[:-2]) & (inner >= together[2:]))
    high = [n for n in peaks if together[n] >= max(0.8 * together[peaks].max(), _TOGETHER)]
    if not high:
        return 0.0
    step = float(steps[high[-1]])
    # an encoder has 2^n steps a turn, or 4 times its lines
    bits = math.log2(2.0 * math.pi / step)
    return 2.0 * math.pi / 2.0 ** round(bits) if abs(bits - round(bits)) < _SNAP else step


def _rounding(third: Array) -> float:
    """The step of a quantised signal: its third differences are whole multiples of it."""
    steps = np.abs(third)
    # what floating point leaves of a zero is no step
    steps = steps[steps > 1e-6 * steps.max()] if steps.size else steps
    if steps.size < 16:
        return 0.0
    step = float(np.quantile(steps, 0.02))
    share = np.abs(steps / step - np.round(steps / step)) < 0.02
    return step if share.mean() > 0.95 else 0.0
