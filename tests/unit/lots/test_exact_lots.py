"""A comparison small enough to be worked out by hand, number by number."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import nct, ttest_ind
from scipy.stats import t as student

from pipeline.lots.assess import _p_value
from pipeline.lots.cogging import cogging_bands, order_levels
from pipeline.lots.regression import compare_lots
from pipeline.lots.traits import Shown, compare_traits, orders_shown
from pipeline.physics.glossary import CONSTANTS
from pipeline.records.datasheet import Datasheet
from pipeline.records.estimate import Order
from pipeline.records.limits import Amount, ConstantLimits
from tests.unit.lots import production as line

NAME = "r_phase_ohm"
SHAPE = np.array([-0.03, 0.01, 0.02])
MEANS = 1.0 + 0.01 * np.array([0.0, 2.0, -1.0, 1.0, -2.0, 0.5, -0.5, 1.5])


def lot(
    name: str, values: Sequence[float], station: str = "S1", u: float = 1e-6
) -> list[Datasheet]:
    return [
        line.sheet(f"{name}-{k}", name, station, {NAME: float(v)}, u=u)
        for k, v in enumerate(values)
    ]


def base() -> list[list[Datasheet]]:
    """Eight lots of three motors each, means as above, all of one shape."""
    return [lot(f"L{k}", mean + SHAPE) for k, mean in enumerate(MEANS)]


def compare(candidate: Sequence[Datasheet], **more):
    limits = replace(
        line.limits((NAME,)), constants=(ConstantLimits(NAME, 1.0, Amount(0.1, "unit")),)
    )
    found = compare_lots(line.samples(base(), candidate, **more), limits, CONSTANTS)
    return found.constants[0], limits


def test_the_test_of_lots_is_students() -> None:
    found, limits = compare(lot("N", 1.05 + SHAPE))
    known = ttest_ind([1.05], MEANS)
    assert found.test.t == pytest.approx(known.statistic, rel=1e-3)
    assert found.test.dof == pytest.approx(7.0, rel=1e-3)
    assert found.test.p_value == pytest.approx(known.pvalue, rel=5e-3)
    assert found.test.p_holm == pytest.approx(found.test.p_value)
    assert (found.test.lots, found.test.needed) == (8, limits.min_lots)
    assert found.effect.difference == pytest.approx(1.05 - MEANS.mean())
    assert found.effect.relative == pytest.approx((1.05 - MEANS.mean()) / MEANS.mean())
    within = SHAPE.std(ddof=1)
    assert found.effect.in_sd == pytest.approx((1.05 - MEANS.mean()) / within, rel=1e-3)
    assert found.power.shift == pytest.approx(1.5 * within, rel=1e-3)
    se = MEANS.std(ddof=1) * math.sqrt(9.0 / 8.0)
    limit = student.isf(limits.alpha / 2.0, 7.0)
    expected = nct.sf(limit, 7.0, 1.5 * within / se)
    assert found.power.power == pytest.approx(expected, rel=0.01)


def test_lots_stand_in_order_of_time_with_their_chart() -> None:
    found, _ = compare(lot("N", 1.05 + SHAPE))
    assert [one.lot for one in found.lots] == [*(f"L{k}" for k in range(8)), "N"]
    assert [one.mean for one in found.lots] == pytest.approx([*MEANS, 1.05])
    assert [one.sd for one in found.lots] == pytest.approx([SHAPE.std(ddof=1)] * 9)
    assert found.lots[0].u == pytest.approx(SHAPE.std(ddof=1) / math.sqrt(3.0), rel=1e-3)
    average = MEANS.mean()
    for one in found.lots:
        average = 0.2 * one.mean + 0.8 * average
        assert one.ewma == pytest.approx(average)
    half = 2.86 * MEANS.std(ddof=1) * math.sqrt(0.2 / 1.8)
    last = math.sqrt(1.0 - 0.8**18)
    assert found.lots[-1].ewma_high == pytest.approx(MEANS.mean() + half * last, rel=0.02)
    assert found.lots[-1].ewma_low == pytest.approx(MEANS.mean() - half * last, rel=0.02)


def test_limits_of_the_design_hold_every_motor() -> None:
    found, _ = compare(lot("N", [1.09, 1.11, 0.95]))
    own = {m.motor_id: m.decision for m in found.motors if m.side == "candidate"}
    assert own == {"N-0": "pass", "N-1": "fail", "N-2": "pass"}
    assert found.conformity.worst_motor == "N-1"
    assert found.verdict == "fail"
    assert found.temperature_degc == 25.0


def test_golden_motors_take_the_other_stations_bias_off() -> None:
    """Three golden motors read 0.04 more on S2, where the candidate was measured.

    Each station gets half of it; the candidate's 1.05 is 1.01 against the baseline's.
    """
    golden = [
        line.sheet(f"g{k}", None, station, {NAME: 1.0 + 0.1 * k + bias}, run=run)
        for k in range(3)
        for run, (station, bias) in enumerate((("S1", 0.0), ("S2", 0.04)))
    ]
    found, _ = compare(lot("N", 1.05 + SHAPE, "S2"), repeats=golden, golden=("g0", "g1", "g2"))
    assert found.effect.difference == pytest.approx(1.01 - MEANS.mean(), abs=1e-4)
    by_motor = {m.motor_id: m for m in found.motors}
    assert by_motor["N-0"].correction == pytest.approx(-0.02, abs=1e-4)
    assert by_motor["L0-0"].correction == pytest.approx(0.02, abs=1e-4)
    assert by_motor["N-0"].value == pytest.approx(1.05 - 0.03 - 0.02, abs=1e-4)
    assert {s.station: s.bias for s in found.stations} == pytest.approx(
        {"S1": -0.02, "S2": 0.02}, abs=1e-4
    )


def test_an_outlier_is_told_in_robust_deviations() -> None:
    values = [1.0, 1.01, 0.99, 1.02, 0.98, 1.005, 0.995, 1.5]
    found, _ = compare(lot("N", values))
    own = {m.motor_id: m for m in found.motors if m.side == "candidate"}
    assert own["N-7"].outlier
    assert own["N-7"].z > 10.0
    assert not own["N-3"].outlier
    assert own["N-3"].z == pytest.approx(-own["N-4"].z, rel=0.5)


def wave(alpha: float, side: str, motor: str, phase: float = 0.3):
    """Orders 4 (1 N·m) and 6 (0.4 N·m) of one motor, its encoder turned by `alpha`."""
    orders = (Order(4, 1.0, 0.01, 4.0 * alpha), Order(6, 0.4, 0.01, phase + 6.0 * alpha))
    made = line.sheet(motor, "A", "S1", {NAME: 1.0}, orders=orders)
    return line.members([made], side)  # type: ignore[arg-type]


@pytest.mark.parametrize(("phase", "crest"), [(0.3, 0.3), (2.0, 2.0 + math.pi), (-1.0, -1.0)])
def test_the_encoders_zero_does_not_blur_the_mean_wave(phase: float, crest: float) -> None:
    """Motors turned anyhow: one wave without spread, its highest common crest at zero.

    At the crests of order 4 order 6 has its phase or pi more: the one whose cosine is positive.
    """
    alphas = (0.0, 0.7, 2.0, -1.3)
    members = [m for k, a in enumerate(alphas) for m in wave(a, "baseline", f"m{k}", phase)]
    (band,) = cogging_bands(members)
    theta, mean = np.array(band.theta_mech_rad), np.array(band.mean_nm)
    assert np.ptp([np.array(band.low_nm), np.array(band.high_nm)], axis=0) == pytest.approx(
        0.0, abs=1e-9
    )
    assert mean == pytest.approx(np.cos(4 * theta) + 0.4 * np.cos(6 * theta + crest), abs=1e-9)
    assert (theta[0], theta[-1], theta.size) == (0.0, pytest.approx(2 * np.pi), 24 * 6 + 1)


def test_levels_of_orders_count_motors_that_lack_one_as_zero() -> None:
    one = wave(0.0, "baseline", "m0")
    bare = line.sheet("m1", "A", "S1", {NAME: 1.0}, orders=(Order(4, 3.0, 0.01, 0.0),))
    levels = {o.order: o for o in order_levels([*one, *line.members([bare], "baseline")])}
    assert set(levels) == {4, 6}
    assert (levels[4].mean, levels[6].mean) == pytest.approx((2.0, 0.2))
    assert levels[6].sd == pytest.approx(0.4 / math.sqrt(2.0))
    assert (levels[6].shown, levels[6].motors) == (1, 2)


def test_orders_count_from_a_share_of_the_typical_leading_one() -> None:
    """Leading orders 1, 1 and 3: the median is 1, of which 0.4 is two fifths."""
    members = [*wave(0.0, "baseline", "m0"), *wave(1.0, "candidate", "m1")]
    strong = line.sheet("m2", "A", "S1", {NAME: 1.0}, orders=(Order(4, 3.0, 0.01, 0.0),))
    members += line.members([strong], "candidate")
    both = {"cogging_order_4", "cogging_order_6"}
    assert set(orders_shown(members, 0.39)[0].sizes) == both
    assert set(orders_shown(members, 0.41)[0].sizes) == {"cogging_order_4"}


def shown(side: str, lot_name: str, having: int, motors: int) -> list[Shown]:
    return [
        Shown(f"{lot_name}-{k}", lot_name, side, {"x": 1.0} if k < having else {})  # type: ignore[arg-type]
        for k in range(motors)
    ]


def test_a_trait_that_one_earlier_lot_mostly_had_is_not_new() -> None:
    new = shown("candidate", "N", 20, 20)
    clean = shown("baseline", "A", 0, 20)
    (change,) = compare_traits([*clean, *new], "datasheet")
    assert change.verdict == "fail"
    assert change.p_value == pytest.approx(2.0 / math.comb(40, 20), rel=1e-6)
    (change,) = compare_traits([*clean, *shown("baseline", "B", 5, 10), *new], "datasheet")
    assert change.verdict == "marginal"
    (change,) = compare_traits([*clean, *shown("baseline", "B", 4, 10), *new], "datasheet")
    assert change.verdict == "fail"


def test_few_motors_that_all_show_it_leave_it_undecided() -> None:
    few = [*shown("baseline", "A", 0, 2), *shown("candidate", "N", 2, 2)]
    (change,) = compare_traits(few, "datasheet")
    assert change.verdict == "undecided"
    (change,) = compare_traits([*few, *shown("baseline", "B", 1, 2)], "datasheet")
    assert change.verdict == "pass"
    half = [*shown("baseline", "A", 0, 4), *shown("candidate", "N", 1, 4)]
    assert compare_traits(half, "datasheet")[0].verdict == "pass"
    assert compare_traits(shown("candidate", "N", 2, 2), "datasheet") == ()
    assert compare_traits(shown("baseline", "N", 2, 2), "datasheet") == ()


def test_a_lot_of_another_station_that_nothing_links_names_both() -> None:
    found, _ = compare(lot("N", 1.05 + SHAPE, "S2"))
    assert found.verdict == "CONFOUNDED"
    assert "S2 of the candidate and S1 of the baseline" in found.why


def test_the_headline_counts_lots() -> None:
    limits = line.limits((NAME,))
    one = compare_lots(line.samples(base(), lot("N", 1.0 + SHAPE)), limits, CONSTANTS)
    two = compare_lots(
        line.samples(base(), [*lot("N", 1.0 + SHAPE), *lot("M", 1.0 + SHAPE)]), limits, CONSTANTS
    )
    assert one.headline.startswith("Lot N: ")
    assert two.headline.startswith("Lots N, M: ")


@pytest.mark.parametrize("difference", [-0.9, 0.0, 0.4, 1.3])
def test_a_difference_of_motors_has_the_two_sided_p_of_student(difference: float) -> None:
    expected = 2.0 * student.sf(abs(difference) / 0.5, 7.0)
    assert _p_value(difference, 0.5, 7.0) == pytest.approx(expected, rel=1e-9)
    assert _p_value(difference, 0.0, 7.0) == float(difference == 0.0)
