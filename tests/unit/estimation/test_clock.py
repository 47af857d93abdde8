"""The time base of a station is in the budget of all that goes by time, as it really enters."""

from __future__ import annotations

import math
from dataclasses import replace

import polars as pl
import pytest

from pipeline.crosscheck.judge import ratio_of
from pipeline.estimation.registry import estimators, fit_all
from pipeline.estimation.uncertainty.instruments import clock_source, with_clock
from pipeline.records.capture import UNSTATED_U, Campaign, Capture
from pipeline.records.estimate import Estimate
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design

FAST = 1.02
U_CLOCK = 0.01
SOURCE = "clock@sim-1"


def on_clock(capture: Capture, factor: float) -> Capture:
    """The capture as a time base wrong by a factor tells it, the bench's speed with it."""
    factors = {"t_s": factor, "omega_mech_rad_s": 1.0 / factor}
    tables = (
        table.with_columns(pl.col(n) * f for n, f in factors.items() if n in table.columns)
        for table in capture.tables
    )
    meta = replace(capture.meta, u_rel_clock=U_CLOCK)
    return replace(capture, tables=tuple(tables), meta=meta)


def fitted(whole: Campaign, factor: float) -> dict[tuple[str, str], Estimate]:
    captures = tuple(on_clock(c, factor) for c in whole.captures)
    constants = fit_all(replace(whole, captures=captures), {})[0]
    return {(e.name, e.method): e for e in constants.estimates if e.known}


AGAIN = {"current_step_d_1", "current_step_q_1", "drive_1_warm"}
"""Captures that give no constant which the others do not."""

ROUGH = {"pole_pairs_by_voltage"}
"""Constants that scatter by a per cent, and need be known to ten."""


@pytest.fixture(scope="module")
def whole() -> Campaign:
    plan = tuple(step for step in CAMPAIGN if step[0] not in AGAIN)
    return campaign_of(campaign(design("gimbal-5208"), Bench(), 3, plan))


@pytest.fixture(scope="module")
def both(whole: Campaign) -> tuple[dict, dict]:
    return fitted(whole, 1.0), fitted(whole, FAST)


def test_the_budget_says_what_a_wrong_clock_does(both):
    """Every constant of every estimator moves by what its contribution of the clock foretells,
    those that rest on others with what these move by, and those without one not at all.
    """
    right, wrong = both
    assert set(right) == set(wrong)
    timed = set()
    for key, estimate in right.items():
        part = sum(p.u for p in estimate.budget if p.source == SOURCE) / U_CLOCK
        ratio = wrong[key].number / estimate.number
        moved = estimate.number * math.log(ratio) / math.log(FAST)
        # windows of another number of samples move a constant a little too
        slack = (0.1 if key[0] in ROUGH else 0.02) * abs(estimate.number)
        assert moved == pytest.approx(part, abs=slack), key
        if part:
            timed.add(key[0])
    least = {"j_rotor_kgm2", "psi_pm_wb", "ld_h", "lq_h", "lq_rated_h", "b_visc_nm_s_rad"}
    least |= {"tau_elec_s", "kv_ll_peak_rpm_v", "kt_from_ke_nm_a", "coast_viscous_1_s"}
    assert least <= timed
    assert not timed & {"r_phase_ohm", "kt_peak_nm_a", "torque_coulomb_nm", "cogging_peak_nm"}


def test_what_two_constants_share_of_a_clock_cancels(both):
    """J over psi squared, as the mechanical time constant has it, knows no clock."""
    found, _ = both
    tau = found["tau_mech_s", "derived"]
    assert abs(sum(p.u for p in tau.budget if p.source == SOURCE)) < 1e-3 * U_CLOCK * tau.number
    u = ratio_of(found["ld_h", "current_step"], found["lq_h", "current_step"]).u
    assert u < 0.5 * U_CLOCK


def test_a_clock_that_states_nothing_counts_for_a_crystal(whole):
    bare = tuple(replace(c, meta=replace(c.meta, u_rel_clock=None)) for c in whole.captures)
    one = Estimate("j_rotor_kgm2", 2.0, "kg·m²", "measured", "x", captures=(bare[0].path,))
    (part,) = with_clock(one, 2, bare[:1]).budget
    assert part.source == clock_source(bare[0].meta)
    assert part.u == pytest.approx(4.0 * UNSTATED_U["u_rel_clock"])
    assert (
        with_clock(one, 2, (replace(bare[0], meta=replace(bare[0].meta, u_rel_clock=0.0)),)).budget
        == ()
    )


def test_powers_are_declared_of_constants_that_are_given():
    for estimator in estimators():
        assert set(estimator.clock_powers) <= set(estimator.gives)
        assert all(estimator.clock_powers.values())
