"""Finding effects in logs that are made here, in closed form, with and without them."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.effect import Discrimination
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.policy.policy import Policy
from pipeline.criticism.policy.regression import NoiseFloors
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import remainder
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.selection import best_candidate, refit, stepwise
from pipeline.criticism.selection.acceptance import _form_error_factors, _same_hook, is_determined
from pipeline.criticism.selection.candidates import Candidate
from pipeline.criticism.selection.refit import floored_anew
from pipeline.criticism.selection.requested_model import fit_of
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.sizes import material, size_of
from pipeline.criticism.selection.stepwise import search
from pipeline.numerics.projection import projection
from tests.unit.criticism.machines import (
    BASE,
    LIBRARY,
    asking_for,
    cautious,
    curved,
    fitted,
    log,
    machine,
    with_drag,
)

TORQUE = "torque_shaft_nm"


def test_a_sound_machine_is_left_alone():
    segments = (log(noise=1.0), log(noise=1.0, seed=6))
    steps = search(fitted(segments), LIBRARY)
    assert [step.added for step in steps] == [()]
    assert steps[0].fit.values["psi_wb"] == pytest.approx(BASE["psi_wb"], rel=1e-3)


def test_the_next_effect_is_judged_against_a_fit_that_has_converged():
    """A tolerance of form is new, no floor has changed by half and nothing is left over one."""
    fit = fitted((log(noise=1.0), log(noise=1.0, seed=6)))
    moved = replace(fit, values={**fit.values, "psi_wb": (1.0 + 2e-4) * fit.values["psi_wb"]})
    found = floored_anew(moved)
    assert linear_system(moved).deviance > linear_system(found).deviance + 1.0
    assert found.values["psi_wb"] == pytest.approx(fit.values["psi_wb"], rel=2e-5)


def test_no_effect_is_credited_with_a_way_out_of_another_minimum(monkeypatch):
    """A late edge of a dead time had two minima. A friction that grows with the load was named for
    the way from one to the other, and was 2.3 of its own uncertainty.
    """
    fit = fitted((log(noise=1.0), log(noise=1.0, seed=6)))
    stuck = replace(fit, values={**fit.values, "psi_wb": 1.01 * fit.values["psi_wb"]})
    offered = []

    def windage(wide, *_):
        offered.append(wide.deviance)
        model = wide.fit.model.with_effects(effects()["windage"])
        begun = replace(
            fit, model=model, values={**zero(effects()["windage"], model), **fit.values}
        )
        return gauss_newton(begun) if len(offered) == 1 else None

    monkeypatch.setattr(stepwise, "best_candidate", windage)
    steps = search(stuck, LIBRARY)
    assert [step.added for step in steps] == [()]
    assert len(offered) == 2
    assert offered[1] < offered[0] - 100.0
    assert steps[0].fit.values["psi_wb"] == pytest.approx(fit.values["psi_wb"], rel=1e-4)


def test_windage_below_a_cautious_floor_is_named_and_nothing_where_there_is_none():
    def drag(omega, _):
        return 0.09 * omega * np.abs(omega) / 250.0**2

    hidden, none = ((with_drag(one), with_drag(one, 6)) for one in (drag, lambda *_: 0.0))
    steps = search(cautious(hidden, 9.0), LIBRARY)
    assert steps[0].system.reduced_chi2(steps[0].system.residual).max() < 1.0
    assert steps[-1].added == ("windage",)
    assert search(cautious(none, 9.0), LIBRARY)[-1].added == ()


def mirrored(segment):
    """The log of a machine that turns and pulls the other way."""
    turned = {name: -segment.recorded[name] for name in ("iq_a", "vq_v", "theta_mech_rad", TORQUE)}
    weak = segment.weak
    again = projection(turned["theta_mech_rad"], weak.starts, weak.length, (1, 7, 14, 42))
    return replace(segment, recorded={**segment.recorded, **turned}, weak=again)


@pytest.mark.parametrize(("senses", "added"), [((1, 1, 1, 1, 1, 1), 1), ((1, 1, -1, -1, 1, -1), 0)])
def test_what_all_captures_have_is_none_of_their_zeros(senses, added):
    """Six usual zeros of the transducer, each capture's own: each fit was at its floor. Predicted
    from the others, a capture is not where all have the same.
    """
    zero_nm = 6.0 * machine().policy.noise_floors.transducer_offset * machine().scales["torque_nm"]
    plain = [log(noise=1.0, seed=n) for n in range(5, 11)]
    both = [mirrored(one) if n % 2 else one for n, one in enumerate(plain)]
    segments = tuple(
        replace(one, recorded={**one.recorded, TORQUE: one.recorded[TORQUE] + sense * zero_nm})
        for sense, one in zip(senses, both, strict=True)
    )
    library = {**LIBRARY, "torque_offset": effects()["torque_offset"]}
    steps = search(fitted(segments), library)
    assert not remainder(steps[0].system)
    assert steps[-1].added == ("torque_offset",) * added


def test_an_offset_of_all_captures_within_a_cautious_floor_is_no_name():
    """Captures held out are at their floors too: nothing is over one that it could take."""
    offset_nm = (
        6.0 * machine().policy.noise_floors.transducer_offset * machine().scales["torque_nm"]
    )
    plain = [log(noise=1.0, seed=n) for n in range(5, 11)]
    segments = tuple(
        replace(one, recorded={**one.recorded, TORQUE: one.recorded[TORQUE] + offset_nm})
        for one in (mirrored(one) if n % 2 else one for n, one in enumerate(plain))
    )
    library = {**LIBRARY, "torque_offset": effects()["torque_offset"]}
    steps = search(cautious(segments, 9.0), library)
    (score,) = (s for s in steps[0].scores if s.candidate.effect.name == "torque_offset")
    assert score.may_be_hidden
    assert steps[-1].added == ()


def test_a_drag_inside_the_allowance_of_a_bench_is_not_named_however_long_the_log():
    """The floor is what bench and model may have wrong: windows by the dozen show one error."""
    wrong = NoiseFloors(model_drive=2e-4)
    machine_of_bench = replace(machine(), policy=Policy(noise_floors=wrong))
    segments = tuple(with_drag(curved(0.04), seed) for seed in (5, 6, 7, 8))
    model = Model(machine_of_bench, ())
    sigma = tuple(floors(segments, model, BASE))
    fit = gauss_newton(Fit(segments, model, dict(BASE), sigma, BASE)).fit
    (last,) = search(fit, LIBRARY)
    windage = next(s for s in last.scores if s.candidate.effect.name == "windage")
    assert windage.fall > windage.penalty
    assert last.added == ()


def bristled(torque_nm, damping_nm, travel_rad, seed):
    """The log with friction of bristles in place of dry friction, after its one reversal."""
    segment = log(noise=1.0, seed=seed)
    omega = -60.0 + 400.0 * np.arange(segment.size) * segment.ts_s
    turned = omega**2 / 800.0
    lack = np.where(omega > 0.0, 2.0 * np.exp(-turned / travel_rad), 0.0)
    columns = {**segment.recorded, "travel_rad": np.where(omega > 0.0, turned, np.inf)}
    columns["torque_shaft_nm"] = columns["torque_shaft_nm"] + lack * (
        torque_nm - damping_nm * omega / 250.0
    )
    return replace(segment, recorded=columns)


def test_bristles_with_a_damping_are_named_with_their_sizes():
    true = {"torque_nm": 0.02, "damping_nm": 1.0, "travel_rad": 0.04}
    library = {**LIBRARY, "presliding": effects()["presliding"]}
    last = search(fitted([bristled(**true, seed=seed) for seed in (5, 6)]), library)[-1]
    assert last.added == ("presliding",)
    for name, value in true.items():
        assert last.fit.values[f"presliding.{name}"] == pytest.approx(value, rel=0.03)


@pytest.mark.slow
def test_choices_are_made_again_on_every_step_and_at_the_end_of_what_is_asked_for(monkeypatch):
    made = []

    def watched(system, at_floor=False):
        if not at_floor:
            made.append([effect.name for effect in system.fit.model.effects])
        return system

    for place in ("stepwise", "requested_model"):
        monkeypatch.setattr(f"pipeline.criticism.selection.{place}.reconsidered", watched)
    hidden = (with_drag(curved(0.09)), with_drag(curved(0.09), 6))
    assert search(cautious(hidden, 9.0), LIBRARY)[-1].added == ("windage",)
    assert made == [["windage"]]
    fit_of(hidden, Model(machine(), (effects()["stribeck"],)))
    assert made == [["windage"], ["stribeck"]]


def test_floors_at_a_fit_s_end_count_on_both_sides_of_a_comparison(monkeypatch):
    """Constants that have moved since floors were made moved without windage as well."""

    def eightfold(system):
        return np.full(len(system.labels), 8.0)

    monkeypatch.setattr("pipeline.criticism.selection.acceptance.floor_factors", eightfold)
    hidden = (with_drag(curved(0.09)), with_drag(curved(0.09), 6))
    assert search(cautious(hidden, 9.0), LIBRARY)[-1].added == ("windage",)


def test_a_small_effect_matters_where_it_takes_what_would_be_told_as_a_remainder():
    """A size that nobody minds is one that nobody is told of. With less of it, or higher floors,
    there is nothing to tell, and then it is seen and not named.
    """
    segments = (with_drag(curved(0.1)), with_drag(curved(0.1), 6))
    library = asking_for(0.3)
    steps = search(fitted(segments), library)
    assert remainder(steps[0].system)
    assert steps[-1].added == ("windage",)
    assert size_of(steps[-1].fit, library["windage"], library["windage"].parameters) < 0.3
    few = (with_drag(curved(0.03)), with_drag(curved(0.03), 6))
    for captured, times in ((few, 1.0), (segments, 10.0)):
        last = search(cautious(captured, times), library)[-1]
        assert last.added == ()
        seen = next(s for s in last.scores if s.candidate.effect.name == "windage")
        assert seen.shortfall.startswith("seen, at 0.")


def test_what_a_small_effect_explains_is_not_named_after_another():
    """Windage that is too small to matter leaves friction its second best explanation."""
    segments = (with_drag(curved(0.2)), with_drag(curved(0.2), 6))
    start = cautious(segments, 15.0)
    without = {k: v for k, v in LIBRARY.items() if k != "windage"}
    other = search(start, without)[-1].added
    assert other
    last = search(start, asking_for(0.5))[-1]
    assert last.added == ()
    shadowed = next(s for s in last.scores if s.candidate.effect.name == other[0])
    assert shadowed.fall > shadowed.penalty
    assert shadowed.shortfall == "windage explains it as well, and is too small to matter"


@pytest.mark.slow
def test_an_effect_that_ties_with_one_too_small_to_matter_is_not_named():
    """The captures do not say which of the two it is, and one of them is nothing to act on."""
    segments = (with_drag(curved(0.1)), with_drag(curved(0.1), 6))
    twin = replace(effects()["windage"], name="twin")
    named = search(fitted(segments), {**LIBRARY, "twin": twin})[-1]
    assert len(named.added) == 1
    last = search(cautious(segments, 4.0), {**asking_for(0.3), "twin": twin})[-1]
    assert last.added == ()
    shadowed = next(s for s in last.scores if s.candidate.effect.name == "twin")
    assert shadowed.confounder == "windage"


def test_an_effect_that_is_not_there_at_its_own_size_shadows_none():
    """What explains then is no amplitude of it, as the mean of all gains is none of one phase's."""
    segments = (with_drag(curved(0.1)), with_drag(curved(0.1), 6))
    twin = replace(effects()["windage"], name="twin")
    last = search(cautious(segments, 4.0), {**asking_for(5.0), "twin": twin})[-1]
    assert last.added == ("twin",)


