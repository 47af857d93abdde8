"""What drives a shaft and what a constant inherits from it: budgets against closed forms."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.estimation.estimators import drive_voltage, inertia, torque_map
from pipeline.estimation.estimators.inertia import (
    Torque,
    _orders,
    _slopes,
    _torque,
    driving_torque,
)
from pipeline.estimation.mechanical.drag_fit import DragFit
from pipeline.estimation.mechanical.locked_rotor import angle_doubt, ripple_share, standstill_words
from pipeline.estimation.mechanical.shaft_rows import COAST, DRIVE, ShaftRows
from pipeline.estimation.mechanical.torque_share import share_of_no_torque
from pipeline.estimation.uncertainty.agreement import judges, reconciled
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import type_a, type_b
from tests.recovery.simulated import recorded
from tests.unit.estimation.points import point
from tests.unit.estimation.signals import capture, estimates, known_value
from tests.unit.estimation.test_motion_parts import coasting, log

J, COULOMB, VISCOUS, KT = 2e-4, 8e-3, 1e-4, 0.06


def driven(path="drive", **more):
    """Drag 40 + 0.5 w rad/s^2 as `coasting` has it; 120 + 60 sin 4t rad/s, a load of 5 mN.m."""
    t = np.arange(12_000) / 2000.0
    speed = 120.0 + 60.0 * np.sin(4.0 * t) + 8.0 * np.sin(11.0 * t)
    gain = 240.0 * np.cos(4.0 * t) + 88.0 * np.cos(11.0 * t)
    theta = 120.0 * t - 15.0 * np.cos(4.0 * t) - 8.0 / 11.0 * np.cos(11.0 * t)
    load = 5e-3 * np.cos(1.3 * t)
    torque = J * gain + COULOMB + VISCOUS * speed + load
    columns = {"t_s": t, "theta_mech_rad": theta, "iq_a": torque / KT, "torque_shaft_nm": load,
               "temp_magnet_degc": np.full(t.size, 25.0)}  # fmt: skip
    return capture("drive", path, u_rel_torque=0.004, **{**columns, **more})


def kt(u=6e-5):
    return replace(known_value("kt_peak_nm_a", KT, u, "N·m/A", "torque_map"))


KNOWN = Constants((kt(), known_value("kt_reluctance_nm_a2", 0.0)))


def test_inertia_and_friction_of_a_drive_and_coasts() -> None:
    """J = K i/(a + drag): it goes with K and the current in full, friction too."""
    runs = (driven(), coasting(1.0), coasting(-1.0, path="back"))
    found = estimates(inertia.ESTIMATOR, *runs, known=KNOWN)
    expected = {"j_rotor_kgm2": J, "torque_coulomb_nm": COULOMB, "b_visc_nm_s_rad": VISCOUS}
    for name, value in expected.items():
        assert found[name].number == pytest.approx(value, rel=3e-3)
        parts = {p.source: p.u for p in found[name].budget}
        # of friction the drives tell a part by themselves, whose ratio to J moves
        near = 0.02 if name == "j_rotor_kgm2" else 0.15
        assert parts["test:kt_peak_nm_a"] == pytest.approx(6e-5 / KT * value, rel=near)
        assert parts["current@s"] == pytest.approx(0.002 * value, rel=near)
        # the load is a small part of the torque, and so its gain of the inertia
        assert abs(parts["torque@s"]) < 0.2 * 0.004 * value
    assert found["j_rotor_kgm2"].at["omega_mech_rad_s"] == pytest.approx(200.0, rel=0.02)


def test_a_load_that_is_not_logged_and_one_beside_it() -> None:
    bare = driven("bare")
    bare = replace(bare, tables=(bare.tables[0].drop("torque_shaft_nm"),))
    both = estimates(inertia.ESTIMATOR, driven(), bare, coasting(), known=KNOWN)["j_rotor_kgm2"]
    assert "without bare, whose load is not logged" in both.note
    assert both.captures == ("c", "drive")
    alone = estimates(inertia.ESTIMATOR, bare, coasting(), known=KNOWN)["j_rotor_kgm2"]
    if alone.known:
        assert "no drive logs its load" in alone.note


def test_without_torque_or_a_torque_constant_there_is_no_inertia() -> None:
    idle = driven(iq_a=np.zeros(12_000), torque_shaft_nm=np.zeros(12_000))
    assert "holds no torque" in estimates(inertia.ESTIMATOR, idle, known=KNOWN)["j_rotor_kgm2"].note
    assert "torque constant" in estimates(inertia.ESTIMATOR, driven())["j_rotor_kgm2"].note
    only = estimates(inertia.ESTIMATOR, coasting(), known=KNOWN)["j_rotor_kgm2"]
    assert "no usable drive log" in only.note


def rows_of(captures, **columns):
    size = next(iter(columns.values())).size
    blank = np.zeros(size)
    given = {"capture": np.zeros(size, dtype=np.int64), "kind": np.zeros(size, dtype=np.int64),
             "cluster": np.zeros(size, dtype=np.int64), **columns}  # fmt: skip
    names = ("time_s", "acceleration_rad_s2", "q_current_a", "warm_current_k_a", "product_a2",
             "load_nm", "ripple_nm", "u_ripple_nm", "speed_rad_s", "sense")  # fmt: skip
    return ShaftRows(captures=tuple(captures), columns={}, fastest_rad_s=1.0, dropped=0,
                     **{n: blank for n in names if n not in given}, **given)  # fmt: skip


def test_the_torque_that_drives() -> None:
    """K (1 + a (T - 25)) iq + Kr id iq - load, with instruments off in their own way."""
    made = [
        capture("drive", "a", t_s=np.arange(2.0), temp_magnet_degc=np.ones(2)),
        capture("drive", "b", t_s=np.arange(2.0), station="x", temp_magnet_degc=np.ones(2)),
    ]
    rows = rows_of(made, q_current_a=np.array([2.0, 3.0]), warm_current_k_a=np.array([20.0, 0.0]),
                   product_a2=np.array([4.0, -1.0]), load_nm=np.array([0.1, 0.2]),
                   capture=np.array([0, 1]))  # fmt: skip
    torque = Torque(0.5, (), 0.01, (), -0.002, (), "")
    plain = driving_torque(rows, torque, {})
    assert plain == pytest.approx([0.5 * (2.0 - 0.04) + 0.04 - 0.1, 1.5 - 0.01 - 0.2])
    off = driving_torque(rows, torque, {"current@s": 0.1, "torque@x": -0.5, "temperature@s": 4.0})
    warm = 20.0 + 2.0 * 4.0
    assert off[0] == pytest.approx(0.55 * (2.0 - 0.002 * warm) + 0.01 * 1.21 * 4.0 - 0.1)
    assert off[1] == pytest.approx(1.5 - 0.01 - 0.1)
    moved = driving_torque(rows, torque, {"kt": 0.1, "reluctance": 0.02, "magnet": 0.001})
    assert moved[0] == pytest.approx(0.55 * (2.0 - 0.001 * 20.0) + 0.03 * 4.0 - 0.1)


def test_slopes_by_what_a_torque_rests_on() -> None:
    """J = kt (1 + k) + 3 r and others, where the torque constant moves by a share k of itself."""
    torque = Torque(0.5, (), -0.02, (), 0.0, (), "")

    def values(shift):
        k, r, m = (shift.get(name, 0.0) for name in ("kt", "reluctance", "magnet"))
        return np.array([0.5 * (1.0 + k) + 3.0 * r, 7.0 * r, 2.0 * m])

    per_kt, per_reluctance, per_magnet = _slopes(values, torque)
    assert per_kt == pytest.approx([1.0, 0.0, 0.0])
    assert per_reluctance == pytest.approx([3.0, 7.0, 0.0])
    assert per_magnet == pytest.approx([0.0, 0.0, 2.0])


def test_reluctance_by_itself_by_the_inductances_or_not_at_all() -> None:
    base = (kt(),)
    measured = _torque(Constants((*base, known_value("kt_reluctance_nm_a2", -0.01, 1e-4))))
    assert measured is not None
    assert (measured.reluctance_nm_a2, measured.reluctance_known) == (-0.01, True)
    axes = (
        known_value("ld_h", 2e-3, 1e-5),
        known_value("lq_h", 3e-3, 2e-5),
        known_value("pole_pairs", 4),
    )
    derived = _torque(Constants((*base, *axes)))
    assert derived is not None
    assert derived.reluctance_nm_a2 == pytest.approx(1.5 * 4 * -1e-3)
    parts = {p.source: p.u for p in derived.reluctance_budget}
    assert parts == pytest.approx({"test:ld_h": 6e-5, "test:lq_h": -1.2e-4})
    unknown = _torque(Constants(base))
    assert unknown is not None
    assert (unknown.reluctance_nm_a2, unknown.reluctance_known) == (0.0, False)
    assert _torque(Constants()) is None


def test_orders_of_cogging_and_of_six_fold_ripple() -> None:
    plate = {"slots": 12, "pole_pairs": 7}
    campaign = Campaign("m", (capture("drive", t_s=np.arange(2.0), **plate),))
    assert _orders(Constants(), campaign, 7) == ((84,), (42,))
    bare = Campaign("m", (capture("drive", t_s=np.arange(2.0)),))
    assert _orders(Constants(), bare, None) == ((), ())


def test_friction_that_coasts_show_takes_no_place_of_a_torque() -> None:
    """Drives that pass a knot of the drag curve only while they accelerate: 94 % of that seemed to
    follow no torque, since they were fitted without it by themselves.
    """
    rng = np.random.default_rng(1)
    torque = np.concatenate([np.ones(6), np.zeros(30)])
    knot = np.concatenate([np.ones(6), np.ones(30)])
    y = 800.0 * torque - 50.0 * knot + rng.standard_normal(36)
    design = np.column_stack([torque, -knot])
    fit = linear_fit(design, y)
    kind = np.repeat([DRIVE, COAST], [6, 30])
    rows = rows_of([], q_current_a=torque, kind=kind)
    blank = np.zeros(3)
    made = DragFit(("torque", "knot 0"), fit.coefficients, fit.covariance, fit.residuals, 34, True,
                   blank, ("", "", ""), design, np.ones(36), y, 1.0)  # fmt: skip
    assert share_of_no_torque(rows, made) < 1e-3


def test_the_share_of_the_acceleration_that_follows_no_torque() -> None:
    """Residual squares of the drives over those without the torque's column."""
    rng = np.random.default_rng(0)
    drive = rng.standard_normal(60)
    design = np.column_stack([drive, np.ones(60)])
    y = 2.0 * drive + 3.0 + 0.5 * rng.standard_normal(60)
    fit = linear_fit(design, y)
    kind = np.repeat([DRIVE, COAST], [40, 20])
    rows = rows_of([], q_current_a=drive, kind=kind)
    blank = np.zeros(3)
    made = DragFit(("torque", "offset"), fit.coefficients, fit.covariance, fit.residuals, 58, False,
                   blank, ("", "", ""), design, np.ones(60), y, 1.0)  # fmt: skip
    left = (y - y.mean())[:40]
    expected = float(fit.residuals[:40] @ fit.residuals[:40]) / float(left @ left)
    assert share_of_no_torque(rows, made) == pytest.approx(expected)


