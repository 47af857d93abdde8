"""What a diagnosis is worth: against the truth where the captures tell it, else against its class.

A document names with confidence when its verdict is `missing`; names under `unknown` are told as
neighbours, with a remainder, and are not held against it. They count as found, since a reader is
given them, but they are no exact set. Nothing hidden is rightly answered by `adequate` alone:
captures of the whole programme suffice to say so.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from tests.benchmark.cases import OUTSIDE_VARIABLES, Case

Mark = Literal["right", "tie", "singled out", "wrong", "unknown", "missed", "failed"]
POINTS: Mapping[Mark, int] = {
    "right": 1,
    "tie": 1,
    "singled out": 0,
    "wrong": -5,
    "unknown": 0,
    "missed": 0,
    "failed": 0,
}
AT_THE_FLOOR = 1.05


@dataclass(frozen=True, slots=True)
class Judged:
    """One case's marks. Shares of a line are over the cases whose entry is not None.

    `exact`: all that is hidden named with confidence and nothing else. `found`, `hidden`: how many
    of the hidden effects were named, under `unknown` too. `flagged`: structure left over that
    matters was reported; `left`: any. `sketch`: the unknown was put down to the right variable.
    `floor`: held-out error of the last step is at most 1.05 of its floor. `slight`: of what is told
    as seen but too small to matter, whether the clearest is hidden there, or a rival that these
    captures cannot exclude; None where nothing is told.
    """

    case: Case
    mark: Mark
    exact: bool
    found: int
    hidden: int
    flagged: bool
    sketch: bool | None
    floor: bool | None
    slight: bool | None = None
    left: bool = False

    @property
    def points(self) -> int:
        """Points of the mark."""
        return POINTS[self.mark]

    @property
    def right(self) -> bool:
        """The truth, or a class that holds it."""
        return self.mark in ("right", "tie")


def judged(case: Case, document: Mapping[str, Any]) -> Judged:
    """The marks of one diagnosis."""
    if "failure" in document:
        return Judged(case, "failed", False, 0, len(case.truth), False, None, None)
    named = tuple(document["missing"])
    confused = {r["effect"]: tuple(r["confused_with"]) for r in document["ranking"]}
    hit = {t: _named_for(t, case, named, confused) for t in case.truth}
    meant = {name for name in hit.values() if name is not None}
    stray = [n for n in named if n not in meant and n not in case.allowed]
    mark = _mark(case, document["verdict"], hit, stray, confused)
    over = document.get("remainder", ())
    unknown = document["verdict"] == "unknown"
    return Judged(
        case,
        mark,
        exact=document["verdict"] == "missing" and bool(hit) and not stray and all(hit.values()),
        found=len(meant),
        hidden=len(case.truth),
        flagged=unknown or any(one["matters"] for one in over),
        sketch=_sketch(case, document),
        floor=_floor(document),
        slight=_slight(case, document),
        left=unknown or bool(over),
    )


def _named_for(
    true: str, case: Case, named: tuple[str, ...], confused: Mapping[str, tuple[str, ...]]
) -> str | None:
    """The name that stands for a hidden effect: itself, or a rival that is told to be one."""
    if true in named:
        return true
    for name in named:
        if name in case.accepted.get(true, ()) and true in confused.get(name, ()):
            return name
    return None


def _mark(
    case: Case,
    verdict: str,
    hit: Mapping[str, str | None],
    stray: list[str],
    confused: Mapping[str, tuple[str, ...]],
) -> Mark:
    if verdict == "unknown":
        return "unknown"
    if stray:
        return "wrong"
    if not case.truth:
        return "missed" if case.outside or verdict == "insufficient" else "right"
    if not all(hit.values()):
        silent = not any(hit.values())
        return "right" if silent and case.nothing else "missed"
    rivals = {t: set(case.accepted.get(t, ())) for t in case.truth}
    if any(rivals[t] and not confused.get(name or "") for t, name in hit.items()):
        return "singled out"
    return "tie" if any(rivals.values()) else "right"


def _sketch(case: Case, document: Mapping[str, Any]) -> bool | None:
    if case.outside is None or case.family != "outside":
        return None
    told = document.get("unknown") or {}
    return bool(set(told.get("variables", ())) & set(OUTSIDE_VARIABLES[case.outside]))


def _slight(case: Case, document: Mapping[str, Any]) -> bool | None:
    told = [
        ranked["effect"]
        for ranked in document["ranking"]
        if (ranked.get("size") or 1.0) < 1.0 and ranked["score"] > 0.0
    ]
    if document["verdict"] != "adequate" or not told:
        return None
    return any(told[0] in (true, *case.accepted.get(true, ())) for true in case.truth)


def _floor(document: Mapping[str, Any]) -> bool | None:
    ladder = document.get("ladder") or []
    return bool(ladder[-1]["held_out"] <= AT_THE_FLOOR) if ladder else None
