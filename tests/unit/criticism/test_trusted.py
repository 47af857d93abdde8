"""What is believed of a ladder: names, and whether they explain what the captures show."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.ranking import _share_of_fall, ranked
from pipeline.criticism.regression.columns import Column
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import remainder
from pipeline.criticism.regression.identifiability import (
    least_of_several,
    significantly_nonzero,
    together_nonzero,
)
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system, model_columns
from pipeline.criticism.search import Ladder, ladder_from
from pipeline.criticism.selection.acceptance import _improves_held_out, is_determined
from pipeline.criticism.selection.candidates import Candidate
from pipeline.criticism.selection.refit import refitted
from pipeline.criticism.selection.requested_model import BaseFit
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.stepwise import LadderStep, search
from pipeline.criticism.selection.truncation import contradiction, explained, truncated
from pipeline.records.diagnosis import Remainder
from tests.unit.criticism.machines import BASE, fitted, log, machine, with_drag


def missing_by(**reduced_chi2):
    """A step around which signals have these χ²/n in a hundred samples each, and no columns."""
    model = Model(machine(), ())
    none = np.zeros(len(model_columns(model)))
    system = LinearSystem(
        columns=tuple(model_columns(model)),
        residual=np.repeat(np.sqrt(list(reduced_chi2.values())), 100),
        matrix=np.zeros((100 * len(reduced_chi2), none.size)),
        group=np.repeat(np.arange(len(reduced_chi2)), 100),
        window=np.tile(np.arange(100), len(reduced_chi2)),
        unit=np.ones(100 * len(reduced_chi2)),
        noise_ratio=np.ones(100 * len(reduced_chi2)),
        row_weight=np.ones(100 * len(reduced_chi2)),
        labels=tuple((0, name, 0) for name in reduced_chi2),
        prior_precision=none,
        prior_gradient=none,
        fit=Fit((log(),) * 3, model, dict(BASE), (np.ones(len(reduced_chi2)),), BASE),
        model_column_count=none.size,
        made_at={},
    )
    return LadderStep((), system, ())


@pytest.fixture
def of_their_forms(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is left may be what the forms of the effects found are wrong by."""
    place = "pipeline.criticism.selection.truncation._is_of_their_forms"
    monkeypatch.setattr(place, lambda *_: True)


@pytest.mark.parametrize(("after", "kept"), [(5.5, 2), (4.1, 2), (3.9, 3)])
@pytest.mark.usefixtures("of_their_forms")
def test_a_further_effect_must_not_predict_worse_while_something_is_left(after, kept, monkeypatch):
    steps = tuple(missing_by(torque_shaft_nm=q) for q in (1e6, 20.0, 10.0))
    over = (Remainder("one", "torque_shaft_nm", 0, 9.0, 1.0),)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: over)
    totals = [HeldOut(steps[0].system.residual, total) for total in (10.0, 5.0, after)]
    assert len(truncated(steps, totals)[0]) == kept


@pytest.mark.parametrize(("after", "kept"), [(9.5, 1), (4.0, 2)])
def test_what_leaves_no_remainder_must_predict_as_well(after, kept, monkeypatch):
    """A thermometer 8 K off under load: a dead time took every remainder, and 12 % of what other
    captures predict.
    """
    steps = missing_by(vq_v=50.0), missing_by(vq_v=1.0)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: ())
    totals = [HeldOut(steps[0].system.residual, total) for total in (10.0, after)]
    assert len(truncated(steps, totals)[0]) == kept


