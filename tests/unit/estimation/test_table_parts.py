"""Meters, thermometers, clamped shafts and single captures: their formulas on small tables."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.estimation import alone
from pipeline.estimation.electrical.back_emf import StretchFlux
from pipeline.estimation.electrical.hand_turns import Turn as Turn_
from pipeline.estimation.electrical.spin_angle import Group
from pipeline.estimation.estimators import (
    cogging,
    hand_turn,
    heat_run,
    holding_current,
    lcr,
    open_circuit,
    soak,
    torque_table,
)
from pipeline.estimation.estimators.current_step import along_ramp, inductances
from pipeline.estimation.estimators.heat_run import _alpha_alone, _line, _resistance
from pipeline.estimation.thermal.heat_record import HeatRecord
from pipeline.estimation.uncertainty.regimes import (
    Partition,
    Regression,
    _of_partition,
    halves,
    information,
    signs,
)
from pipeline.numerics.least_squares import autocorrelation_time, linear_fit
from pipeline.numerics.orders import OrderLine, Spectrum, Turn, noise_power
from pipeline.records.capture import Campaign
from pipeline.records.constants import Constants
from pipeline.records.uncertainty import Contribution, coverage_factor, type_a, type_b
from tests.unit.estimation.signals import capture, estimates, known_value

TURN = 2.0 * math.pi


# LCR meter


def meter(mean=4e-3, a=-1e-3, b=0.0, *, step=15.0, noise=0.0, pair="ab", gain=None, **more):
    angles = np.arange(0.0, 180.0, step)
    axis = {"ab": -30.0, "bc": 90.0, "ca": 210.0}[pair]
    turn = 2.0 * np.radians(angles - axis)
    rng = np.random.default_rng(0)
    l_h = mean + a * np.cos(turn) + b * np.sin(turn) + noise * rng.standard_normal(angles.size)
    extra = {} if gain is None else {"extra": {"u_rel_lcr": str(gain)}}
    return capture("lcr", "lcr", theta_elec_deg=angles, **{f"l{pair}_h": l_h}, **extra, **more)


@pytest.mark.parametrize("pair", ["ab", "bc", "ca"])
@pytest.mark.parametrize("a", [-1e-3, 1e-3])
def test_a_table_over_the_angle(pair: str, a: float) -> None:
    """Ld, Lq = (m + A)/2, (m - A)/2 of every pair, by its own axis."""
    found = estimates(lcr.ESTIMATOR, meter(a=a, pair=pair, noise=1e-7))
    assert found["ld_h"].number == pytest.approx((4e-3 + a) / 2.0, rel=1e-3)
    assert found["lq_h"].number == pytest.approx((4e-3 - a) / 2.0, rel=1e-3)
    assert found["lcr_angle_offset_deg"].number == pytest.approx(0.0, abs=0.05)


@pytest.mark.parametrize("off", [-20.0, 8.0])
def test_a_zero_that_is_off_is_found(off: float) -> None:
    """The table's own angle: L = m + A cos 2(t - axis - off)."""
    a, b = -1e-3 * math.cos(2.0 * math.radians(off)), -1e-3 * math.sin(2.0 * math.radians(off))
    found = estimates(lcr.ESTIMATOR, meter(a=a, b=b, noise=1e-7))
    assert found["lcr_angle_offset_deg"].number == pytest.approx(off, abs=0.05)
    assert found["ld_h"].number == pytest.approx(1.5e-3, rel=1e-3)
    assert found["lq_h"].number == pytest.approx(2.5e-3, rel=1e-3)
    assert f"off by {off:.1f} deg" in found["ld_h"].note
    assert "exchanged" not in found["ld_h"].note


@pytest.mark.parametrize(("off", "told"), [(34.5, False), (35.5, True), (-35.5, True)])
def test_axes_that_may_be_exchanged_from_35_degrees_on(off: float, told: bool) -> None:
    a, b = -1e-3 * math.cos(2.0 * math.radians(off)), -1e-3 * math.sin(2.0 * math.radians(off))
    found = estimates(lcr.ESTIMATOR, meter(a=a, b=b, noise=1e-8))
    assert ("exchanged" in found["ld_h"].note) is told


@pytest.mark.parametrize(("off", "told"), [(0.45, False), (0.55, True)])
def test_half_a_degree_is_the_rotors_own(off: float, told: bool) -> None:
    a, b = -1e-3 * math.cos(2.0 * math.radians(off)), -1e-3 * math.sin(2.0 * math.radians(off))
    found = estimates(lcr.ESTIMATOR, meter(a=a, b=b, noise=1e-9))
    assert ("is off by" in found["ld_h"].note) is told


def test_the_scatter_of_a_tables_inductances() -> None:
    """Over whole half turns m and A are orthogonal: u = s sqrt(1/n + 2/n)/2 each."""
    rng_noise = 2e-6
    found = estimates(lcr.ESTIMATOR, meter(step=5.0, noise=rng_noise))
    made = meter(step=5.0, noise=rng_noise)
    values = made.arrays("lab_h")["lab_h"]
    turn = 2.0 * np.radians(np.arange(0.0, 180.0, 5.0) + 30.0)
    fit = linear_fit(np.column_stack([np.ones(36), np.cos(turn)]), values)
    s = math.sqrt(float(fit.residuals @ fit.residuals) / 34.0)
    assert found["ld_h"].u_a == pytest.approx(0.5 * s * math.sqrt(3.0 / 36.0), rel=1e-6)
    assert found["lq_h"].u_a == pytest.approx(found["ld_h"].u_a, rel=1e-6)
    shift = found["lcr_angle_offset_deg"]
    assert shift.u_a == pytest.approx(
        0.5 * math.degrees(s * math.sqrt(2.0 / 36.0) / 1e-3), rel=0.05
    )


def test_a_meters_gain_is_its_own_or_voltage_over_current() -> None:
    """u_rel_lcr as stated; else sqrt(0.001^2 + 0.002^2) of the station's instruments."""
    stated = estimates(lcr.ESTIMATOR, meter(noise=1e-8, gain=0.003))["ld_h"]
    assert {p.source: p.u for p in stated.budget}["lcr@s"] == pytest.approx(0.003 * stated.number)
    usual = estimates(lcr.ESTIMATOR, meter(noise=1e-8))["ld_h"]
    gain = math.hypot(0.001, 0.002)
    assert {p.source: p.u for p in usual.budget}["lcr@s"] == pytest.approx(gain * usual.number)
    chosen = estimates(lcr.ESTIMATOR, meter(noise=1e-8), u_rel_lcr=0.01)["ld_h"]
    assert {p.source: p.u for p in chosen.budget}["lcr@s"] == pytest.approx(0.01 * chosen.number)


