"""Flux, harmonics and pole pairs from back-EMF written out in closed form."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest
from scipy import signal

from pipeline.estimation.electrical.voltage_filter import left_by_filter
from pipeline.estimation.estimators import (
    hand_turn,
    open_circuit,
)
from pipeline.numerics.integrals import trapezoid
from pipeline.records.capture import Capture
from tests.unit.estimation.signals import capture, estimates

# Open circuit


SPEEDS = ((60.0, 120.0), (-60.0, -120.0), (50.0, 100.0))


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


@pytest.mark.parametrize("pairs", [1, 2, 5])
@pytest.mark.parametrize("sense", [1, -1])
def test_flux_of_a_rotor_that_is_turned_by_hand(pairs, sense):
    """Its speed changes within a cycle: the voltage's own phase lost 6 % of the flux."""
    t_s = np.arange(0.0, 5.0, 5e-4)
    wave = 0.3 * np.sin(10.7 * t_s) + 0.15 * np.sin(19.5 * t_s + 1.0)
    omega = sense * 15.0 * np.clip(t_s, 0.0, 1.0) * (1.0 + wave)
    theta = trapezoid(t_s, omega)
    e = [pairs * theta - 2.0 * math.pi * k / 3.0 for k in range(3)]
    v = [-pairs * omega * 0.05 * (np.sin(x) + 0.02 * np.sin(5.0 * x)) for x in e]
    noise = 2e-3 * np.random.default_rng(pairs).standard_normal((2, t_s.size))
    step = 2.0 * math.pi / 4096
    found = estimates(
        open_circuit.ESTIMATOR,
        capture(
            "open_circuit",
            "by hand",
            t_s=t_s,
            vab_v=v[0] - v[1] + noise[0],
            vbc_v=v[1] - v[2] + noise[1],
            theta_mech_rad=np.round(theta / step) * step,
            temp_magnet_degc=np.full(t_s.size, 25.0),
        ),
    )
    psi = found["psi_pm_wb"]
    assert abs(psi.number - 0.05) < 3.0 * psi.u
    assert psi.u < 0.003 * 0.05
    assert found["pole_pairs"].value == pairs
    assert found["bemf_harmonic_5"].number == pytest.approx(0.02, rel=0.05)


def filtered(whole: Capture, tau_s: float) -> Capture:
    """The same spin behind a filter of first order, by its exact answer from sample to sample."""
    table = whole.tables[0]
    times = table["t_s"].to_numpy()
    passed = {}
    for name in ("vab_v", "vbc_v"):
        volts = table[name].to_numpy()
        states = signal.StateSpace([[-1.0 / tau_s]], [[1.0 / tau_s]], [[1.0]], [[0.0]])
        passed[name] = signal.lsim(states, volts, times)[1]
    return replace(whole, tables=(table.with_columns(**passed),))


@pytest.mark.parametrize("tau_s", [3e-5, 1.5e-4])
def test_flux_is_that_of_a_standstill_where_a_filter_takes_some_of_the_voltage(tau_s):
    """The mean of three speeds was 4 % low behind a filter of 1 kHz, at a fraction of its u."""
    spin = filtered(spin_capture((60.0, 180.0, 300.0)), tau_s)
    found = estimates(open_circuit.ESTIMATOR, spin)["psi_pm_wb"]
    assert found.number == pytest.approx(4e-3, rel=3e-4)
    assert "as behind a filter" in found.note
    assert found.u < 3e-3 * found.number


def test_a_filter_of_first_order_leaves_half_the_power_at_its_corner():
    left = left_by_filter(np.array([0.0, 1e3, -2e3]), 1e-6)
    assert left == pytest.approx([1.0, 0.5**0.5, 0.2**0.5])


def test_two_speeds_that_disagree_beyond_chance_are_no_better_known_than_they_agree():
    spin = filtered(spin_capture((60.0, 300.0)), 1.5e-4)
    found = estimates(open_circuit.ESTIMATOR, spin)["psi_pm_wb"]
    assert abs(found.number - 4e-3) < 3.0 * found.u
    assert "filter" not in found.note


