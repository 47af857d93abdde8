"""Cogging, its orders and the friction of a slow turn on simulated benches whose truth is known."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators.cogging import ESTIMATOR as COGGING
from pipeline.estimation.estimators.cogging import peak_orders
from pipeline.estimation.estimators.holding_current import ESTIMATOR as HOLDING_CURRENT
from pipeline.estimation.estimators.spin_down import ESTIMATOR as SPIN_DOWN
from pipeline.estimation.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.numerics.order_waveform import half_peak_to_peak
from pipeline.numerics.orders import OrderLine
from pipeline.numerics.turns import Spectrum
from pipeline.records.capture import Campaign
from tests.simulated import design
from tests.unit.estimation.mechanical import chain, fitted, number, recorded, without_some_angles
from tests.unit.estimation.signals import capture, estimates


@pytest.mark.slow
def test_lost_angles_do_not_take_creep_friction_away() -> None:
    """Turns and speed are those of the other rows."""
    captures = recorded("cogging")
    both = (captures, without_some_angles(captures, "cogging"))
    whole, found = (chain(c, SPIN_DOWN, COGGING).by("cogging", "torque_coulomb_nm") for c in both)
    assert whole is not None
    assert found is not None
    assert found.number == pytest.approx(whole.number, rel=1e-3)
    assert found.at["omega_mech_rad_s"] == pytest.approx(whole.at["omega_mech_rad_s"], rel=0.01)


def test_lost_angles_leave_the_cogging_order_of_the_holding_current() -> None:
    captures = recorded("cogging")
    known = chain(captures, TORQUE_MAP)
    damaged = without_some_angles(captures, "holding_current")
    orders = [fitted(HOLDING_CURRENT, c, known).estimates[0] for c in (captures, damaged)]
    assert [order.value for order in orders] == [84, 84]


def test_a_false_order_does_not_raise_the_cogging_peak() -> None:
    """Over a turn the crest of a stranger meets the others' somewhere: its whole height would add.

    Order 84 with 15 % of order 168 in quadrature; an order 131 at the level of the test is one in
    a hundred of noise. The weak second multiple counts as measured, tested or not.
    """
    orders = np.arange(1, 401, dtype=np.int64)
    coefficients = np.zeros((2, 400), dtype=np.complex128)
    coefficients[:, 83], coefficients[:, 167], coefficients[:, 130] = 1.0, 0.15j, 0.1
    coefficients[0, 200], coefficients[1, 200] = 0.01, -0.01
    spec = Spectrum(orders, coefficients, np.zeros(2), np.array([1, -1]))
    leading = OrderLine(84, 1.0 + 0.0j, 0.01, 20.0, 0.0)
    stranger = OrderLine(131, 0.1 + 0.0j, 0.01, 20.0, 5e-3)
    sure = replace(stranger, p_value=1e-9)
    kept = {line.order for line in peak_orders([leading, stranger], spec, [12, 14], [])}
    assert kept == {84, 168, 252}
    assert 131 in {line.order for line in peak_orders([leading, sure], spec, [12, 14], [])}
    s = (1.0 - np.sqrt(1.0 + 32.0 * 0.15**2)) / (8.0 * 0.15)
    peak = half_peak_to_peak(peak_orders([leading, stranger], spec, [12, 14], []))[0]
    assert peak == pytest.approx(np.sqrt(1.0 - s**2) * (1.0 - 0.3 * s), rel=1e-6)


def test_cogging_orders_and_creep_friction() -> None:
    motor = design("gimbal-5208")
    known = chain(recorded("cogging"), SPIN_DOWN, COGGING)
    size = 0.02 * motor.torque_rated_nm
    assert number(known, "cogging", "cogging_order") == 84
    amplitude = known.best("cogging_amplitude_nm")
    assert amplitude is not None
    assert 0.1 * size < amplitude.number < 10.0 * size
    assert "LCM of slots and poles" in amplitude.note
    drag = number(known, "cogging", "torque_coulomb_nm")
    assert drag == pytest.approx(motor.torque_coulomb_nm, rel=5e-3)


def test_no_cogging_is_a_result_with_a_limit() -> None:
    order, amplitude, *_ = fitted(COGGING, recorded()).estimates
    assert order.status == amplitude.status == "not_identifiable"
    assert "would have been" in order.note


def test_unbalance_is_no_cogging() -> None:
    order = fitted(COGGING, recorded("unbalance")).estimates[0]
    assert order.status == "not_identifiable"
    assert "unbalance or coupling" in order.note


def test_one_direction_leaves_friction_and_zero_together() -> None:
    captures = recorded("cogging")
    one = Campaign("m", captures.of("cogging")[:1])
    by_name = {e.name: e for e in fitted(COGGING, one).estimates}
    assert by_name["torque_coulomb_nm"].status == "not_identifiable"


def test_holding_current_sees_the_same_order() -> None:
    motor = design("gimbal-5208")
    captures = recorded("cogging")
    known = chain(captures, TORQUE_MAP, COGGING, HOLDING_CURRENT)
    assert number(known, "holding_current", "cogging_order") == 84
    turning = number(known, "cogging", "cogging_amplitude_nm")
    holding = number(known, "holding_current", "cogging_amplitude_nm")
    assert holding == pytest.approx(turning, rel=0.02)
    left = number(known, "holding_current", "holding_residual_a")
    assert left < 0.2 * holding / (1.5 * motor.pole_pairs * motor.psi_pm_wb)


@pytest.mark.slow
def test_the_uncertainty_of_creep_friction_is_its_scatter() -> None:
    """A turn each way, 720 samples of white noise s: half the difference of two means has a
    standard deviation of s sqrt(2/720)/2. 300 motors show it to 4 %.
    """
    friction, noise, count = 5e-3, 2e-4, 720
    theta = np.linspace(0.0, 2.0 * np.pi, count + 1)
    values, squares = [], []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        ways = [
            capture(
                "cogging",
                f"cogging_{sense}",
                u_rel_torque=0.0,
                t_s=np.arange(theta.size) * 0.01,
                theta_mech_rad=sense * theta,
                torque_shaft_nm=-sense * friction + noise * rng.standard_normal(theta.size),
            )
            for sense in (1, -1)
        ]
        found = estimates(COGGING, *ways)["torque_coulomb_nm"]
        values.append(found.number)
        squares.append(found.u**2)
    expected = noise * np.sqrt(2.0 / count) / 2.0
    assert np.sqrt(np.mean(squares)) == pytest.approx(expected, rel=0.04)
    assert np.std(values) == pytest.approx(expected, rel=0.12)
    assert np.mean(values) == pytest.approx(friction, abs=3.0 * expected / np.sqrt(300.0))