def test_a_meters_resistance_and_frequency() -> None:
    ohm = np.array([1.0, 1.1, 1.2, 1.1, 1.0, 1.2, 1.1, 1.1, 1.1, 1.1, 1.1, 1.1])
    found = estimates(lcr.ESTIMATOR, meter(noise=1e-8, rab_ohm=ohm, freq_hz=np.full(12, 1e3)))
    assert found["r_lcr_ohm"].number == pytest.approx(ohm.mean())
    assert found["r_lcr_ohm"].u_a == pytest.approx(ohm.std(ddof=1) / math.sqrt(12.0))
    assert found["ld_h"].at["freq_hz"] == 1e3
    assert not estimates(lcr.ESTIMATOR, meter(noise=1e-8))["r_lcr_ohm"].known


def three_pairs(theta, ld=1.5e-3, lq=2.5e-3, *, noise=0.0, seed=0, stated=False):
    """All three pairs at rotor angles [deg]; the angle is stated for one position only."""
    rng = np.random.default_rng(seed)
    theta = np.atleast_1d(np.asarray(theta, float))
    columns = {}
    for pair, axis in (("ab", -30.0), ("bc", 90.0), ("ca", 210.0)):
        turn = 2.0 * np.radians(theta - axis)
        columns[f"l{pair}_h"] = (
            ld + lq + (ld - lq) * np.cos(turn) + noise * rng.standard_normal(theta.size)
        )
    meta = {"theta_elec_deg": float(theta[0])} if stated else {}
    return capture("lcr", "lcr", **columns, **meta)


@pytest.mark.parametrize("theta", [0.0, 20.0, 75.0, 130.0])
@pytest.mark.parametrize(("ld", "lq"), [(1.5e-3, 2.5e-3), (2.5e-3, 1.5e-3)])
def test_three_pairs_at_one_stated_angle_tell_the_axes(theta, ld, lq) -> None:
    found = estimates(lcr.ESTIMATOR, three_pairs(theta, ld, lq, stated=True))
    assert found["ld_h"].number == pytest.approx(ld)
    assert found["lq_h"].number == pytest.approx(lq)
    assert "one position: scatter unknown" in found["ld_h"].note
    unknown = estimates(lcr.ESTIMATOR, three_pairs(theta, ld, lq))
    assert unknown["ld_h"].number == pytest.approx(1.5e-3)
    assert "the low inductance is taken as d" in unknown["ld_h"].note


def test_positions_scatter_and_noise_alone_makes_no_swing() -> None:
    theta = [3.0, 40.0, 77.0, 101.0, 160.0]
    found = estimates(lcr.ESTIMATOR, three_pairs(theta, noise=1e-5))
    ld = found["ld_h"]
    assert ld.u_a < 2e-5
    assert ld.number == pytest.approx(1.5e-3, rel=0.02)
    assert "scatter unknown" not in ld.note
    alike = estimates(lcr.ESTIMATOR, three_pairs(theta, 2e-3, 2e-3, noise=1e-5))
    assert alike["ld_h"].number == alike["lq_h"].number == pytest.approx(2e-3, rel=0.01)
    assert "not told apart" in alike["ld_h"].note
    for ratio, noise_alone in ((3.9, True), (4.1, False)):
        swings = ratio + np.array([-1.0, 0.0, 1.0])
        assert lcr._swing_of_noise(swings) is noise_alone
    assert not lcr._swing_of_noise(np.array([0.0]))


def one_by_one(table: lcr.Table, name: str) -> np.ndarray:
    """What each position says alone."""
    found = []
    for row in np.unique(table.row):
        own = (getattr(table, f.name)[table.row == row] for f in fields(table))
        single = lcr._at_unknown_angle(lcr.Table(*own))
        assert single is not None
        found.append(single.values[name][0])
    return np.array(found)


def test_the_scatter_over_positions_by_hand() -> None:
    """Ld over five positions: sd/sqrt(5); unparted, the means' scatter and half the swing."""
    places = [3.0, 40.0, 77.0, 101.0, 160.0]
    table = lcr._table([three_pairs(places, noise=1e-5)])
    found, lows = lcr._at_unknown_angle(table), one_by_one(table, "ld_h")
    assert found is not None
    expected = lows.mean(), lows.std(ddof=1) / math.sqrt(5.0), 4.0
    assert found.values["ld_h"] == pytest.approx(expected)
    table = lcr._table([three_pairs(places, 2e-3, 2e-3, noise=1e-5)])
    found, lows, highs = (
        lcr._at_unknown_angle(table), one_by_one(table, "ld_h"), one_by_one(table, "lq_h"),
    )  # fmt: skip
    means = 0.5 * (lows + highs)
    u = math.hypot(means.std(ddof=1) / math.sqrt(5.0), abs(lows.mean() - means.mean()))
    assert found is not None
    assert found.values["ld_h"] == pytest.approx((means.mean(), u, 4.0))


def test_five_angles_or_angles_that_do_not_part_the_swing_are_no_table() -> None:
    for step, there in ((30.0, True), (36.0, False)):
        found = estimates(lcr.ESTIMATOR, meter(step=step, noise=1e-9))
        assert found["ld_h"].known is there
    near = meter(noise=1e-9)
    table = near.tables[0].with_columns(theta_elec_deg=near.tables[0]["theta_elec_deg"] * 0.2)
    assert not estimates(lcr.ESTIMATOR, replace(near, tables=(table,)))["ld_h"].known


# Heat run


def line_of(noise=0.0, alpha=0.0039, commanded=False, rate=1.0 / 60.0):
    t = np.arange(0.0, 300.0, 1.0)
    temp = 25.0 + 50.0 * -np.expm1(-t * rate)
    rng = np.random.default_rng(2)
    r = 0.4 * (1.0 + alpha * (temp - 25.0)) + noise * rng.standard_normal(t.size)
    made = capture("heat_run", "run", t_s=t, voltage_kind="commanded" if commanded else "measured")
    five = np.full(t.size, 5.0)
    return HeatRecord(made, t, r, five, five**2, temp, None, None, False, None)


