"""The lot-level test over many simulated lots: how often it cries wolf, and what it sees.

Lots of 30 motors, twelve constants, twenty baseline lots; unit is the standard deviation between
motors of one lot. Every figure is judged with its own sampling error.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import chi, kstest, norm, ttest_ind
from scipy.stats import t as student

from pipeline.lots.lot_test import detectable, holm, lot_test, power

CONSTANTS, LOTS, MOTORS, HEALTHY = 12, 20, 30, 2000
ALPHA = 0.05


def draw(
    rng: np.random.Generator, count: int, lot_sd: float, shift: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Means of the baseline's lots [count, constants, lots] and of new ones [count, constants].

    Motors are drawn one by one; the first constant of a new lot is shifted.
    """
    shape = (count, CONSTANTS, LOTS + 1)
    means = lot_sd * rng.standard_normal(shape)
    means += rng.standard_normal((*shape, MOTORS), dtype=np.float32).mean(axis=-1)
    means[:, 0, LOTS] += shift
    return means[..., :LOTS], means[..., LOTS]


@pytest.mark.parametrize("lot_sd", [0.0, 0.2, 0.4])
def test_family_false_alarm(lot_sd: float) -> None:
    """2,000 healthy lots of 12 constants: at most 5 % alarm, band 6.5 % for the sampling."""
    rng = np.random.default_rng(int(100 * lot_sd) + 1)
    alarms = 0
    for _ in range(10):
        base, new = draw(rng, HEALTHY // 10, lot_sd)
        alarms += int(np.any(holm(lot_test(base, new).p_value) < ALPHA, axis=-1).sum())
    assert alarms / HEALTHY <= 0.065
    assert alarms / HEALTHY >= 0.03


def test_motor_level_test_cries_wolf() -> None:
    """Why the unit is the lot: 0.2 sd between lots fools a motor-level test in 40 to 50 %."""
    rng = np.random.default_rng(3)
    alarms = 0
    for _ in range(300):
        values = rng.standard_normal((CONSTANTS, LOTS + 1, MOTORS))
        values += 0.2 * rng.standard_normal((CONSTANTS, LOTS + 1, 1))
        base = values[:, :LOTS].reshape(CONSTANTS, -1)
        p = ttest_ind(values[:, LOTS], base, axis=-1).pvalue
        alarms += bool(np.any(holm(p) < ALPHA))
    assert 0.37 <= alarms / 300 <= 0.52


@pytest.mark.parametrize(("lot_sd", "least"), [(0.2, 0.95), (0.3, 0.77), (0.4, 0.5)])
def test_power(lot_sd: float, least: float) -> None:
    """A shift of 1.5 sd of one constant in twelve; table of docs/lots.md."""
    rng = np.random.default_rng(int(100 * lot_sd) + 7)
    count = 2000
    base, new = draw(rng, count, lot_sd, shift=1.5)
    seen = np.mean(holm(lot_test(base, new).p_value)[:, 0] < ALPHA)
    assert seen >= least
    se = math.hypot(lot_sd, 1.0 / math.sqrt(MOTORS)) * math.sqrt(1.0 + 1.0 / LOTS)
    told = power(1.5, se, LOTS - 1, ALPHA / CONSTANTS)
    # The true scatter of lots is known here and estimated there; Holm is a little above Bonferroni.
    assert seen == pytest.approx(told, abs=0.04)


def test_p_values_are_uniform() -> None:
    rng = np.random.default_rng(8)
    base, new = draw(rng, 300, 0.3)
    p = lot_test(base, new).p_value.ravel()
    assert kstest(p, "uniform").pvalue > 0.001


def test_link_of_stations_counts() -> None:
    """Station bias of 0.3 sd in the difference: ignored it alarms, with its u it does not."""
    rng = np.random.default_rng(9)
    base, new = draw(rng, 600, 0.2)
    biased = new + 0.3 * rng.standard_normal(new.shape)
    bare = np.any(holm(lot_test(base, biased).p_value) < ALPHA, axis=-1).mean()
    told = np.any(holm(lot_test(base, biased, 0.3).p_value) < ALPHA, axis=-1).mean()
    assert bare > 0.15
    assert told <= 0.075


def test_several_new_lots() -> None:
    """The mean of M new lots: two-sample t of lot means, where both sides scatter alike."""
    means = np.array([1.0, 1.2, 0.9, 1.1, 1.05, 0.95, 1.15, 1.0])
    tested = lot_test(means, 1.3, 0.0, new_lots=4)
    s = means.std(ddof=1)
    assert float(tested.t) == pytest.approx((1.3 - means.mean()) / (s * math.sqrt(1 / 8 + 1 / 4)))


def test_holm_by_hand() -> None:
    """P 0.01, 0.04, 0.03, 0.005 of four: 0.03, 0.06, 0.06, 0.02 (Holm 1979's step-down)."""
    assert holm([0.01, 0.04, 0.03, 0.005]) == pytest.approx([0.03, 0.06, 0.06, 0.02])
    assert holm([0.9, 0.8]) == pytest.approx([1.0, 1.0])


def test_detectable_is_where_the_power_is() -> None:
    shift = detectable(0.3, 19, 0.05 / 12, 0.95)
    assert power(shift, 0.3, 19, 0.05 / 12) == pytest.approx(0.95, abs=1e-9)


def test_no_scatter_at_all() -> None:
    same, other = lot_test([7.0, 7.0], 7.0), lot_test([7.0, 7.0], 8.0)
    assert float(same.p_value) == 1.0
    assert float(other.p_value) == 0.0
    with pytest.raises(ValueError, match="two"):
        lot_test([1.0], 1.0)


def test_one_lot_against_others_is_students_prediction() -> None:
    """The same as a two-sample t test with one value on the other side (equal variances)."""
    means = np.array([1.0, 1.3, 0.8, 1.1, 0.9])
    tested = lot_test(means, 1.9)
    known = ttest_ind([1.9], means)
    assert float(tested.t) == pytest.approx(known.statistic)
    assert float(tested.p_value) == pytest.approx(known.pvalue)
    assert float(tested.dof) == 4.0


def test_more_uncertainty_lowers_t_and_adds_degrees_of_freedom() -> None:
    """Means 0, 2 (variance 2, times 3/2 is 3) and u² = 1: t = 4/2, dof (4/3)² by Welch."""
    tested = lot_test([0.0, 2.0], 5.0, 1.0)
    assert float(tested.t) == pytest.approx(2.0)
    assert float(tested.dof) == pytest.approx(16.0 / 9.0)
    exact = lot_test([1.0, 1.0], 3.0, 0.5)
    assert float(exact.t) == pytest.approx(4.0)
    assert float(exact.dof) == 1.0


def test_power_against_counting_and_at_its_ends() -> None:
    rng = np.random.default_rng(4)
    x = rng.standard_normal((40_000, 10)) + 0.7
    t = x.mean(axis=1) / (x.std(axis=1, ddof=1) / math.sqrt(10))
    limit = 1.8331129326536335  # 0.95 quantile of Student's t, 9 degrees
    seen = np.mean(np.abs(t) > limit)
    assert power(0.7, 1.0 / math.sqrt(10), 9.0, 0.1) == pytest.approx(seen, abs=0.008)
    assert power(-0.7, 1.0 / math.sqrt(10), 9.0, 0.1) == pytest.approx(seen, abs=0.008)
    assert power(0.0, 1.0, 9.0, 0.1) == pytest.approx(0.1)
    assert (power(0.0, 0.0, 9.0, 0.1), power(0.5, 0.0, 9.0, 0.1)) == (0.1, 1.0)
    assert detectable(0.0, 9.0, 0.1) == 0.0
    assert power(detectable(5.0, 3.0, 0.01, 0.99), 5.0, 3.0, 0.01) == pytest.approx(0.99)


def test_holm_keeps_the_order_of_many_families_at_once() -> None:
    table = np.array([[0.02, 0.01, 0.9], [0.5, 0.001, 0.5]])
    assert holm(table) == pytest.approx(np.array([[0.04, 0.03, 0.9], [1.0, 0.003, 1.0]]))


@pytest.mark.parametrize("dof", [2.0, 3.0, 5.0, 9.0, 19.0, 40.0])
@pytest.mark.parametrize("alpha", [0.05, 0.05 / 12, 0.05 / 27])
def test_the_detectable_shift_by_quadrature(dof: float, alpha: float) -> None:
    """Power is E[Phi(delta - c s)] over s = sqrt(chi²/dof), whose tail below -c adds nothing.

    19 degrees at 0.05/27 once said 7.07 standard errors, where 5.48 are seen in 95 %.
    """
    shift = detectable(1.0, dof, alpha)
    critical = student.isf(alpha / 2.0, dof)
    s = np.linspace(0.0, 8.0, 80_001) + 5e-5
    density = chi.pdf(s * math.sqrt(dof), dof) * math.sqrt(dof) * 1e-4
    assert float((norm.cdf(shift - critical * s) * density).sum()) == pytest.approx(0.95, abs=1e-4)
