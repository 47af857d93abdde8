"""Cogging orders of known machines."""

from __future__ import annotations

import pytest

from pipeline.physics.mechanics import cogging_order


@pytest.mark.parametrize(
    ("slots", "pole_pairs", "order"), [(12, 7, 84), (18, 12, 72), (12, 5, 60), (9, 3, 18)]
)
def test_cogging_order(slots: int, pole_pairs: int, order: int) -> None:
    assert cogging_order(slots, pole_pairs) == order