def test_the_line_of_a_heat_run() -> None:
    record = line_of(1e-4)
    line = _line(record)
    assert line is not None
    assert line.r25_ohm == pytest.approx(0.4, rel=1e-3)
    assert line.slope_ohm_k == pytest.approx(0.4 * 0.0039, rel=5e-3)
    assert line.span_k == pytest.approx(np.ptp(record.temp_winding_degc))
    assert line.temp_mean_degc == pytest.approx(record.temp_winding_degc.mean())
    assert line.rise_rate_1_s == pytest.approx(1.0 / 60.0, rel=2e-2)
    excess = record.temp_winding_degc - 25.0
    fit = linear_fit(np.column_stack([np.ones(300), excess]), record.r_phase_ohm)
    tau = autocorrelation_time(fit.residuals)
    assert line.covariance == pytest.approx(fit.covariance * tau)
    assert line.dof == pytest.approx(298.0 / tau)
    assert _line(line_of(alpha=-0.001)) is None


def test_alpha_and_r25_of_one_run_and_what_they_rest_on() -> None:
    """Alpha = s/R25 with their correlation; gains cancel; R25 by the thermometer's slope."""
    line = _line(line_of(1e-4))
    assert line is not None
    options = heat_run.ESTIMATOR.options
    r25 = _resistance(line, options, [])
    parts = {p.source: p.u for p in r25.budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * line.r25_ohm)
    assert parts["current@s"] == pytest.approx(-0.002 * line.r25_ohm)
    assert parts["temperature@s"] == pytest.approx(-0.5 * line.slope_ohm_k)
    assert parts["assumed:voltage_offset_v"] == pytest.approx(0.0005 / 5.0)
    driven = _resistance(replace(line, record=line_of(commanded=True)), options, [])
    assert {p.source: p.u for p in driven.budget}["assumed:voltage_offset_v"] == pytest.approx(0.06)
    alpha = _alpha_alone(line, r25, options, [])
    value = line.slope_ohm_k / line.r25_ohm
    assert alpha.number == pytest.approx(value)
    parts = {p.source: p.u for p in alpha.budget}
    assert abs(parts.get("voltage@s", 0.0)) < 1e-12
    assert parts["temperature@s"] == pytest.approx(value**2 * 0.5)
    assert parts["assumed:thermometer_lag"] == pytest.approx(value * line.rise_rate_1_s * 0.05)
    v, (a, b) = line.covariance, (-value / line.r25_ohm, 1.0 / line.r25_ohm)
    u = math.sqrt(a * a * v[0, 0] + b * b * v[1, 1] + 2.0 * a * b * v[0, 1])
    assert alpha.u_a == pytest.approx(u)


# Torque table


def clamped(kt=0.12, *, offset=0.03, sag=0.0, stick=0.0, noise=1e-5, levels=None, d=None, seed=0):
    levels = (
        np.array([-8.0, -6.0, -4.0, -2.0, 2.0, 4.0, 6.0, 8.0] * 2) if levels is None else levels
    )
    rng = np.random.default_rng(seed)
    id_ = np.zeros(levels.size) if d is None else d
    t = offset + kt * levels - sag * levels**3 - stick * np.sign(levels) + 0.002 * id_ * levels
    return capture("torque_table", f"table_{offset}", u_rel_torque=0.004, iq_a=levels, id_a=id_,
                   torque_shaft_nm=t + noise * rng.standard_normal(levels.size))  # fmt: skip


def test_the_slope_of_a_clamped_shaft() -> None:
    found = estimates(torque_table.ESTIMATOR, clamped(), clamped(offset=-0.5, seed=1))[
        "kt_peak_nm_a"
    ]
    assert found.number == pytest.approx(0.12, rel=1e-4)
    parts = {p.source: p.u for p in found.budget}
    assert parts["torque@s"] == pytest.approx(0.004 * found.number, rel=1e-6)
    assert parts["current@s"] == pytest.approx(-0.002 * found.number, rel=1e-5)
    assert found.at["iq_a"] == 8.0
    sagging = estimates(torque_table.ESTIMATOR, clamped(sag=1e-4))["kt_peak_nm_a"]
    assert sagging.number == pytest.approx(0.12, rel=1e-3)
    assert "sags" in sagging.note
    sticky = estimates(torque_table.ESTIMATOR, clamped(stick=0.02))["kt_peak_nm_a"]
    assert sticky.number == pytest.approx(0.12, rel=1e-3)
    moving = estimates(torque_table.ESTIMATOR, clamped(d=np.tile([-2.0, 0.0, 1.0, -1.0], 4)))[
        "kt_peak_nm_a"
    ]
    assert moving.number == pytest.approx(0.12, rel=1e-3)


def test_the_scatter_of_a_clamped_slope_and_its_magnets() -> None:
    made = clamped(noise=1e-3)
    found = estimates(torque_table.ESTIMATOR, made)["kt_peak_nm_a"]
    data = made.arrays("iq_a", "torque_shaft_nm")
    fit = linear_fit(np.column_stack([np.ones(16), data["iq_a"]]), data["torque_shaft_nm"])
    scatter = next(p for p in found.budget if p.kind == "A")
    assert scatter.u == pytest.approx(fit.u(1))
    assert scatter.dof == 14
    warm = made.tables[0].with_columns(temp_magnet_degc=np.full(16, 65.0))
    known = Constants((known_value("temp_coeff_magnet_1_k", -0.001, 1e-4),))
    hot = estimates(torque_table.ESTIMATOR, replace(made, tables=(warm,)), known=known)[
        "kt_peak_nm_a"
    ]
    assert hot.number == pytest.approx(found.number / 0.96)
    part = {p.source: p.u for p in hot.budget}["test:temp_coeff_magnet_1_k"]
    assert part == pytest.approx(-hot.number * 40.0 / 0.96 * 1e-4, rel=1e-3)


def test_few_rows_or_levels_are_no_slope() -> None:
    """Five rows and one a table; four currents a hundredth of their range apart."""
    for levels, there in (
        ([-4.0, -2.0, 0.0, 2.0, 4.0], False),
        ([-4.0, -2.0, 0.0, 2.0, 4.0, 4.0], True),
        ([-4.0, -4.0, 0.0, 0.0, 4.0, 4.0], False),
        ([-4.0, -3.97, 0.0, 0.0, 4.0, 4.0], False),
        ([-4.0, -3.8, 0.0, 0.0, 4.0, 4.0], True),
    ):
        found = estimates(torque_table.ESTIMATOR, clamped(levels=np.array(levels)))
        assert found["kt_peak_nm_a"].known is there


