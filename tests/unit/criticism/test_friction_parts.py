"""What friction constants contain of the iron's drag, and constants less that part."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import pytest

from pipeline.criticism.adequacy import _far_inertia, _in_friction, _of_the_shaft_alone
from pipeline.criticism.library.friction_parts import friction_parts
from pipeline.criticism.library.registry import effects
from pipeline.criticism.parameter import Machine
from pipeline.estimation.estimators.derived import FORMULAS
from pipeline.estimation.estimators.derived_electrical import FORMULAS as ELECTRICAL
from pipeline.records.consistent_constants import FOLLOWING, combined, separated
from pipeline.records.diagnosis import ReportedParameter
from pipeline.records.estimate import Estimate
from pipeline.records.model_verdict import FoundEffect, ModelVerdict
from pipeline.records.uncertainty import type_b

B, DRY = "b_visc_nm_s_rad", "torque_coulomb_nm"
HIGHEST_RAD_S = 400.0
SCALES = {"speed_rad_s": HIGHEST_RAD_S, "period_s": 1e-4, "torque_nm": 2.0}
MACHINE = Machine(4, None, {**SCALES, "current_a": 10.0, "freq_hz": 250.0})
EDDY = {
    "drag_nm": ReportedParameter(0.08, 0.004, "N·m"),
    "parallel": ReportedParameter(1.0, 0.0, "1"),
}


def viscous(value: float, u: float = 1e-6) -> dict[str, Estimate]:
    budget = type_b("current@rig", u)
    return {B: Estimate(B, value, "N·m·s/rad", "measured", "inertia", budget, note="by the drive")}


def lacking(*confused: str) -> ModelVerdict:
    return ModelVerdict("missing", missing={"iron_eddy": FoundEffect(EDDY, "", confused)})


def with_parts(model: ModelVerdict) -> ModelVerdict:
    return replace(model, in_friction=_in_friction(model, effects(None), MACHINE))


def test_eddy_currents_are_viscous_and_hysteresis_is_dry() -> None:
    (part,) = friction_parts(effects(None)["iron_eddy"], EDDY, MACHINE).items()
    assert part == (B, (pytest.approx(0.08 / 400.0), pytest.approx(0.004 / 400.0), "N·m·s/rad"))
    dry = {"drag_nm": ReportedParameter(0.03, 0.001, "N·m")}
    (part,) = friction_parts(effects(None)["iron_hysteresis"], dry, MACHINE).items()
    assert part == (DRY, (pytest.approx(0.03), pytest.approx(0.001), "N·m"))


def test_excess_loss_is_some_of_both() -> None:
    """√x by least squares of c + m x over 0 to 1: m = 4/5, c = 4/15."""
    excess = {"excess_nm": ReportedParameter(0.05, 0.0, "N·m")}
    parts = friction_parts(effects(None)["iron_eddy"], excess, MACHINE)
    assert parts[B].value == pytest.approx(0.8 * 0.05 / 400.0, rel=2e-2)
    assert parts[DRY].value == pytest.approx(4.0 / 15.0 * 0.05, rel=2e-2)


def test_a_constant_less_its_part_has_the_parts_uncertainty() -> None:
    model = with_parts(lacking())
    known = viscous(0.0003)
    less = separated(known, model)[B]
    assert less.number == pytest.approx(0.0001)
    assert less.u == pytest.approx(math.hypot(1e-6, 1e-5))
    assert less.note.startswith("less 0.0002 N·m·s/rad of iron_eddy; ")
    again = combined({B: less}, model)[B]
    assert again.number == pytest.approx(0.0003)
    assert again.budget == known[B].budget


def test_of_a_part_that_another_effect_explains_any_share_is_as_likely() -> None:
    """Uniform from none to all: its mean and its standard deviation (GUM 4.3.7)."""
    less = separated(viscous(0.0003), with_parts(lacking("windage")))[B]
    assert less.number == pytest.approx(0.0002)
    assert less.u == pytest.approx(math.sqrt(1e-12 + 1e-10 + 0.0002**2 / 12.0))


def test_a_part_beyond_the_whole_is_not_taken() -> None:
    model = with_parts(lacking())
    known = viscous(0.0001)
    assert separated(known, model) == known
    assert combined(known, model) == known


def test_other_effects_and_other_constants_stay() -> None:
    windage = {"loss_nm": ReportedParameter(0.1, 0.01, "N·m")}
    model = with_parts(ModelVerdict("missing", missing={"windage": FoundEffect(windage)}))
    assert model.in_friction == {}
    assert separated({}, with_parts(lacking())) == {}
    assert ModelVerdict.of(with_parts(lacking()).document()) == with_parts(lacking())


def test_the_inertia_of_the_rotor_is_less_what_is_beyond_a_coupling() -> None:
    """Of a motor behind a soft coupling that of all that turns was published, six times its own."""
    size = {
        "share": ReportedParameter(0.8, 0.01, "1"),
        "between": ReportedParameter(0.0, 0.0, "1"),
    }
    far = _far_inertia({"compliance": size}, effects(None), [])
    model = ModelVerdict("missing", missing={"compliance": FoundEffect(size)}, far_inertia=far)
    whole = Estimate(
        "j_rotor_kgm2", 1e-3, "kg·m²", "measured", "inertia", type_b("current@rig", 1e-5)
    )
    near = separated({"j_rotor_kgm2": whole}, model)["j_rotor_kgm2"]
    assert near.number == pytest.approx(2e-4)
    assert near.u == pytest.approx(math.hypot(2e-6, 1e-5))
    assert "80 ± 1 % of the inertia" in near.note
    assert ModelVerdict.of(model.document()) == model


@pytest.mark.parametrize("logged", [True, False])
def test_without_a_torque_nothing_shows_the_share_beyond_a_gap(logged) -> None:
    """A gap of 3.6 mrad before two thirds of the inertia was one of 10.3 mrad before a quarter, and
    the rotor's inertia 2.3 times too large at 96 u.
    """
    size = {"share": ReportedParameter(0.25, 0.01, "1")}
    drive = SimpleNamespace(test="drive", recorded={"torque_shaft_nm": ()} if logged else {})
    far = _far_inertia({"backlash": size}, effects(None), [drive])["backlash"]
    assert far == (size["share"] if logged else (0.5, pytest.approx(1.0 / math.sqrt(12.0)), "1"))


@pytest.mark.parametrize(
    ("between", "logged", "taken"), [(1.0, True, False), (-1.0, True, True), (1.0, False, True)]
)
def test_a_transducer_in_the_coupling_sees_no_mass_beyond_it(between, logged, taken) -> None:
    share = ReportedParameter(0.8, 0.01, "1")
    size = {"share": share, "between": ReportedParameter(between, 0.0, "1")}
    drive = SimpleNamespace(test="drive", recorded={"torque_shaft_nm": ()} if logged else {})
    far = _far_inertia({"compliance": size, "windage": {}}, effects(None), [drive])
    assert far == ({"compliance": share} if taken else {})


def dry(value: float | None, u: float = 1e-5) -> Estimate:
    if value is None:
        return Estimate(DRY, None, "N·m", "not_identifiable", "inertia", (), note="bent")
    return Estimate(DRY, value, "N·m", "measured", "inertia", type_b("current@rig", u), note="bent")


def fitted(*confused: str, effects_of: tuple[str, ...] = ("stribeck",)) -> ModelVerdict:
    missing = {name: FoundEffect({}, "", confused) for name in effects_of}
    known = {DRY: ReportedParameter(0.02, 2e-4, "N·m")}
    return ModelVerdict("missing", missing=missing, constants=known)


def test_a_constant_that_lacks_an_effect_is_that_of_the_fit_which_has_it() -> None:
    """T_c beside Stribeck's excess was a fortieth too small and sure to 0.7 %."""
    held = separated({DRY: dry(0.0195)}, fitted())[DRY]
    assert (held.number, held.u) == (0.02, pytest.approx(2e-4))
    assert held.note == "by a fit with stribeck; without, 0.0195 ± 1e-05 N·m; bent"
    filled = separated({DRY: dry(None)}, fitted())[DRY]
    assert (filled.number, filled.status) == (0.02, "measured")


