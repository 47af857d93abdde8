"""What waves that turn with the rotor leave of the third differences of a signal."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pipeline.criticism.operating import Array
from pipeline.criticism.policy.sensors import SensorNoise


@dataclass(frozen=True, slots=True)
class LockedWaves:
    """Cosine and sine of orders of the rotor's angle, where these turn far from row to row.

    A ripple of four rows a wave has third differences as large as itself, and so looks like noise.
    It is locked to the angle, and noise is not.

    Attributes
    ----------
    third
        Third differences of the waves [n - 3, k].
    policy
        How many rows a wave needs, and how little it may turn.
    bases
        `basis` of each width that was asked for: all columns of a log need the same.

    """

    third: Array
    policy: SensorNoise
    bases: dict[int, tuple[Array, Array]] = field(default_factory=dict)

    @classmethod
    def of(cls, theta_rad: Array, orders: Sequence[float], policy: SensorNoise) -> LockedWaves:
        """The waves of an angle.

        Parameters
        ----------
        theta_rad
            Angle of the rows [n].
        orders
            Waves a turn.
        policy
            Constants of judgement.

        """
        turned = np.multiply.outer(theta_rad, np.array(orders, dtype=np.float64))
        return cls(np.diff(np.hstack([np.cos(turned), np.sin(turned)]), 3, axis=0), policy)

    def shortest(self) -> int:
        """Third differences of a block at the least."""
        return self.policy.wave_rows * self.third.shape[1]

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
        basis, taken = self.basis(width)
        left = blocks - np.einsum(
            "bwk,bk->bw", basis, np.einsum("bwk,bw->bk", basis, blocks, optimize=True)
        )
        remainder: Array = (left / np.sqrt(1.0 - taken)[:, None]).ravel()
        return remainder

    def basis(self, width: int) -> tuple[Array, Array]:
        """What the waves of each block span, and how much white noise a fit of them takes.

        Parameters
        ----------
        width
            Third differences a block.

        Returns
        -------
        tuple of arrays [blocks, width, k], [blocks]
            Orthonormal columns, zero where the rotor stands still, and the share of the variance of
            the third differences of white noise that lies along them.

        """
        if width not in self.bases:
            blocks = len(self.third) // width
            waves = self.third[: blocks * width].reshape(blocks, width, -1)
            basis, sizes, _ = np.linalg.svd(waves, full_matrices=False)
            basis = basis * (sizes > self.policy.still * sizes[:, :1])[:, None, :]
            # third differences of white noise have 20 times its variance
            self.bases[width] = basis, _noise_along(basis) / (20.0 * width)
        return self.bases[width]


def _noise_along(basis: Array) -> Array:
    """Variance of white noise's third differences along all columns [b, w, k] of a basis: [b]."""
    third = (-1.0, 3.0, -3.0, 1.0)
    spread = sum(part * np.pad(basis, ((0, 0), (n, 3 - n), (0, 0))) for n, part in enumerate(third))
    power: Array = np.square(spread).sum(axis=(1, 2))
    return power
