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
from pipeline.lots.variance import nested, parted


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
        found.append([part.sd for part in parted(noisy, again, [], [])])
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
