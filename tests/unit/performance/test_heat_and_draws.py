"""Thermal ratings against a stepped network, and draws against their covariance."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.performance.draws import interval, joint_draws, uniform_draws
from pipeline.performance.heat import Heat, continuous_current_a, time_to_limit_s
from pipeline.records.uncertainty import covariance
from tests.unit.performance.constants import estimate, salient

ONE = np.ones(1)


def stepped(
    r_wa: float, r_wm: float, r_ma: float, loss: float, growth: float, rise: float
) -> float:
    """Time [s] to a rise of the winding, by small steps; capacities of 40 and 300 J/K."""
    t_w = t_m = t = 0.0
    h = 2e-3
    while t_w < rise:
        p = loss * (1.0 + growth * t_w)
        t_w, t_m = (
            t_w + h / 40.0 * (p - t_w / r_wa - (t_w - t_m) / r_wm),
            t_m + h / 300.0 * ((t_w - t_m) / r_wm - t_m / r_ma),
        )
        t += h
    return t


def test_time_to_the_limit_is_that_of_the_network() -> None:
    r_wa, r_wm, r_ma = 4.0, 1.5, 2.0
    rth = 1.0 / (1.0 / r_wa + 1.0 / (r_wm + r_ma))
    heat = Heat(
        rth * ONE,
        40.0 * ONE,
        40.0 / (1.0 / r_wa + 1.0 / r_wm) * ONE,
        300.0 / (1.0 / r_wm + 1.0 / r_ma) * ONE,
    )
    for loss, rise in ((80.0, 70.0), (40.0, 60.0)):
        found = time_to_limit_s(heat, loss * ONE, 0.0037 * ONE, rise)
        assert found[0] == pytest.approx(stepped(r_wa, r_wm, r_ma, loss, 0.0037, rise), rel=1e-3)
    cool = time_to_limit_s(heat, 10.0 * ONE, 0.0 * ONE, 70.0)
    assert math.isinf(cool[0]), "10 W end at 18.7 K"
    assert time_to_limit_s(heat, 10.0 * ONE, 0.0 * ONE, 0.999 * 10.0 * rth)[0] > 100.0


def test_one_node_is_an_exponential() -> None:
    """T = -τ ln(1 - ΔT/(P R)), whatever stands for the body."""
    heat = Heat(2.0 * ONE, 30.0 * ONE, 60.0 * ONE, 1.0 * ONE)
    found = time_to_limit_s(heat, 50.0 * ONE, 0.0 * ONE, 80.0)
    assert found[0] == pytest.approx(-60.0 * math.log(1.0 - 80.0 / 100.0), rel=1e-6)


def test_continuous_current_settles_at_the_limit() -> None:
    current = continuous_current_a(1.5 * ONE, 0.07 * ONE, 80.0, 5.0 * ONE)
    assert 1.5 * (1.5 * 0.07 * current[0] ** 2 + 5.0) == pytest.approx(80.0)
    assert continuous_current_a(1.5 * ONE, 0.07 * ONE, 80.0, 60.0 * ONE)[0] == 0.0


def test_draws_have_the_covariance_of_the_budgets() -> None:
    known = salient()
    drawn = joint_draws(known, half=4000)
    assert all(drawn[name][0] == one.number for name, one in known.items())
    for one, other in (("ld_h", "lq_h"), ("r_phase_ohm", "psi_pm_wb"), ("r_phase_ohm", "ld_h")):
        told = covariance(known[one].budget, known[other].budget)
        seen = float(np.cov(drawn[one][1:], drawn[other][1:])[0, 1])
        scale = known[one].u * known[other].u
        assert seen / scale == pytest.approx(told / scale, abs=0.04), (one, other)
    assert np.all(drawn["pole_pairs"] == 4.0)
    again = joint_draws(dict(reversed(known.items())), half=4000)
    assert all(np.array_equal(again[name], drawn[name]) for name in known)


def test_interval_of_a_normal_is_1_96_u() -> None:
    drawn = joint_draws({"a": estimate("a", 1.0, "1", of=0.1)}, half=20_000)["a"]
    value, low, high = interval(drawn)
    assert (value, low, high) == pytest.approx((1.0, 1.0 - 0.196, 1.0 + 0.196), abs=0.004)


def test_what_lies_between_two_values_is_drawn_between_them() -> None:
    drawn = uniform_draws("magnet", 40.0, 120.0)
    assert drawn[0] == 80.0
    assert drawn.min() >= 40.0
    assert drawn.max() <= 120.0
    assert np.std(drawn[1:]) == pytest.approx(80.0 / math.sqrt(12.0), rel=0.06)
    assert not np.array_equal(drawn, uniform_draws("drag heat", 40.0, 120.0))


def test_a_source_keeps_its_sign_in_each_constant() -> None:
    """A current that is read too high makes the one large and the other small: the sum stays."""
    known = {"a": estimate("a", 1.0, "1", current=0.1), "b": estimate("b", 1.0, "1", current=-0.1)}
    drawn = joint_draws(known)
    assert np.std(drawn["a"]) > 0.05
    assert drawn["a"] + drawn["b"] == pytest.approx(2.0)
