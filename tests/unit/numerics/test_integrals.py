"""Running integrals against closed forms."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.integrals import cubic, trapezoid

T = np.linspace(0.0, 2.0, 201)


def test_straight_lines_are_exact_on_any_clock() -> None:
    t = np.sort(np.random.default_rng(1).uniform(0.0, 2.0, 200))
    exact = 1.5 * (t**2 - t[0] ** 2) - 4.0 * (t - t[0])
    assert trapezoid(t, 3.0 * t - 4.0) == pytest.approx(exact, abs=1e-12)


def test_the_bend_between_two_rows_is_integrated_too() -> None:
    """Trapezoids of a sine are off by (w h)²/12 of it; with the slopes at the ends, h⁴ is left."""
    exact = (1.0 - np.cos(7.0 * T)) / 7.0
    plain = np.abs(trapezoid(T, np.sin(7.0 * T)) - exact).max()
    better = np.abs(cubic(T, np.sin(7.0 * T)) - exact).max()
    assert plain == pytest.approx(2.0 / 7.0 * (7.0 * 0.01) ** 2 / 12.0, rel=0.01)
    assert better < 0.1 * plain


def test_no_bend_is_made_up_across_a_gap() -> None:
    """Slopes at both ends of lost rows say nothing of what lies between: a straight line."""
    keep = (T < 0.5) | (T > 1.2)
    t, v = T[keep], np.sin(7.0 * T[keep])
    last = int(np.flatnonzero(t < 0.5)[-1])
    across = cubic(t, v)[last + 1] - cubic(t, v)[last]
    assert across == pytest.approx(0.5 * (v[last] + v[last + 1]) * (t[last + 1] - t[last]))
