"""Finding effects in logs that are made here, in closed form, with and without them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.asked import fit_of
from pipeline.criticism.descent import gauss_newton
from pipeline.criticism.effect import Told
from pipeline.criticism.judge import HeldOut, leave_out, remainder
from pipeline.criticism.linearise import effect_columns
from pipeline.criticism.model import Model, zero
from pipeline.criticism.registry import effects
from pipeline.criticism.rivals import rivals_of
from pipeline.criticism.scores import Candidate, Score, candidates, score_all, widened
from pipeline.criticism.selection import (
    _doubt,
    _floored_anew,
    _kin,
    material,
    search,
    size_of,
)
from pipeline.criticism.system import Fitted, System, floors, own_columns, system
from pipeline.criticism.trust import trusted
from pipeline.criticism.unknown import unknown_structure
from tests.unit.criticism.machines import BASE, coasting, log, machine

LIBRARY = {
    name: effects()[name]
    for name in ("coulomb_friction", "windage", "stribeck", "dead_time", "saturation", "unbalance")
}


def fitted(segments, **start):
    """The fit from the true constants, or from others that are given."""
    model = Model(machine(), ())
    begun = Fitted(model, {**BASE, **start}, floors(segments, model, BASE), BASE)
    return gauss_newton(segments, begun)[0]


def cautious(segments, times):
    """A fit whose noise floors are some times what the sensors' noise makes."""
    model = Model(machine(), ())
    sigma = tuple(times * one for one in floors(segments, model, BASE))
    return gauss_newton(segments, Fitted(model, dict(BASE), sigma, BASE))[0]


def with_drag(drag, seed=5):
    """The log with a further drag of speed and angle [N·m] at its shaft."""
    segment = log(noise=1.0, seed=seed)
    theta = segment.recorded["theta_mech_rad"]
    omega = np.gradient(log().recorded["theta_mech_rad"], 5e-5)
    torque = segment.recorded["torque_shaft_nm"] - drag(omega, theta)
    return replace(segment, recorded={**segment.recorded, "torque_shaft_nm": torque})


def test_a_sound_machine_is_left_alone():
    segments = (log(noise=1.0), log(noise=1.0, seed=6))
    rungs = search(segments, fitted(segments), LIBRARY)
    assert [rung.added for rung in rungs] == [()]
    assert rungs[0].fitted.values["psi_wb"] == pytest.approx(BASE["psi_wb"], rel=1e-3)


def test_windage_below_a_cautious_floor_is_named_and_nothing_where_there_is_none():
    def drag(omega, _):
        return 0.02 * omega * np.abs(omega) / 250.0**2

    hidden, none = ((with_drag(one), with_drag(one, 6)) for one in (drag, lambda *_: 0.0))
    rungs = search(hidden, cautious(hidden, 3.0), LIBRARY)
    assert rungs[0].around.spreads(rungs[0].around.residual).max() < 1.0
    assert rungs[-1].added == ("windage",)
    assert search(none, cautious(none, 3.0), LIBRARY)[-1].added == ()


def _curved(size_nm):
    return lambda omega, _: size_nm * omega * np.abs(omega) / 250.0**2


def test_choices_are_made_again_on_every_rung_and_at_the_end_of_what_is_asked_for(monkeypatch):
    made = []

    def watched(_, found, around):
        made.append([effect.name for effect in found.model.effects])
        return found, around

    for place in ("selection", "asked"):
        monkeypatch.setattr(f"pipeline.criticism.{place}.reconsidered", watched)
    hidden = (with_drag(_curved(0.02)), with_drag(_curved(0.02), 6))
    assert search(hidden, cautious(hidden, 3.0), LIBRARY)[-1].added == ("windage",)
    assert made == [["windage"]]
    fit_of(hidden, Model(machine(), (effects()["stribeck"],)))
    assert made == [["windage"], ["stribeck"]]


