"""What an encoder's error is beside its rounding: noise, or that of a mean of readings."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from pipeline.criticism.data.rounding import readings_error, smoothed
from pipeline.criticism.data.sensors import FREE
from pipeline.criticism.operating import Array
from pipeline.criticism.policy.sensors import SensorNoise

_SHIFTS = (-0.375, -0.125, 0.125, 0.375)
_SHARES = np.concatenate([[0.0], 0.0125 * 2.0 ** (0.5 * np.arange(27))])
_BETWEEN = 5
_BLOCKS = 120
"""Parts of a step by which a motion is moved to be rounded anew, evenly spread; trial noises before
the rounding, up to a hundred [steps], and how many lie between the best two; blocks that are looked
at.
"""
_NONE = 1e-3
"""Power of third differences [steps²] that the digits of a file may leave where there is none."""


def readings_and_noise(
    stretches: Sequence[Array], step: float, readings: int, policy: SensorNoise
) -> tuple[int, float]:
    """What an angle was before it was rounded: a mean of coarser readings, or noisy.

    Parameters
    ----------
    stretches
        As recorded [rad], each without a gap.
    step
        Of the samples [rad].
    readings
        Readings a sample that would make its noise; 1 where none are asked for.
    policy
        Constants of judgement.

    Returns
    -------
    readings : int
        As given, where such means predict how large the third differences are in each block better
        than a noise that is the same throughout; else 1.
    noise : float
        Standard deviation [rad] of a single reading's white noise with which the same motion,
        rounded anew, has third differences as large as those that are recorded; 0 of means.

    Notes
    -----
    Without noise the error of a rounding is not white where steps and sampling beat: there its
    third differences may be larger than with some, or less. Means of a motion that crosses steps of
    a reading within a sample have a part of its error, those of one that stays within a step all.

    """
    blocks = _Blocks.of(stretches, step, policy)
    if not blocks.recorded.size:
        return 1, 0.0
    shares = _SHARES[np.argsort([blocks.unlikeness_of_noise(share) for share in _SHARES])[:2]]
    between = np.linspace(shares.min(), shares.max(), _BETWEEN)
    share = float(min(between, key=blocks.unlikeness_of_noise))
    if readings > 1 and blocks.unlikeness_of_means(readings) < blocks.unlikeness_of_noise(share):
        return readings, 0.0
    return 1, step * share


def shared_noise(
    records: Sequence[Sequence[Array]], step: float, alone: Sequence[float], policy: SensorNoise
) -> list[float]:
    """Noise of one encoder in each of its records.

    Parameters
    ----------
    records
        Stretches of each record [rad], each without a gap.
    step
        Of their samples [rad].
    alone
        Noise of each record by itself [rad], by `readings_and_noise`.
    policy
        Constants of judgement.

    Returns
    -------
    list of float
        Standard deviation before the rounding [rad]: that of all records together, where a record's
        own is not likelier by more than `policy.own_noise`. A spin at one speed hardly shows it,
        and a drive at many does.

    """
    everything = [stretch for stretches in records for stretch in stretches]
    _, together = readings_and_noise(everything, step, 1, policy)
    noises = []
    for stretches, own in zip(records, alone, strict=True):
        blocks = _Blocks.of(stretches, step, policy)
        unlike = [blocks.unlikeness_of_noise(noise / step) for noise in (together, own)]
        less = (unlike[0] - unlike[1]) * blocks.recorded.size / FREE
        noises.append(together if less < policy.own_noise else own)
    return noises


@dataclass(frozen=True, slots=True)
class _Blocks:
    """Blocks [B, n] of an angle in steps, evenly spread over its record: as recorded, and as it was
    before its rounding as far as the record shows.
    """

    recorded: Array
    even: Array
    normal: Array
    burst: float

    @classmethod
    def of(cls, stretches: Sequence[Array], step: float, policy: SensorNoise) -> _Blocks:
        """The blocks of a record [rad] without gaps, by its `step` [rad]."""
        noise = _of_differences(stretches, policy) / step
        passing = step * max(math.sqrt(12.0) * noise, 1.0)
        size, pairs = policy.block + 3, []
        for one in stretches:
            pair = np.stack([one, smoothed(one, passing, policy)]) / step
            if one.size >= size:
                pairs.append(sliding_window_view(pair, size, axis=1)[:, :: policy.block])
        if not pairs:
            none = np.zeros((0, size))
            return cls(none, none, none, policy.burst)
        recorded, even = np.concatenate(pairs, axis=1)
        chosen = slice(None, None, max(len(even) // _BLOCKS, 1))
        normal = np.random.default_rng(len(stretches)).normal(size=even[chosen].shape)
        return cls(recorded[chosen], even[chosen], normal, policy.burst)

    def unlikeness_of_noise(self, share: float) -> float:
        """How unlike a noise of a share of a step before the rounding makes the blocks."""
        noisy = self.even + share * self.normal
        return self._unlikeness([np.round(noisy + shift) for shift in _SHIFTS])

    def unlikeness_of_means(self, readings: int) -> float:
        """How unlike means of readings, each in steps of as many of the samples' own, make them."""
        return self._unlikeness(
            [
                self.even + np.apply_along_axis(readings_error, 1, self.even, 1.0, readings, shift)
                for shift in _SHIFTS
            ]
        )

    def _unlikeness(self, made: Sequence[Array]) -> float:
        """Mean deviance of the power of their third differences; a jump is as bad as any."""
        shown = _third_power(self.recorded) + _NONE
        like = np.mean([_third_power(one) for one in made], axis=0) + _NONE
        apart = np.log(like) + np.minimum(shown / like, self.burst)
        return float(apart.mean()) if apart.size else 0.0


def _third_power(blocks: Array) -> Array:
    """Mean square of third differences in each block [B, n]: [B]."""
    power: Array = np.square(np.diff(blocks, 3, axis=1)).mean(axis=1)
    return power


def _of_differences(stretches: Sequence[Array], policy: SensorNoise) -> float:
    """Noise level of an angle by third differences of blocks, none of them across a gap.

    Neighbouring ones of white noise σ² have the covariance −15 σ²; that of a motion is positive.
    """
    blocks = [
        block
        for one in stretches
        for block in np.array_split(np.diff(one, 3), max(one.size // policy.block, 1))
    ]
    powers = [-float(np.mean(block[1:] * block[:-1])) for block in blocks if block.size > 1]
    middle = float(np.quantile(powers, policy.steady[0])) if powers else 0.0
    return math.sqrt(max(middle, 0.0) / 15.0)
