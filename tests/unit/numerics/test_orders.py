"""Orders against an angle: found, not invented, and not mistaken for friction that turns."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.numerics.orders import (
    OrderLine,
    Turn,
    detection_limit,
    even_positions,
    find_orders,
    half_peak_to_peak,
    largest_order,
    passes,
    phase_modulated,
    spectrum,
    whole_turns,
)


def turns(
    waves: dict[int, complex], sigma: float, per_turn: int = 4032, seed: int = 0, count: int = 4
) -> list[Turn]:
    rng = np.random.default_rng(seed)
    made = []
    for r in range(count):
        theta = np.arange(per_turn) * (2.0 * np.pi / per_turn) + rng.uniform(0, 1e-4)
        value = sigma * rng.standard_normal(per_turn)
        for order, c in waves.items():
            value = value + np.real(c * np.exp(1j * order * theta))
        made.append(Turn(theta, value, 1 if r % 2 else -1))
    return made


def test_amplitude_and_phase_without_noise() -> None:
    """A grid that beats with any power of two makes no ghost and no loss at high orders."""
    spec, lines = find_orders(turns({84: 2.0 - 1.0j, 168: 0.25j}, 1e-9), 700)
    assert [line.order for line in lines] == [84, 168]
    assert lines[0].coefficient == pytest.approx(2.0 - 1.0j, rel=1e-6)
    assert lines[1].coefficient == pytest.approx(0.25j, rel=1e-6)
    assert spec.orders.size == 700


def test_uncertainty_is_the_bound_of_white_noise() -> None:
    """Amplitude of a sine in white noise: u = sigma sqrt(2 / n) (Kay 1993, example 3.14)."""
    _, lines = find_orders(turns({60: 1.0}, 0.5), 500)
    assert lines[0].u == pytest.approx(0.5 * np.sqrt(2.0 / (4 * 4032)), rel=0.1)
    assert abs(lines[0].amplitude - 1.0) < 4.0 * lines[0].u


def test_noise_alone_has_no_orders() -> None:
    """At level 0.01 about one in a hundred noise records may show something: here 40 of them."""
    found = sum(len(find_orders(turns({}, 1.0, 512, seed), 250)[1]) for seed in range(40))
    assert found <= 2


def test_coloured_noise_has_no_orders() -> None:
    """A random walk along the angle is strong at low orders and still no cogging."""
    found = 0
    for seed in range(20):
        rng = np.random.default_rng(seed)
        walks = []
        for r in range(4):
            theta = np.linspace(0.0, 2.0 * np.pi, 2000, endpoint=False)
            walks.append(Turn(theta, np.cumsum(rng.standard_normal(2000)), 1 if r % 2 else -1))
        found += len(find_orders(walks, 400)[1])
    assert found <= 2


def test_friction_ripple_that_turns_with_the_sense_is_no_order() -> None:
    made = turns({}, 0.01)
    made = [Turn(t.theta_rad, t.value + t.sense * np.cos(24 * t.theta_rad), t.sense) for t in made]
    assert find_orders(made, 200)[1] == []


def test_detection_limit_is_found_nearly_always() -> None:
    limit = detection_limit(spectrum(turns({}, 1.0, 512), 250))
    found = [bool(find_orders(turns({33: limit}, 1.0, 512, seed), 250)[1]) for seed in range(40)]
    assert sum(found) >= 35


def test_passes_and_whole_turns() -> None:
    """Forward 2.5 turns, back 1.2: two turns one way and one the other."""
    there = np.linspace(0.0, 5.0 * np.pi, 5001)
    back = np.linspace(5.0 * np.pi, 2.6 * np.pi, 2401)
    theta = np.concatenate([there, back[1:]])
    theta = theta + 1e-4 * np.sin(1000 * theta)
    assert [sense for _, sense in passes(theta)] == [1, -1]
    made = whole_turns(theta, np.ones(theta.size))
    assert [turn.sense for turn in made] == [1, 1, -1]
    assert largest_order(made, 10_000) == pytest.approx(1000, abs=2)


def test_even_positions() -> None:
    even = [Turn(np.arange(360) * (2.0 * np.pi / 360), np.ones(360), s) for s in (1, -1)]
    assert even_positions(even) == 360
    rng = np.random.default_rng(0)
    uneven = [Turn(np.sort(rng.uniform(0, 2 * np.pi, 360)), np.ones(360), s) for s in (1, -1)]
    assert even_positions(uneven) is None


def test_half_peak_to_peak_of_two_orders() -> None:
    """sin(x) + sin(2x)/2 peaks at 3 sqrt(3)/4 (x = 60 degrees)."""
    lines = [OrderLine(1, -1.0j, 0.1, 9.0, 0.0), OrderLine(2, -0.5j, 0.0, 9.0, 0.0)]
    peak, u = half_peak_to_peak(lines)
    assert peak == pytest.approx(0.75 * np.sqrt(3.0), rel=1e-6)
    assert u == pytest.approx(0.1 * np.sqrt(3.0) / 2.0, rel=1e-3)


@pytest.mark.parametrize("order", [7, 500])
def test_half_peak_to_peak_keeps_its_accuracy_at_high_orders(order: int) -> None:
    """cos(x) - e sin(2x), odd about a quarter period: crests where sin(x) = -2 e cos(2x).

    With s = sin(x) that is 4 e s² - s - 2 e = 0, and the crest is sqrt(1 - s²) (1 - 2 e s).
    """
    e = 0.15
    s = (1.0 - np.sqrt(1.0 + 32.0 * e**2)) / (8.0 * e)
    lines = [
        OrderLine(order, complex(np.exp(0.4j)), 0.0, 9.0, 0.0),
        OrderLine(2 * order, complex(1j * e * np.exp(0.8j)), 0.0, 9.0, 0.0),
    ]
    peak, _ = half_peak_to_peak(lines)
    assert peak == pytest.approx(np.sqrt(1.0 - s**2) * (1.0 - 2.0 * e * s), rel=1e-9)


def test_eccentric_encoder_makes_sidebands_that_belong_to_the_order() -> None:
    """An angle read as theta + a sin(theta): the power of order 60 spreads, none is lost."""
    made = []
    for turn in turns({}, 1e-4):
        value = turn.value + np.cos(60 * turn.theta_rad)
        made.append(Turn(turn.theta_rad + 0.006 * np.sin(turn.theta_rad + 0.3), value, turn.sense))
    _, lines = find_orders(made, 200)
    leading = lines[0]
    sides = phase_modulated(lines, leading.order)
    whole = np.sqrt(sum(line.amplitude**2 for line in [leading, *sides]))
    assert leading.order == 60
    assert leading.amplitude < 0.98
    assert whole == pytest.approx(1.0, abs=2e-3)


def test_sidebands_of_a_modulated_amplitude_are_its_own() -> None:
    """Unequal magnets modulate the amplitude: (1 + 0.2 cos theta) cos(60 theta)."""
    _, lines = find_orders(turns({60: 1.0, 59: 0.1, 61: 0.1}, 1e-3), 200)
    assert phase_modulated(lines, 60) == []
