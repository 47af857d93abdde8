"""Where counts end: one lot, one motor a lot, as many names as a line shows."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from pipeline.lots.outliers import robust_z
from pipeline.lots.selector import known
from pipeline.lots.variance import Nested, nested


def test_one_group_and_groups_of_one() -> None:
    """Degrees of freedom between and within: none of one group, none of single values."""
    assert nested([[1.0, 2.0, 3.0]]) == Nested(None, 1.0, 0, 2)
    assert nested([[1.0], [2.0], [4.0]]) == Nested(None, None, 2, 0)
    assert nested([]) == Nested(None, None, 0, 0)


def test_a_lot_of_one_has_no_spread() -> None:
    """Deviations 1, 0, 1 of one lot: s = 1.4826 sqrt(3/2); the lone motor adds none."""
    s = 1.4826 * (3.0 / 2.0) ** 0.5
    found = robust_z({"a": [1.0, 2.0, 3.0], "b": [50.0]})
    assert found["a"] == pytest.approx([-1.0 / s, 0.0, 1.0 / s])
    assert found["b"] == [0.0]
    assert robust_z({"a": [1.0], "b": [2.0]}) == {"a": [0.0], "b": [0.0]}


@pytest.mark.parametrize(("count", "more"), [(12, ""), (13, " and 1 more"), (15, " and 3 more")])
def test_a_line_shows_twelve_names(count: int, more: str) -> None:
    versions = [
        SimpleNamespace(
            published=SimpleNamespace(lot=f"L{k:02}", motor_type="", stations=()), tags=()
        )
        for k in range(count)
    ]
    names = ", ".join(f"L{k:02}" for k in range(12))
    assert known(versions) == f"there are lots {names}{more}"  # type: ignore[arg-type]