def test_candidates_are_tried_by_what_they_are_worth(monkeypatch):
    """Of two that tie, the cheaper one comes first: only a few are refitted."""
    tried = []
    monkeypatch.setattr(best_candidate, "_chosen", lambda _, passing, *__: tried.extend(passing))
    wide = linear_system(fitted((log(noise=1.0),)))
    one = Score(
        Candidate(effects()["windage"], ()),
        50.0,
        20.0,
        {},
        {},
        1.0,
        2.0,
        policy=wide.policy.selection,
    )
    dear, cheap = one, replace(one, fall=49.0, penalty=12.0)
    best_candidate.best_candidate(wide, (dear, cheap), 0, frozenset())
    assert tried == [cheap, dear]


@pytest.mark.parametrize(
    ("fall", "first_matters", "over_floor", "apart", "both"),
    [
        (176.0, True, True, False, True),
        (165.0, True, True, False, False),
        (165.0, False, True, False, True),
        (165.0, False, False, False, False),
        (165.0, False, False, True, True),
    ],
)
def test_who_may_be_best_by_a_refit_is_refitted(
    monkeypatch, fall, first_matters, over_floor, apart, both
):
    """Cogging of ten terms has the larger fall, and the friction of a coast less to pay. A coupling
    too small to matter kept an angle off by 18 noise floors from being tried, and a skin effect in
    current steps the windage of coasts.
    """
    tried = []
    wide = linear_system(fitted((log(noise=1.0),)))
    lower = SimpleNamespace(deviance=wide.deviance - 300.0, fit=wide.fit)

    def judged(wide, score):
        tried.append(score.candidate.effect.name)
        return wide

    def matters(*_):
        return first_matters or tried[-1] != "cogging"

    monkeypatch.setattr(best_candidate, "reweighted", judged)
    monkeypatch.setattr(best_candidate, "refitted", lambda *_: lower)
    monkeypatch.setattr(best_candidate, "matters", matters)
    monkeypatch.setattr(best_candidate, "is_rare", lambda *_: False)
    monkeypatch.setattr(best_candidate.Baseline, "is_improved_by", lambda *_: True)
    significant = "pipeline.criticism.selection.acceptance.significant_groups"
    monkeypatch.setattr(significant, lambda _: np.array([over_floor]))

    def acts(system, columns):
        first = np.arange(len(system.labels)) == 0
        return ~first if apart and columns == ("stribeck",) else first

    monkeypatch.setattr(best_candidate, "acts_in", acts)

    def score(name, fall, penalty):
        of = wide.policy.selection
        named = Candidate(effects()[name], (name,))
        return Score(named, fall, penalty, {}, {}, 1.0, 2.0, policy=of)

    passing = [score("cogging", 290.0, 73.0), score("stribeck", fall, 26.7)]
    found = best_candidate._refit_best(wide, passing, ())
    assert found is (lower if first_matters or both else None)
    assert tried == ["cogging", "stribeck"][: 1 + both]


