"""Orders a turn that no equation looks at: seen where two captures have them, and only there."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from pipeline.criticism.data.segment import Unthinned, row_index
from pipeline.criticism.machine.model import Model
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.selection.order_scan import Part, _parts, orders_left
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import BASE, log, machine

PLAIN = Model(machine(), ())
TORQUE = "torque_shaft_nm"


def spinning(seed, waves=(), name="torque_shaft_nm"):
    """A log of fourteen turns with waves (order, size a current) in one of its signals."""
    one = log(16_000, seed, 1.0)
    theta, current = one.recorded["theta_mech_rad"], one.recorded["iq_a"]
    added = sum(
        (size * current * np.cos(order * theta + 0.4) for order, size in waves),
        np.zeros(theta.size),
    )
    signals = {**one.recorded, name: one.recorded[name] + added}
    return replace(one, capture=f"log_{seed}", recorded=signals)


def left(*segments):
    values = dict(BASE)
    fit = Fit(tuple(segments), PLAIN, values, floors(segments, PLAIN, values), values)
    return orders_left(linear_system(fit))


def test_waves_under_load_are_found_by_their_orders():
    both = [spinning(seed, ((16, 2e-3), (37, 3e-3))) for seed in (1, 2)]
    assert left(*both) == (16, 37)
    assert left(*[spinning(seed, ((19, 0.02),), "vq_v") for seed in (1, 2)]) == (19,)


@pytest.mark.parametrize("order", [4.83, pytest.param(16.4, marks=pytest.mark.slow)])
def test_an_order_that_is_no_whole_number_is_told_as_close_as_the_angles_tell_it(order):
    """Fourteen turns tell orders apart by a fourteenth, and one that is clear a hundred times as
    well.
    """
    (found,) = left(*[spinning(seed, ((order, 6e-3),)) for seed in (1, 2)])
    assert found == pytest.approx(order, abs=1e-3)


def test_a_wave_that_changes_its_sense_with_the_current_has_a_whole_order():
    """Its power lies beside the order, half of it on either side."""
    both = [spinning(seed) for seed in (1, 2)]
    theta, current = (both[0].recorded[name] for name in ("theta_mech_rad", "iq_a"))
    added = 0.02 * np.sign(current) * np.cos(16.0 * theta)
    waved = [
        replace(
            s, recorded={**s.recorded, "torque_shaft_nm": s.recorded["torque_shaft_nm"] + added}
        )
        for s in both
    ]
    assert left(*waved) == (16,)


def test_orders_that_are_apart_are_not_one():
    assert left(spinning(1, ((23.37, 6e-3),)), spinning(2, ((24.4, 6e-3),))) == ()


def test_a_wave_that_grows_with_the_size_of_the_current_is_one_order():
    waved = []
    for one in (spinning(seed) for seed in (1, 2)):
        theta, current, torque = (one.recorded[n] for n in ("theta_mech_rad", "iq_a", TORQUE))
        torque = torque + 0.01 * np.abs(current) * np.cos(23.37 * theta)
        waved.append(replace(one, recorded={**one.recorded, TORQUE: torque}))
    assert left(*waved) == pytest.approx((23.37,), abs=2e-3)


def test_what_the_equations_look_at_is_theirs():
    """Order 42 is 6ε of seven pole pairs: its group of rows tells of it."""
    assert left(*[spinning(seed, ((42, 3e-3),)) for seed in (1, 2)]) == ()


def test_one_capture_alone_has_no_order():
    assert left(spinning(1, ((16, 3e-3),)), spinning(2)) == ()


def test_of_a_single_log_both_halves_have_an_order():
    """A programme of one drive: nothing else could show it."""
    whole = spinning(1, ((16, 3e-3),))
    assert left(whole) == (16,)
    plain, torque = spinning(1).recorded[TORQUE], whole.recorded[TORQUE].copy()
    # the shaft gathers speed: more than half of its turns are in the last third of the time
    torque[: torque.size * 7 // 8] = plain[: torque.size * 7 // 8]
    assert left(replace(whole, recorded={**whole.recorded, TORQUE: torque})) == ()


def test_a_single_log_of_a_few_turns_has_no_order():
    """It has no halves that could agree."""
    one = log(10_600, 1, 1.0)
    wave = 3e-3 * one.recorded["iq_a"] * np.cos(16 * one.recorded["theta_mech_rad"] + 0.4)
    waved = replace(one, recorded={**one.recorded, TORQUE: one.recorded[TORQUE] + wave})
    assert left(waved) == ()


def test_a_free_shaft_shows_orders_as_well():
    """Its current is logged and its torque is not: the acceleration has them."""
    one = log(16_000, 1, 1.0)
    t = np.arange(one.size) * one.ts_s
    tau_s = BASE["j_kgm2"] / BASE["b_nm_s_rad"]
    theta = 100.0 * tau_s * (1.0 - np.exp(-t / tau_s))
    theta += 1e-4 * np.cos(16.0 * theta)
    noise = np.random.default_rng(2).normal(0.0, 0.01, (2, t.size))
    current = dict(zip(("id_a", "iq_a"), noise, strict=True))
    kinds = {"kind": "motion", "channels": (TORQUE,), "unthinned": Unthinned()}
    free = replace(one, recorded={**one.recorded, **current, "theta_mech_rad": theta}, **kinds)
    weak = projection(theta, one.weak.starts, one.weak.length, ())
    assert left(replace(free, weak=weak)) == (16,)


@pytest.mark.slow
def test_what_nobody_would_act_on_is_no_order():
    """A two-thousandth of the machine's torque of 1.6 N·m, as an rms."""
    size = 5e-4 * 1.6 / float(np.sqrt(0.5 * np.mean(log(16_000).recorded["iq_a"] ** 2)))
    assert left(*[spinning(seed, ((16, 0.6 * size),)) for seed in (1, 2)]) == ()
    assert left(*[spinning(seed, ((16, 1.2 * size),)) for seed in (1, 2)]) == (16,)


