"""Electrical estimators on signals written out here in closed form, and on the rig's motors."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from pipeline.fit.estimators import (
    current_step,
    derived,
    derived_electrical,
    hand_turn,
    heat_run,
    lcr,
    open_circuit,
    resistance,
    soak,
    thermal,
)
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.records.uncertainty import type_b

RIG = Path(__file__).parents[4] / "shared" / "data" / "rig"
GAINS = {"station": "s", "u_rel_voltage": 0.001, "u_rel_current": 0.002, "u_temp_degc": 0.5}


def capture(test, path="c", **meta_and_columns):
    """A capture from metadata and columns; arrays are columns."""
    columns = {k: v for k, v in meta_and_columns.items() if isinstance(v, np.ndarray)}
    meta = {k: v for k, v in meta_and_columns.items() if not isinstance(v, np.ndarray)}
    table = pl.DataFrame(columns)
    return Capture(path, "0" * 64, "verified", CaptureMeta("m", test, **GAINS | meta), (table,))


def estimates(estimator, *captures, known=None, **options):
    """What an estimator finds, by name; everything it promises is there once."""
    campaign = Campaign("m", tuple(captures))
    chosen = {**estimator.options, **options}
    fit = estimator.fit(campaign, known or Constants(), chosen)
    assert sorted(e.name for e in fit.estimates) == sorted(estimator.gives)
    return {e.name: e for e in fit.estimates}


def known_value(name, value, u=0.0, unit="1", method="elsewhere"):
    return Estimate(name, value, unit, "measured", method, type_b(f"test:{name}", u))


def near(estimate, value, times=4.0):
    """Within `times` its own type A uncertainty."""
    return abs(estimate.number - value) < times * estimate.u_a


# Resistance


def dc_capture(
    pair, r_ohm, *, v0=0.0, offset=0.0, levels=(1.0, 2.0, -1.0, -2.0), temp=25.0, seed=0
):
    rng = np.random.default_rng(seed)
    current = np.repeat((0.0, *levels), 200)
    v = r_ohm * current + v0 * np.sign(current) + offset
    columns = {
        "t_s": np.arange(current.size) * 1e-3,
        f"v{pair}_v": v + 1e-3 * rng.standard_normal(current.size),
        f"i{pair[0]}_a": current + 1e-3 * rng.standard_normal(current.size),
        "temp_winding_degc": np.full(current.size, temp),
    }
    return capture("resistance", f"r_{pair}_{temp:g}_{seed}", pair=pair, **columns)


def test_unbalanced_phases_and_the_drop_at_the_zero_crossing():
    """R_a 0.50, R_b 0.52, R_c 0.55 ohm; V0 0.05 V and an offset of 20 mV do not enter."""
    pairs = {"ab": 1.02, "bc": 1.07, "ca": 1.05}
    found = estimates(
        resistance.ESTIMATOR,
        *(dc_capture(p, r, v0=0.05, offset=0.02, seed=k) for k, (p, r) in enumerate(pairs.items())),
    )
    for phase, r in zip("abc", (0.50, 0.52, 0.55), strict=True):
        assert near(found[f"r_{phase}_ohm"], r)
    assert near(found["r_phase_ohm"], 3.14 / 6.0)
    assert near(found["voltage_offset_v"], 0.05)
    assert near(found["resistance_imbalance"], 0.05 * 6.0 / 3.14)
    assert found["r_ll_ohm"].number == pytest.approx(2.0 * found["r_phase_ohm"].number)


def test_resistance_is_brought_to_25_degc():
    """0.598 ohm at 70 degC is 0.500 at 20 degC, 0.5098 at 25 (IEEE 112: 234.5 + T)."""
    r70 = 1.0 * (234.5 + 70.0) / (234.5 + 20.0)
    found = estimates(resistance.ESTIMATOR, dc_capture("ab", r70, temp=70.0))
    assert found["r_ab_ohm"].number == pytest.approx(259.5 / 254.5, rel=3e-4)
    assert found["resistance_imbalance"].status == "not_identifiable"
    sources = {part.source: part.u for part in found["r_ab_ohm"].budget}
    # Copper of 1 % other slope: 45 K x 0.003854 x 1 % at 70 degC.
    assert abs(sources["assumed:temp_coeff_copper_1_k"]) == pytest.approx(
        1.0196 * 0.01 * 45 / 259.5 / (1 + 45 / 259.5), rel=0.02
    )
    assert sources["voltage@s"] > 0.0 > sources["current@s"]


def test_one_level_leaves_the_drop_as_an_allowance():
    found = estimates(resistance.ESTIMATOR, dc_capture("ab", 1.0, levels=(2.0, -2.0)))
    assert found["voltage_offset_v"].status == "not_identifiable"
    parts = {part.source: part for part in found["r_ab_ohm"].budget}
    assert parts["assumed:voltage_offset_v"].u == pytest.approx(0.0005 / 2.0, rel=1e-3)
    assert parts["assumed:voltage_offset_v"].kind == "B"


def test_no_plateau_names_the_experiment():
    ramp = np.linspace(0.0, 1.0, 400)
    bad = capture("resistance", pair="ab", t_s=np.arange(400.0), vab_v=ramp * 0.0, ia_a=ramp * 0.0)
    found = estimates(resistance.ESTIMATOR, bad)
    assert all(e.status == "not_identifiable" for e in found.values())
    assert "plateaus of both" in found["r_phase_ohm"].note


def test_soaked_winding_gives_the_coefficient_at_25_degc():
    captures = [
        dc_capture("ab", 1.0 * (1 + 0.0042 * (t - 25.0)), temp=t, seed=k, v0=0.1)
        for k, t in enumerate((20.0, 65.0))
    ]
    found = estimates(soak.ESTIMATOR, *captures)["temp_coeff_copper_1_k"]
    assert near(found, 0.0042)
    assert estimates(soak.ESTIMATOR, captures[0])[found.name].status == "not_identifiable"


# Current step


def step_capture(
    pair, theta_deg, volts, l_ll, *, seed, timing="instant", edge=0.3, r=0.8, i_sigma=2e-3
):
    """Exact response of a constant L; the edge lies `edge` of a sample before a sample."""
    rng = np.random.default_rng(seed)
    dt, n, tau = 1e-5, 3000, l_ll / r
    t = np.arange(n) * dt
    on, off = (200 - edge) * dt, (2000 - edge) * dt

    def area(x):
        return np.clip(x - on, 0.0, off - on) * volts

    def rise(x):
        return -np.expm1(-np.maximum(x, 0.0) / tau)

    voltage = {
        "instant": volts * ((t >= on) & (t < off)),
        "held": (area(t + dt) - area(t)) / dt,
        "centred": (area(t + dt / 2) - area(t - dt / 2)) / dt,
    }[timing]
    current = volts / r * (rise(t - on) - rise(t - off)) + 0.03
    columns = {
        "t_s": t,
        f"v{pair}_v": voltage + 1e-3 * rng.standard_normal(n),
        f"i{pair[0]}_a": current + i_sigma * rng.standard_normal(n),
    }
    meta = {"pair": pair, "theta_elec_deg": theta_deg, "voltage_timing": timing}
    return capture("current_step", f"{pair}_{theta_deg}_{volts}", **meta, **columns)


def terminal(pair, theta_deg, ld, lq):
    turn = math.radians(2 * theta_deg + {"ab": 60.0, "bc": -180.0, "ca": -60.0}[pair])
    return (ld + lq) + (ld - lq) * math.cos(turn)


@pytest.mark.parametrize("timing", ["instant", "held", "centred"])
@pytest.mark.parametrize("edge", [0.0, 0.5, 0.9])
def test_the_edge_between_samples_does_not_bias_l(timing, edge):
    """A trapezoid across the edge would be half a sample off: 1 % of L here."""
    captures = [
        step_capture(
            "ab",
            theta,
            v,
            terminal("ab", theta, 2e-4, 3e-4),
            seed=k,
            timing=timing,
            edge=edge if timing != "held" else 0.0,
        )
        for k, (theta, v) in enumerate([(-30.0, 4.0), (-30.0, -4.0), (60.0, 4.0), (60.0, -4.0)])
    ]
    found = estimates(current_step.ESTIMATOR, *captures)
    assert near(found["ld_h"], 2e-4)
    assert near(found["lq_h"], 3e-4)
    assert found["ld_h"].u_a < 3e-4 * 2e-4


def test_any_pair_at_any_angle():
    places = [("ab", 10.0), ("bc", 35.0), ("ca", 100.0), ("ca", 170.0)]
    captures = [
        step_capture(pair, theta, 3.0, terminal(pair, theta, 1.5e-4, 4e-4), seed=k)
        for k, (pair, theta) in enumerate(places)
    ]
    found = estimates(current_step.ESTIMATOR, *captures)
    assert near(found["ld_h"], 1.5e-4)
    assert near(found["lq_h"], 4e-4)


def test_gains_enter_l_as_voltage_over_current():
    captures = [step_capture("ab", -30.0, v, 4e-4, seed=k) for k, v in enumerate((3.0, 5.0))]
    found = estimates(current_step.ESTIMATOR, *captures)
    sources = {part.source: part.u for part in found["ld_h"].budget}
    assert sources["voltage@s"] == pytest.approx(0.001 * 2e-4, rel=0.02)
    assert sources["current@s"] == pytest.approx(-0.002 * 2e-4, rel=0.02)
    assert found["lq_h"].status == "not_identifiable"
    assert "q axis" in found["lq_h"].note


def test_saturation_is_extrapolated_to_zero_current():
    """I = (psi/L)(1 + k psi²) integrated with 50 substeps; 17 % less L at the largest current."""
    rng = np.random.default_rng(8)
    captures = []
    for volts in (0.8, 2.4, 4.0):
        psi, current, dt, n = 0.0, np.zeros(3000), 1e-5, 3000
        for k in range(n):
            v = volts if 200 <= k < 2000 else 0.0
            current[k] = psi / 6e-4 * (1 + 2e4 * psi**2)
            for _ in range(10):
                i_mid = psi / 6e-4 * (1 + 2e4 * psi**2)
                mid = psi + 0.5e-6 * (v - 0.8 * i_mid)
                psi += 1e-6 * (v - 0.8 * (mid / 6e-4 * (1 + 2e4 * mid**2)))
        columns = {
            "t_s": np.arange(n) * dt,
            "vab_v": np.where((np.arange(n) >= 200) & (np.arange(n) < 2000), volts, 0.0)
            + 1e-3 * rng.standard_normal(n),
            "ia_a": current + 2e-3 * rng.standard_normal(n),
        }
        captures.append(
            capture("current_step", f"{volts}", pair="ab", theta_elec_deg=60.0, **columns)
        )
    found = estimates(current_step.ESTIMATOR, *captures)["lq_h"]
    assert found.number == pytest.approx(3e-4, rel=1.5e-3)
    assert "incremental -" in found.note


# LCR


def lcr_capture(offset_deg, pairs=("ab",), angles=None, seed=0):
    rng = np.random.default_rng(seed)
    angles = np.arange(0.0, 360.0, 15.0) if angles is None else np.array(angles)
    columns = {
        f"l{p}_h": np.array([terminal(p, a + offset_deg, 2e-4, 3e-4) for a in angles])
        + 4e-7 * rng.standard_normal(angles.size)
        for p in pairs
    }
    return columns, angles


def test_lcr_over_angle_finds_a_rotor_zero_that_is_off():
    columns, angles = lcr_capture(12.0)
    found = estimates(lcr.ESTIMATOR, capture("lcr", theta_elec_deg=angles, **columns))
    assert near(found["ld_h"], 2e-4)
    assert near(found["lq_h"], 3e-4)
    assert abs(found["lcr_angle_offset_deg"].number) == pytest.approx(12.0, abs=0.5)


def test_three_pairs_at_one_unknown_angle_give_both():
    columns, _ = lcr_capture(0.0, ("ab", "bc", "ca"), [37.0] * 4)
    found = estimates(lcr.ESTIMATOR, capture("lcr", **columns))
    assert found["ld_h"].number == pytest.approx(2e-4, rel=3e-3)
    assert found["lq_h"].number == pytest.approx(3e-4, rel=3e-3)
    assert "rotor angle unknown" in found["ld_h"].note


def test_three_pairs_at_a_stated_angle_tell_the_axes():
    """Ld above Lq, which the guess 'low is d' would exchange."""
    columns = {f"l{p}_h": np.array([terminal(p, 0.0, 3e-4, 2e-4)] * 3) for p in ("ab", "bc", "ca")}
    meta = CaptureMeta("m", "lcr", theta_elec_deg=0.0)
    one = Capture("c", "0" * 64, "verified", meta, (pl.DataFrame(columns),))
    found = estimates(lcr.ESTIMATOR, one)
    assert found["ld_h"].number == pytest.approx(3e-4)
    assert found["lq_h"].number == pytest.approx(2e-4)


# Open circuit


def spin_capture(speeds, *, p=5, psi=4e-3, wobble=0.0, swap=False, temp=25.0, h5=0.03, seed=0):
    """Flux psi (cos e + h5/5 cos 5e + 0.01/7 cos 7e) of each phase, differentiated by hand."""
    rng = np.random.default_rng(seed)
    rate, each = 20_000.0, 6000
    omega = np.repeat(speeds, each).astype(float)
    theta = np.cumsum(omega) / rate
    v = []
    for k in range(3):
        e = p * theta - 2.0 * math.pi * k / 3.0
        e5, e7 = (n * e for n in (5, 7))
        v.append(-p * omega * psi * (np.sin(e) + h5 * np.sin(e5) + 0.01 * np.sin(e7)))
    if swap:
        v[1], v[2] = v[2], v[1]
    noise = 2e-3 * rng.standard_normal((2, omega.size))
    return capture(
        "open_circuit",
        f"spin_{speeds[0]}_{temp}",
        t_s=np.arange(omega.size) / rate,
        vab_v=v[0] - v[1] + noise[0] + 0.01,
        vbc_v=v[1] - v[2] + noise[1] - 0.02,
        theta_mech_rad=theta + wobble * np.sin(theta + 1.0),
        temp_magnet_degc=np.full(omega.size, temp),
    )


def test_flux_and_harmonics_with_an_eccentric_encoder():
    """An angle that wobbles by 0.01 rad once a turn would cost 0.06 % of a demodulated flux."""
    found = estimates(open_circuit.ESTIMATOR, spin_capture((40.0, 120.0, -80.0), wobble=0.01))
    assert found["psi_pm_wb"].number == pytest.approx(4e-3, rel=2e-5)
    assert found["pole_pairs"].value == 5
    assert found["phase_order"].value == 1
    assert found["bemf_harmonic_5"].number == pytest.approx(0.03, rel=2e-3)
    assert found["bemf_harmonic_7"].number == pytest.approx(0.01, rel=5e-3)
    assert found["ke_phase_peak_v_s_rad"].number == pytest.approx(0.02, rel=2e-5)
    assert found["ke_ll_rms_v_s_rad"].number == pytest.approx(0.02 * math.sqrt(1.5), rel=2e-5)
    assert found["psi_pm_wb"].u_b == pytest.approx(4e-3 * math.hypot(0.001, 0.0011 * 0.5), rel=0.01)


def test_exchanged_leads_are_seen_as_phase_order():
    found = estimates(open_circuit.ESTIMATOR, spin_capture((40.0, 120.0), swap=True))
    assert found["phase_order"].value == -1
    assert found["psi_pm_wb"].number == pytest.approx(4e-3, rel=2e-5)


def test_two_magnet_temperatures_give_the_coefficient_at_25_degc():
    warm = spin_capture((-60.0, -120.0), psi=4e-3 * (1 - 0.002 * 40.0), temp=65.0)
    cold = spin_capture((60.0, 120.0), psi=4e-3 * (1 + 0.002 * 5.0), temp=20.0)
    found = estimates(open_circuit.ESTIMATOR, cold, warm)
    assert found["temp_coeff_magnet_1_k"].number == pytest.approx(-0.002, rel=1e-3)
    assert found["psi_pm_wb"].number == pytest.approx(4e-3, rel=5e-5)
    alone = estimates(open_circuit.ESTIMATOR, warm)
    assert alone["temp_coeff_magnet_1_k"].status == "not_identifiable"
    assert "assumed" in alone["psi_pm_wb"].note


def test_a_gear_is_no_pole_pair_count():
    geared = spin_capture((40.0, 120.0))
    table = geared.tables[0].with_columns(pl.col("theta_mech_rad") / 1.07)
    other = Capture("g", "0" * 64, "verified", geared.meta, (table,))
    found = estimates(open_circuit.ESTIMATOR, other)
    assert found["pole_pairs"].status == "not_identifiable"
    assert "gear" in found["pole_pairs"].note
    assert found["psi_pm_wb"].known
    assert not found["ke_phase_peak_v_s_rad"].known


def rows_of(run, keep):
    return Capture("cut", "0" * 64, "verified", run.meta, (run.tables[0].filter(pl.Series(keep)),))


@pytest.mark.parametrize("dropped", [0, 700])
def test_equal_travel_both_ways_without_a_row_at_standstill(dropped):
    """Reversals within one sample, or with 35 ms of rows left out: the net phase is nothing."""
    run = spin_capture((80.0, -80.0) * 3)
    keep = np.arange(36_000) % 6000 >= dropped
    found = estimates(open_circuit.ESTIMATOR, rows_of(run, keep))
    assert found["psi_pm_wb"].number == pytest.approx(4e-3, rel=5e-5)
    assert found["pole_pairs"].value == 5
    assert found["phase_order"].value == 1


def test_too_few_cycles_are_named_as_such():
    run = rows_of(spin_capture((80.0,)), np.arange(6000) < 500)
    found = estimates(open_circuit.ESTIMATOR, run)["psi_pm_wb"]
    assert found.status == "not_identifiable"
    assert "no steady stretch of 3 electrical cycles" in found.note


# Hand turn


@pytest.mark.parametrize("columns", [("vab_v",), ("vab_v", "vbc_v"), ("vab_v", "theta_mech_rad")])
def test_one_turn_by_hand(columns):
    """P = 7 counted, psi by flux alone, whatever the hand did."""
    rng = np.random.default_rng(2)
    t = np.arange(5000) * 5e-4
    u = t / t[-1]
    theta = 2.0 * math.pi * (u - np.sin(2.0 * math.pi * u) / (2.0 * math.pi)) + 0.4
    omega = np.gradient(theta, t)
    v = [-7 * 3e-3 * omega * np.sin(7 * theta - 2 * math.pi * k / 3) for k in range(3)]
    noise = 5e-4 * rng.standard_normal((2, t.size))
    data = {
        "vab_v": v[0] - v[1] + noise[0],
        "vbc_v": v[1] - v[2] + noise[1],
        "theta_mech_rad": theta,
    }
    one = capture("hand_turn", t_s=t, **{name: data[name] for name in columns})
    found = estimates(hand_turn.ESTIMATOR, one)
    assert found["pole_pairs"].value == 7
    assert found["psi_pm_wb"].number == pytest.approx(3e-3, rel=2e-3)


# Heat run


def heat_capture(drop=0.0, kind="commanded", alpha=0.0039, speed=0.0):
    t = np.arange(0.0, 200.0, 0.05)
    temp = 25.0 + 50.0 * -np.expm1(-t / 60.0)
    rng = np.random.default_rng(6)
    current = 5.0 + 1e-3 * rng.standard_normal(t.size)
    vd = 0.4 * (1 + alpha * (temp - 25.0)) * 5.0 + drop
    return capture(
        "heat_run",
        voltage_kind=kind,
        ambient_degc=25.0,
        t_s=t,
        id_a=current,
        iq_a=np.zeros(t.size),
        vd_v=vd + 2e-4 * rng.standard_normal(t.size),
        vq_v=np.zeros(t.size),
        omega_mech_rad_s=np.full(t.size, speed),
        temp_winding_degc=temp + 0.02 * rng.standard_normal(t.size),
    )


def test_an_inverters_drop_leaves_the_coefficient_alone():
    reference = Constants((known_value("r_phase_ohm", 0.4, 0.0004, "ohm", "resistance"),))
    found = estimates(heat_run.ESTIMATOR, heat_capture(drop=0.3), known=reference)
    assert found["temp_coeff_copper_1_k"].number == pytest.approx(0.0039, rel=2e-3)
    assert found["r_phase_ohm"].u > 0.04


def test_a_locked_rotor_sees_its_own_mix_of_unequal_phases():
    """Current on phase a: R = (2/3)(R_a + R_b/4 + R_c/4); the mean of 0.40 would be 4 % off."""
    run = heat_capture(alpha=0.0039, drop=0.3)
    table = run.tables[0].with_columns(pl.lit(0.0).alias("theta_elec_rad"))
    locked = Capture("locked", "0" * 64, "verified", run.meta, (table,))
    phases = {"r_a_ohm": 0.416, "r_b_ohm": 0.37, "r_c_ohm": 0.366}
    known = Constants(
        (
            known_value("r_phase_ohm", 0.384, unit="ohm"),
            *(known_value(name, r, 0.001, "ohm") for name, r in phases.items()),
        )
    )
    found = estimates(heat_run.ESTIMATOR, locked, known=known)["temp_coeff_copper_1_k"]
    assert found.number == pytest.approx(0.0039, rel=2e-3)


def test_a_measured_voltage_needs_no_other_test():
    found = estimates(heat_run.ESTIMATOR, heat_capture(kind="measured"))
    alpha = found["temp_coeff_copper_1_k"]
    assert alpha.number == pytest.approx(0.0039, rel=2e-3)
    sources = {part.source: part.u for part in alpha.budget}
    assert abs(sources.get("current@s", 0.0)) < 1e-9
    assert abs(sources.get("voltage@s", 0.0)) < 1e-9


def with_current(run, i_a):
    """The same run with its d current replaced by i_a [n], the voltage by R(T) times it."""
    warm = run.arrays("temp_winding_degc")["temp_winding_degc"] - 25.0
    volts = 0.4 * (1.0 + 0.0039 * warm) * i_a
    table = run.tables[0].with_columns(pl.Series("id_a", i_a), pl.Series("vd_v", volts))
    return Capture("set", "0" * 64, "verified", run.meta, (table,))


def test_a_current_that_is_exactly_constant_is_steady():
    run = heat_capture(kind="measured")
    held = with_current(run, np.full(4000, 5.16))
    found = estimates(heat_run.ESTIMATOR, held)["temp_coeff_copper_1_k"]
    assert found.number == pytest.approx(0.0039, rel=2e-3)
    flicker = 5.16 + 0.01 * (np.arange(4000) % 90 == 7)
    found = estimates(heat_run.ESTIMATOR, with_current(run, flicker))["temp_coeff_copper_1_k"]
    assert found.number == pytest.approx(0.0039, rel=2e-3)
    swept = with_current(run, 5.0 * np.sin(np.arange(4000) / 30.0))
    lost = estimates(heat_run.ESTIMATOR, swept)["temp_coeff_copper_1_k"]
    assert "no steady current found" in lost.note


def test_a_turning_rotor_without_its_flux_is_refused():
    found = estimates(heat_run.ESTIMATOR, heat_capture(speed=5.0))
    assert found["temp_coeff_copper_1_k"].status == "not_identifiable"
    assert "open_circuit" in found["temp_coeff_copper_1_k"].note


def test_thermal_resistance_of_one_time_constant():
    """3.3 of 60 s: 50 K over the loss at the end; R rises with the winding, so loss does too."""
    found = estimates(thermal.ESTIMATOR, heat_capture(kind="measured", alpha=0.0))
    rth = found["rth_winding_k_w"]
    assert rth.number == pytest.approx(50.0 / (1.5 * 0.4 * 25.0), rel=0.01)
    short = heat_capture(kind="measured", alpha=0.0)
    table = short.tables[0].head(600)
    brief = Capture("short", "0" * 64, "verified", short.meta, (table,))
    assert estimates(thermal.ESTIMATOR, brief)["rth_winding_k_w"].status == "not_identifiable"


# Derived


def test_derived_constants_and_cancelling_gains():
    ld = Estimate("ld_h", 2e-4, "H", "measured", "x", type_b("current@s", -4e-7))
    lq = Estimate("lq_h", 3e-4, "H", "measured", "x", type_b("current@s", -6e-7))
    psi, pairs = known_value("psi_pm_wb", 2.5908e-3, 1e-6, "Wb"), known_value("pole_pairs", 7)
    r, j = known_value("r_phase_ohm", 0.05, 0.0, "ohm"), known_value("j_rotor_kgm2", 1e-5)
    kt = known_value("kt_peak_nm_a", 0.0272, 1e-5, "N·m/A")
    known = Constants((ld, lq, psi, pairs, r, j, kt))
    found = estimates(derived_electrical.ESTIMATOR, known=known)
    assert found["saliency_ratio"].number == pytest.approx(1.5)
    assert found["saliency_ratio"].u == pytest.approx(0.0, abs=1e-15)
    assert found["kt_from_ke_nm_a"].number == pytest.approx(0.027204, rel=1e-4)
    assert found["kt_from_ke_nm_a"].u == pytest.approx(10.5e-6)
    assert found["tau_elec_s"].number == pytest.approx(0.006)
    found = estimates(derived.ESTIMATOR, known=known)
    assert found["kt_rms_nm_a"].number == pytest.approx(0.0272 * math.sqrt(2.0))
    assert found["motor_constant_nm_sqrt_w"].number == pytest.approx(0.0272 / math.sqrt(0.075))
    k = 7 * 2.5908e-3
    assert found["tau_mech_s"].number == pytest.approx(1e-5 * 0.05 / (1.5 * k * k))
    assert found["tau_mech_s"].u == pytest.approx(found["tau_mech_s"].number * 2e-6 / 2.5908e-3)


# The rig's motors with hidden effects


@pytest.mark.skipif(not RIG.is_dir(), reason="../shared/data/rig is not here")
@pytest.mark.parametrize("motor", ["P0", "P1", "P2", "P3", "P4"])
def test_hidden_effects_do_not_spoil_the_electrical_constants(motor):
    from pipeline.io.ingest import read_capture, survey

    wanted = ("resistance", "current_step", "open_circuit", "heat_run")
    folder = RIG / motor
    entries = [e for e in survey(folder, {}).entries if e.said["test"] in wanted]
    campaign = Campaign(motor, tuple(read_capture(folder, entry) for entry in entries))
    true = json.loads((folder / "truth.json").read_bytes())["constants"]
    known = Constants()
    rooms = (resistance, open_circuit, current_step, heat_run)
    for room in rooms:
        fit = room.ESTIMATOR.fit(campaign, known, room.ESTIMATOR.options)
        known = known.adding(fit.estimates)
    limits = {"r_phase_ohm": 0.003, "ld_h": 0.01, "lq_h": 0.01, "psi_pm_wb": 0.002}
    for name, limit in limits.items():
        assert known.best(name).number == pytest.approx(true[name], rel=limit), name
    assert known.best("pole_pairs").value == true["pole_pairs"]
    for name in (*limits, "temp_coeff_copper_1_k", "temp_coeff_magnet_1_k"):
        low, high = known.best(name).interval()
        assert low <= true[name] <= high, name