def test_a_refit_begins_within_the_reach_of_the_tangent(monkeypatch):
    """Ten thousand in deviance away, ten fits went to and fro for a hundred seconds."""
    wide, begun = linear_system(fitted((log(noise=1.0),))), []

    def fit_from(fit, before, most):
        begun.append((fit.values["windage.drag_nm"], fit.values["psi_wb"] - BASE["psi_wb"]))
        assert most == before.deviance + 50.0
        return SimpleNamespace(deviance=most + (1.0 if len(begun) < 3 else -1.0), fit=fit)

    monkeypatch.setattr(refit, "gauss_newton", fit_from)
    at = wide.fit.values["psi_wb"] - BASE["psi_wb"]
    step, moves = {"windage.drag_nm": 0.8}, {"psi_wb": 0.01}
    of, windage = wide.policy.selection, Candidate(effects()["windage"], ())
    refit._along_the_step(wide, Score(windage, 50.0, 15.0, step, moves, 1.0, 2.0, policy=of))
    assert [drag for drag, _ in begun] == pytest.approx([0.8, 0.4, 0.2])
    assert [psi - at for _, psi in begun] == pytest.approx([0.01, 0.005, 0.0025])


def test_windage_is_found_with_its_size():
    def drag(omega, _):
        return 0.035 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    steps = search(fitted(segments), LIBRARY)
    assert steps[-1].added == ("windage",)
    assert steps[-1].fit.values["windage.drag_nm"] == pytest.approx(0.035, rel=0.05)


