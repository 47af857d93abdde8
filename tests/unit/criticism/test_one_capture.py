"""An effect that one capture alone asks for, where others could show it, and which one that is."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

from pipeline.criticism import search
from pipeline.criticism.policy.policy import DEFAULT
from pipeline.criticism.selection.one_capture import only_capture

ROWS = 40


def system(moves, absorbed=False):
    """Four captures of one group each; the effect moves each by that many noises a row, and if
    `absorbed`, as another parameter does.
    """
    rng = np.random.default_rng(3)
    group = np.repeat(np.arange(4), ROWS)
    shape = rng.choice([-1.0, 1.0], group.size)
    column = shape * np.array(moves, dtype=float)[group]
    other = column * 2.0 if absorbed else rng.normal(size=group.size)
    known = {"windage.drag_nm": (None, SimpleNamespace(amplitude=True))}
    model = SimpleNamespace(effects=[SimpleNamespace(name="windage")], parameters=lambda: known)
    names = ("b_nm_s_rad", "windage.drag_nm")
    return SimpleNamespace(
        fit=SimpleNamespace(model=model, values={"windage.drag_nm": 0.5}, policy=DEFAULT),
        columns=[SimpleNamespace(name=name) for name in names],
        matrix=np.column_stack([other, column / 0.5]),
        model_columns=np.arange(2),
        group=group,
        labels=[(n, "torque_shaft_nm", 0) for n in range(4)],
        segments=[SimpleNamespace(capture=f"drive_{n}") for n in range(4)],
        counts=np.full(4, float(ROWS)),
        weights=lambda chi2: (1.0 / np.maximum(chi2, 1.0))[group],
    )


LARGE = np.array([40.0, 2.0, 2.0, 1.0])


@pytest.mark.parametrize("others", [(2.0, 2.0), (2.3, 2.1), (2.4, 1.9)])
def test_one_capture_gains_and_the_others_do_not(others):
    after = np.array([4.0, *others, 1.0])
    assert only_capture(system([3.0, 1.5, 1.5, 0.0]), LARGE, after) == "drive_0"


@pytest.mark.parametrize("others", [(1.2, 2.0), (1.4, 2.1)])
def test_another_capture_confirms_it(others):
    after = np.array([4.0, *others, 1.0])
    assert only_capture(system([3.0, 1.5, 1.5, 0.0]), LARGE, after) is None


def test_no_other_capture_could_show_it():
    after = np.array([4.0, 2.1, 2.1, 1.0])
    assert only_capture(system([3.0, 0.0, 0.05, 0.0]), LARGE, after) is None


def test_what_another_parameter_absorbs_moves_nothing():
    after = np.array([4.0, 2.1, 2.1, 1.0])
    assert only_capture(system([3.0, 1.5, 1.5, 0.0], absorbed=True), LARGE, after) is None


@pytest.mark.parametrize(("wrong", "alone"), [(0.02, None), (0.1, "drive_0")])
def test_what_a_tangent_is_wrong_by_is_no_movement(wrong, alone):
    """An open winding at hundreds of noises, which its own nuisance takes but for that share."""
    tried = system([3.0, 300.0, 0.0, 0.0])
    second, shape = tried.group == 1, np.sign(tried.matrix[:, 1])
    other = np.where(second, tried.matrix[:, 1], 0.0)
    other += np.where(second, wrong * tried.matrix[:, 1] * np.roll(shape, 7), 0.0)
    tried.matrix[:, 0] = other
    after = np.array([4.0, 2.1, 2.0, 1.0])
    assert only_capture(tried, LARGE, after) == alone


def test_a_capture_that_gains_by_itself_confirms_it():
    """An encoder's zero in two logs that miss by thousands of floors, and in an open winding.

    Beside the nuisance that it stands for it moves neither log, and the winding gains nothing.
    """
    made = system([3.0, 3.0, 1.5, 0.0])
    made.matrix[:, 0] = np.where(made.group < 2, made.matrix[:, 1], 0.0)
    before, after = np.array([9e3, 5e3, 1.0, 1.0]), np.array([1.0, 1.0, 2.0, 1.0])
    assert only_capture(made, before, after) is None


def test_a_capture_that_another_parameter_alone_moves_can_show_nothing():
    """A winding's resistance moves with a clock; its capture knows no time.

    A clock that was 2.4 % slow was dropped, since the resistance test did not gain with it.
    """
    made = system([30.0, 0.0, 0.0, 0.0])
    made.matrix[:, 0] = np.where(made.group == 3, 9.0, made.matrix[:, 1])
    after = np.array([4.0, 2.0, 2.0, 1.0])
    assert only_capture(made, LARGE, after) is None


@pytest.mark.parametrize(
    ("alone", "kept", "noted"),
    [
        ((), 3, set()),
        ((2,), 2, {"saturation"}),
        ((1, 2), 1, {"windage", "saturation"}),
        ((1,), 3, set()),
    ],
)
def test_trailing_effects_that_one_capture_alone_asks_for_are_notes_and_no_names(
    alone, kept, noted, monkeypatch
):
    """Of an earlier one nothing is known any more: the fits after it hold it too."""
    names = ("coulomb_friction", "windage", "saturation")
    steps = []
    for n, name in enumerate(names):
        model = SimpleNamespace(effects=[SimpleNamespace(name=name)])
        around = SimpleNamespace(number=n, fit=SimpleNamespace(model=model))
        steps.append(SimpleNamespace(added=names[1 : n + 1], system=around, fit=around.fit))
    monkeypatch.setattr(search, "search", lambda *_: tuple(steps))
    monkeypatch.setattr(search, "_that_explain", lambda steps: steps)
    monkeypatch.setattr(search, "leave_out", lambda system: system.number)
    monkeypatch.setattr(search, "in_common", lambda _, held: list(held))
    monkeypatch.setattr(search, "truncated", lambda steps, _: (tuple(steps), ()))
    monkeypatch.setattr(
        search, "rests_on", lambda _, held: "spin_down_0" if held[-1] in alone else None
    )
    ladder = search.ladder_from(SimpleNamespace(system=SimpleNamespace(fit=None)), {})
    assert len(ladder.steps) == len(ladder.held_out) == kept
    assert set(ladder.cut) == noted
    assert all("spin_down_0" in note for note in ladder.cut.values())
