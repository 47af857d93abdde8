"""Which numbers rows determine, on matrices whose answer is known in closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

from pipeline.numerics.identifiability import REACH, identify, known_combinations, walked, within

SPEED = np.linspace(10.0, 300.0, 200)
INERTIA, DRY, VISCOUS = 4e-5, 4e-3, 2e-5
COAST = np.array([INERTIA, DRY, VISCOUS])
NOISE_RAD_S2 = 0.05


def coast(units=(1.0, 1.0, 1.0), rows=()):
    """Rows of dω/dt = −(T_c + b ω)/J by J, T_c, b, each in `units` times its own unit."""
    drag = DRY + VISCOUS * SPEED
    slopes = [drag / INERTIA**2, -np.ones(SPEED.size) / INERTIA, -SPEED / INERTIA]
    whole = np.vstack([np.column_stack(slopes) / NOISE_RAD_S2, *rows])
    return identify(whole / np.array(units), COAST * np.array(units))


def test_a_coast_tells_neither_inertia_nor_friction():
    found = coast()
    assert not found.determined.any()
    assert np.isinf(found.u).all()
    direction = found.null[:, 0] / COAST
    assert direction == pytest.approx(np.full(3, direction[0]), rel=1e-6)


@pytest.mark.parametrize("units", [(1e6, 1.0, 1.0), (1e-6, 1e6, 1e3), (1.0, 1e-9, 1e9)])
def test_the_answer_does_not_depend_on_units(units):
    """Multiply the unit of a parameter by 1e6: the same parameters, the same ratios, the same
    relative uncertainties.
    """
    plain, other = coast(), coast(units)
    scale = np.array(units)
    assert (other.determined == plain.determined).all()
    one = known_combinations(plain, COAST, [0, 1, 2], [0])
    two = known_combinations(other, COAST * scale, [0, 1, 2], [0])
    assert [c.weights for c in one] == [c.weights for c in two]
    assert [c.u / c.value for c in two] == pytest.approx([c.u / c.value for c in one], rel=1e-6)
    torque = np.array([[0.0, 1.0, 100.0]]) / 1e-5
    assert (coast(units, torque).determined == coast((1.0, 1.0, 1.0), torque).determined).all()


def test_a_coast_tells_friction_over_inertia_as_well_as_a_fit_of_the_ratios():
    found = coast()
    ratios = known_combinations(found, COAST, [0, 1, 2], [0])
    assert [(c.product, c.weights) for c in ratios] == [
        (True, ((1, 1), (0, -1))),
        (True, ((2, 1), (0, -1))),
    ]
    design = np.column_stack([np.ones(SPEED.size), SPEED]) / NOISE_RAD_S2
    expected = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    assert [c.value for c in ratios] == pytest.approx([DRY / INERTIA, VISCOUS / INERTIA])
    assert [c.u for c in ratios] == pytest.approx(expected.tolist(), rel=1e-3)


def test_one_torque_makes_all_of_it_known():
    """A drag of 6 mN·m at 100 rad/s, known to 10 µN·m, is J to 1/600."""
    found = coast(rows=(np.array([[0.0, 1.0, 100.0]]) / 1e-5,))
    assert found.null.shape[1] == 0
    assert found.determined.all()
    assert found.u[0] / INERTIA == pytest.approx(1e-5 / 6e-3, rel=0.05)


def test_priors_are_information_and_weak_ones_little():
    """A prior of J to 30 % makes J known to 30 %, and one to 90 % does not make it known."""
    for share, known in ((0.3, True), (0.9, False)):
        found = coast(rows=(np.array([[1.0 / (share * INERTIA), 0.0, 0.0]]),))
        assert found.determined.tolist() == [known] * 3
        assert found.u / COAST == pytest.approx(np.full(3, share), rel=1e-3)


def test_a_minimum_norm_inverse_would_have_told_each_of_them():
    """What the function is for: J to eight digits from a coast alone."""
    rows = np.column_stack([DRY / INERTIA**2 * np.ones(200)] * 2)
    told = np.sqrt(np.diag(np.linalg.pinv(rows.T @ rows, hermitian=True)))
    assert (told < 1e-3 * INERTIA).all()
    assert np.isinf(identify(rows, np.full(2, INERTIA)).u).all()


def test_two_slow_turns_of_one_speed_tell_one_drag():
    sense = np.r_[np.ones(50), -np.ones(50)]
    found = identify(np.column_stack([sense, 0.25 * sense]) / 1e-4, np.array([4e-3, 1e-3]))
    assert np.isinf(found.u).all()
    (total,) = known_combinations(found, np.array([DRY, VISCOUS]), [0, 1], [])
    assert not total.product
    assert total.weights == ((0, 1.0), (1, pytest.approx(0.25, rel=1e-9)))
    assert total.value == pytest.approx(DRY + 0.25 * VISCOUS)
    assert total.u == pytest.approx(1e-4 / math.sqrt(100), rel=1e-6)


def test_a_product_is_found_where_only_a_product_is_in_the_data():
    values = np.array([3.0, 0.5])
    rows = np.array([[values[1], values[0]]]) / 1e-3
    (one,) = known_combinations(identify(rows, values), values, [0, 1], [0])
    assert (one.product, dict(one.weights)) == (True, {0: 1, 1: 1})
    assert (one.value, one.u) == (pytest.approx(1.5), pytest.approx(1e-3))


def test_three_that_make_one_number_are_told_as_that_number():
    """The mechanical time constant J R / ψ² has ψ alone squared: J R / ψ is what is looked for."""
    values = np.array([2.0, 5.0, 0.1])
    product = 2.0 * 5.0 / 0.1
    rows = product / values * np.array([[1.0, 1.0, -1.0]]) / 1e-2
    (one,) = known_combinations(identify(rows, values), values, [0, 1, 2], [2, 0, 1])
    assert dict(one.weights) == {0: 1, 1: 1, 2: -1}
    assert (one.value, one.u) == (pytest.approx(product), pytest.approx(1e-2))


def test_a_sum_of_a_known_and_a_free_number_is_not_told():
    rows = np.diag([1.0, 0.0]) / 1e-3
    found = identify(rows, np.ones(2))
    assert found.determined.tolist() == [True, False]
    assert known_combinations(found, np.ones(2), [1], [1]) == ()


def test_a_column_of_rounding_tells_nothing():
    """1e-16 where a move by the whole size would make nothing to be seen."""
    rng = np.random.default_rng(0)
    rows = np.column_stack([np.ones(50), 1e-9 * rng.standard_normal(50)])
    assert np.isinf(identify(rows, np.ones(2)).u).tolist() == [False, True]


def test_columns_that_are_nearly_alike_are_known_to_what_parts_them():
    """No rank is decided: what is nearly tied has an uncertainty, and it is the right one."""
    rng = np.random.default_rng(1)
    common, apart = rng.standard_normal((2, 4000))
    rows = np.column_stack([common, common + 1e-6 * apart]) / 1e-8
    found = identify(rows, np.ones(2))
    exact = np.sqrt(np.diag(np.linalg.inv(np.array([[1.0, 1.0], [1.0, 1.0 + 1e-12]]))))
    assert found.null.shape[1] == 0
    assert found.u / (1e-8 / math.sqrt(4000)) == pytest.approx(exact, rel=0.1)
    assert found.determined.all()


def test_known_is_what_is_known_better_than_to_its_own_size():
    u = np.array([0.9, 1.1, math.inf]) / REACH
    assert within(u, np.ones(3)).tolist() == [True, False, False]


def test_a_walk_leaves_what_is_known_as_it_is():
    found = coast()
    ratios = known_combinations(found, COAST, [0, 1, 2], [0])
    ends = [there for _, there in walked(found, COAST, ratios, math.log(2.0))]
    assert [there[0] / INERTIA for there in ends] == pytest.approx([0.5, 2.0]) or [
        there[0] / INERTIA for there in ends
    ] == pytest.approx([2.0, 0.5])
    for there in ends:
        assert there[1:] / there[0] == pytest.approx(COAST[1:] / COAST[0], rel=1e-9)


def test_fewer_rows_than_parameters_leave_the_rest_open():
    found = identify(np.array([[1.0, 1.0, 0.0]]), np.ones(3))
    assert found.null.shape == (3, 2)
    assert np.isinf(found.u).all()
    assert found.u_of(np.array([1.0, 1.0, 0.0])) == pytest.approx(1.0)


def test_a_size_of_nothing_is_refused():
    with pytest.raises(ValueError, match="size above zero"):
        identify(np.eye(2), np.array([1.0, 0.0]))


def test_a_walk_moves_nothing_that_is_left_out_of_its_direction():
    """What is in a product moves by its factor alone: the ends are each other's inverse."""
    found = coast()
    ratios = known_combinations(found, COAST, [0, 1, 2], [0])
    up, down = (there for _, there in walked(found, COAST, ratios, math.log(3.0)))
    assert up * down == pytest.approx(COAST**2, rel=1e-9)


@pytest.mark.parametrize(("slope", "sizes", "size"), [
    (2.0, (1.0, 10.0), 20.0), (0.5, (3.0, 4.0), 3.0), (-2.0, (1.0, 1.0), 2.0),
])  # fmt: skip
def test_a_sum_matters_at_the_larger_of_its_terms(slope, sizes, size):
    """Only x + w y is seen: its size is that of x, or w times that of y."""
    found = identify(np.array([[1.0, slope], [2.0, 2.0 * slope]]), np.array(sizes))
    (one,) = known_combinations(found, np.array([0.3, 0.2]), [0, 1], [])
    assert (one.product, one.weights) == (False, ((0, 1.0), (1, pytest.approx(slope))))
    assert one.size == pytest.approx(size)
    assert one.value == pytest.approx(0.3 + 0.2 * slope)
    assert one.u == pytest.approx(1.0 / math.sqrt(5.0))
