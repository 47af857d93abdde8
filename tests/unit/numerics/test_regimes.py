"""What a machine was doing, told from speed and current."""

from __future__ import annotations

import numpy as np

from pipeline.numerics.regimes import (
    GENERATING,
    LOCKED,
    MOTORING,
    REST,
    UNPOWERED,
    regimes,
    stretches,
)

N = 10_000


def test_four_quadrants_and_standstill_in_their_order() -> None:
    """Current with the speed motors, against it generates, in both senses of rotation."""
    speed = np.repeat([0.0, 0.0, 100.0, 100.0, -100.0, -100.0, 100.0], N)
    current = np.repeat([0.0, 5.0, 5.0, -5.0, -5.0, 5.0, 0.0], N)
    told = regimes(speed, current)
    assert [one.state for one in told] == [
        REST,
        LOCKED,
        MOTORING,
        GENERATING,
        MOTORING,
        GENERATING,
        UNPOWERED,
    ]
    assert np.abs(np.array([one.start for one in told]) - N * np.arange(7)).max() <= 7 * N / 2000


def test_noise_around_a_threshold_makes_no_confetti() -> None:
    rng = np.random.default_rng(2)
    speed = np.concatenate([rng.normal(0.0, 1.0, N), np.full(N, 100.0)])
    told = regimes(speed, np.full(2 * N, 3.0))
    assert [one.state for one in told] == [LOCKED, MOTORING]


def test_missing_values_are_standstill_and_an_empty_record_has_none() -> None:
    nothing = np.full(50, np.nan)
    assert [one.state for one in regimes(nothing, nothing)] == [REST]
    assert regimes(np.zeros(0), np.zeros(0)) == ()


def test_an_infinite_reading_hides_no_other() -> None:
    speed, current = np.full(50, 10.0), np.full(50, 2.0)
    speed[3], current[4] = np.inf, -np.inf
    assert MOTORING in [one.state for one in regimes(speed, current)]


def test_a_stretch_that_is_too_short_joins_the_one_before() -> None:
    states = np.array([*"aaabaaacc"])
    starts = 10 * np.arange(9)
    assert [(s.start, s.state) for s in stretches(states, starts, 2)] == [(0, "a"), (70, "c")]
    assert [(s.start, s.state) for s in stretches(states, starts)] == [
        (0, "a"),
        (30, "b"),
        (40, "a"),
        (70, "c"),
    ]


def test_rest_is_a_hundredth_of_the_speed_and_no_current_three_hundredths() -> None:
    """Just inside and just outside each of the two shares, in either sense."""
    speed = np.repeat([100.0, 0.98, 1.02, -0.98, -1.02], N)
    assert [one.state for one in regimes(speed, np.full(5 * N, 1.0))] == [
        MOTORING,
        LOCKED,
        MOTORING,
        LOCKED,
        GENERATING,
    ]
    current = np.repeat([10.0, 0.29, 0.31, -0.29, -0.31], N)
    assert [one.state for one in regimes(np.full(5 * N, 1.0), current)] == [
        MOTORING,
        UNPOWERED,
        MOTORING,
        UNPOWERED,
        GENERATING,
    ]


def test_a_short_record_is_told_row_by_row() -> None:
    """Ten rows or fewer are ten blocks; of eleven, stretches below three blocks join the last."""
    speed = np.array([0.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0, 5.0])
    told = regimes(speed, np.ones(10))
    assert [(one.start, one.state) for one in told] == [(0, LOCKED), (1, MOTORING)]
    longer = np.concatenate([speed, [0.0, 0.0]])
    told = regimes(longer, np.ones(12))
    assert [(one.start, one.state) for one in told] == [(0, LOCKED), (1, MOTORING)]
    told = regimes(np.concatenate([longer, [0.0]]), np.ones(13))
    assert [(one.start, one.state) for one in told][2:] == [(10, LOCKED)]


def test_blocks_are_means_and_at_most_two_thousand() -> None:
    """4001 rows are blocks of three: a stretch of nine rows counts, one of six does not."""
    speed = np.full(4001, 10.0)
    speed[300:309] = 0.0
    speed[900:906] = 0.0
    told = regimes(speed, np.ones(4001))
    assert [(one.start, one.state) for one in told] == [
        (0, MOTORING),
        (300, LOCKED),
        (309, MOTORING),
    ]


def test_a_record_of_a_few_rows_is_told_row_by_row() -> None:
    """Three blocks are the least of a long record; ten rows have no such thing as confetti."""
    speed = np.array([100.0, 100.0, 0.0, 100.0, 100.0, 100.0])
    told = regimes(speed, np.full(6, 3.0))
    assert [(one.state, one.start) for one in told] == [(MOTORING, 0), (LOCKED, 2), (MOTORING, 3)]
