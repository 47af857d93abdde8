"""Terms inside an effect that captures do not pay for."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.selection import pruning
from pipeline.criticism.selection.pruning import trimmed, with_all_terms
from tests.unit.criticism.machines import BASE, machine

SATURATION = effects()["saturation"]
Q_FALL, Q_BEND, D_ODD, D_FALL, D_BEND = range(1, 6)
NEEDED = {D_ODD: 20.0, Q_FALL: 0.1, Q_BEND: 0.0, D_FALL: 0.3, D_BEND: 0.0}
"""What the deviance loses by the removal of each term."""


class Known:
    """A system of 40 samples around a fit whose deviance is known."""

    size = 40

    def __init__(self, fit: Fit, deviance: float) -> None:
        self.fit, self.deviance = fit, deviance

    def place(self, _names):
        return np.arange(0)

    def informed(self, _places):
        return self.size


@pytest.mark.parametrize(
    ("tangent", "refits"),
    [
        ((Q_FALL, Q_BEND, D_FALL, D_BEND), 1),
        ((D_BEND, Q_FALL, Q_BEND, D_ODD), 6),
        ((D_ODD,), 5),
        ((), 0),
    ],
)
def test_the_terms_that_pay_stay_whatever_the_tangent_says(tangent, refits, monkeypatch):
    """Where d_odd and d_fall tie to first order, the tangent may take the wrong one."""
    tried = []

    def without(system, effect, terms):
        tried.append(terms)
        gone = tuple(sorted({*effect.left_out, *terms}))
        less = Model(machine(), (replace(effect, left_out=gone),))
        fit = Fit((), less, system.fit.values, (), BASE)
        return Known(fit, system.deviance + sum(NEEDED[term] for term in terms))

    monkeypatch.setattr(pruning, "_spare", lambda *_: tangent)
    monkeypatch.setattr(pruning, "_without", without)
    monkeypatch.setattr(pruning, "_doubtful", lambda *known: sorted({*NEEDED} - {*known[2]}))
    model = Model(machine(), (SATURATION,))
    start = Fit((), model, {**BASE, **zero(SATURATION, model)}, (), BASE)
    system = trimmed(Known(start, 0.0), ("saturation",))
    assert len(tried) == refits
    gone = set(system.fit.model.effects[0].left_out)
    assert gone == ({*NEEDED} - {D_ODD} if tangent else set())
    assert system.deviance == pytest.approx(sum(NEEDED[term] for term in gone))
    assert np.log(Known.size) < NEEDED[D_ODD]


def test_what_was_left_out_of_the_machine_comes_back_and_of_a_sensor_does_not():
    encoder = effects()["angle_eccentricity"]
    less = replace(SATURATION, left_out=(D_ODD, D_BEND)), replace(encoder, left_out=(1,))
    model = Model(machine(), less)
    values = {**BASE, **zero(less[0], model), **zero(less[1], model), "saturation.q_fall": 0.2}
    full = with_all_terms(Fit((), model, values, (), BASE))
    assert [effect.left_out for effect in full.model.effects] == [(), (1,)]
    assert full.values["saturation.q_fall"] == 0.2
    assert full.values["saturation.d_odd"] == 0.0 and full.values["saturation.d_bend"] == 1.0


@pytest.mark.parametrize(("loss", "asked"), [(19.0, True), (21.0, False)])
def test_what_clearly_pays_is_not_asked_for_by_a_refit(loss, asked, monkeypatch):
    """In prices of a parameter: the tangent is not wrong about as much as that."""
    penalty = 5.0
    monkeypatch.setattr(pruning, "_loss", lambda _s, _k, names: loss * penalty * len(names))
    model = Model(machine(), (SATURATION,))
    fit = Fit((), model, {**BASE, **zero(SATURATION, model)}, (), BASE)
    system = SimpleNamespace(normal_equations=lambda: None, fit=fit)
    found = pruning._doubtful(system, SATURATION, (Q_BEND,), penalty)
    assert found == (tuple(sorted({*NEEDED} - {Q_BEND})) if asked else ())
