"""Every number of the gate of cut signals from both sides, a few per cent away."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.contracts.gates import (
    saturation,
)
from tests.unit.contracts.signals import OPTIONS
from tests.unit.contracts.test_gate_limits import capture, said


def cut(values, stop):
    return np.clip(values, -stop, stop)


@pytest.mark.parametrize(("share", "expected"), [(0.045, "warned"), (0.056, "refused")])
def test_a_twentieth_of_the_rows_may_be_cut(share: float, expected: str) -> None:
    """A sine of steps all its own, cut at the height that the share leaves."""
    wave = np.sin(np.arange(20000) * 0.0123456) * 10.0
    stop = float(np.quantile(np.abs(wave), 1.0 - share))
    made = capture("drive", iq_a=cut(wave, stop), vq_v=np.cos(np.arange(20000) * 0.1))
    assert np.mean(np.abs(cut(wave, stop)) == stop) == pytest.approx(share, abs=0.002)
    assert said("saturation", made) == expected


@pytest.mark.parametrize(("inside", "found"), [(49, False), (51, True)])
def test_fewer_than_a_twentieth_between_the_extremes_are_two_levels(
    inside: int, found: bool
) -> None:
    values = np.repeat([5.0, 0.0, -5.0], [475, inside, 525 - inside])
    values[475 : 475 + inside] = np.random.default_rng(0).uniform(-4.0, 4.0, inside)
    rows = saturation.clipped_rows(values, OPTIONS["saturation"])
    assert bool(rows.any()) is found


@pytest.mark.parametrize(("pace", "found"), [(1.9, False), (2.1, True)])
def test_a_cut_signal_comes_at_its_full_pace(pace: float, found: bool) -> None:
    """Codes of 1: the samples next to the flat stretch move by `pace` codes."""
    rise = np.arange(0.0, 60.0) * pace
    fine = np.array([0.0, 1.0] * 20)
    values = np.concatenate([-fine - 1.0, rise, np.full(40, 60.0 * pace), rise[::-1], -fine - 1.0])
    assert saturation.clipped_rows(values, OPTIONS["saturation"]).any() == found


@pytest.mark.parametrize(("length", "found"), [(2, False), (3, True)])
def test_two_equal_peaks_are_chance(length: int, found: bool) -> None:
    rng = np.random.default_rng(0)
    values = rng.uniform(-1.0, 1.0, 100)
    values[50 : 50 + length] = 2.0
    rows = saturation.clipped_rows(values, {**OPTIONS["saturation"], "chance": 0.99})
    assert np.count_nonzero(rows) == (length if found else 0)
    assert not saturation.clipped_rows(
        values[30:79], {**OPTIONS["saturation"], "chance": 0.99}
    ).any()


@pytest.mark.parametrize(("chance", "found"), [(1e-5, False), (1e-3, True)])
def test_a_cut_stretch_is_longer_than_chance_allows(chance: float, found: bool) -> None:
    """A tenth repeats inside: 1000 * 0.1^(L - 1) is 1e-4 for a run of eight."""
    rng = np.random.default_rng(6)
    values = rng.uniform(-1.0, 1.0, 1000)
    values[10::10] = values[9:-1:10]
    values[500:508] = 2.0
    rows = saturation.clipped_rows(values, {**OPTIONS["saturation"], "chance": chance})
    assert bool(rows.any()) is found


def test_the_pace_beside_a_flat_stretch_is_of_eight_steps_a_side() -> None:
    steps = np.arange(100.0)
    flat = np.zeros(101, dtype=bool)
    flat[40:50] = True
    # 32 to 39 before it and 49 to 56 after it; the steps inside are none
    assert saturation._pace_beside(steps, flat) == 44.0
    assert saturation._pace_beside(steps, np.roll(flat, -38)) == 13.5  # 0, 1 and 11 to 18
