"""How an estimator says its results: units, sources, notes, refusals and plots."""

from __future__ import annotations

import numpy as np
import pytest

from pipeline.estimation.method import Method, over_x
from pipeline.physics.glossary import Term
from pipeline.records.uncertainty import Contribution
from tests.unit.estimation.signals import capture

OWN = Term("stiction_nm", "N·m", "torque that starts the shaft", "constant", 0.0)
METHOD = Method("bench", (OWN,))


def test_a_constant_has_the_unit_of_its_term_or_of_the_glossary() -> None:
    assert METHOD.unit("stiction_nm") == "N·m"
    assert METHOD.unit("r_phase_ohm") == "ohm"
    with pytest.raises(KeyError):
        METHOD.unit("no_such_constant")


def test_a_measured_constant_has_one_part_a_source_and_no_empty_note() -> None:
    """Parts of one source add with their signs, those of 0 go."""
    parts = [
        METHOD.scatter("r", 0.3, 7.0),
        Contribution("voltage@s", 0.5, "B"),
        Contribution("voltage@s", -0.1, "B"),
        Contribution("current@s", 0.0, "B"),
    ]
    notes = ["one", "", "two"]
    found = METHOD.measured("r_phase_ohm", 2.0, parts, [capture("drive", "a"), "b"], None, notes)
    assert [(p.source, p.kind) for p in found.budget] == [
        ("scatter:bench:r", "A"),
        ("voltage@s", "B"),
    ]
    assert found.budget[0].dof == 7.0
    assert found.budget[1].u == pytest.approx(0.4)
    assert (found.unit, found.method, found.status) == ("ohm", "bench", "measured")
    assert found.captures == ("a", "b")
    assert found.note == "one; two"


def test_what_is_not_there_is_settled_and_what_is_missing_is_not() -> None:
    assert METHOD.absent("stiction_nm", "below 1 mN·m").settled
    assert not METHOD.missing("stiction_nm", "record a drive").settled
    nothing = METHOD.nothing(["stiction_nm", "r_phase_ohm"], "record a drive")
    assert [(e.unit, e.note) for e in nothing.estimates] == [
        ("N·m", "record a drive"),
        ("ohm", "record a drive"),
    ]


def test_traces_are_those_of_each_capture() -> None:
    """Rows of two captures in one regression become a plot each, with its own title."""
    captures = [capture("drive", "a"), capture("drive", "b")]
    number, time = np.array([0, 1, 0]), np.array([0.0, 0.5, 1.0])
    columns = number, time, time + 1.0, time + 2.0
    plots = METHOD.traces(captures, ["first", "second"], "vq_v", columns, "means")
    assert [(p.title, p.capture, p.x_name, p.y_name) for p in plots] == [
        ("first", "a", "t_s", "vq_v"),
        ("second", "b", "t_s", "vq_v"),
    ]
    assert plots[0].series[0].x.tolist() == [0.0, 1.0]
    assert plots[1].series[0].measured.tolist() == [1.5]
    assert plots[1].series[0].fitted.tolist() == [2.5]


def test_points_are_sorted_by_x() -> None:
    found = over_x("ab", np.array([2.0, 1.0]), np.array([20.0, 10.0]), np.array([21.0, 11.0]))
    assert found.x.tolist() == [1.0, 2.0]
    assert found.measured.tolist() == [10.0, 20.0]
    assert found.fitted.tolist() == [11.0, 21.0]
