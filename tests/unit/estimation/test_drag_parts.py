"""Drag of a shaft: curves over speed, what they leave open, and columns of the current."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.mechanical import drag
from pipeline.estimation.mechanical.drag import (
    _drag_part,
    _form_allowance,
    _row_sigma,
    _without_negative_excess,
    drag_beside_current,
    drag_of,
)
from pipeline.estimation.mechanical.drag_fit import Design, DragFit
from pipeline.estimation.mechanical.drag_forms import (
    CURVE,
    DRAG_FORMS,
    KNOTS,
    STRIBECK,
    _hat,
    low_end,
)
from pipeline.estimation.mechanical.drive_windows import freedom, too_short, torque_is_separable
from pipeline.estimation.mechanical.shaft_nuisances import CURRENT_LAG
from pipeline.estimation.mechanical.shaft_rows import COAST, DRIVE, ShaftRows
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit


def rows_of(kinds, *, cluster=None, y=None):
    kind = np.repeat([DRIVE, COAST], kinds)
    blank = np.zeros(kind.size)
    return ShaftRows(
        captures=(), capture=blank.astype(np.int64), kind=kind,
        cluster=(np.arange(kind.size) if cluster is None else cluster).astype(np.int64),
        time_s=blank, acceleration_rad_s2=blank if y is None else y, q_current_a=blank,
        warm_current_k_a=blank, product_a2=blank, load_nm=blank, ripple_nm=blank,
        u_ripple_nm=blank, speed_rad_s=blank, sense=blank,
        columns={}, fastest_rad_s=200.0, dropped=0,
    )  # fmt: skip


def test_hats_are_one_at_their_knot_and_add_to_one() -> None:
    x = np.array([-1.0, -0.5, 0.13, 0.3, 0.9])
    total = sum(_hat(k)(x) for k in range(len(KNOTS)))
    assert total == pytest.approx(np.sign(x))
    assert _hat(3)(np.array([0.1, -0.1, 0.13, 0.06, 0.16])) == pytest.approx([1, -1, 0.5, 0, 0])
    assert DRAG_FORMS["windage"](np.array([-0.5, 0.5])) == pytest.approx([-0.25, 0.25])
    for name, at_width in (
        ("gauss", math.exp(-1)),
        ("exponential", math.exp(-1)),
        ("rational", 0.5),
    ):
        bump = next(n for n in STRIBECK if n.startswith(f"stribeck {name}"))
        width = float(bump.split()[-1])
        assert DRAG_FORMS[bump](np.array([-width, width])) == pytest.approx([-at_width, at_width])
    widths = sorted({float(n.split()[-1]) for n in STRIBECK})
    assert (widths[0], len(widths)) == (0.008, 19)
    assert np.diff(np.log(widths)) == pytest.approx(math.log(1.2), abs=0.01)


def test_knots_lie_denser_towards_rest() -> None:
    """Gaps never shrink with speed; a chord of a square is off by a quarter of its width's."""
    gaps = np.diff(KNOTS)
    assert (KNOTS[0], KNOTS[-1]) == (0.0, 1.0)
    assert np.all(np.diff(gaps) > -1e-12)
    assert 0.25 * gaps.max() ** 2 == pytest.approx(0.0121)


def test_disjoint_windows_and_their_freedom() -> None:
    """Half of overlapping windows count; friction's two columns count where no coast fixes them."""
    for coasts, columns in ((11, 3), (12, 1)):
        rows = rows_of((21, coasts))
        assert rows.disjoint(DRIVE) == 11
        assert freedom(rows) == 11 - columns
    assert too_short(rows_of((21, 0))) == ""
    few = too_short(rows_of((20, 0)))
    assert "only 10 windows" in few
    assert "11 are needed" in few
    assert too_short(rows_of((17, 12))) == ""
    assert "9 are needed" in too_short(rows_of((16, 12)))


def test_a_torque_that_goes_with_speed_is_not_parted() -> None:
    speed = np.linspace(-1.0, 1.0, 30)
    sense = np.sign(speed)
    sigma = np.full(30, 2.0)
    for torque, parted in ((np.cos(speed), True), (3.0 * speed - sense, False)):
        design = np.column_stack([torque, sense, speed])
        assert torque_is_separable(design, sigma) is parted
        assert torque_is_separable(1e-9 * design, sigma) is parted


def test_each_kind_of_row_has_the_noise_that_it_leaves() -> None:
    rng = np.random.default_rng(0)
    x = rng.standard_normal(4000)
    noise = np.concatenate([0.5 * rng.standard_normal(2000), 0.02 * rng.standard_normal(2000)])
    rows = rows_of((2000, 2000))
    sigma = _row_sigma(rows, x[:, None], 3.0 * x + noise)
    assert sigma[:2000] == pytest.approx(0.5, rel=0.05)
    assert sigma[2000:] == pytest.approx(0.02, rel=0.05)
    exact = _row_sigma(rows, x[:, None], 3.0 * x)
    assert exact == pytest.approx(1e-6 * float(np.std(3.0 * x)))