def test_a_constant_in_doubt_is_that_of_the_fit_which_is_sure() -> None:
    """Viscous drag of one sense is open by 18 %, where a fit with direction_friction has 4 %."""
    held = separated({DRY: dry(0.0197, u=5e-4)}, fitted())[DRY]
    assert (held.number, held.u) == (0.02, pytest.approx(2e-4))


def test_a_constant_that_agrees_with_the_fit_stays() -> None:
    near = {DRY: dry(0.0197)}
    assert separated(near, fitted()) == near
    assert separated(near, fitted(effects_of=())) == near


@pytest.mark.parametrize(
    "model",
    [
        replace(fitted(effects_of=()), verdict="adequate"),
        replace(fitted(effects_of=()), verdict="unknown"),
        replace(fitted(), verdict="unknown"),
    ],
)
def test_where_no_effect_says_which_is_right_the_distance_is_in_the_budget(model) -> None:
    """Drives with an encoder that sat loose had T_c +49 % at 4.1 u; the fit of all had +4 %."""
    held = separated({DRY: dry(0.03)}, model)[DRY]
    assert (held.number, held.status) == (0.03, "measured")
    assert held.u == pytest.approx(0.01 / math.sqrt(2.0), rel=1e-3)
    assert "a fit of all captures" in held.note
    assert "has 0.02 ± 0.0002 N·m; bent" in held.note
    assert separated({DRY: dry(None)}, model) == {DRY: dry(None)}


