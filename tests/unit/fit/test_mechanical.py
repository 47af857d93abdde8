"""Torque, cogging, friction and inertia estimators on simulated benches whose truth is known."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest

from pipeline.fit.estimators.cogging import ESTIMATOR as COGGING
from pipeline.fit.estimators.cogging import peak_orders
from pipeline.fit.estimators.drive_voltage import ESTIMATOR as DRIVE_VOLTAGE
from pipeline.fit.estimators.holding_current import ESTIMATOR as HOLDING_CURRENT
from pipeline.fit.estimators.inductance_rated import ESTIMATOR as INDUCTANCE_RATED
from pipeline.fit.estimators.inertia import ESTIMATOR as INERTIA
from pipeline.fit.estimators.spin_down import ESTIMATOR as SPIN_DOWN
from pipeline.fit.estimators.torque_map import ESTIMATOR as TORQUE_MAP
from pipeline.fit.magnet_coefficient import SOURCE, U_USUAL_1_K
from pipeline.fit.protocol import Estimator, Fit
from pipeline.numerics.orders import OrderLine, Spectrum, half_peak_to_peak
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.bench import truth as simulated_truth
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design

MECHANICAL = ("torque_map", "cogging", "spin_down", "drive", "holding_current")
EXACT_BENCH = Bench(instruments=EXACT)


@cache
def recorded(
    effects: str = "", motor: str = "gimbal-5208", tests: tuple[str, ...] = MECHANICAL
) -> Campaign:
    """Mechanical tests of one motor, its own cogging replaced by `effects`; exact instruments."""
    machine = replace(design(motor), effects={})
    machine = with_effects(machine, effects) if effects else machine
    plan = tuple(step for step in CAMPAIGN if step[1] in tests)
    return campaign_of(campaign(machine, EXACT_BENCH, 11, plan))


def fitted(estimator: Estimator, captures: Campaign, known: Constants | None = None) -> Fit:
    return estimator.fit(captures, known or Constants(), estimator.options)


def chain(captures: Campaign, *estimators: Estimator) -> Constants:
    """Estimators one after the other, each seeing what those before it found."""
    known = Constants()
    for estimator in estimators:
        known = known.adding(fitted(estimator, captures, known).estimates)
    return known


def number(known: Constants, method: str, name: str) -> float:
    found = known.by(method, name)
    assert found is not None, known.all_of(name)
    return found.number


def test_torque_constant_and_reluctance() -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(), TORQUE_MAP)
    kt, reluctance = known.best("kt_peak_nm_a"), known.best("kt_reluctance_nm_a2")
    assert kt is not None
    assert reluctance is not None
    assert kt.number == pytest.approx(1.5 * motor.pole_pairs * motor.psi_pm_wb, rel=3e-4)
    saliency = 1.5 * motor.pole_pairs * (motor.ld_h - motor.lq_h)
    assert abs(reluctance.number - saliency) < 4.0 * reluctance.u_a
    shares = {part.source: part.u / kt.number for part in kt.budget}
    assert shares["torque@sim-1"] == pytest.approx(0.002, rel=1e-6)
    assert shares["current@sim-1"] == pytest.approx(-0.002, rel=1e-3)


@pytest.mark.parametrize("effects", ["", "windage"])
def test_drag_of_a_map_that_misses_its_line_has_the_freedom_of_the_speeds(effects: str) -> None:
    """Five speeds less two of drag and the transducer's zero: two, where windage bends the drag;
    that of the points where the line holds.
    """
    machine = replace(design("gimbal-5208"), effects={})
    machine = with_effects(machine, effects) if effects else machine
    speeds = (0.15, 0.35, 0.55, -0.25, -0.45)
    plan = tuple((f"at_{s}", "torque_map", {"speed": s}) for s in speeds)
    captures = campaign_of(campaign(machine, EXACT_BENCH, 11, plan))
    for name in ("torque_coulomb_nm", "b_visc_nm_s_rad"):
        drag = chain(captures, TORQUE_MAP).by("torque_map", name)
        assert drag is not None
        scatter = next(p for p in drag.budget if p.source == f"scatter:torque_map:{name}")
        assert (scatter.dof == 2) == bool(effects)
        assert scatter.dof == 2 or scatter.dof > 100


def test_saturation_does_not_bend_the_torque_constant() -> None:
    """Saturating q flux takes torque from large currents only; K is the slope at small ones."""
    motor = design("servo-ipm")
    known = chain(recorded("saturation,cross_saturation", "servo-ipm"), TORQUE_MAP)
    kt = known.best("kt_peak_nm_a")
    assert kt is not None
    low, high = kt.interval()
    assert low <= 1.5 * motor.pole_pairs * motor.psi_pm_wb <= high
    assert kt.u / kt.number < 0.006


@pytest.mark.parametrize(
    "effects", ["saturation,cross_saturation", "cross_saturation=0.15", "saturation=0.25"]
)
def test_a_bent_map_leaves_the_small_current_torque_constant(effects: str) -> None:
    """1.5 p psi within 0.06 % whatever bends the map, and within what the budget says of form."""
    motor = design("servo-ipm")
    kt = chain(recorded(effects, "servo-ipm", ("torque_map",)), TORQUE_MAP).best("kt_peak_nm_a")
    assert kt is not None
    truth = 1.5 * motor.pole_pairs * motor.psi_pm_wb
    assert kt.number == pytest.approx(truth, rel=6e-4)
    form = next((p.u for p in kt.budget if p.source == "assumed:torque_form"), 0.0)
    assert abs(kt.number - truth) < 3.0 * float(np.hypot(kt.u_a, form))
    assert form < 5e-3 * truth


def test_the_torque_constant_has_the_freedom_of_the_points_that_it_is_fitted_to() -> None:
    """16 points without d current less 3 speeds and 4 odd powers, where saturation bends the map;
    44 points less 3 speeds, i_q and i_d i_q, where it does not. Never that of their samples.
    """
    bent = recorded("saturation,cross_saturation", "servo-ipm", ("torque_map",))
    straight = recorded(tests=("torque_map",))
    for captures, dof in ((bent, 9), (straight, 39)):
        kt = chain(captures, TORQUE_MAP).best("kt_peak_nm_a")
        assert kt is not None
        scatter = next(p for p in kt.budget if p.source == "scatter:torque_map:kt_peak_nm_a")
        assert scatter.dof == dof


@pytest.mark.parametrize("effect", ["torque_offset", "torque_lag", "load_dependent_friction"])
def test_sensor_and_friction_do_not_reach_the_torque_constant(effect: str) -> None:
    motor = design("gimbal-5208")
    kt = number(chain(recorded(effect), TORQUE_MAP), "torque_map", "kt_peak_nm_a")
    assert kt == pytest.approx(1.5 * motor.pole_pairs * motor.psi_pm_wb, rel=1.5e-3)


def without_some_angles(captures: Campaign, test: str) -> Campaign:
    """The campaign with every tenth row of one test without an angle, the first row too."""

    def holed(table: pl.DataFrame) -> pl.DataFrame:
        blind = pl.Series(np.arange(table.height) % 10 == 0)
        angle = pl.when(blind).then(float("nan")).otherwise(pl.col("theta_mech_rad"))
        return table.with_columns(angle.alias("theta_mech_rad"))

    damaged = (
        replace(c, tables=tuple(holed(t) for t in c.tables)) if c.meta.test == test else c
        for c in captures.captures
    )
    return Campaign("m", tuple(damaged))


def test_lost_angles_do_not_take_creep_friction_away() -> None:
    """Turns and speed are those of the other rows."""
    captures = recorded("cogging")
    both = (captures, without_some_angles(captures, "cogging"))
    whole, found = (chain(c, SPIN_DOWN, COGGING).by("cogging", "torque_coulomb_nm") for c in both)
    assert whole is not None
    assert found is not None
    assert found.number == pytest.approx(whole.number, rel=1e-3)
    assert found.at["omega_mech_rad_s"] == pytest.approx(whole.at["omega_mech_rad_s"], rel=0.01)


def test_lost_angles_leave_the_cogging_order_of_the_holding_current() -> None:
    captures = recorded("cogging")
    known = chain(captures, TORQUE_MAP)
    damaged = without_some_angles(captures, "holding_current")
    orders = [fitted(HOLDING_CURRENT, c, known).estimates[0] for c in (captures, damaged)]
    assert [order.value for order in orders] == [84, 84]


def test_torque_map_without_steps_names_the_experiment() -> None:
    captures = recorded()
    first = captures.of("torque_map")[0]
    short = replace(first, tables=(first.tables[0].head(30),))
    found = fitted(TORQUE_MAP, Campaign("m", (short,))).estimates
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("record a torque_map" in e.note for e in found)


def test_rated_inductances() -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(), INDUCTANCE_RATED)
    assert number(known, "inductance_rated", "ld_rated_h") == pytest.approx(motor.ld_h, rel=3e-3)
    lq = known.best("lq_rated_h")
    assert lq is not None
    assert lq.number == pytest.approx(motor.lq_h, rel=3e-3)
    assert lq.at["iq_a"] == pytest.approx(motor.current_rated_a, rel=0.02)


def test_a_false_order_does_not_raise_the_cogging_peak() -> None:
    """Over a turn the crest of a stranger meets the others' somewhere: its whole height would add.

    Order 84 with 15 % of order 168 in quadrature; an order 131 at the level of the test is one in
    a hundred of noise. The weak second multiple counts as measured, tested or not.
    """
    orders = np.arange(1, 401, dtype=np.int64)
    coefficients = np.zeros((2, 400), dtype=np.complex128)
    coefficients[:, 83], coefficients[:, 167], coefficients[:, 130] = 1.0, 0.15j, 0.1
    coefficients[0, 200], coefficients[1, 200] = 0.01, -0.01
    spec = Spectrum(orders, coefficients, np.zeros(2), np.array([1, -1]))
    leading = OrderLine(84, 1.0 + 0.0j, 0.01, 20.0, 0.0)
    stranger = OrderLine(131, 0.1 + 0.0j, 0.01, 20.0, 5e-3)
    sure = replace(stranger, p_value=1e-9)
    kept = {line.order for line in peak_orders([leading, stranger], spec, [12, 14], [])}
    assert kept == {84, 168, 252}
    assert 131 in {line.order for line in peak_orders([leading, sure], spec, [12, 14], [])}
    s = (1.0 - np.sqrt(1.0 + 32.0 * 0.15**2)) / (8.0 * 0.15)
    peak = half_peak_to_peak(peak_orders([leading, stranger], spec, [12, 14], []))[0]
    assert peak == pytest.approx(np.sqrt(1.0 - s**2) * (1.0 - 0.3 * s), rel=1e-6)


@pytest.mark.parametrize("size", [0.03, -0.05])
def test_an_angle_offset_is_no_inductance(size: float) -> None:
    """Turned by e, the drop of R on the other axis reads as R tan(e) / w: 11 % on this motor."""
    motor = design("joint-11p")
    captures = recorded(f"angle_offset={size}", "joint-11p", ("torque_map",))
    known = chain(captures, INDUCTANCE_RATED)
    for name, truth in (("ld_rated_h", motor.ld_h), ("lq_rated_h", motor.lq_h)):
        found = known.best(name)
        assert found is not None
        assert found.number == pytest.approx(truth, rel=8e-4)
        assert f"frame turned by {size:.3f} rad" in found.note


def test_currents_sampled_late_are_no_inductance() -> None:
    """Late by d, the current stands w d beside the voltages' frame: R d adds to both axes, 2.5 %.

    No voltage shows it; the torque of d current does, K i_d sin(w d).
    """
    motor = design("joint-11p")
    delay = 0.03 / (motor.pole_pairs * motor.speed_rated_rad_s)
    captures = recorded("current_delay", "joint-11p", ("torque_map",))
    known = chain(captures, INDUCTANCE_RATED)
    for name, truth in (("ld_rated_h", motor.ld_h), ("lq_rated_h", motor.lq_h)):
        found = known.best(name)
        assert found is not None
        assert found.number == pytest.approx(truth, rel=2e-3)
        late = float(found.note.split("currents ")[1].split(" µs")[0])
        assert late == pytest.approx(1e6 * delay, rel=0.15)


def test_rated_d_inductance_of_a_saturated_axis_is_what_the_truth_means() -> None:
    """Root-form d saturation and cross-saturation: flux over the map's largest d current."""
    motor = with_effects(replace(design("servo-ipm"), effects={}), "saturation,cross_saturation")
    captures = recorded("saturation,cross_saturation", "servo-ipm", ("torque_map",))
    ld = chain(captures, INDUCTANCE_RATED).best("ld_rated_h")
    assert ld is not None
    true = simulated_truth(motor)
    assert true["at"]["ld_rated_h"]["id_a"] == pytest.approx(ld.at["id_a"], rel=0.01)
    assert abs(ld.number - true["constants"]["ld_rated_h"]) < 2.0 * ld.u
    assert true["constants"]["ld_rated_h"] > 1.03 * motor.ld_h


