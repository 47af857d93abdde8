"""Fits from normal matrices by group against least squares on the rows themselves."""

import numpy as np
import pytest

from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.normal_equations import NormalEquations, Prior, pseudo_inverse

GROUP = np.repeat([0, 1, 2], [40, 60, 30])
NOTHING = np.zeros(4)


def rows(bad=1.0):
    """Four columns in three groups, the last of which is off by a constant."""
    random = np.random.default_rng(5)
    matrix = random.normal(size=(GROUP.size, 4))
    residual = matrix @ [1.0, -2.0, 0.5, 0.0] + 0.5 * random.normal(size=GROUP.size)
    return matrix, residual + np.where(GROUP == 2, bad, 0.0)


def normal_equations(matrix, residual, precision=NOTHING, gradient=NOTHING):
    rows = np.column_stack([residual, matrix])
    return NormalEquations.of(rows, GROUP, 3, Prior(precision, gradient), DEFAULT.fit)


def test_groups_at_their_floor_make_an_ordinary_least_squares_fit():
    matrix, residual = rows(bad=0.0)
    end = normal_equations(matrix, residual).best()
    expected = np.linalg.lstsq(matrix, -residual, rcond=None)[0]
    assert end.step == pytest.approx(expected, rel=1e-9)
    left = (residual + matrix @ expected) ** 2
    assert end.reduced_chi2 == pytest.approx(
        [left[place].mean() for place in (n == GROUP for n in range(3))], rel=1e-9
    )


def test_a_group_that_misses_its_floor_counts_less():
    """Its weight is one over its own mean square, so that the others keep their answer."""
    matrix, residual = rows(bad=1000.0)
    end = normal_equations(matrix, residual).best()
    sound = GROUP != 2
    alone = np.linalg.lstsq(matrix[sound], -residual[sound], rcond=None)[0]
    everything = np.linalg.lstsq(matrix, -residual, rcond=None)[0]
    assert np.abs(end.step - alone).max() < 0.05
    assert np.abs(everything - alone).max() > 10.0


def test_a_prior_holds_what_the_rows_do_not_know():
    matrix, residual = rows(bad=0.0)
    matrix[:, 3] = 0.0
    prior_precision, prior_gradient = np.array([0.0, 0.0, 0.0, 4.0]), np.array([0.0, 0.0, 0.0, 2.0])
    end = normal_equations(matrix, residual, prior_precision, prior_gradient).best()
    # a nuisance of standard uncertainty 0.5 that stands at 0.5 goes back to its centre
    assert end.step[3] == pytest.approx(-0.5)


def test_moved_and_along_are_the_same_as_rows_moved_and_chosen():
    matrix, residual = rows()
    there = normal_equations(matrix, residual).moved(np.array([1, 3]), np.array([0.7, -0.2]))
    direct = normal_equations(matrix, residual + matrix[:, [1, 3]] @ [0.7, -0.2])
    assert there.power == pytest.approx(direct.power)
    assert there.slope == pytest.approx(direct.slope)
    some = there.only(np.array([0, 2])).best()
    left, none = residual + matrix[:, [1, 3]] @ [0.7, -0.2], np.zeros(2)
    again = normal_equations(matrix[:, [0, 2]], left, none, none).best()
    assert some.step == pytest.approx(again.step)
    assert some.deviance == pytest.approx(again.deviance)


def test_sheared_is_the_same_as_columns_added_to_another():
    matrix, residual = rows()
    by = np.array([[0.3, -1.0], [0.0, 2.0], [1.5, 0.4]])
    changed = matrix.copy()
    changed[:, 2] += (by[GROUP] * matrix[:, [0, 3]]).sum(axis=1)
    sheared = normal_equations(matrix, residual).sheared(2, np.array([0, 3]), by)
    direct = normal_equations(changed, residual)
    assert sheared.slope == pytest.approx(direct.slope)
    assert sheared.normal == pytest.approx(direct.normal)


@pytest.mark.parametrize("size", [0.0, 1e-170, 1e-160])
def test_a_column_of_next_to_nothing_is_one_that_no_row_observes(size):
    """A bump of friction at a speed that no coast comes near: squares of steps along it overflow,
    and a diagnosis ended with an error of the linear algebra.
    """
    matrix, residual = rows(bad=0.0)
    full = normal_equations(matrix[:, :3], residual, NOTHING[:3], NOTHING[:3]).best()
    matrix[:, 3] *= size
    end = normal_equations(matrix, residual).best()
    assert end.step == pytest.approx([*full.step, 0.0], rel=1e-9)
    assert end.deviance == pytest.approx(full.deviance, rel=1e-12)
    assert np.isfinite(pseudo_inverse(matrix.T @ matrix)).all()
