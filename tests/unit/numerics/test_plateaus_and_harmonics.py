"""Plateaus of stepped signals, harmonic regression, cycle cuts."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.numerics.harmonics import hermite, whole_cycles
from pipeline.numerics.plateaus import block_means, find_plateaus, white_noise_sigma


def stepped(sigma: float) -> np.ndarray:
    """Four levels of 200 rows, each approached with a time constant of 5 rows."""
    signal, level = [], 0.0
    for target in (0.0, 2.0, 1.0, -2.0):
        for _ in range(200):
            level += (target - level) / 5.0
            signal.append(level)
    return np.array(signal) + sigma * np.random.default_rng(1).standard_normal(800)


@pytest.mark.parametrize("scale", [1e-3, 1.0, 1e3])
def test_plateaus_of_any_scale(scale):
    signal = scale * stepped(0.01)
    levels = [float(signal[p.rows].mean()) / scale for p in find_plateaus(signal)]
    assert levels == pytest.approx([0.0, 2.0, 1.0, -2.0], abs=0.004)


@pytest.mark.parametrize("level", [5.16, -5.16e-9, 5.16e9, 0.0])
def test_an_exact_constant_is_one_plateau(level):
    """The running sum of 20 000 times 5.16 is rounded; that is no motion."""
    assert [(p.start, p.stop) for p in find_plateaus(np.full(20_000, level))] == [(0, 20_000)]


def test_a_ramp_has_no_plateau():
    signal = np.linspace(0.0, 5.0, 1000) + 0.001 * np.random.default_rng(2).standard_normal(1000)
    assert all(p.size < 200 for p in find_plateaus(signal))


def test_noise_of_a_drifting_stepped_signal():
    signal = stepped(0.03) + np.linspace(0.0, 1.0, 800)
    assert white_noise_sigma(signal) == pytest.approx(0.03, rel=0.12)


def test_block_means_drop_the_rest():
    assert block_means(np.arange(7.0), 3).tolist() == [1.0, 4.0]


def test_cuts_hold_whole_cycles():
    phase = np.linspace(0.3, 0.3 + 2 * math.pi * 5.4, 1000)
    cuts = whole_cycles(phase)
    assert cuts.size == 6
    assert np.diff(phase[cuts]) == pytest.approx(2 * math.pi, abs=phase[1] - phase[0])


def test_hermite_reproduces_a_parabola_and_its_slope():
    nodes = np.array([0.0, 0.7, 1.5, 2.0, 3.1])
    x = np.linspace(0.8, 1.9, 50)
    value, slope = hermite(nodes, nodes**2, x)
    assert value == pytest.approx(x**2, abs=1e-12)
    assert slope == pytest.approx(2 * x, abs=1e-12)