def test_rated_inductance_of_a_saturated_axis_is_apparent_flux_over_current() -> None:
    """Against the flux map of the same motor at the same current, an independent recording."""
    tests = ("torque_map", "flux_map")
    captures = recorded("saturation", "gimbal-5208", tests)
    lq = chain(captures, INDUCTANCE_RATED).best("lq_rated_h")
    assert lq is not None
    table = captures.of("flux_map")[0].arrays("id_a", "iq_a", "psi_q_wb")
    rated = float(table["iq_a"].max())
    here = (np.abs(table["id_a"]) < 0.05 * rated) & (table["iq_a"] > 0.97 * rated)
    apparent = float(np.mean(table["psi_q_wb"][here] / table["iq_a"][here]))
    assert lq.number == pytest.approx(apparent, rel=0.01)
    assert apparent < 0.97 * design("gimbal-5208").lq_h


@pytest.mark.parametrize(("timing", "allowed"), [("held", 3e-3), ("centred", 6e-3)])
def test_rated_inductance_respects_voltage_timing(timing: str, allowed: float) -> None:
    """A held voltage is turned by half a period against the sample, a centred one damped.

    At 0.09 rad of half period a polygon and a circle differ by 0.4 %: that doubt is in the budget.
    """
    motor = replace(design("gimbal-5208"), effects={})
    plan = (
        ("fast", "torque_map", {"speed": 0.8, "voltage_timing": timing}),
        ("back", "torque_map", {"speed": -0.8, "voltage_timing": timing}),
    )
    captures = campaign_of(campaign(motor, EXACT_BENCH, 5, plan))
    known = chain(captures, INDUCTANCE_RATED)
    for name, truth in (("lq_rated_h", motor.lq_h), ("ld_rated_h", motor.ld_h)):
        found = known.best(name)
        assert found is not None
        low, high = found.interval()
        assert low <= truth <= high
        assert found.number == pytest.approx(truth, rel=allowed)


