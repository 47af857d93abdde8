"""A diagnosis' notes in few lines: what no test excites, by the test to record for it."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence

_UNSEEN = re.compile(r"no test here excites (\w+): record ([\w ]+?) \(.*\)", re.DOTALL)
FEW = 3
"""So many effects that no test excites are told in full."""


def told_and_unseen(notes: Sequence[str]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Notes to tell, and those on single effects that a few lines among the former stand for.

    Each effect goes with one test that would excite it, the tests that would excite most first.
    """
    unseen = {m[1]: tuple(m[2].split(" or ")) for note in notes if (m := _UNSEEN.fullmatch(note))}
    if len(unseen) <= FEW:
        return tuple(notes), ()
    single = tuple(note for note in notes if _UNSEEN.fullmatch(note))
    lines = [
        f"record {test} to excite {', '.join(effects)}"
        for test, effects in _by_test(unseen).items()
    ]
    head = f"no test here excites {len(unseen)} effects, of which nothing can be said:"
    return (*(note for note in notes if note not in single), head, *lines), single


def _by_test(unseen: Mapping[str, Sequence[str]]) -> dict[str, list[str]]:
    """Effects by test, each once, by a greedy cover; ties go by name."""
    left, chosen = dict(unseen), {}
    while left:
        counts: dict[str, int] = {}
        for tests in left.values():
            for test in tests:
                counts[test] = counts.get(test, 0) + 1
        best = min(counts, key=lambda test: (-counts[test], test))
        chosen[best] = [effect for effect, tests in left.items() if best in tests]
        left = {effect: tests for effect, tests in left.items() if best not in tests}
    return chosen
