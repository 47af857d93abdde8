"""Running integrals of sampled signals."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
# What the cubic leaves of a sine's integral, a share of (w h)⁴: its first term of h.
REST = 11.0 / 720.0
# A lost row makes a step twice as long as usual; jitter makes none half as long again.
GAP = 1.5


def trapezoid(t_s: Array, y: Array) -> Array:
    """Running integral [n] of samples y [n] at times t_s [n, s], 0 at the first, by straight lines.

    It takes (w h)²/12 off a sine, and no noise nor gap makes it worse than its samples.
    """
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t_s))])


def cubic(t_s: Array, v: NDArray[Any]) -> NDArray[Any]:
    """Running integral [n] of samples v [n] at times t_s [n, s], 0 at the first.

    A step is that of the cubic with the slopes of the parabolas through each sample and its
    neighbours, h (v0 + v1)/2 + h² (v0' - v1')/12. The trapezoid alone takes (w h)²/12 off a sine,
    this `REST` (w h)⁴. Steps over a gap are trapezoids, for which the slopes beside it say
    nothing. Reference: Davis and Rabinowitz, Methods of Numerical Integration, 2nd ed., 2.9.
    """
    step = np.diff(t_s)
    slope = np.gradient(v, t_s)
    bend = np.where(step < GAP * np.median(step), step**2 / 12.0, 0.0) * (slope[:-1] - slope[1:])
    return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * step + bend)])