def test_the_fit_is_looked_at_anew_whatever_joins(monkeypatch):
    """An unbalance had driven J to six times what it is, and the fit stayed there with it."""
    asked = []

    def spy(fit, before):
        asked.append(fit.model.effects[-1].name)
        return floored_anew(fit, before)

    monkeypatch.setattr("pipeline.criticism.selection.stepwise.floored_anew", spy)
    steps = search(fitted((with_drag(curved(0.1)), with_drag(curved(0.1), 6))), LIBRARY)
    assert steps[-1].added == ("windage",)
    assert asked == ["windage"]


def test_two_effects_are_found_whatever_their_order():
    def drag(omega, theta):
        return 0.02 * np.sign(omega) + 0.02 * np.sin(theta + 0.4)

    segments = (with_drag(drag), with_drag(drag, 6))
    steps = search(fitted(segments), LIBRARY)
    assert set(steps[-1].added) == {"coulomb_friction", "unbalance"}
    values = steps[-1].fit.values
    assert np.hypot(values["unbalance.sin_nm"], values["unbalance.cos_nm"]) == pytest.approx(
        0.02, rel=0.03
    )


def test_beside_an_effect_of_its_kind_another_must_stand_for_more_than_its_error():
    """A twentieth of what windage does, window by window, joins the floor for a drag only."""

    def drag(omega, _):
        return 0.035 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    last = search(fitted(segments), LIBRARY)[-1]
    (windage,) = last.fit.model.effects
    doubt = _form_error_factors(last.system, (windage,))
    omega = np.gradient(log().recorded["theta_mech_rad"], 5e-5)
    place = last.system.labels.index((0, "torque_shaft_nm", 0))
    mine = last.system.group == place
    plain = segments[0].weak.project(drag(omega, 0.0)[None])[0, :, 0]
    wrong = 0.05 * np.sqrt(np.mean(plain[last.system.window[mine]] ** 2))
    noise = np.mean(last.system.row_weight[mine] ** -2.0)
    assert doubt[place] == pytest.approx(noise / (noise + wrong**2), rel=0.1)
    assert doubt[place] < 0.9
    assert doubt[last.system.labels.index((0, "vd_v", 0))] == 1.0
    delay = effects()["sample_delay"]
    assert _same_hook(effects()["iron_eddy"], (windage, delay)) == [windage]
    assert _same_hook(delay, (windage, delay)) == []
    assert (_form_error_factors(last.system, ()) == 1.0).all()


