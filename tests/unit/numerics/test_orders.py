"""Orders against an angle: found, not invented, and not mistaken for friction that turns."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.special import jv
from scipy.stats import f

from pipeline.numerics.order_waveform import half_peak_to_peak, waveform
from pipeline.numerics.orders import (
    MOST_LINES,
    OrderLine,
    detection_limit,
    find_orders,
    orders_present,
    phase_modulated,
)
from pipeline.numerics.turns import (
    Spectrum,
    Turn,
    even_positions,
    held_out_gain,
    largest_order,
    noise_power,
    passes,
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


def test_turns_are_found_behind_a_first_angle_that_is_missing() -> None:
    theta = np.linspace(0.0, 5.0 * np.pi, 5001)
    value = np.ones(theta.size)
    theta[0], value[7] = np.nan, np.inf
    made = whole_turns(theta, value)
    assert [turn.sense for turn in made] == [1, 1]
    assert all(np.isfinite(turn.theta_rad).all() and np.all(turn.value == 1.0) for turn in made)


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


def test_coefficients_of_each_turn_on_an_uneven_grid() -> None:
    """The mean and the coefficient stay, whatever the order in which a turn is passed through."""
    theta = 2.0 * np.pi * (np.arange(1200) + 0.2 * np.sin(np.arange(1200) / 50.0)) / 1200.0
    value = 3.0 + 2.0 * np.cos(5 * theta + 0.4)
    spec = spectrum([Turn(theta, value, 1), Turn(theta[::-1] + 8.0 * np.pi, value[::-1], -1)], 20)
    assert spec.means == pytest.approx([3.0, 3.0], abs=1e-4)
    assert spec.coefficients[:, 4] == pytest.approx(2.0 * np.exp(0.4j) * np.ones(2), abs=1e-4)
    assert np.abs(np.delete(spec.coefficients, 4, axis=1)).max() < 1e-4
    assert spec.orders.tolist() == list(range(1, 21))
    assert spec.senses.tolist() == [1, -1]


def test_coefficients_of_a_turn_sampled_far_denser_than_needed() -> None:
    """10 000 rows for ten orders are averaged first; the coefficients and the mean stay."""
    theta = np.linspace(0.0, 2.0 * np.pi, 10_000, endpoint=False)
    spec = spectrum([Turn(theta, 3.0 + np.real(1j * np.exp(9j * theta)), 1)], 10)
    # 1024 bins of 2 pi/1024: means over a bin lose (9 * 2 pi/1024)²/24 of the amplitude
    assert spec.coefficients[0, 8] == pytest.approx(1j, abs=3e-4)
    assert spec.means[0] == pytest.approx(3.0, abs=1e-6)


def test_a_position_read_twice_counts_once() -> None:
    """A sensor that stands still repeats its angle: the mean of its values, once."""
    theta = np.arange(64) * (2.0 * np.pi / 64)
    value = np.cos(3 * theta)
    twice = np.concatenate([theta, theta[:20]])
    values = np.concatenate([value + 0.5 * (theta < theta[20]), value[:20] - 0.5])
    spec = spectrum([Turn(twice, values, 1)], 8)
    assert spec.coefficients[0, 2] == pytest.approx(1.0, abs=1e-9)
    assert np.abs(np.delete(spec.coefficients[0], 2)).max() < 1e-9


def scattered(rows: list[list[complex]]) -> Spectrum:
    """A spectrum of given coefficients [turns, orders]."""
    made = np.array(rows, dtype=complex)
    turns_made = made.shape[0]
    return Spectrum(
        np.arange(1, made.shape[1] + 1), made, np.zeros(turns_made), np.ones(turns_made, int)
    )


def test_noise_power_is_the_variance_of_the_turns_averaged_over_neighbours() -> None:
    """Two orders of variance 2 (turns ±1) and 0 in turn: own 2, 0, ...; ten neighbours a side."""
    spec = scattered([[1.0, 0.0] * 25, [-1.0, 0.0] * 25])
    local, own, dof = noise_power(spec)
    assert own == pytest.approx(np.tile([2.0, 0.0], 25))
    assert local[25] == pytest.approx(2.0 * 10 / 21)  # an odd place has ten of eleven neighbours
    assert local[24] == pytest.approx(2.0 * 11 / 21)
    assert local[0] == pytest.approx(2.0 * 6 / 11)
    assert dof == 2.0 * 1 * 11
    assert noise_power(scattered([[1.0], [-1.0]]))[2] == 2.0
    assert noise_power(scattered([[1.0, 2.0, 3.0], [3.0, 2.0, 1.0], [2.0, 2.0, 2.0]]))[2] == 8.0


def test_held_out_gain_is_the_share_of_turns_that_the_others_explain() -> None:
    """Turns 1, 1, 1, -3: the others' mean is -1/3 for the first three (no help), 1 for the last."""
    assert held_out_gain(scattered([[1.0], [1.0], [1.0], [-3.0]]))[0] == 0.0
    assert held_out_gain(scattered([[1.0], [1.0], [1.0], [1.0]]))[0] == 1.0
    assert held_out_gain(scattered([[2.0], [2.0], [2.0], [-1.0]]))[0] == 0.75
    # half of the others' mean is where it helps no more: |c|² = |c - m|² at m = 2 c
    assert held_out_gain(scattered([[1.0], [1.9]])).tolist() == [1.0]
    assert held_out_gain(scattered([[1.0], [2.1]])).tolist() == [0.5]
    assert held_out_gain(scattered([[1.0], [2.0]])).tolist() == [0.5]


