"""The steps that a recording was rounded to, and what it was before."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.criticism.data.traces import parabolas
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.sensors import SensorNoise

_BITS = 6, 24
"""Bits of encoders that are tried, from the first to before the last."""
_LOOKED_AT = 2000
"""Third differences, or samples of a part, that are looked at: enough for a mean to 2 %."""
_STEPS = 600
"""Trial steps, from a quarter to twice the rms third difference, which is 1.3 steps of rounding
alone: 0.35 % apart."""
_FIRST_WINDOW, _WIDER = 32, 4
_PLACES = 16
_SPACING, _FINEST = 0.2, 0.02
_REACH = 1.5
"""Parts of a record that give a step sharper and sharper: samples of the first, and times as many
in the next; number of the parts; spacing of trial steps, at first and at the end, in turns of the
phase over a part; how many spacings they reach around the step before. A lobe of the coherence is
a turn wide: a wider spacing misses it, a finer one costs time."""
_KNOWN = 16
"""Values that two neighbours share from which on their spacing is a step: a drive that is switched
off, or limits its current, shares a few."""
_STAIRS, _ALIKE = 3, 1.5
"""Steps that show that they are alike, and by how much the largest of them may be more: a rounding
to the half of one makes it that.
"""
_DIGITS = 1e-3
"""Share of a step that the digits of a file may leave where there is none."""
_FLOATING = 1e-9
"""Share of a signal's size that is rounding of floating-point numbers."""
_MOST_DECIMALS = 9
"""Decimals of a file that may be seen beside a step."""


def resolution(signal: Array, policy: SensorNoise) -> float:
    """The step that a signal's values are whole multiples of.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    policy
        Constants of judgement.

    Returns
    -------
    float
        The least distance of two values, where `policy.mostly` of all distances are whole
        multiples of it; else 0.

    Notes
    -----
    A rounded signal that came unevenly and was put on an even clock has values between its steps.
    Where two neighbours are the same it has none: the step is that of such values, if there are
    `_KNOWN` of them. Steps that a file has rounded once more are no multiples of any: of values
    that have as many samples each, and distances that are much alike, it is the mean distance.

    """
    values = np.unique(signal)
    same = np.unique(signal[1:][np.diff(signal) == 0.0])
    of_neighbours = _spacing(same, policy) if same.size >= _KNOWN else 0.0
    return _spacing(values, policy) or of_neighbours or _staircase(values, signal.size)


def _staircase(values: Array, samples: int) -> float:
    """The mean distance of ascending values [n] that are evenly apart but for a rounding, where
    there are many samples of each; else 0.
    """
    gaps = _gaps(values)
    if gaps.size < _STAIRS or samples < _KNOWN * values.size or gaps.max() > _ALIKE * gaps.min():
        return 0.0
    return float(gaps.mean())


def _spacing(values: Array, policy: SensorNoise) -> float:
    """The least distance of ascending values [n], of which most are whole multiples; else 0."""
    gaps = _gaps(values)
    if gaps.size == 0:
        return 0.0
    steps = gaps / gaps.min()
    multiples = np.abs(steps - np.round(steps)) < policy.whole
    return float(gaps.min()) if multiples.mean() > policy.mostly else 0.0


def _gaps(values: Array) -> Array:
    """Distances of ascending values [n], without those that floating point makes of equal ones."""
    gaps = np.diff(values)
    return gaps[gaps > _FLOATING * np.abs(values).max(initial=0.0)]


