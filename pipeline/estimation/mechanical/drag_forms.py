"""Forms of drag over speed: windage, Stribeck's excess, and a free curve through knots."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pipeline.numerics.least_squares import Array

# Shares of the highest speed, denser where friction bends. Chords of a square of speed are off by
# a quarter of the square of their width: by 1.2 % of the largest drag at most, within
# `drag.material_share`.
KNOTS = (0.0, 0.03, 0.06, 0.1, 0.16, 0.24, 0.34, 0.46, 0.6, 0.78, 1.0)
# Those from which drag is drawn on to standstill.
LOW_KNOTS = KNOTS[:3]
# Widths of Stribeck's excess, from what the slowest rows resolve (`SLOWEST_SHARE`) to where it is
# as good as viscous drag. A fifth apart, the nearest one is off by 7 % of the excess at most.
BUMPS = tuple(float(f"{0.008 * 1.2**k:.3g}") for k in range(19))
SHAPES: dict[str, Callable[[Array], Array]] = {
    "gauss": lambda x: np.asarray(np.exp(-(x**2))),
    "exponential": lambda x: np.asarray(np.exp(-np.abs(x))),
    "rational": lambda x: np.asarray(1.0 / (1.0 + x**2)),
}
CURVE = tuple(f"knot {k}" for k in range(len(KNOTS)))


def _hat(index: int) -> Callable[[Array], Array]:
    """Odd function of speed that is 1 at one knot and falls linearly to 0 at its neighbours."""
    heights = [1.0 if k == index else 0.0 for k in range(len(KNOTS))]
    return lambda x: np.sign(x) * np.interp(np.abs(x), KNOTS, heights)


def _bump(shape: str, width: float) -> Callable[[Array], Array]:
    """Stribeck's excess in one of the shapes in use (Armstrong-Hélouvry, Control of Machines with
    Friction, 1991, 2.3), falling over a speed `width`.
    """
    return lambda x: np.sign(x) * SHAPES[shape](x / width)


_BUMPS = {f"stribeck {shape} {width:g}": _bump(shape, width) for shape in SHAPES for width in BUMPS}
DRAG_FORMS: dict[str, Callable[[Array], Array]] = {
    "windage": lambda x: x * np.abs(x),
    **_BUMPS,
    **{f"knot {k}": _hat(k) for k in range(len(KNOTS))},
}
STRIBECK = tuple(_BUMPS)
WINDAGE = "windage"
FORMS = (WINDAGE, *STRIBECK)
DRAG_NAMES = ("coulomb", "viscous", *FORMS, *CURVE)
"""Columns of a fit that are drag."""


def low_end(curve: Array, fastest: float) -> tuple[float, float]:
    """Drag extrapolated to standstill from the slowest knots, and the mean slope of the curve.

    Parameters
    ----------
    curve
        Drag at the knots [N·m, or N·m over an inertia].
    fastest
        Highest speed [rad/s].

    Returns
    -------
    level, slope
        In the unit of the curve, and that over rad/s.

    """
    speeds = np.array(KNOTS) * fastest
    level = float(np.polyfit(speeds[: len(LOW_KNOTS)], curve[: len(LOW_KNOTS)], 1)[1])
    slope = float(np.polyfit(speeds, curve, 1)[0])
    return level, slope