# A rotor that is held


def test_ripple_of_a_held_rotor_cancels_over_its_angles() -> None:
    """(h5 + h7)/sqrt(2) at one angle; over angles as the mean of exp(6 j p theta)."""
    one = np.array([0.3])
    usual = math.hypot(0.06, 0.02) / math.sqrt(2.0)
    assert ripple_share(one, 5, Constants()) == pytest.approx(usual)
    measured = Constants(
        (known_value("bemf_harmonic_5", 0.04), known_value("bemf_harmonic_7", 0.01))
    )
    assert ripple_share(one, 5, measured) == pytest.approx(math.hypot(0.05, 0.02) / math.sqrt(2.0))
    step = 2.0 * math.pi / 30.0 / 2.0  # half a ripple of order 6 p: that of 12 p adds up
    assert ripple_share(np.array([0.0, step]), 5, Constants()) == pytest.approx(
        0.02 / math.sqrt(2.0)
    )
    assert ripple_share(np.array([0.0, step]), None, Constants()) == pytest.approx(usual)
    assert ripple_share(np.array([0.0, np.nan]), 5, Constants()) == pytest.approx(usual)
    held = point(1.0, w=0.0, cos_turn=math.cos(0.3), sin_turn=math.sin(0.3))
    (part,) = angle_doubt([held, point(1.0)], -0.1, 5, Constants())
    assert part.u == pytest.approx(usual * 0.1 / 2.0)
    assert angle_doubt([point(1.0)], 0.1, 5, Constants()) == ()
    assert standstill_words([point(1.0)], [held, point(1.0)]) == "1 points at standstill left out"
    assert "static friction" in standstill_words([held], [held])
    assert standstill_words([point(1.0)], [point(1.0)]) == ""