@pytest.mark.parametrize("first", [0, *(pytest.param(n, marks=pytest.mark.slow) for n in (4, 8))])
def test_noise_has_no_orders(first):
    assert left(*[spinning(seed) for seed in range(first, first + 4)]) == ()


def test_orders_that_were_seen_have_rows_of_their_own():
    seen = replace(machine(), load_orders=(16,))
    assert set(seen.electrical_orders) - set(machine().electrical_orders) == {16}
    assert ("torque_shaft_nm", 42) in row_index(log())[3]


def test_groups_of_whole_orders_are_named_by_whole_numbers():
    """Beside one that is not, so that a remainder of order 42 is told as 42."""
    segment = log()
    theta, weak = segment.recorded["theta_mech_rad"], segment.weak
    orders = (4.83, 42)
    mixed = replace(segment, weak=projection(theta, weak.starts, weak.length, orders, cycles=0.0))
    named = {order for _, order in row_index(mixed)[3]}
    assert named == {0, 4.83, 42}
    assert {type(order) for order in named if order != 4.83} == {int}


@pytest.mark.parametrize("size", [np.ones_like, np.asarray, np.abs])
def test_a_part_is_rid_of_a_wave_of_one_size_or_as_the_current_or_its_size_goes(size):
    """Else what is left of it hides the orders beside it."""
    theta = np.linspace(0.0, 40.0, 4000)
    current = 3.0 * np.sin(0.37 * theta + 0.2)
    wave, other = size(current) * np.cos(16 * theta + 0.4), 0.01 * np.cos(17 * theta)
    part = Part(wave + other, theta, np.ones(theta.size), current)
    rid = part.without(16.0)
    assert np.abs(rid.residual - other).max() < 0.005
    assert np.abs(part.residual - other).max() > 0.9


GROWS = ("never", "with the current", "with its size")
ORDERS = (1.27, 2.37, 3.14, 7.62)
QUICK = ((1.27, GROWS[0]), (2.37, GROWS[1]), (7.62, GROWS[2]))


@pytest.mark.parametrize(
    ("order", "grows"),
    [
        pytest.param(*one, marks=() if one in QUICK else pytest.mark.slow)
        for one in product(ORDERS, GROWS)
    ],
)
def test_a_clear_line_is_found_wherever_it_is_and_however_it_grows(order, grows):
    """Few turns spread a line over its neighbours: these are no noise beside it."""
    waved = []
    for one in (spinning(seed) for seed in (1, 2)):
        theta, current, torque = (one.recorded[n] for n in ("theta_mech_rad", "iq_a", TORQUE))
        size = {"never": 6.0, "with the current": current, "with its size": np.abs(current)}[grows]
        torque = torque + 6e-3 * size * np.cos(order * theta + 0.7)
        waved.append(replace(one, recorded={**one.recorded, TORQUE: torque}))
    assert left(*waved) == pytest.approx((order,), abs=5e-3)


def test_two_lines_at_once_are_told_apart():
    waved = []
    for one in (spinning(seed) for seed in (1, 2)):
        theta, current, torque = (one.recorded[n] for n in ("theta_mech_rad", "iq_a", TORQUE))
        both = 6e-3 * np.abs(current) * np.cos(1.73 * theta) + 0.024 * np.sin(6.41 * theta)
        waved.append(replace(one, recorded={**one.recorded, TORQUE: torque + both}))
    assert left(*waved) == pytest.approx((1.73, 6.41), abs=0.02)


def test_a_part_of_a_log_has_rows():
    """A shaft that turns by ten turns from row to row passes whole parts without any."""
    theta = np.cumsum(np.repeat([0.1, 20.0 * np.pi, 0.1], [500, 4, 500]))
    parts = list(_parts(theta, np.ones(theta.size), PLAIN.policy.order_scan))
    assert parts
    assert min(part.size for part in parts) > 1
