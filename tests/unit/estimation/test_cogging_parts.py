"""Slow turns: friction, orders and their noise on small spectra."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.estimation.estimators import cogging, holding_current
from pipeline.estimation.mechanical import slow_turns
from pipeline.numerics.orders import OrderLine
from pipeline.numerics.turns import Spectrum, Turn, noise_power
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from tests.unit.estimation.signals import capture, known_value

TURN = 2.0 * math.pi


def spectrum_of(forward, backward, noise=0.01):
    turns = len(forward) + len(backward)
    rng = np.random.default_rng(0)
    coefficients = noise * (
        rng.standard_normal((turns, 60)) + 1j * rng.standard_normal((turns, 60))
    )
    senses = np.array([1] * len(forward) + [-1] * len(backward))
    return Spectrum(np.arange(1, 61), coefficients, np.array([*forward, *backward]), senses)


def creeping(speed=0.5, rows=2000, path="slow"):
    t = np.arange(rows) * 0.01
    return capture("cogging", path, t_s=t, theta_mech_rad=speed * t, torque_shaft_nm=np.zeros(rows))


def test_friction_is_half_the_gap_of_the_directions() -> None:
    """Means that scatter beyond the noise: their own variance, n - 2 degrees of freedom."""
    forward, backward = np.array([-1.0, -1.2, -1.1]), np.array([0.5, 0.9, 0.7, 0.7])
    spec = spectrum_of(forward, backward)
    found = cogging._friction([creeping()], [], spec, Constants())
    assert found.number == pytest.approx((0.7 + 1.1) / 2.0)
    squares = np.sum((forward + 1.1) ** 2) + np.sum((backward - 0.7) ** 2)
    u = math.sqrt(squares / 5.0 * (1.0 / 3.0 + 1.0 / 4.0)) / 2.0
    scatter = next(p for p in found.budget if p.kind == "A")
    assert scatter.u == pytest.approx(u)
    assert scatter.dof == 5.0
    assert "transducer zero -0.2 N" in found.note
    assert found.at["omega_mech_rad_s"] == pytest.approx(0.5)


def test_means_within_the_noise_have_the_noise_of_order_zero() -> None:
    """A quarter of E|c|^2 at the lowest order, with the spectrum's freedom."""
    spec = spectrum_of([-1.0, -1.0 + 1e-4], [0.7, 0.7 - 1e-4], noise=0.1)
    local, _, dof = noise_power(spec)
    variance, freedom = cogging._variance_of_mean(spec, spec.means[:2], spec.means[2:])
    assert variance == pytest.approx(float(local[0]) / 4.0)
    assert freedom == dof
    single = cogging._variance_of_mean(spec, spec.means[:1], spec.means[2:3])
    assert single[0] == pytest.approx(float(local[0]) / 4.0)


def test_the_viscous_part_is_taken_off_by_the_coast_down() -> None:
    """B w / (T_c + B w) with T_c/J 30 rad/s^2 and B/J 0.4 1/s at 5 rad/s: 2 of 32."""
    known = Constants((known_value("coast_coulomb_rad_s2", 30.0),
                       known_value("coast_viscous_1_s", 0.4)))  # fmt: skip
    assert cogging._viscous_share(5.0, known)[0] == pytest.approx(2.0 / 32.0)
    assert cogging._viscous_share(None, known)[0] == 0.0
    negative = Constants((known_value("coast_coulomb_rad_s2", 30.0),
                          known_value("coast_viscous_1_s", -0.4)))  # fmt: skip
    assert cogging._viscous_share(5.0, negative)[0] == 0.0
    spec = spectrum_of([-1.0, -1.2], [0.5, 0.9])
    plain = cogging._friction([creeping(5.0)], [], spec, Constants())
    found = cogging._friction([creeping(5.0)], [], spec, known)
    assert found.number == pytest.approx(plain.number * 30.0 / 32.0)
    assert found.u_a == pytest.approx(plain.u_a * 30.0 / 32.0)


def test_without_a_coast_a_viscous_part_is_in_doubt_by_how_fast_the_creep_is() -> None:
    """A fortieth of the top speed: viscous drag of twice the dry one there is 5 % at the creep."""
    spin = capture("open_circuit", "spin", t_s=np.arange(3.0), omega_mech_rad_s=np.full(3, -20.0))
    top = cogging._top_speed_rad_s(Campaign("m", (creeping(), spin)))
    assert top == 20.0 and cogging._top_speed_rad_s(Campaign("m", (creeping(),))) == 0.0
    friction = cogging._friction([creeping()], [], spectrum_of([-1.0], [1.0]), Constants())
    found = cogging._with_viscous_doubt(friction, 0.5, top)
    (part,) = set(found.budget) - set(friction.budget)
    assert part.u == pytest.approx(0.05 * friction.number / math.sqrt(3.0))
    assert cogging._with_viscous_doubt(friction, 0.5, 0.0) is friction
    assert cogging._with_viscous_doubt(friction, None, top) is friction