def test_columns_of_a_clamped_shaft() -> None:
    iq, id_ = np.array([2.0, -4.0]), np.array([1.0, 3.0])
    base, more = torque_table.torque(iq, id_, np.array([0.9, 1.0]), np.array([0.1, 0.2]))
    assert base.tolist() == [[1.0, 1.8, 2.0], [1.0, -4.0, -12.0]]
    assert more["iq^3"].tolist() == [8.0, -64.0]
    assert more["iq^5"].tolist() == [32.0, -1024.0]
    assert more["sign iq"].tolist() == [1.0, -1.0]
    assert more["iq cos 6"] == pytest.approx([2.0 * math.cos(0.6), -4.0 * math.cos(1.2)])
    assert more["iq sin 12"] == pytest.approx([2.0 * math.sin(1.2), -4.0 * math.sin(2.4)])
    for share, width in ((0.097, 2), (0.103, 3)):
        assert (
            torque_table.torque(iq, np.array([0.0, 6.0 * share]), iq * 0 + 1.0)[0].shape[1] == width
        )


# Steps


def test_inductances_bend_with_their_own_flux() -> None:
    shared = np.array([[1e-3, 2.0, -3.0, 4.0, 5.0, 2e-3, 1.0, 6.0, -7.0, 8.0]])
    y = 0.2
    ld, lq = inductances(shared, np.array([-y]), np.array([-y]))
    d = 1.0 + 2.0 * -y - 3.0 * y**2 + 4.0 * -(y**3) + 5.0 * y**4
    q = 1.0 + y**2 + 6.0 * y**3 - 7.0 * y**4 + 8.0 * y**5
    assert ld[0] == pytest.approx(1e-3 / d)
    assert lq[0] == pytest.approx(2e-3 / q)
    runaway = np.array([[1e-3, -9.0, 0, 0, 0, 2e-3, -90.0, 0, 0, 0]])
    ld, lq = inductances(runaway, np.array([0.5]), np.array([0.5]))
    assert (ld[0], lq[0]) == (pytest.approx(1e-3 / 0.05), pytest.approx(2e-3 / 0.05))


def test_inductance_along_a_ramp() -> None:
    """L = L0/(1 + a y) of the d axis: i L0 = y + a y^2/2: 1 + a y = sqrt(1 + 2 a L0 i)."""
    shared = np.array([1e-3, 40.0, 0, 0, 0, 2e-3, 0, 0, 0, 0])
    ramp = np.linspace(0.0, 5.0, 200)
    found = along_ramp(shared, 1.0, ramp)
    i_d = ramp * 2.0 / math.sqrt(3.0)
    assert found == pytest.approx(2.0 * 1e-3 / np.sqrt(1.0 + 2.0 * 40.0 * 1e-3 * i_d), rel=1e-5)
    between = along_ramp(np.array([1e-3, 0, 0, 0, 0, 2e-3, 0, 0, 0, 0.0]), 0.6, ramp)
    assert between == pytest.approx(2.0 * (0.36 * 1e-3 + 0.64 * 2e-3))


# Open circuit


def group(psi, u, temp=25.0, harmonics=None, u_harmonic=1e-3, **meta):
    logged = {"temp_magnet_degc": np.full(2, temp)}
    made = capture("open_circuit", f"{psi}", t_s=np.arange(2.0), **logged, **meta)
    flux = StretchFlux(psi, u, harmonics or {}, u_harmonic, 100.0, temp, 1.0)
    return Group(made, None, None, flux, temp)  # type: ignore[arg-type]


def test_flux_and_its_coefficient_from_steady_speeds() -> None:
    """Three temperatures with their own u: weighted line, alpha by the ratio's gradient."""
    groups = [group(0.01000, 1e-6), group(0.00981, 2e-6, 45.0), group(0.00959, 1e-6, 65.0)]
    options = open_circuit.ESTIMATOR.options
    found = open_circuit._flux_estimates(groups, [], options)
    psi, alpha = found["psi_pm_wb"], found["temp_coeff_magnet_1_k"]
    excess = np.array([0.0, 20.0, 40.0])
    fit = linear_fit(
        np.column_stack([np.ones(3), excess]),
        np.array([0.01000, 0.00981, 0.00959]),
        np.array([1e-6, 2e-6, 1e-6]),
    )
    value, slope = fit.coefficients
    assert psi.number == pytest.approx(value)
    assert alpha.number == pytest.approx(slope / value)
    v, (a, b) = fit.covariance, (-slope / value**2, 1.0 / value)
    u = math.sqrt(a * a * v[0, 0] + b * b * v[1, 1] + 2 * a * b * v[0, 1])
    assert alpha.u_a == pytest.approx(u)
    parts = {p.source: p.u for p in psi.budget}
    assert parts["voltage@s"] == pytest.approx(0.001 * value)
    assert parts["temperature@s"] == pytest.approx(-value * alpha.number * 0.5)
    parts = {p.source: p.u for p in alpha.budget}
    assert parts["temperature@s"] == pytest.approx(alpha.number**2 * 0.5)
    assert psi.at["temp_measured_high_degc"] == 65.0


@pytest.mark.parametrize(("span", "measured"), [(7.9, False), (8.1, True)])
def test_a_coefficient_needs_eight_kelvin(span: float, measured: bool) -> None:
    groups = [group(0.01, 1e-9), group(0.01 * (1.0 - 0.002 * span), 1e-9, 25.0 + span)]
    found = open_circuit._flux_estimates(groups, [], open_circuit.ESTIMATOR.options)
    assert found["temp_coeff_magnet_1_k"].known is measured


@pytest.mark.parametrize(("share", "measured"), [(0.97, True), (1.03, False)])
def test_a_coefficient_is_known_to_three_ten_thousandths(share: float, measured: bool) -> None:
    """Two equal u 20 K apart: u_alpha is near sqrt(2) u / (20 psi)."""
    alpha = -0.002
    both = math.hypot(1.0, 1.0 + 20.0 * alpha)
    u = share * 3e-4 * 20.0 * 0.01 / both
    groups = [group(0.01, u), group(0.01 * (1.0 + 20.0 * alpha), u, 45.0)]
    found = open_circuit._flux_estimates(groups, [], open_circuit.ESTIMATOR.options)
    assert found["temp_coeff_magnet_1_k"].known is measured