def test_p_value_and_uncertainty_of_an_order_by_hand() -> None:
    """One order of turns 1 ± d: F = r |mean|²/own with (2, 2 (r - 1)); u = sqrt(own/2 r)."""
    d = 0.1
    spec = scattered([[1.0 + d], [1.0 - d], [1.0 + d * 1j], [1.0 - d * 1j]])
    own = 4.0 * d**2 / 3.0
    (line,) = orders_present(spec)
    assert line.coefficient == pytest.approx(1.0)
    assert line.dof == 6.0
    assert line.u == pytest.approx(np.sqrt(own / 8.0))
    assert line.p_value == pytest.approx(f.sf(4.0 / own, 2, 6), rel=1e-9)
    p = line.p_value
    assert orders_present(spec, 1.001 * p)
    assert not orders_present(spec, 0.999 * p)


def test_an_order_of_its_own_scatter_has_its_own_uncertainty() -> None:
    """Forty quiet orders and one that scatters fifty times as much between the turns."""
    rng = np.random.default_rng(4)
    rows = 0.01 * (rng.standard_normal((6, 41)) + 1j * rng.standard_normal((6, 41)))
    rows[:, 20] = 5.0 + 0.5 * np.array([1, -1, 1j, -1j, 0, 0])
    lines = orders_present(scattered(rows.tolist()))
    assert [line.order for line in lines] == [21]
    own = 4 * 0.25 / 5
    assert lines[0].u == pytest.approx(np.sqrt(own / 12.0))
    assert lines[0].dof == 10.0
    # the p-value is against the local mean: 5² 6 over (40 quiet and this one)/21, times 41 orders
    assert lines[0].p_value < 1e-6


def test_forty_orders_are_enough() -> None:
    """Thirty-nine alike join at once, a weaker one next; the weakest is not looked for."""
    alike = dict.fromkeys(range(3, 3 * MOST_LINES, 3), 1.0 + 0.5j)
    found = find_orders(turns({**alike, 121: 0.1, 124: 0.01}, 1e-4, 1024), 200)[1]
    assert MOST_LINES == 40
    assert [line.order for line in found][-1] == 121
    assert sorted(line.order for line in found) == [*alike, 121]