def _asking_for(negligible):
    """The library with windage that nobody minds below a part of the machine's torque."""
    windage = effects()["windage"]
    parameters = tuple(replace(p, negligible=negligible) for p in windage.parameters)
    return {**LIBRARY, "windage": replace(windage, parameters=parameters)}


def test_floors_at_a_fit_s_end_count_on_both_sides_of_a_comparison(monkeypatch):
    """Constants that have moved since floors were made moved without windage as well."""

    def eightfold(_, around):
        return np.full(len(around.labels), 8.0)

    monkeypatch.setattr("pipeline.criticism.selection._shrunk", eightfold)
    hidden = (with_drag(_curved(0.02)), with_drag(_curved(0.02), 6))
    assert search(hidden, cautious(hidden, 3.0), LIBRARY)[-1].added == ("windage",)


def test_a_small_effect_matters_where_it_takes_what_would_be_told_as_a_remainder():
    """A size that nobody minds is one that nobody is told of. With less of it, or higher floors,
    there is nothing to tell, and then it is seen and not named.
    """
    segments = (with_drag(_curved(0.1)), with_drag(_curved(0.1), 6))
    library = _asking_for(0.3)
    rungs = search(segments, fitted(segments), library)
    assert remainder(rungs[0].around, segments, rungs[0].around.residual)
    assert rungs[-1].added == ("windage",)
    assert size_of(rungs[-1].fitted, library["windage"], "negligible") < 0.3
    few = (with_drag(_curved(0.03)), with_drag(_curved(0.03), 6))
    for captured, times in ((few, 1.0), (segments, 10.0)):
        last = search(captured, cautious(captured, times), library)[-1]
        assert last.added == ()
        seen = next(s for s in last.scores if s.candidate.effect.name == "windage")
        assert seen.shortfall.startswith("seen, at 0.")


def test_what_a_small_effect_explains_is_not_named_after_another():
    """Windage that is too small to matter leaves friction its second best explanation."""
    segments = (with_drag(_curved(0.03)), with_drag(_curved(0.03), 6))
    start = cautious(segments, 3.0)
    without = {k: v for k, v in LIBRARY.items() if k != "windage"}
    other = search(segments, start, without)[-1].added
    assert other
    last = search(segments, start, _asking_for(0.1))[-1]
    assert last.added == ()
    shadowed = next(s for s in last.scores if s.candidate.effect.name == other[0])
    assert shadowed.fall > shadowed.price
    assert shadowed.shortfall == "windage explains it better, and is too small to matter"


@pytest.mark.parametrize(
    ("what", "told"),
    [
        ({"fall": 10.0}, "not worth its parameters"),
        ({"size": 0.25, "share": 0.5}, "seen, at 0.25 of the least size that matters"),
        (
            {"size": 0.25, "share": 0.5, "clears": True},
            "refitted, it does not hold on captures held out, or may be zero",
        ),
        ({"share": 0.05}, "takes too small a share of what is over the noise floor"),
        ({"share": 0.5}, "refitted, it does not hold on captures held out, or may be zero"),
        ({"quiet": 40.0}, "refitted, it does not hold on captures held out, or may be zero"),
        (
            {"quiet": 40.0, "effect": "sample_delay"},
            "what it would explain lies below the noise floor",
        ),
        (
            {"quiet": 40.0, "effect": "compliance"},
            "what it would explain lies below the noise floor",
        ),
    ],
)
def test_what_an_effect_lacks_is_said(what, told):
    effect = effects()[what.pop("effect", "windage")]
    known = {"fall": 60.0, "share": 0.0, "size": 2.0, "quiet": 0.0, **what}
    score = Score(Candidate(effect, ()), price=15.0, step={}, moves={}, **known)
    assert score.shortfall == told
    assert score.passes == (
        told == "refitted, it does not hold on captures held out, or may be zero"
    )


def test_windage_is_found_with_its_size():
    def drag(omega, _):
        return 0.03 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    rungs = search(segments, fitted(segments), LIBRARY)
    assert rungs[-1].added == ("windage",)
    assert rungs[-1].fitted.values["windage.drag_nm"] == pytest.approx(0.03, rel=0.05)