def test_the_covariance_by_clusters_or_by_how_many_windows_count() -> None:
    rng = np.random.default_rng(1)
    x = rng.standard_normal(200)
    y = 2.0 * x + 0.1 * rng.standard_normal(200)
    sigma = np.full(200, 0.1)
    found = linear_fit(x[:, None], y, sigma)
    for clusters, robust in ((10, True), (9, False)):
        rows = rows_of((200, 0), cluster=np.arange(200) % clusters)
        covariance, dof = drag._covariance(rows, x[:, None], found, sigma)
        if robust:
            assert dof == 9
        else:
            tau = max(autocorrelation_time(found.residuals / sigma, 200), 2.0)
            assert covariance == pytest.approx(found.covariance * found.chi2_dof * tau)
            assert dof == freedom(rows)


def test_constants_from_coefficients() -> None:
    """G, T_c/J, B/J; of a free curve the line through its three slowest knots, and its slope."""
    blank = np.zeros(3)

    def fit_of(coefficients, free):
        values = np.array(coefficients)
        names = ("torque", *(CURVE if free else ("coulomb", "viscous")))
        return DragFit(
            names,
            values,
            np.diag(np.full(values.size, 1e-4)),
            blank,
            9,
            free,
            blank,
            ("", "", ""),
            np.eye(values.size),
            np.ones(values.size),
            values,
            200.0,
        )

    plain = fit_of([4.0, 8.0, 0.2], False)
    assert plain.constants(plain.coefficients) == pytest.approx([0.25, 2.0, 0.05])
    knots = np.array(KNOTS) * 200.0
    curve = 3.0 + 0.1 * knots
    free = fit_of([4.0, *curve], True)
    assert free.constants(free.coefficients) == pytest.approx([0.25, 0.75, 0.025])
    bent = curve + 1e-4 * knots**2
    level, slope = low_end(bent, 200.0)
    assert level == pytest.approx(float(np.polyfit(knots[:3], bent[:3], 1)[1]))
    assert slope == pytest.approx(float(np.polyfit(knots, bent, 1)[0]))
    # the factor's square is the covariance by the gradient: 1/g, a/g, b/g
    g, a, b = 4.0, 8.0, 0.2
    gradient = np.array([[-1 / g**2, 0, 0], [-a / g**2, 1 / g, 0], [-b / g**2, 0, 1 / g]])
    factor = plain.scatter()
    assert factor @ factor.T == pytest.approx(gradient @ (1e-4 * np.eye(3)) @ gradient.T, rel=1e-4)
    assert plain.refit(np.array([2.0, 0.0, 0.0]))[0] == pytest.approx(2.0)


def test_the_allowance_for_a_form_that_is_free() -> None:
    """The slowest knot, and the line through the next two, against the line through three."""
    rows = rows_of((3, 0))
    knots = np.array(KNOTS) * 200.0
    curve = 3.0 + 0.1 * knots
    curve[0] += 0.6
    allowance, reasons = _form_allowance(np.array([4.0, *curve]), True, rows)
    torque = curve / 4.0
    level = low_end(torque, 200.0)[0]
    beyond = torque[1] - (torque[2] - torque[1]) * KNOTS[1] / (KNOTS[2] - KNOTS[1])
    assert beyond == pytest.approx(0.75)
    spread = max(abs(torque[0] - level), abs(beyond - level))
    assert allowance == pytest.approx([0.0, spread, 0.0])
    slopes = np.diff(torque) / np.diff(knots)
    assert f"from {slopes.min():.2g} to {slopes.max():.2g} N·m·s/rad" in reasons[2]
    assert _form_allowance(np.array([4.0, 1.0, 1.0]), False, rows)[1] == ("", "", "")
    # knots that no row is near are zero: T_c of a propeller was 7e-16 ± 2e-14 N·m
    fast = replace(rows, speed_rad_s=np.full(rows.count, 0.07 * rows.fastest_rad_s))
    unseen = np.array([4.0, 1e-15, 2e-15, 1e-15, *curve[3:]])
    assert "slowest row turns at 14 rad/s" in _form_allowance(unseen, True, fast)[1][1]


def test_an_excess_below_coulomb_friction_is_left_out() -> None:
    rng = np.random.default_rng(2)
    x = rng.uniform(-1.0, 1.0, 300)
    base = np.column_stack([rng.standard_normal(300), -np.sign(x), -x])
    bump = STRIBECK[8]
    candidates = {bump: -DRAG_FORMS[bump](x), "offset": np.ones(300)}
    for size, kept in ((0.5, [bump, "offset"]), (-0.5, ["offset"])):
        y = base @ np.array([2.0, 3.0, 1.0]) + size * candidates[bump] + 0.1
        assert _without_negative_excess([bump, "offset"], base, candidates, y, np.ones(300)) == kept


