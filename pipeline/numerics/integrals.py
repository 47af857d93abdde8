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
# Between rows farther apart a speed is no straight line: a pause, stated or not.
PAUSE = 10.0


def longest_step_s(t_s: Array, pause_s: float | None = None) -> float:
    """The longest step of a clock over which a speed is integrated.

    Parameters
    ----------
    t_s
        Times [n, s], rising; two or more.
    pause_s
        What is stated: a longer step is a pause of the recorder [s].

    Returns
    -------
    float
        `pause_s`, or ten median steps where nothing is stated [s].

    Examples
    --------
    >>> longest_step_s(np.array([0.0, 0.5, 1.0, 9.0]))
    5.0

    """
    return PAUSE * float(np.median(np.diff(t_s))) if pause_s is None else pause_s


def trapezoid(t_s: Array, y: Array) -> Array:
    """Running integral of samples by straight lines between them, 0 at the first.

    Parameters
    ----------
    t_s
        Times [n, s], rising.
    y
        Samples [n, any unit].

    Returns
    -------
    array [n]
        Unit of y times second.

    Notes
    -----
    It takes (ω h)²/12 off a sine of ω [rad/s] at steps of h [s], and no noise nor gap makes it
    worse than its samples.

    Examples
    --------
    >>> trapezoid(np.array([0.0, 1.0, 2.0]), np.array([0.0, 2.0, 4.0])).tolist()
    [0.0, 1.0, 4.0]

    """
    return np.concatenate([[0.0], np.cumsum(0.5 * (y[1:] + y[:-1]) * np.diff(t_s))])


def cubic(t_s: Array, v: NDArray[Any]) -> NDArray[Any]:
    """Running integral of samples by cubics between them, 0 at the first.

    Parameters
    ----------
    t_s
        Times [n, s], rising; two samples or more.
    v
        Samples [n, any unit], real or complex.

    Returns
    -------
    array [n]
        Unit of v times second.

    Notes
    -----
    A step is that of the cubic with the slopes v' of the parabolas through each sample and its
    neighbours: h (v₀ + v₁)/2 + h² (v₀' − v₁')/12. The trapezoid alone takes (ω h)²/12 off a sine,
    this `REST` (ω h)⁴. Steps longer than `GAP` times the median are trapezoids, for which the
    slopes beside a gap say nothing.

    References
    ----------
    Davis and Rabinowitz, Methods of Numerical Integration, 2nd ed., Academic Press, 1984, 2.9.

    """
    step = np.diff(t_s)
    slope = np.gradient(v, t_s)
    bend = np.where(step < GAP * np.median(step), step**2 / 12.0, 0.0) * (slope[:-1] - slope[1:])
    return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * step + bend)])
