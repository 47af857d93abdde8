"""Offsets of shunts, the zero of an encoder and its lateness, as every drive has, are no names."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.residuals.residual import residual
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.refit import begin_from, refitted
from pipeline.criticism.selection.score_test import score_all
from pipeline.criticism.selection.starts import with_nuisances
from pipeline.criticism.selection.stepwise import search
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.bench import CAMPAIGN, campaign
from pipeline.simulator.design import Bench
from tests.simulated import campaign_of, design
from tests.unit.criticism.machines import BASE, fitted, log, machine

ALPHA_A, BETA_A, ZERO_RAD, LATE_S = 0.006, -0.009, 0.0012, 3e-6


def recorded(noise, times=1.0, seed=5):
    """The log as a drive records it whose shunts and encoder are `times` as far off as usual."""
    segment = log(seed=seed, noise=noise)
    found = dict(segment.recorded)
    ahead = times * (ZERO_RAD - LATE_S * np.gradient(7 * found["theta_mech_rad"], segment.ts_s))
    turned = 7 * found["theta_mech_rad"] + ahead
    away = np.exp(-1j * ahead)
    offset = times * (ALPHA_A + 1j * BETA_A) * np.exp(-1j * turned)
    current = (found["id_a"] + 1j * found["iq_a"]) * away + offset
    volts = (found["vd_v"] + 1j * found["vq_v"]) * away
    found |= {"id_a": current.real, "iq_a": current.imag, "vd_v": volts.real, "vq_v": volts.imag}
    found["theta_mech_rad"] = turned / 7
    return replace(segment, recorded=found)


def test_the_state_of_the_instruments_undoes_what_it_does():
    state = {"zero_alpha_a": ALPHA_A, "zero_beta_a": BETA_A}
    values = {**BASE, **state, "zero_angle_rad": ZERO_RAD, "late_angle_s": LATE_S}
    plain = Model(machine(), ())
    clean = residual(log(), plain, BASE)
    # speeds at either end are means of fewer neighbours
    undone = residual(recorded(0.0), plain, values)
    assert undone[:, 30:-30] == pytest.approx(clean[:, 30:-30], abs=2e-7)
    off = np.abs(residual(recorded(0.0), plain, BASE) - clean).max(axis=1)
    assert (off > [0.01, 0.003, 0.001]).all()


def test_a_transducer_has_a_zero_of_its_own_in_every_capture():
    """Two zeros of twice their prior size cost no more than two squares of two."""

    def deviance(zero_nm):
        torques = [(log(noise=1.0, seed=5), zero_nm), (log(noise=1.0, seed=6), -zero_nm)]
        return linear_system(fitted([moved(*one) for one in torques])).deviance

    def moved(segment, zero_nm):
        torque = segment.recorded["torque_shaft_nm"] + zero_nm
        return replace(segment, recorded={**segment.recorded, "torque_shaft_nm": torque})

    usual_nm = DEFAULT.noise_floors.transducer_offset * machine().scales["torque_nm"]
    assert deviance(2.0 * usual_nm) - deviance(0.0) < 2.0 * 2.0**2
    assert deviance(20.0 * usual_nm) - deviance(0.0) > 2.0 * 2.0**2


@pytest.mark.parametrize(("times", "named"), [(1.0, set()), (20.0, {"current_offset"})])
def test_a_usual_offset_is_a_nuisance_and_a_large_one_a_name(times, named):
    segments = (recorded(1.0, times), recorded(1.0, times, seed=6))
    model = Model(machine(), ())
    start = Fit(segments, model, dict(BASE), floors(segments, model, BASE), BASE)
    fit = gauss_newton(start).fit
    library = {n: effects()[n] for n in ("current_offset", "angle_offset", "current_delay")}
    offered = candidates(library, fit.model)
    scores = score_all(widened(fit, offered), offered)
    passing = {s.candidate.effect.name for s in scores if s.passes}
    assert named <= passing if named else not passing
    if not named:
        assert fit.values["zero_alpha_a"] == pytest.approx(ALPHA_A, rel=0.2)
        assert fit.values["zero_beta_a"] == pytest.approx(BETA_A, rel=0.2)
        # at one acceleration, 400 rad/s², a zero and a lag by acceleration are the same
        zero_rad = fit.values["zero_angle_rad"] - 7 * 400.0 * fit.values["bend_angle_s2"]
        assert zero_rad == pytest.approx(ZERO_RAD, rel=0.3)
        assert fit.values["late_angle_s"] == pytest.approx(LATE_S, rel=0.3)


def test_the_usual_offset_is_a_step_of_a_converter_of_twice_the_current():
    """12 bits from minus to plus twice the largest current that was logged, here 16 A."""
    priors = Model(machine(), ()).priors()
    step_a = (2.0 * 16.0 + 2.0 * 16.0) / 2**12
    for name in ("zero_alpha_a", "zero_beta_a"):
        assert priors[name] == (0.0, pytest.approx(step_a, rel=0.05))


@pytest.mark.parametrize(
    ("late_s", "told"), [pytest.param(4e-6, False, marks=pytest.mark.slow), (2e-5, True)]
)
def test_an_encoder_that_is_read_late_is_no_name_and_told_where_it_is_far_off(late_s, told):
    motor = replace(design("gimbal-5208"), effects={})
    plan = tuple(step for step in CAMPAIGN if step[0] in ("torque_map_fast", "drive_0"))
    recorded = campaign(motor, Bench(late_angle_s=late_s), 6, plan)
    found = diagnose(campaign_of(recorded), ModelSpec(), Constants())
    assert (found.verdict in ("adequate", "insufficient"), found.missing) == (True, ())
    notes = [note for note in found.notes if note.startswith("late_angle_s")]
    assert len(notes) == told
    for note in notes:
        said, _, u, unit = note.split("say ")[1].split()
        assert (float(said), unit) == (pytest.approx(late_s, abs=3.0 * float(u)), "s")


@pytest.mark.slow
def test_without_the_nuisance_it_would_be_a_name():
    """What the nuisance is for: with a prior of nothing the same captures name two delays."""
    motor = replace(design("gimbal-5208"), effects={})
    plan = tuple(step for step in CAMPAIGN if step[0] in ("torque_map_fast", "drive_0"))
    recorded = campaign(motor, Bench(late_angle_s=2e-5), 6, plan)
    spec = ModelSpec(policy=(("priors.late_angle_s", 1e-6),))
    found = diagnose(campaign_of(recorded), spec, Constants())
    assert set(found.missing) == {"sample_delay", "current_delay"}


def test_the_filter_of_a_transducer_is_undone():
    late_s, segment = 2e-5, log()
    torque = segment.recorded["torque_shaft_nm"]
    behind = torque - late_s * np.gradient(torque, segment.ts_s)
    lagging = replace(segment, recorded={**segment.recorded, "torque_shaft_nm": behind})
    plain = Model(machine(), ())
    clean = residual(segment, plain, BASE)[-1, 5:-5]
    off = np.abs(residual(lagging, plain, BASE)[-1, 5:-5] - clean).max()
    undone = residual(lagging, plain, {**BASE, "late_torque_s": late_s})[-1, 5:-5]
    assert off > 1e-4
    assert np.abs(undone - clean).max() < 1e-3 * off


def filtered(late_s, seed):
    """The log behind a transducer's filter."""
    segment = log(seed=seed, noise=1.0)
    torque = segment.recorded["torque_shaft_nm"]
    slope = np.gradient(log().recorded["torque_shaft_nm"], segment.ts_s)
    return replace(
        segment, recorded={**segment.recorded, "torque_shaft_nm": torque - late_s * slope}
    )


