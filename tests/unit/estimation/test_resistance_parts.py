"""The parts of a resistance from plateaus whose answer is known."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.electrical.direct_current import Point as DcPoint
from pipeline.estimation.estimators import resistance
from pipeline.estimation.estimators.resistance import (
    _birge,
    _imbalance,
    _unknown_drop_ohm,
    columns_of,
    fit_direct_current,
    terminal_voltage,
)
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from tests.unit.estimation.points import MAP


def dc(i, pair="ab", *, r=1.0, v0=0.0, offset=0.0, temp=25.0, alpha=COPPER_COEFFICIENT_25_1_K,
       number=0, u_v=1e-4, u_i=1e-5, **meta):  # fmt: skip
    v = offset + v0 * math.copysign(1.0, i) + r * (1.0 + alpha * (temp - 25.0)) * i
    return DcPoint(number, pair, v, i, temp, u_v, u_i, replace(MAP.meta, **meta))


def plateaus(pair="ab", number=0, **how):
    return [dc(i, pair, number=number, **how) for i in (1.0, 2.0, -1.0, -2.0)]


def test_what_plateaus_can_tell_apart() -> None:
    found = columns_of([*plateaus("bc"), *plateaus("ab", 3), dc(2.0, "ca", number=7)])
    assert found.pairs == ("ab", "bc", "ca")
    assert found.offsets == (0, 3)
    assert found.drops == ("voltage@s",)
    assert (found.drop_start, found.size) == (5, 6)
    for ratio, there in ((1.19, False), (1.21, True)):
        two = [dc(1.0), dc(-1.0), dc(ratio)]
        assert bool(columns_of(two).drops) is there
    one_sign = columns_of([dc(1.0), dc(2.0)])
    assert (one_sign.offsets, bool(one_sign.drops)) == ((), True)


def test_the_row_of_a_plateau() -> None:
    columns = columns_of([*plateaus("ab"), *plateaus("bc", 1)])
    one = dc(-2.0, "bc", number=1, r=1.5, temp=45.0)
    row = terminal_voltage(one, columns, 0.004)
    factor = 1.08
    slope = 2.0 * COPPER_COEFFICIENT_25_1_K * 20.0 * one.v_v / factor
    assert row == pytest.approx([0.0, factor * -2.0, 0.0, 1.0, -1.0, slope])


@pytest.mark.parametrize("alpha", [0.0037, 0.0042])
def test_resistance_offset_drop_and_copper_from_plateaus(alpha: float) -> None:
    points = [*plateaus(v0=0.05, offset=0.02, temp=20.0, alpha=alpha),
              *plateaus(v0=0.05, offset=-0.01, temp=70.0, alpha=alpha, number=1)]  # fmt: skip
    columns = columns_of(points)
    free = fit_direct_current(points, columns, math.inf)
    assert free.alpha_1_k == pytest.approx(alpha, rel=1e-6)
    assert free.coefficients == pytest.approx([1.0, 0.02, -0.01, 0.05], rel=1e-6)
    assert free.dof == math.inf
    held = fit_direct_current(points, columns, 1e-9, alpha / COPPER_COEFFICIENT_25_1_K - 1.0)
    assert held.alpha_1_k == pytest.approx(alpha, rel=1e-6)
    assert held.u_alpha_1_k < 1e-9
    # the prior's own share is taken out of the scatter: alpha known from the data alone
    both_known = fit_direct_current(points, columns, 0.01)
    assert both_known.u_alpha_1_k < free.u_alpha_1_k


def test_the_scatter_of_a_resistance_by_hand() -> None:
    """Two signs of one current: R = (v+ - v-)/(2 i), u = hypot(u_v, R u_i)/(sqrt(2) i)."""
    points = [dc(2.0, u_v=3e-4, u_i=4e-4), dc(-2.0, u_v=3e-4, u_i=4e-4)]
    found = fit_direct_current(points, columns_of(points), 1e-9)
    assert found.coefficients == pytest.approx([1.0, 0.0], abs=1e-12)
    assert math.sqrt(found.covariance[0, 0]) == pytest.approx(5e-4 / math.sqrt(2.0) / 2.0)


def test_points_that_scatter_beyond_chance_widen_the_covariance() -> None:
    """Beyond 1 + 3 sqrt(2/n) of chi squared; with fewer than three points over, never."""
    for dof in (3, 8):
        limit = 1.0 + 3.0 * math.sqrt(2.0 / dof)
        for chi2, widened in ((0.99 * limit, False), (1.01 * limit, True)):
            normalised = np.full(4, math.sqrt(chi2 * dof / 4.0))
            assert _birge(normalised, dof) == pytest.approx(chi2 if widened else 1.0)
    assert _birge(np.full(4, 100.0), 2) == 1.0
    rough = [replace(p, v_v=p.v_v + s * 5e-3) for p, s in
             zip(plateaus() * 2, (1, -1, 1, 1, -1, -1, 1, -1), strict=True)]  # fmt: skip
    found = fit_direct_current(rough, columns_of(rough), 0.01)
    assert found.dof == 8 - 3
    assert math.sqrt(found.covariance[0, 0]) > 10.0 * 1e-4 / math.sqrt(20.0)


def test_a_drop_that_was_not_fitted_is_an_allowance_over_the_largest_current() -> None:
    options = {"drop_measured_v": 1e-3, "drop_commanded_v": 0.3}
    one = [dc(2.0), dc(-4.0)]
    columns = resistance.Columns(("ab",), (0,), ())
    assert _unknown_drop_ohm(one, columns, "ab", options) == pytest.approx(1e-3 / 4.0)
    driven = [dc(2.0, voltage_kind="commanded"), dc(-4.0)]
    assert _unknown_drop_ohm(driven, columns, "ab", options) == pytest.approx(0.3 / 4.0)
    fitted = resistance.Columns(("ab",), (0,), ("voltage@s",))
    assert _unknown_drop_ohm(one, fitted, "ab", options) == 0.0


def test_the_imbalance_is_the_range_over_the_mean() -> None:
    """U of the extremes' difference, widened by the range of three: 3.314/(1.96 sqrt 2)."""
    values = {"r_phase_ohm": 2.0, "r_a_ohm": 1.9, "r_b_ohm": 2.2, "r_c_ohm": 1.9 + 0.0}
    covariance = np.diag([0.0, 1e-4, 4e-4, 9e-4])
    covariance[1, 2] = covariance[2, 1] = 5e-5
    found = _imbalance(values, covariance, 7.0, [dc(2.0)], [MAP])
    assert found.number == pytest.approx(0.3 / 2.0)
    u = math.sqrt(1e-4 + 4e-4 - 1e-4) / 2.0 * 3.314 / (1.960 * math.sqrt(2.0))
    assert found.u_a == pytest.approx(u)