@pytest.mark.slow
def test_what_is_asked_for_is_looked_for_at_all_its_trial_shapes():
    """From the first of them, 1 rad/s, a bump of 20 rad/s is out of sight."""

    def drag(omega, _):
        return np.sign(omega) * (0.02 + 0.03 * np.exp(-((omega / 20.0) ** 2)))

    segments = (with_drag(drag), with_drag(drag, 6))
    asked = tuple(effects()[name] for name in ("coulomb_friction", "stribeck"))
    found = fit_of(segments, Model(machine(), asked)).system.fit.values
    assert found["stribeck.speed_rad_s"] == pytest.approx(20.0, rel=0.05)
    assert found["stribeck.excess_nm"] == pytest.approx(0.03, rel=0.05)
    assert found["coulomb_friction.torque_nm"] == pytest.approx(0.02, rel=0.05)


def test_an_effect_is_material_by_its_amplitude_and_by_shapes_that_have_a_least():
    """A coupling that hardly twists is none; a sign of a shape without a least says nothing."""
    library = effects()

    def judged(name: str, **values: float) -> bool:
        full = {f"{name}.{k}": v for k, v in values.items()}
        return material(Fit((), Model(machine(), (library[name],)), full, (), full), library[name])

    rigid = {"damping_s": 0.0, "far_friction": 0.0, "between": 0.0}
    assert judged("compliance", share=0.3, twist_rad=0.005, **rigid)
    assert not judged("compliance", share=0.3, twist_rad=1e-4, **rigid)
    assert not judged("compliance", share=0.01, twist_rad=0.005, **rigid)
    assert judged("torque_lag", lag_s=1e-3, late=-0.4, stamped=0.0)


@pytest.mark.parametrize(("part", "possible"), [(0.9, True), (1.0, False), (-1.0, False)])
def test_no_more_of_an_effect_is_named_than_there_can_be(part, possible):
    """A recorder that is 17 % fast was named for a flux of no known form, and was at no bound."""
    clock = effects()["clock_scale"]
    model = Model(machine(), (clock,))
    (gain, _) = clock.parameters
    assert gain.high == 0.1
    values = {**BASE, "clock_scale.gain": part * gain.high, "clock_scale.of": 7.0}
    assert material(Fit((), model, values, (), values), clock) is possible