def test_a_torque_that_drives_the_motion_is_no_friction() -> None:
    spec = spectrum_of([1.0, 1.01], [-1.0, -1.01])
    assert "sign of torque_shaft_nm" in cogging._friction([creeping()], [], spec, Constants()).note
    one = spectrum_of([1.0, 1.01], [])
    assert "one sense" in cogging._friction([creeping()], [], one, Constants()).note


def test_the_speed_of_a_slow_turn_is_its_path_over_its_time() -> None:
    """Two captures of 0.5 and 0.7 rad/s; there and back counts as path; noise does not lengthen."""
    assert cogging.mean_speed_rad_s([creeping(0.5), creeping(-0.7)]) == pytest.approx(0.6)
    t = np.arange(5000) * 0.01
    noisy = 0.5 * t + 1e-4 * (-1.0) ** np.arange(5000)
    made = capture("cogging", t_s=t, theta_mech_rad=noisy, torque_shaft_nm=t)
    assert cogging.mean_speed_rad_s([made]) == pytest.approx(0.5, rel=1e-3)
    blind = capture("cogging", t_s=t, torque_shaft_nm=t)
    assert cogging.mean_speed_rad_s([blind]) is None


def line(order, amplitude=1.0, p=1e-9):
    return OrderLine(order, complex(amplitude), 0.01, 9.0, p)


def plated(**meta):
    return Campaign("m", (capture("cogging", t_s=np.arange(2.0), **meta),))


def test_what_orders_say_of_the_motor() -> None:
    """12 slots, 7 pole pairs: LCM(12, 14) is 84."""
    lines = [line(84, 0.5), line(24), line(28), line(21), line(5)]
    words = cogging.name_orders(lines, Constants(), plated(slots=12, pole_pairs=7))
    assert words == ("84 (LCM of slots and poles): 0.5, 24 (slots): 1, 28 (poles): 1, "
                     "21 (pole pairs): 1, 5: 1")  # fmt: skip
    measured = Constants((known_value("pole_pairs", 5.0),))
    assert "20 (poles)" in cogging.name_orders([line(20)], measured, plated(pole_pairs=7))
    many = [line(k) for k in range(1, 12)]
    assert cogging.name_orders(many, Constants(), plated()).count(":") == 8
    assert cogging._teeth(Constants(), plated(slots=12, pole_pairs=7)) == [12, 14]
    assert cogging._teeth(measured, plated(slots=1)) == [10]


def test_orders_one_and_two_are_unbalance_but_in_motors_that_make_them() -> None:
    lines = [line(84), line(1), line(2), line(3)]
    body, slow = slow_turns.part_orders(lines, Constants(), plated(slots=12, pole_pairs=7))
    assert [one.order for one in slow] == [1, 2]
    assert [one.order for one in body] == [84, 3]
    for meta in ({"pole_pairs": 1}, {"slots": 1}):
        assert slow_turns.part_orders(lines, Constants(), plated(**meta))[1] == []
    _, slow = slow_turns.part_orders(lines, Constants(), plated(pole_pairs=2))
    assert [one.order for one in slow] == [1]


def test_an_order_that_nothing_makes_counts_past_doubt_alone() -> None:
    """12 slots and 7 pole pairs; 83 and 85 are sidebands of an eccentric encoder."""
    found = [line(84), line(59, p=5e-3), line(59 * 2, p=1e-9), line(36, p=5e-3), line(35, p=5e-3)]
    found += [line(2, p=5e-3), line(83, 0.1, p=5e-3), line(85, -0.1, p=5e-3)]
    plate = plated(slots=12, pole_pairs=7)
    counting, unexplained = slow_turns.past_doubt(found, Constants(), plate)
    assert [one.order for one in unexplained] == [59]
    assert [one.order for one in counting] == [84, 118, 36, 35, 2, 83, 85]
    assert slow_turns.past_doubt(found, Constants(), plated(slots=12))[1] == []
    # of three phases any multiple of three may be slots
    at_odds = slow_turns.past_doubt(
        [line(59, p=5e-3), line(27, p=5e-3)], Constants(), plated(pole_pairs=7)
    )
    assert [[one.order for one in part] for part in at_odds] == [[27], [59]]


def test_the_second_and_third_multiple_count_with_their_own_noise() -> None:
    spec = spectrum_of([0.0, 0.1], [0.0, 0.1])
    kept = cogging.peak_orders([line(20)], spec, [], [])
    assert [one.order for one in kept] == [20, 40, 60]
    local, _, dof = noise_power(spec)
    for one in kept[1:]:
        assert one.coefficient == pytest.approx(spec.coefficients[:, one.order - 1].mean())
        assert one.u == pytest.approx(math.sqrt(local[one.order - 1] / 8.0))
        assert (one.dof, one.p_value) == (dof, 1.0)
    assert [k.order for k in cogging.peak_orders([line(25)], spec, [], [])] == [25, 50]
    stranger = [line(20), line(7, p=0.9e-6), line(9, p=1.1e-6), line(12, p=0.5), line(11, p=0.5)]
    kept = cogging.peak_orders(stranger, spec, [6], [stranger[4]])
    assert {one.order for one in kept} == {20, 7, 12, 11, 40, 60}