def test_two_effects_are_found_whatever_their_order():
    def drag(omega, theta):
        return 0.02 * np.sign(omega) + 0.02 * np.sin(theta + 0.4)

    segments = (with_drag(drag), with_drag(drag, 6))
    rungs = search(segments, fitted(segments), LIBRARY)
    assert set(rungs[-1].added) == {"coulomb_friction", "unbalance"}
    values = rungs[-1].fitted.values
    assert np.hypot(values["unbalance.sin_nm"], values["unbalance.cos_nm"]) == pytest.approx(
        0.02, rel=0.03
    )


def test_a_fits_own_columns_are_made_where_it_stands():
    """Those of candidates may stay from the rung before, 3 % of ψ away."""
    segments = (log(noise=1.0),)
    here = fitted(segments)
    away = replace(here, values={**here.values, "psi_wb": 1.03 * here.values["psi_wb"]})
    offered = candidates(LIBRARY, here)
    before = widened(segments, away, offered)
    around, fresh = widened(segments, here, offered, before), widened(segments, here, offered)
    own = len(own_columns(here.model))
    # how many columns are projected at a time is a matter of rounding on some processors
    off = np.abs(around.matrix[:, :own] - fresh.matrix[:, :own]).max(axis=0)
    assert (off <= 1e-13 * np.abs(fresh.matrix[:, :own]).max(axis=0)).all()
    assert not np.allclose(around.matrix[:, :own], before.matrix[:, :own], rtol=1e-3, atol=0.0)
    kept, made = (s.matrix[:, own:] / s.whiten[:, None] for s in (around, before))
    assert kept == pytest.approx(made, rel=1e-9, abs=1e-12 * np.abs(made).max())


def test_beside_an_effect_of_its_kind_another_must_stand_for_more_than_its_error():
    """A twentieth of what windage does, window by window, joins the floor for a drag only."""

    def drag(omega, _):
        return 0.03 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    last = search(segments, fitted(segments), LIBRARY)[-1]
    (windage,) = last.fitted.model.effects
    doubt = _doubt(segments, last.fitted, last.around, (windage,))
    omega = np.gradient(log().recorded["theta_mech_rad"], 5e-5)
    place = last.around.labels.index((0, "torque_shaft_nm", 0))
    mine = last.around.group == place
    plain = segments[0].weak.project(drag(omega, 0.0)[None])[0, :, 0]
    wrong = 0.05 * np.sqrt(np.mean(plain[last.around.window[mine]] ** 2))
    noise = np.mean(last.around.whiten[mine] ** -2.0)
    assert doubt[place] == pytest.approx(noise / (noise + wrong**2), rel=0.1)
    assert doubt[place] < 0.9
    assert doubt[last.around.labels.index((0, "vd_v", 0))] == 1.0
    delay = effects()["sample_delay"]
    assert _kin(effects()["iron_eddy"], (windage, delay)) == [windage]
    assert _kin(delay, (windage, delay)) == []
    assert (_doubt(segments, last.fitted, last.around, ()) == 1.0).all()


def test_a_drag_of_the_wrong_sign_is_no_friction():
    """Windage that pushes is not offered: physics has no such effect."""

    def drag(omega, _):
        return -0.03 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    start = fitted(segments)
    offered = candidates(LIBRARY, start)
    scores = score_all(widened(segments, start, offered), start, offered)
    assert "windage" not in {s.candidate.effect.name for s in scores if s.passes}


@pytest.mark.parametrize("off", [0.95, 1.03])
def test_an_unexplained_torque_does_not_move_the_flux(off):
    """Noise weights alone would trade ψ for the torque equation's error.

    With no gain stated, ψ is known as the voltmeter reads it; the gains stay within 3 of their u.
    """

    def drag(omega, _):
        return 0.3 * np.tanh(omega / 20.0) ** 3

    segments = (with_drag(drag), with_drag(drag, 6))
    found = fitted(segments, psi_wb=off * BASE["psi_wb"])
    read = found.values["psi_wb"] * (1.0 + found.values["gain_voltage"])
    assert read == pytest.approx(BASE["psi_wb"], rel=2e-4)
    priors = found.model.priors()
    for name in ("gain_current", "gain_voltage", "gain_torque"):
        assert abs(found.values[name]) < 3.0 * priors[name][1]


