"""What candidates promise, and what is said of one that is not named."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.columns import effect_columns
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import LinearSystem, model_columns
from pipeline.criticism.selection.candidates import Candidate, candidates, searched, widened
from pipeline.criticism.selection.improvement import fall_below_floor, power_share
from pipeline.criticism.selection.refit import floored_anew
from pipeline.criticism.selection.score_test import Score, _Scoring, paid_for, score_all
from tests.unit.criticism.machines import BASE, LIBRARY, curved, fitted, log, machine, with_drag


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ({"fall": 10.0}, "not worth its parameters"),
        ({"size": 0.25, "share": 0.5}, "seen, at 0.25 of the least size that matters"),
        (
            {"size": 0.25, "share": 0.5, "clears": True},
            "refitted, it is below the floor, not seen in captures held out, or may be zero",
        ),
        ({"share": 0.05}, "takes too small a share of what is over the noise floor"),
        (
            {"share": 0.5},
            "refitted, it is below the floor, not seen in captures held out, or may be zero",
        ),
        (
            {"below_floor": 40.0},
            "refitted, it is below the floor, not seen in captures held out, or may be zero",
        ),
        (
            {"below_floor": 40.0, "effect": "sample_delay"},
            "what it would explain lies below the noise floor",
        ),
        (
            {"below_floor": 40.0, "effect": "compliance"},
            "what it would explain lies below the noise floor",
        ),
        (
            {"other_inertia": True},
            "refitted, it is below the floor, not seen in captures held out, or may be zero",
        ),
    ],
)
def test_what_an_effect_lacks_is_said(what, told):
    effect = effects()[what.pop("effect", "windage")]
    known = {"fall": 60.0, "share": 0.0, "size": 2.0, "below_floor": 0.0, **what}
    score = Score(
        Candidate(effect, ()), penalty=15.0, step={}, moves={}, policy=DEFAULT.selection, **known
    )
    assert score.shortfall == told
    assert score.passes == (
        told == "refitted, it is below the floor, not seen in captures held out, or may be zero"
    )


def test_a_fits_own_columns_are_made_where_it_stands():
    """Those of candidates may stay from the step before, 3 % of ψ away."""
    segments = (log(noise=1.0),)
    here = fitted(segments)
    away = replace(here, values={**here.values, "psi_wb": 1.03 * here.values["psi_wb"]})
    offered = candidates(LIBRARY, here.model)
    before = widened(away, offered)
    system, fresh = widened(here, offered, before), widened(here, offered)
    own = len(model_columns(here.model))
    # how many columns are projected at a time is a matter of rounding on some processors
    off = np.abs(system.matrix[:, :own] - fresh.matrix[:, :own]).max(axis=0)
    assert (off <= 1e-13 * np.abs(fresh.matrix[:, :own]).max(axis=0)).all()
    assert not np.allclose(system.matrix[:, :own], before.matrix[:, :own], rtol=1e-3, atol=0.0)
    kept, made = (s.matrix[:, own:] / s.row_weight[:, None] for s in (system, before))
    assert kept == pytest.approx(made, rel=1e-9, abs=1e-12 * np.abs(made).max())


def test_a_drag_of_the_wrong_sign_is_no_friction():
    """Windage that pushes is not offered: physics has no such effect."""

    def drag(omega, _):
        return -0.03 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    start = fitted(segments)
    offered = candidates(LIBRARY, start.model)
    scores = score_all(widened(start, offered), offered)
    assert "windage" not in {s.candidate.effect.name for s in scores if s.passes}


@pytest.mark.parametrize(("size_nm", "told"), [(-0.03, True), (0.03, False)])
def test_an_amplitude_that_may_not_be_above_zero_is_not_offered_above_it(size_nm, told):
    """Windage with its bounds exchanged: what pushes is told, and what brakes is not."""
    windage = LIBRARY["windage"]
    (braking,) = windage.parameters
    pushing = replace(windage, parameters=(replace(braking, low=-1.0, high=0.0),))
    segments = (with_drag(curved(size_nm)), with_drag(curved(size_nm), 6))
    start = fitted(segments)
    offered = candidates({"windage": pushing}, start.model)
    scores = score_all(widened(start, offered), offered)
    assert [s.candidate.effect.name for s in scores] == ["windage"] * told


def test_zero_of_an_effect_takes_the_trial_shape():
    model = Model(machine(), ())
    values = zero(effects()["stribeck"], model)
    assert values["stribeck.excess_nm"] == 0.0
    assert values["stribeck.speed_rad_s"] == pytest.approx(0.004 * 250.0)


@pytest.mark.parametrize(("other", "expected"), [(1.0, 1.0), (1000.0, 0.002)])
def test_an_effect_helps_by_its_share_of_power_not_of_groups(other, expected):
    """One capture of two comes to its floor from χ²/n = 3, the other stays where it is.

    By logarithms, that would be an eighth of all deviance beside a capture at 1000.
    """
    effect, model = effects()["windage"], Model(machine(), ())
    (column,) = effect_columns(effect, model)
    random = np.random.default_rng(4)
    shape = np.concatenate([np.sqrt(2.0) * random.choice([-1.0, 1.0], 100), np.zeros(100)])
    noise = random.choice([-1.0, 1.0], 200)
    system = LinearSystem(
        columns=(*model_columns(model), column),
        residual=noise * np.repeat([1.0, np.sqrt(other)], 100) - shape,
        matrix=np.column_stack([np.zeros((200, len(model_columns(model)))), shape / 0.1]),
        group=np.repeat([0, 1], 100),
        window=np.tile(np.arange(100), 2),
        unit=np.ones(200),
        noise_ratio=np.ones(200),
        row_weight=np.ones(200),
        labels=((0, "torque_shaft_nm", 0), (1, "torque_shaft_nm", 0)),
        prior_precision=np.zeros(1 + len(model_columns(model))),
        prior_gradient=np.zeros(1 + len(model_columns(model))),
        fit=Fit((log(), log()), model, dict(BASE), (np.ones(100), np.ones(100)), BASE),
        model_column_count=len(model_columns(model)),
        made_at={},
    )
    (score,) = score_all(system, [Candidate(effect, (column,))])
    assert score.fall > score.penalty
    assert score.share == pytest.approx(expected, abs=0.2 * expected)


@pytest.mark.parametrize("quiet_chi2", [0.5, 1.2])
def test_evidence_at_an_order_counts_above_its_floor_or_below_it(quiet_chi2):
    """A channel is loud at order 1 and all but quiet at order 0, where an effect halves it: what it
    takes there is below the floor, whatever the other order has.
    """
    model = Model(machine(), ())
    columns = tuple(model_columns(model))
    before, after = np.array([quiet_chi2, 1000.0]), np.array([0.5 * quiet_chi2, 1000.0])
    system = LinearSystem(
        columns=columns,
        residual=np.repeat(np.sqrt(before), 100),
        matrix=np.zeros((200, len(columns))),
        group=np.repeat([0, 1], 100),
        window=np.tile(np.arange(100), 2),
        unit=np.ones(200),
        noise_ratio=np.ones(200),
        row_weight=np.ones(200),
        labels=((0, "torque_shaft_nm", 0), (0, "torque_shaft_nm", 1)),
        prior_precision=np.zeros(len(columns)),
        prior_gradient=np.zeros(len(columns)),
        fit=Fit((log(),), model, dict(BASE), (np.ones(200),), BASE),
        model_column_count=len(columns),
        made_at={},
    )
    assert power_share(system, before, after) == 0.0
    assert fall_below_floor(system, before, after) > 20.0
    assert fall_below_floor(system, before, np.array([quiet_chi2, 500.0])) == 0.0


NO_STAMP = {"torque_lag.late": 0.0, "torque_lag.stamped": 0.0}


@pytest.mark.parametrize(("lag_s", "anew"), [(2e-3, True), (1e-6, False)])
def test_floors_are_made_anew_where_undoing_a_lag_brings_noise(lag_s, anew):
    segments = (log(noise=1.0), log(noise=1.0, seed=6))
    before = fitted(segments)
    lagging = replace(
        before,
        model=before.model.with_effects(effects()["torque_lag"]),
        values={**before.values, "torque_lag.lag_s": lag_s} | NO_STAMP,
    )
    after = floored_anew(lagging)
    assert (after.sigma is not before.sigma) is anew
    assert bool(after.sigma[0][-1] > 2.0 * before.sigma[0][-1]) is anew


def test_the_best_of_several_choices_has_had_as_many_chances():
    offered = candidates(effects(), Model(machine(), ()))
    plain, clock = (effects()[name] for name in ("windage", "clock_scale"))
    recorders = {c.values["clock_scale.of"] for c in offered if c.effect is clock}
    assert len(recorders) > 1
    assert searched(offered, plain) == pytest.approx(
        2.0 * np.log(len({c.effect.name for c in offered}))
    )
    more = searched(offered, clock) - searched(offered, plain)
    assert more == pytest.approx(2.0 * np.log(len(recorders)))


@pytest.mark.parametrize(
    ("name", "fitted_so", "count"),
    [
        ("dead_time", ("loss_v",), 2),
        ("dead_time", ("loss_v", "on_v"), 3),
        ("current_gain", ("cosine", "sine", "mean"), 3),
    ],
)
def test_a_shape_with_a_prior_costs_a_score_no_parameter(name, fitted_so, count):
    """A dead time of two parameters, a voltage and a width, was charged for four: the lags of its
    pulses and of its sign are what they usually are where captures do not show them.
    """
    step = {f"{name}.{one}": 0.1 for one in fitted_so}
    score = SimpleNamespace(step=step)
    assert paid_for(effects()[name], machine(), score) == count


@pytest.mark.parametrize(("penalty", "named"), [(15.0, "stribeck"), (32.0, None)])
def test_a_small_effect_that_costs_more_does_not_explain_as_well(penalty, named):
    """Two further parameters of friction took what the windage of a map is."""
    some = np.zeros(1, dtype=np.int64)
    candidate = Candidate(effects()["windage"], ())
    score = Score(candidate, 119.0, 15.0, {}, {}, 1.0, 2.0, policy=DEFAULT.selection)
    other = replace(
        score, candidate=Candidate(effects()["stribeck"], ()), fall=108.0, penalty=penalty, size=0.5
    )
    assert score.passes
    assert not other.matters
    fitted_so = SimpleNamespace(best=lambda *_: SimpleNamespace(deviance=0.0))
    scoring = SimpleNamespace(
        system=SimpleNamespace(policy=DEFAULT),
        model_columns=some,
        normal_equations=SimpleNamespace(only=lambda _: fitted_so),
    )
    best = {"windage": (score, some), "stribeck": (other, some)}
    assert _Scoring.confounder(scoring, score, best) == named