# Agreement of methods


def by(method, value, u, **at):
    made = known_value("r_phase_ohm", value, unit="ohm", method=method)
    return replace(made, budget=type_a(f"scatter:{method}", u, 50.0), at=at)


def test_methods_that_disagree_beyond_chance_widen_each_other() -> None:
    """1.0 and 1.1 with u 0.01: sd of what is between them by the method of moments."""
    found = reconciled(Constants((by("a", 1.0, 0.01), by("b", 1.1, 0.01))))
    first = found.by("a", "r_phase_ohm")
    assert first is not None
    assert first.number == 1.0
    part = next(p for p in first.budget if p.source.endswith("r_phase_ohm"))
    spread = (0.1**2 / 2.0) - 0.01**2
    assert part.u == pytest.approx(math.sqrt(spread), rel=0.05)
    assert part.dof == 1.0
    assert "methods disagree beyond chance (a 1 ± 0.01, b 1.1 ± 0.01 ohm)" in first.note
    near = reconciled(Constants((by("a", 1.0, 0.01), by("b", 1.02, 0.01))))
    assert all(len(e.budget) == 1 for e in near.estimates)
    for rho, widened in ((1e-9, True), (0.1, False)):
        shared = type_b("voltage@s", rho)
        pair = [replace(by(m, v, 0.0), budget=(*type_a(f"s:{m}", 1e-3, 50.0), *shared))
                for m, v in (("a", 1.0), ("b", 1.1))]  # fmt: skip
        # one gain in both does not part them: they still disagree
        assert len(reconciled(Constants(tuple(pair))).estimates[0].budget) == 3
        assert widened or rho == 0.1