def test_one_channel_of_a_scope_gives_flux_and_harmonics_but_no_phase_order():
    """One line voltage and no motion at all: flux and harmonics; with a speed pole pairs too."""
    whole = spin_capture((60.0, 120.0))
    table = whole.tables[0]
    alone = replace(whole, tables=(table.select("t_s", "vab_v", "temp_magnet_degc"),))
    found = estimates(open_circuit.ESTIMATOR, alone)
    assert found["psi_pm_wb"].number == pytest.approx(4e-3, rel=2e-4)
    assert found["bemf_harmonic_5"].number == pytest.approx(0.03, rel=5e-3)
    assert found["bemf_harmonic_7"].number == pytest.approx(0.01, rel=1e-2)
    assert found["pole_pairs"].value is None
    speed = np.gradient(table["theta_mech_rad"].to_numpy(), table["t_s"].to_numpy())
    turning = alone.tables[0].with_columns(omega_mech_rad_s=speed)
    found = estimates(open_circuit.ESTIMATOR, replace(whole, tables=(turning,)))
    assert found["pole_pairs"].value == 5
    assert found["ke_phase_peak_v_s_rad"].number == pytest.approx(0.02, rel=2e-4)
    assert found["phase_order"].value is None
    assert "two line voltages" in found["phase_order"].note


@pytest.mark.parametrize("column", ["theta_mech_rad", "omega_mech_rad_s"])
def test_one_channel_of_both_senses_has_one_phase_a_harmonic(column):
    """A seventh a quarter of its turn off, forward and backward: their mean was nothing."""
    made = []
    for speed in (100.0, -100.0):
        t_s = np.arange(20_000) / 2e4
        theta = speed * t_s
        phases = [5.0 * theta - 2.0 * math.pi * k / 3.0 for k in (0, 1)]
        v = [-0.02 * speed * (np.sin(e) + 0.05 * np.sin(7.0 * e + 1.5)) for e in phases]
        shaft = {"theta_mech_rad": theta, "omega_mech_rad_s": np.full(t_s.size, speed)}
        noise = 2e-3 * np.random.default_rng(1).standard_normal(t_s.size)
        columns = {"vab_v": v[0] - v[1] + noise, column: shaft[column]}
        made.append(capture("open_circuit", f"spin_{speed}", t_s=t_s, **columns))
    seventh = estimates(open_circuit.ESTIMATOR, *made)["bemf_harmonic_7"]
    assert seventh.number == pytest.approx(0.05, rel=1e-2)


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


def test_a_magnet_temperature_that_stops_early_is_held():
    """Read at 65 degC at the first speed alone; at the second it is not taken at ambient."""
    whole = spin_capture((60.0, 120.0), temp=65.0)
    temps = whole.tables[0]["temp_magnet_degc"].to_numpy().copy()
    temps[5000:] = np.nan
    table = whole.tables[0].with_columns(temp_magnet_degc=temps)
    short = replace(whole, tables=(table,), meta=replace(whole.meta, ambient_degc=20.0))
    one, other = (estimates(open_circuit.ESTIMATOR, c)["psi_pm_wb"] for c in (short, whole))
    assert one.number == pytest.approx(other.number, rel=1e-9)


@pytest.mark.parametrize("apart", [0.0, 1e-3])
def test_speeds_that_disagree_have_the_freedom_of_their_number(apart):
    """Two speeds a capture, whose fluxes differ beyond their noise or do not."""
    captures = [spin_capture(s, psi=4e-3 * (1 + k * apart), seed=7) for k, s in enumerate(SPEEDS)]
    psi = estimates(open_circuit.ESTIMATOR, *captures)["psi_pm_wb"]
    dof = next(p.dof for p in psi.budget if p.source == "scatter:open_circuit:psi")
    assert dof == (2 * len(SPEEDS) - 1 if apart else math.inf)


@pytest.mark.parametrize("apart", [0.0, 0.01])
def test_a_harmonic_that_differs_between_speeds_has_the_freedom_of_their_number(apart):
    """Six speeds of two components each, one mean: ten; the noise of each speed alone is known."""
    captures = [spin_capture(s, h5=0.03 + k * apart, seed=7) for k, s in enumerate(SPEEDS)]
    fifth = estimates(open_circuit.ESTIMATOR, *captures)["bemf_harmonic_5"]
    assert [part.dof for part in fifth.budget] == [2 * 6 - 2 if apart else math.inf]


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


