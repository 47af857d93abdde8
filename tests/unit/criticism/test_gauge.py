"""Effects of coasts, which know every torque over the inertia alone."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit, floors
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.selection.alternatives import alternatives_to
from pipeline.criticism.selection.candidates import candidates, widened
from pipeline.criticism.selection.pruning import loss_without
from tests.unit.criticism.machines import BASE, coast_under_load, machine


def coasts(policy=DEFAULT):
    """A fit of two coasts, one in each sense, with the load that pulls in them."""
    library = effects()
    inside = tuple(library[name] for name in ("coulomb_friction", "constant_load"))
    model = Model(replace(machine(), policy=policy), inside)
    segments = tuple(coast_under_load(sense, seed=n) for n, sense in enumerate((1.0, -1.0)))
    values = {**BASE, **{k: v for e in inside for k, v in zero(e, model).items()}}
    values |= {"coulomb_friction.torque_nm": 4e-4, "constant_load.torque_nm": 3e-5}
    begun = Fit(segments, model, values, floors(segments, model, values), values)
    return gauss_newton(begun)


def test_what_a_load_explains_in_coasts_is_not_explained_by_another_inertia():
    """All torques of coasts could be small in the same measure; none is therefore without use."""
    system = coasts()
    without = gauss_newton(system.fit.without("constant_load"), before=system)
    loss = without.deviance - system.deviance
    assert loss > 20.0
    assert loss_without(system, ("constant_load",)) == pytest.approx(loss, rel=0.1)


def test_in_coasts_a_load_is_confused_with_a_friction_that_differs_by_sense():
    """Of all effects the nearest: in coasts the two are one."""
    policy = replace(DEFAULT, selection=replace(DEFAULT.selection, most_alternatives=1))
    fit = coasts(policy).fit
    library = effects()
    offered = candidates(library, fit.model)
    wide = widened(fit, offered)
    assert alternatives_to("constant_load", wide, offered) == ("direction_friction",)
