"""Datasheets of drawn benches hold what is true of their motors, as often as they say."""

from __future__ import annotations

import pytest

from tests.recovery.drawn import Published, published, sound, table


@pytest.fixture(scope="module")
def found() -> list[Published]:
    """Constants of the sound motors of a draw whose logs lost columns or digits."""
    cases = [case for case in sound([12]) if case.programme in ("columns", "digits")]
    return [one for case in cases for one in published(case)]


def test_no_constant_is_off_by_more_than_chance(found: list[Published]) -> None:
    """One in a million of them, where there are some hundred."""
    assert len(found) > 200
    assert [one for one in found if one.chance < 1e-6] == []


def test_intervals_hold_the_truth_as_often_as_they_say(found: list[Published]) -> None:
    """95 %, and within what the constants of thirty motors, which hang together, leave to chance:
    a motor is one draw of its instruments' gains.
    """
    share = sum(one.chance < 0.05 for one in found) / len(found)
    assert share < 0.05 + 3.0 * (0.05 * 0.95 / 30) ** 0.5


def test_the_table_counts_and_lists() -> None:
    near = Published("rows 1, whole", "ld_h", "lcr", 0.5, 0.001, 0.6)
    far = Published("rows 3, jitter", "ld_h", "lcr", 5.0, 0.02, 1e-5)
    made = table([near, far])
    assert "| ld_h | 2 | 0.500" in made
    assert "| rows 3, jitter | ld_h | lcr | +5.0 | +2.00% |" in made
    assert "rows 1" not in made
