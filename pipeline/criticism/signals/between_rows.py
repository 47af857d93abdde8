"""Currents between the rows of a log in which the rotor turns far from row to row.

Three equal phases make waves of 6 and 12 a turn of the electrical angle in the currents of the
rotor's frame: harmonics of the back-EMF do, and dead time. Where the rotor turns by a radian from
row to row, a straight line between rows misses them. But the angle of every row is known, and ever
another one: some dozens of rows determine the waves.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Self

import numpy as np

from pipeline.criticism.data.segment import Segment, joins
from pipeline.criticism.operating import Array, Complex, Flags, Indices
from pipeline.criticism.policy.machine import Ripple

ORDERS = (6, 12)
"""Waves a turn of the electrical angle; the winding's inductance leaves little of higher ones."""


def on_points(signal: Complex, size: int) -> Complex:
    """A signal at one or more points a sample, on straight lines between samples.

    Parameters
    ----------
    signal
        At the samples [n, any unit].
    size
        Points wanted, a multiple of n.

    Returns
    -------
    array [size]
        The last sample is held.

    """
    return signal if signal.size == size else at_parts(signal, evenly(size // signal.size))


def evenly(points: int) -> tuple[float, ...]:
    """Where so many points are behind a sample [samples]."""
    return tuple(n / points for n in range(points))


def at_parts(signal: Complex, parts: Sequence[float]) -> Complex:
    """A signal at parts of a sample behind each sample, on straight lines between samples.

    Parameters
    ----------
    signal
        At the samples [n, any unit].
    parts
        Of a sample, negative before it [p].

    Returns
    -------
    array [n p]
        By sample; what is before the first or behind the last is held.

    """
    samples = np.arange(signal.size)
    return np.interp((samples[:, None] + np.array(parts)).ravel(), samples, signal)


@dataclass(frozen=True, slots=True)
class Waves:
    """The waves of a log's current, block of rows by block: what they add to straight lines.

    Attributes
    ----------
    rows
        Rows [b, w] that determine the waves of each block.
    fit
        Size of each wave by the current of these rows [b, k, w].
    places
        Points [b, p] of each block, of as many a row as it was made for.
    beyond
        Of each wave the part [b, p, k] that straight lines between rows miss.
    slow
        Which orders [b, o] look like a slow current in the rows of a block: of their size there
        these rows show nothing.
    points
        Of a row.

    """

    rows: Indices
    fit: Array
    places: Indices
    beyond: Array
    slow: Flags
    points: int

    @classmethod
    def of(
        cls,
        segment: Segment,
        current: Complex,
        eps_rad: Array,
        parts: Sequence[float],
        policy: Ripple,
    ) -> Self:
        """The waves of a log.

        Parameters
        ----------
        segment
            Its clock; nothing is taken across a gap.
        current
            Of the rows [n, A]: how much of it are waves.
        eps_rad
            Electrical angle of the rows [n].
        parts
            Where its points are behind each row [rows].
        policy
            Rows a block, and how much waves have to predict.

        Notes
        -----
        By least squares beside cosines of time: a wave whose rows come at phases that move on
        slowly is no other than a slow current. Where most of it is one, what is left of it would
        need any size to be a step of the current.

        """
        width, step = policy.rows, policy.rows // 4
        blocks = [
            (first, min(max(first - (width - step) // 2, start), end - width), start, end)
            for start, end in _runs(segment, eps_rad.size)
            if end - start >= width
            for first in range(start, end, step)
        ]
        firsts, lows, starts, ends = np.array(blocks, dtype=np.int64).reshape(-1, 4).T[:, :, None]
        rows = lows + np.arange(width)
        waves = _waves(eps_rad[rows])
        halves = np.arange(round(2.0 * policy.slow * width))
        slow, _ = np.linalg.qr(np.cos(np.pi / width * np.outer(np.arange(width) + 0.5, halves)))
        apart = waves - slow @ (slow.T @ waves)
        shown = _fast_shares(waves, apart) > policy.fast_share
        apart *= shown[:, None, :]
        fast = current[rows] - (current[rows] @ slow) @ slow.T
        fit = _fitted(apart, fast, policy.predicted)
        row, part = np.divmod(np.arange(step * len(parts)), len(parts))
        own = np.minimum(firsts + row, ends - 1)
        at = np.clip(own + np.array(parts)[part], starts, ends - 1)
        before = np.minimum(at.astype(np.int64), ends - 2)
        share = (at - before)[:, :, None]
        eps = np.interp(at, np.arange(eps_rad.size), eps_rad)
        straight = (1.0 - share) * _waves(eps_rad[before]) + share * _waves(eps_rad[before + 1])
        places, unshown = len(parts) * own + part, ~shown[:, : len(ORDERS)]
        return cls(rows, fit, places, _waves(eps) - straight, unshown, len(parts))

    def added(self, current: Complex, size: int) -> Complex:
        """What the waves add to straight lines.

        Parameters
        ----------
        current
            At the rows [n, A].
        size
            Points.

        Returns
        -------
        array [size], complex
            In A; zero where too few rows are in a run.

        """
        total = np.zeros(size, dtype=np.complex128)
        total[self.places] = (self.beyond @ (self.fit @ current[self.rows][:, :, None]))[:, :, 0]
        return total

    def unseen(self, current: Complex, size: int) -> Complex:
        """What waves may add where the rows do not show how large they are.

        Parameters
        ----------
        current
            At the rows [n, A].
        size
            Points.

        Returns
        -------
        array [o, size], complex
            Of each order, in A of the q axis, times a phase that is not known: as large as it is
            in the mean of the blocks of the log that show it.

        """
        level = self._level(current)
        total = np.zeros((len(ORDERS), size), dtype=np.complex128)
        for order, one in enumerate(total):
            wave = self.beyond[:, :, order] + 1j * self.beyond[:, :, order + len(ORDERS)]
            one[self.places] = level[order] * self.slow[:, order, None] * wave
        return total

    def unseen_slopes(self, current: Complex, eps_rad: Array) -> Complex:
        """How fast waves may change the current where the rows do not show how large they are.

        Parameters
        ----------
        current
            At the rows [n, A].
        eps_rad
            Electrical angle of the rows [n].

        Returns
        -------
        array [o, n], complex
            Of each order, in A a row of the q axis, times a phase that is not known.

        """
        slow = np.zeros((len(ORDERS), eps_rad.size))
        slow[:, self.places // self.points] = self.slow.T[:, :, None]
        turning = np.array(ORDERS)[:, None] * np.gradient(eps_rad) * slow
        slopes: Complex = (
            self._level(current)[:, None]
            * turning
            * np.exp(1j * np.multiply.outer(ORDERS, eps_rad))
        )
        return slopes

    def _level(self, current: Complex) -> Array:
        """Size [o, A] of each order in the q axis: its mean over the blocks that show it."""
        sizes = (self.fit @ current[self.rows][:, :, None]).imag[:, :, 0]
        power = (sizes**2).reshape(-1, 2, len(ORDERS)).sum(1)
        there = np.any(self.fit, axis=(1, 2))[:, None] & ~self.slow
        level: Array = np.sqrt((power * there).sum(0) / np.maximum(there.sum(0), 1))
        return level


def _fast_shares(waves: Array, apart: Array) -> Array:
    """Share [b, k] of each order's power in its rows [b, w, k] that is `apart` from the slow."""
    order = np.tile(np.arange(len(ORDERS)), 2)
    same = (order[:, None] == order).astype(float)
    power, left = (np.einsum("bwk,bwk->bk", part, part) @ same for part in (waves, apart))
    return left / np.maximum(power, 1e-300)


def _fitted(apart: Array, fast: Complex, least: float) -> Array:
    """Regression [b, k, w] of waves on the current of the rows of each block.

    `apart` are the waves [b, w, k] less what is slow in them, `fast` the current [b, w, A] alike.
    The ridge is what the rows leave over the power of the waves. Without it, waves that come to
    nearly the same phase in every row would be anything. Blocks whose waves, fitted to three
    quarters of the rows, predict less than a share `least` of the other one's power have none: a
    step of the current makes waves as well, and other ones elsewhere.
    """
    width, waves = apart.shape[1:]
    across, columns, one = np.swapaxes(apart, 1, 2), fast[:, :, None], np.eye(waves)
    gram, moments = across @ apart, across @ columns
    left = columns - apart @ (np.linalg.pinv(gram, hermitian=True) @ moments)
    noise = _power(left) / (width - waves)
    missed = np.zeros(len(apart))
    for part in np.array_split(np.arange(width), 4):
        one_out, out = across[:, :, part], columns[:, part]
        others = np.linalg.pinv(gram - one_out @ apart[:, part], hermitian=True)
        missed += _power(out - apart[:, part] @ (others @ (moments - one_out @ out)))
    there = missed < (1.0 - least) * _power(columns)
    power = _power(columns - left)[there] / np.trace(gram[there], axis1=1, axis2=2)
    ridge = (noise[there] / power)[:, None, None] * one
    fit = np.zeros(across.shape)
    fit[there] = np.linalg.solve(gram[there] + ridge, across[there])
    return fit


def _power(signal: Complex) -> Array:
    """Sum of squares [b] of a signal [b, w, 1]."""
    power: Array = (np.abs(signal) ** 2).sum((1, 2))
    return power


def _waves(eps_rad: Array) -> Array:
    """Cosine and sine of each order at angles [b, n]: [b, n, k]."""
    turning = eps_rad[:, :, None] * np.array(ORDERS)
    return np.concatenate([np.cos(turning), np.sin(turning)], axis=2)


def _runs(segment: Segment, size: int) -> list[tuple[int, int]]:
    """First row of each run of rows without a gap, and the one behind its last."""
    return list(pairwise([0, *joins(segment).tolist(), size]))