def test_an_assumed_coefficient_acts_by_its_lever() -> None:
    """One temperature, 20 K above: psi25 = psi/(1 + 20 alpha), and d psi25/d alpha over it."""
    groups = [group(0.0098, 1e-6, 45.0)]
    options = open_circuit.ESTIMATOR.options
    found = open_circuit._flux_estimates(groups, [], options)["psi_pm_wb"]
    factor = 1.0 - 0.0011 * 20.0
    assert found.number == pytest.approx(0.0098 / factor)
    parts = {p.source: p.u for p in found.budget}
    assert parts[open_circuit.SOURCE] == pytest.approx(-found.number * 20.0 / factor * 4e-4)


@pytest.mark.parametrize(("dof", "times"), [(2, 0.98), (2, 1.02), (7, 0.98), (7, 1.02)])
def test_scatter_beyond_chance_is_three_deviations_of_chi_squared(dof: int, times: float) -> None:
    limit = 1.0 + 3.0 * math.sqrt(2.0 / dof)
    assert open_circuit._beyond_chance(times * limit, dof) is (times > 1.0)
    assert not open_circuit._beyond_chance(1e9, 1)


def test_a_harmonic_is_the_weighted_mean_of_complex_ratios() -> None:
    """0.03 with u 1e-3 and 0.03j with u 2e-3: weights 4 to 1."""
    groups = [group(0.01, 1e-6, harmonics={5: 0.03}, u_harmonic=1e-3),
              group(0.0101, 1e-6, harmonics={5: 0.03j}, u_harmonic=2e-3)]  # fmt: skip
    found = open_circuit._harmonics(groups, tuple(g.capture for g in groups))
    fifth = found["bemf_harmonic_5"]
    mean = complex(0.8 * 0.03, 0.2 * 0.03)
    assert fifth.number == pytest.approx(abs(mean))
    chi2 = abs(0.03 - mean) ** 2 * 1e6 + abs(0.03j - mean) ** 2 * 0.25e6
    u = math.sqrt(chi2 / 2.0 / 1.25e6)
    assert fifth.u_a == pytest.approx(u)
    assert [p.dof for p in fifth.budget] == [2.0]
    assert "21 samples a cycle" in found["bemf_harmonic_7"].note
    for size, note in ((0.0029, "within noise of zero"), (0.0031, "")):
        one = [group(0.01, 1e-6, harmonics={5: complex(0.0, size)})]
        assert open_circuit._harmonics(one, (one[0].capture,))["bemf_harmonic_5"].note == note


def test_a_source_counts_by_the_weight_read_through_it() -> None:
    groups = [group(0.01, 1e-6), group(0.0101, 2e-6, station="other", u_rel_voltage=0.004)]
    shares = open_circuit._instrument_shares(groups, tuple(g.capture for g in groups))
    assert dict(shares["voltage"]) == pytest.approx({"voltage@s": 0.0008, "voltage@other": 0.0008})
    assert dict(shares["temperature"]) == pytest.approx(
        {"temperature@s": 0.4, "temperature@other": 0.1})  # fmt: skip


# Cogging


def spectrum_of(forward, backward, noise=0.01):
    turns = len(forward) + len(backward)
    rng = np.random.default_rng(0)
    coefficients = noise * (
        rng.standard_normal((turns, 60)) + 1j * rng.standard_normal((turns, 60))
    )
    senses = np.array([1] * len(forward) + [-1] * len(backward))
    return Spectrum(np.arange(1, 61), coefficients, np.array([*forward, *backward]), senses)


def creeping(speed=0.5, rows=2000, path="slow"):
    t = np.arange(rows) * 0.01
    return capture("cogging", path, t_s=t, theta_mech_rad=speed * t, torque_shaft_nm=np.zeros(rows))


def test_friction_is_half_the_gap_of_the_directions() -> None:
    """Means that scatter beyond the noise: their own variance, n - 2 degrees of freedom."""
    forward, backward = np.array([-1.0, -1.2, -1.1]), np.array([0.5, 0.9, 0.7, 0.7])
    spec = spectrum_of(forward, backward)
    found = cogging._friction([creeping()], [], spec, Constants())
    assert found.number == pytest.approx((0.7 + 1.1) / 2.0)
    squares = np.sum((forward + 1.1) ** 2) + np.sum((backward - 0.7) ** 2)
    u = math.sqrt(squares / 5.0 * (1.0 / 3.0 + 1.0 / 4.0)) / 2.0
    scatter = next(p for p in found.budget if p.kind == "A")
    assert scatter.u == pytest.approx(u)
    assert scatter.dof == 5.0
    assert "transducer zero -0.2 N" in found.note
    assert found.at["omega_mech_rad_s"] == pytest.approx(0.5)


def test_means_within_the_noise_have_the_noise_of_order_zero() -> None:
    """A quarter of E|c|^2 at the lowest order, with the spectrum's freedom."""
    spec = spectrum_of([-1.0, -1.0 + 1e-4], [0.7, 0.7 - 1e-4], noise=0.1)
    local, _, dof = noise_power(spec)
    variance, freedom = cogging._variance_of_mean(spec, spec.means[:2], spec.means[2:])
    assert variance == pytest.approx(float(local[0]) / 4.0)
    assert freedom == dof
    single = cogging._variance_of_mean(spec, spec.means[:1], spec.means[2:3])
    assert single[0] == pytest.approx(float(local[0]) / 4.0)


def test_the_viscous_part_is_taken_off_by_the_coast_down() -> None:
    """B w / (T_c + B w) with T_c/J 30 rad/s^2 and B/J 0.4 1/s at 5 rad/s: 2 of 32."""
    known = Constants((known_value("coast_coulomb_rad_s2", 30.0),
                       known_value("coast_viscous_1_s", 0.4)))  # fmt: skip
    assert cogging._viscous_share(5.0, known)[0] == pytest.approx(2.0 / 32.0)
    assert cogging._viscous_share(None, known)[0] == 0.0
    negative = Constants((known_value("coast_coulomb_rad_s2", 30.0),
                          known_value("coast_viscous_1_s", -0.4)))  # fmt: skip
    assert cogging._viscous_share(5.0, negative)[0] == 0.0
    spec = spectrum_of([-1.0, -1.2], [0.5, 0.9])
    plain = cogging._friction([creeping(5.0)], [], spec, Constants())
    found = cogging._friction([creeping(5.0)], [], spec, known)
    assert found.number == pytest.approx(plain.number * 30.0 / 32.0)
    assert found.u_a == pytest.approx(plain.u_a * 30.0 / 32.0)


