"""How noisy each sensor of a recording is, from the recording itself."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.effect import Array

_BLOCK = 48
"""Samples of a block of third differences. By judgement: shorter ones scatter more, longer ones
are seldom free of steps and bursts."""
_QUIET, _STEADY = (0.3, -0.5244), (0.6, 0.2533)
"""Quantile over the blocks, and the normal variable's value there: a low one, since steps and
bursts only add; of an angle a higher one, since its rounding comes and goes."""
_SMOOTH = 21
"""Samples of the mean of a rounded signal that is rounded anew. By judgement: of a few it still is
a stair, of many its bends are lost."""
_BURST = 12.0
"""Times the median third difference, above which one is a jump and not the rounding."""
_LOOKED_AT = 2000
"""Third differences, or samples of a part, that are looked at: enough for a mean to 2 %."""
_STEPS = 600
"""Trial steps, from a quarter to twice the rms third difference, which is 1.3 steps of rounding
alone: 0.35 % apart."""
_TOGETHER = 0.5
"""Coherence of the phase below which there is no step; noise of 0.04 steps, added after the
rounding, comes to it."""
_HIGH = 0.9
"""Share of the highest coherence that a larger step needs to be preferred: a peak at 1.5 steps has
0.82 at a slow steady speed."""
_SNAP, _AS_GOOD = 0.06, 0.01
"""A whole number of steps a turn is taken within so many octaves, and if it loses no more of the
coherence. The first is 4 %, by judgement; 2000 counts are 0.034 from 2048, so that the coherence
has to tell them apart."""
_FIRST_WINDOW, _WIDER = 32, 4
_PLACES = 16
_SPACING, _FINEST = 0.2, 0.02
_REACH = 1.5
"""Parts of a record that tell a step sharper and sharper: samples of the first, and times as many
in the next; number of the parts; spacing of trial steps, at first and at the end, in turns of the
phase over a part; how many spacings they reach around the step before. A lobe of the coherence is
a turn wide: a wider spacing misses it, a finer one costs time."""
_FLOATING = 1e-9
"""Share of a signal's size that is rounding of floating-point numbers."""
_WHOLE, _MOSTLY = 0.05, 0.95
"""How near to a whole number [steps], and what share of all distances must be so, for a signal to
have a resolution. By judgement: distances of no step come so near one time in ten."""
_UNDITHERED = (0.45**2 + 1.0 / 12.0) ** -0.5
"""Steps over noise, rounding in it, where the noise itself is 0.45 steps."""
_MOVING, _IN_STEP = 16.0, 0.9
"""Steps that an angle must move by, and coherence that it then needs, to be in such steps. By
judgement: one that stands still is in step with anything."""


