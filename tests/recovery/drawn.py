"""Published constants of benches that nobody chose, against what is true of their motors.

Motors, stations, plans and what is lost of the logs are those of the world `drawn`, of sound motors
alone: what is hidden in others is no error of an estimator.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context

from scipy.stats import binomtest, t

from pipeline import Recordings, check, fit
from pipeline.simulator.bench import truth
from tests.benchmark.worlds.case import WorldCase
from tests.benchmark.worlds.with_drawn import campaign, draw_of, drawn


@dataclass(frozen=True, slots=True)
class Published:
    """A constant of a datasheet: where it is from, its error over u, and the chance of that."""

    case: str
    constant: str
    method: str
    error_u: float
    relative: float
    chance: float


def published(case: WorldCase) -> list[Published]:
    """Every constant of a case's datasheet that the truth knows and that is no whole number."""
    found, draw = campaign(case), draw_of(case)
    if not found.captures:
        return []
    true = truth(draw.motor)["constants"]
    sheet = check(fit(Recordings({found.motor_id: found})), model=None)[found.motor_id]
    where = f"{case.programme} {case.seed}, {draw.kind}"
    return [
        Published(
            where,
            name,
            one.method,
            (one.number - true[name]) / one.u,
            one.number / true[name] - 1.0 if true[name] else float("nan"),
            2.0 * float(t.sf(abs(one.number - true[name]) / one.u, one.dof)),
        )
        for name, one in sheet.constants.items()
        if one.known and one.u > 0.0 and true.get(name) is not None
    ]


def sound(draws: Sequence[int]) -> Iterator[WorldCase]:
    """The cases with nothing hidden."""
    return (case for draw in draws for case in drawn(draw) if not case.effects)


def table(found: Sequence[Published]) -> str:
    """A line a constant, then every value that chance explains once in a thousand times."""
    lines = ["| constant | values | beyond 95 % | beyond 99.9 % |", "|---" * 4 + "|"]
    for name in (*sorted({one.constant for one in found}), ""):
        mine = [one for one in found if one.constant == name or not name]
        beyond, far = (sum(one.chance < level for one in mine) for level in (0.05, 0.001))
        low, high = binomtest(beyond, len(mine)).proportion_ci(0.99)
        share = f"{beyond / len(mine):.3f} ({low:.3f} to {high:.3f})"
        lines.append(f"| {name or 'all'} | {len(mine)} | {share} | {far} |")
    lines += ["", "| case | constant | method | error / u | error |", "|---" * 5 + "|"]
    for one in sorted(found, key=lambda one: one.chance):
        if one.chance < 0.001:
            error = f"{one.error_u:+.1f} | {one.relative:+.2%}"
            lines.append(f"| {one.case} | {one.constant} | {one.method} | {error} |")
    return "\n".join(lines) + "\n"


def main(arguments: Sequence[str]) -> int:
    """Prints the table of some draws."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--first", type=int, default=1, help="of the draws")
    parser.add_argument("--last", type=int, default=10)
    parser.add_argument("--workers", type=int, default=2)
    chosen = parser.parse_args(arguments)
    cases = list(sound(range(chosen.first, chosen.last + 1)))
    with ProcessPoolExecutor(chosen.workers, get_context("spawn")) as pool:
        found = [one for rows in pool.map(published, cases) for one in rows]
    sys.stdout.write(table(found))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
