"""Contrasts, temperatures, margins, verdicts and faults of lots, each number by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.lots import assess as assessment
from pipeline.lots.assess import assess
from pipeline.lots.bounds import hold
from pipeline.lots.code import _Seen
from pipeline.lots.constant import gauge_of
from pipeline.lots.gauge import Table, components, study
from pipeline.lots.limits_lint import _constant, _rules
from pipeline.lots.lot_test import detectable, power
from pipeline.lots.sample import Value, _to_reference, independent, lots_in_order, values_of
from pipeline.lots.traits import Shown, _orders, _verdict, compare_traits, effects_shown
from pipeline.lots.verdict import Answers, Judged, _changed, _not_failed, _p, judge, overall
from pipeline.physics.copper import COPPER_COEFFICIENT_25_1_K
from pipeline.physics.glossary import Term
from pipeline.records.diagnosis_summary import DiagnosisSummary
from pipeline.records.limits import Amount, ConstantLimits
from pipeline.records.lot_constant import Conformity, Count, Equivalence, LotTest
from tests.unit.lots import production as line

NOTHING = Equivalence("not_evaluated", None, None, None, None, None)


def value(motor, lot, number, side, *, station="S1", u=1e-6, shared=None, inputs=()):
    return Value(
        motor,
        lot,
        side,
        station,
        () if station is None else tuple(station.split("+")),
        number,
        u,
        u,
        shared or {},
        (),
        frozenset(inputs),
    )


def lot_of(name, numbers, side, **how):
    return [value(f"{name}-{k}", name, x, side, **how) for k, x in enumerate(numbers)]


# The contrast


def test_two_lots_are_compared_by_welch_like_pooled_motors() -> None:
    """One lot a side: s^2 (1/3 + 1/2) of the pooled scatter, three degrees of freedom."""
    values = [*lot_of("A", [1.0, 1.2, 1.1], "baseline"), *lot_of("B", [1.5, 1.7], "candidate")]
    found = assess(values, [], ["A", "B"])
    contrast = found.contrast
    assert contrast is not None
    within = (0.02 + 0.02) / 3.0
    assert found.within_sd == pytest.approx(math.sqrt(within))
    assert contrast.difference == pytest.approx(0.5)
    assert contrast.u == pytest.approx(math.sqrt(within * (1.0 / 3.0 + 0.5)))
    assert contrast.dof == pytest.approx(3.0)
    assert (contrast.lot_p, contrast.lot_se, found.lots_sd) == (None, None, None)


def test_lots_that_scatter_more_than_their_motors_carry_the_baseline() -> None:
    """Means 1, 2, 3: s^2/3 = 1/3 over the motors' share; Welch-Satterthwaite of both parts."""
    values = [
        v
        for k, m in enumerate((1.0, 2.0, 3.0))
        for v in lot_of(f"L{k}", [m - 0.1, m + 0.1], "baseline")
    ]
    values += lot_of("N", [4.8, 5.0, 5.2, 5.0], "candidate")
    found = assess(values, [], ["L0", "L1", "L2", "N"])
    contrast = found.contrast
    assert contrast is not None
    within = (3 * 0.02 + 0.08) / 6.0
    new, old = within / 4.0, 1.0 / 3.0
    assert contrast.difference == pytest.approx(3.0)
    assert contrast.u == pytest.approx(math.sqrt(new + old))
    assert contrast.dof == pytest.approx((new + old) ** 2 / (new**2 / 6.0 + old**2 / 2.0))
    # the lot-level test: one new draw of the lots, whose motors are more than the others'
    assert contrast.lot_se == pytest.approx(math.sqrt(4.0 / 3.0))
    assert contrast.lot_t == pytest.approx(3.0 / math.sqrt(4.0 / 3.0))
    assert contrast.lot_dof == pytest.approx(2.0)
    # a new lot of a single motor is a poorer draw: its motors' variance beyond the others'
    fewer = assess([*values[:6], *lot_of("N", [5.0], "candidate")], [], ["L0", "L1", "L2", "N"])
    more = 0.02 * (1.0 - 0.5)
    assert fewer.contrast is not None
    assert fewer.contrast.lot_se == pytest.approx(math.sqrt(4.0 / 3.0 + more))
    assert fewer.contrast.lot_dof == pytest.approx(2.0 * ((4.0 / 3.0 + more) / (4.0 / 3.0)) ** 2)


