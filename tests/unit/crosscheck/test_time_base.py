"""A wrong time base fails, named with its files, and no wrong inertia is released."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import polars as pl
import pytest
from scipy.signal import lsim, lti

from pipeline.crosscheck.registry import check_all
from pipeline.crosscheck.rules.time_base import RULE, pace
from pipeline.estimation.registry import fit_all
from pipeline.records.capture import Campaign, Capture, CaptureMeta
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

FAST = 1.0 / 1.024
PLAN = tuple(
    step
    for step in CAMPAIGN
    if step[1] in ("resistance", "open_circuit", "torque_map", "spin_down", "drive")
)
TURNS = RULE.options["turns"]


def spin(
    factor: float, lag_s: float = 0.0, noise: float = 0.0, seed: int = 1, **meta: object
) -> Capture:
    """A coast of 2 s whose clock is wrong by a factor and whose speed lags."""
    t_s = np.arange(2000) * 1e-3
    theta, omega = 300.0 * t_s - 70.0 * t_s**2, 300.0 - 140.0 * (t_s - lag_s)
    omega += noise * np.random.default_rng(seed).standard_normal(t_s.size)
    table = {"t_s": factor * t_s, "theta_mech_rad": theta, "omega_mech_rad_s": omega}
    said = CaptureMeta("m", "spin_down", station="s", **meta)  # type: ignore[arg-type]
    return Capture("coast.csv", "0", "verified", said, (pl.DataFrame(table),))


def judged(*captures: Capture):
    return RULE.check(Constants(), Campaign("m", captures), RULE.options)


@pytest.mark.parametrize("lag_s", [0.0, 0.02])
@pytest.mark.parametrize("factor", [1.0, 1.024, FAST, 1.5])
def test_the_ratio_of_two_clocks_knows_no_lag(factor, lag_s):
    """By hand: the recorded time over the true one, however late the speed is."""
    found = pace(spin(factor, lag_s), TURNS)
    assert found.ratio == pytest.approx(factor, rel=1e-6)
    assert found.u == pytest.approx(2**0.5 * 1e-4, rel=1e-3)


@pytest.mark.parametrize("sigma", [0.03, 0.3])
def test_noise_of_the_speed_is_in_its_uncertainty(sigma):
    """Over 200 draws the error of the ratio is its u, within what chance allows."""
    found = [pace(spin(1.0, 0.0, sigma, seed, u_rel_clock=0.0), TURNS) for seed in range(200)]
    z = np.array([(one.ratio - 1.0) / one.u for one in found])
    assert 0.8 < z.std() < 1.2
    assert abs(z.mean()) < 4.0 / 200**0.5


@pytest.mark.parametrize("factor", [1.01, FAST])
def test_a_wrong_clock_fails_and_its_file_is_named(factor):
    check = judged(spin(factor))
    assert check.status == "fail"
    assert "t_s of coast.csv" in check.suspect


@pytest.mark.parametrize(("times", "named"), [(1.8, False), (2.2, True)])
def test_a_file_is_named_from_two_u_beyond_the_allowance(times, named):
    """Beside one that is off by 1 % and fails."""
    u = 2**0.5 * 1e-4
    other = spin(1.0 + RULE.options["allowance"] + times * u)
    check = judged(spin(1.01), replace(other, path="other.csv"))
    assert check.status == "fail"
    assert ("other.csv" in check.suspect) is named


def test_a_clock_within_its_stated_uncertainty_passes():
    """2.4 % off on a bench that states 2 %: no failure, and J has that in its u."""
    assert judged(spin(1.0 + 1e-4)).status == "pass"
    assert judged(spin(FAST, u_rel_clock=0.02)).status == "not_evaluated"


@pytest.mark.parametrize("factor", [1.0, 1.024])
def test_an_observer_of_second_order_under_reversals_is_no_wrong_clock(factor):
    """2.3 Hz, an observer of 40 rad/s: with its first lag alone the ratio is 13 % off."""
    t_s, swing = np.arange(6000) * 1e-3, 2.0 * np.pi * 2.3
    theta = 40.0 / swing * np.sin(swing * t_s) + 2.0 * np.sin(0.31 * swing * t_s**1.05)
    observer = lti([1600.0, 0.0], [1.0, 80.0, 1600.0])
    _, omega, _ = lsim(observer, theta, t_s)
    table = {"t_s": factor * t_s, "theta_mech_rad": theta, "omega_mech_rad_s": omega}
    made = replace(spin(1.0), tables=(pl.DataFrame(table),))
    found = pace(made, TURNS)
    assert found.ratio == pytest.approx(factor, abs=3.0 * found.u)
    assert found.u < 1e-3


def test_without_a_second_clock_nothing_is_judged():
    coast = spin(FAST)
    blind = replace(coast, tables=(coast.tables[0].drop("omega_mech_rad_s"),))
    assert judged(blind).status == "not_evaluated"
    short = replace(coast, tables=(coast.tables[0].head(30),))
    assert judged(short).status == "not_evaluated"


@cache
def sound() -> Campaign:
    return campaign_of(campaign(design("gimbal-5208"), Bench(), 3, PLAN))


@cache
def sound_constants() -> Constants:
    return fit_all(sound(), {})[0]


@pytest.mark.parametrize("speed_too", [False, True], ids=["speed right", "speed by the same clock"])
def test_an_inertia_that_is_five_percent_low_is_not_released(speed_too):
    """All turning captures 2.4 % fast: J was published 4.6 % low and no check failed."""
    whole = sound()
    factors = {"t_s": FAST, "omega_mech_rad_s": 1.0 / FAST if speed_too else 1.0}
    captures = tuple(
        c
        if c.meta.test == "resistance"
        else replace(
            c,
            tables=tuple(
                t.with_columns(pl.col(n) * f for n, f in factors.items() if n in t.columns)
                for t in c.tables
            ),
        )
        for c in whole.captures
    )
    wrong = replace(whole, captures=captures)
    constants = fit_all(wrong, {})[0]
    inertia = constants.best("j_rotor_kgm2")
    assert inertia.number == pytest.approx(FAST**2 * design("gimbal-5208").j_rotor_kgm2, rel=0.01)
    failed = {c.name: c for c in check_all(constants, wrong, {}) if c.status == "fail"}
    name = "kt_vs_ke" if speed_too else "time_base"
    assert name in failed
    assert "time base" in failed[name].suspect or "clock t_s of" in failed[name].suspect
    assert all(c.status != "fail" for c in check_all(sound_constants(), whole, {}))