def test_a_capture_left_out_is_predicted_from_the_others():
    """As a fit to the others alone predicts it, which is not as the fit to all of them has it."""
    segments = tuple(log(noise=1.0, seed=n) for n in (5, 6, 7))
    start = fitted(segments)
    around = system(segments, start)
    held = leave_out(around, len(own_columns(start.model)))
    assert np.isfinite(held.residual).all()
    in_sample = np.sqrt(np.mean((around.residual / around.soft) ** 2))
    assert in_sample < held.total < 1.2
    capture = np.array([number for number, _, _ in around.labels])[around.group]
    for number in range(3):
        others = [n for n in range(3) if n != number]
        less = replace(start, sigma=tuple(start.sigma[n] for n in others))
        alone = gauss_newton([segments[n] for n in others], less)[0]
        told = system(segments, replace(start, values=alone.values)).residual[capture == number]
        assert held.residual[capture == number] == pytest.approx(told, abs=1e-3)
        assert np.abs(told - around.residual[capture == number]).max() > 0.1


def test_one_capture_alone_has_the_error_of_its_fit_and_says_so():
    start = fitted((log(noise=1.0),))
    around = system((log(noise=1.0),), start)
    held = leave_out(around, len(own_columns(start.model)))
    assert not np.isfinite(held.residual).any()
    rms = np.sqrt(np.mean((around.residual / around.soft) ** 2))
    assert held.total == pytest.approx(rms, rel=1e-12)
    assert "of the fit" in held.notes[0]
    two = tuple(log(noise=1.0, seed=n) for n in (5, 6))
    assert leave_out(system(two, fitted(two)), len(own_columns(start.model))).notes == ()


def test_zero_of_an_effect_takes_the_trial_shape():
    model = Model(machine(), ())
    values = zero(effects()["stribeck"], model)
    assert values["stribeck.excess_nm"] == 0.0
    assert values["stribeck.speed_rad_s"] == pytest.approx(0.004 * 250.0)


def test_what_is_asked_for_is_looked_for_at_all_its_trial_shapes():
    """From the first of them, 1 rad/s, a bump of 20 rad/s is out of sight."""

    def drag(omega, _):
        return np.sign(omega) * (0.02 + 0.03 * np.exp(-((omega / 20.0) ** 2)))

    segments = (with_drag(drag), with_drag(drag, 6))
    asked = tuple(effects()[name] for name in ("coulomb_friction", "stribeck"))
    found = fit_of(segments, Model(machine(), asked)).fitted.values
    assert found["stribeck.speed_rad_s"] == pytest.approx(20.0, rel=0.05)
    assert found["stribeck.excess_nm"] == pytest.approx(0.03, rel=0.05)
    assert found["coulomb_friction.torque_nm"] == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize(("other", "expected"), [(1.0, 1.0), (1000.0, 0.002)])
def test_an_effect_helps_by_its_share_of_power_not_of_groups(other, expected):
    """One capture of two comes to its floor from χ²/n = 3, the other stays where it is.

    By logarithms, that would be an eighth of all misfit beside a capture at 1000.
    """
    effect, model = effects()["windage"], Model(machine(), ())
    (column,) = effect_columns(effect, model)
    random = np.random.default_rng(4)
    shape = np.concatenate([np.sqrt(2.0) * random.choice([-1.0, 1.0], 100), np.zeros(100)])
    noise = random.choice([-1.0, 1.0], 200)
    around = System(
        columns=(*own_columns(model), column),
        residual=noise * np.repeat([1.0, np.sqrt(other)], 100) - shape,
        matrix=np.column_stack([np.zeros((200, len(own_columns(model)))), shape / 0.1]),
        group=np.repeat([0, 1], 100),
        window=np.tile(np.arange(100), 2),
        unit=np.ones(200),
        soft=np.ones(200),
        whiten=np.ones(200),
        labels=((0, "torque_shaft_nm", 0), (1, "torque_shaft_nm", 0)),
        penalty=np.zeros(1 + len(own_columns(model))),
        pull=np.zeros(1 + len(own_columns(model))),
        around=Fitted(model, dict(BASE), (), BASE),
        tests=("drive", "drive"),
        made_at=BASE,
    )
    (score,) = score_all(around, around.around, [Candidate(effect, (column,))])
    assert score.fall > score.price
    assert score.share == pytest.approx(expected, abs=0.2 * expected)