def sensor_noise(signal: Array, steady: bool = False) -> float:
    """Standard deviation of a signal's white sensor noise.

    Parameters
    ----------
    signal
        Samples [n, any unit], finite.
    steady
        Whether it is an angle, whose rounding comes and goes with its speed.

    Returns
    -------
    float
        Unit of the signal; 0 for fewer than four samples. Never below q/√12 of the signal's step q.

    Notes
    -----
    Third differences of white noise have the variance 20 σ². Their mean square is taken in blocks,
    and a low quantile over the blocks keeps steps and bursts out, a higher one for a `steady`
    signal; what a quantile of chi-square is below its mean is made up for.

    References
    ----------
    von Neumann, Kent, Bellinson and Hart, Ann. Math. Statist. 12(2), 1941, 153 (successive
    differences), doi:10.1214/aoms/1177731746.
    Wilson and Hilferty, Proc. Natl. Acad. Sci. 17(12), 1931, 684, doi:10.1073/pnas.17.12.684.
    Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, ch. 3.

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


def resolution(signal: Array) -> float:
    """The step that a signal's values are whole multiples of.

    Parameters
    ----------
    signal
        Samples [n, any unit].

    Returns
    -------
    float
        The least distance of two values, where `_MOSTLY` of all distances are whole multiples of
        it; else 0.

    """
    gaps = np.diff(np.unique(signal))
    # what floating point makes of equal numbers is no step
    gaps = gaps[gaps > _FLOATING * np.abs(signal).max(initial=0.0)]
    if gaps.size == 0:
        return 0.0
    steps = gaps / gaps.min()
    whole = np.abs(steps - np.round(steps)) < _WHOLE
    return float(gaps.min()) if whole.mean() > _MOSTLY else 0.0


def coarse_step(signal: Array, sigma: float) -> float:
    """The resolution of a signal that its noise does not dither.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    sigma
        Standard deviation of its noise, that of rounding among it [same unit].

    Returns
    -------
    float
        [same unit]; 0 where there is no step, or noise of 0.45 steps or more.

    Notes
    -----
    Less noise leaves a part of the rounding error that follows the signal, and does not average
    out.

    References
    ----------
    Widrow and Kollar, Quantization Noise, Cambridge University Press, 2008, ch. 19.

    """
    step = resolution(signal)
    return step if step > _UNDITHERED * sigma else 0.0


def unrounded(signal: Array, step: float) -> Array:
    """What a slow signal may have been before it was rounded.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    step
        Step of the rounding [same unit].

    Returns
    -------
    array [n]
        Where the signal changes by a single step it stood half way between the two; it is straight
        from one such place to the next. Around larger changes it stays as it is.

    """
    change = np.diff(signal)
    at = np.flatnonzero(change)
    single = np.abs(change[at]) < 1.5 * step
    slow, far = at[single], at[~single]
    known = np.concatenate([slow + 0.5, far, far + 1.0, [0.0, signal.size - 1.0]])
    middle = 0.5 * (signal[slow] + signal[slow + 1])
    level = np.concatenate([middle, signal[far], signal[far + 1], signal[[0, -1]]])
    order = np.argsort(known, kind="stable")
    found: Array = np.interp(np.arange(signal.size), known[order], level[order])
    return found


def rounding_error(signal: Array, step: float, shift: float) -> Array:
    """What rounding does to a signal like this one.

    Parameters
    ----------
    signal
        As recorded [n, any unit].
    step
        Of the rounding [same unit].
    shift
        By which the smoothed signal is moved before it is rounded anew [steps].

    Returns
    -------
    array [n]
        Rounded less smooth [same unit]. Of a steady motion that is no white noise, but a saw-tooth
        whose beat with the sampling may fall on any order.

    """
    kernel = np.full(_SMOOTH, 1.0 / _SMOOTH)
    padded = np.pad(signal / step, _SMOOTH // 2, mode="reflect", reflect_type="odd")
    smooth = np.convolve(padded, kernel, mode="valid") + shift
    error: Array = (np.round(smooth) - smooth) * step
    return error


def rounding_step(signal: Array) -> float:
    """The step of a signal whose noise is mostly its rounding.

    Parameters
    ----------
    signal
        Samples [n, rad]; an encoder of 2^n steps a turn, or of whole lines, is taken as such.

    Returns
    -------
    float
        [rad]; 0 of another signal.

    Notes
    -----
    Third differences d of a rounded signal are whole steps q, so that their phase e^{j2πd/q} stays
    together at the right q, even where a number format has rounded it once more. Parts of the
    record, longer and longer, tell q sharply enough to separate 4000 steps a turn from 4096.

    """
    signal = signal[np.isfinite(signal)]
    third = np.diff(signal, 3)
    if third.size < _BLOCK:
        return 0.0
    third = third[np.abs(third) < _BURST * np.median(np.abs(third)) + 1e-300]
    spread = float(np.sqrt((third**2).mean())) if third.size >= _BLOCK else 0.0
    if spread <= _FLOATING * float(np.abs(signal).max()):
        return 0.0
    sample = third[:: max(third.size // _LOOKED_AT, 1)]
    steps = np.geomspace(0.25 * spread, 2.0 * spread, _STEPS)
    # in single precision, which is several times faster and good to 1e-4 of a turn
    phase = np.outer(2.0 * np.pi / steps, sample).astype(np.float32)
    together = np.hypot(np.cos(phase).mean(axis=1), np.sin(phase).mean(axis=1))
    inner = together[1:-1]
    peaks = 1 + np.flatnonzero((inner >= together[:-2]) & (inner >= together[2:]))
    high = [n for n in peaks if together[n] >= max(_HIGH * together[peaks].max(), _TOGETHER)]
    if not high:
        return 0.0
    step, parts = _sharpened(signal, float(steps[high[-1]]))
    # an encoder has 2^n steps a turn, or 4 times its lines
    bits = math.log2(2.0 * math.pi / step)
    for count in (2.0 ** round(bits), float(round(2.0**bits))):
        whole = 2.0 * math.pi / max(count, 1.0)
        if abs(math.log2(max(count, 1.0)) - bits) < _SNAP:
            both = _coherence(parts, np.array([step, whole]))
            if both[1] >= both[0] - _AS_GOOD:
                return whole
    return step


def _sharpened(signal: Array, step: float) -> tuple[float, Array]:
    """The step near a rough one of which long parts of the record are whole multiples, and the
    longest parts [parts, samples] that are.

    A part that spans m steps tells the step to 1/m of itself. So the parts grow, and each is
    searched only as far as the one before left the step open. Offsets of the parts are free.
    """
    known = step * math.log(8.0) / _STEPS
    parts = _parts(signal, _FIRST_WINDOW)
    length = _FIRST_WINDOW
    while True:
        wider = _parts(signal, length)
        lobe = step**2 / max(float(np.ptp(wider, axis=1).max()), step)
        found = _best_step(wider, step, known, _SPACING * lobe)
        if float(_coherence(wider, np.array([found]))[0]) < _TOGETHER:
            break
        step, parts, known = found, wider, min(known, _REACH * _SPACING * lobe)
        if length >= signal.size:
            break
        length = min(_WIDER * length, signal.size)
    lobe = step**2 / max(float(np.ptp(parts, axis=1).max()), step)
    return _best_step(parts, step, min(known, _SPACING * lobe), _FINEST * lobe), parts


def _best_step(parts: Array, step: float, reach: float, spacing: float) -> float:
    """The most coherent of the trial steps around one, which are some `_STEPS` at most."""
    count = min(math.ceil(reach / spacing), _STEPS // 2)
    trials = step + spacing * np.arange(-count, count + 1, dtype=np.float64)
    # of equals, the nearest
    trials = trials[np.argsort(np.abs(trials - step), kind="stable")]
    return float(trials[np.argmax(_coherence(parts, trials))])


def _parts(signal: Array, length: int) -> Array:
    """Parts [parts, samples] of a signal less their first sample: the half that spans most."""
    length = min(length, signal.size)
    starts = np.unique(np.linspace(0, signal.size - length, _PLACES).round().astype(np.int64))
    inside = np.linspace(0, length - 1, min(length, _LOOKED_AT // starts.size))
    parts = signal[starts[:, None] + inside.round().astype(np.int64)]
    span = np.ptp(parts, axis=1)
    wide: Array = (parts - parts[:, :1])[span >= np.median(span)]
    return wide


def _coherence(parts: Array, steps: Array) -> Array:
    """How well the phases e^{j2π x/q} of parts [parts, samples] stay together, for steps q [n]."""
    found: Array = np.array(
        [np.abs(np.exp((2j * np.pi / step) * parts).mean(axis=1)).mean() for step in steps]
    )
    return found


def is_rounded(signal: Array, step: float) -> bool:
    """Whether a moving signal's values are whole multiples of a step, but for a common offset."""
    if step <= 0.0 or float(np.ptp(signal)) < _MOVING * step:
        return False
    return abs(complex(np.exp(2j * np.pi / step * signal).mean())) > _IN_STEP


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
