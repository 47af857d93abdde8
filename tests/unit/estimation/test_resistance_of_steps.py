"""Resistance by the settled ends of current steps, where no resistance capture was made."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from pipeline.estimation.electrical.direct_current import captures_of, direct_current_points
from pipeline.estimation.estimators.resistance import ESTIMATOR
from pipeline.records.capture import Campaign, Capture
from pipeline.records.constants import Constants
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import EXACT, Bench
from tests.simulated import campaign_of, design
from tests.unit.estimation.signals import capture

STEPS = tuple(step for step in CAMPAIGN if step[1] == "current_step")
PLATEAUS = tuple(step for step in CAMPAIGN if step[1] == "resistance")


def recorded(name: str, plan: tuple, share: float) -> Campaign:
    """The first `share` of each capture of a motor at ambient temperature, by exact instruments."""
    motor = replace(design(name), effects={})
    whole = campaign_of(campaign(motor, Bench(instruments=EXACT), 1, plan))
    return replace(whole, captures=tuple(cut(c, share) for c in whole.captures))


def cut(capture: Capture, share: float) -> Capture:
    warm = pl.lit(capture.meta.ambient_degc).alias("temp_winding_degc")
    tables = tuple(t.head(int(share * t.height)).with_columns(warm) for t in capture.tables)
    return replace(capture, tables=tables)


def resistance(captures: Campaign) -> Estimate:
    solution = ESTIMATOR.fit(captures, Constants(), ESTIMATOR.options)
    return next(e for e in solution.estimates if e.name == "r_phase_ohm")


@pytest.mark.parametrize("name", ["drone-2306", "gimbal-5208", "servo-15kw"])
@pytest.mark.parametrize("share", [1.0, 0.35, 0.2])
def test_the_settled_end_of_a_step_is_a_resistance(name: str, share: float) -> None:
    """A record that ends early still has L di/dt in its voltage: that is taken off, and doubted."""
    found = resistance(recorded(name, STEPS, share))
    true = design(name).r_phase_ohm
    assert found.number == pytest.approx(true, rel=0.002)
    assert abs(found.number - true) < 3.0 * found.u
    low, high = {1.0: (0.005, 0.006), 0.35: (0.0055, 0.007), 0.2: (0.01, 0.03)}[share]
    assert low < found.u / true < high


def test_a_slow_rise_is_no_level_of_its_own() -> None:
    """Sampled 2000 times a time constant, 20 rows on the way pass for settled; a drop at the zero
    crossing was fitted between those and the end, and left R 35 % in doubt.
    """
    t_s = np.arange(20_000) * 1e-5
    v_v = np.where(t_s > 0.02, 2.0, 0.0)
    i_a = np.where(t_s > 0.02, 100.0 * (1.0 - np.exp(-(t_s - 0.02) / 0.02)), 0.0)
    noise = np.random.default_rng(1)
    columns = {
        "t_s": t_s,
        "vab_v": v_v + 3e-3 * noise.standard_normal(t_s.size),
        "ia_a": i_a + 0.3 * noise.standard_normal(t_s.size),
        "temp_winding_degc": np.full(t_s.size, 25.0),
    }
    step = capture("current_step", "step", pair="ab", **columns)
    points, _ = direct_current_points(Campaign("m", (step,)), ESTIMATOR.options)
    assert len(points) == 1
    found = resistance(Campaign("m", (step,)))
    assert found.number == pytest.approx(0.01, rel=1e-3)
    assert found.u < 0.02 * found.number


@pytest.mark.parametrize("creep", [0.0, 0.2])
def test_a_rise_within_a_sample_leaves_a_level_end_alone(creep: float) -> None:
    """Voltage and current are alike there, so that L is unknown: R came out as zero."""
    t_s = np.arange(400) * 1e-3
    v_v = np.where(t_s > 0.1, 2.0 * (1.0 + creep * (t_s - 0.1)), 0.0)
    columns = {"t_s": t_s, "vab_v": v_v, "ia_a": 10.0 * v_v}
    columns["temp_winding_degc"] = np.full(t_s.size, 25.0)
    found = resistance(Campaign("m", (capture("current_step", "step", pair="ab", **columns),)))
    if creep:
        assert found.status != "measured"
    else:
        assert found.number == pytest.approx(0.05, rel=1e-6)


def test_steps_stand_in_for_resistance_captures_alone() -> None:
    both = recorded("gimbal-5208", STEPS + PLATEAUS, 1.0)
    points, _ = direct_current_points(both, ESTIMATOR.options)
    assert {c.meta.test for c in captures_of(both, points)} == {"resistance"}


def test_steps_of_a_commanded_voltage_give_none() -> None:
    """Two tenths of a volt that the inverter drops are not at the winding, and were 11 % of R."""
    measured = recorded("gimbal-5208", STEPS, 1.0)
    commanded = replace(measured, captures=tuple(map(of_a_drive, measured.captures)))
    assert resistance(measured).status == "measured"
    assert resistance(commanded).status == "not_identifiable"


def of_a_drive(one: Capture) -> Capture:
    drop = 0.2 * (pl.col("ia_a") / 0.05).tanh()
    tables = tuple(t.with_columns(vab_v=pl.col("vab_v") + drop) for t in one.tables)
    return replace(one, tables=tables, meta=replace(one.meta, voltage_kind="commanded"))
