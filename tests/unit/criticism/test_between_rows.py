"""What a current does between the rows of a log in which the rotor turns far from row to row."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.machine import Ripple
from pipeline.criticism.regression import noise_floors
from pipeline.criticism.regression.noise_floors import reading_error, window_gain
from pipeline.criticism.signals.between_rows import Waves, evenly, on_points
from tests.unit.criticism.machines import BASE, log, machine

ROWS, POINTS, ROW_S = 400, 8, 1e-3
POLICY = Ripple()
PARTS = evenly(POINTS)
AT = np.arange(ROWS * POINTS) / POINTS
NOISE = 0.004 * np.random.default_rng(3).normal(size=(ROWS, 2)) @ (1.0, 1.0j)


def clock(t_s: np.ndarray) -> Segment:
    """A log of so many rows."""
    return replace(log(), ts_s=ROW_S, recorded={"t_s": t_s})


def slow(at: np.ndarray) -> np.ndarray:
    """A current that a speed loop moves."""
    return 1.0 + 0.4 * np.sin(at / 40.0) + 0.5j * np.cos(at / 55.0)


def rippling(eps: np.ndarray) -> np.ndarray:
    return 0.2 * np.exp(6j * eps) + 0.1 * np.exp(-6j * eps + 0.3j) - 0.05j * np.cos(12.0 * eps)


def missed(turn_rad: float, ripple: float = 1.0, t_s: np.ndarray | None = None) -> tuple:
    """Rms error [A] of straight lines, and of them with waves, away from the ends."""
    eps = turn_rad * AT * (1.0 + 1e-4 * AT)
    true = slow(AT) + ripple * rippling(eps)
    current = true[::POINTS] + NOISE
    segment = clock(ROW_S * np.arange(ROWS) if t_s is None else t_s)
    waves = Waves.of(segment, current, eps[::POINTS], PARTS, POLICY)
    lines = on_points(current, AT.size)
    with_waves = lines + waves.added(current, AT.size)
    return tuple(np.std((one - true)[8:-8]) for one in (lines, with_waves))


@pytest.mark.parametrize("turn_rad", [0.35, 1.6, 2.3])
def test_waves_of_the_angle_are_found_between_rows(turn_rad: float) -> None:
    straight, with_waves = missed(turn_rad)
    assert straight > 0.09
    assert with_waves < 0.1 * straight


def test_a_current_without_waves_stays_on_straight_lines() -> None:
    straight, with_waves = missed(1.6, ripple=0.0)
    assert with_waves == straight


def test_a_wave_that_every_row_has_at_nearly_the_same_phase_is_a_slow_current() -> None:
    """Six turns of 59/60 of a sixth: by the rows it moves on once in sixty of them."""
    turn_rad = 2.0 * np.pi / 6.0 * 59.0 / 60.0
    current = slow(AT)[::POINTS] + NOISE
    current[ROWS // 2 :] += 2.0
    eps = turn_rad * np.arange(ROWS)
    waves = Waves.of(clock(ROW_S * np.arange(ROWS)), current, eps, PARTS, POLICY)
    assert np.abs(waves.added(current, AT.size)).max() < 0.01


@pytest.mark.parametrize("seed", range(8))
def test_pulses_of_a_speed_loop_are_no_wave_whose_phase_moves_on_slowly(seed: int) -> None:
    """What is not slow in such a wave is next to nothing, and made amperes of a pulse."""
    random = np.random.default_rng(seed)
    current = 0.01 * NOISE + 0.04j
    for row in np.cumsum(random.integers(20, 110, 4)).tolist():
        size = random.uniform(-0.6, 0.6)
        current[row : row + 8] += 1j * size * np.exp(-np.arange(8) / random.uniform(1.0, 3.0))
    eps = 2.0 * np.pi / 6.0 * (1.0 - random.uniform(0.01, 0.09)) * np.arange(ROWS)
    waves = Waves.of(clock(ROW_S * np.arange(ROWS)), current, eps, PARTS, POLICY)
    assert np.abs(waves.added(current, AT.size)).max() < 0.02


def test_waves_that_rows_hardly_tell_apart_stay_small() -> None:
    """At half a wave of order 6 a row its sine is next to nothing in any of them."""
    straight, with_waves = missed(1.0005 * np.pi / 6.0)
    assert with_waves < 1.1 * straight


def test_a_step_of_the_current_is_no_wave() -> None:
    current = slow(AT)[::POINTS] + NOISE
    current[ROWS // 2 :] += 2.0
    waves = Waves.of(clock(ROW_S * np.arange(ROWS)), current, 1.6 * np.arange(ROWS), PARTS, POLICY)
    assert np.abs(waves.added(current, AT.size)).max() < 0.01


def test_no_wave_goes_across_a_gap_and_short_runs_have_none() -> None:
    """Of two parts with a gap each is as good as alone; pieces of thirty rows determine nothing."""
    t_s = ROW_S * (np.arange(ROWS) + 500.0 * (np.arange(ROWS) >= ROWS // 2))
    straight, with_waves = missed(1.6, t_s=t_s)
    assert with_waves < 0.1 * straight
    pieces = ROW_S * (np.arange(ROWS) + 500.0 * (np.arange(ROWS) // 30))
    straight, with_waves = missed(1.6, t_s=pieces)
    assert with_waves == straight


def test_a_wave_that_rows_do_not_show_is_as_large_as_where_they_do() -> None:
    """Half of the log turns a sixth of a turn a row but for a thousandth, half a fourteenth."""
    sixth = 2.0 * np.pi / 6.0
    turn_rad = np.where(np.arange(ROWS * POINTS) < ROWS * POINTS // 2, 0.43, 0.999) * sixth
    eps = np.cumsum(turn_rad) / POINTS
    current = (slow(AT) + 0.2j * np.cos(6.0 * eps + 0.4))[::POINTS] + NOISE
    segment = clock(ROW_S * np.arange(ROWS))
    waves = Waves.of(segment, current, eps[::POINTS], PARTS, POLICY)
    unseen = waves.unseen(current, AT.size)
    shown, not_shown = slice(0, 1200), slice(2000, -POINTS)
    assert not unseen[:, shown].any()
    assert np.abs(unseen[0, not_shown]).max() == pytest.approx(2.0 * 0.2, rel=0.1)
    assert np.abs(unseen[1]).max() < 0.03
    # what straight lines miss there is within it, at every point
    true = 0.2 * np.cos(6.0 * eps + 0.4)
    beside = true - on_points(true[::POINTS], AT.size)
    assert (np.abs(beside) < 1.1 * np.abs(unseen[0]) + 1e-3)[not_shown].all()
    # and the current changes no faster than it says, where the rows show no change
    slopes = np.abs(waves.unseen_slopes(current, eps[::POINTS]))
    assert not slopes[:, :150].any()
    assert slopes[0, 250:-1] == pytest.approx(0.2 * 6.0 * 0.999 * sixth, rel=0.1)
    changes = POINTS * np.abs(np.gradient(true))
    assert (changes[250 * POINTS : -POINTS] < 1.1 * slopes[0, 250]).all()
    of_rows = np.diff(current.imag - slow(AT)[::POINTS].imag)[250:]
    assert np.abs(of_rows).max() < 0.1 * slopes[0, 250]
    # and so where the last rows are too few for a block
    t_s = ROW_S * (np.arange(ROWS) + 500.0 * (np.arange(ROWS) > 349))
    short = Waves.of(clock(t_s), current, eps[::POINTS], PARTS, POLICY)
    ended = np.abs(short.unseen_slopes(current, eps[::POINTS]))
    assert ended[0, 250:349] == pytest.approx(slopes[0, 250:349], rel=0.05)
    assert not ended[:, :150].any()
    assert not ended[:, 350:].any()


def test_a_voltage_is_allowed_what_an_unseen_wave_takes(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of 3 kA/s whose phase is not known, each axis by its own inductance."""
    segment = log(noise=1.0)
    segment = replace(segment, instrument=replace(segment.instrument, timing="instant"))
    model = Model(machine(), ())
    before = reading_error(segment, model, BASE)
    slopes = np.stack([np.full(segment.size, 3e3 + 0.0j), np.zeros(segment.size)])
    monkeypatch.setattr(noise_floors, "unseen_slopes", lambda *_: slopes)
    volts = [segment.channels.index(name) for name in ("vd_v", "vq_v")]
    after = reading_error(segment, model, BASE)
    added = np.sqrt(after[volts, :, 0] ** 2 - before[volts, :, 0] ** 2) / window_gain(segment)
    for axis, name in zip(added, ("ld_h", "lq_h"), strict=True):
        assert axis == pytest.approx(3e3 * BASE[name] / np.sqrt(2.0), rel=1e-6)
