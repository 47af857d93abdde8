"""The cases of a world, and the table of what their diagnoses are worth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from tests.benchmark.worlds.case import MARKS, WorldCase, judged, marked
from tests.benchmark.worlds.recording import world

LINES = ("nothing", "typical", "third", "pair", "outside")
MOTORS = 3
THIRD = 0.3
Found = Sequence[tuple[WorldCase, Mapping[str, Any]]]


def cases(name: str, draw: int = 1) -> list[WorldCase]:
    """Every case of a world: nulls, each effect at two sizes, pairs, and what no library has; on
    three motors and stations, which are others at each `draw`. A world may draw its own.
    """
    place, found = world(name), []
    if hasattr(place, "drawn"):
        return list(place.drawn(draw))
    seeds = range(MOTORS * (draw - 1) + 1, MOTORS * draw + 1)
    for programme, effects in place.EFFECTS.items():
        found += [WorldCase(name, programme, seed) for seed in seeds]
        for k, effect in enumerate(effects):
            for size in (1.0, THIRD):
                found.append(WorldCase(name, programme, seeds[k % MOTORS], {effect: size}))
    first = next(iter(place.EFFECTS))
    for k, (one, other) in enumerate(place.PAIRS):
        found.append(WorldCase(name, first, seeds[k % MOTORS], {one: 1.0, other: 0.5}))
    for effect in place.OUTSIDE:
        found += [WorldCase(name, first, seed, {effect: 1.0}, outside=True) for seed in seeds]
    return found


def by_programme(found: Found) -> str:
    """What the answers of each programme are worth, a row a programme and one of all.

    exact: just what is hidden is named, or nothing where nothing is. partial: some of it, or all
    beside a false name. missed: called adequate or insufficient. abstained: a remainder in place of
    a name. false names: how many, over all cases. flagged: cases of nobody's library of which a
    remainder is reported.
    """
    heads = ("programme", "cases", "exact", "partial", "missed", "abstained", "false names")
    rows = ["| " + " | ".join((*heads, "flagged")) + " |", "|---" * (len(heads) + 1) + "|"]
    programmes = dict.fromkeys(case.programme for case, _ in found)
    for programme in (*programmes, "all"):
        mine = [(c, d) for c, d in found if programme in (c.programme, "all")]
        inside = [(c, d) for c, d in mine if not c.outside]
        marks = [marked(case, document) for case, document in inside]
        counts = [marks.count(mark) for mark in ("right", "half", "silent", "unsure")]
        false = sum(judged(case, document)[1] for case, document in mine if "verdict" in document)
        flagged = [marked(case, document) for case, document in mine if case.outside]
        of = f"{flagged.count('abstained right')} of {len(flagged)}"
        numbers = " | ".join(str(number) for number in (len(mine), *counts, false))
        rows.append(f"| {programme} | {numbers} | {of} |")
    return "\n".join(rows) + "\n"


def table(found: Found) -> str:
    """Marks by line, and each answer that is not right on a line of its own."""
    rows = ["| hidden | cases | " + " | ".join(MARKS) + " |", "|---" * (2 + len(MARKS)) + "|"]
    for line in (*LINES, "all"):
        marks = [marked(case, document) for case, document in found if line in (case.line, "all")]
        counts = " | ".join(str(marks.count(mark)) for mark in MARKS)
        rows.append(f"| {line} | {len(marks)} | {counts} |")
    rows += [
        "",
        "| programme | motor | hidden | mark | verdict | named |",
        "|---|---|---|---|---|---|",
    ]
    for case, document in found:
        mark = marked(case, document)
        if mark in ("right", "abstained right"):
            continue
        hidden = ", ".join(f"{size:g} {name}" for name, size in case.effects.items()) or "nothing"
        named = ", ".join(document.get("missing", ())) or document.get("failure", "nothing")
        verdict = document.get("verdict", "none")
        rows.append(f"| {case.programme} | {case.seed} | {hidden} | {mark} | {verdict} | {named} |")
    return "\n".join(rows) + "\n"


def beside(found: Mapping[str, Found]) -> str:
    """What every method found, named falsely and left open, over the cases that it has answered."""
    heads = (
        "method",
        "cases",
        "hits",
        "false names",
        "abstentions",
        "nulls quiet",
        "outside flagged",
    )
    rows = ["| " + " | ".join(heads) + " |", "|---" * len(heads) + "|"]
    for method, answers in found.items():
        if answers:
            rows.append(f"| `{method}` | {len(answers)} | " + " | ".join(_counts(answers)) + " |")
    return "\n".join(rows) + "\n"


def _counts(answers: Found) -> Sequence[str]:
    """Hits of what is hidden, false names, abstentions, quiet nulls and flagged outsiders."""
    hits = hidden = false = open_ = 0
    lines: dict[str, list[str]] = {"nothing": [], "outside": []}
    for case, document in answers:
        true, wrong = judged(case, document)
        hidden += 0 if case.outside else len(case.effects)
        hits, false = hits + true, false + wrong
        open_ += document.get("verdict") == "unknown"
        lines.setdefault(case.line, []).append(marked(case, document))
    quiet, flagged = lines["nothing"], lines["outside"]
    return (
        f"{hits} of {hidden}",
        str(false),
        str(open_),
        f"{quiet.count('right')} of {len(quiet)}",
        f"{flagged.count('abstained right')} of {len(flagged)}",
    )