def test_a_constant_that_no_effect_touches_is_never_that_of_the_fit() -> None:
    r = "r_phase_ohm"
    own = {r: Estimate(r, 0.62, "ohm", "measured", "resistance", type_b("c", 1e-3))}
    model = replace(fitted(), constants={r: ReportedParameter(0.65, 1e-3, "ohm")})
    held = separated(own, model)[r]
    assert held.number == 0.62
    assert held.u == pytest.approx(0.03 / math.sqrt(2.0), rel=1e-2)


def test_where_two_effects_tie_a_constant_is_as_unsure_as_they_are_apart() -> None:
    held = separated({DRY: dry(0.0195)}, fitted("windage"))[DRY]
    assert held.number == 0.0195
    assert held.u == pytest.approx(5e-4 / math.sqrt(2.0), rel=1e-2)
    unknown = separated({DRY: dry(None)}, fitted("windage"))[DRY]
    assert not unknown.known


def test_the_inertia_behind_a_transducer_in_the_coupling_is_not_that_of_all_that_turns() -> None:
    """Its estimate is of the motor's side, and the fit's is not: none is held against the other."""
    coupling = {"compliance": {"share": ReportedParameter(0.8, 0.01, "1")}}
    known = {"j_rotor_kgm2": ReportedParameter(1e-3, 1e-6, "kg·m²"), DRY: fitted().constants[DRY]}
    assert set(_of_the_shaft_alone(known, coupling, effects(None))) == {DRY}
    assert set(_of_the_shaft_alone(known, {"windage": {}}, effects(None))) == set(known)


def test_drag_at_no_current_has_the_iron_s_beside_a_constant_of_the_fit() -> None:
    """B of the fit has no iron in it, and a no-load run has."""
    known = {B: ReportedParameter(0.0001, 1e-6, "N·m·s/rad")}
    model = replace(with_parts(lacking()), constants=known)
    held = separated(viscous(0.0005), model)
    assert held[B].number == pytest.approx(0.0001)
    assert combined(held, model)[B].number == pytest.approx(0.0003)


def test_a_time_constant_goes_with_the_inertia_that_is_replaced() -> None:
    inertia, tau = "j_rotor_kgm2", "tau_mech_s"
    known = {
        inertia: Estimate(inertia, 2e-4, "kg·m²", "measured", "inertia", type_b("c", 1e-7)),
        tau: Estimate(tau, 0.02, "s", "derived", "derived", type_b("c", 1e-5)),
    }
    model = replace(fitted(), constants={inertia: ReportedParameter(1e-4, 1e-7, "kg·m²")})
    held = separated(known, model)
    assert held[inertia].number == 1e-4
    assert held[tau].number == pytest.approx(0.01)


def test_what_is_derived_from_a_constant_in_doubt_is_in_doubt() -> None:
    r, tau = "r_phase_ohm", "tau_elec_s"
    known = {
        r: Estimate(r, 0.62, "ohm", "measured", "resistance", type_b("c", 1e-3)),
        tau: Estimate(tau, 2e-3, "s", "derived", "derived_electrical", type_b("l", 1e-6)),
    }
    model = replace(fitted(), constants={r: ReportedParameter(0.65, 1e-3, "ohm")})
    held = separated(known, model)
    assert held[tau].number == 2e-3
    doubt = 0.03 / math.sqrt(2.0) / 0.62 * 2e-3
    assert held[tau].u == pytest.approx(math.hypot(1e-6, doubt))


def test_what_follows_what_is_as_the_estimators_derive_it() -> None:
    derived = {**FORMULAS, **ELECTRICAL}
    for name, powers in FOLLOWING.items():
        of = dict(zip(derived[name].of, derived[name].powers, strict=True))
        assert powers == {one: power for one, power in of.items() if one != "pole_pairs"}


@pytest.mark.parametrize(("touched", "number"), [(True, 4e-4), (False, 4.2e-4)])
def test_an_inductance_that_goes_with_the_locked_angle_is_that_of_the_fit(touched, number) -> None:
    """Steps at one angle of a wave of five per cent were 5 % off and sure to 0.1 %."""
    l_q, ratio = "lq_h", "saliency_ratio"
    known = {
        l_q: Estimate(l_q, 4.2e-4, "H", "measured", "steps", type_b("c", 5e-7)),
        ratio: Estimate(ratio, 2.1, "1", "derived", "derived", type_b("c", 2e-3)),
    }
    words = effects(None)["inductance_harmonics"].touches
    assert set(words) == {"ld_h", l_q}
    constants = {l_q: ReportedParameter(4e-4, 1e-6, "H")}
    model = replace(fitted(), constants=constants, touches=words if touched else {})
    held = separated(known, model)
    assert held[l_q].number == number
    assert held[ratio].number == pytest.approx(2.1 * number / 4.2e-4)
    if touched:
        assert held[ratio].u == pytest.approx(math.hypot(2e-3 * number / 4.2e-4, 2.0 * 1e-6 / 4e-4))