def test_a_turning_point_is_a_fall_of_more_than_the_distance_told() -> None:
    """0 to 1 in steps of 0.01, back by 0.19 (no turn) or 0.21 (a turn), and on to 2."""
    up, on = np.arange(0.0, 1.0, 0.01), np.arange(0.8, 2.0, 0.01)
    small = np.concatenate([up, np.arange(1.0, 0.81, -0.01), on + 0.01])
    assert passes(small) == [(slice(0, small.size), 1)]
    large = np.concatenate([up, np.arange(1.0, 0.785, -0.01), on])
    assert [sense for _, sense in passes(large)] == [1, -1, 1]
    first, second, third = (rows for rows, _ in passes(large))
    assert (first.start, first.stop) == (0, second.start)
    assert (second.stop, third.stop) == (third.start, large.size)
    assert large[first][-1] == large[: up.size + 1].max() == 1.0
    assert large[second][-1] == pytest.approx(0.79, abs=0.011)
    assert passes(-small) == [(slice(0, small.size), -1)]
    assert passes(0.19 * np.sin(np.arange(0.0, 1.5, 0.01))) == []
    assert [sense for _, sense in passes(large, 0.25)] == [1]


def test_a_turn_of_98_hundredths_is_whole_and_one_of_97_is_not() -> None:
    for share, count in ((0.97, 0), (0.985, 1), (1.0, 1), (1.97, 1), (1.985, 2)):
        theta = np.linspace(0.0, 2.0 * np.pi * share, 2000)
        found = whole_turns(theta, np.cos(theta))
        assert len(found) == count
        assert all(np.array_equal(turn.value, np.cos(turn.theta_rad)) for turn in found)
    theta = np.linspace(0.0, 4.0 * np.pi, 2001)
    first, second = whole_turns(theta, theta)
    assert first.theta_rad.max() < 2.0 * np.pi <= second.theta_rad.min()
    theta[1::2] = np.nan
    assert [turn.theta_rad.size for turn in whole_turns(theta, np.arange(2001.0))] == [500, 500]
    assert whole_turns(np.linspace(0.0, 7.0, 16), np.ones(16))
    assert whole_turns(np.linspace(0.0, 7.0, 15), np.ones(15)) == []


@pytest.mark.parametrize(("positions", "order"), [(64, 31), (65, 32), (66, 32), (2, 0), (1, 0)])
def test_the_largest_order_has_more_than_two_positions_a_cycle(positions: int, order: int) -> None:
    turn = Turn(np.arange(positions) * (2.0 * np.pi / positions), np.ones(positions), 1)
    other = Turn(np.arange(99) * (2.0 * np.pi / 99), np.ones(99), 1)
    assert largest_order([turn, other], 1000) == order
    assert largest_order([turn, other], 20) == min(order, 20)
    assert largest_order([], 20) == 0


@pytest.mark.parametrize("bits", [11, 12, 14])
def test_even_positions_read_by_an_encoder_of_few_bits(bits: int) -> None:
    """Gaps of 360 positions are eleven or twelve steps of twelve bits, and noise splits them."""
    rng = np.random.default_rng(bits)
    step = 2.0 * np.pi / 2**bits
    theta = np.repeat(np.arange(360) * (2.0 * np.pi / 360), 4)
    read = step * np.round((theta + 1e-4 * rng.standard_normal(theta.size)) / step)
    lost = np.r_[100:140, 700:748]
    for angle in (read, np.delete(read, lost)):
        assert even_positions([Turn(angle, np.ones(angle.size), 1)]) == 360


def test_even_positions_may_miss_some_and_scatter_a_little() -> None:
    """Up to a sixth of their spacing, as an encoder's steps of half of it do; every turn has the
    same number.
    """
    rng = np.random.default_rng(0)
    theta = np.arange(400) * (2.0 * np.pi / 400)
    made = lambda angle: Turn(angle, np.ones(angle.size), 1)  # noqa: E731
    assert even_positions([made(np.delete(theta, np.arange(0, 60, 2)))]) == 400
    scatter = theta[1] * rng.standard_normal(400)
    assert even_positions([made(theta + 0.12 * scatter)]) == 400
    assert even_positions([made(theta + 0.18 * scatter)]) is None
    third = np.arange(300) * (2.0 * np.pi / 300)
    assert even_positions([made(theta), made(third)]) is None
    assert even_positions([made(theta + 40.0), made(theta)]) == 400


