"""How noisy each sensor of a recording is, from the recording itself."""

from __future__ import annotations

import math

import numpy as np

from pipeline.criticism.data.locked_waves import LockedWaves
from pipeline.criticism.data.rounding import step_of_differences
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.sensors import SensorNoise


def sensor_noise(
    signal: Array,
    policy: SensorNoise,
    steady: bool = False,
    waves: LockedWaves | None = None,
) -> float:
    """Standard deviation of a signal's white sensor noise.

    Parameters
    ----------
    signal
        Samples [n, any unit], finite.
    policy
        Constants of judgement.
    steady
        Whether it is an angle, whose rounding comes and goes with its speed.
    waves
        Of the rotor's angle in the same samples, which the signal may contain.

    Returns
    -------
    float
        Unit of the signal; 0 for fewer than four samples. Never below q/√12 of the signal's step q.

    Notes
    -----
    Third differences of white noise have the variance 20 σ². Their mean square is taken in blocks,
    and a low quantile over the blocks keeps steps and bursts out, a higher one for a `steady`
    signal; what a quantile of chi-square is below its mean is made up for. Where shorter blocks
    have far less, the signal steps in most of the longer ones. Where waves of the rotor leave far
    less, they are most of it.

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
    width = min(policy.block, max(third.size // policy.blocks, policy.shortest_block), third.size)
    quantile = policy.steady if steady else policy.quiet
    level = _of_blocks(third, width, quantile)
    if not steady:
        widths = [width >> n for n in range((width // policy.shortest_block).bit_length())]
        clean = min((_of_blocks(third, one, quantile) for one in widths[1:]), default=level)
        level = clean if clean * policy.steps_growth < level else level
        if waves is not None:
            fitted = [one for one in widths if one >= waves.shortest()]
            beside = (_of_blocks(waves.remainder(third, one), one, quantile) for one in fitted)
            clean = min(beside, default=level)
            level = clean if clean * policy.steps_growth < level else level
    return max(level, step_of_differences(third) / math.sqrt(12.0))


def _of_blocks(third: Array, width: int, quantile: tuple[float, ...]) -> float:
    """Standard deviation of white noise whose third differences [n] have the mean square that a
    share of all blocks stays below.
    """
    blocks = third[: third.size // width * width].reshape(-1, width)
    # Wilson and Hilferty's quantile of chi-square with the samples that third differences leave
    spread, (share, deviate) = 2.0 / (9.0 * width / 2.2), quantile
    below = (1.0 - spread + deviate * math.sqrt(spread)) ** 3
    return math.sqrt(float(np.quantile((blocks**2).mean(axis=1), share)) / (20.0 * below))


def slow_noise(signal: Array, longest: float, policy: SensorNoise) -> float:
    """Standard deviation of white noise that is as loud as a signal's is in means of its samples.

    Parameters
    ----------
    signal
        Samples [n, any unit], finite, of a filtered or observed quantity.
    longest
        Samples of a mean at the most.
    policy
        Constants of judgement.

    Returns
    -------
    float
        Unit of the signal; `sensor_noise` where the noise is white.

    Notes
    -----
    What a filter passes of a noise is smooth from sample to sample: third differences of samples
    miss it, and those of means do not. Lengths double until the means show the motion, which grows
    faster than any noise that a loop of second order leaves.

    References
    ----------
    Allan, Proc. IEEE 54(2), 1966, 221, doi:10.1109/PROC.1966.4634 (variances of means).

    """
    loudest = before = sensor_noise(signal, policy)
    length = 2
    while length <= longest and signal.size // length >= policy.block * policy.blocks:
        means = signal[: signal.size // length * length].reshape(-1, length).mean(axis=1)
        level = math.sqrt(length) * sensor_noise(means, policy)
        if level > policy.motion_growth * before:
            break
        loudest, before, length = max(loudest, level), level, 2 * length
    return loudest
