"""Resistance and its temperature coefficient on plateaus written out by hand."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.electrical.terminals import PAIRS
from pipeline.estimation.estimators import (
    resistance,
    soak,
)
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign
from tests.recovery.simulated import BENCH, recorded
from tests.unit.estimation.signals import capture, estimates, near


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


def test_no_resistance_below_nought_is_published():
    """Pairs of 1, 1 and 3 ohm make R_b (1 + 1 - 3)/2 = -0.5 ohm; a meter reads -2 mohm."""
    pairs = {"ab": 1.0, "bc": 1.0, "ca": 3.0}
    direct = (dc_capture(pair, r, seed=k) for k, (pair, r) in enumerate(pairs.items()))
    angles = np.arange(0.0, 360.0, 15.0)
    table = {"lab_h": np.full(angles.size, 4e-4), "rab_ohm": np.full(angles.size, -2e-3)}
    meter = capture("lcr", "lcr", theta_elec_deg=angles, **table)
    known = fit_all(Campaign("m", (*direct, meter)), {})[0]
    for name in ("r_b_ohm", "r_lcr_ohm"):
        (found,) = known.all_of(name)
        assert found.status == "not_identifiable", name
        assert "ohm, outside 0 to any" in found.note
    assert known.all_of("r_a_ohm")[0].number == pytest.approx(1.5, rel=1e-3)


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


def test_a_thermometer_that_stops_early_is_held():
    """Read at 70 degC until the last plateau begins; ambient is 20 degC, and never meant."""
    whole = dc_capture("ab", 1.2, temp=70.0)
    temps = whole.tables[0]["temp_winding_degc"].to_numpy().copy()
    temps[-220:] = np.nan
    table = whole.tables[0].with_columns(temp_winding_degc=temps)
    short = replace(whole, tables=(table,), meta=replace(whole.meta, ambient_degc=20.0))
    for name in ("r_ab_ohm", "r_phase_ohm"):
        one, other = (estimates(resistance.ESTIMATOR, c)[name] for c in (short, whole))
        assert one.number == pytest.approx(other.number, rel=1e-9)


def test_one_level_leaves_the_drop_as_an_allowance():
    found = estimates(resistance.ESTIMATOR, dc_capture("ab", 1.0, levels=(2.0, -2.0)))
    assert found["voltage_offset_v"].status == "not_identifiable"
    parts = {part.source: part for part in found["r_ab_ohm"].budget}
    assert parts["assumed:voltage_offset_v"].u == pytest.approx(0.0005 / 2.0, rel=1e-3)
    assert parts["assumed:voltage_offset_v"].kind == "B"


def test_an_inverters_drop_that_is_not_told_adds_up_over_the_pairs():
    """One inverter, 0.3 V at 2 A on every pair: 0.15 ohm on each, 0.075 ohm on each phase."""
    one_level = {"levels": (2.0, -2.0)}
    captures = [dc_capture(pair, 1.0, seed=k, **one_level) for k, pair in enumerate(PAIRS)]
    commanded = [replace(c, meta=replace(c.meta, voltage_kind="commanded")) for c in captures]
    found = estimates(resistance.ESTIMATOR, *commanded)
    expected = {"r_ll_ohm": 0.15, "r_phase_ohm": 0.075} | {f"r_{p}_ohm": 0.075 for p in "abc"}
    for name, u in expected.items():
        parts = {part.source: part.u for part in found[name].budget}
        assert parts["assumed:voltage_offset_v"] == pytest.approx(u, rel=1e-2)
    moved = [dc_capture(pair, 1.0, seed=k, v0=0.3, **one_level) for k, pair in enumerate(PAIRS)]
    read = estimates(resistance.ESTIMATOR, *moved)
    for name, u in expected.items():
        assert read[name].number - found[name].number == pytest.approx(u, rel=1e-2)


@pytest.mark.parametrize(("contact_v", "dof"), [(0.0, math.inf), (0.01, 9.0)])
def test_scatter_between_plateaus_has_the_plateaus_freedom(contact_v, dof):
    """Twelve plateaus less R, offset and V0, where contacts make them differ; else their rows'."""
    levels = (1.0, -1.0, 1.5, -1.5, 2.0, -2.0) * 2
    whole = dc_capture("ab", 1.0, levels=levels)
    jitter = contact_v * np.random.default_rng(1).standard_normal(len(levels) + 1)
    table = whole.tables[0].with_columns(pl.col("vab_v") + np.repeat(jitter, 200))
    found = estimates(resistance.ESTIMATOR, replace(whole, tables=(table,)))["r_ab_ohm"]
    assert next(p.dof for p in found.budget if p.source == "scatter:resistance:r_ab_ohm") == dof


@pytest.mark.parametrize("temperature_hz", [None, 10.0])
def test_a_noisy_thermometer_makes_no_imbalance(temperature_hz):
    """Nine motors of equal phases, 0.1 K of noise: their imbalance is of the size of its u."""
    quiet = {"voltage_noise_rel": 1e-5, "current_noise_rel": 1e-5, "temperature_noise_degc": 0.1}
    bench = replace(BENCH, **quiet, temperature_hz=temperature_hz)
    plan = [(f"r_{pair}", "resistance", {"pair": pair}) for pair in PAIRS]
    found = []
    for seed in range(9):
        campaign = recorded(plan, seed, bench=bench)[0]
        found.append(estimates(resistance.ESTIMATOR, *campaign.captures)["resistance_imbalance"])
    mean_square = np.mean([(e.number / e.u) ** 2 for e in found])
    assert 0.3 < mean_square < 2.0


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
