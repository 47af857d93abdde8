"""How often the search is repeated, and which of its results is reported."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism import search
from pipeline.criticism.library.registry import effects
from pipeline.criticism.machine.model import Model, zero
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.regression.fit import Fit
from pipeline.criticism.regression.linear_system import linear_system
from pipeline.criticism.search import search_ladder
from pipeline.criticism.selection import free_shares, truncation
from pipeline.criticism.selection.stepwise import LadderStep
from pipeline.records.comparison import ModelSpec
from tests.unit.criticism.machines import fitted, machine, with_drag


@pytest.fixture
def searches(monkeypatch):
    """Ladders that are no more than the orders their equations observe; `sketched` says which of
    them leave something that a state of the machine predicts, `drifts` gives one with drift.
    """
    made = SimpleNamespace(
        orders=[],
        seen=(),
        sketched=set(),
        gains={},
        explained=False,
        drifts=False,
        change=None,
        freed=(),
    )

    class Ladder(SimpleNamespace):
        def explains(self, _):
            return made.explained

        def large(self):
            return ("large", *self.remainders)

    def searched(base, _):
        observed = base if isinstance(base, tuple) else "drift"
        made.orders.append(observed)
        fit = Fit((), Model(machine(), ()), {}, (), {})
        step = SimpleNamespace(system=None, fit=fit)
        inside = SimpleNamespace(system=SimpleNamespace(fit=fit), hum=())
        return Ladder(observed=observed, remainders=(observed,), steps=(step,), base=inside)

    def sketched(ladder, left, name, in_parts=False):
        what = ladder.observed, in_parts
        return (what, made.gains.get(what, 1.0)) if what in made.sketched else (None, 0.0)

    monkeypatch.setattr(search, "ladder_from", searched)
    monkeypatch.setattr(search, "_sketched", sketched)
    monkeypatch.setattr(search, "_other_side_note", lambda *_: [])
    monkeypatch.setattr(search, "share_notes", lambda _: made.freed)
    monkeypatch.setattr(search, "friction_notes", lambda _: ())
    monkeypatch.setattr(search, "changed_constant", lambda _: made.change)
    monkeypatch.setattr(search, "changed_within", lambda _: None)
    monkeypatch.setattr(search, "segments", lambda _, of: of.load_orders)
    monkeypatch.setattr(search, "fit_of", lambda found, _: tuple(found))
    monkeypatch.setattr(search, "model_of", lambda *_: None)
    monkeypatch.setattr(search, "orders_left", lambda *_: made.seen)
    monkeypatch.setattr(search, "drifting_segments", lambda *_: () if made.drifts else None)
    monkeypatch.setattr(search, "gauss_newton", lambda *_: None)
    monkeypatch.setattr(search, "at_other_place", lambda _: None)
    return made


def end():
    return search_ladder(SimpleNamespace(), ModelSpec("standard"), machine(), (), {}, "m_unknown")


def test_orders_that_are_whole_join_at_once(searches):
    searches.seen, searches.explained = (16, 37), True
    assert end().ladder.observed == (16, 37)
    assert searches.orders == [(), (16, 37)]


@pytest.mark.parametrize(("sketched", "observed"), [(True, (16, 4.83)), (False, (16,))])
def test_others_join_where_they_alone_give_a_sketch(searches, sketched, observed):
    searches.seen = (16, 4.83)
    searches.sketched = {((16, 4.83), False)} if sketched else set()
    found = end()
    assert found.ladder.observed == observed
    assert searches.orders == [(), (16,), (16, 4.83)]
    assert (found.sketch is not None) is sketched


@pytest.mark.parametrize(("gain", "observed"), [(900.0, (4.83,)), (0.5, ())])
def test_others_join_where_the_sketch_takes_more_with_them(searches, gain, observed):
    """A sketch of 15 mV was believed, and the belt that made 95 floors of torque was not tried."""
    searches.seen, searches.sketched = (4.83,), {((), False), ((4.83,), False)}
    searches.gains = {((4.83,), False): gain}
    found = end()
    assert (found.ladder.observed, found.sketch) == (observed, (observed, False))


def test_others_are_not_tried_where_nothing_is_left(searches):
    searches.seen, searches.explained = (4.83,), True
    assert end().sketch is None
    assert searches.orders == [()]


def test_drift_is_looked_for_where_nothing_predicts_what_is_left(searches):
    searches.drifts = True
    found = end()
    assert found.ladder.observed == "drift"
    assert found.remainders == ("large", "drift")
    assert "drift" in found.notes[0]
    searches.sketched = {((), False)}
    assert end().notes == ()


def test_a_sketch_held_out_in_parts_is_said_to_be_so(searches):
    """What is left stays as it was told then, also where it is large only beside little voltage."""
    searches.sketched = {((), True)}
    found = end()
    assert found.sketch is not None
    assert (found.remainders, len(found.notes)) == (((),), 1)
    searches.sketched = set()
    assert (end().remainders, end().notes) == (("large", ()), ())


@pytest.mark.parametrize(("gain", "reported"), [(2.0, True), (0.5, False)])
def test_a_changed_constant_is_reported_where_it_takes_more_than_a_sketch(searches, gain, reported):
    searches.sketched = {((), False)}
    searches.change = SimpleNamespace(gain=gain, words="psi_wb is lower")
    found = end()
    assert (found.change is not None) is reported
    assert (found.sketch is None) is reported
    assert found.notes == (("psi_wb is lower",) if reported else ())


def test_a_changed_constant_is_no_matter_where_the_names_explain_all(searches):
    searches.explained, searches.change = True, SimpleNamespace(gain=9.0, words="psi_wb is lower")
    assert (end().change, end().notes) == (None, ())


@pytest.mark.parametrize(("better", "taken"), [(1.2, "wider"), (4.0, "first")])
def test_orders_of_an_earlier_step_join_where_the_last_one_leaves_something(
    monkeypatch: pytest.MonkeyPatch, better: float, taken: str
) -> None:
    """A gap between two masses took a part of a cogging, and its orders were not seen behind it."""
    seen = {"base": (7, 9), "cogging": (22, 4.83, 24), "backlash": ()}

    def ladder(name: str, left: float, *systems: str) -> SimpleNamespace:
        steps = tuple(SimpleNamespace(system=system) for system in systems)
        remainders = (SimpleNamespace(chi2_per_n=left),)
        return SimpleNamespace(name=name, steps=steps, remainders=remainders)

    asked = []

    def search_again(*orders: int) -> SimpleNamespace:
        asked.append(orders)
        return ladder("wider", better) if orders else ladder("first", 2.5, *seen)

    monkeypatch.setattr(search, "orders_left", lambda system: seen[system])
    monkeypatch.setattr(search, "_sketched", lambda *_: (None, 0.0))
    assert search._by_orders(search_again, "m_unknown")[0].name == taken
    assert asked == [(), (22, 24)]


@pytest.mark.parametrize(
    ("explained", "error", "freed", "parts", "kept"),
    [
        (False, 1.0, (), {"windage"}, 2),
        (True, 1.0, ("friction is lower",), {"windage"}, 2),
        (True, 1.0, (), {"windage"}, 3),
        (True, 1.4, (), {"windage"}, 3),
        (True, 1.5, (), {"windage"}, 2),
        (False, 1.0, (), {"windage", "stribeck"}, 1),
        (False, 1.0, (), {"stribeck"}, 3),
    ],
)
def test_trailing_parts_of_a_curve_are_left_out_where_something_is_left(
    searches: SimpleNamespace,
    monkeypatch: pytest.MonkeyPatch,
    explained: bool,
    error: float,
    freed: tuple[str, ...],
    parts: set[str],
    kept: int,
) -> None:
    def ladder(*_: object) -> search.Ladder:
        added = ((), ("stribeck",), ("stribeck", "windage"))
        fit = Fit((), Model(machine(), ()), {}, (), {})
        steps = tuple(SimpleNamespace(added=names, system=None, fit=fit) for names in added)
        held_out = [SimpleNamespace(total=error)] * 3
        return search.Ladder(SimpleNamespace(system=None, hum=()), steps, held_out, (), {})

    monkeypatch.setattr(search, "ladder_from", ladder)
    monkeypatch.setattr(search, "_sketched", lambda *_, **__: (None, 0.0))
    monkeypatch.setattr(search, "explained", lambda *_: explained)
    monkeypatch.setattr(search, "remainder", lambda *_, **__: ())
    monkeypatch.setattr(search, "is_part_of_a_curve", lambda _, __, name: name in parts)
    searches.freed = freed
    found = end().ladder
    assert len(found.steps) == len(found.held_out) == kept
    assert set(found.cut) == {"stribeck", "windage"} - {*found.steps[-1].added}


def test_what_was_found_beside_a_wrong_form_is_looked_for_without_it(monkeypatch) -> None:
    """Cogging that was found after a drag went with it, and was said to be of no known effect."""

    def searched(_: object, library: dict[str, object]) -> list[SimpleNamespace]:
        found = [name for name in ("iron_eddy", "cogging", "stribeck") if name in library]
        ladder = [tuple(found[:count]) for count in range(len(found) + 1)]
        return [SimpleNamespace(added=names, system=names) for names in ladder]

    def cut(steps: list, _: object) -> tuple[list, tuple]:
        return (steps[:1] if "iron_eddy" in steps[-1].added else steps[:2]), ()

    monkeypatch.setattr(search, "search", searched)
    monkeypatch.setattr(search, "_that_explain", lambda steps: steps)
    monkeypatch.setattr(search, "leave_out", lambda _: None)
    monkeypatch.setattr(search, "in_common", lambda systems, _: systems)
    monkeypatch.setattr(search, "_confirmed", lambda steps, _: (steps, {}))
    monkeypatch.setattr(search, "truncated", cut)
    drives = {"iron_eddy": "its friction drives", "stribeck": "so does its own"}
    monkeypatch.setattr(search, "contradiction", lambda step: drives.get(step.added[-1], ""))
    start = SimpleNamespace(system=SimpleNamespace(fit=None))
    ladder = search.ladder_from(start, dict.fromkeys(("iron_eddy", "cogging", "stribeck")))
    assert [step.added for step in ladder.steps] == [(), ("cogging",)]
    assert ladder.cut == drives


@pytest.mark.parametrize(
    ("name", "speaks"), [("windage", True), ("cogging", False), ("unbalance", False)]
)
def test_a_friction_that_drives_speaks_against_drags_and_no_waves(name: str, speaks: bool) -> None:
    fit = fitted([with_drag(lambda *_: 0.0, seed) for seed in (5, 6)])
    effect = effects()[name]
    model = fit.model.with_effects(effect)
    values = {**zero(effect, model), **fit.values, "b_nm_s_rad": -1e-3}
    system = linear_system(replace(fit, model=model, values=values))
    step = LadderStep((name,), system, ())
    assert bool(truncation.contradiction(step)) == speaks


@pytest.mark.parametrize(("u", "told"), [(0.02, True), (0.2, False)])
def test_a_share_that_may_be_none_is_no_change(u: float, told: bool, monkeypatch) -> None:
    """Friction of a coast was said to have changed by 1.5 ± 6 %."""
    names = free_shares.SHARES["spin_down"]
    values = dict.fromkeys(names, 0.2)
    segment = SimpleNamespace(test="spin_down", capture="coast")
    system = SimpleNamespace(
        fit=SimpleNamespace(values=values, segments=(segment,)),
        policy=DEFAULT,
        model_columns=np.arange(len(names)),
        covariance=lambda _: u**2 * np.eye(len(names)),
        place=lambda one: [list(names).index(one[0])],
    )
    monkeypatch.setattr(free_shares, "free_tests", lambda _: ("spin_down",))
    assert bool(list(free_shares.share_notes(system))) == told


@pytest.mark.parametrize(
    ("deviances", "over", "kept"),
    [
        ((135.4, 128.7), True, 1),
        ((135.4, 120.0), True, 2),
        ((135.4, 122.0), False, 1),
        ((135.4, 100.0), False, 2),
        ((300.0, 299.0, 200.0), False, 3),
        ((300.0, 200.0, 195.0, 190.0), True, 2),
        ((50.0,), True, 1),
    ],
)
def test_trailing_steps_without_less_deviance_are_left_out(
    monkeypatch: pytest.MonkeyPatch, deviances: tuple[float, ...], over: bool, kept: int
) -> None:
    """A tie is 12. Below the floors an effect pays half as much again as its penalty, 9."""
    fit = Fit((), Model(machine(), ()), {}, (), {})
    effects = [SimpleNamespace(effect=SimpleNamespace(name=str(k))) for k in range(9)]
    scores = [SimpleNamespace(candidate=one, penalty=9.0) for one in effects]
    steps = [
        SimpleNamespace(fit=fit, system=one, scores=scores, added=tuple("12345"[:k]))
        for k, one in enumerate(deviances)
    ]
    monkeypatch.setattr(search, "sure_fall", lambda before, after: before - after)
    monkeypatch.setattr(search, "significant_groups", lambda _: np.array([over]))
    assert len(search._that_explain(steps)) == kept


def missed(rms: tuple[float, ...], floors: tuple[float, ...]) -> SimpleNamespace:
    """A fit with a residual and a floor a group, of a hundred rows each."""
    floor = np.repeat(floors, 100)
    return SimpleNamespace(
        labels=tuple(range(len(rms))),
        size=floor.size,
        row_weight=1.0 / floor,
        prior_costs=lambda: np.zeros(2),
        residual=np.repeat(rms, 100) / floor,
        reduced_chi2=lambda r: np.mean(np.reshape(r, (-1, 100)) ** 2, axis=1),
        counts=np.full(len(rms), 100.0),
        deviance=float("nan"),
    )


def test_a_fall_that_the_floors_make_is_none() -> None:
    """A `torque_offset` took the place of friction, and J and its noise went down with it; and the
    floor of a voltage that it does not act in was larger in the one fit.
    """
    before = missed((0.95, 0.9, 0.9), (1.0, 1.0, 1.0))
    smaller = missed((0.3, 0.9, 0.9), (0.32, 1.0, 1.0))
    larger = missed((0.95, 0.9, 0.9), (1.0, 1.4, 1.4))
    assert abs(search.sure_fall(before, smaller)) < 5.0
    assert abs(search.sure_fall(before, larger)) < 1e-9
    better = missed((0.3, 0.9, 0.9), (1.0, 1.0, 1.0))
    assert search.sure_fall(before, better) == pytest.approx(100.0 * (0.95**2 - 0.3**2))
    worse = missed((3.0, 0.9, 0.9), (1.0, 1.0, 1.0))
    assert search.sure_fall(worse, before) == pytest.approx(
        100.0 * (2.0 * np.log(3.0) + 1 - 0.95**2)
    )
