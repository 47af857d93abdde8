"""Two current sensors whose gains differ, and the third line taken as less their sum."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.operating import Recorded

A = np.exp(2j * np.pi / 3.0)
N = 400


def recorded_by(pair: int, gains: tuple[float, float]):
    """A true current [n, A] of the stationary frame, and what two shunts make of it."""
    rng = np.random.default_rng(pair)
    true = rng.standard_normal(N) + 1j * rng.standard_normal(N)
    lines = [(true * A**-k).real for k in range(3)]
    first, second, third = pair - 1, pair % 3, (pair + 1) % 3
    lines[first], lines[second] = gains[0] * lines[first], gains[1] * lines[second]
    lines[third] = -lines[first] - lines[second]
    return true, 2.0 / 3.0 * sum(line * A**k for k, line in enumerate(lines))


@pytest.mark.parametrize("gains", [(1.0, 1.02), (0.97, 1.01)])
@pytest.mark.parametrize("pair", [1, 2, 3])
def test_the_gains_of_two_shunts_turn_the_current_as_well(pair, gains):
    """γ, mean and turn of the matrix that two gains make; without the turn a per cent is left."""
    true, seen = recorded_by(pair, gains)
    gamma = (gains[0] - gains[1]) / np.sqrt(3.0) * np.exp(1j * np.pi / 6.0) * A ** (2 * (pair - 1))
    eps = np.linspace(0.0, 30.0, N)
    frame = np.exp(-1j * eps)
    still = np.zeros(N)
    r = Recorded(seen * frame, still, eps, still, 1e-4, True, "drive")
    q = {"cosine": gamma.real, "sine": gamma.imag, "mean": sum(gains) / 2.0 - 1.0, "bench": 0.0}
    current = effects()["current_gain"].current
    assert current is not None
    found = current(r, {**q, "shunts": float(pair)})
    assert found == pytest.approx(true * frame, abs=1e-12)
    other = current(r, {**q, "shunts": 0.0})
    assert np.abs(other - true * frame).max() > 0.2 * abs(gamma)


@pytest.mark.parametrize("name", ["current_gain", "current_offset", "current_delay"])
@pytest.mark.parametrize(("analysed", "alone"), list(product((False, True), (0.0, 1.0))))
def test_an_analyser_beside_a_drive_may_have_sensors_of_its_own(name, analysed, alone):
    n = np.arange(50) / 8.0
    seen, still = np.exp(1j * n), np.zeros(50)
    r = Recorded(seen, still, n, np.ones(50), 1e-4, True, "drive", analysed=analysed)
    effect = effects()[name]
    q = {p.name: p.scan[0] if p.choice else p.typical for p in effect.parameters}
    changed = effect.current(r, {**q, "alone": alone}) - seen
    assert changed.any() == (not (analysed and alone))