def test_cogging_orders_and_creep_friction() -> None:
    motor = design("gimbal-5208")
    known = chain(recorded("cogging"), SPIN_DOWN, COGGING)
    size = 0.02 * motor.torque_rated_nm
    assert number(known, "cogging", "cogging_order") == 84
    amplitude = known.best("cogging_amplitude_nm")
    assert amplitude is not None
    assert 0.1 * size < amplitude.number < 10.0 * size
    assert "LCM of slots and poles" in amplitude.note
    drag = number(known, "cogging", "torque_coulomb_nm")
    assert drag == pytest.approx(motor.torque_coulomb_nm, rel=5e-3)


def test_no_cogging_is_a_result_with_a_limit() -> None:
    order, amplitude, *_ = fitted(COGGING, recorded()).estimates
    assert order.status == amplitude.status == "not_identifiable"
    assert "would have been" in order.note


def test_unbalance_is_no_cogging() -> None:
    order = fitted(COGGING, recorded("unbalance")).estimates[0]
    assert order.status == "not_identifiable"
    assert "unbalance or coupling" in order.note


def test_one_direction_leaves_friction_and_zero_together() -> None:
    captures = recorded("cogging")
    one = Campaign("m", captures.of("cogging")[:1])
    by_name = {e.name: e for e in fitted(COGGING, one).estimates}
    assert by_name["torque_coulomb_nm"].status == "not_identifiable"


