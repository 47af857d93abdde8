"""A diagnosis' notes in few lines: what no test excites, by the test to record for it."""

from __future__ import annotations

from collections.abc import Sequence

from pipeline.records.diagnosis import Diagnosis, Unexcited

FEW = 3
"""So many effects that no test excites are listed in full."""


def shown_and_folded(result: Diagnosis) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Notes to show, and those on single effects that a few lines among the former stand for.

    Each effect goes with one test that would excite it, the tests that would excite most first.

    Parameters
    ----------
    result
        The diagnosis.

    """
    single = tuple(one.words for one in result.unexcited)
    if len(single) <= FEW:
        return (*result.notes, *single), ()
    head = f"no test here excites {len(single)} effects, of which nothing can be said:"
    lines = [
        f"record {_with_signals(test, mine)} to excite {', '.join(one.effect for one in mine)}"
        for test, mine in _by_test(result.unexcited).items()
    ]
    return (*result.notes, head, *lines), single


def _with_signals(test: str, unexcited: Sequence[Unexcited]) -> str:
    signals = dict.fromkeys(name for one in unexcited for name in one.signals)
    return f"{test} with {' and '.join(signals)}" if signals else test


def _by_test(unexcited: Sequence[Unexcited]) -> dict[str, list[Unexcited]]:
    """Effects by test, each once, by a greedy cover; ties go by name."""
    left, chosen = list(unexcited), {}
    while left:
        counts: dict[str, int] = {}
        for one in left:
            for test in one.tests:
                counts[test] = counts.get(test, 0) + 1
        best = min(counts, key=lambda test: (-counts[test], test))
        chosen[best] = [one for one in left if best in one.tests]
        left = [one for one in left if best not in one.tests]
    return chosen
