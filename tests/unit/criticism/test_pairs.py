"""Two effects of which neither predicts what is held out while the other is missing."""

from __future__ import annotations

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism.diagnosis import diagnose
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.selection import pairs, stepwise
from pipeline.criticism.selection.pairs import Pair
from pipeline.records.capture import Campaign
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from tests.unit.criticism.coasts import Shaft
from tests.unit.criticism.test_slow_turn import slow_turn
from tests.unit.estimation.signals import capture

SHAFT = Shaft(
    dry=200.0,
    excess=100.0,
    slow_rad_s=40.0,
    viscous=0.15,
    windage=1e-4,
    top_rad_s=1170.0,
    end_rad_s=6.0,
    row_s=2e-3,
)
"""Friction falls over 40 rad/s, and grows by the square of speed above."""


def two_drags() -> Campaign:
    """Coasts of both senses."""
    coasts = (capture("spin_down", f"coast{s}", **SHAFT.coast(s)) for s in (1.0, -1.0))
    return Campaign("m", tuple(coasts))


def test_two_drags_are_found_together() -> None:
    found = diagnose(two_drags(), ModelSpec(), Constants())
    assert sorted(found.missing) == ["stribeck", "windage"]
    assert len(found.ladder) == 3
    assert found.ladder[-1].held_out < 1.0 < found.ladder[0].held_out


def test_neither_joins_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stepwise, "best_pair", lambda *_: None)
    found = diagnose(two_drags(), ModelSpec(), Constants())
    assert sorted(found.missing) != ["stribeck", "windage"]


@pytest.mark.parametrize(
    ("first", "second", "fall", "needed"),
    [
        ((15.0, 6.0), (8.0, 5.0), 21.0, True),
        ((15.0, 6.0), (8.0, 5.0), 19.0, False),
        ((10.0, 6.0), (9.0, 2.0), 14.0, False),
        ((10.0, 6.0), (9.0, 2.0), 16.0, True),
    ],
)
def test_a_pair_is_worth_both_penalties_beside_each_other(
    first: tuple[float, float], second: tuple[float, float], fall: float, needed: bool
) -> None:
    both = tuple(SimpleNamespace(fall=own, penalty=cost) for own, cost in (first, second))
    pair = Pair(both, fall, {})  # type: ignore[arg-type]
    assert pair.both_needed is needed
    assert pair.penalty == first[1] + second[1]


def test_the_coasts_are_what_they_say() -> None:
    """Deceleration from the angle's second difference, over fifty rows."""
    rows = SHAFT.coast(1.0)
    theta, period = rows["theta_mech_rad"], 50.0 * SHAFT.row_s
    speed = (theta[100:] - theta[:-100]) / (2.0 * period)
    slowed = -(theta[100:] - 2.0 * theta[50:-50] + theta[:-100]) / period**2
    law = np.array([SHAFT.slowed(omega) for omega in speed])
    assert slowed[speed > 100.0] == pytest.approx(law[speed > 100.0], rel=1e-3)