def test_gains_common_to_a_side_are_in_the_difference_and_cancel_alike() -> None:
    """0.03 and 0.01 of one source on two lots of a side: their mean; on both sides the rest."""
    a = lot_of("A", [1.0, 1.1], "baseline", shared={"voltage@T": 0.03})
    b = lot_of("B", [1.0, 1.1], "baseline", shared={"voltage@T": 0.01})
    n = lot_of("N", [1.0, 1.1], "candidate", shared={"voltage@T": 0.05, "current@T": 0.04})
    groups = assessment.Groups({"A": (1.0, 1.1), "B": (1.0, 1.1)}, {"N": (1.0, 1.1)})
    u = assessment._u_shared([*a, *b, *n], groups, frozenset())
    assert u == pytest.approx(math.hypot(0.05 - 0.02, 0.04))
    assert assessment._u_shared([*a, *b, *n], groups, frozenset({"S+T"})) == 0.0
    aside = value("z", "Z", 9.0, "baseline", shared={"voltage@T": 9.0})
    assert assessment._u_shared([*a, *b, *n, aside], groups, frozenset()) == pytest.approx(u)


def test_shares_of_stations_in_the_difference() -> None:
    """Lot A half on S1, half on S2; lot N on S2: -1/4, -1/4 and -1/2 beside +1."""
    values = [
        value("a", "A", 1.0, "baseline"),
        value("b", "A", 1.0, "baseline", station="S2"),
        *lot_of("B", [1.0, 1.0], "baseline"),
        *lot_of("N", [1.0, 1.0], "candidate", station="S2"),
    ]
    groups = assessment.Groups({"A": (1.0, 1.0), "B": (1.0, 1.0)}, {"N": (1.0, 1.0)})
    shares = assessment._shares(values, groups)
    assert shares == pytest.approx({"S1": -0.75, "S2": 0.75})
    assert assessment._corrected_stations({"S1": 1e-13, "S2": -0.1}) == ["S2"]
    assert assessment._mean_share({"A": (1, 2), "B": (1, 2, 3)}) == pytest.approx(
        (1 / 2 + 1 / 3) / 4
    )
    assert assessment._each({"A": (1, 2), "B": (1, 2, 3)}) == pytest.approx((1 / 2 + 1 / 3) / 2)


def test_links_and_shared_gains_add_in_squares() -> None:
    """Golden motors link S1 and S2; what both sides' instruments add stays beside the link."""
    gain = {"assumed:alpha": 0.03}
    values = [
        *lot_of("A", [1.0, 1.2], "baseline"),
        *lot_of("N", [1.5, 1.7], "candidate", station="S2", shared=gain),
    ]
    golden = [
        value(f"g{k}", "-", 1.0 + b, None, station=s, u=0.05)
        for k in range(2)
        for s, b in (("S1", 0.0), ("S2", 0.1))
    ]
    plain = [replace(v, shared={}) for v in values]
    with_gain, without = assess(values, golden, ["A", "N"]), assess(plain, golden, ["A", "N"])
    assert with_gain.contrast is not None
    assert without.contrast is not None
    assert with_gain.contrast.difference == pytest.approx(0.4)
    assert with_gain.contrast.u**2 - without.contrast.u**2 == pytest.approx(0.03**2)
    motors = 0.02 * (0.5 + 0.5)
    link = without.contrast.u**2 - motors
    # two golden motors, each read once on either station with 0.05: u^2 = 2 * 0.05^2 / 2
    assert link == pytest.approx(0.0025, rel=1e-6)


# Samples