@pytest.mark.parametrize(("after", "kept"), [(9.5, 1), (8.5, 1), (5.0, 2)])
def test_beside_an_unknown_a_name_must_take_a_fifth_of_the_error(after, kept):
    segments = tuple(with_drag(lambda _, theta: 0.3 * np.cos(3.0 * theta), n) for n in (5, 6))
    (first,) = search(segments, fitted(segments), {})
    second = replace(first, added=("windage",))
    totals = [HeldOut(first.around.residual, total) for total in (10.0, after)]
    rungs, left = trusted(segments, (first, second), totals)
    assert len(rungs) == kept
    assert {one.signal for one in left} >= {"torque_shaft_nm"}


@pytest.mark.parametrize(("lag_s", "anew"), [(2e-3, True), (1e-6, False)])
def test_floors_are_made_anew_where_undoing_a_lag_brings_noise(lag_s, anew):
    segments = (log(noise=1.0), log(noise=1.0, seed=6))
    before = fitted(segments)
    lagging = replace(
        before,
        model=before.model.with_effects(effects()["torque_lag"]),
        values={**before.values, "torque_lag.lag_s": lag_s, "torque_lag.late": 0.0},
    )
    after = _floored_anew(segments, lagging)
    assert (after.sigma is not before.sigma) is anew
    assert bool(after.sigma[0][-1] > 2.0 * before.sigma[0][-1]) is anew


def test_an_unknown_drag_is_told_by_its_variable_and_curve():
    """An eddy-current brake, in no library: peak 0.2 N·m at 40 rad/s, falling beyond."""

    def drag(omega, _):
        return 0.4 * (omega / 40.0) / (1.0 + (omega / 40.0) ** 2)

    segments = (with_drag(drag), with_drag(drag, 6))
    start = fitted(segments)
    assert remainder(system(segments, start), segments, system(segments, start).residual)
    sketch, gain = unknown_structure(segments, start, ["torque_shaft_nm"])
    assert gain > 100.0
    assert sketch.signal == "torque_shaft_nm"
    assert sketch.variables == ("omega_mech_rad_s",)
    assert {unit for _, _, unit in sketch.sketch} == {"N·m"}


def test_a_rival_is_told_where_the_captures_cannot_part_them():
    """Two names of one formula are one class; friction of another shape is not in it."""
    twin = replace(effects()["windage"], name="brake")
    library = {**LIBRARY, "brake": twin}

    def drag(omega, _):
        return 0.03 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    last = search(segments, fitted(segments), library)[-1]
    assert last.added in {("windage",), ("brake",)}
    offered = candidates(library, last.fitted)
    rivals = rivals_of(last.added[0], last.fitted, last.around, offered, segments)
    assert set(rivals) == {"windage", "brake"} - set(last.added)


def test_a_rival_is_told_whatever_size_it_comes_out_at():
    """That it would be too small to matter does not part it from what it is confused with."""
    twin = replace(_asking_for(0.1)["windage"], name="brake")
    segments = (with_drag(_curved(0.03)), with_drag(_curved(0.03), 6))
    fit = search(segments, fitted(segments), LIBRARY)[-1].fitted
    assert [effect.name for effect in fit.model.effects] == ["windage"]
    offered = candidates({**LIBRARY, "brake": twin}, fit)
    around = widened(segments, fit, offered)
    assert rivals_of("windage", fit, around, offered, segments) == ("brake",)


