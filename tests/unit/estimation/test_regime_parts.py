"""Regimes of one capture: halves of its rows and the coefficient of each."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.uncertainty.regimes import (
    Partition,
    Regression,
    _of_partition,
    halves,
    information,
    signs,
)
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.uncertainty import Contribution


def test_rows_are_halved_by_what_they_tell() -> None:
    """Information 1, 1, 1, 1, 4 in the order of the values: half is reached after the fourth."""
    values = np.array([5.0, 1.0, 3.0, 2.0, 4.0])
    told = np.array([4.0, 1.0, 1.0, 1.0, 1.0])
    everyone = np.ones(5, dtype=bool)
    found = halves("speed", values, "slow", "fast", told, everyone)
    assert found.labels.tolist() == [1, 0, 0, 0, 0]
    assert halves("speed", values, "slow", "fast", np.ones(5), everyone).labels.tolist() == [
        1,
        0,
        1,
        0,
        1,
    ]
    some = np.array([True, True, True, False, True])
    assert halves("x", values, "a", "b", told, some).labels.tolist() == [1, 0, 0, -1, 0]
    assert signs(
        "x", np.array([-1.0, 0.0, 2.0]), "a", "b", np.array([True, True, True])
    ).labels.tolist() == [0, 0, 1]


def regressed(slopes, n=60, noise=0.01, seed=0, cluster=None):
    """Y = 3 + slope x with a slope of its own for each third or half of the rows."""
    rng = np.random.default_rng(seed)
    x = rng.uniform(-1.0, 1.0, n * len(slopes))
    labels = np.repeat(np.arange(len(slopes)), n)
    y = 3.0 + np.array(slopes)[labels] * x + noise * rng.standard_normal(x.size)
    clusters = np.arange(x.size) // 2 if cluster is None else cluster
    return Regression(
        np.column_stack([x, np.ones(x.size)]), y, np.full(x.size, noise), clusters
    ), labels


def test_information_is_a_columns_own_part() -> None:
    made, _ = regressed([1.0])
    x = made.design[:, 0]
    own = (x - x.mean()) ** 2
    assert information(made, 0) == pytest.approx(own / own.sum())


def test_a_coefficient_of_each_regime_relative_to_the_common_one() -> None:
    made, labels = regressed([1.0, 1.1])
    told = information(made, 0)
    found = _of_partition(made, 0, told, Partition("half", labels, ("one", "other")))
    assert found is not None
    common = linear_fit(made.design, made.y, made.sigma).coefficients[0]
    assert found.relative == pytest.approx(np.array([1.0, 1.1]) / common, rel=5e-3)
    assert "half beyond chance" in found.words("it")
    part = found.part("x", 2.0)
    assert part.u == pytest.approx(2.0 * found.between.sd)
    assert isinstance(part, Contribution)
    few = np.where(np.arange(120) < 19, 1, 0)
    assert _of_partition(made, 0, told, Partition("few", few, ("one", "other"))) is None
    enough = np.where(np.arange(120) < 20, 1, 0)
    assert _of_partition(made, 0, told, Partition("few", enough, ("one", "other"))) is not None
    alone_ = Partition("all", np.zeros(120, dtype=np.int64), ("one", "other"))
    assert _of_partition(made, 0, told, alone_) is None


@pytest.mark.parametrize("scale", [8.0, 0.125])
def test_what_regimes_say_has_no_unit(scale: float) -> None:
    """All in another unit: relative values, their scatter and its chance stay."""
    made, labels = regressed([1.0, 1.15], noise=0.3)
    told = information(made, 0)
    half = Partition("half", labels, ("one", "other"))
    other = replace(made, y=scale * made.y, sigma=scale * made.sigma)
    one, same = _of_partition(made, 0, told, half), _of_partition(other, 0, told, half)
    assert one is not None
    assert same is not None
    assert same.relative == pytest.approx(one.relative)
    assert 0.0 < one.between.p_value < 1.0
    assert same.between.p_value == pytest.approx(one.between.p_value)
    assert same.between.sd == pytest.approx(one.between.sd)


def test_a_regime_without_the_column_has_no_value_of_it() -> None:
    """Coasts have no torque: their viscous friction was read as the inertia of braking."""
    made, labels = regressed([1.0, 1.0])
    made.design[labels == 1, 0] = 0.0
    y = 3.0 + made.design[:, 0] + 0.01 * np.random.default_rng(1).standard_normal(labels.size)
    made, told = replace(made, y=y), np.full(labels.size, 1.0 / labels.size)
    assert _of_partition(made, 0, told, Partition("half", labels, ("one", "other"))) is None
