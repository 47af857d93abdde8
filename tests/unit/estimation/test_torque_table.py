"""Kt from a static table of torque and current."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from pipeline.estimation.estimators.torque_table import ESTIMATOR, torque
from pipeline.estimation.registry import fit_all
from pipeline.records.constants import Constants
from pipeline.simulator.design import EXACT
from tests.recovery.simulated import BENCH, MOTOR, recorded

KT_NM_A = 1.5 * MOTOR.pole_pairs * MOTOR.psi_pm_wb
TABLE = ("torque_table", "torque_table", {})


def found(seed: int = 1, motor=MOTOR, bench=BENCH, **protocol):
    plan = (("torque_table", "torque_table", protocol),)
    campaign, gains = recorded(plan, seed, motor, bench)
    return fit_all(campaign, {})[0].chosen()["kt_peak_nm_a"], gains


def test_intervals_hold_the_truth_over_benches_with_gains_of_their_own():
    """Clamp and transducer are drawn per seed; friction holds torque back; harmonics ripple.

    Neither too narrow nor too wide: 60 errors over their u are chi square, to one in a thousand.
    """
    motor = MOTOR.having(bemf_harmonics=0.01)
    kts = [found(seed, motor)[0] for seed in range(60)]
    assert sum(kt.interval()[0] < KT_NM_A < kt.interval()[1] for kt in kts) >= 54
    errors = np.array([(kt.number - KT_NM_A) / kt.u for kt in kts])
    assert chi2.isf(0.999, 60) < np.sum(errors**2) < chi2.isf(0.001, 60)


def test_the_ripple_of_many_angles_is_no_scatter():
    """Harmonics of 1 % at seven angles: as noise they made u_a more than twice what gains make."""
    kt, _ = found(motor=MOTOR.having(bemf_harmonics=0.01))
    assert kt.u_a < 0.2 * kt.u_b


def test_gains_are_in_the_budget_with_their_signs():
    """Torque over current: one gain up, the other down, by the relative uncertainties stated."""
    kt, _ = found()
    parts = {part.source.partition("@")[0]: part.u / kt.number for part in kt.budget}
    assert parts["torque"] == pytest.approx(BENCH.u_rel_torque, rel=0.02)
    assert parts["current"] == pytest.approx(-BENCH.u_rel_current, rel=0.02)


def test_a_slope_that_sags_is_told_and_the_slope_at_small_current_is_given():
    exact = replace(BENCH, instruments=EXACT, torque_noise_rel=1e-5)
    straight, _ = found(bench=exact)
    assert "sags" not in straight.note
    assert straight.number == pytest.approx(KT_NM_A, rel=2e-3)
    iq = np.linspace(-12.0, 12.0, 25)
    base, candidates = torque(iq, np.zeros(25), np.ones(25))
    bent = base @ [0.01, KT_NM_A] - 2e-6 * candidates["iq^3"]
    capture, _ = recorded((TABLE,), 1, bench=exact)
    import polars as pl

    table = pl.DataFrame({"iq_a": iq, "torque_shaft_nm": bent, "theta_mech_rad": iq * 0.0})
    campaign = replace(capture, captures=(replace(capture.captures[0], tables=(table,)),))
    sags = fit_all(campaign, {})[0].chosen()["kt_peak_nm_a"]
    assert "sags with current" in sags.note
    assert sags.number == pytest.approx(KT_NM_A, rel=1e-9)


def test_one_angle_counts_for_its_ripple_and_many_do_not():
    """h5 and h7 of 3 % each and one angle: (0.06)/√2 of Kt, unless angles cancel it."""
    many, _ = found(angles=7)
    one, _ = found(angles=1)
    blind, _ = found(angles=7, with_angle=False)
    share = {name: e.u / e.number for name, e in zip("mob", (many, one, blind), strict=True)}
    ripple = np.hypot(0.06, 0.02) / np.sqrt(2.0)
    assert share["m"] < 0.1 * ripple
    for name in "ob":
        assert share[name] == pytest.approx(ripple, rel=0.05)


def test_too_few_currents_name_the_test_to_record():
    plan = (("torque_table", "torque_table", {"levels": (-1.0, 1.0)}),)
    campaign, _ = recorded(plan, 1)
    (kt,) = ESTIMATOR.fit(campaign, Constants(), ESTIMATOR.options).estimates
    assert not kt.known
    assert ESTIMATOR.experiment in kt.note
