"""The forms of drag are dense enough for what they stand for."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.mechanical.drag_forms import BUMPS, KNOTS, SHAPES
from pipeline.estimation.policy import DEFAULT


def test_chords_between_knots_follow_windage() -> None:
    """Straight lines from knot to knot leave less of a square of speed than counts as a form."""
    speed = np.linspace(0.0, 1.0, 20_001)
    off = np.interp(speed, KNOTS, np.square(KNOTS)) - speed**2
    assert float(np.max(np.abs(off))) == pytest.approx(0.0121, rel=0.01)
    assert float(np.max(np.abs(off))) < DEFAULT.drag.material_share


@pytest.mark.parametrize("shape", SHAPES)
def test_some_width_is_near_any_excess(shape: str) -> None:
    """Halfway between two widths, at worst, 7 % of the excess is left."""
    steps = np.array(BUMPS[1:]) / np.array(BUMPS[:-1])
    assert BUMPS[0] < DEFAULT.shaft_rows.slowest_share < BUMPS[2]
    over_width = np.linspace(0.0, 8.0, 4001)
    between = SHAPES[shape](over_width / np.sqrt(float(steps.max())))
    assert float(np.max(np.abs(SHAPES[shape](over_width) - between))) < 0.072