def test_a_pair_that_explains_less_than_what_is_named_does_not_join(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Nor is it fitted, where twice its fall to first order would not do."""
    given, fits = stepwise.best_pair, []
    monkeypatch.setattr(stepwise, "best_pair", lambda *all_but: given(*all_but[:4], -math.inf))
    monkeypatch.setattr(pairs, "gauss_newton", lambda *fit, **_: fits.append(fit))
    found = diagnose(two_drags(), ModelSpec(), Constants())
    assert sorted(found.missing) != ["stribeck", "windage"]
    assert not fits


@pytest.mark.slow
def test_a_choice_that_was_made_before_a_pair_is_no_second_effect() -> None:
    """Before the friction at low speed was known, the load seemed to act beyond the transducer.
    What was then lacking in the slow turns was named `torque_offset`, as large as the load.
    """
    j_kgm2, load = 1.1e-4, 100.0
    shaft = replace(SHAFT, excess=200.0, slow_rad_s=20.0, viscous=0.2, windage=0.0)
    shaft = replace(shaft, top_rad_s=300.0, end_rad_s=3.0)
    coasts = [
        capture("spin_down", f"coast{s}", **replace(shaft, dry=shaft.dry + s * load).coast(s))
        for s in (1.0, -1.0)
    ]
    turns = [
        slow_turn(f"{s}.csv", 0.0, sense=s, noise_nm=1e-5, dry_nm=j_kgm2 * (400.0 + s * load))
        for s in (1, -1)
    ]
    found = diagnose(Campaign("m", (*coasts, *turns)), ModelSpec(), Constants())
    assert sorted(found.missing) == ["constant_load", "stribeck"]
    assert found.ladder[-1].parameters["constant_load.inside"].value == 1.0
    assert found.ladder[-1].parameters["constant_load.torque_nm"].value == pytest.approx(
        j_kgm2 * load, rel=0.02
    )


@pytest.mark.parametrize(("second_is_needed", "steps"), [(True, 2), (False, 1)])
def test_of_a_pair_one_goes_whose_place_another_choice_takes(
    monkeypatch: pytest.MonkeyPatch, second_is_needed: bool, steps: int
) -> None:
    """A load of MuJoCo's hinge: by the other side of the transducer the offset explains nothing."""

    def fitted(deviance: float, *names: str) -> SimpleNamespace:
        effects = tuple(SimpleNamespace(name=name) for name in names)
        model = SimpleNamespace(effects=effects)
        fit = SimpleNamespace(model=model, policy=DEFAULT, without=lambda name: name)
        return SimpleNamespace(deviance=deviance, fit=fit)

    both = fitted(-605.0, "stribeck", "torque_offset")
    rechosen = {"stribeck": fitted(-450.0), "torque_offset": fitted(-607.0, "stribeck")}
    if second_is_needed:
        rechosen["torque_offset"] = fitted(-580.0, "stribeck")
    given = {
        "significant_groups": lambda _: np.array([True]),
        "candidates": lambda *_: (),
        "best_pair": lambda *_: both,
        "gauss_newton": lambda name, **_: name,
        "reconsidered": lambda name, **_: rechosen[name],
        "scored": lambda *_: (fitted(-500.0, "stribeck"), ()),
        "_refloored": lambda *_: None,
    }
    for name, answer in given.items():
        monkeypatch.setattr(stepwise, name, answer)
    ladder = [stepwise.LadderStep((), fitted(-450.0), ())]  # type: ignore[arg-type]
    found = stepwise._with_pair(ladder, {}, 0, frozenset())
    assert found is (both if second_is_needed else rechosen["torque_offset"])
    assert len(ladder) == steps


@pytest.mark.parametrize(
    ("beside", "deviance", "found"),
    [
        # beside one that leaves nothing: seven for the parameter more, and a tie of twelve
        ({"skin_effect": 105.0}, -325.0, True),
        ({"skin_effect": 105.0}, -310.0, False),
        # no other effect would have done as much
        ({"skin_effect": 40.0}, -325.0, False),
    ],
)
def test_two_are_tried_at_the_floors_where_one_does_nearly_as_much(
    monkeypatch: pytest.MonkeyPatch, beside: dict[str, float], deviance: float, found: bool
) -> None:
    def fitted(deviance: float, *names: str) -> SimpleNamespace:
        effects = tuple(SimpleNamespace(name=name) for name in names)
        model = SimpleNamespace(effects=effects)
        fit = SimpleNamespace(model=model, policy=DEFAULT, without=lambda name: name)
        return SimpleNamespace(deviance=deviance, fit=fit, policy=DEFAULT)

    both = fitted(deviance, "skin_effect", "iron_hysteresis")
    scores = tuple(
        SimpleNamespace(candidate=SimpleNamespace(effect=SimpleNamespace(name=name)), fall=fall)
        for name, fall in {"current_delay": 115.0, **beside}.items()
    )
    asked: list[frozenset[str]] = []
    given = {
        "significant_groups": lambda _: np.array([False]),
        "candidates": lambda *_: (),
        "best_pair": lambda *given: asked.append(given[-1]) or both,
        "_cost": lambda system: system.deviance + 7.0 * len(system.fit.model.effects),
        "gauss_newton": lambda name, **_: name,
        "reconsidered": lambda *_, **__: fitted(-280.0, "skin_effect"),
        "scored": lambda *_: (fitted(-280.0, "skin_effect"), ()),
        "_refloored": lambda *_: None,
    }
    for name, answer in given.items():
        monkeypatch.setattr(stepwise, name, answer)
    ladder = [
        stepwise.LadderStep((), fitted(-176.0), scores),  # type: ignore[arg-type]
        stepwise.LadderStep(("current_delay",), fitted(-292.0, "current_delay"), ()),  # type: ignore[arg-type]
    ]
    assert (stepwise._with_pair(ladder, {}, 0, frozenset()) is both) is found
    assert all(names == {"skin_effect"} for names in asked)
    assert [step.added for step in ladder[1:]] == [
        ("skin_effect",) if found else ("current_delay",)
    ]
