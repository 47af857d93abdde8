"""A name must be told apart from zero beside all others, and not only when it joined."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from pipeline.criticism.data.segment import Segment
from pipeline.criticism.effect import Effect
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import zero
from pipeline.criticism.regression.cross_validation import HeldOut
from pipeline.criticism.regression.gauss_newton import gauss_newton
from pipeline.criticism.regression.linear_system import LinearSystem
from pipeline.criticism.selection.pruning import unsure_effect
from pipeline.criticism.selection.score_test import Score
from pipeline.criticism.selection.stepwise import search
from tests.unit.criticism.machines import fitted, with_drag

NAMES = ("coulomb_friction", "windage")
LIBRARY = {name: effects()[name] for name in NAMES}
BEST = "pipeline.criticism.selection.best_candidate"
REMOVAL = "pipeline.criticism.selection.pruning"


def logs(*curved_nm: float) -> tuple[Segment, ...]:
    """Logs with one dry friction, and each with a windage of its own [N·m]."""

    def made(n: int, size_nm: float) -> Segment:
        def drag(omega: np.ndarray, _: np.ndarray) -> np.ndarray:
            return 0.003 * np.sign(omega) + size_nm * omega * np.abs(omega) / 250.0**2

        return replace(with_drag(drag, 5 + n), capture=f"log_{n}")

    return tuple(made(n, size_nm) for n, size_nm in enumerate(curved_nm))


def with_all(segments: tuple[Segment, ...], *added: Effect) -> LinearSystem:
    """The fit with effects, each begun at a half of a tenth."""
    fit = fitted(segments)
    model = fit.model
    for effect in added:
        model = model.with_effects(effect)
    values = dict(fit.values)
    for effect in added:
        values |= {
            name: 0.05 if name.endswith("_nm") else v for name, v in zero(effect, model).items()
        }
    return gauss_newton(replace(fit, model=model, values=values))


@pytest.mark.parametrize("first", [NAMES[0], pytest.param(NAMES[1], marks=pytest.mark.slow)])
def test_a_size_that_may_be_zero_once_all_others_are_in_is_no_name(
    first: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A delay of -150 ± 110 µs stood beside the dead time that it had stood for."""

    def sure(system: LinearSystem, _: HeldOut, effect: Effect) -> list[str]:
        return [] if effect.name == "windage" and len(system.fit.model.effects) > 1 else ["size"]

    joined: list[str] = []

    def may_join(score: Score, *_: object) -> bool:
        return first in (score.candidate.effect.name, *joined)

    def joins(system: LinearSystem, _: LinearSystem) -> bool:
        joined.append(system.fit.model.effects[-1].name)
        return True

    monkeypatch.setattr(f"{BEST}.is_determined", joins)
    monkeypatch.setattr(f"{BEST}._may_join", may_join)
    fit = fitted(logs(0.1, 0.1))
    assert set(search(fit, LIBRARY)[-1].added) == set(joined) == set(NAMES)
    monkeypatch.setattr(f"{REMOVAL}.sure_amplitudes", sure)
    monkeypatch.setattr(f"{REMOVAL}.clears", lambda *_: False)
    joined.clear()
    steps = search(fit, LIBRARY)
    assert [step.added for step in steps] == [(), ("coulomb_friction",)]


@pytest.mark.parametrize(("curved_nm", "name"), [((0.1, -0.05), "windage"), ((0.1, 0.1), None)])
def test_a_size_of_which_captures_disagree_by_more_than_itself_may_be_zero(
    curved_nm: tuple[float, ...], name: str | None
) -> None:
    found = unsure_effect(with_all(logs(*curved_nm), *LIBRARY.values()), 0)
    assert (found and found[0]) == name


def test_what_takes_most_of_an_error_is_there_however_badly_its_size_is_known(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def sure(_: LinearSystem, __: HeldOut, effect: Effect) -> list[str]:
        return [] if effect.name == "windage" else ["size"]

    monkeypatch.setattr(f"{REMOVAL}.sure_amplitudes", sure)
    assert unsure_effect(with_all(logs(0.6, 0.6), *LIBRARY.values()), 0) is None


def test_of_two_that_stand_for_one_another_one_stays() -> None:
    """Neither is known beside the other, and the captures need one of them."""
    twin = replace(LIBRARY["windage"], name="twin")
    both = with_all(logs(0.1, 0.1), *LIBRARY.values(), twin)
    found = unsure_effect(both, 0)
    assert found is not None and found[0] in ("windage", "twin")
    assert unsure_effect(found[1], 0) is None
    assert unsure_effect(both, 3) is None