def test_values_come_to_25_degrees() -> None:
    def sheet(**constants):
        return line.sheet("m", "A", "S1", constants)

    def at(name, degc, **constants):
        made = line.sheet(
            "m",
            "A",
            "S1",
            {name: 1.0, **constants},
            at={"temp_winding_degc": degc, "temp_magnet_degc": degc},
        )
        return _to_reference(name, made.constants[name], made)

    alpha = COPPER_COEFFICIENT_25_1_K
    assert at("r_phase_ohm", 45.0)[0] == pytest.approx(1.0 / (1.0 + 20.0 * alpha))
    assert at("r_phase_ohm", 45.0, temp_coeff_copper_1_k=0.003)[0] == pytest.approx(1.0 / 1.06)
    assert at("psi_pm_wb", 45.0, temp_coeff_magnet_1_k=-0.001)[0] == pytest.approx(1.0 / 0.98)
    assert at("kv_ll_peak_rpm_v", 45.0, temp_coeff_magnet_1_k=-0.001)[0] == pytest.approx(0.98)
    assert "is not known" in at("psi_pm_wb", 45.0)[1]
    assert at("psi_pm_wb", 25.49) == (1.0, "")
    assert "is not known" in at("psi_pm_wb", 25.51)[1]
    assert "is not known" in at("psi_pm_wb", 24.49)[1]
    assert at("ld_h", 45.0) == (1.0, "")
    bare = line.sheet("m", "A", "S1", {"r_phase_ohm": 1.0}, at={})
    assert (
        "states no temp_winding_degc"
        in _to_reference("r_phase_ohm", bare.constants["r_phase_ohm"], bare)[1]
    )
    made = line.sheet(
        "m",
        "A",
        "S1",
        {"r_phase_ohm": 2.0},
        u=0.1,
        u_gain=0.2,
        at={"temp_winding_degc": 45.0, "temp_magnet_degc": 45.0},
    )
    (one,), missing = values_of("r_phase_ohm", line.members([made], "baseline"))
    factor = 1.0 / (1.0 + 20.0 * alpha)
    assert (one.value, one.u_a) == pytest.approx((2.0 * factor, 0.1 * factor))
    assert one.u == pytest.approx(math.hypot(0.1, 0.2) * factor)
    assert one.shared == pytest.approx({"voltage@S1": 0.2 * factor})
    assert missing == []
    assert values_of("ld_h", line.members([sheet(r_phase_ohm=1.0)], None))[1] == ["m: no estimate"]


def test_values_of_one_capture_count_once_and_lots_stand_in_time() -> None:
    first = value("m", "A", 1.0, "baseline", inputs=("x", "y"))
    again = value("m", "A", 1.1, "baseline", inputs=("y", "z"))
    third = value("m", "A", 1.2, "baseline", inputs=("z",))
    other = value("n", "A", 1.3, "baseline", inputs=("x",))
    assert independent([first, again, third, other]) == [first, third, other]
    sheets = [line.sheet("a", "B", "S1", {"ld_h": 1.0}), line.sheet("b", "A", "S1", {"ld_h": 1.0})]
    members = line.members(sheets[:1], "baseline", 3) + line.members(sheets[1:], "baseline", 2)
    members += line.members(sheets[:1], "baseline", 1)
    assert [name for name, _ in lots_in_order(members)] == ["B", "A"]
    assert lots_in_order(members)[0][1].startswith("2026-01-01")


# Bounds


def test_margins_and_guard_bands_that_do_not_count() -> None:
    """No tolerance: guard band 0, margin in U of the median motor, k = 2."""
    made = [value(m, "N", 1.0, "candidate", u=u) for m, u in (("a", 0.1), ("b", 0.2), ("c", 0.9))]
    limits = ConstantLimits("r", margins=(Amount(0.5, "U"),))
    found = hold(limits, made, dict.fromkeys("abc", 1.0), 1.0, None, 2.0)
    assert found.margin == pytest.approx(0.2)
    assert found.bounds is not None
    assert found.bounds.guard_band == 0.0
    sided = ConstantLimits("r", minimum=0.5, guard_band=Amount(0.1, "unit"))
    found = hold(sided, made, {"a": 0.45, "b": 0.55, "c": 0.65}, None, None, 2.0)
    assert found.decisions == {"a": "conditional_fail", "b": "conditional_pass", "c": "pass"}
    assert found.bounds is not None
    assert (found.bounds.accept_lower, found.bounds.guard_band) == pytest.approx((0.6, 0.1))


