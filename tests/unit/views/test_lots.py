"""Lots against lots: what matters first, no share of nearly nothing, one why for equal reasons."""

from __future__ import annotations

from dataclasses import replace

import pytest

from pipeline.io.recordings.lots import verdict_markdown
from pipeline.records.lot_constant import ConstantResult
from pipeline.report.pages.lot_page import render_regression
from pipeline.report.text.lot_text import regression_text
from pipeline.views.lots import change_text, compared, lot_view
from tests.unit.regressions import make_constant, make_regression
from tests.unit.report.conftest import flat

HISTORY = "the lot-level test needs 3 baseline lots, there is 1"


def changed(before: float, difference: float, expanded: float) -> ConstantResult:
    one = make_constant("cogging_amplitude_nm", "N·m", before, before + difference, 1e-9, "fail")
    relative = difference / before if before else None
    effect = replace(
        one.effect, difference=difference, expanded_u=expanded, k=2.0, relative=relative
    )
    return replace(one, effect=effect)


@pytest.mark.parametrize(
    ("before", "difference", "expanded", "words"),
    [
        (0.008, 0.006, 0.0004, "+75.0 ± 5.0 %"),
        (0.008, -0.002, 0.0004, "−25.0 ± 5.0 %"),
        (2e-6, 6e-5, 1.2e-4, "+60 ± 120 µN·m"),
        (1e-4, 1e-4, 3e-4, "+100 ± 300 µN·m"),
        (1e-15, 6e-5, 1.2e-4, "+60 ± 120 µN·m"),
        (1e-4, 3e-3, 1e-5, "+3.000 ± 0.010 mN·m"),
    ],
)
def test_a_change_is_a_share_only_of_something(
    before: float, difference: float, expanded: float, words: str
) -> None:
    """Once +2994.79 ± 6123.33 % was told of a baseline that could as well be zero."""
    assert change_text(changed(before, difference, expanded)) == words


def test_the_change_that_matters_stands_first_everywhere() -> None:
    small = make_constant("ld_h", "H", 2e-4, 2.1e-4, 1e-6, "fail")
    small = replace(small, effect=replace(small.effect, in_sd=2.0))
    large = make_constant("lq_h", "H", 3e-4, 3.6e-4, 1e-6, "fail")
    large = replace(large, effect=replace(large.effect, in_sd=-40.0))
    result = replace(make_regression(), constants=(*make_regression().constants, small, large))
    names = [row.name for row in lot_view(result).rows]
    assert names.index("lq_h") < names.index("ld_h") < names.index("r_phase_ohm")
    assert [one.name for one in compared(result)] == names
    for text in (regression_text(result, ()), verdict_markdown(result).replace("\\", "")):
        places = [text.index(name) for name in ("lq_h", "ld_h")]
        assert places == sorted(places)


def test_one_why_for_equal_reasons() -> None:
    constants = [replace(one, why=HISTORY) for one in make_regression().constants]
    own = replace(make_constant("ld_h", "H", 2e-4, 2e-4, 1e-6, "pass"), why="the same")
    result = replace(make_regression(), constants=(*constants, own))
    view = lot_view(result)
    assert [(r.text, set(r.members)) for r in view.reasons] == [
        (HISTORY, {"r_phase_ohm", "cogging_amplitude_nm"})
    ]
    assert {row.name: row.shared for row in view.rows} == {
        "r_phase_ohm": 1,
        "cogging_amplitude_nm": 1,
        "ld_h": 0,
    }
    html = flat(render_regression(result))
    assert html.count(HISTORY) == 1 and "<b>2 constants</b>" in html
    assert html.count("the same</div>") == 1
    assert regression_text(result, ()).count(f"2 constants: {HISTORY}") == 1


def test_the_table_of_a_terminal_fits_eighty_columns() -> None:
    text = regression_text(make_regression(), ("out/report.html",))
    table = [line for line in text.splitlines() if line.startswith(("constant", "cogging", "r_"))]
    assert max(map(len, table)) <= 80
