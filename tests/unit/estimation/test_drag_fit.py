"""Drag fitted to rows written out by hand: what widens it, and in which units it is told."""

from __future__ import annotations

import re

import numpy as np
import pytest
from numpy.typing import NDArray

from pipeline.estimation.estimators.inertia import acceleration
from pipeline.estimation.mechanical.drag import _form_allowance, drag_of
from pipeline.estimation.mechanical.drag_fit import DragFit
from pipeline.estimation.mechanical.drag_forms import CURVE, DRAG_FORMS, KNOTS, SHAPES, STRIBECK
from pipeline.estimation.mechanical.shaft_rows import COAST, DRIVE, ShaftRows
from pipeline.numerics.least_squares import linear_fit

Array = NDArray[np.float64]
J, COULOMB, VISCOUS, FASTEST = 4e-5, 5e-3, 2e-5, 300.0
LEVEL = 0.001


def straight(share: Array) -> Array:
    return COULOMB * np.sign(share) + VISCOUS * FASTEST * share


def excess(share: Array) -> Array:
    """Stribeck's, of a shape in use."""
    return straight(share) + COULOMB * np.sign(share) * SHAPES["exponential"](share / 0.05)


def eddy_brake(share: Array) -> Array:
    """Rises to its most at a tenth of the fastest and falls (Smythe's law)."""
    return straight(share) + 6.0 * COULOMB * share / 0.1 / (1.0 + (share / 0.1) ** 2)


def rows_of(drag, noise_rad_s2: float, seed: int, drives: int = 60) -> tuple[ShaftRows, Array]:
    """Rows of drives and of one coast of a shaft with this drag [N·m], and the driving torque."""
    rng = np.random.default_rng(seed)
    coast = np.geomspace(1.0, 0.01, 80)
    share = np.concatenate(
        [rng.uniform(0.02, 1.0, drives) * rng.choice([-1.0, 1.0], drives), coast]
    )
    kind = np.repeat([DRIVE, COAST], [drives, coast.size])
    torque = np.where(kind == DRIVE, rng.normal(0.0, 10.0 * COULOMB, share.size), 0.0)
    noise = noise_rad_s2 * rng.standard_normal(share.size)
    blank = np.zeros(share.size)
    rows = ShaftRows(
        captures=(),
        capture=blank.astype(np.int64),
        kind=kind,
        cluster=kind.astype(np.int64),
        time_s=np.arange(share.size) * 0.01,
        acceleration_rad_s2=(torque - drag(share)) / J + noise,
        q_current_a=blank,
        warm_current_k_a=blank,
        product_a2=blank,
        load_nm=blank,
        ripple_nm=blank,
        u_ripple_nm=blank,
        speed_rad_s=share * FASTEST,
        sense=np.sign(share),
        columns={name: function(share) for name, function in DRAG_FORMS.items()},
        fastest_rad_s=FASTEST,
        dropped=0,
    )
    return rows, torque


def fitted(drag, noise_rad_s2: float = 1.0, seed: int = 0) -> tuple[DragFit, ShaftRows]:
    rows, torque = rows_of(drag, noise_rad_s2, seed)
    return drag_of(rows, acceleration(rows, torque), (), LEVEL), rows


def test_windows_that_share_half_their_samples_count_half() -> None:
    """Noise that shows no correlation: half-overlapping windows are half as many all the same."""
    found, _ = fitted(straight)
    assert found.names == ("torque", "coulomb", "viscous")
    alone = linear_fit(found.design, found.target, found.sigma)
    assert found.covariance == pytest.approx(2.0 * alone.covariance * alone.chi2_dof)


def test_another_shape_of_the_excess_moves_drag_by_twice_its_doubt() -> None:
    """Each shape at its best width: the second best tells how far off the law may be."""
    found, rows = fitted(excess)
    (bump,) = (name for name in found.names if name in STRIBECK)
    assert "exponential" in bump

    plain = found.design[:, [name != bump for name in found.names]]

    def law(name: str) -> tuple[float, Array]:
        design = np.column_stack([plain, -rows.columns[name]])
        fit = linear_fit(design, found.target, found.sigma)
        return fit.chi2_dof, fit.coefficients[1:3] / fit.coefficients[0]

    others = [law(name) for name in STRIBECK if "exponential" not in name]
    second = min(others, key=lambda one: one[0])[1]
    apart = np.abs(second - law(bump)[1])
    assert found.u_form == pytest.approx([0.0, *apart / 2.0], rel=1e-6)
    assert np.all(found.u_form[1:] > 0.0)


@pytest.mark.parametrize("seed", range(4))
def test_the_noise_of_a_coast_is_no_other_form(seed: int) -> None:
    """A tenth of its deceleration, which a curve leaves over as two constants do."""
    found, _ = fitted(straight, noise_rad_s2=0.1 * (COULOMB + VISCOUS * FASTEST) / J, seed=seed)
    assert not found.free
    assert found.constants(found.coefficients)[1] == pytest.approx(COULOMB, rel=0.5)


def test_a_curve_that_is_open_at_standstill_tells_no_dry_friction() -> None:
    """A curve of the same torque at every knot but the lowest, which no row supports."""
    rows, _ = rows_of(straight, 1.0, 0)
    for lowest, told in ((1.1 * COULOMB, True), (100.0 * COULOMB, False)):
        curve = np.full(len(KNOTS), COULOMB)
        curve[0] = lowest
        spread, (_, dry, _) = _form_allowance(np.array([1.0, *curve]) / J, True, rows)
        assert (dry == "") is told
        assert bool(spread[1] < COULOMB) is told


def test_slopes_of_a_free_curve_are_told_per_speed() -> None:
    """N·m·s/rad: from knot to knot of the true drag, over that many rad/s."""
    found, _ = fitted(eddy_brake, noise_rad_s2=0.01)
    assert found.names[1 : 1 + len(CURVE)] == CURVE
    told = re.search(r"slope runs from (\S+) to (\S+) N·m·s/rad", found.reasons[2])
    assert told is not None
    shares = np.maximum(KNOTS, 1e-9)
    slopes = np.diff(eddy_brake(shares)) / np.diff(shares * FASTEST)
    assert float(told[1]) == pytest.approx(slopes.min(), rel=0.1)
    assert float(told[2]) == pytest.approx(slopes.max(), rel=0.1)