# Gauge


def test_shares_of_nothing_are_nothing() -> None:
    flat = np.zeros((3, 2, 2))
    found = study(flat)
    assert (found.percent, found.percent_low, found.percent_high) == (0.0, 0.0, 0.0)
    assert found.verdict == "good"


def test_components_at_their_pooling_limit() -> None:
    """MSI over MSE at p a little below and above a quarter: interaction kept, then pooled."""
    from scipy.stats import f

    for p, pooled in ((0.24, False), (0.26, True)):
        table = Table(4, 3, 2, 9.0, 7.0, float(f.isf(p, 6, 12)), 1.0)
        found = components(table)
        assert (found.interaction == 0.0) is pooled


def test_a_gauge_study_takes_the_most_widely_used_stations() -> None:
    """Three motors twice on S1 and S2 (one thrice on S1); one on S1 alone; none unstated."""
    rng = np.random.default_rng(0)
    repeats = [
        value(f"m{k}", "A", k + 0.1 * rng.standard_normal(), None, station=s)
        for k in range(3)
        for s in ("S1", "S2")
        for _ in range(2)
    ]
    extra = value("m0", "A", 50.0, None, station="S1")
    alone = [value("x", "A", 9.0, None, station="S1")] * 2 + [
        value("y", "A", 9.0, None, station=None)
    ]
    found = gauge_of([*repeats, extra, *alone])
    assert found is not None
    table = np.array(
        [
            [
                [v.value for v in repeats if v.motor_id == f"m{k}" and v.station == s]
                for s in ("S1", "S2")
            ]
            for k in range(3)
        ]
    )
    assert found == study(table)
    assert gauge_of(repeats[:4]) is None
    assert gauge_of([v for v in repeats if v.station == "S1"]) is None


# Tests and powers


def test_the_detectable_shift_far_from_its_first_guess() -> None:
    """Few degrees of freedom and a small alpha need more than the first 2 se, twice over."""
    for dof, alpha in ((2.0, 1e-4), (30.0, 0.05)):
        shift = detectable(0.1, dof, alpha)
        assert power(shift, 0.1, dof, alpha) == pytest.approx(0.95, abs=1e-6)


# Traits


def test_waves_of_an_effect_count_from_a_tenth_of_the_largest() -> None:
    parameters = {
        "cos_6_nm": (3.0, "N·m"),
        "sin_6_nm": (4.0, "N·m"),
        "cos_12_nm": (0.51, "N·m"),
        "sin_18_nm": (0.49, "N·m"),
        "offset_nm": (9.0, "N·m"),
    }
    assert _orders(parameters) == pytest.approx({6: 5.0, 12: 0.51})
    assert _orders({}) == {}


def test_the_size_of_an_effect_is_that_of_its_only_parameter() -> None:
    sheets = [line.sheet(m, "A", "S1", {"ld_h": 1.0}) for m in ("a", "b", "c", "d")]
    members = line.members(sheets, "baseline")
    summaries = {
        "a": DiagnosisSummary(
            "a",
            "missing",
            ("drag", "ripple"),
            {
                "drag": {"b": (0.3, "N·m·s")},
                "ripple": {"cos_6_nm": (3.0, "N·m"), "sin_6_nm": (4.0, "N·m")},
            },
        ),
        "b": DiagnosisSummary("b", "unknown", ("drag",), {}),
        "c": DiagnosisSummary("c", "insufficient", ("drag",), {}),
    }
    one, other = effects_shown(members, summaries)
    assert one.sizes == {"drag": 0.3, "ripple": None, "cogging_order_6 (diagnosed)": 5.0}
    assert one.units["drag"] == "N·m·s"
    assert other.sizes == {"drag": None, "unknown structure": None}
    changes = compare_traits([one, replace(one, side="candidate", motor_id="z")], "diagnosis")
    by_name = {c.name: c for c in changes}
    assert by_name["drag"].unit == "N·m·s"