def test_holding_current_sees_the_same_order() -> None:
    motor = design("gimbal-5208")
    captures = recorded("cogging")
    known = chain(captures, TORQUE_MAP, COGGING, HOLDING_CURRENT)
    assert number(known, "holding_current", "cogging_order") == 84
    turning = number(known, "cogging", "cogging_amplitude_nm")
    holding = number(known, "holding_current", "cogging_amplitude_nm")
    assert holding == pytest.approx(turning, rel=0.02)
    left = number(known, "holding_current", "holding_residual_a")
    assert left < 0.2 * holding / (1.5 * motor.pole_pairs * motor.psi_pm_wb)


@pytest.mark.parametrize("name", ["gimbal-5208", "drone-2306", "servo-15kw"])
def test_coast_down_ratios(name: str) -> None:
    motor = design(name)
    known = chain(recorded("", name, ("spin_down",)), SPIN_DOWN)
    coulomb = number(known, "spin_down", "coast_coulomb_rad_s2")
    viscous = number(known, "spin_down", "coast_viscous_1_s")
    assert coulomb == pytest.approx(motor.torque_coulomb_nm / motor.j_rotor_kgm2, rel=2e-4)
    assert viscous == pytest.approx(motor.b_visc_nm_s_rad / motor.j_rotor_kgm2, rel=2e-3)


