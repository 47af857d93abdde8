"""What captures that lack a column are good for: the same constants with a u that says so, or none.

Alone and beside whole captures: a file that cannot be used keeps no other from being used.
"""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cache

import pytest

from pipeline.estimation.protocol import Fit
from pipeline.records.capture import Campaign, Capture
from tests.unit.estimation.test_scales import PLANS, campaign, fitted


def doubted(name: str) -> Campaign:
    """The captures with thermometers whose offset is as large as the bench draws it."""
    made = campaign(name)
    metas = (replace(c.meta, u_temp_degc=0.5) for c in made.captures)
    captures = zip(made.captures, metas, strict=True)
    return replace(made, captures=tuple(replace(c, meta=meta) for c, meta in captures))


def without(capture: Capture, column: str) -> Capture:
    if not capture.has(column):
        return capture
    tables = tuple(t.drop(column) if column in t.columns else t for t in capture.tables)
    return replace(capture, path=f"less_{capture.path}", sha256="e" * 64, tables=tables)


def columns_of(made: Campaign) -> list[str]:
    return sorted({n for c in made.captures for t in c.tables for n in t.columns})


LONG = {"current_step": {"vab_v"}, "inertia": {"id_a"}, "torque_map": {"iq_a"}}
"""Of estimators that take longest, the column that the default run takes away."""
CASES = [
    pytest.param(
        name, column, marks=pytest.mark.slow if column not in LONG.get(name, {column}) else ()
    )
    for name in PLANS
    for column in columns_of(campaign(name))
]


def agree(plain: Fit, other: Fit, *, keeps: bool) -> None:
    """Each number within four of both uncertainties, each that is withheld with its reason."""
    for one, two in zip(plain.estimates, other.estimates, strict=True):
        assert two.name == one.name
        if not two.known:
            assert two.note, two.name
            assert not keeps or not one.known, (two.name, two.note)
            continue
        assert math.isfinite(two.number)
        assert math.isfinite(two.u)
        if one.known:
            room = 4.0 * math.hypot(one.u, two.u) + 1e-9 * abs(one.number)
            assert two.number == pytest.approx(one.number, abs=room), two.name


@cache
def whole(name: str) -> Fit:
    return fitted(name, doubted(name))


@pytest.mark.parametrize(("name", "column"), CASES)
def test_captures_without_a_column_give_no_other_number(name: str, column: str) -> None:
    """Where nothing is left of them, one of them beside the whole ones takes nothing from these."""
    made = doubted(name)
    less = [without(c, column) for c in made.captures]
    other = fitted(name, replace(made, captures=tuple(less)))
    agree(whole(name), other, keeps=False)
    if any(e.known for e in other.estimates):
        return
    first = next(c for c in less if c.path.startswith("less_"))
    both = replace(made, captures=(replace(first, path="0"), *made.captures))
    agree(whole(name), fitted(name, both), keeps=True)