@pytest.mark.parametrize(
    ("meter_rise", "observed", "kept"), [(0.0, True, 1), (0.3, True, 2), (0.0, False, 2)]
)
def test_what_captures_speak_against_is_no_name_beside_an_unknown(
    meter_rise, observed, kept, monkeypatch
):
    """A supply that sags with power looks like a resistance that grows with speed; but a meter of a
    higher frequency than any drive's would show that too, where there is one.
    """
    skin = effects()["skin_effect"]
    first = missing_by(vq_v=1e4)
    model = first.fit.model.with_effects(skin)
    columns = model_columns(model)
    matrix = np.zeros((100, len(columns)))
    matrix[:, [c.name == "skin_effect.meter_rise" for c in columns]] = float(observed)
    found = {"rise": 0.5, "meter_rise": meter_rise, "inner": 0.0, "bend": 0.0}
    values = {**BASE, **{f"skin_effect.{name}": value for name, value in found.items()}}
    step = missing_by(vq_v=1e3)
    fit = Fit((log(),), model, values, (), BASE)
    system = replace(
        step.system, columns=tuple(columns), matrix=matrix, fit=fit, model_column_count=len(columns)
    )
    second = LadderStep(("skin_effect",), system, ())
    over = (Remainder("one", "vq_v", 0, 9.0, 1.0),)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: over)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.explained", lambda *_: False)
    held = [HeldOut(first.system.residual, total) for total in (10.0, 5.0)]
    assert len(truncated((first, second), held)[0]) == kept
    assert ("meter_rise of 0" in contradiction(second)) is (kept == 1)
    found, totals = (first, second), iter(held)
    monkeypatch.setattr("pipeline.criticism.search.search", lambda *_: found)
    monkeypatch.setattr("pipeline.criticism.search.leave_out", lambda *_: next(totals))
    monkeypatch.setattr("pipeline.criticism.search.in_common", lambda _, alone: list(alone))
    cut = ladder_from(BaseFit(first.system, ()), {}).cut
    assert list(cut) == ["skin_effect"] * (kept == 1)
    score = Score(Candidate(skin, ()), 50.0, 10.0, {}, {}, 1.0, 2.0, policy=DEFAULT.selection)
    ladder = Ladder(
        BaseFit(first.system, ()), (replace(first, scores=(score,)),), held[:1], (), cut
    )
    (only,) = ranked(ladder, (), {})
    assert ("contradict" in only.shortfall) is (kept == 1)


def with_waves(*reduced_chi2: float) -> LadderStep:
    """A step that misses the torque by these χ²/n at the orders 0, 7 and 84 of a turn."""
    names = ("plain", "seventh", "cogging")
    step = missing_by(**dict(zip(names, reduced_chi2, strict=True)))
    labels = tuple((0, "torque_shaft_nm", order) for order in (0, 7, 84))
    return replace(step, system=replace(step.system, labels=labels))


@pytest.mark.parametrize(
    ("left", "kept"), [((1e6, 0.5, 0.5), 2), ((1e6, 0.5, 20.0), 1), ((1e6, 20.0, 0.5), 1)]
)
def test_what_clears_all_waves_is_no_guess_beside_an_unknown(left, kept, monkeypatch):
    """Cogging beside a brake of nobody's library, which is nearly all of the error."""
    steps = with_waves(1e6, 20.0, 5e3), with_waves(*left)
    over = (Remainder("one", "torque_shaft_nm", 0, 9.0, 1.0),)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: over)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.explained", lambda *_: False)
    held = [HeldOut(steps[0].system.residual, total) for total in (97.0, 98.0)]
    assert len(truncated(steps, held)[0]) == kept


@pytest.mark.parametrize(("delay_s", "kept"), [(5e-6, 2), (-5e-6, 1)])
def test_nothing_rare_is_named_for_its_own_side_beside_an_unknown(delay_s, kept, monkeypatch):
    """A voltage that is logged after it acted, beside an encoder that sits loose."""
    steps = with_waves(1e6, 20.0, 5e3), with_waves(1e6, 0.5, 0.5)
    fit = steps[1].fit
    values = {"sample_delay.delay_s": delay_s, "sample_delay.of_speed": 0.0}
    model = fit.model.with_effects(effects()["sample_delay"])
    late = replace(fit, model=model, values={**fit.values, **values})
    added = LadderStep(("sample_delay",), replace(steps[1].system, fit=late), ())
    over = (Remainder("one", "torque_shaft_nm", 0, 9.0, 1.0),)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: over)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.explained", lambda *_: False)
    held = [HeldOut(steps[0].system.residual, total) for total in (97.0, 98.0)]
    assert len(truncated((steps[0], added), held)[0]) == kept


