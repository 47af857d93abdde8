"""Tables of an LCR meter: their formulas on small ones."""

from __future__ import annotations

import math
from dataclasses import fields, replace

import numpy as np
import pytest

from pipeline.contracts.registry import gates
from pipeline.estimation.estimators import (
    lcr,
)
from pipeline.estimation.registry import fit_all
from pipeline.numerics.least_squares import linear_fit
from pipeline.records.capture import Campaign
from tests.unit.estimation.signals import capture, estimates

GATES = {gate.name: gate for gate in gates()}


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
    assert "cannot be distinguished" in alike["ld_h"].note
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


def test_one_row_of_three_pairs_is_a_reading() -> None:
    """A meter's table has no clock; one row was refused, and its saliency had no uncertainty."""
    rows = {
        name: np.array([4e-3 - 1e-3 * math.cos(2.0 * math.radians(17.0 - axis))])
        for name, axis in (("lab_h", -30.0), ("lbc_h", 90.0), ("lca_h", 210.0))
    }
    table = capture("lcr", "lcr", theta_elec_deg=np.array([17.0]), **rows)
    assert GATES["missing_values"].check(table, GATES["missing_values"].options).masks == ()
    known = fit_all(Campaign("m", (table,)), {})[0]
    for name, true in (("ld_h", 1.5e-3), ("lq_h", 2.5e-3)):
        found = known.best(name)
        assert found is not None
        assert found.number == pytest.approx(true, rel=1e-9)
    ratio = known.best("saliency_ratio")
    assert ratio is not None
    assert 0.001 * ratio.number < ratio.u < 0.05 * ratio.number