def coarse_step(signal: Array, sigma: float, policy: SensorNoise) -> float:
    """The resolution of a signal that its noise does not dither.

    Parameters
    ----------
    signal
        Samples [n, any unit].
    sigma
        Standard deviation of its noise, that of rounding among it [same unit].
    policy
        Constants of judgement.

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
    step = resolution(signal, policy)
    dithered = (policy.undithered**2 + 1.0 / 12.0) ** -0.5
    return step if step > dithered * sigma else 0.0


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
    return np.interp(np.arange(signal.size), known[order], level[order])


def smoothed(
    signal: Array, step: float, policy: SensorNoise, between: Array | None = None
) -> Array:
    """What a rounded signal was, as far as its samples tell.

    Parameters
    ----------
    signal
        As recorded [n, any unit].
    step
        Of the rounding [same unit].
    policy
        Lengths of the local parabola that smooths it.
    between
        The signal between its steps [n, same unit], which is smoothed instead (`unrounded`).

    Returns
    -------
    array [n]
        Smoothed, part by part, by the longest parabola, up to one for all, that leaves no more
        there than a rounding does, step / √12. A shorter one would keep part of the beat between
        the steps and the sampling, and a longer one loses bends that the signal has: a log that
        creeps and reverses needs both.

    Notes
    -----
    A. Savitzky and M. J. E. Golay, Anal. Chem. 36 (1964) 1627, DOI 10.1021/ac60214a047.

    """
    most = policy.smooth_share * step / math.sqrt(12.0)
    rough = signal if between is None else between
    whole = max(signal.size - 1 + signal.size % 2, 1)
    shortest, *longer = *(n for n in policy.smooth if n < whole), whole
    even = parabolas(rough, shortest)
    starts = np.arange(max(signal.size // policy.smooth_part, 1)) * policy.smooth_part
    sizes = np.diff(starts, append=signal.size)
    for length in longer:
        wider = parabolas(rough, length)
        left = np.add.reduceat((signal - wider) ** 2, starts) / sizes if signal.size else sizes
        even = np.where(np.repeat(left <= most**2, sizes), wider, even)
    return even


def scatter(signal: Array, step: float, policy: SensorNoise) -> float:
    """Standard deviation of a rounded signal about what it was, rounding included.

    Parameters
    ----------
    signal
        As recorded [n, any unit].
    step
        Of the rounding [same unit].
    policy
        Lengths of the local parabola that smooths it, and of blocks.

    Returns
    -------
    float
        [same unit]. Between steps noise is hidden, and third differences miss that part of it.

    """
    off = signal - smoothed(signal, step, policy, unrounded(signal, step))
    count = max(off.size // policy.block, 1)
    noise = math.sqrt(float(np.median([(part**2).mean() for part in np.array_split(off, count)])))
    # a bend that smoothing may leave is no noise
    alone = step / math.sqrt(12.0)
    return min(noise, alone) if noise <= policy.smooth_share * alone else noise


def rounding_error(even: Array, step: float, shift: Array | float) -> Array:
    """What rounding does to a signal.

    Parameters
    ----------
    even
        The signal before it is rounded [n, any unit].
    step
        Of the rounding [same unit].
    shift
        By which it is moved before it is rounded [steps].

    Returns
    -------
    array [n]
        Rounded less smooth [same unit]. Of a steady motion that is no white noise, but a saw-tooth
        whose beat with the sampling may fall on any order.

    """
    moved = even / step + shift
    return (np.round(moved) - moved) * step


def readings_error(even: Array, step: float, readings: int, shift: Array | float) -> Array:
    """What rounding does to samples that are means of readings, taken evenly over each sample.

    Parameters
    ----------
    even
        The signal before it is rounded [n, any unit].
    step
        Of the samples [same unit]; a reading is in steps of `readings` times that.
    readings
        Readings a sample.
    shift
        By which it is moved before it is rounded [steps of a reading].

    Returns
    -------
    array [n]
        Means less smooth [same unit].

    """
    if readings == 1:
        return rounding_error(even, step, shift)
    turned, coarse = np.gradient(even), readings * step
    places = (np.arange(readings) + 0.5) / readings - 0.5
    return np.mean(
        [rounding_error(even + place * turned, coarse, shift) for place in places], axis=0
    )


def rounding_step(signal: Array, policy: SensorNoise) -> float:
    """The step of a signal whose noise is mostly its rounding.

    Parameters
    ----------
    signal
        Samples [n, rad], NaN where a row lacks it; an encoder of 2^n steps a turn, or of whole
        lines, is taken as such.
    policy
        Constants of judgement.

    Returns
    -------
    float
        [rad]; 0 of another signal.

    Notes
    -----
    An encoder of 2^n steps is found at any motion, as its values themselves are multiples of one.
    Of another, third differences d are whole steps q, so that their phase e^{j2πd/q} stays at 1 at
    the right q, even where a number format has rounded it once more. Where a format keeps a number
    of digits, small angles have more decimals: they are looked at first, for multiples of a coarse
    decimal may lie near those of a fraction of q. Parts of the record, longer and longer, give q
    sharply enough to separate 4000 steps a turn from 4096.

    """
    if signal.size < policy.block + 3:
        return 0.0
    known = signal[np.isfinite(signal)]
    binary = (2.0 * math.pi / 2.0**bits for bits in range(*_BITS))
    whole = (step for step in binary if is_rounded(known, step, policy))
    return next(whole, 0.0) or _by_differences(signal, policy)


def _by_differences(signal: Array, policy: SensorNoise) -> float:
    """The step of a signal that moves by some steps from sample to sample, 0 of another."""
    differences = np.diff(signal, 3)
    seen = np.isfinite(differences)
    largest = sliding_window_view(np.abs(signal), 4).max(axis=1)[seen]
    differences, signal = differences[seen], signal[np.isfinite(signal)]
    decades = np.floor(np.log10(np.maximum(largest, _FLOATING)))
    of_decade = {decade: _decimal(largest[decades == decade]) for decade in np.unique(decades)}
    decimals = np.array([of_decade[decade] for decade in decades])
    third = np.empty(0)
    for decimal in np.unique(decimals):
        alike = differences[decimals == decimal]
        third = np.append(third, _beyond_digits(alike, decimal, policy))
        if third.size >= policy.block:
            break
    else:
        return 0.0
    third = third[np.abs(third) < policy.burst * np.median(np.abs(third)) + 1e-300]
    spread = float(np.sqrt((third**2).mean())) if third.size >= policy.block else 0.0
    if spread <= _FLOATING * float(np.abs(signal).max()):
        return 0.0
    sample = third[:: max(third.size // _LOOKED_AT, 1)]
    steps = np.geomspace(0.25 * spread, 2.0 * spread, _STEPS)
    # in single precision, which is several times faster and good to 1e-4 of a turn
    phase = np.outer(2.0 * np.pi / steps, sample).astype(np.float32)
    together = np.cos(phase).mean(axis=1)
    inner = together[1:-1]
    peaks = 1 + np.flatnonzero((inner >= together[:-2]) & (inner >= together[2:]))
    least = max(policy.high * together[peaks].max(initial=0.0), policy.together)
    high = [n for n in peaks if together[n] >= least]
    if not high:
        return 0.0
    step, parts = _borne_out(signal, [float(steps[n]) for n in reversed(high)], policy)
    # an encoder has 2^n steps a turn, or 4 times its lines
    bits = math.log2(2.0 * math.pi / step)
    for count in (2.0 ** round(bits), float(round(2.0**bits))):
        fraction = 2.0 * math.pi / max(count, 1.0)
        if abs(math.log2(max(count, 1.0)) - bits) < policy.snap_octaves:
            coherence = _coherence(parts, np.array([step, fraction]))
            if coherence[1] >= coherence[0] - policy.snap_loss:
                return fraction
    return step


def _beyond_digits(third: Array, decimal: float, policy: SensorNoise) -> Array:
    """Third differences that are more than a file's digits: of a shaft that turns by nearly whole
    steps a sample most are zero, but for those.
    """
    size = np.abs(third)
    beneath, digits = _DIGITS * np.quantile(size, 0.95), 4.0 * decimal
    if np.mean((size > digits) & (size <= 3.0 * digits)) < policy.between:
        beneath = max(beneath, digits)
    return third[size > beneath]


def _decimal(signal: Array) -> float:
    """The last decimal that most values have: a third difference is off by four at most."""
    for decimals in range(_MOST_DECIMALS):
        scaled = signal * 10.0**decimals
        if np.mean(np.abs(scaled - np.round(scaled)) < _FLOATING * 10.0**decimals) > 0.5:
            return float(10.0**-decimals)
    return 0.0


def _borne_out(signal: Array, rough: Sequence[float], policy: SensorNoise) -> tuple[float, Array]:
    """The largest of some rough steps that the signal itself goes in, sharpened, and the parts of
    the signal that do; the largest is the first.

    Its differences may be multiples of more: of two steps, where a shaft turns by half a step more
    or less than whole ones from sample to sample. One that is too rough to be sharpened is tried as
    a multiple of another.
    """
    ends = [_sharpened(signal, step, policy.together) for step in rough]
    step, parts = max(ends, key=lambda end: float(_coherence(end[1], np.array(end[:1]))[0]))
    multiples = step * np.round(np.array(rough) / step)
    multiples = np.append(multiples[multiples > step], step)
    coherence = _coherence(parts, multiples)
    return float(multiples[coherence >= policy.high * coherence[-1]][0]), parts


def _sharpened(signal: Array, step: float, together: float) -> tuple[float, Array]:
    """The step near a rough one of which long parts of the record are whole multiples, and the
    longest parts [parts, samples] that are.

    A part that spans m steps gives the step to 1/m of itself. So the parts grow, and each is
    searched only as far as the one before left the step open. Offsets of the parts are free.
    """
    known = step * math.log(8.0) / _STEPS
    parts = _parts(signal, _FIRST_WINDOW)
    length = _FIRST_WINDOW
    while True:
        wider = _parts(signal, length)
        lobe = step**2 / max(float(np.ptp(wider, axis=1).max()), step)
        best = _best_step(wider, step, known, _SPACING * lobe)
        if float(_coherence(wider, np.array([best]))[0]) < together:
            break
        step, parts, known = best, wider, min(known, _REACH * _SPACING * lobe)
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
    return (parts - parts[:, :1])[span >= np.median(span)]


def _coherence(parts: Array, steps: Array) -> Array:
    """How well the phases e^{j2π x/q} of parts [parts, samples] stay together, for steps q [n]."""
    return np.array(
        [np.abs(np.exp((2j * np.pi / step) * parts).mean(axis=1)).mean() for step in steps]
    )


def is_rounded(signal: Array, step: float, policy: SensorNoise) -> bool:
    """Whether the values of a moving signal are whole multiples of a step, except for a common
    offset.

    Parameters
    ----------
    signal
        Samples [n].
    step
        The step [unit of the signal].
    policy
        How many steps a signal must move through, and how coherent its phase must be.

    """
    if step <= 0.0 or float(np.ptp(signal)) < policy.moving * step:
        return False
    turns = signal / step
    # in single precision, as above
    phase = (2.0 * np.pi * (turns - np.round(turns))).astype(np.float32)
    return math.hypot(np.cos(phase).mean(), np.sin(phase).mean()) > policy.in_step


def step_of_differences(third: Array) -> float:
    """The step that a signal is rounded to: its differences are whole multiples of it.

    Parameters
    ----------
    third
        Third differences of its samples [n, any unit].

    Returns
    -------
    float
        [same unit]; 0 where most are no multiples of one step, or too few differ from zero.

    """
    steps = np.abs(third)
    # what floating point, or the digits of a file, leave of a zero is no step
    steps = steps[steps > _DIGITS * np.quantile(steps, 0.95)] if steps.size else steps
    if steps.size < 16:
        return 0.0
    step = float(np.quantile(steps, 0.02))
    share = np.abs(steps / step - np.round(steps / step)) < 0.02
    return step if share.mean() > 0.95 else 0.0