def shaking(sense: float, rotor_kgm2: float, load_kgm2: float, cogging_nm: float):
    """A slow turn, 60 orders of cogging, of a rotor that shakes with a load that gives way."""
    step, theta, omega = 1e-4, 0.1, 3.0 * sense
    rows = np.empty((round(TURN / 3.0 / step * 1.05), 2))
    for row in rows:
        pull = -cogging_nm * math.sin(60.0 * theta) / (rotor_kgm2 + load_kgm2)
        # a weak speed loop holds the mean
        pull += 2.0 * (3.0 * sense - omega)
        row[:] = theta, -cogging_nm * math.sin(60.0 * theta) - rotor_kgm2 * pull - 0.01 * sense
        omega += step * pull
        theta += step * omega
    theta_rad, torque = rows[::10].T
    count = TURN / 16384
    return capture(
        "cogging",
        f"turn_{sense:+.0f}",
        t_s=10 * step * np.arange(theta_rad.size),
        theta_mech_rad=count * np.floor(theta_rad / count),
        torque_shaft_nm=torque + np.random.default_rng(1).normal(0.0, 1e-4, torque.size),
        slots=30,
        pole_pairs=2,
    )


@pytest.mark.parametrize("stated", [True, False])
def test_a_shaft_that_shakes_takes_a_part_of_its_cogging(stated: bool) -> None:
    """A load of twice the rotor's inertia: without J two thirds of the cogging are seen."""
    turns = tuple(shaking(sense, 1e-4, 2e-4, 0.006) for sense in (1.0, -1.0))
    known = Constants((known_value("j_rotor_kgm2", 1e-4),) if stated else ())
    options = dict(cogging.ESTIMATOR.options)
    found = cogging.fit(Campaign("m", turns), known, options).estimates
    by_name = {one.name: one for one in found}
    assert by_name["cogging_order"].number == 60
    amplitude = by_name["cogging_amplitude_nm"]
    assert amplitude.number == pytest.approx(0.006 if stated else 0.004, rel=0.03)
    assert by_name["cogging_peak_nm"].number == pytest.approx(amplitude.number, rel=0.1)


def test_the_uncertainty_of_the_inertia_is_in_what_it_adds() -> None:
    turns = [shaking(sense, 1e-4, 2e-4, 0.006) for sense in (1.0, -1.0)]
    inertia = known_value("j_rotor_kgm2", 1e-4, 1e-5)
    (sure,) = slow_turns.of_still_shaft([line(60, 0.004)], turns, known_value("j_rotor_kgm2", 1e-4))
    (unsure,) = slow_turns.of_still_shaft([line(60, 0.004)], turns, inertia)
    assert math.sqrt(unsure.u**2 - sure.u**2) == pytest.approx(0.1 * 0.002, rel=0.1)
    assert slow_turns.of_still_shaft([line(60, 0.004)], turns, None) == [line(60, 0.004)]


def test_an_order_seen_on_even_positions_may_be_another() -> None:
    """12 slots and 14 poles make 84; on 100 positions it looks like 16."""
    plate = plated(slots=12, pole_pairs=7)
    assert holding_current._true_order(16, 100, Constants(), plate)[0] == 84
    assert "100 even positions show order 84 as 16" in holding_current._true_order(
        16, 100, Constants(), plate)[1]  # fmt: skip
    assert holding_current._true_order(84, 100, Constants(), plate) == (84, "")
    assert holding_current._true_order(17, 100, Constants(), plate) == (17, "")
    assert holding_current._true_order(16, None, Constants(), plate) == (16, "")
    assert holding_current._true_order(16, 100, Constants(), plated(slots=12)) == (16, "")


def test_held_out_sectors_leave_what_the_orders_do_not_explain() -> None:
    theta = np.linspace(0.0, TURN, 6001)[:-1]
    rng = np.random.default_rng(0)
    noise = 0.01 * rng.standard_normal((2, theta.size))
    turns = [Turn(theta if s > 0 else theta[::-1], np.cos(84.0 * (theta if s > 0 else theta[::-1]))
                  + 0.3 * s + noise[k], s) for k, s in enumerate((1, -1))]  # fmt: skip
    left = holding_current.held_out_residual(turns, [84])
    assert left is not None
    assert math.sqrt(np.mean(left**2)) == pytest.approx(0.01, rel=0.05)
    without = holding_current.held_out_residual(turns, [80])
    assert math.sqrt(np.mean(without**2)) == pytest.approx(math.sqrt(0.5), rel=0.05)
    assert holding_current._u_rms(left) == pytest.approx(0.01 / math.sqrt(2.0 * left.size), rel=0.2)
    few = [Turn(t.theta_rad[::300], t.value[::300], t.sense) for t in turns]
    assert holding_current.held_out_residual(few, [84, 12]) is None