@pytest.mark.parametrize(("after", "kept"), [(0.5, 2), (20.0, 1)])
def test_waves_that_another_signal_keeps_do_not_make_a_guess_of_what_clears_one(
    after, kept, monkeypatch
):
    """An open winding whose magnet's temperature was not logged, beside cogging in a slow turn."""
    labels = ((0, "torque_shaft_nm", 84), (1, "vd_v", 42))
    steps = [
        replace(step, system=replace(step.system, labels=labels))
        for step in (missing_by(cogging=5e3, winding=1e6), missing_by(cogging=after, winding=1e6))
    ]
    over = (Remainder("one", "vd_v", 42, 9.0, 1.0),)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: over)
    monkeypatch.setattr("pipeline.criticism.selection.truncation.explained", lambda *_: False)
    held = [HeldOut(steps[0].system.residual, total) for total in (97.0, 97.0)]
    assert len(truncated(steps, held)[0]) == kept


@pytest.mark.parametrize(("speed", "said"), [(90.0, False), (3.0, True)])
@pytest.mark.usefixtures("of_their_forms")
def test_what_one_signal_gained_does_not_explain_another(speed, said):
    """An offset of the angle that takes all the torque's error leaves a shaft that coasts too
    short.
    """
    names = ("omega_mech_rad_s", "torque_shaft_nm")
    left = [Remainder("one", name, 0, 9.0, 1.0) for name in names]
    first = missing_by(omega_mech_rad_s=100.0, torque_shaft_nm=1e6)
    last = missing_by(omega_mech_rad_s=speed, torque_shaft_nm=2.0)
    held = [HeldOut(first.system.residual, total) for total in (100.0, 2.0)]
    assert explained((first, last), held, left) is said


@pytest.mark.parametrize(("total", "said"), [(239.7, False), (160.0, False), (110.0, True)])
@pytest.mark.usefixtures("of_their_forms")
def test_what_predicts_no_capture_better_explains_nothing(total, said):
    """From a million floors to a thousand is half of the logarithm, and still a thousand."""
    left = [Remainder("one", "torque_shaft_nm", 0, 9.0, 1.0)]
    first, last = missing_by(torque_shaft_nm=1e6), missing_by(torque_shaft_nm=900.0)
    held = [HeldOut(first.system.residual, one) for one in (244.1, total)]
    assert explained((first, last), held, left) is said


@pytest.mark.parametrize(("wave_nm", "said"), [(0.0, True), (0.002, False)])
def test_what_is_left_where_the_effects_found_do_nothing_is_not_of_their_forms(
    wave_nm: float, said: bool
) -> None:
    """A drag that is windage but for a fortieth, beside waves of the angle, which it has not."""
    dragged = with_drag(
        lambda omega, theta: (
            3.0 * omega * np.abs(omega) / 250.0**2
            + 0.008 * np.exp(-(((omega - 80.0) / 20.0) ** 2))
            + wave_nm * np.sin(14.0 * theta)
        )
    )
    fit = fitted([dragged])
    windage = effects()["windage"]
    model = fit.model.with_effects(windage)
    begun = replace(fit, model=model, values={**zero(windage, model), **fit.values})
    first, last = linear_system(fit), gauss_newton(begun)
    steps = LadderStep((), first, ()), LadderStep(("windage",), last, ())
    left = remainder(last)
    assert {one.order for one in left} == ({0, 14} if wave_nm else {0})
    held = [HeldOut(first.residual, total) for total in (100.0, 2.0)]
    assert explained(steps, held, left) is said


@pytest.mark.parametrize(("total", "said"), [(3.1, False), (1.3, True)])
def test_a_name_that_leaves_most_of_the_error_explains_it_nowhere(total, said):
    """However small each signal's part is for the machine; a floor is good to twice its power."""
    first, last = (missing_by(torque_shaft_nm=q) for q in (20.0, 9.0))
    held = [HeldOut(first.system.residual, one) for one in (5.2 if total > 2.0 else 1.5, total)]
    assert explained((first, last), held, ()) is said
    assert explained((first,), held, ())


