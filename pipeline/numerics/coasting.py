"""Motion of a shaft that coasts under a drag that depends on speed alone."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.numerics.plateaus import Array, true_runs

Deceleration = Callable[[Array], Array]

GRID = 3000
REST, TOP, LEAST_TOP = 0.005, 0.995, 0.05


def coasting_rows(speed: Array) -> list[tuple[slice, int]]:
    """Rows and sense of every coast in a record of speed: the falls from a high speed to rest.

    Parameters
    ----------
    speed
        Smooth speed [n, any unit].

    Returns
    -------
    list of (slice, sense)
        Rows, and +1 or -1; forward coasts first. Empty where the speed is zero throughout.

    Notes
    -----
    A coast ends where the speed falls below `REST` of the fastest of all. It begins in the last row
    within `TOP` of its own highest speed, for the shaft may have been held there before. One whose
    highest speed is below `LEAST_TOP` of the fastest is none.

    """
    fastest = float(np.max(np.abs(speed), initial=0.0))
    if fastest == 0.0:
        return []
    runs = []
    for sense in (1, -1):
        along = speed * sense
        for start, stop in true_runs(along >= REST * fastest):
            top = float(along[start:stop].max())
            if top >= LEAST_TOP * fastest:
                high = np.flatnonzero(along[start:stop] >= TOP * top)
                runs.append((slice(start + int(high[-1]), stop), sense))
    return runs


def coast_down(
    t_s: Array, speed_rad_s: float, deceleration_rad_s2: Deceleration
) -> tuple[Array, Array]:
    """Angle and speed of a shaft that coasts down from a speed.

    Parameters
    ----------
    t_s
        Times since the start [n, s]; at times before it the shaft is where it starts.
    speed_rad_s
        Speed at time 0 [rad/s], above zero.
    deceleration_rad_s2
        D(ω) [m, rad/s²] of speeds [m, rad/s], positive; below 1e-9 of its largest value it is taken
        as that, so that the coast ends.

    Returns
    -------
    angle [n, rad]
        Travelled since time 0.
    speed [n, rad/s]
        0 once the shaft stands.

    Notes
    -----
    dω/dt = −D(ω), so t(ω) = ∫ dω/D and θ(ω) = ∫ ω dω/D from ω up to the start: Simpson's rule on
    `GRID` steps of speed, and cubic Hermite interpolation in time between them, for both
    derivatives are known.

    Examples
    --------
    A constant drag of 2 rad/s² takes 5 s to stop 10 rad/s, within 10 · 5/2 = 25 rad.

    >>> angle, speed = coast_down(np.array([2.5, 9.0]), 10.0, lambda w: np.full(w.size, 2.0))
    >>> np.round(speed, 6).tolist(), np.round(angle, 6).tolist()
    ([5.0, 0.0], [18.75, 25.0])

    """
    grid = np.linspace(speed_rad_s, 0.0, GRID + 1)
    middle = 0.5 * (grid[1:] + grid[:-1])
    width = speed_rad_s / GRID
    at, mid = _inverse(deceleration_rad_s2(grid)), _inverse(deceleration_rad_s2(middle))
    time = _simpson(at, mid, width)
    angle = _simpson(grid * at, middle * mid, width)
    inside = np.clip(t_s, 0.0, time[-1])
    cell = np.clip(np.searchsorted(time, inside, side="right") - 1, 0, GRID - 1)
    step = time[cell + 1] - time[cell]
    x = (inside - time[cell]) / step
    speed = _hermite(x, step, grid[cell], grid[cell + 1], -1.0 / at[cell], -1.0 / at[cell + 1])
    theta = _hermite(x, step, angle[cell], angle[cell + 1], grid[cell], grid[cell + 1])
    return theta, speed


def _inverse(deceleration: Array) -> Array:
    floor = 1e-9 * max(float(np.max(deceleration)), 1e-300)
    return 1.0 / np.maximum(deceleration, floor)


def _simpson(at: Array, mid: Array, width: float) -> Array:
    pieces = width / 6.0 * (at[:-1] + 4.0 * mid + at[1:])
    return np.concatenate([[0.0], np.cumsum(pieces)])


def _hermite(x: Array, step: Array, y0: Array, y1: Array, d0: Array, d1: Array) -> Array:
    return (
        (1.0 + 2.0 * x) * (1.0 - x) ** 2 * y0
        + x * (1.0 - x) ** 2 * step * d0
        + x**2 * (3.0 - 2.0 * x) * y1
        + x**2 * (x - 1.0) * step * d1
    )
