"""Which changes of a speed are jumps between samples, and which are noise or rounding."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.jumps import speed_jumps

SHARE, TIMES, STEP = 0.03, 10.0, 2.0 * np.pi / 4096


def smooth(rows: int = 4000):
    """A shaft that turns by some steps of its encoder a row, to and fro."""
    return 40.0 * STEP / 0.01 * np.sin(0.01 * np.arange(rows))


@pytest.mark.parametrize("steps", [0.0, 1.0, 4.0])
def test_rounding_is_no_jump(steps: float) -> None:
    """Without its resolution, half of the rows of a telemetry log of one motor were jumps."""
    theta = smooth() / 40.0 * max(steps, 0.5)
    assert not speed_jumps(STEP * np.floor(theta / STEP), SHARE, TIMES).any()


def test_noise_is_no_jump() -> None:
    noise = np.random.default_rng(1).normal(0.0, STEP, 4000)
    assert not speed_jumps(smooth() + noise, SHARE, TIMES).any()


@pytest.mark.parametrize("counts", [None, 4096])
def test_a_speed_that_changes_between_two_rows_is_one(counts: int | None) -> None:
    speed = np.repeat([100.0, 400.0, -200.0], 50) * STEP
    theta = np.append(0.0, np.cumsum(speed))
    if counts is not None:
        theta = STEP * np.floor(theta / STEP + 0.3)
    assert speed_jumps(theta, SHARE, TIMES).nonzero()[0].tolist() == [50, 100]


@pytest.mark.parametrize(("rows", "jump"), [(2, True), (10, False)])
def test_an_acceleration_that_lasts_is_none(rows: int, jump: bool) -> None:
    """A drive that reverses in ten rows, and runs at its highest speed in most, lost the rows that
    show its inertia.
    """
    steps = np.concatenate([np.zeros(60), np.full(rows, -2.0 / rows), np.zeros(60)])
    theta = np.cumsum(np.cumsum(np.concatenate([[1.0], steps, -steps])))
    theta += np.random.default_rng(2).normal(0.0, 1e-5, theta.size)
    assert speed_jumps(theta, SHARE, TIMES).any() == jump
