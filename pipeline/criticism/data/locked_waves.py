"""What waves that turn with the rotor leave of the third differences of a signal."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pipeline.criticism.operating import Array

_FLAT = 1e-3
"""Size of a wave's third differences over the largest one's from which on it is in the fit."""
_WHITE = 20.0
"""Variance of third differences over that of white noise."""
_LEAST = 3
"""Third differences a wave that a block has at the least."""


@dataclass(frozen=True, slots=True)
class LockedWaves:
    """Cosine and sine of orders of the rotor's angle, where these turn far from row to row.

    A ripple of four rows a wave has third differences as large as itself, and so looks like noise.
    It is locked to the angle, and noise is not.

    Attributes
    ----------
    third
        Third differences of the waves [n - 3, k].

    """

    third: Array

    @classmethod
    def of(cls, theta_rad: Array, orders: Sequence[float]) -> LockedWaves:
        """The waves of an angle.

        Parameters
        ----------
        theta_rad
            Angle of the rows [n].
        orders
            Waves a turn.

        """
        turned = np.multiply.outer(theta_rad, np.array(orders, dtype=np.float64))
        return cls(np.diff(np.hstack([np.cos(turned), np.sin(turned)]), 3, axis=0))

    def shortest(self) -> int:
        """Third differences of a block at the least."""
        return _LEAST * self.third.shape[1]

    def remainder(self, third: Array, width: int) -> Array:
        """What a fit of the waves to each block leaves.

        Parameters
        ----------
        third
            Third differences of a signal [n - 3, any unit].
        width
            Third differences a block.

        Returns
        -------
        array [whole blocks · width]
            Of white noise with the mean square that its third differences have.

        """
        blocks = third[: third.size // width * width].reshape(-1, width)
        waves = self.third[: blocks.size].reshape(len(blocks), width, -1)
        basis, sizes, _ = np.linalg.svd(waves, full_matrices=False)
        basis = basis * (sizes > _FLAT * sizes[:, :1])[:, None, :]
        left = blocks - np.einsum(
            "bwk,bk->bw", basis, np.einsum("bwk,bw->bk", basis, blocks, optimize=True)
        )
        taken = _noise_along(basis) / (_WHITE * width)
        remainder: Array = (left / np.sqrt(1.0 - taken)[:, None]).ravel()
        return remainder


def _noise_along(basis: Array) -> Array:
    """Variance of white noise's third differences along all columns [b, w, k] of a basis: [b]."""
    kernel = (-1.0, 3.0, -3.0, 1.0)
    spread = sum(
        part * np.pad(basis, ((0, 0), (n, len(kernel) - 1 - n), (0, 0)))
        for n, part in enumerate(kernel)
    )
    power: Array = np.square(spread).sum(axis=(1, 2))
    return power
