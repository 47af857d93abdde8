"""Orders a turn that a fit leaves in logs under load, whether its equations look at them or not.

The weak form looks at the orders that a machine's design gives: what turns with any other averages
out of every window, and would be left over unseen.

Reference: Lomb, Astrophys. Space Sci. 39 (1976), the spectrum of samples that are not even, here
even in time and not in angle; Högbom, Astron. Astrophys. Suppl. 15 (1974), the strongest line taken
out before the next is looked for.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter

from pipeline.criticism.effect import Array
from pipeline.criticism.judge import material_size
from pipeline.criticism.residuals import residual
from pipeline.criticism.segment import Segment
from pipeline.criticism.system import System
from pipeline.numerics.projection import Projection, bump

_HIGHEST = 128
"""Orders looked at: beyond any tooth count times two of the machines here."""
_SAMPLES = 5.0
"""Samples a cycle that an order must have at the mean speed of a part of a log."""
_TURNS = 3.0
"""Turns a part must have for orders to be told apart."""
_PARTS = 8
"""Parts of a log whose spectra are averaged: of eight, noise varies by a third."""
_BESIDE = 12
_STANDS_OUT = 20.0
"""Power over the median of what is beside: of noise averaged over eight parts one in a million has
four."""
_CAPTURES = 2
"""Captures that must have an order: what only one has predicts no other."""
_MOST = 4
"""Orders of one log: each is another fit of the machine, and its harmonics follow the first."""


def orders_left(segments: Sequence[Segment], around: System) -> tuple[int, ...]:
    """Orders that two captures have over what is beside them and in a size that matters, of those
    that no equation looks at.
    """
    found: dict[int, set[str]] = {}
    for segment in segments:
        for order in _of_segment(segment, around):
            found.setdefault(order, set()).add(segment.capture)
    clear = [order for order, captures in found.items() if len(captures) >= _CAPTURES]
    return tuple(sorted(clear))


def _of_segment(segment: Segment, around: System) -> set[int]:
    weak, theta = segment.weak, segment.recorded.get("theta_mech_rad")
    if segment.kind != "dq" or weak is None or theta is None or not (weak.orders > 0).any():
        return set()
    weight = _weight(weak, segment.size)
    parts = list(_parts(theta, weight))
    if not parts:
        return set()
    fitted = around.around
    left = residual(segment, fitted.model, fitted.values)
    found: set[int] = set()
    for channel, one in zip(segment.channels, left, strict=True):
        least = material_size(segment, channel, around)
        for carrier in (np.ones(segment.size), segment.recorded["iq_a"]):
            cut = [Part(*(a[rows] for a in (one, theta, weight, carrier))) for rows in parts]
            found.update(_lines(cut, least))
    return found.difference(weak.orders.tolist())


@dataclass(frozen=True, slots=True)
class Part:
    """Part of a log [n]: what is left of a signal, the shaft's angle, the weight of each sample,
    and what waves of the angle may grow with: nothing, or the current.
    """

    left: Array
    theta_rad: Array
    weight: Array
    carrier: Array

    def spectrum(self, highest: int) -> Array:
        """Mean square of each order from 1 [K]."""
        turn = np.exp(-1j * self.theta_rad)
        carried = self.weight * self.carrier
        wave = carried * self.left + 0j
        power = np.empty(highest)
        for order in range(highest):
            wave *= turn
            power[order] = 2.0 * abs(wave.sum()) ** 2
        scaled: Array = power / max(float(carried @ self.carrier * self.weight.sum()), 1e-300)
        return scaled

    def without(self, order: int) -> Part:
        """The part less its best wave of an order."""
        angle = order * self.theta_rad
        waves = self.carrier * np.stack([np.cos(angle), np.sin(angle)])
        weighted = self.weight * waves
        best = np.linalg.lstsq(weighted @ waves.T, weighted @ self.left, rcond=None)[0]
        return replace(self, left=self.left - best @ waves)


def _weight(weak: Projection, size: int) -> Array:
    """Weight [n] of the samples: the sum of the windows they are in, nothing beside a gap."""
    weight = np.zeros(size)
    shape = bump(weak.length)
    for start in weak.starts.tolist():
        weight[start : start + weak.length] += shape
    return weight


def _parts(theta: Array, weight: Array) -> Iterator[NDArray[np.int64]]:
    """Rows of each of eight parts of a log at most, of three turns or more."""
    rows = np.flatnonzero(weight > 0.0)
    step = np.abs(np.diff(theta[rows], prepend=theta[rows[:1]]))
    # a gap between windows is no turn that anything was seen of
    turned = np.cumsum(np.where(np.diff(rows, prepend=rows[:1] - 1) == 1, step, 0.0))
    count = min(_PARTS, int(turned[-1] / (2.0 * math.pi * _TURNS))) if rows.size else 0
    edges = np.searchsorted(turned, np.linspace(0.0, turned[-1], count + 1)) if count else ()
    for first, last in pairwise(edges):
        yield rows[first:last]


def _lines(parts: Sequence[Part], least: float) -> list[int]:
    """Orders that stand out of the twelve at either side by 20 in power and have an rms over
    `least`; the clearest is taken out before the next is looked for.
    """
    highest = min(_HIGHEST, *(_seen_to(part.theta_rad) for part in parts))
    found: list[int] = []
    while len(found) < _MOST and highest > _BESIDE:
        power = np.mean([part.spectrum(highest) for part in parts], axis=0)
        clear = power / median_filter(power, 2 * _BESIDE + 1, mode="nearest")
        best = int(np.argmax(np.where(power > least**2, clear, 0.0))) + 1
        if power[best - 1] <= least**2 or clear[best - 1] <= _STANDS_OUT:
            break
        found.append(best)
        parts = [part.without(best) for part in parts]
    return found


def _seen_to(theta: Array) -> int:
    """Highest order that has samples enough a cycle."""
    return int(2.0 * math.pi / (_SAMPLES * float(np.median(np.abs(np.diff(theta)))) + 1e-12))