def test_the_drag_of_a_fit_in_torque() -> None:
    design = np.column_stack([np.ones(4), np.arange(4.0), np.full(4, 2.0), np.full(4, 9.0)])
    fit = linear_fit(np.eye(4), np.array([4.0, 8.0, 0.4, 7.0]))
    found = _drag_part(Design(design, ("torque", "coulomb", "viscous", "offset")), fit)
    assert found == pytest.approx((8.0 * np.arange(4.0) + 0.8) / 4.0)


def test_the_doubt_of_a_shape_is_half_of_what_the_next_best_moves() -> None:
    rng = np.random.default_rng(3)
    x = rng.uniform(-1.0, 1.0, 400)
    base = np.column_stack([rng.standard_normal(400), -np.sign(x), -x])
    names = [n for n in STRIBECK if n.endswith(" 0.0498")] or STRIBECK[9::19][:3]
    candidates = {n: -DRAG_FORMS[n](x) for n in STRIBECK}
    used = names[0]
    y = base @ np.array([2.0, 3.0, 1.0]) + 0.8 * candidates[used]
    sigma = np.ones(400)
    own = linear_fit(np.column_stack([base, candidates[used]]), y, sigma).coefficients
    found = drag._shape_allowance(base, candidates, [used], own, y, sigma)
    others = [linear_fit(np.column_stack([base, candidates[n]]), y, sigma)
              for n in STRIBECK if n.split()[1] != used.split()[1]]  # fmt: skip
    best = min(others, key=lambda one: float(one.residuals @ one.residuals)).coefficients
    expected = [0.0] + [abs(best[k] / best[0] - own[k] / own[0]) / 2.0 for k in (1, 2)]
    assert found == pytest.approx(expected)
    assert found[1] > 0.0
    assert drag._shape_allowance(base, candidates, [], own, y, sigma).tolist() == [0.0, 0.0, 0.0]


@pytest.mark.parametrize(("drives", "coasts", "most"), [(120, 12, 5), (120, 0, 3), (20, 0, 0),
                                                        (900, 12, 14)])  # fmt: skip
def test_a_nuisance_takes_ten_windows(drives, coasts, most, monkeypatch) -> None:
    """Of windows that share no sample, less the columns that drives must determine; 14 at most."""
    asked: list[int] = []

    def needed(base, pool, y, sigma, level, limit, tau):
        asked.append(limit)
        return []

    monkeypatch.setattr(drag, "needed_columns", needed)
    rng = np.random.default_rng(0)
    speed = rng.uniform(-1.0, 1.0, drives + coasts)
    y = rng.standard_normal(speed.size)
    rows = rows_of((drives, coasts), y=y)
    forms = {name: form(speed) for name, form in DRAG_FORMS.items()}
    law = np.column_stack([rng.standard_normal(speed.size), -np.sign(speed), -speed])
    drag.drag_of(replace(rows, columns=forms), law, [], 0.01)
    assert asked[0] == most


def swung(cube, scatter, seed=2, late=0.0):
    """Windows of a drive whose acceleration is the torque over 1e-3 kg·m² less friction, with a
    cube of the current, scatter, and a rate of the current beside it.
    """
    rng, count = np.random.default_rng(seed), 400
    current = rng.choice([-1.0, -0.6, 0.6, 1.0], count) + 0.1 * rng.standard_normal(count)
    speed, rate = rng.uniform(-80.0, 80.0, count), rng.standard_normal(count)
    law = np.column_stack([current, -np.sign(speed), -speed])
    y = law @ np.array([1e3, 40.0, 0.5]) + cube * current**3 + late * rate
    columns = {CURRENT_LAG: rate, "q current cubed": current**3}
    columns |= {name: form(speed / 80.0) for name, form in DRAG_FORMS.items()}
    bare = rows_of((count, 0), y=y + scatter * rng.standard_normal(count))
    rows = replace(bare, speed_rad_s=speed, q_current_a=current, columns=columns)
    return rows, drag_of(rows, law, [CURRENT_LAG, "q current cubed"], 0.05)


@pytest.mark.parametrize(
    ("cube", "scatter", "least", "most"), [(120.0, 1.0, 0.0, 5e-3), (60.0, 120.0, 0.03, 0.12)]
)
def test_a_cube_of_the_current_is_in_doubt_by_what_it_leaves(cube, scatter, least, most) -> None:
    """A bent torque that explains the rows is sure; one that follows an error beside others takes
    the torque's place: J of sound motors was 5 to 12 % too large at 5 to 7 u.
    """
    rows, drag = swung(cube, scatter)
    assert "q current cubed" in drag.names
    doubt = drag_beside_current(rows, drag, smoothed=False).u_form[0]
    assert least < math.sqrt(doubt**2 - drag.u_form[0] ** 2) / 1e-3 < most


@pytest.mark.parametrize(("smoothed", "sure"), [(False, True), (True, False)])
def test_the_instant_of_a_current_is_sure_beside_an_angle(smoothed: bool, sure: bool) -> None:
    rows, drag = swung(0.0, 5.0, late=50.0)
    assert CURRENT_LAG in drag.names
    doubt = drag_beside_current(rows, drag, smoothed).u_form
    assert np.array_equal(doubt, drag.u_form) is sure
