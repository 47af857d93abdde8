"""What motors show, lot against lot: the words fit the counts."""

from __future__ import annotations

import pytest

from pipeline.lots.traits import Shown, compare_traits


def shown(side: str, motors: int, having: int) -> list[Shown]:
    sizes = [{"check resistance_balance": None} if k < having else {} for k in range(motors)]
    return [Shown(f"{side}-{k}", side, side, one) for k, one in enumerate(sizes)]


@pytest.mark.parametrize(
    ("before", "after", "verdict", "words"),
    [
        ((3, 0), (3, 1), "pass", "in more motors than before, which may be chance: 1 of 3"),
        ((3, 1), (3, 1), "pass", "as before: 1 of 3"),
        ((2, 1), (4, 2), "pass", "as before: 2 of 4"),
        ((4, 2), (4, 1), "pass", "in fewer motors than before, which may be chance: 1 of 4"),
        ((3, 1), (3, 0), "pass", "no longer there, which may be chance: 0 of 3"),
        ((12, 12), (12, 0), "marginal", "no longer there: 0 of 12"),
        ((12, 12), (12, 2), "marginal", "in fewer motors than before: 2 of 12"),
        ((12, 0), (12, 12), "fail", "new in this lot: 12 of 12"),
    ],
)
def test_a_change_is_told_as_the_counts_have_it(
    before: tuple[int, int], after: tuple[int, int], verdict: str, words: str
) -> None:
    groups = [*shown("baseline", *before), *shown("candidate", *after)]
    (change,) = compare_traits(groups, "datasheet")
    assert change.verdict == verdict
    assert change.why.startswith(words)
