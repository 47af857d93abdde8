"""Friction that changes with time within captures is told; no other friction is taken for it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from pipeline.criticism.diagnosis import base_fit, diagnose
from pipeline.criticism.machine.model import EARLY_S, EARLY_SHARES
from pipeline.criticism.regression.column_validity import is_valid
from pipeline.criticism.regression.linear_system import LinearSystem, linear_system
from pipeline.criticism.selection.free_shares import with_changing_friction
from pipeline.records.comparison import ModelSpec
from pipeline.records.constants import Constants
from pipeline.simulator.catalogue import with_effects
from tests.unit.criticism.machines import fitted, log
from tests.unit.estimation.test_drag_over_time import COASTS, DRIVES, plain, recorded, relaxing


def freed(found, most=math.inf) -> LinearSystem | None:
    base = base_fit(found, ModelSpec(), Constants())
    assert not isinstance(base, str)
    return with_changing_friction(base.system, most)


@pytest.mark.parametrize(
    ("course", "stems", "share", "tau_s"),
    [
        (relaxing(1.8, 1.0), COASTS, 0.8, 1.0),
        pytest.param(relaxing(1.3, 0.5), DRIVES, 0.3, 0.5, marks=pytest.mark.slow),
        pytest.param(relaxing(1.0, 0.5, last=1.25), COASTS, -0.2, 0.5, marks=pytest.mark.slow),
    ],
)
def test_both_shares_and_the_time_constant_are_found(course, stems, share, tau_s):
    found = recorded(plain("gimbal-5208"), stems, course)
    system = freed(found)
    assert system is not None
    assert freed(found, most=system.deviance - 100.0) is None
    values = system.fit.values
    assert [values[name] for name in EARLY_SHARES] == pytest.approx([share] * 2, rel=0.12)
    assert values[EARLY_S] == pytest.approx(tau_s, rel=0.1)


@pytest.mark.parametrize(
    ("effects", "stems"),
    [
        ("", DRIVES),
        pytest.param("windage", COASTS, marks=pytest.mark.slow),
        pytest.param("windage,stribeck", COASTS, marks=pytest.mark.slow),
        pytest.param("iron_eddy", COASTS, marks=pytest.mark.slow),
    ],
)
def test_friction_of_any_form_over_speed_is_no_change(effects, stems):
    motor = plain("gimbal-5208")
    assert freed(recorded(with_effects(motor, effects) if effects else motor, stems)) is None


@pytest.mark.slow
def test_one_coast_does_not_tell_time_from_speed() -> None:
    assert freed(recorded(plain("gimbal-5208"), COASTS[:2], relaxing(1.8, 0.4))) is None


@pytest.mark.parametrize(
    "course", [relaxing(1.8, 1.0), pytest.param(relaxing(1.8, 30.0), marks=pytest.mark.slow)]
)
def test_the_diagnosis_says_what_changed_and_names_no_other_friction(course):
    """Windage and a friction by sense were named for it, or nothing."""
    result = diagnose(recorded(plain("gimbal-5208"), COASTS, course), ModelSpec(), Constants())
    assert (result.verdict, result.missing) == ("unknown", ())
    note = next(note for note in result.notes if "with a time constant of" in note)
    assert "dry friction is" in note
    assert "viscous friction is" in note
    assert all(f"{stem}.mcap" in note for stem in COASTS[1:])
    assert "record several coasts from different speeds" in note


def test_a_column_is_old_from_before_friction_had_a_time_constant() -> None:
    """It was none in the fit that the column is of, and nothing was divided by it since."""
    fit = fitted([log(noise=1.0)])
    share = EARLY_SHARES[0]
    later = replace(fit, values={**fit.values, share: 1e-6, EARLY_S: 2.0})
    (column,) = (one for one in linear_system(fit).columns if one.name == "psi_wb")
    before, since = {**fit.values, share: 0.0, EARLY_S: 0.0}, {**later.values, EARLY_S: 2.0}
    assert not is_valid(column, before, later)
    assert is_valid(column, since, later)