def reversing(speed_rad_s, columns):
    """A spin of any course of speed [n] at 20 kHz, p = 5, psi = 4 mWb, with the shaft's columns."""
    rng = np.random.default_rng(3)
    theta = np.concatenate([[0.0], np.cumsum(0.5 * (speed_rad_s[1:] + speed_rad_s[:-1]) / 2e4)])
    v = [-0.02 * speed_rad_s * np.sin(5.0 * theta - 2.0 * math.pi * k / 3.0) for k in range(3)]
    noise = 2e-3 * rng.standard_normal((2, theta.size))
    shaft = {"theta_mech_rad": theta, "omega_mech_rad_s": speed_rad_s}
    return capture(
        "open_circuit",
        t_s=np.arange(theta.size) / 2e4,
        vab_v=v[0] - v[1] + noise[0],
        vbc_v=v[1] - v[2] + noise[1],
        temp_magnet_degc=np.full(theta.size, 25.0),
        **{name: shaft[name] for name in columns},
    )


@pytest.mark.parametrize("columns", [("theta_mech_rad",), ("omega_mech_rad_s",)])
@pytest.mark.parametrize("course", ["sine", "trapezoid", "there and back"])
@pytest.mark.parametrize("missing", ["none", "slow rows", "some rows", "stretches"])
def test_a_reversing_spin_with_rows_missing(course, missing, columns):
    """Whatever rows are missing around the reversals: p, phase order, and psi within its U."""
    t = np.arange(40_000) / 2e4
    speed = {
        "sine": 80.0 * np.sin(2.0 * math.pi * t),
        "trapezoid": np.clip(160.0 * np.sin(2.0 * math.pi * t), -80.0, 80.0),
        "there and back": np.where(t < 1.0, 100.0 * (1.0 - t), -100.0 * (t - 1.0)),
    }[course]
    rng = np.random.default_rng(1)
    keep = {
        "none": np.ones(t.size, dtype=bool),
        "slow rows": np.abs(speed) > 20.0,
        "some rows": rng.random(t.size) > 0.05,
        "stretches": ~np.isin(np.arange(t.size) // 200, rng.choice(200, 20, replace=False)),
    }[missing]
    found = estimates(open_circuit.ESTIMATOR, rows_of(reversing(speed, columns), keep))
    psi = found["psi_pm_wb"]
    assert abs(psi.number - 4e-3) < 2.0 * psi.u
    assert psi.u < 5e-3 * psi.number
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


def test_what_an_instrument_reads_high_moves_psi_as_its_budget_says():
    """Sign and size: voltages high by u read psi high, a warm-reading thermometer too where
    alpha is negative; both as contributions of their own.
    """
    alpha = -0.002
    cold = spin_capture((60.0, 120.0), psi=4e-3 * (1.0 - 5.0 * alpha), temp=20.0)
    warm = spin_capture((-60.0, -120.0), psi=4e-3 * (1.0 + 40.0 * alpha), temp=65.0)
    found = estimates(open_circuit.ESTIMATOR, cold, warm)["psi_pm_wb"]
    said = {part.source: part.u for part in found.budget}
    moved = {
        "voltage@s": [pl.col("vab_v", "vbc_v") * 1.001],
        "temperature@s": [pl.col("temp_magnet_degc") + 0.5],
    }
    for source, changed in moved.items():
        runs = [replace(c, tables=(c.tables[0].with_columns(changed),)) for c in (cold, warm)]
        high = estimates(open_circuit.ESTIMATOR, *runs)["psi_pm_wb"]
        assert said[source] == pytest.approx(high.number - found.number, rel=5e-3)


def test_a_harmonics_uncertainty_is_its_scatter():
    """Over 16 seeds of two speeds whose noise differs fivefold, about the harmonic put in."""
    found = [
        estimates(open_circuit.ESTIMATOR, spin_capture((24.0, 120.0), seed=seed))
        for seed in range(16)
    ]
    fifth = np.array([one["bemf_harmonic_5"].number for one in found])
    u = float(np.mean([one["bemf_harmonic_5"].u for one in found]))
    assert 0.55 < fifth.std(ddof=1) / u < 1.6
    assert abs(fifth.mean() - 0.03) < 4.0 * u / math.sqrt(16)
