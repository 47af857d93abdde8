"""Equivalence, the moving average and capability against what theory and counting say."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.stats import t as student

from pipeline.lots.capability import capability
from pipeline.lots.chart import ewma_chart
from pipeline.lots.equivalence import equivalence
from pipeline.lots.outliers import critical_z, robust_z
from pipeline.lots.variance import nested, variance_components


def test_equivalence_is_inclusion_of_the_90_percent_interval() -> None:
    for difference in (0.0, 0.3, 0.6, 0.9, 1.5, -1.6):
        found = equivalence(difference, 0.2, 15.0, 1.0, 0.05)
        half = float(student.ppf(0.95, 15.0)) * 0.2
        assert found.low == pytest.approx(difference - half)
        inside = difference - half > -1.0 and difference + half < 1.0
        assert (found.status == "equivalent") == inside
        assert (found.status == "different") == (abs(difference) - half > 1.0)


def test_44_motors_show_half_a_sigma() -> None:
    """Against a known mean, margin 0.5 sd: 44 motors show sameness in 90 % (JCGM practice)."""
    rng = np.random.default_rng(2)
    shown = 0
    for _ in range(3000):
        x = rng.standard_normal(44)
        found = equivalence(x.mean(), 1.0 / math.sqrt(44), 1e9, 0.5, 0.05)
        shown += found.status == "equivalent"
    assert shown / 3000 == pytest.approx(0.9, abs=0.02)


def test_a_wrong_lot_is_seldom_called_the_same() -> None:
    """A difference of exactly the margin: shown to be the same in 5 % at most."""
    rng = np.random.default_rng(4)
    shown = sum(
        equivalence(d, 0.1, 1e9, 1.0, 0.05).status == "equivalent"
        for d in rng.normal(1.0, 0.1, 4000)
    )
    assert shown / 4000 <= 0.06


def test_published_run_lengths() -> None:
    """2,500 charts counted: 365 lots in control, 8.7 after a shift of one sd, within 5 %."""
    rng = np.random.default_rng(6)
    for shift, length, published in ((0.0, 3000, 365.0), (1.0, 90, 8.7)):
        means = rng.standard_normal((2500, length)) + shift
        signal = ewma_chart(means, np.zeros(2500), np.ones(2500)).signal
        first = np.where(signal.any(axis=1), signal.argmax(axis=1) + 1, length)
        assert first.mean() == pytest.approx(published, rel=0.05)


def test_cpk_by_hand_and_interval_by_counting() -> None:
    found = capability([9.0, 10.0, 11.0], 4.0, 13.0)
    assert found.cp == pytest.approx(1.5)
    assert found.cpk == pytest.approx(1.0)
    rng = np.random.default_rng(12)
    true = 1.2
    hits = 0
    for _ in range(1500):
        one = capability(rng.standard_normal(30), -3.0 * 1.5, 3.0 * true)
        assert one.cpk_low is not None
        assert one.cpk_high is not None
        hits += one.cpk_low <= true <= one.cpk_high
    assert hits / 1500 == pytest.approx(0.95, abs=0.02)
    assert capability([1.0, 1.0, 1.0], 0.0, 2.0).cpk is None
    assert capability([1.0, 2.0, 3.0], -math.inf, 5.0).cp is None


def test_components_come_back() -> None:
    """Lots 0.5, motors 1, captures 0.3: the mean of 200 estimates of each variance is true."""
    rng = np.random.default_rng(13)
    found = []
    for _ in range(200):
        lots = {
            str(k): (0.5 * rng.standard_normal() + rng.standard_normal(n)).tolist()
            for k, n in enumerate((5, 12, 20, 8, 15, 30))
        }
        again = [(rng.standard_normal() + 0.3 * rng.standard_normal(3)).tolist() for _ in range(6)]
        noisy = {
            name: (np.array(values) + 0.3 * rng.standard_normal(len(values))).tolist()
            for name, values in lots.items()
        }
        found.append([part.sd for part in variance_components(noisy, again, [], [])])
    squares = np.square(np.array([[sd or 0.0 for sd in row] for row in found])).mean(axis=0)
    assert squares[0] == pytest.approx(0.25, rel=0.2)
    assert squares[2] == pytest.approx(1.0, rel=0.05)
    assert squares[3] == pytest.approx(0.09, rel=0.08)


def test_one_lot_has_no_lot_component() -> None:
    assert nested([[1.0, 2.0, 3.0]]).between is None
    assert nested([[1.0], [2.0]]).within is None


def test_outliers_are_rare_among_healthy_motors_and_found_among_others() -> None:
    rng = np.random.default_rng(14)
    false = found = 0
    for _ in range(1000):
        lots = {"a": rng.standard_normal(12).tolist(), "b": (5 + rng.standard_normal(12)).tolist()}
        limit = critical_z(24, 2)
        false += any(abs(z) > limit for own in robust_z(lots).values() for z in own)
        lots["b"][3] = 5.0 + 9.0
        found += abs(robust_z(lots)["b"][3]) > limit
    assert false / 1000 <= 0.03
    assert found / 1000 >= 0.9


def test_nested_by_hand() -> None:
    """Groups 1, 3 | 6, 8, 10: means 2 and 8, grand 5.6; MSW (2 + 8)/3; MSB 2·12.96 + 3·5.76.

    n0 = 5 - 13/5 = 2.4.
    """
    found = nested([[1.0, 3.0], [], [6.0, 8.0, 10.0]])
    assert found.within == pytest.approx(10.0 / 3.0)
    assert found.between == pytest.approx((43.2 - 10.0 / 3.0) / 2.4)
    assert (found.dof_between, found.dof_within) == (1, 3)
    three = nested([[1.0, 3.0], [6.0, 8.0, 10.0], [4.0]])
    assert (three.dof_between, three.dof_within) == (2, 3)
    # means 2, 8, 4; grand 32/6; MSB = (2·(10/3)² + 3·(8/3)² + (4/3)²)/2; n0 = (6 - 14/6)/2
    msb = (200.0 + 192.0 + 16.0) / 9.0 / 2.0
    assert three.between == pytest.approx((msb - 10.0 / 3.0) / (11.0 / 6.0))
    assert nested([[1.0, 9.0], [2.0, 8.0]]).between == 0.0


def test_the_parts_of_a_spread_by_hand() -> None:
    """Repeats ±0.1 (variance 0.02), motors within lots of variance 2, two stations ±0.5."""
    lots = {"a": [1.0, 3.0], "b": [6.0, 8.0]}
    lot, station, motor, capture = variance_components(
        lots, [[4.9, 5.1], [7.0]], [0.3], [0.5, -0.5]
    )
    assert lot.sd == pytest.approx(math.sqrt((25.0 - 2.0) / 2.0))
    assert station.sd == pytest.approx(math.sqrt(0.5))
    assert motor.sd == pytest.approx(math.sqrt(2.0 - 0.02))
    assert capture.sd == pytest.approx(math.sqrt(0.02))
    assert [part.dof for part in (lot, station, motor, capture)] == [1.0, 1.0, 2.0, 1.0]
    shares = [part.share for part in (lot, station, motor, capture)]
    assert shares == pytest.approx([11.5 / 14.0, 0.5 / 14.0, 1.98 / 14.0, 0.02 / 14.0])


def test_without_repeats_the_fits_say_what_a_capture_scatters() -> None:
    lots = {"a": [1.0, 3.0]}
    lot, station, motor, capture = variance_components(lots, [[5.0]], [0.3, 0.4], [0.7])
    assert (lot.sd, station.sd) == (None, None)
    assert capture.sd == pytest.approx(math.sqrt(0.125))
    assert capture.dof is None
    assert motor.sd == pytest.approx(math.sqrt(2.0 - 0.125))
    assert motor.share == pytest.approx(1.875 / 2.0)
    nothing = variance_components({"a": [1.0, 3.0]}, [], [], [])
    assert nothing[3].sd is None
    assert nothing[2].sd == pytest.approx(math.sqrt(2.0))
    assert nothing[0].note == "needs two lots"
    single = variance_components({"a": [1.0], "b": [3.0]}, [], [], [])
    assert single[0].sd is None
    assert single[0].note == single[2].note == "needs two motors in a lot"
    still = variance_components({"a": [1.0, 1.0], "b": [1.0, 1.0]}, [], [], [])
    assert [part.share for part in still] == [None, None, None, None]


def test_the_two_one_sided_p_value() -> None:
    """Room 0.4 of standard error 0.2 with 15 degrees: P(t < -2) = 0.03197."""
    found = equivalence(-0.6, 0.2, 15.0, 1.0, 0.05)
    assert found.p_value == pytest.approx(float(student.sf(2.0, 15.0)))
    assert found.high == pytest.approx(-0.6 + float(student.ppf(0.95, 15.0)) * 0.2)
    assert found.status == "equivalent"
    assert found.dof == 15.0
    assert equivalence(0.5, 0.0, 1.0, 1.0, 0.05).p_value == 0.0
    assert equivalence(1.0, 0.0, 1.0, 1.0, 0.05).p_value == 1.0
    assert equivalence(1.5, 0.0, 1.0, 1.0, 0.05).status == "different"
    assert equivalence(1.0, 0.0, 1.0, 1.0, 0.05).status == "undecided"
    assert equivalence(-1.5, 0.01, 9.0, 1.0, 0.05).status == "different"
    with pytest.raises(ValueError, match="positive"):
        equivalence(0.0, 1.0, 1.0, 0.0, 0.05)


def test_the_moving_average_by_hand() -> None:
    """Weight 0.5 from centre 1: 3 gives 2, then 6 gives 4; limits 1 ± 2 sqrt((1 - 0.25^i)/3)."""
    chart = ewma_chart([[3.0, 6.0, 1.0]], [1.0], [1.0], 0.5, 2.0)
    assert chart.ewma.tolist() == [[2.0, 4.0, 2.5]]
    half = 2.0 * np.sqrt((1.0 - 0.25 ** np.arange(1, 4)) / 3.0)
    assert chart.high[0] == pytest.approx(1.0 + half)
    assert chart.low[0] == pytest.approx(1.0 - half)
    assert chart.signal.tolist() == [[False, True, True]]
    assert ewma_chart([[-1.0, -4.0, 1.0]], [1.0], [1.0], 0.5, 2.0).signal.tolist() == [
        [False, True, True]
    ]


def test_cpk_of_each_side_and_its_interval() -> None:
    """Bissell: half width 1.96 sqrt(1/(9n) + Cpk²/(2(n - 1)))."""
    values = [9.0, 10.0, 11.0]
    assert capability(values, 7.0, 16.0).cpk == pytest.approx(1.0)
    assert capability(values, 7.0, math.inf).cpk == pytest.approx(1.0)
    found = capability(values, 4.0, 13.0)
    half = 1.959963985 * math.sqrt(1.0 / 27.0 + 1.0 / 4.0)
    assert (found.cpk_low, found.cpk_high) == pytest.approx((1.0 - half, 1.0 + half))
    assert capability([1.0, 2.0], 0.0, 3.0).cpk is None
    assert capability(values, -math.inf, math.inf).cpk is None


def test_robust_distances_by_hand() -> None:
    """Deviations 1, 0, 1 | 3, 0, 3 pooled: median 1, six less two lots: 1.4826 sqrt(6/4)."""
    found = robust_z({"a": [1.0, 2.0, 3.0], "b": [7.0, 10.0, 13.0], "c": [5.0]})
    sd = 1.4826 * math.sqrt(6.0 / 4.0)
    assert found["a"] == pytest.approx([-1.0 / sd, 0.0, 1.0 / sd])
    assert found["b"] == pytest.approx([-3.0 / sd, 0.0, 3.0 / sd])
    assert found["c"] == [0.0]
    assert robust_z({"a": [1.0, 1.0, 1.0, 9.0]}) == {"a": [0.0, 0.0, 0.0, 0.0]}


def test_the_critical_distance_is_bonferroni_of_student() -> None:
    """37 motors in two lots: 0.37 · 35 degrees, level 0.01 over 37 motors, both sides."""
    expected = float(student.isf(0.01 / 74.0, 0.37 * 35))
    assert critical_z(37, 2) == pytest.approx(expected)
    assert critical_z(2, 1, 0.05) == pytest.approx(float(student.isf(0.05 / 4.0, 1.0)))
