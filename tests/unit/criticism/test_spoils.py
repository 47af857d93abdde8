"""An effect that spoils more of what other captures predict than it mends is not named."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.selection.acceptance import spoils


def after_refit(acts):
    """A system of three groups of ten rows; its newest effect has a column where it `acts`."""
    group = np.repeat(np.arange(3), 10)
    effects = [SimpleNamespace(name="windage")]
    return SimpleNamespace(
        fit=SimpleNamespace(model=SimpleNamespace(effects=effects)),
        columns=[SimpleNamespace(name=n, key=n) for n in ("r_ohm", "windage.drag_nm")],
        matrix=np.column_stack([np.ones(30), np.isin(group, acts).astype(float)]),
        group=group,
        labels=range(3),
        counts=np.full(3, 10.0),
        policy=DEFAULT,
    )


def test_a_large_error_that_grows_weighs_more_than_a_small_one_that_is_halved():
    before, after = np.array([8.0, 40.0, 1.0]), np.array([1.0, 60.0, 1.0])
    assert spoils(after_refit([0, 1, 2]), before, after)
    assert not spoils(after_refit([0, 1, 2]), after, before)


def test_what_it_does_not_act_on_or_moves_a_little_does_not_count():
    before, after = np.array([8.0, 4000.0, 1.0]), np.array([1.0, 4100.0, 1.0])
    assert not spoils(after_refit([0, 1, 2]), before, after)
    assert not spoils(after_refit([0, 2]), before, np.array([1.0, 9000.0, 1.0]))


def test_below_the_floor_nothing_is_spoilt():
    assert not spoils(after_refit([0, 1, 2]), np.full(3, 0.2), np.full(3, 0.9))


def test_what_a_prior_is_relieved_of_counts_too() -> None:
    before, after = np.array([1.0, 1.2, 1.0]), np.array([1.0, 1.5, 1.0])
    added = float(after_refit([0, 1, 2]).counts[1] * 0.3)
    assert spoils(after_refit([0, 1, 2]), before, after, 0.9 * added)
    assert not spoils(after_refit([0, 1, 2]), before, after, 1.1 * added)