@pytest.mark.parametrize("effect", ["windage", "stribeck", "angle_eccentricity"])
def test_coast_down_ratios_with_more_than_coulomb_and_viscous(effect: str) -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(effect), SPIN_DOWN)
    coulomb = number(known, "spin_down", "coast_coulomb_rad_s2")
    assert coulomb == pytest.approx(motor.torque_coulomb_nm / motor.j_rotor_kgm2, rel=0.02)


@pytest.mark.parametrize(
    "effect", ["", "cogging", "windage", "stribeck", "unbalance", "bemf_harmonics", "torque_lag"]
)
def test_inertia_and_friction(effect: str) -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(effect), SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    assert number(known, "inertia", "j_rotor_kgm2") == pytest.approx(motor.j_rotor_kgm2, rel=0.004)
    friction = number(known, "inertia", "torque_coulomb_nm")
    assert friction == pytest.approx(motor.torque_coulomb_nm, rel=0.02)
    viscous = number(known, "inertia", "b_visc_nm_s_rad")
    assert viscous == pytest.approx(motor.b_visc_nm_s_rad, rel=0.06)


def test_inertia_carries_the_torque_gain_and_not_the_current_gain() -> None:
    """J = Kt i / alpha and Kt = T / i: the current gain cancels, the torque gain stays."""
    known = chain(recorded(), SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    inertia = known.by("inertia", "j_rotor_kgm2")
    assert inertia is not None
    shares = {part.source: part.u / inertia.number for part in inertia.budget}
    assert shares["torque@sim-1"] == pytest.approx(0.002, rel=0.01)
    assert abs(shares.get("current@sim-1", 0.0)) < 2e-5


def with_short_drives(captures: Campaign, start_s: float, length_s: float) -> Campaign:
    """The same campaign with a piece of each drive."""
    inside = pl.col("t_s").is_between(start_s, start_s + length_s)
    cut = tuple(
        replace(c, tables=tuple(table.filter(inside) for table in c.tables))
        if c.meta.test == "drive"
        else c
        for c in captures.captures
    )
    return Campaign(captures.motor_id, cut)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("start_s", [0.1, 0.33, 0.6, 0.8])
def test_a_drive_of_a_few_windows_is_refused_with_the_experiment(start_s: float) -> None:
    """30 ms hold two windows: any column of its own would fit them without a residual."""
    known = chain(recorded(), SPIN_DOWN, TORQUE_MAP, COGGING)
    found = fitted(INERTIA, with_short_drives(recorded(), start_s, 0.03), known).estimates
    assert {e.name for e in found} == {"j_rotor_kgm2", "torque_coulomb_nm", "b_visc_nm_s_rad"}
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("share no sample" in e.note for e in found)
    assert all("record a drive of at least a second and a turn" in e.note for e in found)


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("length_s", [0.06, 0.1, 0.15, 0.3])
def test_inertia_of_a_short_drive_is_right_or_refused(length_s: float) -> None:
    motor = design("gimbal-5208")
    known = chain(recorded(), SPIN_DOWN, TORQUE_MAP, COGGING)
    given = 0
    for start_s in (0.05, 0.2, 0.35, 0.5, 0.65):
        captures = with_short_drives(recorded(), start_s, length_s)
        estimate = fitted(INERTIA, captures, known).estimates[0]
        if estimate.value is None:
            assert "record a drive" in estimate.note
            continue
        given += 1
        assert abs(estimate.number - motor.j_rotor_kgm2) < 3.0 * estimate.u
        scatter = [p.u for p in estimate.budget if p.source.startswith("scatter:inertia")]
        assert np.linalg.norm(scatter) > 1e-6 * estimate.number
    assert given == 5 if length_s >= 0.15 else given < 5


def test_torque_that_is_friction_in_disguise_is_not_parted() -> None:
    from pipeline.fit.drag import torque_is_parted

    sense, speed = np.ones(40), np.linspace(1.0, 3.0, 40)
    rest = [sense, speed]
    assert not torque_is_parted(np.column_stack([0.2 * sense + 0.1 * speed, *rest]), sense)
    assert torque_is_parted(np.column_stack([speed**2, *rest]), sense)


def test_what_inertia_added_is_said_and_claims_no_effect() -> None:
    known = chain(recorded("windage"), SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    found = known.by("inertia", "j_rotor_kgm2")
    assert found is not None
    assert "allowed for in this fit, no finding (diagnose tells effects): " in found.note
    assert "demand" not in found.note
    assert "windage" in found.note


def test_inertia_without_a_torque_constant_says_so() -> None:
    found = fitted(INERTIA, recorded()).estimates
    assert {e.status for e in found} == {"not_identifiable"}
    assert all("torque constant" in e.note for e in found)


def test_drag_of_another_form_is_not_called_viscous() -> None:
    """A brake whose drag peaks and falls: J holds, B is refused, Coulomb is allowed for."""
    from pipeline.simulator.outside import with_unknown

    motor = with_unknown(replace(design("gimbal-5208"), effects={}), "eddy_brake", 3.0)
    plan = tuple(step for step in CAMPAIGN if step[1] in MECHANICAL)
    captures = campaign_of(campaign(motor, EXACT_BENCH, 2, plan))
    known = chain(captures, SPIN_DOWN, TORQUE_MAP, COGGING, INERTIA)
    assert number(known, "inertia", "j_rotor_kgm2") == pytest.approx(motor.j_rotor_kgm2, rel=0.006)
    assert known.by("inertia", "b_visc_nm_s_rad") is None
    friction = known.by("inertia", "torque_coulomb_nm")
    assert friction is not None
    low, high = friction.interval()
    assert low <= motor.torque_coulomb_nm <= high


def test_back_emf_constant_from_a_drive() -> None:
    """One log at 25, one at 42 degC: what is assumed of the magnet is in u until it is measured."""
    motor = design("gimbal-5208")
    coefficient = Estimate(
        "temp_coeff_magnet_1_k", -0.0011, "1/K", "measured", "given", type_b("x", 1e-5)
    )
    for given, source in ((Constants((coefficient,)), "x"), (Constants(), SOURCE)):
        ke, r_phase = fitted(DRIVE_VOLTAGE, recorded(), given).estimates
        low, high = ke.interval()
        assert low <= motor.pole_pairs * motor.psi_pm_wb <= high
        share = next(p.u for p in ke.budget if p.source == source)
        assert ke.u < 0.003 * ke.number or source == SOURCE
        assert abs(share) > 5.0 * (1e-5 if source == "x" else U_USUAL_1_K) * ke.number
        assert r_phase.number == pytest.approx(motor.r_phase_ohm, rel=0.02)


def test_angle_counts_where_the_bench_lags() -> None:
    """The bench's own speed, late by 20 ms, must not change anything where the angle is there."""
    captures = recorded()
    late = []
    for capture in captures.of("drive"):
        table = capture.tables[0]
        rate = 1.0 / float(table["t_s"][1] - table["t_s"][0])
        shifted = table["omega_mech_rad_s"].shift(round(0.02 * rate), fill_value=0.0)
        late.append(
            replace(capture, tables=(table.with_columns(shifted.alias("omega_mech_rad_s")),))
        )
    slow = fitted(DRIVE_VOLTAGE, Campaign("m", tuple(late))).estimates
    assert slow == fitted(DRIVE_VOLTAGE, captures).estimates


def test_masked_rows_are_not_used() -> None:
    """Rows with no number anywhere are left out and everything else stays."""
    captures = recorded()
    holed = []
    for capture in captures.of("torque_map"):
        table = capture.tables[0]
        torque = table["torque_shaft_nm"].to_numpy().copy()
        torque[1000:1003] = np.nan
        holed.append(
            replace(capture, tables=(table.with_columns(pl.Series("torque_shaft_nm", torque)),))
        )
    kt = fitted(TORQUE_MAP, Campaign("m", tuple(holed))).estimates[0]
    whole = fitted(TORQUE_MAP, captures).estimates[0]
    assert kt.number == pytest.approx(whole.number, rel=1e-3)


def test_both_sides_of_d_current_are_stated_and_the_negative_published() -> None:
    """Saturated along the magnet: 20 % apart on the two sides, never averaged into one."""
    design_motor = with_effects(replace(design("gimbal-5208"), effects={}), "saturation.size_d=0.2")
    levels = {"id_levels": (-0.6, 0.0, 0.6)}
    plan = tuple(
        (f"map_{k}", "torque_map", {**levels, "speed": w}) for k, w in ((0, 0.3), (1, -0.5))
    )
    captures = campaign_of(campaign(design_motor, EXACT_BENCH, 4, plan))
    found = chain(captures, INDUCTANCE_RATED).best("ld_rated_h")
    assert found is not None
    assert found.at["id_a"] == pytest.approx(-0.6 * design_motor.current_rated_a, rel=0.01)
    assert found.number > 1.02 * design_motor.ld_h
    other = 1e-6 * float(found.note.rsplit("; ", 1)[1].split(" µH at ")[0])
    assert other < 0.98 * design_motor.ld_h


def test_plots_over_time_name_their_capture() -> None:
    """A recording shows only series that say which capture they belong to."""
    captures = recorded("")
    coasting = fitted(SPIN_DOWN, captures)
    known = Constants(coasting.estimates).adding(fitted(TORQUE_MAP, captures).estimates)
    paths = {c.path for c in captures.of("drive", "spin_down")}
    for found in (coasting, fitted(INERTIA, captures, known)):
        timed = [one for one in found.evidence if one.x_name == "t_s"]
        assert timed
        assert {one.capture for one in timed} <= paths
        assert all(series.fitted.size == series.x.size for one in timed for series in one.series)


def test_flux_plots_hold_the_published_inductance() -> None:
    found = fitted(INDUCTANCE_RATED, recorded("", tests=("torque_map",)))
    values = {e.name: e.number for e in found.estimates}
    for one, name in zip(found.evidence, ("lq_rated_h", "ld_rated_h"), strict=True):
        curves = [s for s in one.series if s.fitted.size and np.ptp(s.x) > 1.0]
        assert curves
        for series in curves:
            slope = float(np.polyfit(series.x, series.fitted, 1)[0])
            assert slope == pytest.approx(values[name], rel=1e-6)
            assert np.std(series.measured - series.fitted) < 0.02 * np.ptp(series.measured)