@pytest.mark.parametrize(
    ("name", "friction", "left", "said"),
    [
        ("windage", -1e-3, True, False),
        ("windage", -1e-6, True, True),
        ("windage", 1e-3, True, True),
        ("windage", -1e-3, False, True),
        ("dead_time", -1e-3, True, True),
    ],
)
@pytest.mark.usefixtures("of_their_forms")
def test_a_drag_beside_a_friction_that_drives_explains_nothing(name, friction, left, said):
    """Eddy currents for a drag that falls with speed leave the difference to the viscous friction,
    here known to a hundredth of what it is: below zero, and by more than its uncertainty. It is no
    evidence against an effect of the winding.
    """
    first, last = (missing_by(torque_shaft_nm=q) for q in (1e4, 4.0))
    matrix = np.zeros_like(last.system.matrix)
    matrix[:, [c.name == "b_nm_s_rad" for c in last.system.columns]] = 1e4
    found = effects()[name]
    model = last.fit.model.with_effects(found)
    values = {**last.fit.values, **zero(found, model), "b_nm_s_rad": friction}
    fit = replace(last.fit, model=model, values=values)
    last = LadderStep((name,), replace(last.system, matrix=matrix, fit=fit), ())
    held = [HeldOut(first.system.residual, one) for one in (100.0, 1.3)]
    over = [Remainder("one", "torque_shaft_nm", 0, 4.0, 1.0)] if left else []
    assert explained((first, last), held, over) is said
    drives = name == "windage" and friction == -1e-3
    assert ("which drives the shaft" in contradiction(last)) is drives


@pytest.mark.parametrize(("doubt", "kept"), [(1.0, True), (0.3, False)])
def test_what_a_doubted_form_brings_below_the_floor_was_not_below_it(doubt, kept):
    """χ²/n of 3 that forms which are a little wrong may have made: neither a signal below its floor
    nor one above says that an effect is there.
    """
    wide, tried = (missing_by(torque_shaft_nm=q).system for q in (3.0, 0.2))
    after = tried.reduced_chi2(tried.residual)
    doubts = np.array([doubt]), np.array([doubt])
    assert _improves_held_out(wide, np.array([3.0]), tried, after, (10.0, 10.0), doubts) is kept


@pytest.mark.parametrize(
    ("name", "values", "apart", "sure"),
    [
        ("windage", {"drag_nm": 0.1}, {"drag_nm": 0.04}, True),
        ("windage", {"drag_nm": 0.1}, {"drag_nm": 0.06}, False),
        ("bemf_harmonics", {"q6_sin": 1e-4, "d12_sin": 1e-2}, {"d12_sin": 6e-3}, False),
        ("bemf_harmonics", {"q6_sin": 1e-4, "d12_sin": 1e-2}, {"d12_sin": 4.4e-3}, False),
        ("bemf_harmonics", {"q6_sin": 1e-4, "d12_sin": 1e-2}, {"d12_sin": 3e-3}, True),
        ("bemf_harmonics", {"q6_sin": 1e-3, "d12_sin": 1e-2}, {"d12_sin": 6e-3}, True),
        ("current_gain", {"mean": 0.05, "cosine": 0.01}, {"cosine": 6e-3}, False),
        ("presliding", {"torque_nm": 0.1, "travel_rad": 1e-3}, {"travel_rad": 1e-2}, True),
        ("compliance", {"share": 0.1, "twist_rad": 1e-3}, {"share": 0.04}, True),
        ("compliance", {"share": 0.1, "twist_rad": 1e-3}, {"share": 0.06}, False),
        ("compliance", {"share": 0.1, "twist_rad": 1e-3}, {"twist_rad": 1e-3}, False),
    ],
)
def test_an_effect_is_named_only_where_it_is_surely_there(name, values, apart, sure, monkeypatch):
    """Two captures, without the one or the other of which the parameters move so far."""
    plain = missing_by(torque_shaft_nm=1.0).system
    full = {f"{name}.{key}": value for key, value in values.items()}
    model = Model(machine(), (effects()[name],))
    fit = Fit((log(),) * 3, model, {**BASE, **zero(effects()[name], model), **full}, (), {})
    random = np.random.default_rng(4)
    system = replace(
        plain,
        columns=tuple(Column(key, 1e-3) for key in full),
        matrix=random.normal(0.0, 1e5, (plain.size, len(full))),
        prior_precision=np.zeros(len(full)),
        prior_gradient=np.zeros(len(full)),
        fit=fit,
        model_column_count=len(full),
    )
    step = np.array([apart.get(key, 0.0) for key in values])
    held = HeldOut(plain.residual, 1.0, {0: step, 1: -step})
    monkeypatch.setattr("pipeline.criticism.selection.acceptance.leave_out", lambda _: held)
    assert is_determined(system, plain) is sure


