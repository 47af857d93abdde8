"""Magnet flux and inductances from tables of flux linkage and of steady voltage."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import polars as pl
import pytest
from scipy.stats import chi2

from pipeline.estimation.estimators.flux_map import ESTIMATOR
from pipeline.estimation.policy import DEFAULT
from pipeline.estimation.registry import fit_all
from pipeline.io.ingest.capture_reader import read_capture, survey
from pipeline.io.maps.map_file import load_source_maps
from pipeline.records.capture import UNSTATED_U, Campaign
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.settings import configuration_folder
from pipeline.simulator.catalogue import with_effects
from pipeline.simulator.design import EXACT
from tests.recovery.simulated import BENCH, MOTOR, recorded

TRUE = {"psi_pm_wb": MOTOR.psi_pm_wb, "ld_h": MOTOR.ld_h, "lq_h": MOTOR.lq_h}
MOTEUS = Path(__file__).parents[4] / "shared" / "data" / "real" / "moteus"


def found(seed: int = 1, motor=MOTOR, bench=BENCH, **how) -> dict[str, Estimate]:
    campaign, _ = recorded((("flux_map", "flux_map", how),), seed, motor, bench)
    return by_name(campaign)


def by_name(campaign: Campaign) -> dict[str, Estimate]:
    fit = ESTIMATOR.fit(campaign, Constants(), ESTIMATOR.options)
    return {one.name: one for one in fit.estimates}


def swept(seed: int = 1, noise_v: float = 2e-3, **changes: float) -> Campaign:
    """v_q = v_0(i_d) + p ω (ψ + L_d i_d + a i_d²), by its formula, at eight speeds a level."""
    rng = np.random.default_rng(seed)
    level = np.linspace(-12.0, 12.0, 9)
    id_a, omega = (one.ravel() for one in np.meshgrid(level, np.linspace(20.0, 160.0, 8)))
    flux = MOTOR.psi_pm_wb + MOTOR.ld_h * id_a + changes.get("bend", 0.0) * id_a**2
    drop = 0.05 * np.sign(id_a) + changes.get("r", 0.01) * id_a
    volts = drop + MOTOR.pole_pairs * omega * flux + noise_v * rng.standard_normal(id_a.size)
    table = pl.DataFrame({"id_a": id_a, "omega_mech_rad_s": omega, "vq_v": volts})
    campaign, _ = recorded((("flux_map", "flux_map", {}),), 1)
    first = campaign.captures[0]
    meta = replace(first.meta, pole_pairs=MOTOR.pole_pairs)
    return replace(campaign, captures=(replace(first, meta=meta, tables=(table,)),))


@cache
def sixty() -> tuple[dict[str, Estimate], ...]:
    """What is found on sixty benches; every constant of them is asked for."""
    return tuple(found(seed) for seed in range(60))


@pytest.mark.parametrize("name", sorted(TRUE))
def test_intervals_hold_the_truth_over_benches_with_gains_of_their_own(name: str) -> None:
    """None too narrow: the squares of 60 errors over their u, to one in 1,000 of chi square."""
    each = [one[name] for one in sixty()]
    assert sum(one.interval()[0] < TRUE[name] < one.interval()[1] for one in each) >= 54
    errors = np.array([(one.number - TRUE[name]) / one.u for one in each])
    assert np.sum(errors**2) < chi2.isf(0.001, 60)


def test_iron_that_saturates_moves_nothing_at_zero_current():
    """Apparent inductance falls by a third at rated current; that at zero is what is given."""
    motor = with_effects(MOTOR, "[saturation.size=0.3, saturation.size_d=0.1]")
    exact = replace(BENCH, instruments=EXACT, flux_noise_rel=1e-5)
    levels = tuple(np.linspace(-1.0, 1.0, 15))
    one = found(motor=motor, bench=exact, id_levels=levels, iq_levels=levels)
    for name, true in TRUE.items():
        assert one[name].number == pytest.approx(true, rel=0.01), name
    assert float(one["lq_h"].note.split("within ")[1].split(" A")[0]) < MOTOR.current_rated_a


def test_gains_are_in_the_budget_with_their_signs():
    """A flux linkage goes with the voltage; an inductance with voltage over current."""
    one = found()
    for name, powers in {"psi_pm_wb": (1, 0), "ld_h": (1, -1), "lq_h": (1, -1)}.items():
        of = {p.source.partition("@")[0]: p.u / one[name].number for p in one[name].budget}
        assert of.get("voltage", 0.0) == pytest.approx(powers[0] * BENCH.u_rel_voltage, rel=0.02)
        assert of.get("current", 0.0) == pytest.approx(
            powers[1] * BENCH.u_rel_current, rel=0.05, abs=1e-4 * BENCH.u_rel_current
        )


def test_a_thermometer_of_the_magnets_is_read():
    """The same linkages of magnets at 75 °C are those of stronger ones at 25 °C."""
    campaign, _ = recorded((("flux_map", "flux_map", {}),), 1)
    first = campaign.captures[0]
    tables = [first.tables[0].with_columns(temp_magnet_degc=pl.lit(t)) for t in (25.0, 75.0)]
    cold, warm = (
        by_name(replace(campaign, captures=(replace(first, tables=(table,)),)))["psi_pm_wb"]
        for table in tables
    )
    lost = 50.0 * DEFAULT.magnet.coefficient_1_k
    assert warm.number * (1.0 + lost) == pytest.approx(cold.number, rel=1e-9)
    assert "not logged" not in warm.note
    assert {p.source for p in warm.budget} > {"assumed:temp_coeff_magnet_1_k"}


def test_drops_of_a_level_are_no_flux():
    """Resistance and inverter drop the same at every speed: R of 0.01 or of 10 ohm."""
    one, other = (by_name(swept(r=r)) for r in (0.01, 10.0))
    for name in ("psi_pm_wb", "ld_h"):
        assert one[name].number == pytest.approx(TRUE[name], abs=3.0 * one[name].u)
        assert other[name].number == pytest.approx(one[name].number, rel=1e-9)
    assert not one["lq_h"].known
    assert "flux linkages of both axes" in one["lq_h"].note


def test_a_narrower_range_is_taken_where_the_flux_bends():
    """The fifth power of i_d that the terms lack reaches 0.37 of L_d i_d at the ends."""
    straight = by_name(swept(noise_v=1e-5))["ld_h"]
    campaign = swept(noise_v=1e-5)
    table = campaign.captures[0].tables[0]
    bent = pl.col("vq_v") + pl.col("omega_mech_rad_s") * pl.col("id_a") ** 5 * 5e-9
    capture = replace(campaign.captures[0], tables=(table.with_columns(bent.alias("vq_v")),))
    one = by_name(replace(campaign, captures=(capture,)))["ld_h"]
    assert "within 12 A" in straight.note
    assert "within 12 A" not in one.note


def test_rows_of_one_current_alone_say_nothing():
    """A map measured twice: two equal rows have no scatter, and no terms can be told apart."""
    campaign, _ = recorded((("flux_map", "flux_map", {}),), 1)
    first = campaign.captures[0]
    again = replace(campaign, captures=(first, replace(first, path="again", sha256="f" * 64)))
    for name, one in by_name(again).items():
        assert one.number == pytest.approx(TRUE[name], abs=3.0 * one.u), name


def test_a_fast_clock_raises_the_speed():
    """Flux is voltage over speed; a table of flux linkages shows no clock."""
    sweep, table = by_name(swept())["psi_pm_wb"], found()["psi_pm_wb"]
    of = {p.source.partition("@")[0]: p.u / sweep.number for p in sweep.budget}
    assert abs(of["clock"]) == pytest.approx(UNSTATED_U["u_rel_clock"], rel=0.01)
    assert not any(p.source.startswith("clock") for p in table.budget)


@pytest.mark.parametrize("sense", [-1.0, 1.0])
def test_nothing_is_read_beyond_the_ends_of_a_table(sense: float) -> None:
    """All d currents far from zero: what lies at zero is not in the table."""
    levels = tuple(sense * np.array([1.0, 0.9, 0.8, 0.7, 0.6, 0.5]))
    one = found(id_levels=levels, iq_levels=(-1.0, -0.5, 0.0, 0.5))
    assert not one["ld_h"].known
    assert not one["psi_pm_wb"].known


@pytest.mark.skipif(not MOTEUS.is_dir(), reason="../shared/data/real/moteus is not here")
@pytest.mark.parametrize("motor", ["be8108", "flipsky6374", "mj5208"])
def test_what_the_maker_of_a_real_drive_fits_lies_in_the_interval(motor: str) -> None:
    """Moteus' own fit of its sweeps: λ and B of ψ_d = λ + (B + C i_d) i_d."""
    maps = load_source_maps(configuration_folder() / "source")
    entries = [e for e in survey(MOTEUS, maps).entries if motor in e.path]
    captures = tuple(read_capture(MOTEUS, entry) for entry in entries)
    known = fit_all(Campaign(captures[0].meta.motor_id, captures), {})[0]
    maker = json.loads((MOTEUS / f"ld_{motor}.json").read_bytes())["fit"]
    psi, ld = known.best("psi_pm_wb"), known.best("ld_h")
    assert psi is not None
    assert psi.interval()[0] <= maker["lambda_m"] <= psi.interval()[1]
    # flipsky6374's inductance, 8 µH, is not larger than what its voltages scatter
    assert (ld is None) == (motor == "flipsky6374")
    assert ld is None or ld.interval()[0] <= maker["B"] <= ld.interval()[1]