def test_a_torque_that_drives_the_motion_is_no_friction() -> None:
    spec = spectrum_of([1.0, 1.01], [-1.0, -1.01])
    assert "sign of torque_shaft_nm" in cogging._friction([creeping()], [], spec, Constants()).note
    one = spectrum_of([1.0, 1.01], [])
    assert "one sense" in cogging._friction([creeping()], [], one, Constants()).note


def test_the_speed_of_a_slow_turn_is_its_path_over_its_time() -> None:
    """Two captures of 0.5 and 0.7 rad/s; there and back counts as path; noise does not lengthen."""
    assert cogging._speed([creeping(0.5), creeping(-0.7)]) == pytest.approx(0.6)
    t = np.arange(5000) * 0.01
    noisy = 0.5 * t + 1e-4 * (-1.0) ** np.arange(5000)
    made = capture("cogging", t_s=t, theta_mech_rad=noisy, torque_shaft_nm=t)
    assert cogging._speed([made]) == pytest.approx(0.5, rel=1e-3)
    blind = capture("cogging", t_s=t, torque_shaft_nm=t)
    assert cogging._speed([blind]) is None


def line(order, amplitude=1.0, p=1e-9):
    return OrderLine(order, complex(amplitude), 0.01, 9.0, p)


def plated(**meta):
    return Campaign("m", (capture("cogging", t_s=np.arange(2.0), **meta),))


def test_what_orders_say_of_the_motor() -> None:
    """12 slots, 7 pole pairs: LCM(12, 14) is 84."""
    lines = [line(84, 0.5), line(24), line(28), line(21), line(5)]
    words = cogging.name_orders(lines, Constants(), plated(slots=12, pole_pairs=7))
    assert words == ("84 (LCM of slots and poles): 0.5, 24 (slots): 1, 28 (poles): 1, "
                     "21 (pole pairs): 1, 5: 1")  # fmt: skip
    measured = Constants((known_value("pole_pairs", 5.0),))
    assert "20 (poles)" in cogging.name_orders([line(20)], measured, plated(pole_pairs=7))
    many = [line(k) for k in range(1, 12)]
    assert cogging.name_orders(many, Constants(), plated()).count(":") == 8
    assert cogging._teeth(Constants(), plated(slots=12, pole_pairs=7)) == [12, 14]
    assert cogging._teeth(measured, plated(slots=1)) == [10]


def test_orders_one_and_two_are_unbalance_but_in_motors_that_make_them() -> None:
    lines = [line(84), line(1), line(2), line(3)]
    body, slow = cogging.part_orders(lines, Constants(), plated(slots=12, pole_pairs=7))
    assert [one.order for one in slow] == [1, 2]
    assert [one.order for one in body] == [84, 3]
    for meta in ({"pole_pairs": 1}, {"slots": 1}):
        assert cogging.part_orders(lines, Constants(), plated(**meta))[1] == []
    _, slow = cogging.part_orders(lines, Constants(), plated(pole_pairs=2))
    assert [one.order for one in slow] == [1]


def test_the_second_and_third_multiple_count_with_their_own_noise() -> None:
    spec = spectrum_of([0.0, 0.1], [0.0, 0.1])
    kept = cogging.peak_orders([line(20)], spec, [], [])
    assert [one.order for one in kept] == [20, 40, 60]
    local, _, dof = noise_power(spec)
    for one in kept[1:]:
        assert one.coefficient == pytest.approx(spec.coefficients[:, one.order - 1].mean())
        assert one.u == pytest.approx(math.sqrt(local[one.order - 1] / 8.0))
        assert (one.dof, one.p_value) == (dof, 1.0)
    assert [k.order for k in cogging.peak_orders([line(25)], spec, [], [])] == [25, 50]
    stranger = [line(20), line(7, p=0.9e-6), line(9, p=1.1e-6), line(12, p=0.5), line(11, p=0.5)]
    kept = cogging.peak_orders(stranger, spec, [6], [stranger[4]])
    assert {one.order for one in kept} == {20, 7, 12, 11, 40, 60}


def test_an_order_seen_on_even_positions_may_be_another() -> None:
    """12 slots and 14 poles make 84; on 100 positions it looks like 16."""
    plate = plated(slots=12, pole_pairs=7)
    assert holding_current._true_order(16, 100, Constants(), plate)[0] == 84
    assert "100 even positions show order 84 as 16" in holding_current._true_order(
        16, 100, Constants(), plate)[1]  # fmt: skip
    assert holding_current._true_order(84, 100, Constants(), plate) == (84, "")
    assert holding_current._true_order(17, 100, Constants(), plate) == (17, "")
    assert holding_current._true_order(16, None, Constants(), plate) == (16, "")
    assert holding_current._true_order(16, 100, Constants(), plated(slots=12)) == (16, "")


def test_held_out_sectors_leave_what_the_orders_do_not_explain() -> None:
    theta = np.linspace(0.0, TURN, 6001)[:-1]
    rng = np.random.default_rng(0)
    noise = 0.01 * rng.standard_normal((2, theta.size))
    turns = [Turn(theta if s > 0 else theta[::-1], np.cos(84.0 * (theta if s > 0 else theta[::-1]))
                  + 0.3 * s + noise[k], s) for k, s in enumerate((1, -1))]  # fmt: skip
    left = holding_current.held_out_residual(turns, [84])
    assert left is not None
    assert math.sqrt(np.mean(left**2)) == pytest.approx(0.01, rel=0.05)
    without = holding_current.held_out_residual(turns, [80])
    assert math.sqrt(np.mean(without**2)) == pytest.approx(math.sqrt(0.5), rel=0.05)
    assert holding_current._u_rms(left) == pytest.approx(0.01 / math.sqrt(2.0 * left.size), rel=0.2)
    few = [Turn(t.theta_rad[::300], t.value[::300], t.sense) for t in turns]
    assert holding_current.held_out_residual(few, [84, 12]) is None


# One capture alone