@pytest.mark.parametrize(("cosine", "possible"), [(0.19, True), (-0.2, False)])
def test_of_a_vector_no_part_is_at_its_bound(cosine, possible):
    """A spring on an arm was named an encoder 0.2 rad off its centre, at 4330 noise floors."""
    disc = effects()["angle_eccentricity"]
    model = Model(machine(), (disc,))
    sizes = dict.fromkeys((p.name for p in disc.parameters_of(machine())), 0.0)
    sizes |= {"sine_rad": 0.01, "cosine_rad": cosine}
    values = {**BASE, **{f"angle_eccentricity.{name}": size for name, size in sizes.items()}}
    assert material(Fit((), model, values, (), values), disc) is possible


def test_a_part_that_is_not_there_is_at_no_bound():
    """Excess loss alone: no eddy currents stand at zero, which is their bound."""
    iron = effects()["iron_eddy"]
    model = Model(machine(), (iron,))
    sizes = {"drag_nm": 0.0, "excess_nm": 0.05, "parallel": 1.0}
    values = {**BASE, **{f"iron_eddy.{name}": size for name, size in sizes.items()}}
    assert material(Fit((), model, values, (), values), iron)


@pytest.mark.parametrize(("mean", "possible"), [(0.01, True), (-0.3, False)])
def test_what_goes_with_an_effect_is_no_larger_than_there_can_be(mean, possible):
    """No current sensor reads a third too little: with that, its ripple stood for a dead time."""
    gain = effects()["current_gain"]
    model = Model(machine(), (gain,))
    sizes = {"cosine": 0.02, "sine": 0.0, "mean": mean, "shunts": 0.0, "bench": 0.0, "alone": 0.0}
    values = {**BASE, **{f"current_gain.{name}": value for name, value in sizes.items()}}
    assert material(Fit((), model, values, (), values), gain) is possible


@pytest.mark.slow
def test_nothing_is_named_in_place_of_a_better_explanation_of_unsure_size(monkeypatch):
    def unsure(system, _):
        return system.fit.model.effects[-1].name != "windage"

    hidden = tuple(with_drag(curved(0.1), seed) for seed in (5, 6))
    assert search(fitted(hidden), LIBRARY)[-1].added == ("windage",)
    monkeypatch.setattr("pipeline.criticism.selection.best_candidate.is_determined", unsure)
    assert search(fitted(hidden), LIBRARY)[-1].added == ()


def test_an_explanation_of_unsure_size_does_not_speak_where_it_does_not_act(monkeypatch):
    """As a field inside the conductors, in current steps, beside the windage of coasts."""

    def acts(system, columns=()):
        unsure = not columns and system.fit.model.effects[-1].name == "windage"
        return np.full(len(system.labels), unsure) ^ (np.arange(len(system.labels)) > 0)

    def sure(system, _):
        return system.fit.model.effects[-1].name != "windage"

    hidden = tuple(with_drag(curved(0.1), seed) for seed in (5, 6))
    for name, answer in (("is_determined", sure), ("acts_in", acts)):
        monkeypatch.setattr(f"pipeline.criticism.selection.best_candidate.{name}", answer)
    added = search(fitted(hidden), LIBRARY)[-1].added
    assert added
    assert "windage" not in added


@pytest.mark.parametrize(("logged", "determined"), [({}, False), ({"gap_rad": (5e-3, 1e-4)}, True)])
def test_a_gap_that_windows_leave_open_is_determined_where_full_logs_show_it(
    monkeypatch, logged, determined
):
    effect = effects()["backlash"]
    fit = fitted((log(noise=1.0), log(noise=1.0, seed=6)))
    model = fit.model.with_effects(effect)
    loose = {"backlash.share": 0.5, "backlash.gap_rad": 1e-3, "backlash.twist_rad": 3e-3}
    values = {**fit.values, **zero(effect, model), **loose}
    coupled = linear_system(replace(fit, model=model, values=values))
    for name, answer in (
        ("significantly_nonzero", {"backlash.share"}),
        ("discriminate", Discrimination("backlash", logged)),
    ):
        monkeypatch.setattr(
            f"pipeline.criticism.selection.acceptance.{name}", lambda *_, a=answer: a
        )
    assert is_determined(coupled, coupled) is determined