def test_detection_limit_of_known_noise() -> None:
    """sqrt(noise F) + 1.645 sqrt(noise/2), noise a turn's power over the turns."""
    spec = scattered([[1.0] * 30, [-1.0] * 30, [1.0] * 30, [-1.0] * 30])
    noise = (4.0 / 3.0) / 4.0
    threshold = f.isf(0.01 / 30, 2, 2 * 3 * 11)
    expected = np.sqrt(noise * threshold) + 1.6448536269514722 * np.sqrt(noise / 2.0)
    assert detection_limit(spec) == pytest.approx(expected, rel=1e-9)
    assert detection_limit(spec, power=0.5) == pytest.approx(np.sqrt(noise * threshold))


def line(order: int, coefficient: complex, u: float = 0.0) -> OrderLine:
    return OrderLine(order, coefficient, u, 9.0, 0.0)


def test_sidebands_of_an_encoder_by_the_series_of_bessel() -> None:
    """cos(60 (theta + a sin theta)) = sum J_n(60 a) cos((60 + n) theta): all sides, none beyond."""
    lines = [line(60 + n, complex(jv(n, 0.5))) for n in range(-4, 5)]
    lines.append(line(7, 1.0))
    assert [side.order for side in phase_modulated(lines, 60)] == [57, 58, 59, 61, 62, 63]
    assert phase_modulated([one for one in lines if one.order != 61], 60) == []
    assert phase_modulated([one for one in lines if one.order != 59], 60) == []


@pytest.mark.parametrize(
    ("excess", "u", "sides"), [(0.09, 0.0, 2), (0.12, 0.0, 0), (0.12, 1e-3, 2)]
)
def test_sidebands_agree_to_a_tenth_and_three_u(excess: float, u: float, sides: int) -> None:
    """c[61]/c[60] = 0.1 and c[59]/c[60] = -0.1 (1 - excess); 3 u sqrt 2 / 2 of it is allowed."""
    lines = [line(60, 2.0), line(61, 0.2, u), line(59, -0.2 * (1.0 - excess), u)]
    assert len(phase_modulated(lines, 60)) == sides


def test_no_order_has_no_peak() -> None:
    with pytest.raises(ValueError, match="no order"):
        half_peak_to_peak([])


def test_half_peak_to_peak_adds_uncertainties_as_the_extremes_see_them() -> None:
    """Orders 1 and 3 at opposite extremes half a turn apart: |exp(jk pi) - 1|²/4 = 1 each."""
    peak, u = half_peak_to_peak([line(1, 1.0, 0.3), line(3, 0.05, 0.4)])
    assert peak == pytest.approx(1.05)
    assert u == pytest.approx(0.5)


def test_waveform_is_the_sum_of_its_orders() -> None:
    theta = np.array([0.0, 0.3, 2.0])
    wave = waveform([line(2, 3.0 - 4.0j), line(5, 1j)], theta)
    expected = 3 * np.cos(2 * theta) + 4 * np.sin(2 * theta) - np.sin(5 * theta)
    assert wave == pytest.approx(expected)


@pytest.mark.parametrize("rows", [1357, 4001, 20011])
def test_a_constant_has_no_orders_however_its_angles_are_rounded(rows: int) -> None:
    """Friction leaked into an order at which an encoder's steps beat with the rows."""
    step = 2.0 * np.pi / 16384
    theta = np.round(np.linspace(0.3, 0.3 + 2.0 * np.pi, rows, endpoint=False) / step) * step
    found = spectrum([Turn(theta, np.full(rows, 0.05), 1)], min(600, rows // 2 - 1))
    assert np.abs(found.coefficients).max() < 1e-15
    assert found.means == pytest.approx([0.05])
