"""Draws the mutants of a package, runs the tests that cover them, and keeps what came out."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import yaml

from tests.mutants import coverage
from tests.mutants.operators import Mutant, draw, find
from tests.mutants.packages import Package
from tests.mutants.scratch import Scratch

JUDGED = Path(__file__).parent / "judged.yaml"
# CPU seconds of tests a mutant, as measured under the tracer, which is several times slower.
TESTS_S = 15.0
# A mutant may take this much more CPU time, and three times its tests; then it is a loop.
LEAST_CPU_S = 20.0


@dataclass(frozen=True, slots=True)
class Outcome:
    """`killed`, `equivalent` or `survived`; `why` is the test that failed, or the judgement."""

    mutant: Mutant
    verdict: str
    why: str


def judgements() -> dict[str, dict[str, str]]:
    """By key: `verdict` is `equivalent` or `survived`; `why` is the reason in a few words."""
    return yaml.safe_load(JUDGED.read_text(encoding="utf-8")) or {}


def judged(outcome: Outcome) -> Outcome:
    """What a person said of a mutant that no test killed."""
    said = judgements().get(outcome.mutant.key)
    if outcome.verdict == "killed" or said is None:
        return outcome
    return Outcome(outcome.mutant, said["verdict"], said["why"])


def drawn(package: Package, root: Path, seed: int, count: int) -> list[Mutant]:
    """The mutants of a package that a seed draws."""
    mutants = [
        mutant
        for path in package.files(root)
        for mutant in find(path.read_text(encoding="utf-8"), path.relative_to(root).as_posix())
    ]
    return draw(mutants, seed, count)


def run(
    package: Package,
    scratch: Scratch,
    cache: Path,
    *,
    seed: int,
    count: int,
    note: Callable[[str], object],
    only: frozenset[str] = frozenset(),
) -> list[Outcome]:
    """Every drawn mutant of a package with its verdict.

    A mutant that was judged equivalent is run all the same: a test that fails shows that the
    judgement was wrong.
    """
    covered = coverage.measure(scratch, package, cache)
    for test in sorted(covered.failed):
        note(f"{package.name}: fails without a change, left out: {test}")
    killers = _read(cache / "killers.json")
    outcomes = []
    for mutant in drawn(package, scratch.tree, seed, count):
        if only and mutant.key not in only:
            continue
        verdict, why = attempt(mutant, scratch, covered, killers.get(mutant.key, ""))
        if verdict == "killed":
            killers[mutant.key] = why
        outcomes.append(judged(Outcome(mutant, verdict, why)))
        note(f"{mutant.key} {verdict:10} {mutant.path}:{mutant.line} {mutant.kind} {why}")
        note(f"    {_short(mutant.before)}  ->  {_short(mutant.after)}")
        _write(cache / "killers.json", killers)
    return outcomes


def attempt(
    mutant: Mutant, scratch: Scratch, covered: coverage.Coverage, killer: str
) -> tuple[str, str]:
    """(`killed` or `survived`, the test that failed)."""
    tests = covered.order(covered.of(mutant, scratch.tree), TESTS_S)
    if not tests:
        return "survived", "no test runs it"
    if killer in tests:
        tests = [killer, *(t for t in tests if t != killer)]
    cpu_s = LEAST_CPU_S + 3.0 * sum(covered.seconds[t] for t in tests)
    source = (scratch.tree / mutant.path).read_text(encoding="utf-8")
    scratch.change(mutant.path, mutant.apply(source))
    try:
        result, first = scratch.run(tests, cpu_s)
    finally:
        scratch.change(mutant.path, None)
    if result == "passed":
        return "survived", ""
    return "killed", first or result


def _short(text: str) -> str:
    line = " ".join(text.split())
    return line if len(line) <= 90 else f"{line[:87]}..."


def _read(path: Path) -> dict[str, str]:
    return json.loads(path.read_text()) if path.exists() else {}


def _write(path: Path, value: dict[str, str]) -> None:
    path.write_text(json.dumps(value, indent=0, sort_keys=True))