def test_scatter_of_one_capture_counts_by_its_interval() -> None:
    """Of 5 degrees of freedom u is widened as 95 % of Student's law over the normal's."""
    budget = type_a("scatter", 0.1, 5.0) + type_b("voltage@s", 0.2)
    parts = {p.source: p for p in alone._own_scatter(budget, 2.0, "c.csv")}
    assert set(parts) == {"scatter#c.csv", "voltage@s"}
    widened = coverage_factor(5.0) / coverage_factor(math.inf)
    assert widened > 1.2
    assert parts["scatter#c.csv"].u == pytest.approx(0.2 * widened)
    assert parts["voltage@s"].u == pytest.approx(0.4)
    assert parts["scatter#c.csv"].dof == math.inf


@pytest.mark.parametrize(
    ("quantity", "test", "column", "meta", "expected"),
    [
        ("pole_pairs", "open_circuit", None, {}, 0.002),
        ("ld_h", "current_step", None, {}, 0.03),
        ("lq_h", "current_step", None, {}, 0.03),
        ("r_phase_ohm", "resistance", "temp_winding_degc", {}, 0.02),
        ("r_phase_ohm", "resistance", None, {}, 0.05),
        ("r_phase_ohm", "drive", "temp_winding_degc", {}, 0.03),
        ("r_phase_ohm", "drive", None, {}, 0.05),
        ("p·psi", "torque_map", "temp_magnet_degc", {}, 0.01),
        ("p·psi", "torque_map", None, {}, 0.02),
        ("p·psi", "open_circuit", "temp_magnet_degc", {}, 0.005),
        ("p·psi", "open_circuit", None, {}, 0.01),
        ("p·psi", "hand_turn", None, {"ambient_degc": 22.0}, 0.005),
        ("p·psi", "drive", "temp_winding_degc", {}, 0.03),
        ("p·psi", "heat_run", None, {}, 0.02),
        ("p·psi", "heat_run", "temp_winding_degc", {}, 0.005),
    ],
)
def test_how_a_method_spreads_from_capture_to_capture(quantity, test, column, meta, expected):
    columns = {} if column is None else {column: np.full(3, 30.0)}
    made = capture(test, t_s=np.arange(3.0), **meta, **columns)
    assert alone._spread(made, quantity) == expected


def test_what_an_inverter_is_of_a_constant() -> None:
    """2 % of the larger of the link and sqrt(3) v_q, over Ke times the largest speed."""

    def log(**more):
        columns = {"t_s": np.arange(1000) * 1e-3, "vq_v": np.full(1000, -10.0)}
        return capture("drive", **{**columns, **more})

    ke = replace(known_value("ke_phase_peak_v_s_rad", 0.05), unit="V·s/rad",
                 budget=type_b("voltage_commanded@s", 1e-3))  # fmt: skip
    speed = np.full(1000, -120.0)
    seen = 0.02 * math.sqrt(3.0) * 10.0 / (0.05 * 120.0)
    assert alone._inverter(log(omega_mech_rad_s=speed), ke) == pytest.approx(seen)
    link = 0.02 * 48.0 / (0.05 * 120.0)
    assert alone._inverter(log(omega_mech_rad_s=speed, vdc_v=48.0), ke) == pytest.approx(link)
    both = log(omega_mech_rad_s=speed, vdc_v=np.full(1000, 48.0))
    assert alone._inverter(both, ke) == pytest.approx(link)
    # from the angle where no speed was logged
    by_angle = log(theta_mech_rad=-120.0 * np.arange(1000) * 1e-3)
    assert alone._inverter(by_angle, ke) == pytest.approx(seen, rel=1e-6)
    ohm = replace(ke, unit="ohm", value=0.5)
    amps = log(iq_a=np.full(1000, -8.0), id_a=np.full(1000, 4.0))
    assert alone._inverter(amps, ohm) == pytest.approx(0.02 * math.sqrt(3.0) * 10.0 / 4.0)
    assert alone._inverter(log(), ohm) == math.inf
    assert alone._inverter(log(omega_mech_rad_s=speed), known_value("ke", 0.05)) == 0.0
    assert alone._inverter(capture("drive", t_s=np.arange(3.0)), ke) == 0.0


def test_the_largest_of_a_column_leaves_strays_aside() -> None:
    values = np.concatenate([np.linspace(-1.0, 1.0, 101), [50.0, np.nan]])
    made = capture("drive", iq_a=values)
    expected = float(np.percentile(np.abs(values[:-1]), 95.0))
    assert alone._largest(made, "iq_a") == pytest.approx(expected)
    assert alone._largest(made, "id_a") == 0.0
    t = np.arange(1000) * 1e-3
    angle = np.where(t < 0.5, 30.0 * t, 15.0 - 90.0 * (t - 0.5))
    angle[::7] = np.nan
    assert alone._fastest_rad_s(capture("drive", t_s=t, theta_mech_rad=angle)) == pytest.approx(
        90.0
    )


def test_captures_that_measure_alike() -> None:
    """The same test, pair and kind of voltage; steps also of one angle, mod 180, and height."""

    def step(path, angle, amps, **meta):
        return capture(
            "current_step", path, theta_elec_deg=angle, ia_a=np.array([0.0, -amps]), **meta
        )

    one = step("a", -30.0, 5.0)
    assert alone._way(one) == alone._way(step("b", 150.0, 5.3))
    assert alone._way(one) != alone._way(step("b", -30.0, 6.5))
    assert alone._way(one) != alone._way(step("b", 60.0, 5.0))
    assert alone._way(one) != alone._way(step("b", -30.0, 5.0, pair="bc"))
    assert alone._height(step("b", 0.0, 0.0)) == ""
    assert alone._height(step("b", 0.0, 1.25**3)) == "3"
    campaign = Campaign("m", (one, step("b", -30.0, 6.5), step("c", 150.0, 5.0)))
    assert [c.path for c in alone.repeated(campaign)] == ["a", "c"]


# Regimes


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
    assert part.u == pytest.approx(2.0 * found.found.sd)
    assert isinstance(part, Contribution)
    few = np.where(np.arange(120) < 19, 1, 0)
    assert _of_partition(made, 0, told, Partition("few", few, ("one", "other"))) is None
    enough = np.where(np.arange(120) < 20, 1, 0)
    assert _of_partition(made, 0, told, Partition("few", enough, ("one", "other"))) is not None
    alone_ = Partition("all", np.zeros(120, dtype=np.int64), ("one", "other"))
    assert _of_partition(made, 0, told, alone_) is None