@pytest.mark.parametrize("count", [1, 4, 8])
def test_the_largest_of_several_is_by_chance_no_further_from_zero_than_one_alone(count):
    least = least_of_several(2.0, count)
    largest = np.abs(np.random.default_rng(5).standard_normal((200_000, count))).max(axis=1)
    assert np.mean(largest > least) == pytest.approx(math.erfc(2.0 / math.sqrt(2.0)), rel=0.04)


def test_what_all_current_sensors_share_names_no_difference_of_them(monkeypatch):
    """Not even where it takes most of what is left: that is a gain, of which there are others."""
    plain = missing_by(torque_shaft_nm=1.0).system
    gain = effects()["current_gain"]
    model = Model(machine(), (gain,))
    values = {**BASE, **zero(gain, model), "current_gain.mean": 0.05}
    system = replace(
        plain,
        columns=(Column("current_gain.mean", 1e-3),),
        matrix=np.random.default_rng(4).normal(0.0, 1e5, (plain.size, 1)),
        prior_precision=np.zeros(1),
        prior_gradient=np.zeros(1),
        fit=Fit((log(),) * 3, model, values, (), {}),
        model_column_count=1,
    )
    held = HeldOut(plain.residual, 1.0, {})
    monkeypatch.setattr("pipeline.criticism.selection.acceptance.leave_out", lambda _: held)
    monkeypatch.setattr("pipeline.criticism.selection.acceptance._takes_most", lambda *_: True)
    assert not is_determined(system, plain)


@pytest.mark.parametrize(("damping_nm", "sure"), [(0.1, True), (-0.1, False)])
def test_amplitudes_that_stand_for_one_another_are_surely_there_together(damping_nm, sure):
    """Friction and damping of bristles, of which captures know the sum to 0.02 and the difference
    to 1: neither is known, and both are not zero, unless they are no more than the difference.
    """
    plain = missing_by(torque_shaft_nm=1.0).system
    values = {"torque_nm": 0.1, "damping_nm": damping_nm, "travel_rad": 1e-3}
    full = {f"presliding.{key}": value for key, value in values.items()}
    model = Model(machine(), (effects()["presliding"],))
    fit = Fit((log(),) * 3, model, {**BASE, **full}, (), {})
    rows = np.zeros((plain.size, 3))
    rows[0], rows[1], rows[2] = (50.0, 50.0, 0.0), (1.0, -1.0, 0.0), (0.0, 0.0, 1e5)
    system = replace(
        plain,
        columns=tuple(Column(key, 1e-3) for key in full),
        matrix=rows,
        prior_precision=np.zeros(3),
        prior_gradient=np.zeros(3),
        residual=np.zeros(plain.size),
        fit=fit,
        model_column_count=3,
    )
    held = HeldOut(plain.residual, 1.0, {0: np.zeros(3), 1: np.zeros(3)})
    amplitudes = ["presliding.torque_nm", "presliding.damping_nm"]
    assert not significantly_nonzero(system, held, 2.0) & set(amplitudes)
    assert together_nonzero(system, held, amplitudes, 2.0) is sure