def shown(lot, having, of, side="baseline"):
    return [Shown(f"{lot}{k}", lot, side, {"x": None} if k < having else {}) for k in range(of)]


@pytest.mark.parametrize(
    ("p", "after", "base", "verdict"),
    [
        (0.0099, 2, (("A", 0, 4),), "fail"),
        (0.0101, 2, (("A", 0, 4),), "undecided"),
        (0.0101, 2, (("A", 1, 4),), "pass"),
        (0.0099, 1, (("A", 0, 4),), "marginal"),  # fewer than half of the motors
        (0.0099, 2, (("A", 2, 4), ("B", 0, 4)), "marginal"),  # half of a lot had it before
        (0.0099, 2, (("A", 1, 4), ("B", 0, 4)), "fail"),
    ],
)
def test_a_trait_is_new_where_most_show_it_and_no_lot_did(p, after, base, verdict) -> None:
    before = [one for lot in base for one in shown(*lot)]
    candidate = shown("N", after, 4, "candidate")
    have = [one for one in before if one.sizes]
    assert _verdict(have, [c for c in candidate if c.sizes], before, candidate, p) == verdict


# Verdicts


def evaluated(significant=True, p=0.004):
    return LotTest("evaluated", 8, 8, 5.0, 7.0, p, p, significant)


def same(status, margin=0.2):
    return Equivalence(status, margin, -0.1, 0.1, 0.03, 9.0)


SHIFTED = assess(
    [*lot_of("A", [1.0, 1.2, 1.1], "baseline"), *lot_of("B", [1.5, 1.7], "candidate")],
    [],
    ["A", "B"],
)
FINE = Conformity((Count("pass", 2),), "pass", None, None, None)


def answers(conformity):
    return Answers(conformity, evaluated(), NOTHING, None, 0.01)


def changed(limits, test, equal, p=None):
    return _changed(limits, "ohm", SHIFTED, Answers(FINE, test, equal, p, 0.01))


@pytest.mark.parametrize(
    ("tolerate", "status", "verdict", "ending"),
    [
        (True, "equivalent", "marginal", "p 0.004, yet within the margin"),
        (False, "equivalent", "fail", "p 0.004, although within the margin"),
        (True, "different", "fail", "p 0.004"),
        (False, "undecided", "fail", "p 0.004"),
    ],
)
def test_a_significant_change_and_its_margin(tolerate, status, verdict, ending) -> None:
    limits = ConstantLimits("r", margins=(Amount(0.2, "unit"),), tolerate=tolerate)
    found = changed(limits, evaluated(), same(status))
    assert found is not None
    assert (found.verdict, found.why) == (
        verdict,
        f"+45.5 %: beyond the scatter of 8 lots, {ending}",
    )
    assert changed(limits, evaluated(significant=False), same(status)) is None


@pytest.mark.parametrize(
    ("margin", "p", "fails"),
    [(0.4915, 0.009, True), (0.51, 0.009, False), (0.49, 0.011, False), (0.49, None, False)],
)
def test_without_history_a_change_is_beyond_margin_and_chance(margin, p, fails) -> None:
    """The difference is 0.5; alpha is 0.01."""
    history = LotTest("INSUFFICIENT_HISTORY", 1, 8, None, None, None, None, False)
    found = changed(ConstantLimits("r"), history, same("different", margin), p)
    assert (found is not None) is fails
    if found is not None:
        assert found.why == "+45.5 %: beyond the margin of 492 mΩ, p 0.009 by motors"