# Soak


def soaked(temp, alpha=0.0038, pair="ab", noise=0.0, seed=0):
    rng = np.random.default_rng(seed)
    i = np.repeat([1.0, 2.0, -1.0, -2.0], 200) + 1e-6 * rng.standard_normal(800)
    v = 0.8 * (1.0 + alpha * (temp - 25.0)) * i + noise * rng.standard_normal(800)
    columns = {f"v{pair}_v": v, f"i{pair[0]}_a": i, "temp_winding_degc": np.full(800, temp)}
    return capture("resistance", f"{pair}{temp}", pair=pair, t_s=np.arange(800) * 1e-3, **columns)


@pytest.mark.parametrize(("span", "there"), [(9.9, False), (10.1, True)])
def test_copper_of_a_soaked_pair(span: float, there: bool) -> None:
    """Of the pairs that were measured ten kelvin apart; another pair does not count."""
    runs = [
        soaked(20.0, noise=1e-5),
        soaked(20.0 + span, noise=1e-5, seed=1),
        soaked(20.0, 0.009, "bc"),
    ]
    found = estimates(soak.ESTIMATOR, *runs)["temp_coeff_copper_1_k"]
    assert found.known is there
    if there:
        assert found.number == pytest.approx(0.0038, rel=1e-3)
        assert (found.at["temp_low_degc"], found.at["temp_high_degc"]) == pytest.approx(
            (20.0, 30.1)
        )
        parts = {p.source: p.u for p in found.budget}
        assert parts["temperature@s"] == pytest.approx(0.0038**2 * 0.5, rel=5e-3)
        assert abs(parts.get("voltage@s", 0.0)) < 1e-8


def test_a_coefficient_that_the_scatter_hides_is_not_published() -> None:
    """Within a fifth of itself it is."""
    rough = [soaked(20.0, noise=0.2, seed=3), soaked(31.0, noise=0.2, seed=4)]
    assert not estimates(soak.ESTIMATOR, *rough)["temp_coeff_copper_1_k"].known
    allowed = estimates(soak.ESTIMATOR, *rough, worst_u_rel=50.0)["temp_coeff_copper_1_k"]
    assert allowed.u_a > 0.2 * abs(allowed.number)


# Turns by hand, put together


def turn_of(name, psi, u, *, channel="vab_v", dof=math.inf, cycles=7.0, temp=25.0, **meta):
    made = capture("hand_turn", name, t_s=np.arange(2.0), temp_magnet_degc=np.full(2, temp), **meta)
    return made, Turn_(channel, cycles, psi, u, dof, np.arange(2.0), np.zeros(2), np.zeros(0))


def flux_of_turns(turns):
    options = hand_turn.ESTIMATOR.options
    return hand_turn._flux(turns, Constants((known_value("temp_coeff_magnet_1_k", -0.001, 1e-4),)),
                           options)  # fmt: skip


def test_turns_that_agree_have_their_own_scatter() -> None:
    """Weights 1, 1/4, 1/4: u is that of the weighted mean."""
    turns = [turn_of("a", 0.010, 1e-4), turn_of("b", 0.010, 2e-4), turn_of("c", 0.010, 2e-4)]
    found = flux_of_turns(turns)
    assert found.number == pytest.approx(0.010)
    assert found.u_a == pytest.approx(1e-4 / math.sqrt(1.5))


def test_turns_that_differ_scatter_as_three_do() -> None:
    """Equal weights: sd of the mean of three, with two degrees of freedom."""
    values = np.array([0.0100, 0.0103, 0.0098])
    found = flux_of_turns([turn_of(f"{k}", v, 1e-6) for k, v in enumerate(values)])
    assert found.number == pytest.approx(values.mean())
    scatter = next(p for p in found.budget if p.kind == "A")
    assert scatter.u == pytest.approx(math.sqrt(np.mean((values - values.mean()) ** 2) / 2.0))
    assert scatter.dof == 2.0


def test_a_warm_turn_and_a_cold_one_come_to_25_degrees() -> None:
    """20 K above and 10 K below: the coefficient acts by the weighted excess of both."""
    turns = [turn_of("a", 0.98e-2, 1e-4, temp=45.0), turn_of("b", 1.01e-2, 2e-4, temp=15.0)]
    found = flux_of_turns(turns)
    values = 0.98e-2 / 0.98, 1.01e-2 / 1.01
    assert found.number == pytest.approx(0.8 * values[0] + 0.2 * values[1])
    parts = {p.source: p.u for p in found.budget}
    assert parts["test:temp_coeff_magnet_1_k"] == pytest.approx(-found.number * 14.0 * 1e-4)
    assert found.at["temp_measured_degc"] == pytest.approx(39.0)
    assert parts["voltage@s"] == pytest.approx(0.001 * found.number)


def test_the_count_of_a_turn_is_that_of_the_middle_channel() -> None:
    turns = [turn_of("a", 0.01, 1e-4, cycles=c) for c in (6.2, 7.0, 7.01)]
    assert hand_turn._pole_pairs(turns).value == 7
    odd = [turn_of("a", 0.01, 1e-4, cycles=c) for c in (6.2, 6.5, 7.0)]
    assert "6.500 electrical cycles a turn" in hand_turn._pole_pairs(odd).note


def test_plots_of_flux_over_speed_have_the_line_of_their_temperature() -> None:
    """Psi 10 mWb at 25 degC, 0.1 % less a kelvin; the line is psi(T) times the speed."""
    groups = [group(0.01 * (1.0 - 0.001 * (t - 25.0)), 1e-7, t) for t in (25.0, 45.0, 65.0)]
    psi = open_circuit._flux_estimates(groups, [], open_circuit.ESTIMATOR.options)["psi_pm_wb"]
    amplitude, flux = open_circuit._evidence(groups, psi)
    for g, line_, plain in zip(groups, amplitude.series, flux.series, strict=True):
        assert plain.fitted == pytest.approx([g.flux.psi_wb])
        assert plain.measured == pytest.approx([g.flux.psi_wb])
        assert line_.fitted == pytest.approx([g.flux.psi_wb * 100.0])


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
    assert 0.0 < one.found.p_value < 1.0
    assert same.found.p_value == pytest.approx(one.found.p_value)
    assert same.found.sd == pytest.approx(one.found.sd)