def fitted_behind(late_s):
    segments, model = (filtered(late_s, 5), filtered(late_s, 6)), Model(machine(), ())
    start = Fit(segments, model, dict(BASE), floors(segments, model, BASE), BASE)
    return gauss_newton(start).fit


@pytest.mark.parametrize(("late_s", "named"), [(2e-5, set()), (2e-3, {"torque_lag"})])
def test_a_usual_filter_is_a_nuisance_and_a_long_one_a_name(late_s, named):
    fit = fitted_behind(late_s)
    library = {n: effects()[n] for n in ("torque_lag", "compliance", "windage")}
    assert {*search(fit, library)[-1].added} == named


def test_an_effect_takes_over_the_nuisance_that_it_is_at_an_unusual_size():
    fit = fitted_behind(2e-4)
    lag_s, (_, usual_s) = fit.values["late_torque_s"], fit.model.priors()["late_torque_s"]
    assert lag_s > 5.0 * usual_s
    offered = candidates({"torque_lag": effects()["torque_lag"]}, fit.model)
    wide = widened(fit, offered)
    (score,) = with_nuisances(wide, offered, ())
    assert score.fall == pytest.approx((lag_s / usual_s) ** 2, rel=1e-6)
    begun = begin_from(fit, score)
    assert (begun.values["late_torque_s"], begun.values["torque_lag.lag_s"]) == (0.0, lag_s)
    assert begun.model.priors()["late_torque_s"][1] < 1e-3 * usual_s
    saved = wide.only(wide.model_columns).deviance - linear_system(begun).deviance
    assert saved == pytest.approx(score.fall, rel=0.1)


def test_a_late_stamp_that_was_begun_as_a_lag_is_the_stamp():
    """Their tangents are one. Where a refit falls far short of it, the other choice is tried."""
    fit = fitted_behind(2e-3)
    offered = candidates({"torque_lag": effects()["torque_lag"]}, fit.model)
    wide = widened(fit, offered)
    (score,) = with_nuisances(wide, offered, score_all(wide, offered, significant_groups(wide)))
    of_lag = {**score.candidate.values, "torque_lag.stamped": 0.0}
    begun = replace(score, candidate=replace(score.candidate, values=of_lag))
    lag, late = (refitted(wide, replace(begun, fall=fall)) for fall in (0.0, 1e3 * score.fall))
    assert lag.fit.values["torque_lag.stamped"] == 0.0
    assert late.fit.values["torque_lag.stamped"] == 1.0
    assert late.deviance < lag.deviance - 100.0
    assert late.fit.values["torque_lag.lag_s"] == pytest.approx(2e-3, rel=0.02)