@pytest.mark.parametrize(("times", "counts"), [(0.98, True), (1.02, False)])
def test_a_method_judges_where_it_is_precise_enough(times: float, counts: bool) -> None:
    """Three times the other's u, times the root of the number of both."""
    own = by("a", 1.0, 0.01)
    other = by("b", 1.1, times * 3.0 * math.sqrt(2.0) * 0.01)
    assert bool(judges(Constants((own, other)), own)) is counts


@pytest.mark.parametrize(("ratio", "alike"), [(9.9, True), (10.1, False)])
def test_methods_of_speeds_of_one_order_of_magnitude_are_held_together(ratio, alike) -> None:
    own = by("a", 1.0, 0.01, omega_mech_rad_s=-20.0)
    other = by("b", 1.1, 0.01, omega_mech_rad_s=20.0 * ratio)
    assert bool(judges(Constants((own, other)), own)) is alike
    unsaid = by("c", 1.1, 0.01)
    assert judges(Constants((own, unsaid)), own) == [unsaid]


# Budgets of a drive's voltage and of a map


def test_what_ke_and_r_of_a_drive_inherit() -> None:
    """Voltage scales both; current R alone, the other way; magnets Ke by their own law."""
    known = Constants((known_value("temp_coeff_magnet_1_k", -0.001, 1e-4),))
    warm = log(temp_magnet_degc=np.full(8000, 65.0), temp_winding_degc=np.full(8000, 25.0))
    found = estimates(drive_voltage.ESTIMATOR, warm, known=known)
    ke, r = found["ke_phase_peak_v_s_rad"], found["r_phase_ohm"]
    assert ke.number == pytest.approx(0.02 / 0.96, rel=2e-3)
    parts = {p.source: p.u for p in ke.budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * ke.number, rel=1e-3)
    assert abs(parts.get("current@s", 0.0)) < 1e-6 * ke.number
    assert parts["test:temp_coeff_magnet_1_k"] == pytest.approx(
        -ke.number * 40.0 / 0.96 * 1e-4, rel=0.02
    )
    parts = {p.source: p.u for p in r.budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * r.number, rel=1e-3)
    assert parts["current@s"] == pytest.approx(-0.002 * r.number, rel=1e-3)
    cold = estimates(drive_voltage.ESTIMATOR, log(), known=known)
    for name, per_k in (("ke_phase_peak_v_s_rad", 0.001), ("r_phase_ohm", 1.0 / 259.5)):
        parts = {p.source: p.u for p in cold[name].budget}
        place = "temp_magnet_degc" if name.startswith("ke") else "temp_winding_degc"
        size = parts[f"assumed:{place}"] / cold[name].number / per_k
        assert 10.0 < size < 25.0
        assert "not logged, taken as 25" in cold[name].note


def test_the_regression_of_a_map_gives_its_points_their_rows() -> None:
    """A point of four times the rows counts four times: weighted least squares by hand."""
    points = [
        point(i, rows=n, torque_nm=t)
        for i, n, t in ((-2.0, 100, -0.11), (2.0, 400, 0.13), (4.0, 100, 0.23), (-4.0, 200, -0.25))
    ]
    found = torque_map._regress(points, 0.0, [])
    x = np.array([[1.0, p.iq_a] for p in points])
    w = np.diag([p.rows for p in points])
    y = np.array([p.torque_nm for p in points])
    beta = np.linalg.solve(x.T @ w @ x, x.T @ w @ y)
    assert found.coefficients == pytest.approx(beta)
    left = y - x @ beta
    mean = np.mean([p.rows for p in points])
    chi2 = left @ w @ left / mean / 2.0
    assert found.covariance == pytest.approx(np.linalg.inv(x.T @ w @ x / mean) * chi2)
    assert found.dof == 2


def test_levels_of_few_rows_are_said_to_be_too_short() -> None:
    """A map whose levels last for eight rows is no lack of a map."""
    (full,) = recorded((("torque_map_0", "torque_map", {"dwell_s": 0.06}),), 3)[0].captures
    levels = 24
    thinned = full.tables[0].gather_every(full.tables[0].height // (8 * levels))
    found = estimates(torque_map.ESTIMATOR, replace(full, tables=(thinned,)))["kt_peak_nm_a"]
    assert not found.known
    assert found.note.startswith("0 levels of current hold still for 20 rows once settled")
    assert "hold each level for longer" in found.note