@pytest.mark.parametrize(
    ("status", "test", "verdict", "words"),
    [
        ("equivalent", evaluated(False), "pass", "shown to lie within the margin, p 0.030"),
        (
            "undecided",
            None,
            "INSUFFICIENT_HISTORY",
            "not shown to be the same, 3 of 8 baseline lots",
        ),
        (
            "not_evaluated",
            evaluated(False),
            "pass",
            "no change beyond the scatter of 8 lots; no margin",
        ),
        (
            "undecided",
            evaluated(False),
            "undecided",
            "no change seen, but not shown to be the same",
        ),
    ],
)
def test_what_is_not_failed(status, test, verdict, words) -> None:
    test = test or LotTest("INSUFFICIENT_HISTORY", 3, 8, None, None, None, None, False)
    equal = NOTHING if status == "not_evaluated" else same(status)
    found = _not_failed(FINE, test, equal, "moved")
    assert found.verdict == verdict
    assert words in found.why
    guard = Conformity((Count("conditional_pass", 1),), "conditional_pass", "N-1", None, None)
    held = _not_failed(guard, test, equal, "moved")
    assert held.verdict == ("marginal" if verdict == "pass" else verdict)
    assert ("N-1 is in the guard band" in held.why) is (verdict == "pass")


def test_motors_outside_come_before_all_else_and_the_move_is_relative() -> None:
    out = Conformity(
        (Count("fail", 1), Count("conditional_fail", 2), Count("pass", 4)),
        "fail",
        "N-3",
        None,
        None,
    )
    found = judge(ConstantLimits("r"), "ohm", SHIFTED, answers(out))
    assert found == Judged("fail", "+45.5 %: 3 of 7 motors outside the limits, N-3 is a fail")
    assert (_p(None), _p(0.0009), _p(0.001), _p(0.0126)) == ("unknown", "< 0.001", "0.001", "0.013")
    empty = replace(SHIFTED, candidate={})
    missing = judge(ConstantLimits("r"), "ohm", empty, answers(FINE))
    assert missing == Judged("not_evaluated", "no motor of the candidate has it")
    from_zero = assess(
        [*lot_of("A", [-0.1, 0.1], "baseline"), *lot_of("B", [0.3916, 0.5916], "candidate")],
        [],
        ["A", "B"],
    )
    found = judge(ConstantLimits("r"), "ohm", from_zero, answers(out))
    assert found.why.startswith("+492 mΩ: 3 of 7")
    for candidate, words in ((0.29, "+190 %"), (0.31, "+210 mΩ")):
        values = [candidate - 0.01, candidate + 0.01]
        from_little = assess(
            [*lot_of("A", [0.09, 0.11], "baseline"), *lot_of("B", values, "candidate")],
            [],
            ["A", "B"],
        )
        found = judge(ConstantLimits("r"), "ohm", from_little, answers(out))
        assert found.why.startswith(f"{words}: 3 of 7")
    assert overall((), ()) == ("undecided", ("no constant could be compared",))


# Faults of a limits file


TERM = Term("r", "ohm", "a resistance", "constant", 0.0, 10.0)


def faults(**limits):
    return list(_constant(ConstantLimits("r", **limits), TERM))


