"""Effects that the captures at hand cannot tell apart."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.effect import Discrimination
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.goodness import significant_groups
from pipeline.criticism.selection.alternatives import alternatives_to
from pipeline.criticism.selection.candidates import candidates, placed, widened
from pipeline.criticism.selection.stepwise import search
from tests.unit.criticism.machines import (
    BASE,
    LIBRARY,
    asking_for,
    curved,
    fitted,
    log,
    machine,
    with_drag,
)


def test_a_rival_is_told_where_the_captures_cannot_part_them():
    """Two names of one formula are one class; friction of another shape is not in it."""
    twin = replace(effects()["windage"], name="brake")
    library = {**LIBRARY, "brake": twin}

    def drag(omega, _):
        return 0.12 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    last = search(fitted(segments), library)[-1]
    assert last.added in {("windage",), ("brake",)}
    offered = candidates(library, last.fit.model)
    others = alternatives_to(last.added[0], last.system, offered)
    assert set(others) == {"windage", "brake"} - set(last.added)


@pytest.mark.parametrize(
    ("rare", "named"),
    [("windage", "brake"), pytest.param("brake", "windage", marks=pytest.mark.slow)],
)
def test_of_two_that_tie_the_one_that_benches_have_is_named(rare, named):
    """A clock that is off by 2 % explains as much as a gain that is, and clocks seldom are."""
    library = {name: replace(effects()["windage"], name=name) for name in ("windage", "brake")}
    library[rare] = replace(library[rare], rare=True)
    segments = (with_drag(curved(0.1)), with_drag(curved(0.1), 6))
    assert search(fitted(segments), library)[-1].added == (named,)


@pytest.mark.parametrize(
    ("rare", "named"),
    [pytest.param("windage", "brake", marks=pytest.mark.slow), ("brake", "windage")],
)
def test_of_two_that_tie_the_one_of_a_usual_size_is_named(rare, named):
    library = {name: replace(effects()["windage"], name=name) for name in ("windage", "brake")}
    (size,) = library[rare].parameters
    library[rare] = replace(library[rare], parameters=(replace(size, rare_below=1.0),))
    segments = (with_drag(curved(0.1)), with_drag(curved(0.1), 6))
    assert search(fitted(segments), library)[-1].added == (named,)


@pytest.mark.slow
def test_a_rival_is_told_whatever_size_it_comes_out_at():
    """That it would be too small to matter does not part it from what it is confused with."""
    twin = replace(asking_for(0.1)["windage"], name="brake")
    segments = (with_drag(curved(0.035)), with_drag(curved(0.035), 6))
    fit = search(fitted(segments), LIBRARY)[-1].fit
    assert [effect.name for effect in fit.model.effects] == ["windage"]
    offered = candidates({**LIBRARY, "brake": twin}, fit.model)
    system = widened(fit, offered)
    assert alternatives_to("windage", system, offered) == ("brake",)


@pytest.mark.parametrize(
    ("less", "named", "others"),
    [
        (0.05, {"constant_load"}, set()),
        (0.02, {"constant_load", "direction_friction"}, {"constant_load", "direction_friction"}),
    ],
)
def test_a_friction_that_would_drive_is_no_name(less, named, others):
    """A load of 50 mN·m looks like a friction that differs by as much, which dry friction of 30
    mN·m forbids: in one sense it would push the shaft.
    """
    names = ("coulomb_friction", "direction_friction", "constant_load")
    library = {name: effects()[name] for name in names}

    def drag(omega, _):
        return 0.03 * np.sign(omega) + less * np.abs(np.sign(omega))

    # of a steady acceleration an inertia looks like a load
    known = {"j_kgm2": (BASE["j_kgm2"], 1e-3 * BASE["j_kgm2"])}
    model = Model(replace(machine(), stated=known), (library["coulomb_friction"],))
    values = {**BASE, **zero(library["coulomb_friction"], model)}
    segments = (with_drag(drag), with_drag(drag, 6))
    begun = Fit(segments, model, values, floors(segments, model, values), values)
    fit = gauss_newton(begun).fit
    last = search(fit, library)[-1]
    (found,) = last.added
    assert found in named
    offered = candidates(library, last.fit.model)
    assert set(alternatives_to(found, last.system, offered)) == others - {found}


@pytest.mark.parametrize(
    "told",
    [
        "brake",
        pytest.param("windage", marks=pytest.mark.slow),
        pytest.param(None, marks=pytest.mark.slow),
    ],
)
def test_effects_that_share_a_closer_look_are_told_apart_by_it(told):
    """Two forms that are one: the look's word counts, and without it each is the other's
    alternative.
    """

    def look(wholes, q):
        assert set(q) == {"drag_nm"}
        return None if told is None else Discrimination(told, {"drag_nm": (0.116, 0.001)})

    windage = replace(LIBRARY["windage"], discriminator=look)
    library = {**LIBRARY, "windage": windage, "brake": replace(windage, name="brake")}

    def drag(omega, _):
        return 0.12 * omega * np.abs(omega) / 250.0**2

    segments = (with_drag(drag), with_drag(drag, 6))
    last = search(fitted(segments), library)[-1]
    assert len(last.added) == 1
    name = last.added[0]
    offered = candidates(library, last.fit.model)
    others = alternatives_to(name, last.system, offered)
    if told is None:
        assert set(others) == {"windage", "brake"} - {name}
        return
    assert (name, others) == (told, ())
    assert last.fit.values[f"{told}.drag_nm"] == pytest.approx(0.12, rel=0.05)


@pytest.mark.parametrize("coupling", [True, False])
def test_what_noise_in_a_speed_loop_looks_like_needs_a_remainder_that_is_reported(coupling):
    """A soft shaft was named in telemetry that hides nothing: below the floors a coupling is none,
    any other effect of the machine is seen there.
    """

    def look(wholes, q):
        return Discrimination("windage", {"drag_nm": (0.034, 0.001)})

    windage = LIBRARY["windage"]
    library = {"windage": replace(windage, discriminator=look) if coupling else windage}

    def drag(omega, _):
        return 0.035 * omega * np.abs(omega) / 250.0**2

    fit = fitted((with_drag(drag), with_drag(drag, 6)))
    assert not significant_groups(search(fit, {})[0].system).any()
    assert search(fit, library)[-1].added == (() if coupling else ("windage",))


def test_candidates_that_a_system_was_not_widened_with_have_no_place() -> None:
    """The end of the tutorial: a diagnosis counted the columns of one candidate too many."""
    fit = fitted([log(noise=1.0)])
    offered = candidates(effects(), fit.model)
    missing = next(one for one in offered if one.effect.name == "windage")
    some = tuple(one for one in offered if one.effect.name != "windage")
    wide = widened(fit, some)
    found = list(placed(wide, offered))
    assert [one for one, _ in found] == list(some)
    assert missing in offered
    for one, places in found:
        assert [wide.columns[n].name for n in places] == [c.name for c in one.columns]