@pytest.mark.parametrize("told", ["brake", "windage", None])
def test_effects_that_share_a_closer_look_are_told_apart_by_it(told):
    """Two forms that are one: the look's word counts, and without it each is the other's rival."""

    def look(wholes, q):
        assert set(q) == {"drag_nm"}
        return None if told is None else Told(told, {"drag_nm": (0.029, 0.001)})

    windage = replace(LIBRARY["windage"], closer=look)
    library = {**LIBRARY, "windage": windage, "brake": replace(windage, name="brake")}

    def drag(omega, _):
        return 0.03 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    last = search(segments, fitted(segments), library)[-1]
    assert len(last.added) == 1
    name = last.added[0]
    offered = candidates(library, last.fitted)
    rivals = rivals_of(name, last.fitted, last.around, offered, segments)
    if told is None:
        assert set(rivals) == {"windage", "brake"} - {name}
        return
    assert (name, rivals) == (told, ())
    assert last.fitted.values[f"{told}.drag_nm"] == pytest.approx(0.03, rel=0.05)


def test_an_effect_is_material_by_its_amplitude_and_by_shapes_that_have_a_least():
    """A coupling that hardly twists is none; a sign of a shape without a least says nothing."""
    library = effects()

    def judged(name: str, **values: float) -> bool:
        full = {f"{name}.{k}": v for k, v in values.items()}
        return material(Fitted(Model(machine(), (library[name],)), full, (), full), library[name])

    rigid = {"damping_s": 0.0, "between": 0.0}
    assert judged("compliance", share=0.3, twist_rad=0.005, **rigid)
    assert not judged("compliance", share=0.3, twist_rad=1e-4, **rigid)
    assert not judged("compliance", share=0.01, twist_rad=0.005, **rigid)
    assert judged("torque_lag", lag_s=1e-3, late=-0.4)


@pytest.mark.parametrize("start", [1e-13, -1e-13])
def test_viscous_friction_comes_back_from_next_to_nothing(start):
    """A rough fit may leave it there; steps of its own size then held it, and the equation of the
    coasting shaft was given up.
    """
    segments = (log(noise=1.0), log(noise=1.0, seed=6))
    model = Model(machine(), ())
    near = Fitted(model, {**BASE, "b_nm_s_rad": start}, floors(segments, model, BASE), BASE)
    found = gauss_newton(segments, near)[0]
    assert found.values["b_nm_s_rad"] == pytest.approx(BASE["b_nm_s_rad"], rel=0.05)


@pytest.mark.parametrize("share", [0.015, 0.1, 8.0])
def test_inertia_comes_back_from_where_a_missing_effect_left_it(share):
    """A step of its own size would not reach, and a floor that counts T / J by the fit's own J
    would make it well worth to stay: a coasting shaft may then do what it likes.
    """
    segments = (log(noise=1.0), coasting(), log(noise=1.0, seed=6))
    model = Model(machine(), ())
    near = Fitted(model, dict(BASE), floors(segments, model, BASE), BASE)
    lost = {**BASE, "j_kgm2": share * BASE["j_kgm2"], "b_nm_s_rad": share * BASE["b_nm_s_rad"]}
    found = gauss_newton(segments, replace(near, values=lost))[0]
    assert found.values["j_kgm2"] == pytest.approx(BASE["j_kgm2"], rel=0.01)
    assert found.values["b_nm_s_rad"] == pytest.approx(BASE["b_nm_s_rad"], rel=0.05)


def test_reading_errors_do_not_grow_while_a_fit_makes_the_inertia_small():
    shaft = coasting()
    model = Model(machine(), ())
    sigma = floors((shaft,), model, BASE)
    light = {**BASE, "j_kgm2": 0.01 * BASE["j_kgm2"]}
    around = [system((shaft,), Fitted(model, v, sigma, BASE)) for v in (BASE, light)]
    assert around[1].whiten == pytest.approx(around[0].whiten)