@pytest.mark.parametrize(
    ("limits", "words"),
    [
        ({"minimum": 2.0, "maximum": 2.0}, "minimum 2 is not below maximum 2"),
        ({"minimum": 1.9, "maximum": 2.0}, None),
        ({"nominal": 10.0}, None),
        ({"nominal": 10.1}, "beyond what the glossary"),
        ({"nominal": -0.1}, "beyond what the glossary"),
        ({"nominal": 1.0, "minimum": 1.0, "maximum": 1.0 + 1e-3}, None),
        ({"nominal": 1.0, "minimum": 1.1}, "minimum 1.1 leaves the nominal 1 outside"),
        ({"nominal": 1.0, "maximum": 0.9}, "maximum 0.9 leaves the nominal 1 outside"),
        ({"tolerance": Amount(0.0, "unit")}, "tolerance is not positive"),
        ({"tolerance": Amount(0.5, "U")}, "tolerance counts in U"),
        ({"guard_band": Amount(-0.1, "unit")}, "guard_band is negative"),
        ({"guard_band": Amount(0.0, "unit")}, None),
        ({"margins": (Amount(0.0, "unit"),)}, "equivalence_margin is not positive"),
        ({"tolerate": True}, "tolerate_within_margin needs"),
        (
            {"nominal": 1.0, "tolerance": Amount(0.1, "unit"), "minimum": 0.91},
            "tighter than its design",
        ),
        (
            {"nominal": 1.0, "tolerance": Amount(0.1, "unit"), "maximum": 1.09},
            "tighter than its design",
        ),
        ({"nominal": 1.0, "tolerance": Amount(0.1, "unit"), "minimum": 0.9, "maximum": 1.1}, None),
        (
            {"nominal": 2.0, "tolerance": Amount(0.1, "nominal"), "maximum": 2.19},
            "which allows 2.2",
        ),
        (
            {"nominal": 1.0, "tolerance": Amount(0.1, "unit"), "guard_band": Amount(0.099, "unit")},
            None,
        ),
        (
            {"nominal": 1.0, "tolerance": Amount(0.1, "unit"), "guard_band": Amount(0.101, "unit")},
            "leaves nothing of the tolerance 0.9 to 1.1",
        ),
        (
            {
                "nominal": 1.0,
                "tolerance": Amount(0.1, "unit"),
                "guard_band": Amount(0.2, "unit"),
                "rule": "simple",
            },
            None,
        ),
        (
            {"nominal": 1.0, "tolerance": Amount(0.1, "unit"), "margins": (Amount(0.19, "unit"),)},
            None,
        ),
        (
            {
                "nominal": 1.0,
                "tolerance": Amount(0.1, "unit"),
                "margins": (Amount(0.21, "nominal"),),
            },
            "equivalence_margin 0.21 is wider",
        ),
        (
            {"nominal": 1.0, "minimum": 0.8, "maximum": 1.1, "guard_band": Amount(0.16, "unit")},
            "leaves nothing of the tolerance 0.8 to 1.1",
        ),
    ],
)
def test_faults_at_their_limits(limits, words) -> None:
    found = faults(**limits)
    assert (found == []) if words is None else any(words in fault for fault in found)


@pytest.mark.parametrize(
    ("rules", "fault"),
    [
        ({"alpha": 0.5}, "alpha"),
        ({"alpha": 0.49}, None),
        ({"alpha": 0.0}, "alpha"),
        ({"min_lots": 2}, "min_lots"),
        ({"min_lots": 3}, None),
        ({"k": 0.0}, "coverage"),
        ({"order_share": 1.0}, "order_share"),
        ({"order_share": 0.0}, None),
        ({"code_negligible": 1.0, "code_limit": 1.0}, None),
        ({"code_negligible": 1.1, "code_limit": 1.0}, "code_negligible"),
        ({"code_negligible": -0.1}, "code_negligible"),
    ],
)
def test_rules_at_their_limits(rules, fault) -> None:
    found = list(_rules(line.limits(**rules)))
    assert (found == []) if fault is None else (fault in found[0] and len(found) == 1)


# Versions of the code


@pytest.mark.parametrize(
    ("ratio", "wider"), [(0.49, True), (0.51, False), (1.98, False), (2.02, True)]
)
def test_a_u_that_doubled_or_halved_is_told(ratio: float, wider: bool) -> None:
    from pipeline.lots.code import Pair

    def member(u):
        return line.members([line.sheet("m", "A", "S1", {"ld_h": 1.0}, u=u)], "baseline")[0]

    seen = _Seen()
    seen.take("ld_h", Pair(member(1e-3), member(ratio * 1e-3)), line.limits())
    assert seen.wider == ([f"m {ratio:.3g} times"] if wider else [])
    assert [m.z for m in seen.motors] == [None, 0.0]
