"""`python -m tests.mutants.table`: mutants of every package into `docs/mutants.md`."""

from __future__ import annotations

import argparse
import json
import re
import sys
import tempfile
from collections import Counter
from dataclasses import asdict
from pathlib import Path

from tests.mutants.operators import Mutant
from tests.mutants.packages import PACKAGES
from tests.mutants.run import TESTS_S, Outcome, judged, run
from tests.mutants.scratch import Scratch

ROOT = Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "mutants.md"
CACHE = ROOT / "reports" / "mutants"
WANTED = 0.85
SURVIVORS = "## Survivors"
ROW = re.compile(r"\| (\w+) \| (\d+) \| .*\|$")
Rows = dict[tuple[str, int], list[str]]
ABOUT = """# Do the tests see a wrong line?

`make mutants` changes one point of the code (a constant by 15 % or by one, an operator, a boundary
or a direction of a comparison, a sign, a condition, the bound of a slice), runs the tests of the
package that run the changed line, and asks whether one fails. Text, types and messages are not
changed. {count} mutants a package and seed; the same seed draws the same ones while the code stays.

*Equivalent* are mutants that no test can tell from the code, or whose difference is below what
the code promises; each was judged by a person, with the reason, in `tests/mutants/judged.yaml`. The
rate is killed / (drawn - equivalent); at least 85 % is asked. The tests of a mutant stop at
{limit:g} s of CPU time, measured under a tracer, the quickest first. A mutant that does not end
counts as killed. A seed is measured once, before tests are added because of it; what these are
worth the next seed shows, which they have not seen.

"""


def main(arguments: list[str] | None = None) -> int:
    """Runs what was asked for; the page keeps the rows of what this checkout has not measured."""
    parser = argparse.ArgumentParser(prog="python -m tests.mutants.table", description=__doc__)
    parser.add_argument("--seed", type=int, action="append", help="may be repeated; default 1, 2")
    parser.add_argument("--per-package", type=int, default=40)
    parser.add_argument("--package", action="append", choices=sorted(PACKAGES))
    parser.add_argument("--survivors", action="store_true", help="only those that survived before")
    parser.add_argument("--page", action="store_true", help="only the page, from results kept")
    chosen = parser.parse_args(arguments)
    CACHE.mkdir(parents=True, exist_ok=True)
    if not chosen.page:
        with tempfile.TemporaryDirectory(prefix="mutants-") as place:
            _measure(chosen, Path(place))
    results = {}
    for path in sorted(CACHE.glob("result-*.json")):
        name, seed = path.stem.removeprefix("result-").rsplit("-", 1)
        if outcomes := _kept(path):
            results[name, int(seed)] = outcomes
    before = PAGE.read_text(encoding="utf-8") if PAGE.exists() else ""
    PAGE.write_text(_page(results, chosen.per_package, before), encoding="utf-8")
    return 0


def _measure(chosen: argparse.Namespace, place: Path) -> None:
    scratch = Scratch(ROOT, place)
    for name in chosen.package or PACKAGES:
        for seed in chosen.seed or (1, 2):
            path = CACHE / f"result-{name}-{seed}.json"
            before = _kept(path) if chosen.survivors else []
            left = frozenset(o.mutant.key for o in before if o.verdict != "killed")
            if chosen.survivors and not left:
                continue
            outcomes = run(
                PACKAGES[name],
                scratch,
                CACHE,
                seed=seed,
                count=chosen.per_package,
                note=_say,
                only=left,
            )
            outcomes += [o for o in before if o.mutant.key not in left]
            outcomes.sort(key=lambda o: (o.mutant.path, o.mutant.start))
            path.write_text(json.dumps([asdict(o) for o in outcomes], indent=1))
            _say(f"{name} seed {seed}: {_row(name, seed, outcomes)}")


def _say(line: str) -> None:
    sys.stdout.write(f"{line}\n")
    sys.stdout.flush()


def _kept(path: Path) -> list[Outcome]:
    if not path.exists():
        return []
    kept = json.loads(path.read_text())
    return [judged(Outcome(Mutant(**o["mutant"]), o["verdict"], o["why"])) for o in kept]


def _row(name: str, seed: int, outcomes: list[Outcome]) -> str:
    count = Counter(o.verdict for o in outcomes)
    real = len(outcomes) - count["equivalent"]
    rate = count["killed"] / real if real else 1.0
    mark = "" if rate >= WANTED else " (short)"
    cells = (name, seed, len(outcomes), count["killed"], count["equivalent"], count["survived"])
    return f"| {' | '.join(map(str, cells))} | {100 * rate:.0f} %{mark} |"


def _page(results: dict[tuple[str, int], list[Outcome]], count: int, before: str) -> str:
    """The page of these results, with the rows of `before` that they do not measure again."""
    rates, survivors = _rows(before)
    for (name, seed), outcomes in results.items():
        rates[name, seed] = [_row(name, seed, outcomes)]
        alive = [o for o in outcomes if o.verdict == "survived"]
        survivors[name, seed] = [_survivor(name, seed, outcome) for outcome in alive]
    order = {name: place for place, name in enumerate(PACKAGES)}
    keys = sorted((k for k in rates if k[0] in order), key=lambda k: (order[k[0]], k[1]))
    lines = [ABOUT.format(count=count, limit=TESTS_S)]
    lines.append("| package | seed | drawn | killed | equivalent | survived | rate |\n")
    lines.append("| --- | --: | --: | --: | --: | --: | --: |\n")
    lines += [f"{line}\n" for key in keys for line in rates[key]]
    lines.append(f"\n{SURVIVORS}\n\n| package | seed | where | change | why |\n")
    lines.append("| --- | --: | --- | --- | --- |\n")
    lines += [f"{line}\n" for key in keys for line in survivors.get(key, [])]
    return "".join(lines)


def _rows(page: str) -> tuple[Rows, Rows]:
    """The rows of both tables of a page, by package and seed."""
    tables: tuple[Rows, Rows] = ({}, {})
    for rows, text in zip(tables, page.split(SURVIVORS), strict=False):
        for line in text.splitlines():
            if match := ROW.match(line):
                rows.setdefault((match[1], int(match[2])), []).append(line)
    return tables


def _survivor(name: str, seed: int, outcome: Outcome) -> str:
    mutant = outcome.mutant
    where = f"`{mutant.path.removeprefix('pipeline/')}` `{mutant.function}`"
    change = f"`{_cell(mutant.before)}` to `{_cell(mutant.after)}`"
    return f"| {name} | {seed} | {where} | {change} | {outcome.why} |"


def _cell(text: str) -> str:
    line = " ".join(text.split()).replace("|", "\\|").replace("`", "'")
    return line if len(line) <= 70 else f"{line[:67]}..."


if __name__ == "__main__":
    sys.exit(main())