@pytest.mark.parametrize(
    ("foreseen", "near", "begun", "end"),
    [(50.0, 20.0, [0.4], 50.0), (95.0, 60.0, [0.4, 0.3], 60.0), (95.0, 99.0, [0.4, 0.3], 95.0)],
)
def test_a_refit_begins_again_where_the_tangent_goes_astray(
    foreseen, near, begun, end, monkeypatch
):
    """From where the others are, if what the score foresees does not pay its price of 10."""
    windage, asked = effects()["windage"], []
    score = Score(
        Candidate(windage, ()),
        30.0,
        10.0,
        {"windage.drag_nm": 0.1},
        {"r_ohm": 0.1},
        1.0,
        2.0,
        policy=DEFAULT.selection,
    )

    def gauss_newton(start, before, most=np.inf):
        asked.append(round(start.values["r_ohm"], 6))
        deviance = foreseen if asked[-1] == 0.4 else near
        return replace(before, fit=start, residual=np.full(before.size, deviance))

    monkeypatch.setattr("pipeline.criticism.selection.refit.gauss_newton", gauss_newton)
    monkeypatch.setattr(LinearSystem, "deviance", property(lambda one: float(one.residual[0])))
    fit = Fit((log(),), Model(machine(), ()), {**BASE, "r_ohm": 0.3}, (), BASE)
    wide = replace(missing_by(torque_shaft_nm=100.0**2).system, fit=fit)
    assert refitted(wide, score).deviance == end
    assert asked == begun


def test_an_effect_s_drop_is_that_of_the_step_it_came_with():
    """A removal on the way leaves steps and names of different counts."""
    steps = [
        LadderStep(added, None, ())  # type: ignore[arg-type]
        for added in ((), ("cogging",), ("saturation",), ("saturation", "windage"))
    ]
    held = [HeldOut(np.zeros(1), total) for total in (math.e**4, math.e**3, math.e, math.e**1.5)]
    assert _share_of_fall(steps, held, "saturation") == pytest.approx(2.0 / 2.5)
    assert _share_of_fall(steps, held, "windage") == 0.0


@pytest.mark.parametrize(("after", "kept"), [(9.5, 1), (8.5, 1), (5.0, 2)])
def test_beside_an_unknown_a_name_must_take_a_fifth_of_the_error(after, kept):
    segments = tuple(with_drag(lambda _, theta: 0.3 * np.cos(3.0 * theta), n) for n in (5, 6))
    (first,) = search(fitted(segments), {})
    second = replace(first, added=("windage",))
    totals = [HeldOut(first.system.residual, total) for total in (10.0, after)]
    steps, left = truncated((first, second), totals)
    assert len(steps) == kept
    assert {one.signal for one in left} >= {"torque_shaft_nm"}


@pytest.mark.parametrize(
    ("torque", "carried", "kept"), [(4.0, False, 2), (8e3, False, 1), (4.0, True, 1)]
)
def test_a_misfit_of_the_voltage_is_no_evidence_against_a_friction(
    torque, carried, kept, monkeypatch
):
    """What an inverter leaves in a voltage drowns the gain of a drag in the total, not in its own
    signal; a drag that leaves most of that is a guess all the same, and so is one whose signal is
    never held out, since one capture alone carries it.
    """
    voltage = 1e6
    first = missing_by(vq_v=voltage, torque_shaft_nm=1e4)
    bump = effects()["stribeck"]
    model = first.fit.model.with_effects(bump)
    columns = model_columns(model)
    matrix = np.zeros((200, len(columns)))
    matrix[100:, [c.name.startswith("stribeck.") for c in columns]] = 1.0
    step = missing_by(vq_v=voltage, torque_shaft_nm=torque)
    fit = Fit((log(),), model, {**BASE, **zero(bump, model)}, (), BASE)
    system = replace(
        step.system, columns=tuple(columns), matrix=matrix, fit=fit, model_column_count=len(columns)
    )
    steps = (first, LadderStep(("stribeck",), system, ()))
    over = (
        Remainder("one", "vq_v", 0, voltage, 1.0),
        Remainder("one", "torque_shaft_nm", 0, 9.0, 1.0),
    )
    monkeypatch.setattr("pipeline.criticism.selection.truncation.remainder", lambda *_: over)
    monkeypatch.setattr(
        "pipeline.criticism.selection.truncation.significant_groups",
        lambda one: one.reduced_chi2(one.residual) > 2.0,
    )
    held = [
        HeldOut(
            np.where(carried & (np.arange(200) >= 100), np.nan, one.system.residual),
            math.sqrt(0.5 * (voltage + q)),
        )
        for one, q in zip(steps, (1e4, torque), strict=True)
    ]
    assert len(truncated(steps, held)[0]) == kept
